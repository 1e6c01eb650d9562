"""Bodies that are alike and stand side by side are served together, others each by themselves."""

from hfsim.mechanics.chart import side_by_side
from hfsim.parts.bodies.planar_interior import InteriorBeams
from hfsim.parts.bodies.planar_natural import NaturalBeams

ROW = (slice(0, 8), 1, 2, 0.1, False)


def test_alike_bodies_are_joined():
    both = side_by_side((NaturalBeams(*ROW), None, NaturalBeams(slice(8, 16), *ROW[1:])))
    assert [(one.columns, one.bodies) for one in both] == [(slice(0, 16), 2)]


def test_what_differs_or_stands_elsewhere_is_not():
    first = NaturalBeams(*ROW)
    others = (
        NaturalBeams(slice(8, 16), 1, 2, 0.2, False),
        NaturalBeams(slice(8, 16), 1, 2, 0.1, True),
        NaturalBeams(slice(8, 20), *ROW[1:]),
        NaturalBeams(slice(9, 17), *ROW[1:]),
        InteriorBeams(slice(8, 16), *ROW[1:]),
    )
    assert [first.joined(other) for other in others] == [None] * len(others)
