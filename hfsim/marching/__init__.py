"""From an assembled scene to a trajectory, and what watches over it."""
