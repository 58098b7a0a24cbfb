"""What holds the least box up, on walls of which the answer is known."""

import numpy as np
import pytest

from opl.least.holders import holders
from opl.search.least_box import BoxProof
from opl.search.walls import Image, Line, Piece, Wall

SAME = (Image(np.ones(6), np.zeros(6), (0,)),)


def point_wall(place, q):
    """Return a wall that is crossed at one posture only."""
    corners = np.tile(np.asarray(q, dtype=float), (2, 1))
    nothing = np.zeros((1, 6))
    piece = Piece(0, Line(np.eye(4)), np.array([0.0, 1.0]), corners, nothing, nothing)
    return Wall(0, place, (piece,))


def held(*walls):
    postures = [wall.pieces[0].corners[0] for wall in walls]
    value = np.ptp(postures, axis=0).sum()
    return value, holders(walls, lambda _: SAME, lambda *_: (), value)


def test_the_ends_of_each_joint_hold_the_box_and_the_middle_does_not():
    walls = [point_wall(k, [0.3 * k, 0.1 * k**2, 0, 0, 0, 0]) for k in range(4)]
    value, found = held(*walls)
    assert value == pytest.approx(0.9 + 0.9)
    assert sorted(one.place for one in found) == [0.0, 3.0]
    assert all(set(one.joints) == {0, 1} for one in found)


def test_without_a_holder_the_others_still_need_their_own_box():
    walls = [
        point_wall(0, [0, 0, 0, 0, 0, 0]),
        point_wall(1, [0.5, 0.2, 0, 0, 0, 0]),
        point_wall(2, [0.6, -0.3, 0, 0, 0, 0]),
    ]
    value, found = held(*walls)
    assert value == pytest.approx(0.6 + 0.5)
    without = {one.place: one.bound_without for one in found}
    assert without[0.0] == pytest.approx(0.1 + 0.5, rel=2e-3)
    assert without[1.0] == pytest.approx(0.6 + 0.3, rel=2e-3)
    assert without[2.0] == pytest.approx(0.5 + 0.2, rel=2e-3)
    joints = {one.place: one.joints for one in found}
    assert joints[1.0] == (1,)
    assert set(joints[2.0]) == {0, 1}
    assert all(one.bound_without <= value for one in found)


def test_what_is_forbidden_is_left_out_of_the_least_box_and_asked_for_where_it_matters():
    corners = np.outer(np.linspace(0.0, 1.0, 11), np.eye(6)[0])
    nothing = np.zeros((10, 6))
    ramp = Piece(0, Line(np.eye(4)), np.linspace(0.0, 1.0, 11), corners, nothing, nothing)
    asked = []

    class WithoutTheLowest:
        n_flips = 1

        def clear(self, piece, flip, first, end, looks):
            low, high = np.zeros(len(piece.pad_low)), np.ones(len(piece.pad_low))
            if end > first:
                asked.append((first, end))
            if len(low) == 10 and asked:
                low[:3], high[:3] = 1.0, 0.0
            return low, high

    proof = BoxProof(lambda _: SAME, lambda *_: (), 0.5, 1e-3, WithoutTheLowest())
    proof.add(point_wall(0, np.zeros(6)))
    proof.add(Wall(0, 1.0, (ramp,)))
    while (candidate := proof.take_next()) is None:
        pass
    assert candidate.bound == pytest.approx(0.3, abs=2e-3)
    assert (0, 10) not in asked
