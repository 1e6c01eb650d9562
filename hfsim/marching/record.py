"""What a run leaves behind, made while it goes on: rows of output, energy balance, states to look at later.

All is computed block by block, and what a block is follows from the steps alone, not from clocks: a run
that is put down and taken up again gives the same rows, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from hfsim.errors import SolverFailure
from hfsim.integrators import Counts, Memory, Trajectory, packed, part_of
from hfsim.marching.balance import Balance, step_samples
from hfsim.marching.sampling import SceneSamples, channels_of, output_times, samples_of, table_of
from hfsim.marching.solution import Channel, Run
from hfsim.marching.turns import read_states
from hfsim.maths.arrays import Array, distinct
from hfsim.scene.build import Scene

CALL, NATIVE, STATE = 3e-4, 3e-5, 2e-7
"""Nominal time of a batch of evaluations, of one in native steps, and of each coordinate of a state [s]."""
LARGE, SPARSE = 40, 10.0
"""Coordinates from which a coordinate costs more in proportion, as matrices do, and how much more at most."""
BLOCK = 0.25
"""Nominal time after which the steps so far become a block [s]."""
MOST_STEPS = 50e6
"""Bytes of steps that are kept as they are; beyond, less and less is kept of their inside."""
MOST_STATES = 16e6
"""Bytes of states at output times that are kept; beyond, every second one is."""


class Sink(Protocol):
    """Where finished rows go."""

    def begin(self, channels: Sequence[str]) -> None:
        """Take note that there will be rows with these channels."""

    def rows(self, table: Array) -> None:
        """Take the next rows: time and channels, shape (n_rows, 1 + n_channels)."""

    def block(self, memory: Callable[[], Memory]) -> None:
        """Take note that a block has ended, and of what the run must know to go on from there."""

    def solved(self, run: Run) -> None:
        """Take what the steps have come to, before anything else is found out about the run."""


class Reader(Protocol):
    """What reads the steps of a run while they are whole: later, less may be kept of them."""

    def take(self, scene: Scene, steps: Trajectory, angles: Mapping[str, float]) -> None:
        """Take the next steps; `angles` are those of the bodies where they begin [rad]."""


class Record:
    """The rows and legs of one run.

    Attributes
    ----------
    legs : list of LegRecord
    balanced : bool
        Whether energies and constraint violations are looked at.
    reader : Reader or None
        Gets all steps.
    """

    def __init__(
        self,
        sink: Sink | None = None,
        memory: Memory | None = None,
        balanced: bool = True,
        reader: Reader | None = None,
    ) -> None:
        self.balanced, self.reader = balanced, reader
        self.legs: list[LegRecord] = []
        self._sink, self._tables = sink, list[Array]()
        self._memory = memory

    def open(self, scene: Scene) -> None:
        """Say that the scene stands and steps are about to be made."""
        if self._sink is not None:
            self._sink.begin(scene.deck.channels)

    def solved(self, run: Run) -> None:
        """Say what the steps have come to."""
        if self._sink is not None:
            self._sink.solved(run)

    def begin(self, scene: Scene, lasting: bool = True) -> Memory | None:
        """Begin a leg; return what its steps go on from, if it was put down in this leg.

        Parameters
        ----------
        lasting : bool
            Whether nothing undoes its steps any more: only then can it have been put down.
        """
        self.legs.append(LegRecord(scene, self.legs[-1] if self.legs else None, self.balanced, self.reader))
        memory = self._memory if lasting else None
        if memory is None:
            return None
        self._add(memory["table"][sum(map(len, self._tables)) :])
        self.legs[-1].recall(part_of(memory, "record"))
        return part_of(memory, "steps")

    def due(self, path: Trajectory, counts: Counts) -> bool:
        """Return whether the steps since the last block have cost enough to be one."""
        return self.legs[-1].due(counts, len(path.q))

    def close(self, path: Trajectory, counts: Counts, memory: Callable[[], Memory] | None = None) -> None:
        """Make a block of the steps since the last one.

        Parameters
        ----------
        memory : callable, optional
            Gives what the steps go on from; without it the leg ends here.

        Raises
        ------
        SolverFailure
            If an output is not finite; the rows before are kept.
        """
        leg = self.legs[-1]
        table = leg.block(path, counts)
        bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
        self._add(table[: bad[0]] if len(bad) else table)
        if len(bad):
            names, row = ("t", *leg.scene.deck.channels), table[bad[0]]
            name, time = names[int(np.argmin(np.isfinite(row)))], float(row[0])
            raise SolverFailure(f"{name} is not finite from t = {time:.6g} s on", time, name)
        if self._sink is not None and memory is not None:
            steps, own = memory(), leg.memory()
            self._sink.block(lambda: packed({"steps": steps, "record": own()}))

    def keep(self, scene: Scene, path: Trajectory, counts: Counts) -> SolverFailure | None:
        """Take a leg as a whole; return the failure where an output is not finite."""
        self.begin(scene, lasting=False)
        try:
            self.close(path, counts)
        except SolverFailure as spoiled:
            return spoiled
        return None

    def _add(self, table: Array) -> None:
        self._tables.append(table)
        if self._sink is not None:
            self._sink.rows(table)

    def table(self) -> Array:
        """Return all rows so far, shape (n_rows, 1 + n_channels)."""
        if len(self._tables) > 1:
            self._tables = [np.concatenate(self._tables)]
        return self._tables[0]

    def channels(self) -> tuple[Channel, ...]:
        """Return the columns that the deck asks for."""
        return channels_of(self.legs[0].scene.deck.channels, self.table())


class LegRecord:
    """What is known of the steps with one choice of models.

    Attributes
    ----------
    balance : Balance
    begin_angles : mapping of str to float
        Angles of bodies where its steps begin, or those since it was put down [rad].
    """

    def __init__(
        self, scene: Scene, before: LegRecord | None, balanced: bool, reader: Reader | None = None
    ) -> None:
        self._balanced, self._reader = balanced, reader
        self.scene, self.balance = scene, Balance(scene)
        self._times = output_times(scene)
        self._begin: int = before._next if before else 0
        self._next: int = self._begin
        self._angles: Mapping[str, float] = scene.start_angles
        self.begin_angles = self._angles
        self._first = 0
        self._cost, self._size = 0.0, 0
        self._states: list[Array] = [np.empty((0, 2 + 2 * scene.system.n))]
        self._wanted = distinct(np.array(scene.deck.output.snapshots, dtype=float))
        self._shots: list[Array] = [np.empty((0, 1 + 2 * scene.system.n))]
        self._shot: int = before._shot if before else 0
        self._stride = 1

    def due(self, counts: Counts, n: int) -> bool:
        """Return whether the steps since the last block have cost enough to be one."""
        return _nominal(counts, n) - self._cost > BLOCK

    def block(self, path: Trajectory, counts: Counts) -> Array:
        """Add the steps since the last block; return their rows, (n_rows, 1 + n_channels)."""
        stretch = path.part(slice(self._first, None), path.t_end, path.q, path.v)
        last = int(np.searchsorted(self._times, path.t_end, side="right"))
        with np.errstate(all="ignore"):
            if self._reader is not None:
                self._reader.take(self.scene, stretch, self._angles)
            table = self._rows(stretch, slice(self._next, max(last, self._next)))
            self._take(stretch)
            if self._balanced:
                self.balance.add(step_samples(stretch))
        self._cost = _nominal(counts, len(path.q))
        self._size += stretch.size
        if self._size > MOST_STEPS:
            path.condense()
            self._size = path.size
        self._first = len(path.segments)
        return table

    def _rows(self, stretch: Trajectory, mine: slice) -> Array:
        scene, times = self.scene, self._times[mine]
        q, v, turns = read_states(scene, stretch, np.append(times, stretch.t_end), self._angles)
        self._angles = {**self._angles, **{name: float(angles[-1]) for name, angles in turns.items()}}
        self._next = mine.stop
        if not len(times):
            return np.empty((0, 1 + len(scene.deck.channels)))
        before = {name: angles[:-1] for name, angles in turns.items()}
        samples = samples_of(scene, times, q[:-1], v[:-1], before, stretch.past)
        self._keep(np.column_stack([np.arange(mine.start, mine.stop), times, samples.q, samples.v]))
        return table_of(samples)

    def _take(self, stretch: Trajectory) -> None:
        """Keep the states at the times of snapshots."""
        last = int(np.searchsorted(self._wanted, stretch.t_end, side="right"))
        times = self._wanted[self._shot : last]
        if len(times):
            q, v = self.scene.system.project(times, *stretch.at(times))
            self._shots.append(np.column_stack([times, q, v]))
            self._shot = last

    def _keep(self, states: Array) -> None:
        self._states.append(states[states[:, 0] % self._stride == 0])
        while sum(one.nbytes for one in self._states) > MOST_STATES:
            self._stride *= 2
            self._states = [one[one[:, 0] % self._stride == 0] for one in self._states]

    @property
    def times(self) -> Array:
        """Its output times so far."""
        return self._times[self._begin : self._next]

    @property
    def samples(self) -> SceneSamples:
        """States at the output times, in long runs at some of them; turns are not in it."""
        n, states = self.scene.system.n, np.concatenate(self._states)
        return SceneSamples(self.scene, states[:, 1], states[:, 2 : 2 + n], states[:, 2 + n :], {})

    @property
    def shots(self) -> SceneSamples:
        """States at the times of snapshots that were reached; turns are not in it."""
        n, states = self.scene.system.n, np.concatenate(self._shots)
        states = states[np.isfinite(states).all(axis=1)]
        return SceneSamples(self.scene, states[:, 0], states[:, 1 : 1 + n], states[:, 1 + n :], {})

    def memory(self) -> Callable[[], Memory]:
        """Return what gives all that the next block depends on, as of now."""
        states, place = list(self._states), np.array([self._next, self._stride, self._cost])
        shots = list(self._shots)
        known = {"place": place, "angles": np.array(list(self._angles.values())), **self.balance.memory()}
        return lambda: {**known, "states": np.concatenate(states), "shots": np.concatenate(shots)}

    def recall(self, memory: Memory) -> None:
        """Go on from a memory."""
        self._next, self._stride = map(int, memory["place"][:2])
        self._cost = float(memory["place"][2])
        self._angles = dict(zip(self._angles, map(float, memory["angles"]), strict=True))
        self.begin_angles = self._angles
        self._states, self._shots = [memory["states"]], [memory["shots"]]
        self._shot = int(np.searchsorted(self._wanted, self._shots[0][:, 0].max(initial=-1.0), side="right"))
        self.balance.recall(memory)


def _nominal(counts: Counts, n: int) -> float:
    """Return about how long the evaluations so far take [s], the same on any machine."""
    native = counts.native / max(counts.steps, 1)
    share = min(max(1.0, n / LARGE), SPARSE)
    return (CALL + native * (NATIVE - CALL)) * counts.calls + share * STATE * n * counts.evaluations
