"""Scenes that turn steadily about the vertical through the origin, by the code that modes are found with."""

from dataclasses import replace

import numpy as np

from hfsim.maths.eigenpairs import eigenpairs
from hfsim.maths.matrices import dense, is_sparse
from hfsim.mechanics.small_motions import small_motions
from hfsim.mechanics.turning import Turning as Axes
from hfsim.scene.nearby import nearby


class Turning:
    """A scene in steady rotation at an angular velocity (3,)."""

    def __init__(self, scene, spin):
        system = scene.system
        sparse = is_sparse(system.equations.constant_mass)
        axes = Axes.of(scene.bodies.values(), spin, np.zeros(3), sparse)
        self.W = dense(axes.matrix)
        x = nearby(scene, 0.0, system.absolute(scene.q[None])[0], axes)
        self.x = x[None]
        turning = axes if np.any(spin) else None
        self._motions = small_motions(system, 0.0, x, axes.rates(self.x)[0], turning)

    def frequencies(self, near):
        """Return the circular frequencies without their damping [rad/s] by their distance to one."""
        pencil = self._motions.pencil
        gyroscopic = 0.5 * (pencil.velocity - pencil.velocity.T)
        found = eigenpairs(replace(pencil, velocity=gyroscopic), 60).values.imag
        return found[np.argsort(np.abs(found - near))]
