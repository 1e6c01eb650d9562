"""Scenes of many bodies are put together in time and memory that grow with their number, not its square."""

import json
import random
from types import SimpleNamespace

import numpy as np
import pytest

from hfsim.maths.matrices import dense, is_sparse
from hfsim.mechanics import elimination
from hfsim.scene import closing, facing, freedom, mounts
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

ROD = {"type": "beam", "material": "rubber", "section": "rod", "length": 0.5, "elements": 2}


def scene_of(bodies, joints, n_dim=3, springs=(), initial=(), ground=()):
    deck = {
        "hfsim": 1,
        "gravity": [*[0.0] * (n_dim - 1), -9.81],
        "materials": {"rubber": {"density": 1150.0, "youngs_modulus": 5e8, "poisson_ratio": 0.3}},
        "sections": {"rod": {"shape": "circle", "diameter": 0.02}},
        "ground": {"points": dict(ground)},
        "bodies": bodies,
        "joints": joints,
        "springs": dict(springs),
        "initial": dict(initial),
        "solve": {"duration": 0.1},
    }
    return build(parse_deck(json.dumps(deck), "large.yaml"))


def hub_of(count, n_dim=3):
    """Return a hub that turns about the vertical at 2 rad/s, with as many blades fixed around it."""
    angles = 2.0 * np.pi * np.arange(count) / count
    places = 0.1 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)[:, :n_dim]
    rim = {f"p{k}": place for k, place in enumerate(places.tolist())}
    about = {"axis": [0.0, 0.0, 1.0]} if n_dim == 3 else {}
    inertia = 0.1 if n_dim == 2 else [0.1, 0.1, 0.1]
    joints = {"pin": {"type": "revolute", "between": ["ground", "hub"], **about}}
    for k, angle in enumerate(angles):
        between = [f"hub.p{k}", f"b{k}.root"]
        joints[f"f{k}"] = {"type": "fixed", "between": between, "angle": float(angle)}
    bodies = {"hub": {"type": "rigid", "mass": 1.0, "inertia": inertia, "points": rim}}
    bodies |= {f"b{k}": ROD for k in range(count)}
    spin = [0.0, 0.0, 2.0] if n_dim == 3 else 2.0
    return scene_of(bodies, joints, n_dim, initial={"hub": {"angular_velocity": spin}})


def test_no_dense_rows_are_made_of_many_joints():
    """For 256 blades they took 0.9 GB."""
    scene = hub_of(96)
    assert scene.warnings == []
    for equations in (scene.system.equations.phi, scene.assembly.linkage.equations):
        assert "_constant_transpose" in vars(equations) and "_constant_rows" not in vars(equations)


def test_large_scenes_start_as_dense_algebra_has_it(monkeypatch):
    found = hub_of(96)
    link = found.assembly.linkage
    place = found.assembly.place + 1e-3 * np.sin(np.arange(link.n))
    rates, slopes = link.slopes_by_rates(place), link.slopes_at(place, np.arange(link.n) % 5 != 0)
    assert is_sparse(rates) and is_sparse(slopes)
    monkeypatch.setattr(closing, "MOST_ROWS", 10**6)
    again = hub_of(96)
    whole = again.assembly.linkage
    assert not is_sparse(whole.slopes_by_rates(place))
    assert np.abs(dense(rates) - whole.slopes_by_rates(place)).max() < 1e-14
    other = whole.slopes(place[None], np.arange(link.n) % 5 != 0)[0]
    assert np.abs(dense(slopes) - other).max() < 1e-14 * np.abs(other).max()
    assert np.abs(found.q - again.q).max() < 1e-14 and np.abs(found.v - again.v).max() < 1e-12
    assert np.abs(found.v).max() > 1.0


def test_constant_rows_of_large_scenes_are_sparse_and_the_same(monkeypatch):
    phi = hub_of(40).system.equations.phi
    assert phi.sparse and not phi.constant
    part = phi._constant_transpose
    assert is_sparse(part) and np.array_equal(part.toarray()[phi.support], phi._constant_rows[0].T)
    few = hub_of(4).system.equations.phi
    assert not is_sparse(few._constant_transpose)


# --- orientations that joints hand on -------------------------------------------------------------


def handed_on_in_rounds(joints, known, names, steps):
    """Return what looking at all joints again and again hands on."""

    def once(step):
        before = len(known)
        for joint in joints:
            a, b = (end.partition(".")[0] for end in joint.between)
            if a in known and b not in known and (R := step(joint, known[a], False)) is not None:
                known[b] = R
            elif b in known and a not in known and (R := step(joint, known[b], True)) is not None:
                known[a] = R
        return len(known) > before

    for name in names:
        known.setdefault(name, facing.LEVEL)
        while any(once(step) for step in steps):
            pass
    return known


@pytest.mark.parametrize("seed", range(20))
def test_joints_hand_on_in_the_order_of_the_deck(seed):
    rng = random.Random(seed)
    names = ["ground", *(f"b{k}" for k in range(12))]
    joints = [
        SimpleNamespace(between=[f"{name}.p" for name in rng.sample(names, 2)], number=k, kind=k % 7 % 3)
        for k in range(rng.randrange(5, 30))
    ]

    def by(kind):
        return lambda joint, way, back: (way, joint.number, back) if joint.kind == kind else None

    steps, known = (by(0), by(1)), {name: name for name in rng.sample(names, 2)}
    facings = facing.Facings.__new__(facing.Facings)
    facings.__dict__["_joints"] = {str(joint.number): joint for joint in joints}
    sought = rng.sample(names, 5)
    found = facings._spread(dict(known), sought, *steps)
    expected = handed_on_in_rounds(joints, dict(known), sought, steps)
    assert list(map(str, found.items())) == list(map(str, expected.items()))


# --- how often things are looked at ---------------------------------------------------------------


def counted(monkeypatch, module, name):
    """Count the calls of a function of a module."""
    calls, function = [], getattr(module, name)
    monkeypatch.setattr(module, name, lambda *args: (calls.append(1), function(*args))[1])
    return calls


def test_each_joint_is_looked_at_a_few_times_for_orientations(monkeypatch):
    points = counted(monkeypatch, facing, "split_point")
    hub_of(40)
    assert 0 < len(points) < 60 * 40


def test_each_joint_is_looked_at_a_few_times_for_what_a_beam_is_fixed_to(monkeypatch):
    looked, held = [], elimination._held_slopes

    def counting(constraints):
        return held(looked.append(1) or one for one in constraints)

    monkeypatch.setattr(elimination, "_held_slopes", counting)
    assert len(hub_of(40, 2).system.reduction.eliminated) > 0
    assert 0 < len(looked) < 6 * 40


def test_each_spring_is_looked_at_a_few_times_where_bodies_float(monkeypatch):
    count, ends = 40, counted(monkeypatch, freedom, "owners")
    bodies = {f"r{k}": {"type": "rigid", "mass": 1.0, "inertia": [0.1, 0.1, 0.1]} for k in range(count)}
    spring = {"type": "two_point", "stiffness": 10.0, "rest_length": 1.0}
    springs = {f"s{k}": {**spring, "between": [f"ground.g{k}", f"r{k}"]} for k in range(count)}
    points = {f"g{k}": [float(k), 0.0, 1.0] for k in range(count)}
    scene = scene_of(bodies, {}, springs=springs, ground=points)
    assert len(scene.free_motions) == count and scene.warnings is not None
    assert 0 < len(ends) < 4 * count


def test_each_bushing_is_looked_at_a_few_times_for_where_bodies_start(monkeypatch):
    count, asked = 60, []
    bodies = {f"r{k}": {"type": "rigid", "mass": 1.0, "inertia": 0.1} for k in range(count)}
    held = {"type": "bushing", "stiffness": 1e4, "rotational_stiffness": 1e3}
    springs = {f"s{k}": {**held, "between": [f"r{k - 1}" if k else "ground", f"r{k}"]} for k in range(count)}
    deck = scene_of(bodies, {}, 2, springs).deck
    joins = mounts._Placing.joins
    monkeypatch.setattr(mounts._Placing, "joins", lambda *args: (asked.append(1), joins(*args))[1])
    assert list(mounts.mounts(deck)) == [f"springs.{name}" for name in springs]
    assert 0 < len(asked) < 20 * count
