"""Studies: loops over `hfsim.simulate` and the pure functions that judge their results."""
