"""All steps of a problem by a method, without a deck."""

from hfsim.integrators import Stepping


def integrate(problem, method, start, t_end, limits, watch):
    """All kept steps as a trajectory, and what ended them early, if anything; the arguments of `Stepping`."""
    stepping = Stepping(problem, method, start, t_end, limits, watch)
    for _ in stepping:
        pass
    return stepping.path, stepping.stop
