"""A wheel on a coil: the angle is sin(10 t) / 10."""

WHEEL = """
hfsim: 1
name: wheel
bodies: {hub: {type: rigid, mass: 1.0, inertia: 1.0, points: {rim: [1.0, 0.0]}}}
joints: {pin: {type: revolute, between: [ground, hub]}}
springs: {coil: {type: rotational, between: [ground, hub], stiffness: 100.0}}
initial: {hub: {angular_velocity: 1.0}}
solve: {duration: 0.5, tolerance: 1.0e-8}
output: {channels: [hub.angle, hub.rim.x]}
"""
