"""What distances between channels are divided by, and which channels count."""

from types import SimpleNamespace

import numpy as np
import pytest

from hfsim.marching.distance import channel_errors, channel_scales, error_scales, gap, reference_scales
from hfsim.marching.solution import Channel
from hfsim.parts.channels import is_judged
from hfsim.scene.build import build
from hfsim.scene.loading import parse_deck

T = np.linspace(0.0, 1.0, 101)


def channel(name, unit="m", size=1.0, offset=0.0):
    return Channel(name, unit, offset + size * np.cos(np.pi * T))


def scale_of(*channels, outlines=None, conserved=False):
    return channel_scales(channels, outlines or {}, conserved)[0]


def test_a_channel_is_judged_by_its_range():
    found = scale_of(channel("tip.x", size=0.5))
    assert (found.channel, found.unit, found.small, found.judged) == ("tip.x", "m", False, True)
    assert found.scale == found.reference_range == pytest.approx(1.0)


@pytest.mark.parametrize("others", [(channel("tip.x"),), ()])
def test_a_tiny_range_is_judged_by_the_largest_of_its_unit(others):
    outlines = {} if others else {"b1": np.array([[[0.0, 0.0], [0.0, 2.0]]])}
    found = scale_of(channel("tip.deflection", size=1e-6), *others, outlines=outlines)
    assert found.small and found.scale == pytest.approx(2e-3)


@pytest.mark.parametrize(("unit", "other"), [("N m", "N"), ("N", "N m")])
def test_a_moment_that_is_noise_is_judged_by_forces_and_their_arms_and_back(unit, other):
    """A joint of a plane of symmetry has no moment across it: what is there is no result."""
    noise, large, place = channel("j.moment_x", unit, 1e-9), channel("j.moment_y", other, 40.0), channel("x")
    arm = 2.0 if unit == "N m" else 0.5
    assert scale_of(noise, large, place).scale == pytest.approx(1e-3 * 40.0 * arm)
    assert scale_of(large, noise, place).scale == pytest.approx(80.0)


def test_angles_are_judged_by_a_radian_at_least():
    assert scale_of(channel("b1.angle", "rad", 1e-6)).scale == pytest.approx(1e-3)


def test_where_the_origin_lies_does_not_matter():
    near, far = (scale_of(channel("tip.x", offset=offset)).scale for offset in (0.0, 1e6))
    assert far == pytest.approx(near)


def test_nothing_is_divided_by_zero():
    assert scale_of(channel("tip.x", size=0.0)).scale > 0.0


def test_residuals_and_conserved_energies_do_not_count():
    assert not is_judged("constraint.position") and not scale_of(channel("constraint.position")).judged
    energy = channel("energy.total", "J")
    assert scale_of(energy).judged and not scale_of(energy, conserved=True).judged
    huge = channel("constraint.position", size=1e9)
    assert scale_of(channel("tip.x", size=1e-3), huge).scale == pytest.approx(2e-3)


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_the_energy_of_a_reference_is_judged_where_something_takes_from_it(damping):
    scene = build(
        parse_deck(f"""hfsim: 1
bodies: {{b: {{type: rigid, mass: 1.0, inertia: 0.1}}}}
joints: {{j: {{type: revolute, between: [ground, b], damping: {damping}}}}}
solve: {{duration: 1.0}}
""")
    )
    samples = SimpleNamespace(scene=scene, x=scene.system.absolute(scene.q[None]))
    (found,) = reference_scales(samples, [channel("energy.total", "J")])
    assert found.judged is (damping > 0.0)


def test_a_gap_is_the_largest_distance_and_its_root_mean_square():
    truth = channel("tip.x").values
    found = gap(truth + 0.1 * (T >= 0.5), truth)
    assert found.largest == pytest.approx(0.1) and T[found.at] >= 0.5
    assert found.rms == pytest.approx(0.1 * np.sqrt(51 / 101))
    assert np.isfinite(gap(truth + 1e200, truth)).all()
    assert gap(T[:0], T[:0]) == gap(truth, truth) == (0.0, 0.0, 0)


@pytest.mark.parametrize(("size", "scale"), [(1e-6, 2e-6), (1e-9, 1e-3), (0.0, 1e-3)])
def test_errors_of_what_stands_still_are_judged_by_the_scene_and_all_others_by_their_range(size, scale):
    """A steady deflection has no range; a vibration of micrometres has one."""
    still, moving = channel("tip.deflection", size=size), channel("tip.deflection", size=1e-4)
    for mine, truth in ((still, still), (still, moving), (moving, still)):
        (found,) = error_scales([mine], [truth], {"m": 1.0})
        expected = max(scale, 2e-4) if truth is moving else scale
        assert found.scale == pytest.approx(expected) and found.small is (scale == 1e-3)


@pytest.mark.parametrize(
    ("name", "unit", "scale"),
    [
        ("te.tip.axial_force", "N", 300.1),
        ("joint.moment", "N m", 300.1),
        ("b.angular_velocity", "rad/s", 300.1),
        ("te.tip.elongation", "m", 300.1),
        ("te.tip.acceleration", "m/s^2", 300.1),
        ("b.angular_acceleration", "rad/s^2", 300.1),
        ("joint.power", "W", 300.1),
        ("energy.kinetic", "J", 300.1),
        ("energy.strain", "J", 300.1),
        ("energy.potential", "J", 0.2),
        ("b.x", "m", 0.2),
        ("b.angle", "rad", 0.2),
    ],
)
def test_errors_of_what_counts_from_zero_and_hardly_changes_are_judged_by_its_size(name, unit, scale):
    """The tension of what turns steadily is as good as its error over it; places may lie anywhere."""
    steady, wavy = channel(name, unit, 0.1, 300.0), channel(name, unit, 0.2, 300.0)
    assert error_scales([steady], [steady])[0].scale == pytest.approx(scale)
    assert error_scales([wavy], [wavy])[0].scale == pytest.approx(0.4)
    if scale > 1.0:
        assert error_scales([steady], [wavy])[0].scale == pytest.approx(300.2)


def test_errors_last_as_long_as_the_reference():
    off = np.where(T < 0.8, 1e-3, 1.0)
    mine = [channel("tip.x")._replace(values=channel("tip.x").values + off), channel("energy.total", "J")]
    truth = [
        one._replace(values=one.values[T < 0.8]) for one in (channel("tip.x"), channel("energy.total", "J"))
    ]
    absolute, relative = channel_errors(mine, truth)
    assert absolute == {"tip.x": pytest.approx(1e-3), "energy.total": 0.0}
    assert relative == {"tip.x": pytest.approx(1e-3 / np.ptp(truth[0].values))}


def test_errors_last_as_long_as_what_is_judged():
    """The second run of one that failed may come further."""
    truth = [channel("tip.x"), channel("energy.total", "J")]
    mine = [one._replace(values=one.values[T < 0.8]) for one in truth]
    absolute, relative = channel_errors(mine, truth)
    assert absolute == {"tip.x": 0.0, "energy.total": 0.0} and relative == {"tip.x": 0.0}
    late = truth[0]._replace(values=truth[0].values + np.where(T < 0.8, 1e-3, 1.0))
    assert channel_errors(mine[:1], [late])[0]["tip.x"] == pytest.approx(1e-3)


def test_what_moves_by_round_off_has_no_error_to_speak_of():
    still = channel("tip.x", size=1e-16, offset=1.0)
    noise = still._replace(values=still.values + 1e-15)
    assert channel_errors([noise], [still])[1]["tip.x"] < 1e-8
