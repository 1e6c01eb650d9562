"""What the validity monitor says of `linear` and `lowOrder`, beside their measured error.

Error: distance of a beam's tip from where `exact` has it, over the largest range of a coordinate of
that tip in the run of `exact`; of the beams of a scene the worst counts.
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import sample
from hfsim.scene.build import build
from hfsim.scene.loading import load_deck, parse_deck
from hfsim.trust.doubt import validity
from hfsim.trust.validity import LEFT

CASES = Path(__file__).parent.parent / "cases"
SILENT, LARGE = 1e-3, 1e-2
"""Errors below which the monitor must be silent, and before which it must warn."""

BLADE = """
materials: {alloy: {density: 2700.0, youngs_modulus: 7.0e10}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.005}}
bodies: {b1: {type: beam, material: alloy, section: bar, length: 1.0, elements: 4}}
"""
CANTILEVER = f"""hfsim: 1
{BLADE}
joints: {{clamp: {{type: fixed, between: [ground, b1.root]}}}}
loads:
  push:
    type: force
    at: b1.tip
    force: [0.0, 1.0]
    law: {{type: smooth_step, from: 0, to: 1, start: 0, end: 0.2}}
solve: {{duration: 0.5, tolerance: 1.0e-8}}
"""
SPIN_UP = f"""hfsim: 1
{BLADE}
joints:
  axle: {{type: revolute, between: [ground, b1.root]}}
  motor: {{type: driver, between: [ground, b1], angle: {{type: spin_up, rate: 6.0, time: 1.0}}}}
solve: {{duration: 1.5, tolerance: 1.0e-8}}
"""


def _deck(base, **changes):
    overrides = [f"{key.replace('__', '.')}={value}" for key, value in changes.items()]
    return parse_deck(base, "scene.yaml", overrides) if "\n" in base else load_deck(CASES / base, overrides)


def _spun(omega, ratio=1.0, case="two_beams.yaml"):
    spins = {"initial__b1__angular_velocity": omega, "initial__b2__angular_velocity": ratio * omega}
    return _deck(case, **spins, solve__duration=1.0)


def _pendulum(modulus):
    return _deck("pendulum.yaml", materials__rubber__youngs_modulus=modulus)


def _hub(modulus, duration=1.0):
    return _deck("hub_beams.yaml", materials__soft__youngs_modulus=modulus, solve__duration=duration)


def _cantilever(force):
    return _deck(CANTILEVER, loads__push__force=f"[0.0, {force}]")


def _spin_up(rate):
    return _deck(SPIN_UP, joints__motor__angle__rate=rate)


FAST = {
    "cantilever, 0.01 N": lambda: _cantilever(0.01),
    "cantilever, 0.3 N": lambda: _cantilever(0.3),
    "cantilever, 3 N": lambda: _cantilever(3.0),
    "pendulum": lambda: _deck("pendulum.yaml"),
    "pendulum, E = 7e8": lambda: _pendulum(7e8),
    "pendulum, E = 7e10": lambda: _pendulum(7e10),
    "two_beams, 1 rad/s": lambda: _spun(1.0),
    "two_beams": lambda: _spun(4.0),
    "spin-up to 2 rad/s": lambda: _spin_up(2.0),
}
SLOW = {
    "cantilever, 0.1 N": lambda: _cantilever(0.1),
    "cantilever, 1 N": lambda: _cantilever(1.0),
    "pendulum, E = 7e7": lambda: _pendulum(7e7),
    "pendulum, E = 7e9": lambda: _pendulum(7e9),
    "two_beams, 2 rad/s": lambda: _spun(2.0),
    "two_beams_relative, 0.5 rad/s": lambda: _spun(0.5, 2.0, "two_beams_relative.yaml"),
    "two_beams_relative, 1 rad/s": lambda: _spun(1.0, 2.0, "two_beams_relative.yaml"),
    "two_beams_relative": lambda: _spun(4.0, 2.0, "two_beams_relative.yaml"),
    "spin-up to 6 rad/s": lambda: _spin_up(6.0),
    "spin-up to 20 rad/s": lambda: _spin_up(20.0),
    "spin-up to 60 rad/s": lambda: _spin_up(60.0),
    "hub_beams_soft": lambda: _deck("hub_beams_soft.yaml", solve__duration=1.0),
    "hub_beams, E = 7e9": lambda: _hub(7e9),
    "hub_beams, 5 s": lambda: _hub(7e10, 5.0),
    "hub_beams, E = 7e11": lambda: _hub(7e11),
}
HELD_BACK = {
    **{f"cantilever, {force} N": partial(_cantilever, force) for force in (0.05, 0.18, 0.6, 2.0)},
    **{f"pendulum, E = {modulus:g}": partial(_pendulum, modulus) for modulus in (2e8, 3e9, 2e10)},
    **{f"spin-up to {rate} rad/s": partial(_spin_up, rate) for rate in (3.5, 10.0, 35.0)},
    **{f"two_beams, {omega} rad/s": partial(_spun, omega) for omega in (2.8, 3.3)},
    **{
        f"two_beams_relative, {omega} rad/s": partial(_spun, omega, 2.0, "two_beams_relative.yaml")
        for omega in (1.4, 2.0, 3.0)
    },
    **{f"hub_beams, E = {modulus:g}": partial(_hub, modulus) for modulus in (2e10, 2e11)},
}
"""Scenes first looked at when the monitor was finished; the others are those its constants were chosen by."""


@dataclass(frozen=True)
class Row:
    """One model of one scene: its largest error, and when it passed 1 % and the monitor warned [s]."""

    scene: str
    model: str
    error: float
    estimated: float
    large_at: float | None
    left_at: float | None
    broke_down: bool

    @property
    def right(self):
        """Whether the monitor warned in time, and was silent where it must be."""
        if self.error < SILENT and not self.broke_down:
            return self.left_at is None
        return self.large_at is None or (self.left_at is not None and self.left_at <= self.large_at)


def measure(label, loaded):
    """Return a row for each truncated model of a scene."""
    truth, names, at = _tips(build(loaded, "exact"))[:3]
    return [_row(label, loaded, model, truth, names, at) for model in ("linear", "lowOrder")]


def _tips(scene):
    done = run_integration(scene, scene.deck.solve)
    samples = sample(scene, done.trajectory)
    names = [name for name, spec in scene.deck.bodies.items() if spec.type == "beam"]
    tips = np.stack([scene.marker(f"{name}.tip").position(samples.x) for name in names])
    return tips, names, samples, done


def _row(label, loaded, model, truth, names, at):
    scene = build(loaded, model)
    tips, _, samples, done = _tips(scene)
    n = min(len(samples.t), len(at.t))
    reach = np.ptp(truth, axis=1).max(axis=1)
    error = (np.linalg.norm(tips[:, :n] - truth[:, :n], axis=2) / reach[:, None]).max(axis=0)
    found = validity(samples, done.trajectory)
    left = [facts["left_at"] for facts in found.values() if facts["left_at"] is not None]
    large = np.flatnonzero(error > LARGE)
    return Row(
        scene=label,
        model=model,
        error=float(error.max()),
        estimated=max(facts["largest"]["estimated_error"] for facts in found.values()),
        large_at=float(samples.t[large[0]]) if len(large) else None,
        left_at=min(left, default=None),
        broke_down=done.stop is not None,
    )


HEAD = f"""error of the tip relative to its range, against exact; warns above an estimate of {LEFT:g}
{"scene":32}{"model":10}{"error":>9}{"estimated":>11}{"1 % at":>9}{"warns at":>10}"""


def as_text(row):
    """Return a line of the table."""
    large, left = (f"{time:.3g} s" if time is not None else "-" for time in (row.large_at, row.left_at))
    end = " broke down" if row.broke_down else ""
    verdict = "ok" if row.right else "WRONG"
    numbers = f"{row.error:9.1e}{row.estimated:11.1e}{large:>9}{left:>10}"
    return f"{row.scene:32}{row.model:10}{numbers}  {verdict}{end}"
