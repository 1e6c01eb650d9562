"""The deck: all that a YAML file may say; `hfsim.scene.loading` reads one."""

import math
import typing
from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from hfsim.deck.complaints import Complaint, refusal, shown
from hfsim.deck.fields import (
    LONGEST_NAME,
    AccelerationVector,
    Count,
    EmptyAllowed,
    Flag,
    FlagOrCsv,
    Name,
    NamesOf,
    Points,
    PositiveTime,
    SomeTimes,
    UnitInterval,
    measures,
    read_text,
    split_point,
    whole,
)
from hfsim.deck.made_of import beam_properties, section_properties
from hfsim.deck.materials import MaterialSpec
from hfsim.deck.reader import Path
from hfsim.deck.sections import SectionSpec
from hfsim.deck.source import did_you_mean
from hfsim.deck.spec import Around, ReadBy, Spec, entry_of, named_in
from hfsim.integrators import steps_in_absolute_coordinates
from hfsim.maths.memory import available, in_bytes
from hfsim.parts.bodies import AnyBody, BeamSpec
from hfsim.parts.channels import is_judged
from hfsim.parts.forces import AnyLoad, AnySpring
from hfsim.parts.joints import AnyJoint
from hfsim.scene.initial import AT_REST, STEADY, AnyInitial, EquilibriumSpec, InitialSpec, SteadySpec

if typing.TYPE_CHECKING:
    from hfsim.deck.stations import BeamAlong, SectionsAlong

FORMAT = 1
"""The deck format this version reads."""
_LONG_HISTORY, _LONGEST_HISTORY = 1e8, 64e9
"""Bytes of a history from which it is asked whether they are there, and beyond which it is refused anyway."""
_COPIES, _PER_ROW = 3, 250.0
"""How often a history is held at a time, at most; and what else a row takes meanwhile [byte]."""
LEAST_TOLERANCE = 1e-14
"""Tolerance below which errors of steps are rounding."""


def _read_format(value: object) -> int:
    if isinstance(value, bool) or value != FORMAT:
        message = f"deck format {shown(value)} is unknown; this version of hfsim reads format {FORMAT}"
        raise refusal(message, f"hfsim: {FORMAT}")
    return FORMAT


def _read_deck_name(value: object) -> str:
    name = read_text(value)
    if not name.strip() or set("/\\") & set(name) or name.startswith("-") or not name.isprintable():
        raise refusal(f"{shown(name)} cannot be a name", "it becomes the name of a folder")
    if len(name.encode()) > LONGEST_NAME:
        why = f"at most {LONGEST_NAME} bytes: it becomes the name of a folder"
        raise refusal(f"{shown(name)} is too long", why)
    return name


_FILE = {"type": "string"}


def _read_nothing(value: object) -> None:
    """Take what has been worked out before."""


class GroundSpec(Spec):
    """The scene's ground."""

    vectors = ("points",)

    points: Points = Field(default_factory=dict)
    """Named points of the ground [m]."""


class SolveSpec(Spec):
    """What is solved, and how."""

    model: Annotated[str, named_in("hfsim.parts.bodies.models.MODELS", "auto")] = "exact"
    """Model of the beams that have none of their own; auto: the cheapest that suffices, chosen in the run."""

    model_error: Annotated[float, measures(above=0, at_most=1)] = 0.01
    """Error of a beam's tip, relative to its range, that models chosen by auto may make [-]."""

    duration: PositiveTime
    """Time to simulate [s]."""

    method: Annotated[str, named_in("hfsim.integrators.METHODS", "auto")] = "auto"
    """Integration method."""

    tolerance: Annotated[float, measures(at_least=LEAST_TOLERANCE, at_most=0.1)] = 1e-6
    """Tolerance of the steps' error [-]."""

    step: PositiveTime | None = None
    """Fixed step [s]; without it, steps follow the tolerance."""

    order: Annotated[int, whole(at_most=5)] | None = None
    """Order of the method gear [-]."""

    stages: Annotated[int, whole(at_most=24)] | None = None
    """Stages of the methods gauss, radau and energy [-]."""

    rho_inf: UnitInterval = 0.8
    """Spectral radius at infinite frequency of the method generalized_alpha [-]."""

    coordinates: Literal["auto", "frame", "absolute"] = "auto"
    """Coordinates the steps are made in: the model's own with a body frame, or absolute nodal ones that are
    mapped to the frame for output; lowOrder of a cable has only its own."""

    elastic_form: Annotated[str, named_in("hfsim.parts.elements.ELASTIC_FORMS")] = "gram"
    """How exact and ancf compute the elastic force: all give the same to round-off, gram is the fastest."""

    max_steps: Count | None = None
    """Steps after which the run stops [-]."""

    keep: tuple[Annotated[str, ReadBy(read_text, type="string")], ...] = ()
    """Rules that are not to leave anything out; `hfsim plan` names them."""

    keep_all: Flag = False
    """Build and compute everything, whether the scene needs it or not: for checking."""

    target_error: Annotated[float, measures(above=0, at_most=0.5)] | None = None
    """Total error, of mesh and time, that `run` is to reach by its choice of elements, degrees, tolerance and
    method (if that is auto): largest over time in the worst channel, relative to the channel's range [-]."""

    target_channels: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Channels that must reach the target error; all but energy.total and constraint residuals without it."""

    budget: PositiveTime | None = None
    """Time that a run may take [s]; the search for a target error takes 60 without it."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a step longer than the run, and keys that do not go together."""
        if self.target_error is None:
            if self.target_channels is not None:
                why = "goes with target_error or elements: auto only"
                yield Complaint(("target_channels",), why, "give target_error, e.g. 1e-3")
        elif self.step is not None:
            yield Complaint(
                ("step",), "target_error and elements: auto choose the steps", "remove one of them"
            )
        if self.coordinates == "frame" and steps_in_absolute_coordinates(self.method):
            why = f"method {self.method} makes its steps in absolute coordinates"
            yield Complaint(("coordinates",), why, "leave this entry out")
        if self.step is not None and self.step > self.duration:
            yield Complaint(
                ("step",), f"a step of {self.step:g} s is longer than the run, {self.duration:g} s"
            )

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield target channels that the output has not, or that have no range."""
        judged = [name for name in around.channels or () if is_judged(name)]
        for index, name in enumerate(self.target_channels or () if around.channels else ()):
            path = ("target_channels", index)
            if name not in (around.channels or ()):
                yield Complaint(path, f"'{name}' is not among output.channels", did_you_mean(name, judged))
            elif name not in judged:
                yield Complaint(path, f"'{name}' has no range that errors could be measured by")


class OutputSpec(Spec):
    """What is written."""

    interval: PositiveTime | None = None
    """Time between rows [s]; a 200th of the duration without it."""

    channels: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Columns; without it, the tips of beams, the rigid bodies and the total energy."""

    plots: Flag = True
    """Whether pictures are drawn."""

    shapes: FlagOrCsv = False
    """Whether the points of all bodies over time are written, as shapes.npz; csv: as shapes.csv too."""

    snapshots: SomeTimes = ()
    """Times at which the bodies are drawn, and what runs inside each beam along it [s]."""

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an interval that makes too many rows."""
        rows = (around.duration or 0.0) / (self.interval or math.inf)
        columns = 1 + len(self.channels or ())
        needed = rows * (8.0 * _COPIES * columns + _PER_ROW)
        if needed > _LONG_HISTORY and needed > (there := min(available(), _LONGEST_HISTORY)):
            size = f"{rows:.3g} rows of {columns} columns would take about {in_bytes(needed)} of memory"
            yield Complaint(("interval",), f"{size}, at most {in_bytes(there)} can be had", "lengthen it")
        for number, time in enumerate(self.snapshots):
            if time > (around.duration or math.inf):
                why = f"{time:g} s is after the end of the run, {around.duration:g} s"
                yield Complaint(("snapshots", number), why, f"at most {around.duration:g}")

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an interval longer than the run."""
        if self.interval is not None and around.duration is not None and self.interval > around.duration:
            message = f"{self.interval:g} s is longer than the run, {around.duration:g} s"
            yield Complaint(("interval",), message, f"'{self.interval:g} ms'?")


class Deck(Spec):
    """A scene and what is asked of it."""

    hfsim: Annotated[Literal[1], ReadBy(_read_format, const=1)]
    """Deck format, 1."""

    name: Annotated[str, ReadBy(_read_deck_name, type="string")] = "deck"
    """Name of the scene; the file's name without it."""

    include: Annotated[Any, ReadBy(_read_nothing, anyOf=[_FILE, {"type": "array", "items": _FILE}])] = Field(
        default=None, exclude=True
    )
    """A file in the deck's folder, or a list of such, that holds parts of the deck."""

    parameters: Annotated[dict[str, Any], EmptyAllowed] = Field(default_factory=dict, exclude=True)
    """Numbers by name: numbers, text with a unit, or expressions of others such as "${length / 2}", which may
    stand wherever a number does."""

    gravity: AccelerationVector = (0.0, 0.0)
    """Acceleration of gravity [m/s^2]; two numbers: planar scene, three: spatial."""

    materials: Annotated[dict[Name, MaterialSpec], EmptyAllowed] = Field(default_factory=dict)
    """Materials."""

    sections: Annotated[dict[Name, SectionSpec], EmptyAllowed] = Field(default_factory=dict)
    """Cross-sections."""

    ground: GroundSpec = Field(default_factory=GroundSpec.model_construct)
    """Ground."""

    bodies: Annotated[dict[Name, AnyBody], EmptyAllowed]
    """Bodies, at least one."""

    joints: Annotated[dict[Name, AnyJoint], EmptyAllowed] = Field(default_factory=dict)
    """Joints."""

    springs: Annotated[dict[Name, AnySpring], EmptyAllowed] = Field(default_factory=dict)
    """Springs and dampers."""

    loads: Annotated[dict[Name, AnyLoad], EmptyAllowed] = Field(default_factory=dict)
    """Forces and moments from outside."""

    initial: Annotated[
        dict[Name, AnyInitial], EmptyAllowed, NamesOf(("bodies", "joints"), AT_REST, STEADY)
    ] = Field(default_factory=dict)
    """Initial motion, by body; equilibrium: true, or a list of bodies, starts these from where they rest;
    steady: a body and its rate starts from steady rotation."""

    solve: SolveSpec
    """What is solved, and how."""

    output: OutputSpec = Field(default_factory=OutputSpec.model_construct)
    """What is written."""

    verify: Annotated[Any, entry_of("hfsim.scene.published.VerifySpec")] = Field(default=None, exclude=True)
    """Published values that `hfsim verify` holds the deck against."""

    sweep: Annotated[Any, entry_of("hfsim.scene.swept.SweepSpec")] = Field(default=None, exclude=True)
    """Values that `hfsim sweep` gives entries of the deck in many runs."""

    def model_post_init(self, context: Any, /) -> None:
        """Put the defaults that depend on other entries into the output."""
        super().model_post_init(context)
        entries = {key: getattr(self, key) for key in type(self).model_fields}
        n_dim = space_of(entries)[0]
        if "gravity" not in self.model_fields_set and n_dim == 3:
            object.__setattr__(self, "gravity", (0.0, 0.0, 0.0))
        # gravity of two numbers in space is refused: nothing else of the deck is taken as planar for it
        beams = {k: b.in_space(n_dim) for k, b in self.bodies.items() if isinstance(b, BeamSpec)}
        object.__setattr__(self, "bodies", {**self.bodies, **beams})
        for spring in self.springs.values():
            spring.bind(self.springs, self.joints)
        filled = {**vars(self.output)}
        filled["interval"] = self.output.interval or self.solve.duration / 200
        filled["channels"] = self.output.channels or default_channels(self.bodies, n_dim)
        object.__setattr__(self, "output", OutputSpec.model_construct(**filled))

    @property
    def dimension(self) -> int:
        """Number of space dimensions, 2 or 3."""
        return len(self.gravity)

    @property
    def interval(self) -> float:
        """Time between rows of the output [s]."""
        return typing.cast(float, self.output.interval)

    @property
    def channels(self) -> tuple[str, ...]:
        """Columns of the output."""
        return typing.cast(tuple[str, ...], self.output.channels)

    @property
    def motions(self) -> dict[str, InitialSpec]:
        """What is stated under initial of single bodies."""
        named = ((k, one) for k, one in self.initial.items() if k not in self.joints)
        found = {name: one for name, one in named if isinstance(one, InitialSpec)}
        if (steady := self.steady) is not None:
            own = found.get(steady.body) or InitialSpec()
            found[steady.body] = own.model_copy(update={"angular_velocity": steady.rate})
        return found

    @property
    def steady(self) -> SteadySpec | None:
        """The steady rotation that the scene starts in."""
        found = self.initial.get(STEADY)
        return found if isinstance(found, SteadySpec) else None

    def initial_of(self, bodies: Collection[str]) -> dict[str, InitialSpec | EquilibriumSpec | SteadySpec]:
        """Return what is stated under initial of some bodies."""
        found: dict[str, InitialSpec | EquilibriumSpec | SteadySpec] = {
            name: one for name, one in self.motions.items() if name in bodies
        }
        for name, joint in self.joints.items():
            if name in self.initial and {split_point(end)[0] for end in joint.between} <= set(bodies):
                found[name] = self.initial[name]
        if (steady := self.steady) is not None and steady.body in bodies:
            found[STEADY] = steady
        resting = tuple(name for name in self.resting if name in bodies)
        return found | ({AT_REST: EquilibriumSpec(bodies=resting)} if resting else {})

    @property
    def resting(self) -> tuple[str, ...]:
        """The bodies that start in equilibrium."""
        found = self.initial.get(AT_REST)
        if not isinstance(found, EquilibriumSpec):
            return ()
        return tuple(self.bodies) if found.bodies == "all" else found.bodies

    def properties(self, beam: str) -> "BeamAlong":
        """Return what follows from the material and the section of a beam, or from its stations."""
        return beam_properties(self.bodies[beam], self.materials, self.sections)

    def section_properties(self, beam: str) -> "SectionsAlong":
        """Return the same of a beam in space, in all directions."""
        return section_properties(self.bodies[beam], self.materials, self.sections)

    def models(self, model: str) -> dict[str, str]:
        """Return the model of each beam: its own, or else the one given."""
        beams = ((name, body) for name, body in self.bodies.items() if isinstance(body, BeamSpec))
        return {name: beam.model or model for name, beam in beams}

    def resolved(self) -> dict[str, Any]:
        """Return the deck as plain data with defaults filled in and SI numbers; it loads as an equal deck."""
        data = self.model_dump(mode="json", by_alias=True, exclude_none=True)
        for name in self.joints.keys() & self.initial.keys():
            data["initial"][name].pop("exact", None)  # of bodies alone
        return data


def specs_in(entries: Mapping[str, Any]) -> Iterator[tuple[Path, Spec]]:
    """Yield the entries under top-level keys with their paths."""
    for key, group in entries.items():
        if isinstance(group, Spec):
            yield (key,), group
        elif isinstance(group, dict):
            yield from (((key, name), entry) for name, entry in group.items() if isinstance(entry, Spec))


def space_of(entries: Mapping[str, Any]) -> tuple[int, Path]:
    """Return how many dimensions space has, and which entry says so: any vector of three numbers."""
    if len(entries.get("gravity") or ()) == 3:
        return 3, ("gravity",)
    for path, spec in specs_in(entries):
        for n, inner in spec.spaces():
            if n == 3:
                return 3, (*path, *inner)
    return 2, ()


def default_channels(bodies: dict[str, AnyBody], n_dim: int) -> tuple[str, ...]:
    """Return the channels of a deck that names none: beams' tips, rigid bodies, total energy."""
    own = (f"{name}.{one}" for name, body in bodies.items() for one in body.default_channels(n_dim))
    return (*own, "energy.total")
