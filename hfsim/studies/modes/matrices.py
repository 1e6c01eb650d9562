"""The matrices of small motions for other programs, with names of all coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np

from hfsim.maths.arrays import Array
from hfsim.maths.matrices import Matrix, is_sparse
from hfsim.mechanics.body import Body, VectorBody
from hfsim.studies.modes.found import Modes

_INDEPENDENT = 1e-6
"""Part of a shape that must be its own to count beside others."""


def matrices_of(found: Modes) -> dict[str, Any]:
    """Return arrays by names, as ``modes --matrices`` writes them.

    Sparse matrices are three arrays: ``K.row``, ``K.column``, ``K.value``.
    """
    motions, scene = found.about.motions, found.about.scene
    V = motions.velocity
    parts = {
        "M": motions.mass,
        "C": 0.5 * (V + V.T),
        "G": 0.5 * (V - V.T),
        "K": motions.stiffness,
        "J": motions.jacobian,
        "basis": motions.basis,
    }
    arrays: dict[str, Any] = {}
    for name, matrix in parts.items():
        arrays.update(_entries(name, matrix) if is_sparse(matrix) else {name: np.asarray(matrix)})
    every = [name for body in scene.bodies.values() for name in _names(body)]
    reduction = scene.system.reduction
    T, A = reduced(found)
    return arrays | {
        "shape": np.array(motions.mass.shape),
        "x": motions.x,
        "u": motions.u,
        "names": np.array(every),
        "free_names": np.array([every[row] for row in reduction.rows]),
        "eigenvalues": np.array([mode.value for mode in found.modes]),
        "shapes": np.array([mode.change for mode in found.modes]).T,
        "T": T,
        "A": A,
        "B": np.concatenate([np.zeros_like(T.T), T.T]),
    }


def reduced(found: Modes) -> tuple[Array, Array]:
    """Return shapes T (n_x, r) and the state matrix A (2 r, 2 r) of the modes that were asked for.

    Changes of the absolute coordinates are T h, and (h, h')' = A (h, h') + (0, T^T f) with forces f on these;
    shapes are of unit mass. The eigenvalues of A include those of the modes.
    """
    motions = found.about.motions
    free = np.array([mode.change for mode in found.modes]).reshape(-1, motions.x.size).T
    both = np.hstack([free.real, free.imag])
    momentum = found.about.scene.system.equations.momentum
    gram = both.T @ momentum(motions.x[None], both.T).T
    scale = np.sqrt(np.diagonal(gram))
    kept = scale > _INDEPENDENT * scale.max(initial=0.0)
    sizes, axes = np.linalg.eigh(gram[np.ix_(kept, kept)] / np.outer(scale[kept], scale[kept]))
    own = sizes > _INDEPENDENT**2 * sizes.max(initial=0.0)
    T = (both[:, kept] / scale[kept]) @ (axes[:, own] / np.sqrt(sizes[own]))
    # back to the free coordinates, in which the matrices are
    Z = found.about.scene.system.reduction.free_rates(T.T).T
    K, V = (Z.T @ (matrix @ Z) for matrix in (motions.stiffness, motions.velocity))
    r = T.shape[1]
    return T, np.block([[np.zeros((r, r)), np.eye(r)], [-K, -V]])


def _entries(name: str, matrix: Matrix) -> dict[str, Array]:
    found = matrix.tocoo()
    return {f"{name}.row": found.row, f"{name}.column": found.col, f"{name}.value": found.data}


def _names(body: Body) -> list[str]:
    """Return what the coordinates of a body are called: body, number of the vector and component."""
    count = body.columns.stop - body.columns.start
    if isinstance(body, VectorBody):
        axes = "xyz"[: body.n_dim]
        return [f"{body.name}.{k // len(axes)}.{axes[k % len(axes)]}" for k in range(count)]
    own = ["x", "y", "angle", *(f"p{k}" for k in range(max(0, count - 3)))]
    return [f"{body.name}.{name}" for name in own[:count]]
