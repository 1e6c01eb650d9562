"""The models of beams: which body each makes, and which coordinates its state has.

The page to read before adding a model: a file with its body, and an entry in `MODELS`.
"""

from __future__ import annotations

from pkgutil import resolve_name
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

if TYPE_CHECKING:
    from hfsim.mechanics.body import Body
    from hfsim.parts.bodies.blueprint import Blueprint
    from hfsim.parts.bodies.section_blueprint import SectionBlueprint


class Model(NamedTuple):
    """One model of a flexible body.

    Attributes
    ----------
    body, spatial, gradients, sections, flat : str
        Where its classes of bodies stand: in the plane; in space of lines, of fully parameterised beams, and
        of beams with sections; of these in the plane.  They are imported when a scene has one.  Empty where
        it has none.
    frame : bool
        Whether the state has a body frame and coordinates relative to it.
    strain : str
        ``none`` in a rigid body; ``exact`` as the element says; ``linear`` about the undeformed state in
        the body frame; ``low_order`` in the axial variable w with the foreshortening in the kinematics.
    leaves_out : tuple of str
        Terms by which its error is estimated, of `hfsim.trust.validity`; none where it is the truth.
    rung : int or None
        Place on the ladder of models that are chosen in a run, from the cheapest to the truth.
    alone : bool
        Whether it is worth that only for the one flexible beam of a scene.
    lacks : tuple of (key, value, words, what to say instead)
        Options of beams without sections that it does not know.
    without : tuple of str
        Elements that it does not know.
    varying_mass : bool
        Whether the mass matrix of its bodies changes with the motion, but of those with sections.
    """

    body: str
    frame: bool
    strain: Literal["none", "exact", "linear", "low_order"]
    leaves_out: tuple[str, ...] = ()
    rung: int | None = None
    alone: bool = False
    lacks: tuple[tuple[str, object, str, str], ...] = ()
    spatial: str = ""
    gradients: str = ""
    sections: str = ""
    flat: str = ""
    without: tuple[str, ...] = ()
    varying_mass: bool = False

    @property
    def flexible(self) -> bool:
        """Whether its body deforms."""
        return self.strain != "none"

    @property
    def truncated(self) -> bool:
        """Whether its body deforms, but terms of that are left out."""
        return self.flexible and bool(self.leaves_out)

    def where(self, element: str, n_dim: int) -> str:
        """Return where the class of its bodies of an element stands; empty if it has none."""
        if element in self.without:
            return ""
        if element == "cosserat":
            return self.flat if n_dim == 2 else self.sections
        return self.body if n_dim == 2 else {"continuum": self.gradients}.get(element, self.spatial)

    def assemble(self, beam: Blueprint | SectionBlueprint, element: str) -> Body:
        """Return the body of a beam in this model."""
        where = self.where(element, beam.n_dim)
        return cast("Body", resolve_name(f"hfsim.parts.bodies.{where}").of(beam, self.frame))

    def stepping_in(self, coordinates: Literal["auto", "frame", "absolute"], element: str | None) -> Model:
        """Return the model with its state in the coordinates asked for, where it has them.

        A body frame is a change of variables of absolute nodal coordinates, so that steps can be made
        in either; the axial variable that ``low_order`` has without sections is not.  ``auto`` takes
        those in which the stiffness changes least: nodal ones for ``exact``, the body frame for ``linear``.
        Nodes with section vectors have equations of their own, which the frame would couple to those of
        the root: there it takes nodal ones, too.
        """
        sections = element == "cosserat"
        model = self._replace(varying_mass=self.varying_mass and not sections)
        if model.strain == "none" or model.varying_mass or coordinates == "frame":
            return model
        return model._replace(frame=coordinates == "auto" and self.strain == "linear" and not sections)


MODELS: dict[str, Model] = {
    "rigid": Model(
        "planar_rigid_beam:RigidBeam",
        frame=False,
        strain="none",
        leaves_out=("bending", "stretch"),
        rung=0,
        spatial="spatial_rigid_beam:SpatialRigidBeam",
        gradients="spatial_rigid_section_beam:SpatialRigidSectionBeam",
        sections="spatial_rigid_section_beam:SpatialRigidSectionBeam",
        flat="planar_rigid_section_beam:PlanarRigidSectionBeam",
    ),
    "linear": Model(
        "linear:PlanarLinearBeam",
        frame=True,
        strain="linear",
        leaves_out=("foreshortening", "stiffening", "twist"),
        rung=1,
        alone=True,
        spatial="spatial_linear:SpatialLinearBeam",
        gradients="spatial_continuum_linear:LinearContinuumBeam",
        sections="section_linear:LinearSectionBeam",
        flat="section_linear:LinearSectionBeam",
    ),
    "lowOrder": Model(
        "planar_low_order_body:LowOrderBody",
        frame=True,
        strain="low_order",
        leaves_out=("curvature", "twist"),
        lacks=(("rotary_inertia", True, "rotary inertia", "false"),),
        spatial="spatial_low_order_body:SpatialLowOrderBody",
        sections="section_low_order:LowOrderSectionBeam",
        flat="section_low_order:LowOrderSectionBeam",
        without=("continuum",),
        varying_mass=True,
    ),
    "exact": Model(
        "nodal:NodalBeam",
        frame=True,
        strain="exact",
        rung=2,
        spatial="spatial_nodal:SpatialNodalBeam",
        gradients="spatial_continuum:SpatialContinuumBeam",
        sections="cosserat:CosseratBeam",
        flat="cosserat:CosseratBeam",
    ),
    "ancf": Model(
        "nodal:NodalBeam",
        frame=False,
        strain="exact",
        spatial="spatial_nodal:SpatialNodalBeam",
        gradients="spatial_continuum:SpatialContinuumBeam",
        sections="cosserat:CosseratBeam",
        flat="cosserat:CosseratBeam",
    ),
}

LADDER = tuple(
    sorted((n for n, m in MODELS.items() if m.rung is not None), key=lambda n: MODELS[n].rung or 0)
)
"""Models that are chosen in a run: from the cheapest, which is rigid, to the one that leaves nothing out."""


def missing(model: str, element: str, n_dim: int) -> tuple[str, str] | None:
    """Return that beams of an element have no such model, and what to take; None if they have it."""
    there = [name for name, one in MODELS.items() if one.where(element, n_dim)]
    needed = LADDER if model == "auto" else (model,)
    if set(needed) <= set(there) or (model not in MODELS and model != "auto"):
        return None
    space = "space" if n_dim == 3 else "the plane"
    instead = f"take {', '.join(there)}, or another element"
    return f"a {element} element has no model {model} in {space}", instead
