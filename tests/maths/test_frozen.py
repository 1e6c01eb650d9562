"""Classes of values: compared by identity, shown as dataclasses are."""

from dataclasses import field, replace

from hfsim.maths.frozen import frozen


@frozen
class Point:
    x: float
    y: float = field(default=0.0, repr=False)


@frozen
class Named(Point):
    name: str = ""

    def __repr__(self):
        return self.name


def test_values_differ_by_identity():
    point = Point(1.0)
    assert point != Point(1.0) and len({point, point, Point(1.0)}) == 2
    assert replace(point, y=2.0).y == 2.0


def test_texts():
    assert repr(Point(1.0)) == f"{Point.__qualname__}(x=1.0)"
    assert repr(Named(1.0, name="tip")) == "tip"
