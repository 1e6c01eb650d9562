"""Classes of values: compared by identity, shown as dataclasses are."""

from dataclasses import field, replace

import pytest

from hfsim.maths.frozen import frozen, mutable


@frozen
class Point:
    x: float
    y: float = field(default=0.0, repr=False)


@frozen
class Named(Point):
    name: str = ""

    def __repr__(self):
        return self.name


@mutable
class Heap:
    kind: str = field(kw_only=True)
    stones: list[int] = field(default_factory=list)
    total = 0

    def __post_init__(self):
        self.total = sum(self.stones)


def test_values_are_given_by_place_or_by_name_or_have_defaults():
    assert vars(Named(1.0, name="tip")) == {"x": 1.0, "y": 0.0, "name": "tip"}
    first, second = Heap(kind="a"), Heap([1, 2], kind="b")
    assert first.stones == [] and first.stones is not Heap(kind="c").stones
    assert (first.total, second.total, second.kind) == (0, 3, "b")


@pytest.mark.parametrize(
    ("values", "named"), [((), {}), ((1.0, 2.0, 3.0), {}), ((1.0,), {"x": 2.0}), ((1.0,), {"z": 2.0})]
)
def test_values_of_no_field_or_missing_or_given_twice(values, named):
    with pytest.raises(TypeError, match="Point"):
        Point(*values, **named)


def test_values_differ_by_identity():
    point = Point(1.0)
    assert point != Point(1.0) and len({point, point, Point(1.0)}) == 2
    assert replace(point, y=2.0).y == 2.0


def test_texts():
    assert repr(Point(1.0)) == f"{Point.__qualname__}(x=1.0)"
    assert repr(Named(1.0, name="tip")) == "tip"
