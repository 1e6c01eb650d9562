"""The state that modes are about."""

import numpy as np
import pytest
from click.testing import CliRunner

import hfsim
from hfsim.cli import app
from hfsim.scene.loading import parse_deck

ROD = """hfsim: 1
name: rod
gravity: [0.0, -9.81]
bodies: {{rod: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{p: [-1.0, 0.0]}}}}}}
joints: {{pin: {{type: revolute, between: [ground, rod.p]}}}}
initial: {{rod: {{angle: {angle} deg}}}}
solve: {{duration: 1.0}}
"""


@pytest.mark.parametrize("angle", [-60, 10, 80])
def test_modes_are_about_the_place_where_the_scene_comes_to_rest(angle):
    """From above the pin the equilibrium that balances without being let down is the upper one."""
    deck = parse_deck(ROD.format(angle=angle))
    (found,) = hfsim.modes(deck, about="equilibrium")
    assert found.value == pytest.approx(1j * np.sqrt(9.81 / 1.1), rel=1e-9)
    assert found.value.imag**2 == pytest.approx(hfsim.static(deck).statistics["smallest_eigenvalue"])


def test_an_equilibrium_next_to_the_start_is_taken_though_not_stable_and_told(tmp_path):
    deck = tmp_path / "rod.yaml"
    deck.write_text(ROD.format(angle=89))
    growths = [mode.value for mode in hfsim.modes(str(deck), about="equilibrium")]
    assert growths == pytest.approx([np.sqrt(9.81 / 1.1), -np.sqrt(9.81 / 1.1)], rel=1e-9)
    words = ["modes", str(deck), "--about", "equilibrium", "--no-plots", "-o", str(tmp_path / "out")]
    told = " ".join(CliRunner().invoke(app, words).output.split())
    assert "this equilibrium is not stable: hfsim static tells where the scene comes to rest" in told
