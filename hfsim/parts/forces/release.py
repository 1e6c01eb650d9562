"""What decks say of when springs let go."""

from collections.abc import Iterator

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import NonNegativeTime, PositiveForce, PositiveMoment
from hfsim.deck.spec import Spec
from hfsim.mechanics.releases import Release


class ReleaseSpec(Spec):
    """When a spring lets go for good: at the first of what is stated."""

    time: NonNegativeTime | None = None
    """At a time [s]."""

    force: PositiveForce | None = None
    """When its force is so large, to either side [N]."""

    moment: PositiveMoment | None = None
    """When its moment is so large, to either side [N m]."""

    def complaints(self) -> Iterator[Complaint]:
        """Yield a release that says nothing."""
        if not self.model_fields_set:
            yield Complaint((), "a release needs a time, a force or a moment", "e.g. {time: 2}")

    def build(self) -> Release:
        """Return the release."""
        limits = (("m", self.force), ("rad", self.moment))
        most = tuple((unit, limit) for unit, limit in limits if limit is not None)
        return Release(most=most) if self.time is None else Release(self.time, most)
