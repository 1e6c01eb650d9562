"""Materials, and all numbers that follow from them and from cross-sections; no other file computes these."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, NamedTuple, Self

from hfsim.deck.complaints import Complaint
from hfsim.deck.fields import NonNegativeTime, PositiveDensity, PositivePressure, measures, within
from hfsim.deck.sections import Fibres, GeneralSection, Moments, equivalent_side
from hfsim.deck.spec import Around, Spec

if TYPE_CHECKING:
    from hfsim.deck.section_shapes import CircleSection, RectangleSection, TubeSection
    from hfsim.deck.section_stiffness import CoupledSection, StiffnessSection
    from hfsim.maths.arrays import Array

    ShapedSection = GeneralSection | RectangleSection | CircleSection | TubeSection
    AnySection = ShapedSection | StiffnessSection | CoupledSection

_PLASTIC_TO_OSMIUM = (0.5, 23.0)
"""Densities of solids [g/cm^3]."""
_MODULI = (0.05, 1200.0)
"""Young's moduli of solids [GPa]."""
_METALS = (5e4, 4.5e5)
"""Young's moduli of metals [MPa]."""


class MaterialSpec(Spec):
    """Isotropic elastic material with damping that grows with the strain rate."""

    density: PositiveDensity
    """Mass density [kg/m^3]."""

    youngs_modulus: PositivePressure
    """Young's modulus [Pa]."""

    poisson_ratio: Annotated[float, measures(above=-1, below=0.5)] = 0.0
    """Poisson's ratio [-]."""

    axial_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of the axial strain, and of shear where sections have it [s]."""

    bending_damping: NonNegativeTime = 0.0
    """Kelvin-Voigt retardation time of the curvature, and of twist where sections have it [s]."""

    def slips_in(self, around: Around) -> Iterator[Complaint]:
        """Yield numbers of solids in other units."""
        rho, E = self.density, self.youngs_modulus
        for unit, scale in (("g/cm3", 1.0), ("kg/mm3", 1e-6), ("t/mm3", 1e-9)):
            if within(rho / scale, _PLASTIC_TO_OSMIUM) and rho != 1.0:
                yield Complaint(("density",), f"{rho:g} kg/m^3 is no solid's", f"'{rho:g} {unit}'?")
        if within(E, _MODULI):
            yield Complaint(("youngs_modulus",), f"{E:g} Pa is softer than jelly", f"'{E:g} GPa'?")
        elif within(E, _METALS) and rho >= 2000.0:
            message = f"{E:g} Pa is soft rubber's, and {rho:g} kg/m^3 a metal's"
            yield Complaint(("youngs_modulus",), message, f"'{E:g} MPa'?")
        if self.poisson_ratio < 0.0:
            message = f"{self.poisson_ratio:g}: this material becomes thicker when it is pulled"
            yield Complaint(("poisson_ratio",), message, f"{-self.poisson_ratio:g}?")

    @property
    def lame_lambda(self) -> float:
        r"""First Lame constant [Pa], :math:`E \nu / ((1 + \nu)(1 - 2 \nu))`."""
        nu = self.poisson_ratio
        return self.youngs_modulus * nu / ((1 + nu) * (1 - 2 * nu))

    @property
    def lame_mu(self) -> float:
        r"""Second Lame constant, the shear modulus [Pa], :math:`E / (2 (1 + \nu))`."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


class BeamProperties(NamedTuple):
    """All that follows from a beam's material and section.

    Attributes
    ----------
    mass_per_length : float
        rho A [kg/m].
    rotary_inertia : float
        rho I, per length [kg m].
    axial_stiffness : float
        EA [N].
    bending_stiffness : float
        EI [N m^2].
    axial_damping, bending_damping : float
        Kelvin-Voigt retardation times of strain and curvature [s].
    lame_lambda, lame_mu : float
        Lame constants [Pa].
    height, width : float
        Of the (equivalent) rectangle [m]; the height lies in the bending plane.
    breadth : float
        Width of the rectangle with the same second moment for bending across that plane, in space [m].
    fibres : Fibres or None
        What normal stresses follow from, where the section's shape is known.
    """

    mass_per_length: float = 0.0
    rotary_inertia: float = 0.0
    axial_stiffness: float = 0.0
    bending_stiffness: float = 0.0
    axial_damping: float = 0.0
    bending_damping: float = 0.0
    lame_lambda: float = 0.0
    lame_mu: float = 0.0
    height: float = 0.0
    width: float = 0.0
    fibres: Fibres | None = None
    breadth: float = 0.0

    @classmethod
    def of(cls, material: MaterialSpec | None, section: "AnySection") -> Self:
        """Return the properties of a beam with a section, of a material unless that is stiff by itself."""
        if section.stiff:
            return cls(
                mass_per_length=section.mass_per_length,
                rotary_inertia=section.rotary[1],
                axial_stiffness=section.axial_stiffness,
                bending_stiffness=section.bending[1],
                axial_damping=section.axial_damping,
                bending_damping=section.bending_damping,
            )
        assert material is not None
        return cls(
            mass_per_length=material.density * section.area,
            rotary_inertia=material.density * section.bending[1],
            axial_stiffness=material.youngs_modulus * section.area,
            bending_stiffness=material.youngs_modulus * section.bending[1],
            axial_damping=material.axial_damping,
            bending_damping=material.bending_damping,
            lame_lambda=material.lame_lambda,
            lame_mu=material.lame_mu,
            height=section.height,
            width=section.width,
            fibres=getattr(section, "fibres", None),
            breadth=equivalent_side(section.bending[0], section.area),
        )

    @classmethod
    def of_a_line(cls, material: MaterialSpec | None, section: "AnySection") -> Self:
        """Return the properties of a beam whose sections' rotary inertia does not count."""
        return cls.of(material, section)._replace(rotary_inertia=0.0)

    @property
    def damped(self) -> bool:
        """Whether the material loses energy."""
        return bool(self.axial_damping or self.bending_damping)

    def at(self, shares: "Array") -> Self:
        """Return the properties at shares of the length: they are the same all along a beam."""
        return self

    def in_elements(self, places: "Array", count: int) -> Self:
        """Return those at places of the unit interval in each of equal elements, the same."""
        return self

    def cuts(self, count: int) -> tuple[float, ...]:
        """Return where stations stand inside equal elements: nowhere."""
        return ()


class SectionProperties(NamedTuple):
    """All that follows from the material and the section of a beam; pairs are of y and z.

    The plane is that of x and y: of pairs, shear along y and what goes with turns about z count there.

    Attributes
    ----------
    mass_per_length : float
        rho A [kg/m].
    rotary_inertia : tuple of float
        rho I_y and rho I_z, per length [kg m]; that about the axis is their sum.
    axial_stiffness : float
        EA [N].
    shear_stiffness : tuple of float
        k_y GA and k_z GA [N].
    torsion_stiffness : float
        GJ [N m^2].
    bending_stiffness : tuple of float
        EI_y and EI_z: bending about y, about z [N m^2].
    axial_damping, bending_damping : float
        Kelvin-Voigt retardation times of stretch and shear, and of twist and curvature [s].
    fibres : Fibres or None
        What normal stresses follow from, where the section's shape is known.
    couplings : tuple of float
        What of the stiffness matrix stands above its diagonal, row by row [N], [N m], [N m^2].
    """

    mass_per_length: float
    rotary_inertia: Moments
    axial_stiffness: float
    shear_stiffness: Moments
    torsion_stiffness: float
    bending_stiffness: Moments
    axial_damping: float = 0.0
    bending_damping: float = 0.0
    fibres: Fibres | None = None
    couplings: tuple[float, ...] = (0.0,) * 15

    @classmethod
    def of(cls, material: MaterialSpec | None, section: "AnySection") -> Self:
        """Return the properties of a beam with a section, of a material unless that is stiff by itself."""
        if section.stiff:
            return cls(
                mass_per_length=section.mass_per_length,
                rotary_inertia=section.rotary,
                axial_stiffness=section.axial_stiffness,
                shear_stiffness=section.shears,
                torsion_stiffness=section.torsion_stiffness or 0.0,
                bending_stiffness=section.bending,
                axial_damping=section.axial_damping,
                bending_damping=section.bending_damping,
                couplings=section.couplings,
            )
        assert material is not None
        E, G, (I_y, I_z) = material.youngs_modulus, material.lame_mu, section.bending
        k_y, k_z = section.shear(material.poisson_ratio)
        return cls(
            mass_per_length=material.density * section.area,
            rotary_inertia=(material.density * I_y, material.density * I_z),
            axial_stiffness=E * section.area,
            shear_stiffness=(k_y * G * section.area, k_z * G * section.area),
            torsion_stiffness=G * section.torsion,
            bending_stiffness=(E * I_y, E * I_z),
            axial_damping=material.axial_damping,
            bending_damping=material.bending_damping,
            fibres=getattr(section, "fibres", None),
        )

    @classmethod
    def of_plane_sections(cls, own: BeamProperties) -> Self:
        """Return those of fully parameterised beams: of plane sections, without factors of shear."""
        about_y, about_z = (side**2 / 12.0 for side in (own.breadth, own.height))
        shear = own.lame_mu * own.height * own.width
        return cls(
            mass_per_length=own.mass_per_length,
            rotary_inertia=(own.mass_per_length * about_y, own.mass_per_length * about_z),
            axial_stiffness=own.axial_stiffness,
            shear_stiffness=(shear, shear),
            torsion_stiffness=shear * (about_y + about_z),
            bending_stiffness=(own.axial_stiffness * about_y, own.axial_stiffness * about_z),
        )

    def at(self, shares: "Array") -> Self:
        """Return the properties at shares of the length: they are the same all along a beam."""
        return self

    def in_elements(self, places: "Array", count: int) -> Self:
        """Return those at places of the unit interval in each of equal elements, the same."""
        return self

    def cuts(self, count: int) -> tuple[float, ...]:
        """Return where stations stand inside equal elements: nowhere."""
        return ()

    @property
    def stiffness(self) -> tuple[float, ...]:
        """EA, GA_y, GA_z [N], GJ, EI_y, EI_z [N m^2]."""
        forces = (self.axial_stiffness, *self.shear_stiffness)
        return (*forces, self.torsion_stiffness, *self.bending_stiffness)

    @property
    def retardation(self) -> tuple[float, ...]:
        """The retardation times of what these resist [s]."""
        return (self.axial_damping,) * 3 + (self.bending_damping,) * 3
