"""Mathematics that knows nothing of mechanics: arrays, matrices, rotations, shape functions."""
