"""Beam elements: a table of shape functions, a mass matrix and an elastic energy each."""

from hfsim.parts.elements._base import ElasticLaw, Element, Inertia, Measures, Stiffness, join_laws
from hfsim.parts.elements.cable import Cable
from hfsim.parts.elements.continuum import Continuum

ELEMENTS: dict[str, type[Element]] = {"cable": Cable, "continuum": Continuum}

__all__ = [
    "ELEMENTS",
    "Cable",
    "Continuum",
    "ElasticLaw",
    "Element",
    "Inertia",
    "Measures",
    "Stiffness",
    "join_laws",
]
