"""Fully parameterised beams of tests of their laws, and what holds for models of them under small loads."""

import numpy as np
import pytest
from cantilevers import at_rest, displacement

from hfsim.deck.materials import BeamProperties
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.models import MODELS

HEIGHT, WIDTH, DENSITY, LAMBDA, MU = 0.3, 0.2, 3.0, 500.0, 400.0
OWN = BeamProperties(
    mass_per_length=DENSITY * HEIGHT * WIDTH,
    axial_stiffness=300.0,
    lame_lambda=LAMBDA,
    lame_mu=MU,
    height=HEIGHT,
    width=WIDTH,
    breadth=WIDTH,
)
FORCE, MOMENT = (30.0, 20.0, 10.0), (0.5, 2.0, -3.0)
"""At the tip of a cantilever."""


def check_small_loads(bar, load):
    """`linear` tends to `ancf` with the square of the load; `bar` makes one of a model, a force, a moment."""
    missed = []
    for size in (load, load / 2.0):
        force, moment = (tuple((size * np.array(part)).tolist()) for part in (FORCE, MOMENT))
        scenes = (bar(model, force, moment) for model in ("linear", "ancf"))
        ends = [displacement(scene, at_rest(scene, 1.0)) for scene in scenes]
        missed.append(np.abs(ends[0] - ends[1]).max())
        assert missed[-1] < 0.05 * np.abs(ends[1]).max()
    assert missed[0] / missed[1] > 3.5


def told_at_rest(bar):
    """Return what the rigid cantilever tells of its deformation at rest, and that of `linear`.

    The shape that `linear` takes over from it is that of its own equilibrium.
    """
    flexible = bar("linear")
    x = at_rest(flexible, 1.0)
    deck, linear = flexible.loaded.deck, flexible.bodies["b"]
    body = deck.bodies["b"].assemble("b", 0, deck, MODELS["rigid"])
    pose = Pose.level([0.0, 0.0, 0.0])
    y, still = body.placed(pose)[None], np.zeros((1, 12))
    tip = body.marker(body.points["tip"])
    on = np.array(FORCE) @ tip.position_jacobian(y)[0] + np.array(MOMENT) @ tip.spin_jacobian(y)[0]
    seen = body.statics(y, still, still, [(tip, on[None])])
    taken, there = linear.deformed(pose, Twist(np.zeros(3), np.zeros(3)), seen)[0], x[0]
    moved = there - linear.placed(pose)
    assert taken == pytest.approx(there, abs=0.02 * np.abs(moved).max())
    return seen, linear.deformation(x, np.zeros_like(x))
