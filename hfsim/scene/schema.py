"""The deck: all that a YAML file may say, and the checks that it describes a scene.

`load_deck` reads a file. Pydantic checks each entry; then names are checked in the plain data, so that one
bad entry hides no bad reference elsewhere, and options and sizes in the entries that could be read.
"""

import difflib
import hashlib
import json
import typing
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from hfsim.deck.fields import (
    AccelerationVector,
    Angle,
    AngularVelocity,
    Complaint,
    Count,
    EmptyAllowed,
    Flag,
    LengthVector,
    Name,
    Points,
    PositiveTime,
    ReadBy,
    Spec,
    UnitInterval,
    VelocityVector,
    explain,
    measures,
    read_text,
    refusal,
    shown,
    spec_keys,
    split_point,
    whole,
)
from hfsim.deck.materials import MaterialSpec, SectionSpec
from hfsim.deck.source import DeckSource, Path, did_you_mean, parse_source, read_source
from hfsim.errors import DeckError
from hfsim.parts.bodies import AnyBody, BeamSpec
from hfsim.parts.bodies.beam import DEFAULT_ELEMENTS, END_POINTS
from hfsim.parts.forces import AnyLoad, AnySpring
from hfsim.parts.joints import AnyJoint
from hfsim.scene.rules import RULES

FORMAT = 1
"""The deck format this version reads."""

DEFAULT_TARGET = 1e-2
"""Target error of decks that leave elements to `run` and state no target [-]."""

_MAX_ROWS = 10_000_000
_RESERVED = ("energy", "constraint", "t")
_ENERGIES = ("kinetic", "strain", "potential", "total")
_RESIDUALS = ("position", "velocity")
_POINT_QUANTITIES = ("x", "y", "vx", "vy", "speed")
_BEAM_QUANTITIES = ("deflection", "elongation")
_BODY_QUANTITIES = ("angle", "angular_velocity")
_REACTIONS = ("force_x", "force_y", "moment")


def _read_format(value: object) -> int:
    if isinstance(value, bool) or value != FORMAT:
        message = f"deck format {shown(value)} is unknown; this version of hfsim reads format {FORMAT}"
        raise refusal(message, f"hfsim: {FORMAT}")
    return FORMAT


def _read_rule(value: object) -> str:
    rule = read_text(value)
    if rule not in RULES:
        raise refusal(f"there is no rule '{rule}'", did_you_mean(rule, RULES))
    return rule


def _read_deck_name(value: object) -> str:
    name = read_text(value)
    if not name.strip() or "/" in name or "\\" in name or not name.isprintable():
        raise refusal(f"'{name}' cannot be a name", "it becomes the name of a folder")
    return name


class GroundSpec(Spec):
    """The scene's ground."""

    points: Points = Field(default_factory=dict)
    """Named points of the ground [m]."""


class InitialSpec(Spec):
    """Motion of one body at the start, absolute; what is not stated follows from the joints."""

    angle: Angle | None = None
    """Angle of the body frame [rad]."""

    angular_velocity: AngularVelocity | None = None
    """Angular velocity of the body frame [rad/s]."""

    position: LengthVector | None = None
    """Position of the body's origin [m]."""

    velocity: VelocityVector | None = None
    """Velocity of the body's origin [m/s]."""


class SolveSpec(Spec):
    """What is solved, and how."""

    model: Literal["rigid", "linear", "lowOrder", "exact", "ancf", "auto"] = "exact"
    """Model of the beams that have none of their own; auto: the cheapest that suffices, chosen in the run."""

    model_error: Annotated[float, measures(above=0, at_most=1)] = 0.01
    """Error of a beam's tip, relative to its range, that models chosen by auto may make [-]."""

    duration: PositiveTime
    """Time to simulate [s]."""

    method: Literal["gear", "gauss", "radau", "energy", "generalized_alpha", "explicit", "auto"] = "auto"
    """Integration method."""

    tolerance: Annotated[float, measures(above=0, at_most=0.1)] = 1e-8
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
    mapped to the frame for output; lowOrder has only its own."""

    elastic_form: Literal["direct", "tabulated", "separated", "gram"] = "gram"
    """How exact and ancf compute the elastic force: all give the same to round-off, gram is the fastest."""

    max_steps: Count | None = None
    """Steps after which the run stops [-]."""

    keep: tuple[Annotated[str, ReadBy(_read_rule)], ...] = ()
    """Rules that are not to leave anything out; `hfsim plan` names them."""

    keep_all: Flag = False
    """Build and compute everything, whether the scene needs it or not: for checking."""

    target_error: Annotated[float, measures(above=0, at_most=0.5)] | None = None
    """Total error, of mesh and time, that `run` is to reach by its choice of elements, degrees, tolerance and
    method (if that is auto): largest over time in the worst channel, relative to the channel's range [-]."""

    target_channels: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Channels that must reach the target error; all but energy.total and constraint residuals without it."""

    budget: PositiveTime | None = None
    """Time that the search for the target error may take [s]; 60 without it."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a step longer than the run, and keys that do not go together."""
        if self.target_error is None:
            for key in ("target_channels", "budget"):
                if getattr(self, key) is not None:
                    why = "goes with target_error or elements: auto only"
                    yield Complaint((key,), why, "give target_error, e.g. 1e-3")
        elif self.step is not None:
            yield Complaint(
                ("step",), "target_error and elements: auto choose the steps", "remove one of them"
            )
        if self.method == "energy" and self.coordinates == "frame":
            why = "method energy makes its steps in absolute coordinates"
            yield Complaint(("coordinates",), why, "leave this entry out")
        if self.step is not None and self.step > self.duration:
            yield Complaint(
                ("step",), f"a step of {self.step:g} s is longer than the run, {self.duration:g} s"
            )


class OutputSpec(Spec):
    """What is written."""

    interval: PositiveTime | None = None
    """Time between rows [s]; a 200th of the duration without it."""

    channels: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    """Columns; without it, the tips of beams, the rigid bodies and the total energy."""

    plots: Flag = True
    """Whether pictures are drawn."""


class Deck(Spec):
    """A scene and what is asked of it."""

    hfsim: Annotated[Literal[1], ReadBy(_read_format)]
    """Deck format, 1."""

    name: Annotated[str, ReadBy(_read_deck_name)] = "deck"
    """Name of the scene; the file's name without it."""

    gravity: AccelerationVector = (0.0, 0.0)
    """Acceleration of gravity [m/s^2]; two numbers: planar scene."""

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

    initial: Annotated[dict[Name, InitialSpec], EmptyAllowed] = Field(default_factory=dict)
    """Initial motion, by body."""

    solve: SolveSpec
    """What is solved, and how."""

    output: OutputSpec = Field(default_factory=OutputSpec.model_construct)
    """What is written."""

    def model_post_init(self, context: Any, /) -> None:
        """Put the defaults that depend on other entries into the output."""
        super().model_post_init(context)
        filled = OutputSpec.model_construct(
            interval=self.output.interval or self.solve.duration / 200,
            channels=self.output.channels or default_channels(self.bodies),
            plots=self.output.plots,
        )
        object.__setattr__(self, "output", filled)

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

    def models(self, model: str) -> dict[str, str]:
        """Return the model of each beam: its own, or else the one given."""
        beams = {name: body for name, body in self.bodies.items() if isinstance(body, BeamSpec)}
        return {name: beam.model or model for name, beam in beams.items()}

    def resolved(self) -> dict[str, Any]:
        """Return the deck as plain data with defaults filled in and SI numbers; it loads as an equal deck."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)

    @property
    def deck_sha256(self) -> str:
        """Hash of the resolved deck; equal decks have equal hashes."""
        return _sha256(self.resolved())


def _sha256(resolved: dict[str, Any]) -> str:
    canonical = json.dumps(resolved, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()


def is_judged(channel: str) -> bool:
    """Return whether errors of a channel count: not those of residuals, nor of the conserved energy."""
    return channel != "energy.total" and not channel.startswith("constraint.")


def default_channels(bodies: dict[str, Any]) -> tuple[str, ...]:
    """Return the channels of a deck that names none: beams' tips, rigid bodies, total energy."""
    channels: list[str] = []
    for name, body in bodies.items():
        if isinstance(body, BeamSpec):
            channels += [f"{name}.tip.x", f"{name}.tip.y", f"{name}.tip.deflection"]
        else:
            channels += [f"{name}.x", f"{name}.y"]
        channels += [f"{name}.angle", f"{name}.angular_velocity"]
    return (*channels, "energy.total")


@dataclass(frozen=True)
class LoadedDeck:
    """A deck and where it came from.

    Attributes
    ----------
    deck : Deck
        With numbers of elements throughout.
    source : DeckSource
    auto_elements : tuple of str
        Beams whose elements the deck leaves to `hfsim run`; it has a target error then.
    """

    deck: Deck
    source: DeckSource = field(repr=False, compare=False)
    auto_elements: tuple[str, ...] = ()

    @property
    def deck_sha256(self) -> str:
        """Hash of the resolved deck, and of which elements are left open."""
        resolved = self.deck.resolved()
        for name in self.auto_elements:
            resolved["bodies"][name]["elements"] = "auto"
        return _sha256(resolved)

    def with_numbers(self) -> "LoadedDeck":
        """Return the deck with the default elements where it leaves them open, and then without target."""
        if not self.auto_elements:
            return self
        numbers = [f"bodies.{name}.elements={DEFAULT_ELEMENTS}" for name in self.auto_elements]
        stated = self.source.data["solve"]
        none = [f"solve.{key}=null" for key in ("target_error", "target_channels", "budget") if key in stated]
        return parse_deck(self.source.text, self.source.file, (*self.overrides, *numbers, *none))

    @property
    def overrides(self) -> tuple[str, ...]:
        """The overrides as given, ``KEY=VALUE``."""
        return self.source.overrides

    def with_solve(self, update: dict[str, Any]) -> "LoadedDeck":
        """Return the same deck solved in another way: entries of ``solve`` by their names."""
        solve = self.deck.solve.model_copy(update=update)
        return replace(self, deck=self.deck.model_copy(update={"solve": solve}))

    def line_of(self, path: str) -> int:
        """Return the line of an entry such as ``bodies.b1``, or of the entry around it; 0 if overridden."""
        mark = self.source.mark(self.source.path_of(path), on_key=True)
        return mark.line if mark else 0

    def problem(self, path: str, message: str, hint: str = "") -> DeckError:
        """Return the exception that refuses the entry at a dotted path; for checks made after loading."""
        return self.source.error([self.source.problem(self.source.path_of(path), message, hint)])


def load_deck(path: str | FilePath, overrides: Sequence[str] = ()) -> LoadedDeck:
    """Read a deck file and check it.

    Parameters
    ----------
    path : str or pathlib.Path
        The YAML file.
    overrides : sequence of str
        ``KEY=VALUE`` each, applied before the checks.

    Raises
    ------
    DeckError
        With every problem found.
    """
    return _load(read_source(path, overrides), FilePath(path).stem)


def parse_deck(text: str, file: str = "deck", overrides: Sequence[str] = ()) -> LoadedDeck:
    """Check a deck given as text; see `load_deck`."""
    return _load(parse_source(text, file, overrides), FilePath(file).stem)


def _load(source: DeckSource, stem: str) -> LoadedDeck:
    data = {"name": stem, **{key: value for key, value in source.data.items() if value is not None}}
    auto = _auto_elements(data)
    solve = data.get("solve")
    if auto and isinstance(solve, dict) and solve.get("target_error") is None:
        data["solve"] = {**solve, "target_error": DEFAULT_TARGET}
    deck, complaints = None, []
    try:
        deck = Deck.model_validate(data)
        entries = {key: getattr(deck, key) for key in Deck.model_fields}
    except ValidationError as error:
        complaints = list(explain(error, Deck, data))
        entries = _readable_entries(data)
    complaints += _Checks(data, entries).complaints()
    problems = source.problems + [source.problem(*complaint) for complaint in complaints]
    if problems or deck is None:
        # What follows from a problem at the very same place is left out.
        raise source.error({(one.path, one.line, one.column): one for one in reversed(problems)}.values())
    return LoadedDeck(deck, source, auto)


def _auto_elements(data: dict[str, Any]) -> tuple[str, ...]:
    """Return the bodies of a deck's plain data that leave their elements open."""
    bodies = data.get("bodies")
    pairs = bodies.items() if isinstance(bodies, dict) else ()
    return tuple(name for name, body in pairs if isinstance(body, dict) and body.get("elements") == "auto")


def _readable_entries(data: dict[str, Any]) -> dict[str, Any]:
    """Return of each top-level key what can be read, though other parts of the deck are bad."""
    entries: dict[str, Any] = {}
    for key, info in Deck.model_fields.items():
        value, annotation = data.get(key), typing.cast(Any, info.annotation)
        if typing.get_origin(annotation) is dict:
            adapter: TypeAdapter[Any] = TypeAdapter(typing.get_args(annotation)[1])
            pairs = value.items() if isinstance(value, dict) else ()
            read = {name: _read_or_none(adapter, entry) for name, entry in pairs}
            entries[key] = {name: entry for name, entry in read.items() if entry is not None}
        else:
            entries[key] = _read_or_none(TypeAdapter[Any](annotation), value)
    return entries


def _read_or_none(adapter: TypeAdapter[Any], value: Any) -> Any:
    try:
        return adapter.validate_python(value)
    except ValidationError:
        return None


class _Checks:
    """The checks that concern more than one entry.

    Names are looked up in the plain data and everything else in the entries that could be read. A name that
    some other, already reported mistake may have hidden is not complained about.
    """

    def __init__(self, data: dict[str, Any], entries: dict[str, Any]) -> None:
        self.data = data
        self.entries = entries
        self.solve: SolveSpec | None = entries["solve"]
        self.beams = {name: body for name, body in entries["bodies"].items() if isinstance(body, BeamSpec)}

    def complaints(self) -> Iterator[Complaint]:
        """Yield everything that is wrong."""
        yield from self._names()
        yield from self._beam_references()
        yield from self._connections()
        yield from self._initial_names()
        yield from self._channels()
        yield from self._target_channels()
        yield from self._dimensions()
        yield from self._beam_sizes()
        yield from self._model_options()
        yield from self._elastic_form()
        yield from self._law_ranges()
        yield from self._output_rows()

    # Plain data -----------------------------------------------------------------------------------------

    def _maps(self, key: str) -> dict[str, dict[str, Any]]:
        """Return those entries of a top-level key that are maps."""
        value = self.data.get(key)
        pairs = value.items() if isinstance(value, dict) else ()
        return {name: entry for name, entry in pairs if isinstance(entry, dict)}

    def _declared(self, key: str) -> list[str] | None:
        """Return the names under a top-level key, None where they cannot be known."""
        return _names_in(self.data, key, list(Deck.model_fields))

    @cached_property
    def _points(self) -> dict[str, list[str] | None] | None:
        """The points of ground and of each body; None where they cannot be known."""
        bodies = self._declared("bodies")
        ground = self.data.get("ground", {})
        if bodies is None or not bodies:
            return None
        known = _names_in(ground, "points", ["points"]) if isinstance(ground, dict) else None
        return {"ground": known, **{name: _points_of(self.data["bodies"][name]) for name in bodies}}

    def _point_complaint(self, path: Path, reference: str) -> Iterator[Complaint]:
        """Yield a point that does not exist."""
        if self._points is None:
            return
        owner, point = split_point(reference)
        if owner not in self._points:
            yield Complaint(path, f"there is no body '{owner}'", did_you_mean(owner, self._points))
            return
        known = self._points[owner]
        if known is None or not point or point in known:
            return
        if point in END_POINTS:
            yield Complaint(
                path, f"'{owner}' has no {point}, only beams have", _points_hint(owner, point, known)
            )
        else:
            yield Complaint(path, f"'{owner}' has no point '{point}'", _points_hint(owner, point, known))

    # Names ----------------------------------------------------------------------------------------------

    def _names(self) -> Iterator[Complaint]:
        bodies = self._declared("bodies")
        if bodies is not None and not bodies and "bodies" in self.data:
            yield Complaint(("bodies",), "a scene needs at least one body", "", True)
        for key in ("bodies", "joints"):
            for name in self._declared(key) or ():
                if name in _RESERVED:
                    message = f"'{name}' is taken by the output's columns"
                    yield Complaint((key, name), message, "choose another name", True)
        for name in self._declared("joints") or ():
            if name in (bodies or ()):
                message = f"a body is called '{name}' too, so channels could not tell them apart"
                yield Complaint(("joints", name), message, "choose another name", True)

    def _beam_references(self) -> Iterator[Complaint]:
        for name, body in self._maps("bodies").items():
            for key, kind in (("material", "materials"), ("section", "sections")):
                wanted, known = body.get(key), self._declared(kind)
                if isinstance(wanted, str) and known is not None and wanted not in known:
                    hint = did_you_mean(wanted, known) or f"declare it under {kind}"
                    yield Complaint(("bodies", name, key), f"there is no {key} '{wanted}'", hint)

    def _connections(self) -> Iterator[Complaint]:
        for kind in ("joints", "springs"):
            for name, entry in self._maps(kind).items():
                yield from self._ends((kind, name, "between"), entry.get("between"))
        for name, load in self._maps("loads").items():
            point, path = load.get("at"), ("loads", name, "at")
            if isinstance(point, str) and split_point(point)[0] == "ground":
                yield Complaint(path, "a load on the ground moves nothing", "name a point of a body")
            elif isinstance(point, str):
                yield from self._point_complaint(path, point)

    def _ends(self, path: Path, ends: Any) -> Iterator[Complaint]:
        if not isinstance(ends, list) or len(ends) != 2 or not all(isinstance(end, str) for end in ends):
            return
        found = [one for index, end in enumerate(ends) for one in self._point_complaint((*path, index), end)]
        yield from found
        first, second = (split_point(end)[0] for end in ends)
        if first == second and not found:
            yield Complaint(path, f"connects '{first}' with itself", "name points of two different bodies")

    def _initial_names(self) -> Iterator[Complaint]:
        bodies = self._declared("bodies")
        for name in self._declared("initial") or ():
            if bodies and name not in bodies and name != "ground":
                yield Complaint(
                    ("initial", name), f"there is no body '{name}'", did_you_mean(name, bodies), True
                )

    # Channels -------------------------------------------------------------------------------------------

    def _channels(self) -> Iterator[Complaint]:
        output = self.data.get("output")
        channels = output.get("channels") if isinstance(output, dict) else None
        seen: set[str] = set()
        for index, channel in enumerate(channels if isinstance(channels, list) else ()):
            path: Path = ("output", "channels", index)
            if not isinstance(channel, str):
                continue
            if channel in seen:
                yield Complaint(path, f"'{channel}' is listed twice", "remove one of the two")
            seen.add(channel)
            yield from self._channel_complaint(path, channel)

    def _channel_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        owner, _, rest = channel.partition(".")
        fixed = {"energy": _ENERGIES, "constraint": _RESIDUALS}.get(owner)
        joints, bodies = self._declared("joints"), self._declared("bodies")
        if fixed is None and owner in (joints or ()) and owner not in (bodies or ()):
            fixed = _REACTIONS
        if fixed is not None:
            if rest not in fixed:
                yield _unknown_quantity(path, owner, rest, fixed)
        elif owner == "ground":
            yield Complaint(path, "the ground does not move", "name a point of a body")
        elif self._points is not None and joints is not None and owner not in self._points:
            known = [*self._points, *joints, "energy", "constraint"]
            known.remove("ground")
            yield Complaint(path, f"there is no body or joint '{owner}'", did_you_mean(owner, known))
        elif self._points is not None and joints is not None:
            yield from self._motion_complaint(path, channel)

    def _motion_complaint(self, path: Path, channel: str) -> Iterator[Complaint]:
        """Yield what is wrong with a channel of a body or of one of its points."""
        point, _, quantity = channel.rpartition(".")
        owner, name = split_point(point or channel)
        if not point:
            quantity = ""
        body = self._maps("bodies").get(owner, {})
        beam = body.get("type") == "beam"
        if quantity in _BODY_QUANTITIES and name:
            yield Complaint(path, f"{quantity} belongs to a body, not to a point", f"'{owner}.{quantity}'")
        elif quantity == "z" and len(self.entries["gravity"] or ()) != 3:
            yield Complaint(path, "a planar scene has no z", f"'{point}.x' or '{point}.y'")
        elif quantity in _BEAM_QUANTITIES and not beam and self._points and self._points[owner] is not None:
            yield Complaint(path, f"only a beam has {quantity}, '{owner}' is {shown(body.get('type'))}")
        elif quantity in (*_POINT_QUANTITIES, *_BEAM_QUANTITIES, *_BODY_QUANTITIES, "z"):
            yield from self._point_complaint(path, point)
        else:
            known = (
                _POINT_QUANTITIES + (_BEAM_QUANTITIES if beam else ()) + (() if name else _BODY_QUANTITIES)
            )
            yield _unknown_quantity(path, point or channel, quantity, known)

    # Sizes and options ----------------------------------------------------------------------------------

    def _dimensions(self) -> Iterator[Complaint]:
        if len(self.entries["gravity"] or ()) == 3:
            yield Complaint(("gravity",), "spatial scenes are not available yet; give two numbers")
            return
        for path, vector in self._vectors():
            if len(vector) != 2:
                yield Complaint(path, "must be a list of 2 numbers: this scene is planar")

    def _vectors(self) -> Iterator[tuple[Path, Sequence[float]]]:
        owners = [(("bodies", name), body) for name, body in self.entries["bodies"].items()]
        for path, owner in [(("ground",), self.entries["ground"]), *owners]:
            for name, point in (owner.points if owner else {}).items():
                yield (*path, "points", name), point
        for kind, *keys in (("joints", "axis"), ("loads", "force"), ("initial", "position", "velocity")):
            for path, vector in self._values(kind, keys):
                if vector is not None:
                    yield path, vector

    def _beam_sizes(self) -> Iterator[Complaint]:
        for name, beam in self.beams.items():
            section = self.entries["sections"].get(beam.section)
            if section is None:
                continue
            if section.height > beam.length:
                message = f"a section {section.height:.3g} m high is higher than the beam is long"
                yield Complaint(("bodies", name, "section"), message)
            for point, place in beam.points.items():
                if beam.element == "continuum" and abs(place[1]) > section.height / 2:
                    message = f"y = {place[1]:g} m is outside the section, {section.height:.3g} m high"
                    yield Complaint(("bodies", name, "points", point), message)

    def _model_options(self) -> Iterator[Complaint]:
        for name, beam in self.beams.items():
            model = beam.model or (self.solve.model if self.solve else None)
            if model != "lowOrder":
                continue
            if beam.element == "continuum":
                message = "the model lowOrder has no continuum element"
                yield Complaint(("bodies", name, "element"), message, "element: cable, or another model")
            if beam.rotary_inertia:
                message = "the model lowOrder has no rotary inertia"
                yield Complaint(("bodies", name, "rotary_inertia"), message, "false, or another model")

    def _elastic_form(self) -> Iterator[Complaint]:
        if self.solve is None or self.solve.elastic_form == "gram":
            return
        for name, beam in self.beams.items():
            if (beam.strain, beam.curvature) != ("green", "linear"):
                key = "strain" if beam.strain != "green" else "curvature"
                message = f"elastic_form: {self.solve.elastic_form} needs strain: green, curvature: linear"
                yield Complaint(("bodies", name, key), message, "or leave elastic_form out")

    def _law_ranges(self) -> Iterator[Complaint]:
        for path, law in self._laws():
            if self.solve is None or getattr(law, "type", None) != "table":
                continue
            first, last = law.times[0], law.times[-1]
            if first > 0 or last < self.solve.duration:
                message = (
                    f"covers {first:g} s to {last:g} s, the run goes from 0 to {self.solve.duration:g} s"
                )
                yield Complaint((*path, "times"), message)

    def _laws(self) -> Iterator[tuple[Path, Any]]:
        for kind, keys in (("joints", ("angle", "position")), ("loads", ("law",))):
            yield from self._values(kind, keys)

    def _values(self, kind: str, keys: Sequence[str]) -> Iterator[tuple[Path, Any]]:
        """Yield of each entry of a kind what stands under the keys, None where it has no such key."""
        for name, entry in self.entries[kind].items():
            for key in keys:
                yield (kind, name, key), getattr(entry, key, None)

    def _target_channels(self) -> Iterator[Complaint]:
        output: OutputSpec | None = self.entries["output"]
        if self.solve is None or output is None or output.channels is None:
            return
        judged = [c for c in output.channels if is_judged(c)]
        for i, name in enumerate(self.solve.target_channels or ()):
            path = ("solve", "target_channels", i)
            if name in output.channels and name not in judged:
                yield Complaint(path, f"'{name}' has no range that errors could be measured by")
            elif name not in output.channels:
                yield Complaint(path, f"'{name}' is not among output.channels", did_you_mean(name, judged))

    def _output_rows(self) -> Iterator[Complaint]:
        output: OutputSpec | None = self.entries["output"]
        if output is None or output.interval is None or self.solve is None:
            return
        rows = self.solve.duration / output.interval
        if rows > _MAX_ROWS:
            yield Complaint(
                ("output", "interval"), f"would make {rows:.3g} rows, at most {_MAX_ROWS:.0e} fit"
            )


def _names_in(data: dict[str, Any], key: str, known_keys: Iterable[str]) -> list[str] | None:
    """Return the keys of a map inside a map, none if it is absent, None if it is malformed or misspelt."""
    if key not in data:
        strangers = [other for other in data if isinstance(other, str) and other not in known_keys]
        return None if difflib.get_close_matches(key, strangers, n=1) else []
    value = data[key]
    if value is None:
        return []
    return list(value) if isinstance(value, dict) else None


def _points_of(body: Any) -> list[str] | None:
    """Return the points that a body's plain data declare, None where they cannot be known."""
    if not isinstance(body, dict) or body.get("type") not in ("beam", "rigid"):
        return None
    ends = END_POINTS if body["type"] == "beam" else ()
    points = _names_in(body, "points", spec_keys(BeamSpec))
    return None if points is None else [*ends, *points]


def _points_hint(owner: str, point: str, known: list[str]) -> str:
    if not known:
        return f"declare it under {'ground.points' if owner == 'ground' else f'bodies.{owner}.points'}"
    return did_you_mean(point, known)


def _unknown_quantity(path: Path, owner: str, quantity: str, known: Sequence[str]) -> Complaint:
    hint = did_you_mean(quantity, known)
    if not quantity:
        return Complaint(path, f"'{owner}' is not a channel, a quantity is missing", hint)
    return Complaint(path, f"'{owner}' has no quantity '{quantity}'", hint)
