# ruff: noqa: E501
"""Decks of spatial loops of hinges that move though they are held too often: planar four-bar, Bennett, Bricard."""

from itertools import pairwise

import numpy as np

from hfsim.maths.rotations import rotation

LEVEL, ORIGIN = np.eye(3), np.zeros(3)


def listed(vector):
    """A vector as decks have it, with all its digits."""
    return f"[{', '.join(repr(float(part)) for part in vector)}]"


def turned(R):
    """An orientation as decks have it."""
    return f"{{x: {listed(R[:, 0])}, y: {listed(R[:, 1])}}}"


def ring(links, angles, rate, R=LEVEL, shift=ORIGIN, duration=2.0):
    """Deck of a closed chain of hinges: the last link is the ground, the first is given a rate.

    Each link goes from one hinge's axis to the next one's, `length` along their common normal, `twist` between
    them; the frames of the bodies are turned in no order, all of it by R and shifted.
    """
    frames = [np.eye(4)]
    for (length, twist), angle in zip(links, angles, strict=True):
        step = np.eye(4)
        step[:3, :3] = rotation(np.array([0.0, 0.0, angle])) @ rotation(np.array([twist, 0.0, 0.0]))
        step[:3, 3] = length * np.array([np.cos(angle), np.sin(angle), 0.0])
        frames.append(frames[-1] @ step)
    closing = frames.pop()
    assert np.allclose(closing, np.eye(4), rtol=0.0, atol=1e-14), closing
    places, axes = ([R @ frame[:3, k] for frame in frames] for k in (3, 2))
    places = [place + shift for place in places]
    bodies, joints, initial, own = [], [], [], []
    for k, (start, end) in enumerate(pairwise(places)):
        own.append(R @ rotation(np.array([0.1 * k, 0.2, 0.3 * k])))
        ends = [listed(own[-1].T @ (place - 0.5 * (start + end))) for place in (start, end)]
        points = f"points: {{r: {ends[0]}, t: {ends[1]}}}"
        bodies.append(f"l{k}: {{type: rigid, mass: 1.0, inertia: [0.02, 0.03, 0.04], {points}}}")
        spin = f", angular_velocity: {listed(rate * axes[0])}" if k == 0 else ""
        initial.append(f"l{k}: {{orientation: {turned(own[-1])}{spin}}}")
        before, axis = ("ground.A", axes[0]) if k == 0 else (f"l{k - 1}.t", own[k - 1].T @ axes[k])
        joints.append(f"j{k}: {{type: revolute, between: [{before}, l{k}.r], axis: {listed(axis)}}}")
    last = len(own)
    joints.append(
        f"j{last}: {{type: revolute, between: [ground.D, l{last - 1}.t], axis: {listed(axes[last])}}}"
    )
    return "\n  ".join(
        [
            f"hfsim: 1\ngravity: {listed(R @ [0.0, -9.81, 0.0])}",
            f"\nground: {{points: {{A: {listed(places[0])}, D: {listed(places[last])}}}}}\nbodies:",
            *bodies,
        ]
    ) + "\n".join(
        [
            "\njoints:\n  " + "\n  ".join(joints),
            "initial:\n  " + "\n  ".join(initial),
            f"solve: {{duration: {duration}, tolerance: 1.0e-9}}",
            "output: {interval: 0.05, channels: [l1.x, l1.y, l1.z, energy.total, constraint.position]}\n",
        ]
    )


def four_bar(rate=12.0, crank_angle=1.0, lengths=(0.3, 0.8, 0.6, 0.9), **where):
    """Deck of a planar crank and rocker; its crank turns through. The ground's link points along x of R."""
    a, b, c, d = lengths
    pin, pivot = a * np.exp(1j * crank_angle), complex(d)
    far = abs(pivot - pin)
    elbow = np.arccos(np.clip((b * b + far * far - c * c) / (2.0 * b * far), -1.0, 1.0))
    end = pin + b * np.exp(1j * (np.angle(pivot - pin) + elbow))
    headings = np.angle([pin, end - pin, pivot - end, -pivot])
    angles = np.diff(headings, prepend=headings[-1])
    return ring([(length, 0.0) for length in lengths], angles, rate, **where)


def bennett(rate=4.0, angle=0.7, length=0.5, twists=(0.6, 1.1), **where):
    """Deck of Bennett's loop: opposite links alike, lengths as the sines of their twists."""
    p, q = twists
    other = length * np.sin(q) / np.sin(p)
    next_angle = 2.0 * np.arctan(np.sin(0.5 * (q + p)) / np.sin(0.5 * (q - p)) / np.tan(0.5 * angle))
    links = [(length, p), (other, q)] * 2
    return ring(links, [angle, next_angle, -angle, -next_angle], rate, **where)


def bricard(rate=3.0, angle=0.6, length=0.4, **where):
    """Deck of Bricard's loop with threefold symmetry and right angles: six equal links."""
    next_angle = np.arccos(-np.cos(angle) / (1.0 + np.cos(angle)))
    links = [(length, 0.5 * np.pi), (length, -0.5 * np.pi)] * 3
    return ring(links, [angle, next_angle] * 3, rate, **where)
