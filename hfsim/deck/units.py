"""Quantities with units: text such as ``"12 deg"`` or ``"7 GPa"`` to SI numbers.

Inside hfsim everything is SI; this table is the edge where it is converted.
"""

from __future__ import annotations

import re
from contextlib import suppress
from decimal import Decimal
from functools import cache

_PI = "3.14159265358979323846264338328"
_DEGREE = str(Decimal(_PI) / 180)
_TURN = str(Decimal(_PI) * 2)
_RPM = str(Decimal(_PI) / 30)

_LENGTHS = {"m": "1", "km": "1e3", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "in": "0.0254", "ft": "0.3048"}
_METRIC = ("m", "cm", "mm")
_FORCES = {"N": "1", "kN": "1e3", "MN": "1e6", "mN": "1e-3"}
_MOMENTS = {"N*m": "1", "kN*m": "1e3", "MN*m": "1e6", "N*mm": "1e-3", "mN*m": "1e-3"}
_ANGLES = {"rad": "1", "mrad": "1e-3", "deg": _DEGREE, "°": _DEGREE, "rev": _TURN}


def _power(exponent: int) -> dict[str, str]:
    return {f"{unit}{exponent}": str(Decimal(_LENGTHS[unit]) ** exponent) for unit in _METRIC}


def _per(units: dict[str, str], divisor: str) -> dict[str, str]:
    return {f"{unit}/{divisor}": factor for unit, factor in units.items()}


UNITS: dict[str, dict[str, str]] = {
    "length": _LENGTHS,
    "angle": _ANGLES,
    "time": {"s": "1", "ms": "1e-3", "us": "1e-6", "min": "60", "h": "3600"},
    "mass": {"kg": "1", "g": "1e-3", "t": "1e3"},
    "force": _FORCES,
    "moment": _MOMENTS,
    "pressure": {"Pa": "1", "kPa": "1e3", "MPa": "1e6", "GPa": "1e9", "N/m2": "1", "N/mm2": "1e6"},
    "density": {
        **{"kg/m3": "1", "g/cm3": "1e3", "t/m3": "1e3", "kg/l": "1e3"},
        **{"kg/mm3": "1e9", "t/mm3": "1e12"},
    },
    "area": _power(2),
    "second_moment": _power(4),
    "mass_per_length": {"kg/m": "1", "g/m": "1e-3", "kg/mm": "1e3", "t/m": "1e3"},
    "inertia_per_length": {"kg*m": "1", "g*m": "1e-3", "kg*mm": "1e-3"},
    "flexural_rigidity": {"N*m2": "1", "kN*m2": "1e3", "MN*m2": "1e6", "N*mm2": "1e-6"},
    "inertia": {"kg*m2": "1", "g*m2": "1e-3", "kg*cm2": "1e-4", "kg*mm2": "1e-6"},
    "velocity": {"m/s": "1", "mm/s": "1e-3", "cm/s": "1e-2", "km/s": "1e3", "km/h": str(1 / Decimal("3.6"))},
    "acceleration": {"m/s2": "1", "mm/s2": "1e-3", "g0": "9.80665"},
    "angular_velocity": {"rpm": _RPM, "rev/min": _RPM, **_per(_ANGLES, "s")},
    "frequency": {"Hz": "1", "kHz": "1e3", "1/s": "1"},
    "stiffness": {**_per(_FORCES, "m"), "N/mm": "1e3", "kN/mm": "1e6"},
    "force_per_length": {**_per(_FORCES, "m"), "N/mm": "1e3", "kN/mm": "1e6"},
    "damping": _per({"N*s": "1", "kN*s": "1e3"}, "m"),
    "rotational_stiffness": {
        **_per(_MOMENTS, "rad"),
        **{f"{unit}/deg": str(Decimal(factor) / Decimal(_DEGREE)) for unit, factor in _MOMENTS.items()},
    },
    "rotational_damping": _per({"N*m*s": "1", "kN*m*s": "1e3"}, "rad"),
    "dissipation": {"s/m": "1", "s/mm": "1e3"},
    "rotational_dissipation": {"s/rad": "1", "s/deg": str(1 / Decimal(_DEGREE))},
    "dimensionless": {"%": "0.01"},
}
"""Factor to SI of each unit, by dimension; powers without a caret, products with an optional ``*``."""

_DIMENSIONS: dict[str, tuple[str, float, float]] = {
    "length": ("m", 1e-12, 1e12),
    "angle": ("rad", 0.0, 1e9),
    "time": ("s", 1e-18, 1e15),
    "mass": ("kg", 1e-27, 1e30),
    "force": ("N", 0.0, 1e24),
    "moment": ("N m", 0.0, 1e24),
    "pressure": ("Pa", 1e-12, 1e18),
    "density": ("kg/m^3", 1e-12, 1e18),
    "area": ("m^2", 1e-24, 1e24),
    "second_moment": ("m^4", 1e-48, 1e48),
    "mass_per_length": ("kg/m", 1e-36, 1e36),
    "inertia_per_length": ("kg m", 1e-48, 1e48),
    "flexural_rigidity": ("N m^2", 1e-48, 1e48),
    "inertia": ("kg m^2", 1e-48, 1e48),
    "velocity": ("m/s", 0.0, 1e12),
    "acceleration": ("m/s^2", 0.0, 1e15),
    "angular_velocity": ("rad/s", 0.0, 1e12),
    "frequency": ("Hz", 1e-15, 1e15),
    "stiffness": ("N/m", 0.0, 1e24),
    "force_per_length": ("N/m", 0.0, 1e24),
    "damping": ("N s/m", 0.0, 1e24),
    "rotational_stiffness": ("N m/rad", 0.0, 1e24),
    "rotational_damping": ("N m s/rad", 0.0, 1e24),
    "dissipation": ("s/m", 0.0, 1e24),
    "rotational_dissipation": ("s/rad", 0.0, 1e24),
    "dimensionless": ("-", 0.0, 1e24),
}
"""The SI unit of each dimension; smallest number that counts as greater than zero, and largest magnitude."""

SI_UNITS = {name: unit for name, (unit, _, _) in _DIMENSIONS.items()}
"""The SI unit of each dimension, as messages show it."""

RANGES = {name: (least, most) for name, (_, least, most) in _DIMENSIONS.items()}
"""Smallest number that counts as greater than zero, and largest magnitude, in SI: far beyond all mechanisms.

Within them, whatever is computed of a deck's numbers neither overflows nor vanishes.
"""

_LONGEST = 100
"""Characters of a quantity."""

_QUANTITY = re.compile(r"\s*([-+]?(?:\.\d+|\d+\.?\d*)(?:[eE][-+]?\d+)?)\s*(.*?)\s*\Z", re.ASCII)
_NUMBER_GOES_ON = re.compile(r"(?!1/)[-+.\d_,eE]*[.\d_,]|[eE][-+]?(?![\w%])", re.ASCII)
"""What follows a number and is no unit, as 1/min is: more of a number, or an exponent without digits."""

_DECIMAL_COMMA = re.compile(r"\A([-+]?[0-9]+),([0-9]+(?![.,_\d]))", re.ASCII)

_ASKEW = re.compile(r"[${(]+\s*([A-Za-z_]\w*)\s*[)}]*", re.ASCII)
"""A name as other programs' templates have it."""


class UnitError(ValueError):
    """Text that is no quantity of the dimension asked for; ``hint`` says what would be, ``unit`` is wrong."""

    def __init__(self, message: str, hint: str = "", unit: str = "") -> None:
        super().__init__(message)
        self.hint, self.unit = hint, unit


def describe(dimension: str) -> str:
    """Return a dimension and its SI unit in words.

    Examples
    --------
    >>> describe("angular_velocity")
    'an angular velocity [rad/s]'
    """
    if dimension == "dimensionless":
        return "a number"
    words = dimension.replace("_", " ")
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words} [{SI_UNITS[dimension]}]"


def parse_quantity(text: str, dimension: str) -> float:
    """Return a quantity with a unit in SI.

    Parameters
    ----------
    text : str
        A number and a unit.
    dimension : str
        A key of `UNITS`.

    Raises
    ------
    UnitError
        The text is no quantity, or its unit is unknown or of another dimension.

    Examples
    --------
    >>> parse_quantity("9 mm", "length")
    0.009
    >>> parse_quantity("2.5 kg/m^3", "density")
    2.5
    """
    match = _QUANTITY.match(text) if len(text) <= _LONGEST else None
    expected = f"must be {describe(dimension)}"
    if match is None:
        askew = _ASKEW.fullmatch(text.strip())
        hint = f'"${{{askew[1]}}}" is the value of a parameter' if askew else _known_units(dimension)
        raise UnitError(f"{expected}, not '{text}'", hint)
    number, unit = match.groups()
    if not unit:
        raise UnitError(f"{expected}, not the text '{text}'", f"without quotes, {number} is taken in SI")
    factor = _factor(unit, dimension)
    if factor is None:
        kind, more = _kind_of(unit), _NUMBER_GOES_ON.match(text, match.start(2))
        if more and not kind:
            meant = _DECIMAL_COMMA.sub(r"\1.\2", text.strip())
            hint = "" if meant == text.strip() else f"did you mean '{meant}'?"
            raise UnitError(f"{expected}, '{text[: more.end()].strip()}' is no number", hint)
        what = kind or "not a known unit"
        raise UnitError(f"{expected}, '{unit}' is {what}", _known_units(dimension, unit), unit)
    try:
        return float(Decimal(number) * Decimal(factor))
    except (ArithmeticError, OverflowError) as error:
        raise UnitError(f"{expected}, '{text}' is out of range", "") from error


def plain_number(text: str) -> float | None:
    """Return the number that a text alone is; None where it is none, as `1_0`, which Python would take.

    Examples
    --------
    >>> plain_number("1e3"), plain_number("1_0"), plain_number("gauss")
    (1000.0, None, None)
    """
    try:
        return float(text) if "_" not in text and text.isascii() else None
    except ValueError:
        return None


@cache
def words_of_units() -> dict[str, float]:
    """Return the units that are one word, of whatever dimension, with their size in SI."""
    units = (pair for known in UNITS.values() for pair in known.items())
    return {unit: float(factor) for unit, factor in units if unit.isalnum() and unit.isascii()}


def quantity_of_any_kind(text: str) -> tuple[float, str] | None:
    """Return a quantity with a unit in SI, whatever it measures, and the SI unit; None where it is none.

    Examples
    --------
    >>> quantity_of_any_kind("50 cm"), quantity_of_any_kind("gauss")
    ((0.5, 'm'), None)
    """
    for dimension in UNITS:
        with suppress(UnitError):
            return parse_quantity(text, dimension), SI_UNITS[dimension]
    return None


def _plain(unit: str) -> str:
    """Return a unit as the table writes it: ``kg/m³`` and ``kg / m^3`` are ``kg/m3``, ``N m`` is ``N*m``."""
    unit = unit.translate(str.maketrans("²³⁴µμ·", "234uu*", "^"))
    return re.sub(r"\s*([/*])\s*|\s+", lambda match: match.group(1) or "*", unit)


def _factor(unit: str, dimension: str) -> str | None:
    plain = _plain(unit)
    for known, factor in UNITS[dimension].items():
        if plain in (known, known.replace("*", "", 1), known.replace("*", "")):
            return factor
    return None


def _known_units(dimension: str, unit: str = "") -> str:
    for known in UNITS[dimension]:
        if known.lower() == _plain(unit).lower():
            return f"did you mean '{known}'?"
    return f"units: {', '.join(UNITS[dimension])}"


def _kind_of(unit: str) -> str:
    for dimension in UNITS:
        if _factor(unit, dimension) is not None:
            return f"a unit of {dimension.replace('_', ' ')}"
    return ""
