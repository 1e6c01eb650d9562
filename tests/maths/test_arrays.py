from hfsim.maths.arrays import random_signs


def test_signs_in_no_order_are_both_there_and_always_the_same():
    signs = random_signs((7, 30))
    assert signs.shape == (7, 30) and set(signs.ravel()) == {-1.0, 1.0}
    assert abs(signs.sum()) < 60 and (signs == random_signs((7, 30))).all()
