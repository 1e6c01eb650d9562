"""What is new to trust: a model and a load that it has never heard of pass through it and are named."""

from typing import ClassVar, Literal

import numpy as np
import pytest

from hfsim.marching.balance import step_samples
from hfsim.marching.integration import run_integration
from hfsim.marching.stop import Budget
from hfsim.maths.frozen import frozen
from hfsim.mechanics.force import ForcePart
from hfsim.mechanics.markers import Marker
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.forces import LOADS
from hfsim.parts.specs import LoadSpec
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate
from hfsim.trust.diagnosis import diagnose
from hfsim.trust.validity import watch_validity

BLADE = """hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1100.0, youngs_modulus: 5.0e6}}
sections: {bar: {shape: rectangle, width: 0.02, height: 0.02}}
bodies: {b1: {type: beam, material: rubber, section: bar, length: 1.0, elements: 2}}
joints: {pin: {type: revolute, between: [ground, b1.root]}}
solve: {duration: 0.4, tolerance: 1.0e-4}
"""


class GustSpec(LoadSpec):
    """A vertical force that leaves all bounds."""

    type: Literal["gust"]
    at: str
    law: None = None
    amount: ClassVar = (1.0,)

    def build(self, marker):
        """Return the force at a marker."""
        return Gust(marker)


@frozen
class Gust(ForcePart):
    """A force of 1 N upwards, and without bounds after 0.1 s."""

    marker: Marker

    @property
    def markers(self):
        """Its point."""
        return (self.marker,)

    @property
    def support(self):
        """Coordinates of its point."""
        return self.marker.support

    def add_force(self, t, x, u, out):
        """Add the force."""
        size = np.where(t > 0.1, np.inf, 1.0)
        out[:, self.marker.columns] += size[:, None] * self.marker.position_jacobian(x)[:, 1]


@pytest.mark.parametrize("terms", [("foreshortening", "stiffening"), ("curvature",), ()])
def test_a_new_model_is_judged_by_the_terms_it_states(monkeypatch, terms):
    monkeypatch.setitem(MODELS, "plain", MODELS["linear"]._replace(leaves_out=terms, rung=None))
    scene = build(parse_deck(BLADE), models={"b1": "plain"})
    ends = step_samples(run_integration(scene, scene.deck.solve).trajectory)
    found = watch_validity(scene, ends.t, ends.q, ends.v)
    assert list(found) == (["b1"] if terms else [])
    if terms:
        assert found["b1"]["left_at"] is not None and found["b1"]["reason"]


def test_a_new_model_that_runs_away_is_diagnosed(monkeypatch):
    monkeypatch.setitem(MODELS, "plain", MODELS["linear"]._replace(rung=None))
    text = BLADE.replace("solve:", "initial: {b1: {angular_velocity: 40.0}}\nsolve:")
    scene = build(parse_deck(text, overrides=("solve.duration=2.0",)), models={"b1": "plain"})
    done = run_integration(scene, scene.deck.solve)
    failure = diagnose(scene, done, Budget(1.5))
    assert (failure.kind, failure.item) == ("model", "bodies.b1")
    assert failure.remedy.endswith("--set solve.model=exact")


def test_a_new_load_is_named_when_it_is_not_finite(monkeypatch):
    monkeypatch.setitem(LOADS, "gust", GustSpec)
    run = simulate(parse_deck(BLADE + "loads: {storm: {type: gust, at: b1.tip}}\n"), diagnosis=True)
    assert run.failure is not None
    assert (run.failure["class"], run.failure["item"]) == ("deck", "loads.storm")
