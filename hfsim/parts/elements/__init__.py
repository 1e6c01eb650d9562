"""Beam elements: a table of shape functions, a mass matrix and an elastic energy each."""

from __future__ import annotations

from typing import Any

from hfsim.parts.elements._base import ElasticLaw, Element, Measures, join_laws
from hfsim.parts.elements.cable import Cable
from hfsim.parts.elements.continuum import Continuum

ELEMENTS: dict[str, type[Element]] = {"cable": Cable, "continuum": Continuum}
"""Elements with gradient vectors at their nodes; for section vectors see `hfsim.parts.bodies.cosserat`."""

_FORMS = "hfsim.studies.separation"
ELASTIC_FORMS: dict[str, Any] = {
    "direct": f"{_FORMS}.quadrature.DirectStiffness",
    "tabulated": f"{_FORMS}.quadrature.TabulatedStiffness",
    "separated": f"{_FORMS}.separated.SeparatedStiffness",
    "gram": f"{_FORMS}.gram.GramStiffness",
}
"""Ways to the same elastic force by the names that decks know, with the class of each or where it stands: the
study that measures them alone needs more than ``gram``, which is every element's own."""


def elastic_form(name: str) -> Any:
    """Return one of the classes that `ELASTIC_FORMS` names."""
    from pkgutil import resolve_name

    form = ELASTIC_FORMS[name]
    return resolve_name(form) if isinstance(form, str) else form


__all__ = [
    "ELASTIC_FORMS",
    "ELEMENTS",
    "Cable",
    "Continuum",
    "ElasticLaw",
    "Element",
    "Measures",
    "elastic_form",
    "join_laws",
]
