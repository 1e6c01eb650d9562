"""What deck entries of each kind of part say of themselves: the page to read before adding one.

Checks and rules ask these facts; they know no kind of body, joint, spring or load by name.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import Between, split_point
from hfsim.deck.spec import Around, Spec, entry_of
from hfsim.maths.arrays import Array
from hfsim.maths.rotations import freedoms

if TYPE_CHECKING:
    from hfsim.deck.law_spec import LawSpec
    from hfsim.mechanics.body import Body
    from hfsim.mechanics.constraints import Held
    from hfsim.mechanics.force import ForcePart
    from hfsim.mechanics.markers import Marker
    from hfsim.mechanics.resistances import Resistance
    from hfsim.mechanics.ties import Tie


class BodySpec(Spec):
    """Base of bodies."""

    noun: ClassVar[str] = "body"
    """What one of its kind is called."""

    own_points: ClassVar[tuple[str, ...]] = ()
    """Points that every body of this kind has, besides those a deck names."""

    rigid: ClassVar[bool] = False
    """Whether it cannot deform: it has no model, and can be folded into the ground."""

    @property
    def sectioned(self) -> bool:
        """Whether, in space, its points have three axes, not the tangent of a line alone."""
        return True

    vectors = ("points",)

    def lacking(self, model: str, n_dim: int) -> tuple[str, str] | None:
        """Return that it has no such model, and what to take; None if it has it or needs none."""
        return None

    def assemble(self, name: str, start: int, deck: Any, model: Any) -> "Body":
        """Return the body, its coordinates from a column on; the model is that of a body that deforms."""
        raise NotImplementedError

    def size(self, n_dim: int) -> int:
        """Return the number of its coordinates; of a rigid body its freedoms, as its axes cost little."""
        return freedoms(n_dim)

    def default_channels(self, n_dim: int) -> tuple[str, ...]:
        """Return what is written of it where a deck names no channels."""
        if n_dim == 2:
            return ("x", "y", "angle", "angular_velocity")
        turns = (f"{what}_{axis}" for what in ("rotation", "angular_velocity") for axis in "xyz")
        return ("x", "y", "z", *turns)


class JointSpec(Spec):
    """Base of joints."""

    type: str
    """Kind of joint."""

    between: Between
    """The two points, [A, B]."""

    @property
    def points(self) -> tuple[str, ...]:
        """All points that it ties, these first."""
        return self.between

    meets: ClassVar[bool] = False
    """Whether its two points stay together."""

    welds: ClassVar[bool] = False
    """Whether it leaves no motion between its two bodies."""

    turns: ClassVar[bool] = False
    """Whether, in space, it leaves a turn about one axis that both bodies share, and no other."""

    swings: ClassVar[bool] = False
    """Whether, in space, it leaves turns from an orientation that it states."""

    holds: ClassVar[bool] = True
    """Whether it holds anything; else it only exerts a force on what it leaves free."""

    follows_start: ClassVar[bool] = False
    """Whether, in space, its axis on the second body is where both bodies' stated orientations have it."""

    def held(self, facing: Array | None = None) -> "tuple[Held, ...]":
        """Return what it holds of the second point against the first, such as shifts and turns.

        In space that depends on how B's frame faces A's where all its angles are zero: by a matrix (3, 3)
        that takes vectors in B's frame to A's.
        """
        raise NotImplementedError

    steadies: ClassVar[bool] = True
    """Whether what it exerts depends on where its bodies are, so that it can hold them in place."""

    measures: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Angle and distance that it has: the unit, and the key without which it has none, if any."""

    def coordinates(self, facing: Array | None = None) -> "Iterator[tuple[str, Held]]":
        """Yield angles and distances that it leaves free, drives or acts on, with the key of each, if any."""
        return iter(())

    @property
    def resisting(self) -> "Mapping[str, tuple[Resistance, ...]]":
        """What resists its coordinates, or acts on them, by the key of each."""
        return {}

    def resisted(self, facing: Array | None = None) -> "Iterator[tuple[str, Held, tuple[Resistance, ...]]]":
        """Yield the coordinates that it resists or acts on: their keys, what, and by what forces."""
        acting = {key: forces for key, forces in self.resisting.items() if forces}
        own = self.coordinates(facing) if acting else ()
        yield from ((key, held, acting[key]) for key, held in own if key in acting)

    @property
    def carries(self) -> bool:
        """Whether it resists shifts of its bodies, not turns alone."""
        return True

    led_angle: ClassVar[str] = ""
    """The key of a law of time that its angle follows, if it has one."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield angles in that law that look like degrees."""
        yield from super().slips_in(around)
        if self.led_angle and (law := getattr(self, self.led_angle)):
            yield from (one.inside(self.led_angle) for one in law.turns_in_degrees())

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield an axis of an angle in the plane."""
        yield from super().complaints_in(around)
        axis = getattr(self, "axis", None)
        if around.n_dim == 2 and not self.carries and axis is not None and len(axis) == 2:
            why = "in a planar scene angles and torques are about the axis across the plane"
            yield Complaint(("axis",), why, "remove this key", True)

    @property
    def stands(self) -> bool:
        """Whether what it drives stands still, where any joint without a law does."""
        return False


class SpringSpec(Spec):
    """Base of springs."""

    release: Annotated[Any, entry_of("hfsim.parts.forces.release.ReleaseSpec")] | None = None
    """When it lets go for good; never without it."""

    if TYPE_CHECKING:
        between: tuple[str, str]
        stiffness: float
        damping: float

    def complaints_in(self, around: Around) -> Iterator[Complaint]:
        """Yield a release by an effort that it has not, or of what is not let go."""
        yield from super().complaints_in(around)
        if self.release is None:
            return
        for key in ("force", "moment"):
            if getattr(self.release, key) is not None and key not in self.limits:
                hint = f"a {' or a '.join(self.limits)}, or a time"
                yield Complaint(("release", key), f"this spring has no {key} by which it could let go", hint)
        for key in self.lasting:
            if getattr(self, key, None) is not None:
                hint = "state it in a spring of its own"
                yield Complaint((key,), f"a spring that lets go has no {key}", hint, True)

    @property
    def on(self) -> Mapping[str, Any]:
        """The joints and springs whose coordinates it is on, by their names; none where it has two points."""
        return {}

    def bind(self, *known: Mapping[str, Any]) -> None:
        """Take note of these, of all springs and joints by name: joints go before springs."""

    def coupling(self, parts: "Sequence[Tie]", start: Array) -> "ForcePart":
        """Return the force on what parts measure, in a scene with coordinates (n,) at the start."""
        raise NotImplementedError

    @property
    def points(self) -> tuple[str, ...]:
        """The points that it ties."""
        return self.between

    carries: ClassVar[bool] = False
    """Whether it resists shifts of its bodies, not turns alone."""

    steadies: ClassVar[bool] = True
    measures: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Both as of joints."""

    limits: ClassVar[tuple[str, ...]] = ()
    """What of its efforts may make it let go: ``force``, ``moment``."""

    lasting: ClassVar[tuple[str, ...]] = ("friction", "stops", "latch")
    """Its keys of what does not let go."""

    @property
    def framed(self) -> tuple[str, ...]:
        """Those of its points on whose frames' turns it depends, which lines have not."""
        return ()

    def frameless(self, end: str) -> str:
        """Return what serves in its place where one of these has none; empty if nothing does."""
        return "two_point springs beside the axis"

    reacts: ClassVar[bool] = True
    """Whether what it does to its second point is one force and one moment."""

    @property
    def about(self) -> tuple[str, ...]:
        """Axes of A, of ``x``, ``y``, ``z``, about each of which it resists an angle of its own in space."""
        return ()

    @property
    def rest_turn(self) -> float:
        """Angle in the plane, or about its one axis, at which it is at rest [rad]."""
        return 0.0

    @property
    def mount(self) -> JointSpec | None:
        """The joint that holds B where it is without force, if that is one place."""
        return None

    def firmness(self, n_dim: int) -> tuple[int, int, float, float]:
        """Return how many shifts and turns it holds there, how many shifts, and how stiff both are in all."""
        return 0, 0, 0.0, 0.0

    def parts(self, first: "Marker", second: "Marker", start: Array) -> "Iterator[tuple[str, ForcePart]]":
        """Yield what acts between two markers of a scene with coordinates (n,) at the start, by names."""
        yield "", self.build(first, second, start)

    def build(self, first: "Marker", second: "Marker", start: Array) -> "ForcePart":
        """Return the one force that this is."""
        raise NotImplementedError

    @property
    def acts(self) -> bool:
        """Whether it ever exerts a force."""
        return bool(self.stiffness or self.damping)


class LoadSpec(Spec):
    """Base of loads."""

    type: str
    """Kind of load."""

    if TYPE_CHECKING:
        at: Any
        law: LawSpec | None

    @property
    def follows(self) -> bool:
        """Whether it turns with what it acts on."""
        return bool(getattr(self, "follower", False))

    carries: ClassVar[bool] = False
    """Whether it is a force, not a moment."""

    @property
    def owner(self) -> str:
        """The body it acts on."""
        return split_point(self.at)[0]

    def beyond(self, length: float) -> Iterable[Complaint]:
        """Yield what in it is not on a beam of a length."""
        return ()

    def build_on(self, marker: "Callable[[str], Marker]", body: "Body", spec: Any) -> "ForcePart":
        """Return the force on a body with its entry; a function gives the markers of points."""
        return self.build(marker(self.at))

    def build(self, marker: "Marker") -> "ForcePart":
        """Return the force on a marker."""
        raise NotImplementedError

    @property
    def amount(self) -> Iterable[float]:
        """Its numbers where the law is 1."""
        return (1.0,)

    @property
    def acts(self) -> bool:
        """Whether it ever exerts a force."""
        return any(self.amount) and (self.law is None or self.law.constant != 0.0)
