"""Laws that hold for all models of beams, and a fully parameterised beam."""

from itertools import product

import numpy as np
import pytest
from analytical import gauss, jacobian
from cantilevers import at_rest, displacement
from solved import parsed

from hfsim.deck.materials import BeamProperties
from hfsim.marching.integration import run_integration
from hfsim.mechanics.pose import Pose, Twist
from hfsim.parts.bodies.models import MODELS
from hfsim.scene.build import build
from hfsim.trust.handover import hand_over
from hfsim.trust.quasistatic import deformation_of

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


def box(line, points):
    """Yield xi, y, z and weight of so many Gauss points a side of the section, along a rule of the line."""
    sides = (gauss(points, -side / 2, side / 2) for side in (HEIGHT, WIDTH))
    for (xi, a), (y, b), (z, c) in product(*(list(zip(*rule, strict=True)) for rule in (line, *sides))):
        yield xi, y, z, a * b * c


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


def check_told_at_rest(flexible, force, moment, within=2e-3):
    """A rigid cantilever at rest tells the deformation of `linear`, the scene: tip, and shape to go over to.

    Returns
    -------
    Deformation, Deformation
        What the rigid beam tells, and what there is in `linear`.
    """
    x, deck, linear = at_rest(flexible, 1.0), flexible.loaded.deck, flexible.bodies["b"]
    expected = linear.deformation(x, np.zeros_like(x))
    body, moment = deck.bodies["b"].assemble("b", 0, deck, MODELS["rigid"]), np.atleast_1d(moment)
    pose = Pose.level([0.0] * deck.dimension)
    y = body.placed(pose)[None]
    still, tip = np.zeros_like(y), body.marker(body.points["tip"])
    on = np.array(force) @ tip.position_jacobian(y)[0] + moment @ tip.spin_jacobian(y)[0]
    seen = body.statics(y, still, still, [(tip, on[None])])
    assert seen.tip == pytest.approx(expected.tip, abs=within * np.abs(expected.tip).max())
    own, there = (np.vstack([one.axial[0], one.slope[0].T]) for one in (seen, expected))
    found = [np.interp(expected.places, seen.places, row) for row in own]
    assert np.array(found) == pytest.approx(there, abs=within * seen.steepness.max())
    taken, _ = linear.deformed(pose, Twist(np.zeros(deck.dimension), np.zeros(len(moment))), seen)
    assert taken == pytest.approx(x[0], abs=within * np.abs(x[0] - linear.placed(pose)).max())
    return seen, expected


def check_force_of_energy(force, x, rng):
    """The force at x (n,) is the slope of its energy, and what its damping takes is its power."""
    t, x, still, u, h = np.zeros(1), x[None], np.zeros((1, len(x))), rng.normal(size=(1, len(x))), 1e-5
    out, damped = np.zeros((2, *x.shape))
    force.add_force(t, x, still, out)
    slope = jacobian(lambda y: force.strain_energy(y)[:, None], x[0])[0]
    assert out[0] == pytest.approx(-slope, abs=1e-8 * np.abs(slope).max())
    rates = (force.displacements(x + h * u) - force.displacements(x - h * u)) / (2.0 * h)
    assert force.rates(x, u) == pytest.approx(rates, abs=1e-7)
    force.add_force(t, x, u, damped)
    lost = force.power(t, x, u)[0]
    assert np.sum((damped - out) * u) == pytest.approx(lost, rel=1e-9)
    assert lost < 0.0


def check_rigid_motions(body, force, x, rng):
    """No rigid motion from x (n,) is resisted by damping, nor caused by the force of any motion."""
    freedoms = body.freedoms(x)
    count = len(freedoms) + 1
    u = np.zeros((count, len(x)))
    u[:-1, body.columns], u[-1] = freedoms, rng.normal(size=len(x))
    moving, still = np.zeros((2, count, len(x)))
    for rates, out in ((u, moving), (np.zeros_like(u), still)):
        force.add_force(np.zeros(count), np.repeat(x[None], count, axis=0), rates, out)
    resisted = np.abs(moving - still).max(axis=1)
    assert resisted[:-1].max() < 1e-9 * resisted[-1]
    assert np.abs(u[:-1] @ moving[-1]).max() < 1e-9 * np.abs(moving[-1]).max()


def check_inertia_of_rigid(rotor):
    """Moving rigidly, a rigid beam has the energies of `exact`, and its tip where that has it."""
    energies, places = [], []
    for model in ("rigid", "exact"):
        scene = build(parsed(rotor(model)))
        system = scene.system
        x, u = system.absolute(scene.q[None]), system.absolute_velocity(scene.q[None], scene.v[None])
        energies.append([system.kinetic_energy(x, u)[0], system.potential_energy(np.zeros(1), x)[0]])
        places.append(scene.marker("b1.tip").position(x)[0])
        assert scene.bodies["b1"].outline(x)[0, -1] == pytest.approx(places[-1], abs=1e-6)
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)
    assert places[0] == pytest.approx(places[1], abs=1e-12)


def check_takeover(data, lost=2e-3):
    """What takes over from a rigid beam goes on in the same place, bent as told, with the same forces."""
    old, end = build(parsed(data)), np.array([data["solve"]["duration"]])
    path = run_integration(old, old.deck.solve).trajectory
    x = old.system.absolute(path.q[None])
    seen = deformation_of(old, old.bodies["b1"], end, path.q[None], path.v[None])
    size = np.linalg.norm(seen.sections[0, -1, : old.deck.dimension])
    assert size > 1e-4
    for model in ("linear", "exact"):
        new, gained = hand_over(old, build(old.loaded, models={"b1": model}), path)
        y, rates = new.system.absolute(new.q[None]), new.system.absolute_velocity(new.q[None], new.v[None])
        assert np.abs(new.system.residual(end, y)).max() < 1e-9
        bent = new.bodies["b1"].deformation(y, rates)
        assert bent.tip == pytest.approx(seen.tip, abs=5e-3 * np.abs(seen.tip).max())
        moved = new.marker("b1.root").position(y) - old.marker("b1.root").position(x)
        assert np.abs(moved).max() < 0.1 * size
        assert abs(gained) < lost * new.system.kinetic_energy(y, rates)[0]
