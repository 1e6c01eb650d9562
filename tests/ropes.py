"""A cart on a rope that breaks."""

import numpy as np

ROPE = """
hfsim: 1
bodies: {cart: {type: rigid, mass: 2.0, inertia: 0.1}}
springs:
  rope: {type: two_point, between: [ground, cart], stiffness: 50, rest_length: 1.0, release: {force: 20}}
initial: {cart: {position: [1.0, 0.0], velocity: [3.0, 0.0]}}
solve: {duration: 1.0, tolerance: 1.0e-9}
output: {interval: 0.05, channels: [cart.x, cart.vx, rope.force, energy.total]}
"""
BROKEN = np.arcsin(20.0 / 50.0 / (3.0 / 5.0)) / 5.0
"""When 50 N/m have 20 N [s]: x - 1 = 0.6 sin(5 t)."""
