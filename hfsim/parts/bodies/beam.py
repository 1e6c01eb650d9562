"""Beams: slender flexible bodies."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, ValidationError

from hfsim.deck.complaints import Complaint, refusal, refuse_all, refused, shown
from hfsim.deck.fields import Angle, Flag, Points, PositiveLength, alike, whole
from hfsim.deck.reader import Path
from hfsim.deck.spec import Around, Before, Spec, entry_of, explained, named_in
from hfsim.parts.bodies.models import MODELS, missing
from hfsim.parts.specs import BodySpec

if TYPE_CHECKING:
    from hfsim.deck.materials import AnySection
    from hfsim.mechanics.body import Body
    from hfsim.parts.bodies.models import Model

END_POINTS = ("root", "tip")
"""Points that every beam has."""

_SAME_LENGTH = 1e-6
"""Difference of a stated length from that of the axis, relative to it, that is rounding."""

DEFAULT_ELEMENTS = 4
"""Elements of a beam whose deck states none, or ``auto`` where nothing chooses them."""


USUAL_ELEMENTS = {2: "cable", 3: "cosserat"}
"""Element of a beam that states none, by the dimensions of space."""
_STRAINS = (
    ("strain", "green", "has strains of its own", ""),
    ("curvature", "linear", "has no curvature of its own", ""),
)
_NO_AXES = "has no section axes"
_OWN = {
    "cable": (("section_degree", 1, "has no section vectors", ""),),
    "continuum": _STRAINS,
    "cosserat": (
        ("section_degree", 1, "has sections of its degree", ""),
        ("rotary_inertia", False, "always has it", ""),
        *_STRAINS,
    ),
}
"""Options that elements do not know, with their usual values."""

_STRAIGHT = {
    ("cable", 2): (("axis", "is straight"),),
    ("cable", 3): (("axis", "is straight"), ("section_angle", _NO_AXES), ("twist", _NO_AXES)),
    ("continuum", 2): (("axis", "is straight in the plane"),),
}
"""Options of curved and turned sections that elements in plane or space do not know, and why."""


_EITHER = (("section", "stations", "Name of the section"), ("length", "axis", "Undeformed length [m]"))
"""Keys one of which a beam needs."""
_Station = Annotated[Any, entry_of("hfsim.deck.stations.StationSpec")]
_ELEMENTS = whole(at_most=100_000, words=("auto",))


def _read_elements(value: object) -> object:
    if isinstance(value, str) and value != "auto":
        raise refusal(f"must be a whole number or auto, not {shown(value)}")
    return DEFAULT_ELEMENTS if value == "auto" else value


class QuadratureSpec(Spec):
    """Gauss points an element for the integrals that are not polynomials."""

    axial: Annotated[int, whole(at_most=20)]
    """Points for the axial energy [-]."""

    bending: Annotated[int, whole(at_most=20)]
    """Points for the bending energy [-]."""


class BeamSpec(BodySpec):
    """Beam with a constant section or with stations; frame at the root, first axis along the root tangent."""

    own_points = END_POINTS
    noun = "beam"
    spatial = ("section_angle", "twist")

    type: Literal["beam"]
    """Kind of body."""

    material: str | None = None
    """Name of the material; a section given by its stiffness needs none."""

    section: str | None = None
    """Name of the section; or state stations."""

    stations: tuple[_Station, ...] | None = None
    """Section and material at places from root to tip, in place of `section`."""

    length: PositiveLength = 0.0
    """Undeformed length [m]; that of its axis, if it states one."""

    elements: Annotated[int, _ELEMENTS, Before(_read_elements)] = DEFAULT_ELEMENTS
    """Number of elements [-]; auto: `run` chooses it and the degree, all else takes 4."""

    element: Annotated[str, named_in("hfsim.parts.elements.ELEMENTS", "cosserat")] | None = None
    """cable: centre line only, usual in the plane; continuum: fully parameterised as in Liu, Hong & Cui
    (2007), eq. 22-27; cosserat: line with sections, with shear, in space torsion too, usual there."""

    degree: Annotated[int, whole(1, 12)] = 3
    """Degree of the shapes [-]: of a cable 3 or more, cubic Hermite and degree - 3 interior functions;
    of a continuum element 3, or more with a section_degree above 1; of a cosserat element any, so many
    intervals between nodes."""

    section_degree: Annotated[int, whole(1, 11)] = 1
    """Degree of the section vectors of a continuum element along its axis [-]: 1 in the paper; one less than
    `degree` does not lock in bending."""

    section_angle: Angle | None = None
    """Angle by which the section's axes are turned about the beam from those of its frame, in space [rad]."""

    strain: Literal["green", "engineering"] = "green"
    """Axial strain of the cable element: (r'.r' - 1)/2 or abs(r') - 1."""

    curvature: Literal["linear", "exact"] = "linear"
    """Curvature of the cable element: r'' or (r' x r'')/abs(r')^2."""

    quadrature: QuadratureSpec | None = None
    """Gauss points an element, where the elastic energy is no polynomial, and of damping then; 2 degree - 1
    without it."""

    rotary_inertia: Flag = False
    """Whether the sections' rotary inertia counts; a cable's resists stretching too."""

    truncation: Literal["second_order", "none"] = "second_order"
    """Order in the deformation through which the model lowOrder keeps inertia terms."""

    axis: Annotated[Any, entry_of("hfsim.parts.bodies.axis_spec.AxisSpec")] | None = None
    """Undeformed centre line in the body frame; straight along x without it."""

    twist: Angle | None = None
    """Angle by which the section is turned at the tip more than at the root, undeformed, in space [rad]."""

    model: Annotated[str, named_in("hfsim.parts.bodies.models.MODELS", "auto")] | None = None
    """Model of this beam; that of ``solve.model`` without it."""

    points: Points = Field(default_factory=dict)
    """Named points in the undeformed body frame [m]; the first number counts along an arc or a curve."""

    @classmethod
    def _read(cls, value: Any, read: Callable[[Any], Any]) -> Any:
        """Read a beam; one without length or section is refused beside all else that is wrong with it."""
        keys = value.keys() if isinstance(value, dict) else {"length", "section"}
        lacking = ((one, text) for one, other, text in _EITHER if not keys & {one, other})
        missing = [Complaint((key,), "missing key", text, True) for key, text in lacking]
        try:
            beam = super()._read(value, read)
        except ValidationError as error:
            raise refused([*missing, *explained(cls, error)]) from None
        refuse_all(missing)
        return beam

    def assemble(self, name: str, start: int, deck: Any, model: "Model | None") -> "Body":
        """Return the body of a model whose coordinates begin at a column."""
        assert model is not None and self.element is not None
        if self.element == "cosserat":
            from hfsim.parts.bodies.section_blueprint import SectionBlueprint as Blueprint
        else:
            from hfsim.parts.bodies.blueprint import Blueprint  # type: ignore[assignment]

        return model.assemble(Blueprint.of(self, name, start, deck), self.element)

    def lacking(self, model: str, n_dim: int) -> tuple[str, str] | None:
        """Return that it has no such model, and what to take."""
        return missing(model, self.in_space(n_dim).element or "", n_dim)

    def size(self, n_dim: int) -> int:
        """Return the number of coordinates of the nodes and of the elements' interiors, if it deforms."""
        element, sections = self.in_space(n_dim).element, n_dim - 1
        if element == "cosserat":
            return n_dim**2 * (self.elements * self.degree + 1)
        vectors = 2 * (self.elements + 1) + (self.degree - 3) * self.elements
        if element == "continuum":
            vectors += sections * (self.section_degree * self.elements + 1)
        return n_dim * vectors

    def in_space(self, n_dim: int) -> Self:
        """Return the beam with its length, and with an element: that usual in a space if it states none."""
        length = self.length or (self.axis.length if self.axis else 0.0)
        return self.model_copy(update={"element": self.element or USUAL_ELEMENTS[n_dim], "length": length})

    @property
    def fewest_elements(self) -> int:
        """Elements that its curved or twisted line needs, in space."""
        if self.element != "continuum" or not (self.axis or self.twist):
            return self.equal_parts
        from hfsim.parts.bodies.beam_axis import Axis

        return -(-Axis.of(self).fewest_elements // self.equal_parts) * self.equal_parts

    @property
    def equal_parts(self) -> int:
        """Number of which that of its elements is a multiple, so that steps of its sections are at nodes."""
        if not self.stations:
            return 1
        from hfsim.deck.stations import equal_parts

        return equal_parts(self.stations)

    @property
    def made_of(self) -> list[tuple[Path, float, str | None, str]]:
        """Path in this entry, place as a share of the length, material and section of each station."""
        if self.stations is None:
            return [((), 0.0, self.material, self.section or "")]
        each = enumerate(self.stations)
        return [(("stations", i), one.at, one.material or self.material, one.section) for i, one in each]

    @property
    def takes_degrees(self) -> bool:
        """Whether its degree may be chosen."""
        return self.element != "continuum" and self.quadrature is None

    @property
    def sectioned(self) -> bool:
        """Whether its elements are more than a line."""
        return self.element != "cable"

    def default_channels(self, n_dim: int) -> tuple[str, ...]:
        """Return those of the tip and of the frame."""
        if n_dim == 3:
            spins = (f"angular_velocity_{axis}" for axis in "xyz")
            return ("tip.x", "tip.y", "tip.z", "tip.deflection_y", "tip.deflection_z", *spins)
        return ("tip.x", "tip.y", "tip.deflection", "angle", "angular_velocity")

    def complaints(self) -> Iterator[Complaint]:
        """Yield options that exclude one another, and points outside the beam."""
        if self.stations is not None:
            from hfsim.deck.stations import station_complaints

            yield from station_complaints(self.stations, self.elements)
            if self.section is not None:
                yield Complaint(("section",), "the stations say the section", "remove this key", True)
        length = self.axis.length if self.axis else self.length
        for name, point in self.points.items():
            if name in END_POINTS:
                yield Complaint(("points", name), f"every beam has a point '{name}'", "choose another name")
            elif not 0 <= point[0] <= length:
                message = f"x = {point[0]:g} m is outside the beam, which goes from 0 to {length:g} m"
                yield Complaint(("points", name), message)
            elif any(point[1:]) and (self.element or USUAL_ELEMENTS[len(point)]) == "cable":
                hint = f"give y = 0, or element: {'continuum' if len(point) == 2 else 'cosserat'}"
                message = "a cable element has points on its centre line only"
                yield Complaint(("points", name), message, hint)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield what does not fit the section, the model and the form of the elastic force."""
        beam = self.in_space(around.n_dim or 2)
        yield from super().complaints_in(around)
        if self.axis and abs(self.axis.length - beam.length) > _SAME_LENGTH * self.axis.length:
            yield Complaint(("length",), f"the axis is {self.axis.length:.9g} m long", "remove this key")
        yield from beam._element_complaints(around.n_dim or 2)
        for path, _, material, name in self.made_of:
            section = around.sections.get(name)
            if path and section is not None and section.stiff:
                material = (self.stations or ())[int(path[-1])].material  # the beam's is for others
            yield from (one.inside(*path) for one in beam._section_complaints(name, section, material))
            if around.n_dim == 3:
                yield from (one.inside(*path) for one in beam._spatial_complaints(section))
        model = self.model or around.model or ""
        for key, value, words, instead in MODELS[model].lacks if model in MODELS else ():
            if getattr(beam, key) == value and beam.element != "cosserat":
                yield Complaint((key,), f"the model {model} has no {words}", f"{instead}, or another model")
        if lacks := beam.lacking(model, around.n_dim or 2):
            yield Complaint(("model",), *lacks)
        if beam.element == "continuum":
            from hfsim.parts.bodies.section_sides import side_complaints

            yield from side_complaints(beam, around)
        if around.elastic_form not in (None, "gram") and (self.strain, self.curvature) != ("green", "linear"):
            key = "strain" if self.strain != "green" else "curvature"
            message = f"elastic_form: {around.elastic_form} needs strain: green, curvature: linear"
            yield Complaint((key,), message, "or leave elastic_form out")
        if around.elastic_form not in (None, "gram") and self.stations is not None:
            message = f"elastic_form: {around.elastic_form} is for beams of one section"
            yield Complaint(("stations",), message, "or leave elastic_form out", True)
        if around.elastic_form not in (None, "gram") and self.section_degree > 1:
            message = f"elastic_form: {around.elastic_form} is for the paper's element, of section_degree 1"
            yield Complaint(("section_degree",), message, "or leave elastic_form out")

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a section higher than the beam is long, and a length that looks like millimetres."""
        sections = [one for *_, name in self.made_of if (one := around.sections.get(name)) is not None]
        if not sections or any(any(section.slips_in(around)) for section in sections):
            return
        height = max(section.height for section in sections)
        if height > self.length:
            message = f"a section {height:.3g} m high, and the beam is {self.length:g} m long"
            yield Complaint(("length",), message, "are all in metres?")
        if self.length >= 100.0 and self.length > 1e4 * height:
            message = f"{self.length:g} m for a section {height:.3g} m high"
            yield Complaint(("length",), message, f"'{self.length:g} mm'?")

    def _spatial_complaints(self, section: "AnySection | None") -> Iterator[Complaint]:
        if self.element == "cable" and section is not None and not alike(section.bending):
            first, second = section.bending
            message = f"a cable element has no section axes, but {first:.4g} about y and {second:.4g} about z"
            yield Complaint(("section",), message, "equal second moments, or element: cosserat")

    def _section_complaints(
        self, name: str, section: "AnySection | None", material: str | None
    ) -> Iterator[Complaint]:
        if section is None:
            return
        if self.element == "continuum" and section.stiff:
            message = "a continuum element is made of its material: it needs the section's shape or moments"
            yield Complaint(("section",), message, "a material and such a section, or element: cosserat")
        elif self.element == "cable" and section.stiff and any(section.couplings):
            message = "a cable element has tension and bending only, which it cannot couple"
            yield Complaint(("section",), message, "element: cosserat")
        elif material is None and not section.stiff:
            yield Complaint(("material",), "missing key", "Name of the material", True)
        elif material is not None and section.stiff:
            message = f"the section '{name}' has its stiffness and needs no material"
            yield Complaint(("material",), message, "remove this key", True)

    def _degree_complaints(self) -> Iterator[Complaint]:
        """Yield degrees that do not go together: sections do not turn faster than their line."""
        if self.section_degree >= max(3, self.degree):
            message = f"must be less than the degree of the line, which is {self.degree}"
            yield Complaint(("section_degree",), message, f"{self.degree - 1}?")
        elif self.degree > 3 and self.section_degree == 1:
            message = "a continuum element with linear section vectors is cubic along its axis"
            instead = f"state section_degree: {self.degree - 1} too, or take element: cable"
            yield Complaint(("degree",), message, instead)

    def in_sections(self, place: Sequence[float]) -> Sequence[float]:
        """Return a point with its distances from the line along the axes of the section."""
        if not (self.section_angle or self.twist):
            return place
        angle = (self.section_angle or 0.0) + (self.twist or 0.0) * place[0] / self.length
        c, s = math.cos(angle), math.sin(angle)
        return place[0], c * place[1] + s * place[2], c * place[2] - s * place[1]

    def _element_complaints(self, n_dim: int) -> Iterator[Complaint]:
        if self.element == "continuum":
            yield from self._degree_complaints()
        for key, usual, why, instead in _OWN.get(self.element or "", ()):
            if getattr(self, key) != usual:
                yield Complaint((key,), f"a {self.element} element {why}", f"remove this key{instead}")
        for key, why in _STRAIGHT.get((self.element or "", n_dim), ()):
            if getattr(self, key) is not None:
                message = f"a {self.element} element {why}"
                yield Complaint((key,), message, "remove this key, or element: cosserat", True)
        if self.element in ("cable", "continuum") and self.degree < 3:
            yield Complaint(("degree",), f"must be at least 3, not {self.degree}")
        if self.quadrature is None:
            return
        if self.element != "cable":
            yield Complaint(("quadrature",), "applies to cable elements only", "remove this key")
        elif self.strain == "green" and self.curvature == "linear":
            message = "strain: green with curvature: linear is integrated exactly"
            yield Complaint(("quadrature",), message, "remove this key")
