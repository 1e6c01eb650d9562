"""The checks of a deck that concern more than one entry."""

from collections.abc import Iterator, Sequence
from typing import Any

from hfsim.deck.fields import split_point
from hfsim.deck.source import Path, did_you_mean
from hfsim.deck.spec import Complaint
from hfsim.parts.bodies import BeamSpec
from hfsim.scene.channel_names import ChannelNames
from hfsim.scene.declared import Declared
from hfsim.scene.rules import RULES
from hfsim.scene.schema import OutputSpec, SolveSpec, is_judged

_MAX_ROWS = 10_000_000
_RESERVED = ("energy", "constraint", "t")


class Checks:
    """The checks that concern more than one entry.

    Names are looked up in the plain data and everything else in the entries that could be read.
    """

    def __init__(self, data: dict[str, Any], entries: dict[str, Any]) -> None:
        self.declared = Declared(data)
        self.entries = entries
        self.solve: SolveSpec | None = entries["solve"]
        self.beams = {name: body for name, body in entries["bodies"].items() if isinstance(body, BeamSpec)}

    def complaints(self) -> Iterator[Complaint]:
        """Yield everything that is wrong."""
        yield from self._names()
        yield from self._beam_references()
        yield from self._connections()
        yield from self._initial_names()
        yield from self._rules()
        yield from ChannelNames(self.declared, len(self.entries["gravity"] or ())).complaints()
        yield from self._target_channels()
        yield from self._dimensions()
        yield from self._beam_sizes()
        yield from self._model_options()
        yield from self._elastic_form()
        yield from self._law_ranges()
        yield from self._output_rows()

    # Names ----------------------------------------------------------------------------------------------

    def _names(self) -> Iterator[Complaint]:
        bodies = self.declared.names("bodies")
        if bodies is not None and not bodies and "bodies" in self.declared.data:
            yield Complaint(("bodies",), "a scene needs at least one body", "", True)
        for key in ("bodies", "joints"):
            for name in self.declared.names(key) or ():
                if name in _RESERVED:
                    message = f"'{name}' is taken by the output's columns"
                    yield Complaint((key, name), message, "choose another name", True)
        for name in self.declared.names("joints") or ():
            if name in (bodies or ()):
                message = f"a body is called '{name}' too, so channels could not tell them apart"
                yield Complaint(("joints", name), message, "choose another name", True)

    def _beam_references(self) -> Iterator[Complaint]:
        for name, body in self.declared.maps("bodies").items():
            for key, kind in (("material", "materials"), ("section", "sections")):
                wanted, known = body.get(key), self.declared.names(kind)
                if isinstance(wanted, str) and known is not None and wanted not in known:
                    hint = did_you_mean(wanted, known) or f"declare it under {kind}"
                    yield Complaint(("bodies", name, key), f"there is no {key} '{wanted}'", hint)

    def _connections(self) -> Iterator[Complaint]:
        for kind in ("joints", "springs"):
            for name, entry in self.declared.maps(kind).items():
                yield from self._ends((kind, name, "between"), entry.get("between"))
        for name, load in self.declared.maps("loads").items():
            point, path = load.get("at"), ("loads", name, "at")
            if isinstance(point, str) and split_point(point)[0] == "ground":
                yield Complaint(path, "a load on the ground moves nothing", "name a point of a body")
            elif isinstance(point, str):
                yield from self.declared.point_complaint(path, point)

    def _ends(self, path: Path, ends: Any) -> Iterator[Complaint]:
        if not isinstance(ends, list) or len(ends) != 2 or not all(isinstance(end, str) for end in ends):
            return
        check = self.declared.point_complaint
        found = [one for index, end in enumerate(ends) for one in check((*path, index), end)]
        yield from found
        first, second = (split_point(end)[0] for end in ends)
        if first == second and not found:
            yield Complaint(path, f"connects '{first}' with itself", "name points of two different bodies")

    def _initial_names(self) -> Iterator[Complaint]:
        bodies = self.declared.names("bodies")
        for name in self.declared.names("initial") or ():
            if bodies and name not in bodies and name != "ground":
                yield Complaint(
                    ("initial", name), f"there is no body '{name}'", did_you_mean(name, bodies), True
                )

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

    def _rules(self) -> Iterator[Complaint]:
        solve = self.declared.data.get("solve")
        kept = solve.get("keep") if isinstance(solve, dict) else None
        for index, rule in enumerate(kept if isinstance(kept, list) else ()):
            if isinstance(rule, str) and rule not in RULES:
                hint = did_you_mean(rule, RULES)
                yield Complaint(("solve", "keep", index), f"there is no rule '{rule}'", hint)
