"""A wheel that is elsewhere than planned is told by its shift, and nothing else is."""

import re
from dataclasses import replace

import numpy as np
import pytest

from opl.geometry.frames import pose
from opl.motion.motion import MoveKind
from opl.proof.common_shift import common_shift, fit_shift
from opl.verification.kinematic_checks import missing_points
from opl.verification.recognise import recognise
from tests.cells.test_recognise import RULE
from tests.support.planned import small_motion, small_problem


def beside(shift_mm):
    """Return the cell with the wheel shifted, seen from contact frame 0."""
    cell = small_problem().cell
    T = cell.wheel.T_base_contact0 @ pose(np.eye(3), 1e-3 * np.array(shift_mm))
    return replace(cell, wheel=replace(cell.wheel, T_base_contact0=T))


def told(cell, q):
    time, stations = np.ones(len(q)), np.arange(len(q))
    return common_shift(cell, small_problem().points, q, time, stations, RULE)


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        ([0, 0, -0.2], "seems 0.20 mm nearer than planned"),
        ([0, 0, 0.9], "seems 0.90 mm farther away than planned"),
        ([-0.3, 0.2, 0.1], "seems 0.37 mm aside of where it was planned"),
    ],
)
def test_a_shifted_wheel_is_told_by_its_shift(shift, words):
    cell, q, points = beside(shift), small_motion().q, small_problem().points
    found = recognise(cell, points, q, np.ones(len(q)), np.arange(len(q)), RULE)
    assert missing_points(points, found.timed.motion)  # without the shift hardly any is ground
    message = str(told(cell, q))
    assert message.startswith(f"contact at wheel: the wheel {words}")
    numbers = re.search(r"\(x (\S+), y (\S+), z (\S+) mm", message).groups()
    np.testing.assert_allclose([float(number) for number in numbers], shift, atol=0.011)


@pytest.mark.parametrize("seed", range(4))
def test_the_fit_is_the_shift(seed):
    shift = np.random.default_rng(seed).uniform(-0.6, 0.6, 3)
    fitted = fit_shift(beside(shift), small_problem().points, small_motion().q)
    np.testing.assert_allclose(1e3 * fitted.p_contact0, -shift, atol=2e-3)
    assert len(fitted.observed) == 3  # the edges show what is along the axle


def test_what_no_contact_shows_stays_zero():
    """A plane on the flat of the wheel: nothing shows a shift along the axle."""
    problem, motion = small_problem(), small_motion()
    well_on_flat = np.abs(motion.contact_position) < problem.cell.wheel.flat_end - 1.0
    runs = np.split(np.arange(len(motion)), np.flatnonzero(np.diff(well_on_flat)) + 1)
    rows = max((run for run in runs if well_on_flat[run[0]]), key=len)
    ground = [int(motion.cutter_point[k]) for k in rows if motion.kind[k] is MoveKind.GRIND]
    assert len(ground) > 3
    points = replace(
        problem.points,
        Ts_workpiece_cutter=problem.points.Ts_workpiece_cutter[ground],
        pass_index=np.zeros(len(ground), dtype=int),
        arc_length=problem.points.arc_length[ground],
    )
    fitted = fit_shift(beside([0.3, 0.0, -0.2]), points, motion.q[rows])
    np.testing.assert_allclose(1e3 * fitted.p_contact0[[0, 2]], [0.0, 0.2], atol=5e-3)
    assert np.abs(fitted.observed[:, 0]).max() < 0.05


def test_what_is_no_shift_is_not_told_as_one():
    q = np.array(small_motion().q)
    on_wheel = np.flatnonzero(small_motion().on_wheel)
    one = q.copy()
    one[on_wheel[len(on_wheel) // 3], 1] += np.deg2rad(0.1)  # a single position
    assert told(small_problem().cell, one) is None
    half = q.copy()
    half[: len(q) // 2, 1] += np.deg2rad(0.05)  # one of the two passes
    assert told(small_problem().cell, half) is None
    turned = q + np.deg2rad([0.0, 0.0, 0.0, 0.0, 0.3, 0.0])  # the part in the gripper
    assert told(small_problem().cell, turned) is None
    assert told(beside([0.0, 0.0, 5.0]), q) is None  # too far to know what belongs to what
