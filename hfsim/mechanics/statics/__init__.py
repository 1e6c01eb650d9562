"""Equilibrium of a system: the problem, ways to solve it, and whether what is found is stable."""
