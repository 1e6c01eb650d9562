"""The system: coordinates, forces and equations of a scene put together (paper, section 4).

Three sets of coordinates. The *state* q, v = q' is what is integrated. Where a model steps in hybrid
coordinates, charts turn it into the *free* coordinates z; else it is z itself. These determine the *absolute*
coordinates x of all bodies (`hfsim.mechanics.reduction`), in which the mass matrix of most is constant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.maths.arrays import Array
from hfsim.maths.frozen import frozen
from hfsim.maths.matrices import Entries, Matrix, assemble, complement, is_sparse, positive
from hfsim.maths.traced import apart
from hfsim.mechanics.chart import Chart
from hfsim.mechanics.constraints import Constraint
from hfsim.mechanics.equations import Equations
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.increments import NaturalIncrements
from hfsim.mechanics.linearized import Linearized
from hfsim.mechanics.many_forces import ManyForces
from hfsim.mechanics.nets import knotted
from hfsim.mechanics.projection import Projection, Through, directly
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.subset import parted
from hfsim.mechanics.variable_mass import VariableMass

if TYPE_CHECKING:
    from hfsim.deck.laws import Law
    from hfsim.mechanics.carried import CarriedIncrements


@frozen
class System:
    """Everything that the equations of motion of a scene are made of.

    Attributes
    ----------
    charts : tuple of Chart
        Where state and free coordinates differ.
    natural : NaturalIncrements, CarriedIncrements or None
        Coordinates for Newton corrections; None where the state's own serve.
    keeps_rates, keeps_work : bool
        Compute rates and the power put in even where they are not needed.
    redundant : tuple of Constraint
        What has no multipliers: others hold it already.
    """

    charts: tuple[Chart, ...]
    forces: tuple[ForcePart, ...]
    equations: Equations
    natural: NaturalIncrements | CarriedIncrements | None
    keeps_rates: bool = False
    keeps_work: bool = False
    redundant: tuple[Constraint, ...] = ()

    @property
    def n(self) -> int:
        """Number of coordinates of the state."""
        return self.equations.n

    @property
    def n_rows(self) -> int:
        """Number of constraint equations that need multipliers."""
        return self.equations.n_rows

    @property
    def n_x(self) -> int:
        """Number of absolute coordinates."""
        return len(self.reduction.offset)

    @property
    def reduction(self) -> Reduction:
        """The map from free to absolute coordinates."""
        return self.equations.reduction

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """All constraints, those included that the free coordinates fulfil by themselves."""
        return self.equations.all_constraints

    @property
    def variable_mass(self) -> tuple[VariableMass, ...]:
        """Bodies whose mass matrix depends on their coordinates."""
        return self.equations.variable_mass

    @cached_property
    def unreduced(self) -> Equations:
        """The equations of all coordinates with all constraints: what reactions are computed from."""
        if not self.reduction.eliminated:
            return self.equations
        nothing = Reduction.nothing(self.n_x, is_sparse(self.equations.constant_mass))
        return replace(self.equations, reduction=nothing)

    # ------------------------------------------------------------------ coordinates

    def frames(self, q: Array) -> list[Any]:
        """Return the body frames of each chart; what the maps below have in common."""
        return [chart.frames(q) for chart in self.charts]

    def arranged(self, q: Array) -> Array:
        """Return the state in the places of x, shape (n_batch, n_x): as it is, so relative in body frames."""
        return self.reduction.expand(q)

    def absolute(self, q: Array, frames: list[Any] | None = None) -> Array:
        """Return the absolute coordinates x(q), shape (n_batch, n_x)."""
        frames = self.frames(q) if frames is None else frames
        z = self._charted(q, [c.absolute(f) for c, f in zip(self.charts, frames, strict=True)])
        return self.reduction.expand(z)

    def absolute_velocity(self, q: Array, v: Array, frames: list[Any] | None = None) -> Array:
        """Return the rates of the absolute coordinates."""
        frames = self.frames(q) if frames is None else frames
        w = self._charted(v, [c.absolute_velocity(f, v) for c, f in zip(self.charts, frames, strict=True)])
        return self.reduction.expand_rates(w)

    def state_acceleration(self, frames: list[Any], v: Array, az: Array) -> Array:
        """Return q'' that belongs to accelerations of the free coordinates."""
        parts = zip(self.charts, frames, strict=True)
        return self._charted(az, [c.relative_acceleration(f, v, az) for c, f in parts])

    def state(self, x: Array, u: Array, near: Array) -> tuple[Array, Array]:
        """Return (q, v) of absolute coordinates and rates; frame angles are taken near those of ``near``."""
        z, w = self.reduction.free(x), self.reduction.free_rates(u)
        q = self._charted(z, [chart.hybrid(z, near) for chart in self.charts])
        frames = self.frames(q)
        v = self._charted(w, [c.hybrid_velocity(f, w) for c, f in zip(self.charts, frames, strict=True)])
        return q, v

    def _charted(self, given: Array, blocks: list[Array]) -> Array:
        """Return ``given`` with the columns of the charts replaced."""
        if not blocks:
            return given
        if blocks[0].shape == given.shape:
            return blocks[0]
        out = given.copy()
        for chart, block in zip(self.charts, blocks, strict=True):
            out[:, chart.columns] = block
        return out

    # ------------------------------------------------------------------ forces and energies

    @cached_property
    def uses_rates(self) -> bool:
        """Whether forces or constraints need the rates u."""
        return self.keeps_rates or any(f.uses_rates for f in self.forces) or not self.equations.phi.constant

    @cached_property
    def dissipates(self) -> bool:
        """Whether stiff methods need the derivative of the forces by the rates."""
        return any(f.dissipates for f in self.forces)

    @cached_property
    def exchanges_power(self) -> bool:
        """Whether energy can enter or leave by loads, dampers, drivers; or power is computed all the same."""
        return any(f.exchanges_power for f in self.forces) or self.driven or self.keeps_work

    @cached_property
    def driven(self) -> bool:
        """Whether laws of time move joints."""
        return any(c.driven for c in self.constraints)

    @property
    def _laws(self) -> Iterator[tuple[Law, int]]:
        """Yield each law of time with the order of the derivative by which it acts."""
        yield from ((law, 0) for part in self.forces for law in part.laws)
        yield from ((c.law, 2) for c in self.constraints if c.law is not None)

    def breaks(self, t_end: float) -> Array:
        """Return the times until the end at which steps have to end [s], sorted: of all laws and events."""
        events = [one.time for part in self.forces for one in part.events if 0.0 < one.time < t_end]
        return np.sort(np.concatenate([events, *(law.breaks(k, t_end) for law, k in self._laws)]))

    def period(self, begin: float, end: float, t_end: float) -> float:
        """Return the shortest oscillation of a law between two times of a run until ``t_end`` [s]."""
        return min((law.period(begin, end, t_end) for law, _ in self._laws), default=np.inf)

    @cached_property
    def together(self) -> tuple[ForcePart, ...]:
        """The forces, with those called together that can be."""
        return knotted(self.forces, self.n_x)

    def force(self, t: Array, x: Array, u: Array) -> Array:
        """Return the generalised force of all parts, shape (n_batch, n_x)."""
        f = np.zeros_like(x)
        for part in self.together:
            apart(part.add_force, t, x, u, f)
        return f

    def kinetic_energy(self, x: Array, u: Array) -> Array:
        """Return the kinetic energy [J], shape (n_batch,)."""
        return self.equations.kinetic_energy(x, u)

    def strain_energy(self, x: Array) -> Array:
        """Return the strain energy of all bodies [J], shape (n_batch,)."""
        return np.asarray(sum((f.strain_energy(x) for f in self.forces), np.zeros(len(x))))

    def potential_energy(self, t: Array, x: Array) -> Array:
        """Return the energy of weight and springs [J], shape (n_batch,)."""
        return np.asarray(sum((f.potential_energy(t, x) for f in self.together), np.zeros(len(x))))

    def power(
        self, t: Array, x: Array, u: Array, solve: Callable[..., tuple[Array, Array]] | None = None
    ) -> Array:
        """Return the power put in by loads, dampers and drivers [W], shape (n_batch,).

        What solves the equations of motion may be stated; see `Equations.solve`.
        """
        power = np.asarray(sum((f.power(t, x, u) for f in self.together), np.zeros(len(x))))
        if self.driven:
            multipliers = (solve or self.equations.solve)(t, x, u, self.force(t, x, u))[1]
            power += np.sum(multipliers * self.equations.phi.rate(t), axis=-1)
        return power

    def solved(self, t: Array, x: Array, u: Array) -> tuple[Array, Array]:
        """Return x'', (n_batch, n_x), and multipliers of constraints, (n_batch, n_rows of `unreduced`)."""
        a, multipliers = self.unreduced.solve(t, x, u, self.force(t, x, u))
        return self.unreduced.reduction.expand_rates(a), multipliers

    def residual(self, t: Array, x: Array) -> Array:
        """Return Phi of all constraints: rows of `unreduced`, then redundant ones, shape (n_batch, ...)."""
        return np.hstack([one.phi.residual(t, x) for one in self.monitored])

    def drift(self, t: Array, x: Array, u: Array) -> Array:
        """Return Phi' of all constraints, as `residual`."""
        return np.hstack([one.phi.drift(t, x, u) for one in self.monitored])

    @cached_property
    def monitored(self) -> tuple[Equations, ...]:
        """`unreduced`, then redundant constraints if there are any: whose rows `residual` has."""
        own = self.unreduced
        return (own, replace(own, all_constraints=self.redundant)) if self.redundant else (own,)

    def without(self, rows: Mapping[int, Sequence[int]]) -> System:
        """Return the same system without some rows of constraints, by the constraints' numbers."""
        kept, gone = parted(self.constraints, rows)
        return replace(self, equations=replace(self.equations, all_constraints=kept), redundant=gone)

    # ------------------------------------------------------------------ equations of motion

    def acceleration(self, t: Array, q: Array, v: Array) -> Array:
        """Return q'' for a batch of states: the one operation that carries every integrator.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v : ndarray, shape (n_batch, n)

        Returns
        -------
        ndarray, shape (n_batch, n)
        """
        frames = self.frames(q)
        x = self.absolute(q, frames)
        u = self.absolute_velocity(q, v, frames) if self.uses_rates else x
        az = self.equations.accelerations(t, x, u, self.force(t, x, u))
        return self.state_acceleration(frames, v, az) if self.charts else az

    @property
    def balances(self) -> bool:
        """Whether `imbalance` is at hand."""
        return self.linearizes and self.equations.balances

    def imbalance(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return by how much accelerations ``a`` fail the equations of motion.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v, a : ndarray, shape (n_batch, n)

        Returns
        -------
        forces, gaps : ndarray, shape (n_batch, n) and (n_batch, n_rows)
        """
        x = self.absolute(q)
        u = self.absolute_velocity(q, v) if self.uses_rates else x
        return self.equations.imbalance(t, x, u, self.force(t, x, u), a)

    @property
    def linearizes(self) -> bool:
        """Whether `linearized` is at hand: the state are coordinates with a constant mass matrix."""
        return not self.charts and not self.variable_mass

    @property
    def quartic(self) -> bool:
        """Whether mass and joints are constant in the state and the potential a polynomial of degree four."""
        constant = self.linearizes and self.equations.phi.constant
        return constant and all(part.quartic for part in self.forces)

    def linearized(self, t: float, q: Array, v: Array, through: Through = directly) -> Linearized:
        """Return the equations of motion linearised at a state (n,), through what may replay slopes."""
        time, x, u = np.array([t]), self.absolute(q[None]), self.absolute_velocity(q[None], v[None])
        equations, reduction = self.equations, self.reduction
        stiff = self._conserving.tangents(time, x, u, through)
        if not equations.phi.constant:
            multipliers = equations.solve(time, x, u, self.force(time, x, u))[1]
            stiff += equations.phi.stiffness(x, multipliers)
        damping = None
        if self.dissipates:
            damping = self._free_matrix(self._every.rate_tangents(time, x, u, through))
        jacobian = equations.phi.jacobian_at(x) @ reduction.basis if equations.constraints else None
        metric, root = equations.metric(jacobian)
        return Linearized(equations.free_mass, self._free_matrix(stiff), damping, jacobian, root, metric)

    @cached_property
    def _conserving(self) -> ManyForces:
        return ManyForces([part for part in self.together if not part.of_strain_rates])

    @cached_property
    def _every(self) -> ManyForces:
        return ManyForces(self.together)

    def _free_matrix(self, parts: list[Entries]) -> Matrix:
        whole = assemble(parts, (self.n_x, self.n_x), is_sparse(self.equations.constant_mass))
        return self.reduction.reduced(whole)

    # ------------------------------------------------------------------ trust in a state

    def admissible(self, q: Array, through: Through = directly) -> bool:
        """Whether a state (n,) makes sense, its mass matrix called through what may replay it.

        The mass matrix is positive definite for all motions that the joints allow, and no clamped slope
        has turned over through zero length.
        """
        if min(q[self.reduction.stretches].tolist(), default=1.0) <= 0.0:
            return False
        return not self.variable_mass or self._has_inertia(self.absolute(q[None]), through)

    def breakdown(self, t: float, q: Array) -> SolverFailure | None:
        """Return why no step leads on from a state (n,), if a body says that its model has broken down."""
        if not self.variable_mass:
            return None
        x = self.absolute(q[None])
        size, motion = self._smallest_inertia(x)
        body = max(self.variable_mass, key=lambda one: float(np.sum(motion[one.columns] ** 2)))
        return body.breakdown(t, size, self._smallest_inertia(self._straightened(x))[0])

    def _straightened(self, x: Array) -> Array:
        """Return coordinates (1, n_x) with no deformation of bodies whose mass matrix depends on that."""
        straight = x.copy()
        for body in self.variable_mass:
            straight[0, body.columns] = body.straightened(x[0, body.columns])
        return straight

    def _has_inertia(self, x: Array, through: Through) -> bool:
        """Whether the mass matrix is positive definite in a state (1, n_x), for allowed motions at least."""
        # for all: that is found much sooner
        found = positive(through("mass matrix", self.unreduced.mass, (x,))[0])
        return found or self._smallest_inertia(x)[0] > 0.0

    def _smallest_inertia(self, x: Array) -> tuple[float, Array]:
        """Return the smallest eigenvalue of the mass matrix among allowed motions, and that motion.

        Coordinates are scaled so that the undeformed mass matrix has a unit diagonal, where it has any.
        """
        equations, sizes = self.unreduced, np.diag(self.unreduced.mass(self._straightened(x))[0])
        scale = 1.0 / np.sqrt(np.maximum(sizes, sizes[sizes > 0.0].min()))
        M = equations.mass(x)[0] * np.outer(scale, scale)
        Z = complement(equations.phi.jacobians(x)[0] * scale)
        sizes, motions = np.linalg.eigh(Z.T @ M @ Z)
        return float(sizes[0]), Z @ motions[:, 0]

    # ------------------------------------------------------------------ projection

    def project(self, t: Array, q: Array, v: Array, strict: bool = False) -> tuple[Array, Array]:
        """Move states onto the constraints, at position and velocity level, in the metric of the mass.

        Parameters
        ----------
        t : ndarray, shape (n_batch,)
        q, v : ndarray, shape (n_batch, n)
        strict : bool
            Refuse states near which the joints cannot be closed, instead of returning what was reached.

        Raises
        ------
        numpy.linalg.LinAlgError
            If ``strict`` and a violation is left, or the equations are singular.
        """
        if not self.equations.constraints:
            return q, v
        return Projection(self)(t, q, v, strict)
