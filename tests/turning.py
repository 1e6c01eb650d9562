"""Small motions about scenes that turn steadily: in the frame that turns all coefficients are constant."""

import numpy as np

from hfsim.maths.matrices import assemble, dense
from hfsim.maths.rotations import skew

CONVERGED = 1e-9


class Turning:
    """A scene whose coordinates are vectors, turning about the origin at an angular velocity (3,)."""

    def __init__(self, scene, spin):
        self.system = scene.system
        self.equations, self.t = self.system.equations, np.zeros(1)
        self.M = dense(self.equations.constant_mass)
        n = len(self.M) // 3
        self.W = np.kron(np.eye(n), skew(np.asarray(spin)))
        self.basis = dense(self.equations.reduction.basis)
        z, multipliers = scene.q[None], np.zeros((1, self.system.n_rows))
        for _ in range(60):
            x = self.system.absolute(z)
            K, J = self._slopes(x, multipliers)
            force = self.system.force(self.t, x, x @ self.W.T) - x @ (self.M @ self.W @ self.W).T
            left = (force @ self.basis - multipliers @ J)[0]
            gap = self.equations.phi.residual(self.t, x)[0]
            step = np.linalg.solve(np.block([[K, J.T], [J, np.zeros((len(J), len(J)))]]), np.r_[left, -gap])
            z, multipliers = z + step[: K.shape[0]], multipliers + step[K.shape[0] :]
            if np.abs(step[: K.shape[0]]).max() < CONVERGED * max(1.0, np.abs(z).max()):
                break
        else:
            raise AssertionError("no steady state")
        self.x, self.multipliers = self.system.absolute(z), multipliers

    def _slopes(self, x, multipliers):
        """Return stiffness with that of the centrifugal forces, and the slopes of the joints."""
        parts = [part.tangent(self.t, x, 0.0 * x) for part in self.system.forces]
        parts += self.equations.phi.stiffness(x, multipliers)
        K = assemble(parts, (self.system.n_x, self.system.n_x), False) + self.M @ self.W @ self.W
        J = dense(self.equations.phi.jacobian_at(x))
        return self.basis.T @ K @ self.basis, J @ self.basis

    def frequencies(self, near):
        """Return the circular frequencies [rad/s] by their distance to one.

        Joints stay equations of their own: in a basis of the motions that they allow, what is stiff would be
        mixed with what is not.
        """
        K, J = self._slopes(self.x, self.multipliers)
        M, G = (self.basis.T @ matrix @ self.basis for matrix in (self.M, 2.0 * self.M @ self.W))
        n, m = len(K), len(J)
        left, right = np.zeros((2, 2 * n + m, 2 * n + m))
        left[:n, :n], left[n : 2 * n, n : 2 * n] = np.eye(n), M
        right[:n, n : 2 * n] = np.eye(n)
        right[n : 2 * n] = np.hstack([-K, -G, -J.T])
        right[2 * n :, :n] = J
        shift = 1.01j * near
        closeness = np.linalg.eigvals(np.linalg.solve(right - shift * left, left))
        found = shift + 1.0 / closeness[np.abs(closeness) > 1e-9 / abs(shift)]
        return found.imag[np.argsort(np.abs(found - shift))]
