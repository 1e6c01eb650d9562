"""What forces remember of a finished run, which others of the same scene follow."""

import numpy as np
import pytest
from ropes import BROKEN, ROPE
from solved import parsed

import hfsim
from hfsim.marching.balance import balance, step_samples
from hfsim.marching.integration import run_integration
from hfsim.marching.sampling import compute_channels, sample
from hfsim.marching.stop import TimeUp
from hfsim.scene.build import build
from hfsim.studies import spectra

WOUND = """
hfsim: 1
gravity: [0, 0, 0]
bodies: {hub: {type: rigid, mass: 1.0, inertia: [0.2, 0.2, 0.2]}}
joints: {axle: {type: revolute, between: [ground, hub]}}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 0.5}}
initial: {axle: {angular_velocity: 20}}
solve: {duration: 1.5}
output: {interval: 0.05, channels: [coil.torque, energy.total]}
"""


def soon(share):
    """End a run after its first step."""
    if share > 0.0:
        raise TimeUp("ended")


@pytest.mark.parametrize("deck", [ROPE.replace("tolerance: 1.0e-9", "step: 0.01"), WOUND])
def test_a_run_is_read_as_it_was_when_others_have_followed(deck):
    scene = build(parsed(deck))
    done = run_integration(scene, scene.deck.solve)

    def read():
        return compute_channels(sample(scene, done.trajectory)), balance(scene, step_samples(done.trajectory))

    (*first, energy), balanced = read()
    assert balanced["energy_drift"] < 1e-6
    again = run_integration(scene, scene.deck.solve, soon)
    assert isinstance(again.stop, TimeUp) and again.trajectory.t_end < 0.5 * done.trajectory.t_end
    (*second, energy_then), balanced_then = read()
    for one, other in zip([*first, energy], [*second, energy_then], strict=True):
        np.testing.assert_array_equal(one.values, other.values)
    assert balanced == balanced_then
    if "rope" in deck:
        left = 9.0 - 25.0 * (0.6 * np.sin(0.75)) ** 2
        assert energy.values[-1] == pytest.approx(left) and second[2].values[-1] == 0.0
    else:
        sine = np.sin(np.sqrt(0.5 / 0.2) * np.linspace(0.0, 1.5, 31))
        torque = -0.5 * 20.0 / np.sqrt(0.5 / 0.2) * sine
        np.testing.assert_allclose(second[0].values, torque, atol=1e-5)


def test_a_refined_run_is_that_of_its_level_whatever_was_raced_after_it():
    run = hfsim.run(parsed(ROPE), {"solve.target_error": 1e-3})
    assert run.exit_code == 0 and run.statistics["energy_drift"] < 1e-6
    assert run.statistics["releases"] == {"springs.rope": pytest.approx(BROKEN, abs=1e-4)}
    assert run["rope.force"][-1] == 0.0 and run["energy.total"][-1] == pytest.approx(5.0, abs=1e-3)


def test_frequencies_on_the_way_are_those_after_what_has_happened():
    scene = build(parsed(ROPE).with_solve({"duration": 0.2}))
    path = run_integration(scene, scene.deck.solve).trajectory
    assert path.t_end > BROKEN
    near = spectra.spectrum(scene, path.t_end, path.q, path.v)
    assert near.fastest == pytest.approx(0.0, abs=1e-3)
