"""Springs of a net, called together, are those that each is by itself."""

import numpy as np
import pytest
from natively import native

import hfsim
from hfsim.maths import kernel
from hfsim.maths.matrices import assemble
from hfsim.mechanics import nets
from hfsim.mechanics.nets import Net
from hfsim.scene.build import build

KINDS = [
    {"stiffness": 200.0, "damping": 3.0, "preload": 5.0},
    {"stiffness": 150.0, "rest_length": 0.0},
    {"stiffness": 50.0, "rest_length": {"type": "sine", "offset": 0.4, "amplitude": 0.1, "frequency": 1.0}},
    {"table": [[-0.1, 0.0], [0.0, 0.0], [0.2, 40.0]], "friction": {"force": 2.0, "velocity": 0.3}},
    {"stiffness": 80.0, "stops": {"upper": 0.5, "stiffness": 3000.0, "damping": 0.1}},
    {"stiffness": 90.0, "damping": 1.0, "release": {"time": 0.05}},
]


def deck(dimension, count=6, **solve):
    """Bodies in a row beside a beam, tied to the ground, to each other and to the beam; two ends meet."""

    def place(*own):
        return [*own, 0.0, 0.0, 0.0][:dimension]

    inertia = 0.1 if dimension == 2 else [0.1, 0.2, 0.15]
    bodies = {
        f"b{k}": {"type": "rigid", "mass": 1.0 + 0.1 * k, "inertia": inertia} for k in range(count)
    }
    arm = {} if dimension == 2 else {"points": {"arm": [0.1, 0.05, 0.02]}}
    bodies["b0"].update(arm)
    bodies["beam"] = {
        "type": "beam", "element": "cable", "material": "m", "section": "s", "length": 2.0, "elements": 2,
        "points": {"mid": place(0.7)},
    }  # fmt: skip
    ties = [(f"ground.p{k}", f"b{k}") for k in range(count)]
    ties += [(f"b{k}", f"b{k + 1}") for k in range(count - 1)]
    ties += [("beam.mid", "b3"), ("beam.tip", "b4"), ("b0.arm" if arm else "b0", "beam.tip")]
    springs = {
        f"s{k}": {"type": "two_point", "between": list(ends), **KINDS[k % len(KINDS)]}
        for k, ends in enumerate(ties)
    }
    springs["meets"] = {"type": "two_point", "between": ["ground.q", "b5"], "stiffness": 70.0, "damping": 2.0}
    springs["meets"]["rest_length"] = 0.0
    return {
        "hfsim": 1,
        "gravity": place(0.0, -9.81),
        "materials": {"m": {"density": 1000.0, "youngs_modulus": 1e7, "poisson_ratio": 0.3}},
        "sections": {"s": {"shape": "rectangle", "width": 0.05, "height": 0.05}},
        "ground": {"points": {"q": place(1.5, 0.1), **{f"p{k}": place(0.3 * k, 0.5) for k in range(count)}}},
        "bodies": bodies,
        "joints": {"clamp": {"type": "fixed", "between": ["ground", "beam.root"]}},
        "springs": springs,
        "initial": {f"b{k}": {"position": place(0.3 * k, 0.1)} for k in range(count)},
        "solve": {"duration": 0.1, "tolerance": 1e-6, **solve},
        "output": {"interval": 0.02, "channels": ["b0.x", "b3.y", "beam.tip.y", "s4.force", "energy.total"]},
    }


def states(system, q):
    """Return times, places and rates: as the scene starts, and beside."""
    rng = np.random.default_rng(1)
    x = np.repeat(system.absolute(q[None]), 3, axis=0)
    x[1:] += 0.05 * rng.normal(size=x[1:].shape)
    return np.array([0.0, 0.03, 0.2]), x, rng.normal(size=x.shape)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_net_is_all_its_ties(dimension, sparse, monkeypatch):
    if sparse:
        monkeypatch.setattr("hfsim.scene.build.dense_up_to", lambda *sizes: 0)
        monkeypatch.setattr("hfsim.maths.matrices.DENSE_UP_TO", 0)
    scene = build(hfsim.load(deck(dimension)))
    system = scene.system
    (net,) = (part for part in system.together if isinstance(part, Net))
    assert len(net.ties) == len(scene.deck.springs) and len(system.together) < 10
    t, x, u = states(system, scene.q)
    own, found = np.zeros_like(x), np.zeros_like(x)
    for tie in net.ties:
        tie.add_force(t, x, u, own)
    net.add_force(t, x, u, found)
    assert np.abs(own).max() > 10.0
    np.testing.assert_allclose(found, own, rtol=0.0, atol=1e-13 * np.abs(own).max())
    for name, given in (("potential_energy", (t, x)), ("power", (t, x, u))):
        each = [getattr(tie, name)(*given) for tie in net.ties]
        size = np.abs(each).sum(axis=0)
        assert size.min() > 0.1
        np.testing.assert_allclose(getattr(net, name)(*given), np.sum(each, axis=0), atol=1e-13 * size.max())
    for k in range(len(t)):
        state = t[k : k + 1], x[k : k + 1], u[k : k + 1]
        for name in ("tangent", "rate_tangent"):
            each = assemble([getattr(tie, name)(*state) for tie in net.ties], (system.n_x,) * 2, False)
            whole = assemble([getattr(net, name)(*state)], (system.n_x,) * 2, False)
            assert np.abs(each).max() > 1.0
            np.testing.assert_allclose(whole, each, rtol=0.0, atol=1e-12 * np.abs(each).max())


@pytest.mark.parametrize("way", ["numpy", pytest.param("native", marks=native)])
@pytest.mark.parametrize(("dimension", "method"), [(2, "gauss"), (3, "radau")])
def test_scenes_move_as_with_each_by_itself(dimension, method, way, monkeypatch):
    monkeypatch.setattr(kernel, "KERNEL", way)
    together = hfsim.run(deck(dimension, method=method), error_estimate=False)
    monkeypatch.setattr(nets, "MANY", np.inf)
    apart = hfsim.run(deck(dimension, method=method), error_estimate=False)
    system = build(hfsim.load(deck(dimension))).system
    assert len(system.together) == len(system.forces)
    for name in together.units:
        size = np.abs(apart[name]).max()
        np.testing.assert_allclose(together[name], apart[name], rtol=0.0, atol=1e-9 * size)


def test_a_net_comes_to_rest_as_each_spring_by_itself(monkeypatch):
    given = deck(3)
    for spring in given["springs"].values():  # what is at rest does not depend on the way there
        spring.pop("release", None), spring.pop("friction", None)
    together = hfsim.static(given)
    monkeypatch.setattr(nets, "MANY", np.inf)
    apart = hfsim.static(given)
    for name, value in apart.final.items():
        assert together.final[name] == pytest.approx(value, rel=1e-9, abs=1e-9)
