"""Rigid bodies."""

from typing import Literal

from pydantic import Field

from hfsim.deck.fields import Points, PositiveInertia, PositiveMass, Spec


class RigidSpec(Spec):
    """Rigid body; its frame is at the centre of mass."""

    type: Literal["rigid"]
    """Kind of body."""

    mass: PositiveMass
    """Mass [kg]."""

    inertia: PositiveInertia
    """Moment of inertia about the centre of mass [kg m^2]."""

    points: Points = Field(default_factory=dict)
    """Named points in the body frame [m]."""
