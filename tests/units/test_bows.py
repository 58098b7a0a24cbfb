"""Lines on the wheel that are too far off between places: as the proof of a program measures it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import inverse
from opl.motion.bows import BETWEEN, bowed_lines, freedom, off_contact
from opl.verification.contact import LEVER, contact_positions, misfit
from tests.support.planned import small_motion, small_problem


def coarse(every):
    """Return the motion of a small job with one in so many configurations on the wheel written."""
    motion = small_motion()
    written, q = np.ones(len(motion), dtype=bool), motion.q.copy()
    for index in range(motion.pass_index.max() + 1):
        rows = np.flatnonzero(motion.on_wheel & (motion.pass_index == index))
        kept = np.union1d(rows[::every], rows[-1:])
        written[rows] = np.isin(rows, kept)
        place = motion.cutter_point[rows]
        for joint in range(6):
            q[rows, joint] = np.interp(place, motion.cutter_point[kept], motion.q[kept, joint])
    return replace(motion, q=q, written=written)


def farthest(motion, before):
    """Return how far off the way from a configuration to the next is, by the proof's measure.

    Between the two: how far off lines are at configurations themselves is asked elsewhere
    (`opl.motion.line_error`), and may be most where a corner of the passes is cut.
    """
    problem = small_problem()
    cell, points = problem.cell, problem.points
    share = np.linspace(BETWEEN[0], BETWEEN[-1], 13)[:, None]
    q = motion.q[before] + share * (motion.q[before + 1] - motion.q[before])
    T_contact0_base = inverse(cell.wheel.T_base_contact(np.zeros(1)))[0]
    Ts = T_contact0_base @ forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece
    place, width = np.full((len(q), 1), motion.cutter_point[before : before + 2].mean()), 1.0
    for _ in range(5):
        place = place + np.linspace(-width, width, 41)
        at_place = Ts[:, None] @ points.frames_at(place)
        distance, angle = misfit(cell.wheel, at_place, contact_positions(cell.wheel, at_place))
        off = np.hypot(distance, LEVER * angle)
        place = np.take_along_axis(place, off.argmin(axis=1)[:, None], axis=1)
        width /= 10.0
    return off.min(axis=1).max()


@pytest.mark.parametrize("every", [2, 3])
def test_no_line_that_is_too_far_off_for_the_proof_is_left_out(every):
    motion, problem = coarse(every), small_problem()
    on, index = motion.on_wheel, motion.pass_index
    gaps = np.flatnonzero(on[:-1] & on[1:] & (index[:-1] == index[1:]))
    off = np.array([farthest(motion, before) for before in gaps])
    line = motion.positions[np.searchsorted(motion.positions, gaps, side="right") - 1]
    farthest_of = {first: off[line == first].max() for first in np.unique(line).tolist()}
    allowed = float(np.median(list(farthest_of.values())))
    bowed = {first for first, _ in bowed_lines(problem.cell, problem.points, motion, allowed)}
    assert all(first in bowed for first, most in farthest_of.items() if most > 1.02 * allowed)
    assert 0 < len(bowed) < len(farthest_of)


def test_lines_end_at_written_configurations_next_to_each_other():
    motion, problem = coarse(3), small_problem()
    lines = bowed_lines(problem.cell, problem.points, motion, 1e-5)
    assert lines == sorted(set(lines))
    following = dict(zip(motion.positions[:-1], motion.positions[1:], strict=True))
    assert all(following[first] == end for first, end in lines)
    assert not bowed_lines(problem.cell, problem.points, motion, 1.0)


@given(
    st.floats(-1.0, 1.0),
    st.lists(st.floats(-1e-4, 1e-4), min_size=3, max_size=3),
    st.lists(st.floats(-1e-3, 1e-3), min_size=3, max_size=3),
)
def test_what_is_off_is_what_the_proof_measures(share, moved, turned):
    wheel = small_problem().cell.wheel
    t = np.array([0.98 * share * wheel.last_position])
    _, room = freedom(wheel, t)
    if room[0, 1] < 2e-4 or room[0, 0] > -2e-4:  # the proof would change from flat to edge
        return
    T = np.eye(4)
    T[:3, 3] = moved
    x, y, z = turned
    rotation = np.eye(3) + np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    u, _, vt = np.linalg.svd(rotation)
    T[:3, :3] = u @ vt
    Ts_contact0 = wheel.T_contact0_contact(t) @ T
    distance, angle = misfit(wheel, Ts_contact0, contact_positions(wheel, Ts_contact0))
    measured = float(np.hypot(distance, LEVER * angle)[0])
    assert off_contact(wheel, T[None], t)[0] == pytest.approx(measured, abs=2e-7)
