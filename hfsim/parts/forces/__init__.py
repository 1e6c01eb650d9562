"""Springs between two points and loads on one; `SPRINGS` and `LOADS` name every kind there is.

The module of a kind is imported when a deck has one.
"""

from typing import TYPE_CHECKING, Annotated

from hfsim.deck.spec import OneOf, Spec

if TYPE_CHECKING:
    from hfsim.parts.forces.bushing import BushingSpec
    from hfsim.parts.forces.contact import ContactSpec
    from hfsim.parts.forces.coupling import CouplingSpec
    from hfsim.parts.forces.distributed import DistributedSpec
    from hfsim.parts.forces.drag import DragSpec
    from hfsim.parts.forces.force import ForceSpec
    from hfsim.parts.forces.moment import MomentSpec
    from hfsim.parts.forces.rotational import RotationalSpec
    from hfsim.parts.forces.two_point import TwoPointSpec

    AnySpring = RotationalSpec | TwoPointSpec | BushingSpec | ContactSpec | CouplingSpec
    AnyLoad = ForceSpec | MomentSpec | DistributedSpec | DragSpec

SPRINGS = {
    "rotational": "hfsim.parts.forces.rotational.RotationalSpec",
    "two_point": "hfsim.parts.forces.two_point.TwoPointSpec",
    "bushing": "hfsim.parts.forces.bushing.BushingSpec",
    "contact": "hfsim.parts.forces.contact.ContactSpec",
    "coupling": "hfsim.parts.forces.coupling.CouplingSpec",
}
LOADS = {
    "force": "hfsim.parts.forces.force.ForceSpec",
    "moment": "hfsim.parts.forces.moment.MomentSpec",
    "distributed": "hfsim.parts.forces.distributed.DistributedSpec",
    "drag": "hfsim.parts.forces.drag.DragSpec",
}

if not TYPE_CHECKING:
    AnySpring = Annotated[Spec, OneOf("type", SPRINGS)]
    AnyLoad = Annotated[Spec, OneOf("type", LOADS)]

__all__ = ["LOADS", "SPRINGS", "AnyLoad", "AnySpring"]
