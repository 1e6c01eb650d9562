"""Points in space as a drawing of lines: the edges of what they enclose, drawn in one go."""

from __future__ import annotations

import numpy as np

from hfsim.maths.arrays import Array

_FLAT = 1e-9
"""Extent, over the largest, below which points lie in a plane, on a line or at one place."""

_LEVEL = 1e-6
"""Difference of unit normals from which two triangles do not lie in one face."""


def wire(points: Array) -> list[int]:
    """Return which points to join one after the other to draw the edges of their convex hull.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        One at least.

    Returns
    -------
    list of int
        On a line from one end to the other, in a plane once around; else along all edges, some of them twice.
        Points inside are not among them.

    Examples
    --------
    >>> wire(np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0]]))
    [0, 2, 1]
    >>> wire(np.array([[0.0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]]))
    [0, 2, 1, 3, 0]
    """
    middle = points - points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(middle, full_matrices=False)
    rank = int(np.sum(sizes > _FLAT * max(sizes[0], np.finfo(float).tiny)))
    if rank == 0:
        return [0]
    if rank == 1:
        order = list(map(int, np.argsort(middle @ axes[0], kind="stable")))
        return order if order[0] < order[-1] else order[::-1]
    return _trail(_edges(middle @ axes[:rank].T))


def _edges(points: Array) -> list[tuple[int, int]]:
    """Return the edges of the convex hull of points (n, 2) or (n, 3) that span their space."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    found = set[tuple[int, int]]()
    for facet, normal, neighbours in zip(hull.simplices, hull.equations, hull.neighbors, strict=True):
        if points.shape[1] == 2:
            found.add((min(facet), max(facet)))
            continue
        for k, beyond in enumerate(neighbours):  # the k-th one shares all corners but the k-th
            if np.abs(normal - hull.equations[beyond])[:3].max() > _LEVEL:
                a, b = np.delete(facet, k)
                found.add((min(a, b), max(a, b)))
    return sorted((int(a), int(b)) for a, b in found)


def _trail(edges: list[tuple[int, int]]) -> list[int]:
    """Return a walk along all edges of a connected graph, from its first point on."""
    ways: dict[int, list[int]] = {}
    for a, b in edges:
        ways.setdefault(a, []).append(b)
        ways.setdefault(b, []).append(a)
    left = {frozenset(edge) for edge in edges}
    walk = [min(ways)]
    while left:
        path = _to_the_next(walk[-1], ways, left)
        left -= {frozenset(path[-2:])}
        walk += path[1:]
    return walk


def _to_the_next(start: int, ways: dict[int, list[int]], left: set[frozenset[int]]) -> list[int]:
    """Return the shortest path from a point whose last edge is one of those left."""
    paths, seen = [[start]], {start}
    for path in paths:
        for beyond in ways[path[-1]]:
            if frozenset((path[-1], beyond)) in left:
                return [*path, beyond]
            if beyond not in seen:
                seen.add(beyond)
                paths.append([*path, beyond])
    raise AssertionError("the edges are not connected")
