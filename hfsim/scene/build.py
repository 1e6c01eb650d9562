"""From a deck to an assembled scene: coordinates numbered, names resolved, equations put together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Literal, NamedTuple

import numpy as np

from hfsim.deck.fields import split_point
from hfsim.deck.materials import BeamProperties
from hfsim.maths.arrays import Array, IntArray
from hfsim.maths.matrices import DENSE_UP_TO, Entries, Matrix, assemble
from hfsim.maths.rank import dependence
from hfsim.mechanics.body import Body
from hfsim.mechanics.connectivity import Connectivity
from hfsim.mechanics.constraints import Along, Constraint, RelativeAngle
from hfsim.mechanics.elimination import eliminate
from hfsim.mechanics.equations import Equations, VariableMass
from hfsim.mechanics.force import ConstantForce, ForcePart
from hfsim.mechanics.increments import NaturalIncrements
from hfsim.mechanics.markers import GroundMarker, Marker
from hfsim.mechanics.pose import Pose
from hfsim.mechanics.reduction import Reduction
from hfsim.mechanics.system import System
from hfsim.parts.bodies import BeamSpec, RigidSpec
from hfsim.parts.bodies.folded import FoldedBody
from hfsim.parts.bodies.frame import FrameChart
from hfsim.parts.bodies.linear import LinearElasticForce
from hfsim.parts.bodies.low_order import LowOrderBeam
from hfsim.parts.bodies.low_order_body import LowOrderBody
from hfsim.parts.bodies.mesh import BeamMesh
from hfsim.parts.bodies.models import MODELS, Model
from hfsim.parts.bodies.natural import InteriorBeams, NaturalBeams
from hfsim.parts.bodies.nodal import NodalBeam
from hfsim.parts.bodies.rigid import RigidBody
from hfsim.parts.bodies.rigid_beam import RigidBeam
from hfsim.parts.elements import (
    ELEMENTS,
    Cable,
    ElasticLaw,
    Inertia,
    Measures,
    Stiffness,
    elastic_law,
    join_laws,
)
from hfsim.parts.elements.forces import ElasticForce, KelvinVoigtForce
from hfsim.scene.loading import LoadedDeck
from hfsim.scene.rules import LeftOut, apply_rules, connected, still_bodies, welds
from hfsim.scene.schema import Deck
from hfsim.scene.start import Start, starting_state


@dataclass(frozen=True)
class Scene:
    """A deck with a model for each of its beams, ready to be simulated.

    Attributes
    ----------
    loaded : LoadedDeck
    model : str
        Of the beams that have none of their own.
    models : dict of str to str
        Model of each beam.
    system : System
    bodies : dict of str to Body
    joints : dict of str to tuple of int
        Which constraints of the system each joint is made of.
    q, v : ndarray, shape (n,)
        State at the start, consistent with the joints.
    start_angles : dict of str to float
        Angle of each body frame at the start, with the full turns the deck states [rad].
    left_out : LeftOut
        What the rules found that the scene does not need.
    parts : tuple of Part
        Parts that nothing connects and that are integrated by themselves; none where all is one.
    """

    loaded: LoadedDeck
    model: str
    models: dict[str, str]
    system: System
    bodies: dict[str, Body]
    joints: dict[str, tuple[int, ...]]
    q: Array
    v: Array
    start_angles: dict[str, float]
    left_out: LeftOut
    parts: tuple[Part, ...] = ()

    @property
    def deck(self) -> Deck:
        """The deck."""
        return self.loaded.deck

    def marker(self, point: str) -> Marker:
        """Return the marker of a point such as ``b1.tip``."""
        return find_marker(point, self.bodies, self.deck)


class Part(NamedTuple):
    """A part of a scene that nothing connects to the rest.

    Attributes
    ----------
    bodies : tuple of str
    scene : Scene
        The part alone.
    columns : ndarray of int
        Where its state stands in that of the whole scene.
    """

    bodies: tuple[str, ...]
    scene: Scene
    columns: IntArray


FALLBACK = "exact"
"""Model of beams whose model is to be chosen in the run, where nothing chooses."""


def build(loaded: LoadedDeck, model: str | None = None, models: Mapping[str, str] | None = None) -> Scene:
    """Assemble a scene.

    Parameters
    ----------
    loaded : LoadedDeck
    model : str, optional
        Instead of the deck's ``solve.model``; beams with a model of their own keep it.
    models : mapping of str to str, optional
        Models of some beams, whatever the deck says.

    Raises
    ------
    DeckError
        If the initial state contradicts the joints, or joints are redundant.
    """
    deck = loaded.deck
    name = model or deck.solve.model
    named = deck.models(name) | dict(models or {})
    named = {beam: FALLBACK if one == "auto" else one for beam, one in named.items()}
    kinds = {beam: MODELS[one].stepping_in(_coordinates(loaded, one)) for beam, one in named.items()}
    bodies = _bodies(deck, kinds)
    joints, constraints = _joints(deck, bodies)
    start = Start(
        bodies=bodies,
        initial=deck.initial,
        constraints=constraints,
        joints=joints,
        refuse=loaded.problem,
    )
    x, u, angles = starting_state(start)
    left_out = apply_rules(deck, kinds)
    if left_out.fires("fixed_bodies"):
        moving = _moving_columns(bodies, still_bodies(deck, kinds))
        bodies = _folded(deck, kinds, bodies, x, angles)
        joints, constraints = _joints(deck, bodies, left_out)
        x, u = x[moving], u[moving]
    elif left_out.fires("standing_drivers"):
        joints, constraints = _joints(deck, bodies, left_out)
    system = _system(deck, kinds, bodies, constraints, left_out, x)
    _check_independent(loaded, system, joints, x)
    near = np.zeros((1, system.n_x))
    for body in bodies.values() if system.charts else ():
        if body.angle_column is not None:
            near[0, body.angle_column] = angles[body.name]
    q, v = system.state(x[None], u[None], system.reduction.free_rates(near))
    q, v = system.project(np.zeros(1), q, v)
    scene = Scene(loaded, name, named, system, bodies, joints, q[0], v[0], angles, left_out)
    return replace(scene, parts=_parts(scene, kinds)) if left_out.fires("parts") else scene


def _parts(scene: Scene, kinds: Mapping[str, Model]) -> tuple[Part, ...]:
    """Assemble each part by itself."""
    still = still_bodies(scene.deck, kinds)
    return tuple(_part(scene, group, still) for group in connected(scene.deck, still))


def _part(scene: Scene, group: tuple[str, ...], still: tuple[str, ...]) -> Part:
    deck, there = scene.deck, {"ground", *group, *still}

    def tied(entries: dict[str, Any]) -> dict[str, Any]:
        return {k: e for k, e in entries.items() if {split_point(end)[0] for end in e.between} <= there}

    update = {
        "bodies": {name: spec for name, spec in deck.bodies.items() if name in there},
        "joints": tied(deck.joints),
        "springs": tied(deck.springs),
        "loads": {k: load for k, load in deck.loads.items() if split_point(load.at)[0] in there},
        "initial": {name: entry for name, entry in deck.initial.items() if name in there},
    }
    own = {name: model for name, model in scene.models.items() if name in there}
    part = build(LoadedDeck(deck.model_copy(update=update), scene.loaded.source), scene.model, own)
    columns = [np.arange(scene.bodies[n].columns.start, scene.bodies[n].columns.stop) for n in group]
    x_columns, of_x = np.concatenate(columns), np.zeros(scene.system.n_x, dtype=np.intp)
    of_x[scene.system.reduction.rows] = np.arange(scene.system.n)
    return Part(group, part, of_x[x_columns[part.system.reduction.rows]])


def _moving_columns(bodies: dict[str, Body], still: tuple[str, ...]) -> IntArray:
    moving = (body.columns for name, body in bodies.items() if name not in still)
    return np.concatenate([np.arange(columns.start, columns.stop) for columns in moving])


def _folded(
    deck: Deck, models: Mapping[str, Model], bodies: dict[str, Body], x: Array, angles: dict[str, float]
) -> dict[str, Body]:
    """Number the coordinates anew without the bodies that cannot move."""
    places = {
        name: bodies[name].marker((0.0, 0.0)).position(x[None])[0] for name in still_bodies(deck, models)
    }
    folded = {
        name: FoldedBody(name, Pose.planar(place, angles[name]), bodies[name].points)
        for name, place in places.items()
    }
    return _bodies(deck, models, folded)


def _coordinates(loaded: LoadedDeck, model: str) -> Literal["auto", "frame", "absolute"]:
    """Return the coordinates to make steps in: those with a constant mass matrix for the method energy.

    Raises
    ------
    DeckError
        If the model has none.
    """
    solve = loaded.deck.solve
    if solve.method != "energy":
        return solve.coordinates
    if MODELS[model].strain == "low_order":
        why = f"energy needs a constant mass matrix, and that of {model} changes with the motion"
        raise loaded.problem("solve.method", why, "take gauss, or another model")
    return "absolute"


def find_marker(point: str, bodies: dict[str, Body], deck: Deck) -> Marker:
    """Return the marker of a point as decks name it: ``BODY``, ``BODY.tip``, ``ground.name``."""
    owner, name = split_point(point)
    if owner == "ground":
        place = deck.ground.points[name] if name else (0.0, 0.0)
        return GroundMarker((place[0], place[1]))
    body = bodies[owner]
    return body.marker(body.points[name] if name else (0.0, 0.0))


def _bodies(
    deck: Deck, models: Mapping[str, Model], folded: dict[str, FoldedBody] | None = None
) -> dict[str, Body]:
    """Number the coordinates: each body that is not folded has a run of its own in x."""
    bodies: dict[str, Body] = {}
    at = 0
    for name, spec in deck.bodies.items():
        if folded and name in folded:
            bodies[name] = folded[name]
            continue
        points = {key: (place[0], place[1]) for key, place in spec.points.items()}
        if isinstance(spec, RigidSpec):
            bodies[name] = RigidBody(name, slice(at, at + 3), spec.mass, spec.inertia, points)
        else:
            points |= {"root": (0.0, 0.0), "tip": (spec.length, 0.0)}
            bodies[name] = _beam(deck, name, spec, models[name], points, at)
        at = bodies[name].columns.stop
    return bodies


def _beam(
    deck: Deck, name: str, spec: BeamSpec, model: Model, points: dict[str, tuple[float, float]], at: int
) -> Body:
    """Return a beam whose coordinates begin at a column."""
    mesh = _mesh(deck, name, spec)
    if model.strain == "none":
        return RigidBeam.of(name, slice(at, at + 3), mesh, points)
    columns = slice(at, at + 2 * mesh.n_vectors)
    if model.strain == "low_order":
        return LowOrderBody(name, _low_order_beam(deck, name, mesh, columns), points)
    return NodalBeam(name, columns, mesh, model.frame, points)


def _mesh(deck: Deck, name: str, spec: BeamSpec) -> BeamMesh:
    beam = deck.properties(name)
    rotary = beam.rotary_inertia if spec.rotary_inertia else 0.0
    inertia = Inertia(beam.mass_per_length, rotary, beam.height)
    length = spec.length / spec.elements
    element = Cable(length, spec.degree) if spec.element == "cable" else ELEMENTS[spec.element](length)
    return BeamMesh(element, spec.elements, inertia)


def _stiffness(beam: BeamProperties) -> Stiffness:
    return Stiffness(
        axial=beam.axial_stiffness,
        bending=beam.bending_stiffness,
        lame_lambda=beam.lame_lambda,
        lame_mu=beam.lame_mu,
        height=beam.height,
        width=beam.width,
    )


def _measures(spec: BeamSpec) -> Measures:
    if spec.quadrature is None:
        return Measures(spec.strain, spec.curvature)
    return Measures(spec.strain, spec.curvature, spec.quadrature.axial, spec.quadrature.bending)


def _low_order_beam(deck: Deck, name: str, mesh: BeamMesh, columns: slice) -> LowOrderBeam:
    spec = deck.bodies[name]
    assert isinstance(spec, BeamSpec)
    beam = deck.properties(name)
    return LowOrderBeam(
        name=name,
        mesh=mesh,
        columns=columns,
        axial=beam.axial_stiffness,
        bending=beam.bending_stiffness,
        axial_damping=beam.axial_damping,
        bending_damping=beam.bending_damping,
        gravity=(deck.gravity[0], deck.gravity[1]),
        whole=spec.truncation == "none",
        item=f"bodies.{name}",
    )


def _joints(
    deck: Deck, bodies: dict[str, Body], left_out: LeftOut | None = None
) -> tuple[dict[str, tuple[int, ...]], tuple[Constraint, ...]]:
    joints: dict[str, tuple[int, ...]] = {}
    constraints: list[Constraint] = []
    held = welds(deck, [name for name, body in bodies.items() if isinstance(body, FoldedBody)])
    for name, spec in deck.joints.items():
        first, second = (find_marker(point, bodies, deck) for point in spec.between)
        rows = () if name in held else spec.build(first, second)
        rows = tuple(replace(row, item=f"joints.{name}") for row in rows)  # type: ignore[type-var]
        if left_out is not None and f"joints.{name}" in left_out["standing_drivers"]:
            rows = tuple(_standing(row) for row in rows)
        joints[name] = tuple(range(len(constraints), len(constraints) + len(rows)))
        constraints.extend(rows)
    return joints, tuple(constraints)


def _standing(row: Constraint) -> Constraint:
    """Return the equation of a driver whose law is constant as that of a joint."""
    if isinstance(row, RelativeAngle) and row.law is not None:
        return replace(row, offset=row.offset + float(row.law.value(0.0)), law=None)
    assert isinstance(row, Along)
    return replace(row, law=None)


def _system(
    deck: Deck,
    models: Mapping[str, Model],
    bodies: dict[str, Body],
    constraints: tuple[Constraint, ...],
    left_out: LeftOut,
    x: Array,
) -> System:
    n = len(x)
    sparse = n > DENSE_UP_TO and not any(model.frame for model in models.values())
    mass = _constant_mass(bodies, n, sparse)
    variable = [body.beam for body in bodies.values() if isinstance(body, LowOrderBody)]
    forces: list[ForcePart] = list(variable)
    if not left_out.fires("weight"):
        forces.append(_weight(deck, bodies, mass))
    forces += [*_beam_forces(deck, models, bodies, left_out, n)]
    forces += _springs_and_loads(deck, bodies, left_out, x)
    beams = [body for body in bodies.values() if isinstance(body, NodalBeam)]
    masses: tuple[VariableMass, ...] = tuple(variable)
    moving = {name: body for name, body in bodies.items() if not isinstance(body, FoldedBody)}
    free = eliminate(moving, constraints if left_out.fires("tree_joints") else (), sparse)
    framed = [beam for beam in beams if beam.framed]
    # natural increments are those of the Green strain
    exact = [beam for beam in beams if models[beam.name].strain == "exact"]
    natural = NaturalIncrements(
        tuple(_natural(run) for run in _runs(exact)), free.reduction, free.ties, free.natural_columns
    )
    return System(
        charts=tuple(_chart(run, free.reduction) for run in _runs(framed)),
        forces=tuple(forces),
        equations=Equations(mass, masses, constraints, free.reduction, left_out.fires("constant_mass")),
        natural=natural if exact else None,
        keeps_rates=not left_out.fires("rates"),
        keeps_work=not left_out.fires("work"),
    )


def _constant_mass(bodies: dict[str, Body], n: int, sparse: bool) -> Matrix:
    parts = []
    for body in bodies.values():
        if isinstance(body, NodalBeam):
            block = np.kron(body.mesh.element.mass(body.mesh.inertia), np.eye(2))
            columns = _element_columns(body)
            parts.append(Entries.of_block(columns, columns, np.tile(block, (len(columns), 1, 1))))
        elif isinstance(body, RigidBody):
            columns = np.arange(body.columns.start, body.columns.stop)
            parts.append(Entries(columns, columns, np.array([body.mass, body.mass, body.inertia])))
    return assemble(parts, (n, n), sparse)


def _weight(deck: Deck, bodies: dict[str, Body], mass: Matrix) -> ConstantForce:
    """Weight as mass times a uniform field of accelerations."""
    energy = 0.0
    field = np.zeros(mass.shape[0])
    for body in bodies.values():
        if isinstance(body, NodalBeam):
            field[body.columns] = np.kron(body.mesh.positions, deck.gravity)
        elif isinstance(body, RigidBody):
            field[body.columns] = [*deck.gravity, 0.0]
        elif isinstance(body, FoldedBody):
            spec = deck.bodies[body.name]
            assert isinstance(spec, RigidSpec)
            energy -= spec.mass * float(np.dot(deck.gravity, body.pose.origin))
    return ConstantForce(mass @ field, energy)


def _runs(beams: list[NodalBeam]) -> Iterable[list[NodalBeam]]:
    """Yield beams that stand side by side and have alike meshes together: one batched map serves them."""
    run: list[NodalBeam] = []
    for beam in beams:
        if run and not _alike(run[-1], beam):
            yield run
            run = []
        run.append(beam)
    if run:
        yield run


def _columns(run: list[NodalBeam]) -> slice:
    return slice(run[0].columns.start, run[-1].columns.stop)


def _chart(run: list[NodalBeam], reduction: Reduction) -> FrameChart:
    return FrameChart(reduction.free_columns(_columns(run)), len(run), run[0].mesh.element.stride)


def _natural(run: list[NodalBeam]) -> NaturalBeams:
    element = run[0].mesh.element
    kind = InteriorBeams if element.stride > element.per_node else NaturalBeams
    return kind(_columns(run), len(run), element.stride, element.length, run[0].framed)


def _alike(a: NodalBeam, b: NodalBeam) -> bool:
    side_by_side = a.columns.stop == b.columns.start and a.framed == b.framed
    return side_by_side and np.array_equal(a.mesh.undeformed, b.mesh.undeformed)


def _beam_forces(
    deck: Deck, models: Mapping[str, Model], bodies: dict[str, Body], left_out: LeftOut, n: int
) -> Iterable[ForcePart]:
    beams: list[NodalBeam] = []
    for body in bodies.values():
        if isinstance(body, NodalBeam) and models[body.name].strain == "linear":
            yield _linear_force(deck, body)
        elif isinstance(body, NodalBeam):
            beams.append(body)
    groups: dict[object, list[NodalBeam]] = {}
    for body in beams:
        groups.setdefault(_law_kind(deck, body), []).append(body)
    for group in groups.values():
        yield _elastic_force(deck, group, n)
    for body in beams:
        if f"damping of bodies.{body.name}" not in left_out["damping"]:
            yield _kelvin_voigt(deck, body, n)


def _spec(deck: Deck, body: Body) -> BeamSpec:
    spec = deck.bodies[body.name]
    assert isinstance(spec, BeamSpec)
    return spec


def _law_kind(deck: Deck, body: NodalBeam) -> object:
    """Return what must be equal for two beams to share one batched law."""
    spec = _spec(deck, body)
    if spec.element == "continuum" or deck.solve.elastic_form != "gram":
        return (spec.element, _stiffness(deck.properties(body.name)), body.mesh.element.length)
    return (spec.element, spec.degree, _measures(spec))


def _elastic_force(deck: Deck, group: list[NodalBeam], n: int) -> ElasticForce:
    laws, parts = [], []
    for body in group:
        law, local = _elastic_law(deck, body)
        laws.append(law)
        parts.append(_connectivity(body, n, local))
    return ElasticForce(reduce(lambda a, b: a.joined(b), parts), join_laws(laws))


def _elastic_law(deck: Deck, body: NodalBeam) -> tuple[ElasticLaw, Array]:
    """Return the law of a beam in the form asked for, and the matrix to an element's vectors."""
    spec, stiffness = _spec(deck, body), _stiffness(deck.properties(body.name))
    element, form = body.mesh.element, deck.solve.elastic_form
    return elastic_law(form, element, stiffness, spec.elements, _measures(spec))


def _connectivity(body: NodalBeam, n: int, vectors: Array) -> Connectivity:
    """Return how the vectors of each element follow, ``vectors`` being the matrix from its nodal vectors."""
    columns = _element_columns(body)
    return Connectivity(n, columns, np.tile(np.kron(vectors, np.eye(2)), (len(columns), 1, 1)))


def _element_columns(body: NodalBeam) -> IntArray:
    """Return the coordinates of each element, shape (n_elements, k)."""
    element = body.mesh.element
    first = body.columns.start + 2 * element.stride * np.arange(body.mesh.count)
    return np.asarray(first[:, None] + np.arange(2 * element.differences().shape[1]))


def _linear_force(deck: Deck, body: NodalBeam) -> LinearElasticForce:
    """Linearise the element's own energy about the undeformed state."""
    spec, mesh, beam = _spec(deck, body), body.mesh, deck.properties(body.name)
    stiffness = _stiffness(beam)
    local = np.kron(mesh.differences, np.eye(2))
    straight = (mesh.differences @ mesh.undeformed).reshape(1, spec.elements, -1, 2)

    def matrix(stiffness: Stiffness, curvature: str) -> Array:
        measures = _measures(spec)._replace(curvature=curvature)
        H = mesh.element.law(stiffness, spec.elements, measures).hessian(straight)[0]
        k = H.shape[-1]
        return sum(
            (local[e * k : (e + 1) * k].T @ H[e] @ local[e * k : (e + 1) * k] for e in range(spec.elements)),
            np.zeros((local.shape[1], local.shape[1])),
        )

    K = matrix(stiffness, spec.curvature)
    damping = np.zeros_like(K)
    if beam.damped:
        # as KelvinVoigtForce, which damps the curvature (r' x r'')/|r'|^2 whatever the deck's
        axial = matrix(stiffness.without_bending(), "exact")
        both = matrix(stiffness, "exact")
        damping = beam.axial_damping * axial + beam.bending_damping * (both - axial)
    return LinearElasticForce(
        body.name, body.columns, K, damping, mesh.undeformed, mesh.positions, item=f"bodies.{body.name}"
    )


def _kelvin_voigt(deck: Deck, body: NodalBeam, n: int) -> KelvinVoigtForce:
    beam = deck.properties(body.name)
    return KelvinVoigtForce.of(
        elements=_connectivity(body, n, body.mesh.element.differences()),
        degree=_spec(deck, body).degree,
        axial=beam.axial_stiffness * body.mesh.element.length * beam.axial_damping,
        bending=beam.bending_stiffness / body.mesh.element.length * beam.bending_damping,
    )


def _springs_and_loads(deck: Deck, bodies: dict[str, Body], left_out: LeftOut, x: Array) -> list[ForcePart]:
    found: dict[str, ForcePart] = {}
    for name, spring in deck.springs.items():
        first, second = (find_marker(point, bodies, deck) for point in spring.between)
        if spring.type == "two_point":
            gap = second.position(x[None]) - first.position(x[None])
            found[f"springs.{name}"] = spring.build(first, second, float(np.linalg.norm(gap)))
        else:
            found[f"springs.{name}"] = spring.build(first, second)
    for name, load in deck.loads.items():
        found[f"loads.{name}"] = load.build(find_marker(load.at, bodies, deck))
    gone = {*left_out["springs"], *left_out["loads"]}
    return [replace(part, item=item) for item, part in found.items() if item not in gone]


def _check_independent(
    loaded: LoadedDeck, system: System, joints: dict[str, tuple[int, ...]], x: Array
) -> None:
    """Refuse joints that block the same motion twice: no multipliers would be determined.

    Raises
    ------
    DeckError
        Naming the joints whose equations depend on one another.
    """
    own = system.equations
    rows = own.jacobians(x[None])[0] @ own.reduction.basis
    if not dependence(rows, own.rows, {}).missing:
        return
    equations = system.unreduced
    found = dependence(equations.jacobians(x[None])[0], equations.rows, joints)
    *others, last = found.joints
    raise loaded.problem(
        f"joints.{last}",
        f"blocks what {_listed(loaded, others) or 'it'} already block{'s' if len(others) < 2 else ''}: "
        f"{found.missing} of {equations.n_rows} joint equations are redundant",
        "remove a joint or free one of its motions",
    )


def _listed(loaded: LoadedDeck, names: list[str]) -> str:
    lines = {name: loaded.line_of(f"joints.{name}") for name in names}
    return ", ".join(f"'{name}' (line {line})" if line else f"'{name}'" for name, line in lines.items())
