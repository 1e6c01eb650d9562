"""Damping of fully parameterised beams: of all strains, means over sections and the rest by a time each."""

import numpy as np
import pytest
import yaml
from damping import check_damping
from tapered import TAPER, deck

from hfsim.parts.elements.continuum_damping import ContinuumDamping
from hfsim.parts.elements.forces import ElasticForce
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck
from hfsim.studies.modes import modes_of
from hfsim.studies.modes.about import about

E, RHO, H, B, L = 2.1e8, 7800.0, 0.02, 0.1, 1.5
BEAMS = {
    "plane": (2, {}),
    "plane, of high degree": (2, {"degree": 4, "section_degree": 3}),
    "space": (3, {}),
    "arc": (3, {"axis": {"arc": {"radius": 2.0, "angle": 0.7}}, "degree": 4, "section_degree": 3}),
}


def damped(beam="plane", axial=0.02, bending=0.02, stations=None, model="ancf", free=True, **material):
    n_dim, more = BEAMS[beam]
    data = deck(None, n_dim, model, element="continuum", elements=2, **more)
    body = data["bodies"]["b"]
    if stations:
        body["stations"] = stations
    else:
        del body["stations"]
        body["section"] = "thick"
    if "axis" in body:
        del body["length"]
    data["materials"]["steel"] |= {"axial_damping": axial, "bending_damping": bending, **material}
    if free:
        del data["joints"], data["loads"]
    return build(parse_deck(yaml.safe_dump(data)))


def part_of(scene, kind):
    return next(part for part in scene.system.forces if isinstance(part, kind))


def matrix(entries, n):
    K = np.zeros((n, n))
    np.add.at(K, (entries.rows, entries.columns), entries.values)
    return K


@pytest.mark.parametrize("stations", [None, TAPER])
@pytest.mark.parametrize("beam", BEAMS)
def test_damping_of_the_undeformed_beam_is_its_stiffness_by_the_time(beam, stations, rng):
    scene = damped(beam, stations=stations)
    x, t, n = scene.system.absolute(scene.q[None]), np.zeros(1), scene.system.n_x
    K = matrix(part_of(scene, ElasticForce).tangent(t, x, 0.0 * x), n)
    D = matrix(part_of(scene, ContinuumDamping).rate_tangent(t, x, 0.0 * x), n)
    assert np.abs(D - 0.02 * K).max() < 1e-12 * np.abs(D).max()
    u = rng.normal(size=x.shape)
    assert scene.system.power(t, x, u)[0] == pytest.approx(-0.02 * u[0] @ K @ u[0], rel=1e-10)


@pytest.mark.parametrize("stations", [None, TAPER])
@pytest.mark.parametrize("beam", BEAMS)
def test_damping_holds_its_laws(beam, stations, rng):
    """Slopes, power below zero, and none of turning, in a deformed state, with times that differ."""
    scene = damped(beam, 0.02, 0.05, stations, density=1.0, youngs_modulus=1e3)
    check_damping(scene, rng, slice(BEAMS[beam][0], None))


def power_at(scene, change, size=1.0):
    """Power where vectors change at rates of a function of the body's undeformed ones."""
    body, x = scene.bodies["b"], scene.system.absolute(scene.q[None])
    u = np.zeros_like(x)
    u[0, body.columns] = size * change(body.undeformed, body.mesh.element.stride).ravel()
    return scene.system.power(np.zeros(1), x, u)[0]


def stretched(vectors, stride):
    rates = np.zeros_like(vectors)
    rates[::stride, 0] = vectors[::stride, 0]
    rates[1::stride, 0] = 1.0
    return rates


def thickened(vectors, stride):
    rates = np.zeros_like(vectors)
    rates[2::stride, 1] = 1.0
    return rates


def sheared(vectors, stride):
    rates = np.zeros_like(vectors)
    rates[2::stride, 0] = 1.0
    return rates


def curved(vectors, stride):
    """v = x^2 / 2 with sections normal to it."""
    rates, x = np.zeros_like(vectors), vectors[::stride, 0]
    rates[::stride, 1] = 0.5 * x**2
    rates[1::stride, 1], rates[2::stride, 0] = x, -x
    return rates


def twisted(vectors, stride):
    rates, x = np.zeros_like(vectors), vectors[::stride, 0]
    rates[2::stride, 2], rates[3::stride, 1] = x, -x
    return rates


G, I_y, I_z = E / 2, H * B**3 / 12, B * H**3 / 12
KINDS = [
    (stretched, 2, E * B * H, True),
    (thickened, 2, E * B * H, True),
    (sheared, 2, G * B * H, True),
    (curved, 2, E * I_z, False),
    (curved, 3, E * I_z, False),
    (twisted, 3, G * (I_y + I_z), False),
]


@pytest.mark.parametrize(("change", "n_dim", "stiffness", "of_mean"), KINDS)
def test_means_of_strains_are_damped_by_one_time_and_the_rest_by_the_other(change, n_dim, stiffness, of_mean):
    beam = "plane" if n_dim == 2 else "space"
    for axial, bending in ((0.03, 0.0), (0.0, 0.05)):
        scene = damped(beam, axial, bending, poisson_ratio=0.0)
        expected = -L * stiffness * (axial if of_mean else bending)
        assert power_at(scene, change) == pytest.approx(expected, rel=1e-10, abs=1e-12 * L * E * B * H)


def modes_at(scene_of, near):
    """Frequency and damping ratio of the mode nearest to a frequency [1/s]."""
    found = modes_of(about(scene_of.loaded, "start", None), 200)
    mode = min(found.modes, key=lambda one: abs(2.0 * np.pi * one.natural_frequency - near))
    return 2.0 * np.pi * mode.natural_frequency, mode.damping_ratio


BENDING = (4.730040745 / L) ** 2 * np.sqrt(E * H**2 / 12 / RHO)
ACROSS = np.sqrt(12.0 / RHO) / H
"""Of vibrations of r_y alone, by the root of their modulus."""


@pytest.mark.parametrize("model", ["ancf", "linear"])
def test_modes_decay_as_of_damping_in_proportion_to_stiffness(model):
    """A free beam: bending by its time; change of thickness and shear, alike along the beam, by the other."""
    kinds = ((BENDING, 0.02, 2e-3), (ACROSS * np.sqrt(E), 2e-5, 1e-9), (ACROSS * np.sqrt(G), 2e-5, 1e-3))
    scene = damped("plane, of high degree", 2e-5, 0.02, model=model, poisson_ratio=0.0)
    for omega, time, within in kinds:
        found, ratio = modes_at(scene, omega)
        assert found == pytest.approx(omega, rel=within)
        assert ratio == pytest.approx(0.5 * found * time, rel=1e-3)
        assert 0.05 < ratio < 0.5
