"""The state that modes are about: laws of time stand in what lasts, and rest is where statics has it."""

import numpy as np
import pytest
from click.testing import CliRunner

import hfsim
from hfsim.cli import app
from hfsim.mechanics.statics.newton import HOLD, stepped
from hfsim.scene import nearby
from hfsim.scene.build import build
from hfsim.scene.equilibrium import equilibrium_of, problem_of
from hfsim.scene.loading import parse_deck

PAIR = """hfsim: 1
bodies:
  a: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{p: [0.3, 0.0]}}}}
  b: {{type: rigid, mass: 1.0, inertia: 0.1, points: {{q: [-0.4, 0.0]}}}}
  {body}
joints:
  pin: {{type: revolute, between: [ground, a]}}
  {joint}
springs: {{coil: {{type: rotational, between: [ground, a], stiffness: {stiffness}}}}}
{more}
solve: {{duration: 1.0}}
"""
LED = {
    "place": "lead: {{type: motion, between: [a.p, b.q], x: {}}}",
    "turn": "lead: {{type: motion, between: [a.p, b.q], turn: {}}}",
    "driver": "s: {{type: prismatic, between: [a.p, b.q]}}\n"
    "  lead: {{type: driver, between: [a.p, b.q], position: {}}}",
    "servo": "s: {{type: prismatic, between: [a.p, b.q]}}\n"
    "  lead: {{type: servo, between: [a.p, b.q], position: {}, stiffness: 50.0, damping: 2.0}}",
}
LAWS = {
    "rate": "{type: sine, amplitude: 1.0, frequency: 1.0}",
    "acceleration": "{type: sine, amplitude: 1.0, frequency: 1.0, phase: 90 deg, offset: -1.0}",
}


def values(joint, about, stiffness=5.0, more="", body=""):
    """Return the eigenvalues of two bodies, one led by the other."""
    text = PAIR.format(joint=joint, stiffness=stiffness, more=more, body=body)
    found = hfsim.modes(parse_deck(text), about=about)
    assert found.about.lasting
    return np.array([mode.value for mode in found])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("kind", LED)
def test_laws_stand_at_rest(kind, law):
    """Their accelerations load joints, and so do servos that go on: neither is there at rest."""
    moving, standing = (values(LED[kind].format(one), "equilibrium") for one in (LAWS[law], "0.0"))
    assert moving == pytest.approx(standing, rel=1e-9)


@pytest.mark.parametrize("kind", ["place", "turn", "driver"])
def test_laws_stand_in_steady_rotation(kind):
    third = "c: {type: rigid, mass: 0.5, inertia: 0.1, points: {r: [-0.2, 0.0]}}"
    joint = LED[kind] + "\n  hinge: {{type: revolute, between: [b, c.r]}}"
    more = "initial: {a: {angular_velocity: 1.5}, b: {angular_velocity: 1.5}, c: {angular_velocity: 1.5}}"
    told = (LAWS["acceleration"], "0.0")
    moving, standing = (values(joint.format(one), "steady", 0.0, more, third) for one in told)
    assert len(moving) > 1 and moving == pytest.approx(standing, rel=1e-7, abs=1e-7)


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


FINE = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {rubber: {density: 1150.0, youngs_modulus: 5.0e8, poisson_ratio: 0.3}}
sections: {rod: {shape: circle, diameter: 0.004}}
bodies: {bar: {type: beam, material: rubber, section: rod, length: 0.6, elements: 64, element: cosserat}}
joints: {clamp: {type: fixed, between: [ground, bar.root]}}
solve: {duration: 0.1}
"""


ROTOR = """
hfsim: 1
gravity: [0.0, -9.81]
materials: {grp: {density: 1800.0, youngs_modulus: 3.0e10}}
sections: {blade: {shape: rectangle, width: 0.1, height: 0.01}}
bodies:
  hub: {type: rigid, mass: 1.0, inertia: 0.01}
  left: {type: beam, material: grp, section: blade, length: 1.0, elements: 2}
  right: {type: beam, material: grp, section: blade, length: 1.0, elements: 2}
joints:
  axle: {type: revolute, between: [ground, hub]}
  one: {type: fixed, between: [hub, right.root]}
  other: {type: fixed, between: [hub, left.root], angle: "180 deg"}
initial: {hub: {angle: 0.03}}
solve: {duration: 0.1}
"""


@pytest.mark.parametrize(("text", "holds"), [(FINE, [0.0]), (ROTOR, [HOLD, 0.0])])
def test_nothing_holds_back_what_is_held_already_on_the_way_to_rest(monkeypatch, text, holds):
    """Of fine meshes the stiffest are so stiff that a hold of 1e-11 of these bent all corrections.

    What blades weigh in that they bend is as soft: in a straight rotor nothing does.
    """
    scene, efforts = build(parse_deck(text, "deck.yaml")), []

    def noted(problem, effort, *others):
        efforts.append((problem.hold, effort))
        return stepped(problem, effort, *others)

    monkeypatch.setattr(nearby, "stepped", noted)
    x = nearby.resting(scene)
    assert [hold for hold, _ in efforts] == holds
    assert sum(effort.iterations for _, effort in efforts) < 20
    state = equilibrium_of(scene, problem_of(scene)).state
    assert np.abs(x - scene.system.reduction.expand(state.z)[0]).max() < 1e-9
