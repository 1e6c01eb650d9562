"""One run of a refinement."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hfsim.marching.clock import PhaseClock
from hfsim.marching.integration import Integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.solution import Channel
from hfsim.scene.build import Scene
from hfsim.studies.methods import Entry
from hfsim.studies.refine.setting import Setting


@dataclass
class Level:
    """One run of a refinement.

    Attributes
    ----------
    refined : str
        What was refined to get here; empty for the first.
    status, reason : str
        ``done``, ``failed`` or ``over budget``; why.
    cpu : float
        CPU time, building and sampling included [s].
    wall : float
        The same on the clock [s].
    change : float or None
        Largest difference to the level that was refined, relative to the channel's range [-].
    channel : str
        The channel with it.
    estimate : float or None
        Error as it is known in the end [-].
    base : int
        Number of the level that was refined.
    held : int
        Memory that it has taken and keeps [byte].
    clock : PhaseClock
        CPU and wall time of building and solving.
    channels : tuple of Channel
        None unless it reached its end.
    """

    number: int
    refined: str
    setting: Setting
    status: str = "done"
    reason: str = ""
    cpu: float = 0.0
    wall: float = 0.0
    change: float | None = None
    channel: str = ""
    estimate: float | None = None
    base: int = 0
    held: int = 0
    scene: Scene | None = field(default=None, repr=False)
    done: Integration | None = field(default=None, repr=False)
    clock: PhaseClock = field(default_factory=PhaseClock, repr=False)
    channels: tuple[Channel, ...] = field(default=(), repr=False)

    def read(self) -> None:
        """Compute the channels, of an integration that reached its end."""
        assert self.scene is not None and self.done is not None
        self.channels = compute_channels(sample(self.scene, self.done.trajectory))

    @property
    def unknowns(self) -> int:
        """Number of coordinates; 0 before it is built."""
        return self.scene.system.n if self.scene else 0

    @property
    def work(self) -> float:
        """Evaluations times unknowns."""
        evaluations = self.done.problem.counts.evaluations if self.done else 0
        return float(max(evaluations, 1) * self.unknowns)

    @property
    def method(self) -> str:
        """The method really used, once it is known."""
        return self.done.method if self.done else self.setting.method

    def facts(self) -> dict[str, Any]:
        """Return JSON-ready facts."""
        return {
            "number": self.number,
            "refined": self.refined,
            "status": self.status,
            "reason": self.reason,
            "unknowns": self.unknowns,
            "steps": self.done.problem.counts.steps if self.done else 0,
            "change": self.change,
            "channel": self.channel,
            "estimate": self.estimate,
            "cpu_s": self.cpu,
            "tolerance": self.setting.tolerance,
            "method": self.method,
            "coordinates": self.setting.coordinates,
            "bodies": {body: {"elements": n, "degree": p} for body, n, p in self.setting.mesh},
        }

    def entry(self) -> Entry:
        """Return the level as one to be raced against."""
        assert self.scene is not None and self.done is not None
        return Entry(self.method, self.setting.tolerance, self.scene, self.done, self.clock.cpu["solve"])
