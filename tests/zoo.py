"""One vector of coordinates with every kind of body in it, and every kind of marker on them."""

from dataclasses import replace

import numpy as np

from hfsim.deck.materials import BeamProperties, SectionProperties
from hfsim.mechanics.markers import GroundMarker
from hfsim.mechanics.planar_markers import NodalMarker, RigidMarker
from hfsim.mechanics.planar_section_marker import PlanarSectionMarker
from hfsim.mechanics.pose import Pose
from hfsim.parts.bodies.beam_axis import Axis, Line
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.planar_low_order import LowOrderBeam
from hfsim.parts.bodies.planar_low_order_body import LowOrderMarker
from hfsim.parts.bodies.section_mesh import SectionMesh
from hfsim.parts.elements import Cable, Continuum

STIFFNESS = BeamProperties(
    axial_stiffness=300.0, bending_stiffness=2.0, lame_lambda=500.0, lame_mu=400.0, height=0.3, width=0.2
)
INERTIA = BeamProperties(mass_per_length=1.7, rotary_inertia=0.0, height=0.3)
ELASTIC = INERTIA._replace(axial_stiffness=300.0, bending_stiffness=2.0)

CABLE = BeamMesh(Cable(0.6), 2, INERTIA)
CONTINUUM = BeamMesh(Continuum(0.6), 2, INERTIA)
SPAR = SectionMesh(
    Axis(Line(), 1.2, n_dim=2), 1, 2, SectionProperties(1.7, (0.1, 0.1), 300.0, (90.0, 90.0), 1.0, (2.0, 2.0))
)

HUB, PLATE = slice(0, 3), slice(3, 6)
ROPE = slice(6, 6 + 2 * CABLE.n_vectors)
BLOCK = slice(ROPE.stop, ROPE.stop + 2 * CONTINUUM.n_vectors)
BLADE = slice(BLOCK.stop, BLOCK.stop + 2 * CABLE.n_vectors)
SLAT = slice(BLADE.stop, BLADE.stop + SPAR.undeformed.size)
N = SLAT.stop
MESHED = ((CABLE, ROPE), (CONTINUUM, BLOCK), (SPAR, SLAT))

LOW_ORDER = LowOrderBeam(
    name="blade",
    mesh=replace(CABLE, properties=ELASTIC),
    columns=BLADE,
    gravity=(0.0, 0.0),
    whole=False,
)


def nodal(mesh, columns, x, y=0.0):
    """Marker of a material point of a beam in nodal coordinates."""
    return NodalMarker(columns, mesh.shape(x, y), mesh.shape(x, y, (1, 0)))


def section(x, y):
    """Marker of a material point of the beam with section vectors."""
    position, (across,), _ = SPAR.point((x, y))
    return PlanarSectionMarker(SLAT, position, across, 0.5 * np.pi)


MARKERS = {
    "ground": GroundMarker(Pose.planar((0.3, -0.2), 0.4)),
    "hub": RigidMarker(HUB),
    "plate": RigidMarker(PLATE, (0.4, -0.3)),
    "rope_tip": nodal(CABLE, ROPE, 1.2),
    "rope_inside": nodal(CABLE, ROPE, 0.4),
    "block": nodal(CONTINUUM, BLOCK, 0.8, 0.1),
    "blade_root": LowOrderMarker(LOW_ORDER, 0.0),
    "blade": LowOrderMarker(LOW_ORDER, 0.9),
    "slat": section(0.8, 0.1),
}

PAIRS = [
    ("ground", "hub"),
    ("ground", "rope_tip"),
    ("ground", "blade"),
    ("hub", "ground"),
    ("hub", "plate"),
    ("plate", "rope_inside"),
    ("rope_tip", "block"),
    ("block", "rope_inside"),
    ("block", "blade"),
    ("blade", "plate"),
    ("blade_root", "rope_tip"),
    ("slat", "plate"),
    ("ground", "slat"),
    ("rope_inside", "rope_tip"),
]
"""First and second marker; the last pair shares its body."""


def random_state(rng, size=0.15):
    """Coordinates (N,) of bodies that are placed, turned and deformed at random."""
    x = rng.normal(size=N)
    for mesh, columns in MESHED:
        angle, place = rng.uniform(-1.2, 1.2), rng.normal(size=2)
        vectors = mesh.undeformed + size * rng.normal(size=mesh.undeformed.shape)
        c, s = np.cos(angle), np.sin(angle)
        x[columns] = (vectors @ np.array([[c, s], [-s, c]]) + mesh.positions[:, None] * place).ravel()
    x[BLADE.start + 3 : BLADE.stop] *= size
    return x


PLACES = {
    "hub": (0.0, 0.0),
    "plate": (0.4, -0.3),
    "rope_tip": (1.2, 0.0),
    "rope_inside": (0.4, 0.0),
    "block": (0.8, 0.1),
    "blade_root": (0.0, 0.0),
    "blade": (0.9, 0.0),
    "slat": (0.8, 0.1),
}
"""Where the markers of undeformed bodies stand in the frames of their bodies."""


def undeformed(turn, origin):
    """Coordinates (N,) of all bodies undeformed, their frames turned by a matrix and put in one place."""
    x = np.zeros(N)
    for columns in (HUB, PLATE, BLADE):
        x[columns.start : columns.start + 3] = [*origin, np.arctan2(turn[1, 0], turn[0, 0])]
    for mesh, columns in MESHED:
        x[columns] = (mesh.undeformed @ turn.T + mesh.positions[:, None] * origin).ravel()
    return x


def rigid_motions(x):
    """Rates of all bodies in each common shift along an axis and turn about one, shape (n, N)."""
    return np.array([rigid_motion(x, one[:2], one[2:]) for one in np.eye(3)])


def rigid_motion(x, velocity, spin):
    """Rates (N,) of all bodies in one common rigid motion about the inertial origin."""
    u, (omega,) = np.zeros(N), spin
    for columns in (HUB, PLATE, BLADE):
        i = columns.start
        u[i : i + 3] = [velocity[0] - omega * x[i + 1], velocity[1] + omega * x[i], omega]
    for mesh, columns in MESHED:
        z = x[columns].reshape(-1, 2)
        turned = omega * np.stack([-z[:, 1], z[:, 0]], axis=-1)
        u[columns] = (turned + mesh.positions[:, None] * np.asarray(velocity)).ravel()
    return u


DEAD_CENTRE = """hfsim: 1
bodies:
  crank: {type: rigid, mass: 1.0, inertia: 0.01, points: {pivot: [-0.1, 0.0], end: [0.1, 0.0]}}
  rod: {type: rigid, mass: 1.0, inertia: 0.05, points: {start: [-0.3, 0.0], end: [0.3, 0.0]}}
  slider: {type: rigid, mass: 1.0, inertia: 0.1}
joints:
  axle: {type: revolute, between: [ground, crank.pivot]}
  pin: {type: revolute, between: [crank.end, rod.start]}
  wrist: {type: revolute, between: [rod.end, slider]}
  rail: {type: prismatic, between: [ground, slider]}
  push: {type: driver, between: [ground, slider], position: {type: constant_rate, rate: 0.2,
         start: 0.683974572191}}
initial:
  crank: {angle: 1.0}
  rod: {angle: -0.284304905894}
  slider: {position: [0.683974572191, 0.0]}
solve: {duration: 2.0, tolerance: 1.0e-5}
"""

WHIP = """
hfsim: 1
materials: {pom: {density: 1400, youngs_modulus: 3 GPa, bending_damping: 1.0e-4, axial_damping: 1.0e-5}}
sections: {r: {shape: circle, diameter: 2 cm}}
bodies:
  base: {type: rigid, mass: 3, inertia: [0.05, 0.05, 0.08], points: {top: [0, 0, 0.2]}}
  link: {type: beam, material: pom, section: r, length: 0.7, elements: 2, degree: 2}
  hand: {type: rigid, mass: 0.4, inertia: [0.001, 0.001, 0.001]}
joints:
  yaw: {type: revolute, between: [ground, base], axis: [0, 0, 1]}
  pitch: {type: revolute, between: [base.top, link.root], axis: [0, 1, 0]}
  grip: {type: fixed, between: [link.tip, hand]}
  yawdrive: {type: driver, between: [ground, base], axis: [0, 0, 1],
    angle: {type: smooth_step, from: 0, to: 1.5, start: 0, end: 0.4}}
  pitchdrive: {type: servo, between: [base.top, link.root], axis: [0, 1, 0],
    angle: {expression: "-0.5*sin(4*t)"}, stiffness: 300, damping: 10}
solve: {method: radau, duration: 0.05, tolerance: 1.0e-5}
output: {interval: 0.004, channels: [hand.x, link.root.torsion_moment]}
"""
"""Of its torsion, Gauss collocation at 1e-8 leaves a fast swing of 6 % undamped; radau damps it."""
