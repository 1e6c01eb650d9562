"""Beams: slender flexible bodies."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from hfsim.deck.fields import Flag, Points, PositiveLength, whole
from hfsim.deck.materials import AnySection
from hfsim.deck.spec import Around, Complaint, Spec, named_in, refusal, shown
from hfsim.parts.bodies.models import MODELS
from hfsim.parts.specs import BodySpec

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.parts.bodies.models import Model

END_POINTS = ("root", "tip")
"""Points that every beam has."""

DEFAULT_ELEMENTS = 4
"""Elements of a beam whose deck states none, or ``auto`` where nothing chooses them."""


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
    """Straight beam with a constant section; its frame is at the root, first axis along the root tangent."""

    own_points = END_POINTS
    noun = "beam"

    type: Literal["beam"]
    """Kind of body."""

    material: str
    """Name of the material."""

    section: str
    """Name of the section."""

    length: PositiveLength
    """Undeformed length [m]."""

    elements: Annotated[int, whole(at_most=100_000), BeforeValidator(_read_elements)] = DEFAULT_ELEMENTS
    """Number of elements [-]; auto: `run` chooses it and the degree, all else takes 4."""

    element: Annotated[str, named_in("hfsim.parts.elements.ELEMENTS")] = "cable"
    """Centre line only, or the fully parameterised element of Liu, Hong & Cui (2007), eq. 22-27."""

    degree: Annotated[int, whole(3, 12)] = 3
    """Degree of the cable element's shapes: cubic Hermite and degree - 3 interior functions [-]."""

    strain: Literal["green", "engineering"] = "green"
    """Axial strain of the cable element: (r'.r' - 1)/2 or abs(r') - 1."""

    curvature: Literal["linear", "exact"] = "linear"
    """Curvature of the cable element: r'' or (r' x r'')/abs(r')^2."""

    quadrature: QuadratureSpec | None = None
    """Gauss points an element, where the elastic energy is no polynomial; 2 degree - 1 without it."""

    rotary_inertia: Flag = False
    """Whether the sections' rotary inertia counts."""

    truncation: Literal["second_order", "none"] = "second_order"
    """Order in the deformation through which the model lowOrder keeps inertia terms."""

    model: Annotated[str, named_in("hfsim.parts.bodies.models.MODELS", "auto")] | None = None
    """Model of this beam; that of ``solve.model`` without it."""

    points: Points = Field(default_factory=dict)
    """Named points in the undeformed body frame [m]."""

    def assemble(self, name: str, start: int, deck: Any, model: "Model | None") -> "Body":
        """Return the body of a model whose coordinates begin at a column."""
        from hfsim.parts.bodies.blueprint import Blueprint

        assert model is not None
        return model.assemble(Blueprint.of(self, name, start, deck))

    @property
    def size(self) -> int:
        """Number of coordinates of the nodes and of the elements' interiors."""
        return 4 * (self.elements + 1) + 2 * (self.degree - 3) * self.elements

    @property
    def centre_line(self) -> bool:
        """Whether its elements are a line without height."""
        from hfsim.parts.elements import ELEMENTS

        return ELEMENTS[self.element].centre_line

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
        yield from self._element_complaints()
        for name, point in self.points.items():
            if name in END_POINTS:
                yield Complaint(("points", name), f"every beam has a point '{name}'", "choose another name")
            elif not 0 <= point[0] <= self.length:
                message = f"x = {point[0]:g} m is outside the beam, which goes from 0 to {self.length:g} m"
                yield Complaint(("points", name), message)
            elif self.centre_line and any(point[1:]):
                hint = "give y = 0, or element: continuum"
                message = f"a {self.element} element has points on its centre line only"
                yield Complaint(("points", name), message, hint)

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield what does not fit the section, the model and the form of the elastic force."""
        yield from super().complaints_in(around)
        yield from self._section_complaints(around.sections.get(self.section))
        model = self.model or around.model or ""
        for key, value, words, instead in MODELS[model].lacks if model in MODELS else ():
            if getattr(self, key) == value:
                yield Complaint((key,), f"the model {model} has no {words}", f"{instead}, or another model")
        if around.n_dim == 3:
            yield from self._spatial_complaints(model)
        if around.elastic_form not in (None, "gram") and (self.strain, self.curvature) != ("green", "linear"):
            key = "strain" if self.strain != "green" else "curvature"
            message = f"elastic_form: {around.elastic_form} needs strain: green, curvature: linear"
            yield Complaint((key,), message, "or leave elastic_form out")

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a section higher than the beam is long, and a length that looks like millimetres."""
        section = around.sections.get(self.section)
        if section is None or any(section.slips_in(around)):
            return
        height = section.height
        if height > self.length:
            message = f"a section {height:.3g} m high, and the beam is {self.length:g} m long"
            yield Complaint(("length",), message, "are all in metres?")
        if self.length >= 100.0 and self.length > 1e4 * height:
            message = f"{self.length:g} m for a section {height:.3g} m high"
            yield Complaint(("length",), message, f"'{self.length:g} mm'?")

    def _spatial_complaints(self, model: str) -> Iterator[Complaint]:
        if model and not (model in MODELS and MODELS[model].spatial):
            there = ", ".join(name for name, one in MODELS.items() if one.spatial)
            yield Complaint(("model",), f"the model {model} is not available in space", f"take {there}")
        if self.element != "cable":
            yield Complaint(("element",), f"a {self.element} element is not available in space", "cable")

    def _section_complaints(self, section: AnySection | None) -> Iterator[Complaint]:
        if section is None:
            return
        for name, place in self.points.items():
            if not self.centre_line and abs(place[1]) > section.height / 2:
                message = f"y = {place[1]:g} m is outside the section, {section.height:.3g} m high"
                yield Complaint(("points", name), message)

    def _element_complaints(self) -> Iterator[Complaint]:
        if not self.centre_line:
            own = (
                ("degree", 3, "is cubic along its axis", ", or take element: cable"),
                ("strain", "green", "has the Green strain", ""),
                ("curvature", "linear", "has no curvature of its own", ""),
            )
            for key, usual, why, instead in own:
                if getattr(self, key) != usual:
                    yield Complaint((key,), f"a {self.element} element {why}", f"remove this key{instead}")
        if self.quadrature is None:
            return
        if not self.centre_line:
            yield Complaint(("quadrature",), "applies to cable elements only", "remove this key")
        elif self.strain == "green" and self.curvature == "linear":
            message = "strain: green with curvature: linear is integrated exactly"
            yield Complaint(("quadrature",), message, "remove this key")
