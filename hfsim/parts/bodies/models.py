"""The models: which coordinates the state has, and which strain measure."""

from __future__ import annotations

from typing import Literal, NamedTuple


class Model(NamedTuple):
    """One model of a flexible body.

    Attributes
    ----------
    frame : bool
        Whether the state has a body frame and coordinates relative to it.
    strain : str
        ``none`` in a rigid body; ``exact`` as the element says; ``linear`` about the undeformed state in
        the body frame; ``low_order`` in the axial variable w with the foreshortening in the kinematics.
    """

    frame: bool
    strain: Literal["none", "exact", "linear", "low_order"]

    def stepping_in(self, coordinates: Literal["auto", "frame", "absolute"]) -> Model:
        """Return the model with its state in the coordinates asked for, where it has them.

        A body frame is a change of variables of absolute nodal coordinates, so that steps can be made
        in either; the axial variable of ``low_order`` is not.  ``auto`` takes those in which the
        stiffness changes least: nodal ones for ``exact``, the body frame for ``linear``.
        """
        if self.strain in ("none", "low_order") or coordinates == "frame":
            return self
        return self._replace(frame=coordinates == "auto" and self.strain == "linear")


MODELS: dict[str, Model] = {
    "rigid": Model(frame=False, strain="none"),
    "linear": Model(frame=True, strain="linear"),
    "lowOrder": Model(frame=True, strain="low_order"),
    "exact": Model(frame=True, strain="exact"),
    "ancf": Model(frame=False, strain="exact"),
}
