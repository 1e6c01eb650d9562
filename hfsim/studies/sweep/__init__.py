"""Many runs of one deck: a grid, a sample or a table of values of its entries, a row for each run."""
