"""The energy of elements in nodal components, and the laws that it obeys whatever the element."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from analytical import jacobian

from hfsim.maths.arrays import component_rows


def gradient_of(law, V):
    """dU/dV: what a law pulls in rows, of the shape (..., n_elements, n_vectors, n_dim) of V again."""
    *elements, vectors, n_dim = V.shape
    return law.pull(component_rows(V)).reshape(vectors, n_dim, *reversed(elements)).swapaxes(0, 1).T


class Energy(NamedTuple):
    """Energy, gradient and Hessian of a law in nodal components (n_batch, n), summed over elements."""

    law: Any
    differences: np.ndarray
    """From the nodal vectors to those of the law, (n_elements, n_vectors, n_nodal)."""
    n_dim: int

    def _vectors(self, p):
        return self.differences @ p.reshape(len(p), 1, -1, self.n_dim)

    def energy(self, p):
        return self.law.energy(self._vectors(p)).sum(axis=1)

    def gradient(self, p):
        own = gradient_of(self.law, self._vectors(p))
        return np.einsum("ean,beai->bni", self.differences, own).reshape(len(p), -1)

    def hessian(self, p):
        H = self.law.hessian(self._vectors(p))
        wide = np.array([np.kron(D, np.eye(self.n_dim)) for D in self.differences])
        return np.einsum("eam,beac,ecn->bmn", wide, H, wide, optimize=True)


def check_slopes(law, p):
    """The gradient at p (n,) is the slope of the energy, the Hessian that of the gradient, and symmetric."""
    slope, force = jacobian(law.energy, p), law.gradient(p[None])[0]
    assert force == pytest.approx(slope, rel=1e-9, abs=1e-9 * np.abs(slope).max())
    H, slopes = law.hessian(p[None])[0], jacobian(law.gradient, p)
    assert np.abs(H - slopes).max() < 1e-8 * np.abs(H).max()
    assert np.abs(H - H.T).max() < 1e-13 * np.abs(H).max()


def check_moved(law, P, positions, R, shift):
    """Nodal vectors P (n, n_dim) turned by R and shifted: energy is kept, and forces turn and balance."""
    n_dim, moved = P.shape[1], P @ R.T + positions[:, None] * shift
    here, there = P.reshape(1, -1), moved.reshape(1, -1)
    assert law.energy(there) == pytest.approx(law.energy(here), rel=1e-12)
    force = law.gradient(here).reshape(-1, n_dim)
    assert law.gradient(there).reshape(-1, n_dim) @ R == pytest.approx(force, abs=1e-11 * np.abs(force).max())
    moments = P.T @ force
    assert moments == pytest.approx(moments.T, abs=1e-11 * np.abs(force).max())


def check_undeformed(law, P, positions, turns, rng):
    """Undeformed nodal vectors P (n, n_dim) store nothing wherever they are, and only in rigid motions."""
    n_dim = P.shape[1]
    H = law.hessian(P.reshape(1, -1))[0]
    for turn in turns:
        moved = (P @ turn.T + positions[:, None] * rng.normal(size=n_dim)).reshape(1, -1)
        assert abs(law.energy(moved)[0]) < 1e-14 * np.abs(H).max()
        assert np.abs(law.gradient(moved)).max() < 1e-12 * np.abs(H).max()
    sizes, free = np.linalg.eigvalsh(H), n_dim * (n_dim + 1) // 2
    assert np.abs(sizes[:free]).max() < 1e-11 * sizes[-1]
    assert sizes[free] > 1e-8 * sizes[-1]


def check_joined(join, laws, V):
    """Two laws, the first of two elements, act joined as alone on V (n_elements, n_vectors, n_dim)."""
    joined = join(laws)
    for told in (lambda law, V: law.energy(V), gradient_of, lambda law, V: law.hessian(V)):
        both = np.concatenate([told(laws[0], V[None, :2]), told(laws[1], V[None, 2:])], axis=1)
        assert np.abs(told(joined, V[None]) - both).max() < 1e-12 * np.abs(both).max()
