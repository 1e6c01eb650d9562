"""The beam of Hairer and Wanner's test set: forty links, clamped at one end and pushed at the other."""

import numpy as np
import pytest

from hfsim.scene.loading import parse_deck
from hfsim.simulate import simulate

COUNT = 40
PUBLISHED = {
    "l1.angle": -5.792366591285007e-3,
    "l10.angle": -9.119134654647947e-2,
    "l20.angle": -0.1483595472463012,
    "l40.angle": -0.1767201761075488,
    "l1.angular_velocity": 0.03747362681329794,
    "l40.angular_velocity": 1.186724615113034,
}
"""At 5 s: problem BEAM of Solving Ordinary Differential Equations II and of the test set of Bari."""


def links(tolerance):
    """Return the deck: links without mass of 1/40 m, masses where they meet, half of one at the end.

    In its equations the first link is clamped half a link before its end: a spring of twice the stiffness.
    """
    h, bodies, joints, springs = 1.0 / COUNT, [], [], []
    for k in range(1, COUNT + 1):
        before, mass = f"l{k - 1}" if k > 1 else "ground", h if k < COUNT else 0.5 * h
        between = f"between: [{before}, l{k}"
        bodies.append(f"  l{k}: {{type: rigid, mass: {mass}, inertia: 1.0e-12, points: {{low: [{-h}, 0]}}}}")
        joints.append(f"  j{k}: {{type: revolute, {between}.low]}}")
        stiffness = COUNT if k > 1 else 2 * COUNT
        springs.append(f"  s{k}: {{type: rotational, {between}], stiffness: {stiffness}, rest_angle: 0}}")
    push = f'{{type: force, at: l{COUNT}, force: [-1, 1], law: {{expression: "1.5 * sin(min(t, pi))**2"}}}}'
    lines = ["hfsim: 1", "bodies:", *bodies, "joints:", *joints, "springs:", *springs]
    lines += ["loads:", f"  push: {push}", f"solve: {{duration: 5.0, tolerance: {tolerance}}}"]
    return "\n".join([*lines, f"output: {{interval: 5.0, channels: [{', '.join(PUBLISHED)}]}}"])


@pytest.mark.slow
def test_a_beam_of_links_ends_where_the_test_set_says():
    run = simulate(parse_deck(links(1.0e-5)), error_estimate=False)
    assert run.status == "done"
    ends = np.array([run[name][-1] for name in PUBLISHED])
    assert ends[:4] == pytest.approx(list(PUBLISHED.values())[:4], abs=1e-6)
    assert ends[4:] == pytest.approx(list(PUBLISHED.values())[4:], abs=1e-4)
