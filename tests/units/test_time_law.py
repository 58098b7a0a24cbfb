"""The time law against closed forms, a linear program, and differences of its own samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.sparse import coo_matrix

from opl.errors import UnsafeError
from opl.motion.rounded import CORNER_CUT, rounded_line
from opl.motion.time_law import JointLimits, TimeLaw, fastest_law, require_limits

LIMITS = JointLimits(np.array([3.0, 3.0, 3.5, 7.0, 7.0, 10.0]), np.full(6, 8.0))


def joints(*columns):
    """Return configurations whose first joints go through columns, the others standing still."""
    q = np.zeros((len(columns[0]), 6))
    for k, column in enumerate(columns):
        q[:, k] = column
    return q


def sampled_loads(law, limits, step=1e-3):
    """Return the largest joint speed and acceleration, by limit, seen in samples of positions."""
    q = law.configurations(np.arange(0.0, law.time[-1], step))
    speed = np.abs(np.diff(q, axis=0)) / step / limits.speed
    acceleration = np.abs(q[2:] - 2.0 * q[1:-1] + q[:-2]) / step**2 / limits.acceleration
    return speed.max(), acceleration.max()


def random_line(seed, n=40):
    """Return a jerky walk with moves of very different lengths, and its wanted times."""
    random = np.random.default_rng(seed)
    times = 10.0 ** random.uniform(-2.3, -0.5, n)
    speed = np.cumsum(random.normal(scale=0.1, size=(n, 6)), axis=0)
    speed += random.normal(scale=0.3, size=(n, 6)) * (random.random((n, 1)) < 0.2)
    return np.vstack([np.zeros(6), np.cumsum(speed * times[:, None], axis=0)]), times


# closed forms


@given(
    way=st.floats(0.01, 3.0),
    speed=st.floats(0.05, 2.9),
    acceleration=st.floats(0.2, 50.0),
)
@settings(max_examples=60, deadline=None)
def test_one_joint_from_point_to_point_takes_the_time_of_the_trapezoid(way, speed, acceleration):
    limits = JointLimits(LIMITS.speed, np.full(6, acceleration))
    law = fastest_law(rounded_line(joints([0.2, 0.2 - way]), np.array([way / speed])), limits, True)
    if way >= speed**2 / acceleration:
        exact = way / speed + speed / acceleration
    else:
        exact = 2.0 * np.sqrt(way / acceleration)
    assert law.time[-1] == pytest.approx(exact, rel=1e-3)


def test_the_joint_that_needs_longest_sets_the_ramps_of_all():
    limits = JointLimits(LIMITS.speed, np.array([8.0, 1.0, 8.0, 8.0, 8.0, 8.0]))
    law = fastest_law(rounded_line(joints([0.0, 2.0], [0.0, 0.5]), np.array([2.0])), limits, True)
    assert law.time[-1] == pytest.approx(2.0 + 0.25 / 1.0, rel=1e-4)
    assert law.acceleration_load.max(axis=0)[:2] == pytest.approx([0.5, 1.0], rel=1e-3)


def circle(speed, radius=0.2, n=2000):
    angle = np.linspace(0.0, 2.0 * np.pi, n + 1)
    q = joints(radius * np.cos(angle), radius * np.sin(angle))
    return rounded_line(q, np.full(n, 2.0 * np.pi * radius / n / speed))


def test_a_circle_at_constant_speed_is_kept_as_long_as_its_acceleration_is_allowed():
    # v^2 / r = 5 of 8 allowed
    law = fastest_law(circle(1.0), LIMITS, at_rest=False)
    assert law.path_speed == pytest.approx(1.0)
    assert law.acceleration_load.max() == pytest.approx(5.0 / 8.0, rel=1e-3)


def test_on_a_circle_too_fast_by_half_the_pace_falls_to_what_the_acceleration_allows():
    # v^2 / r = 32, four times what is allowed: half the speed where one joint bears all of it
    law = fastest_law(circle(np.sqrt(32.0 * 0.2)), LIMITS, at_rest=False)
    at_top = np.interp(np.arange(1, 4) / 4.0 * law.place[-1], law.place, law.path_speed)
    assert at_top == pytest.approx(0.5, rel=0.01)
    assert law.path_speed.max() < np.sqrt(0.5) + 0.01
    assert max(sampled_loads(law, LIMITS)) <= 1.001


def test_a_corner_is_passed_as_fast_as_its_rounding_allows():
    # the speed changes by 1 rad/s within the time in which a corner cut by CORNER_CUT is gone round
    q = joints([0.0, 1.0, 1.0], [0.0, 0.0, 1.0])
    law = fastest_law(rounded_line(q, np.ones(2)), LIMITS, at_rest=False)
    half = 4.0 * CORNER_CUT
    allowed = np.sqrt(8.0 * 2.0 * half)
    assert law.path_speed.min() == pytest.approx(allowed, rel=1e-3)
    assert law.path_speed[[0, -1]] == pytest.approx(1.0)


def test_top_speed_of_a_joint_is_kept_where_the_wanted_times_ask_for_more():
    law = fastest_law(rounded_line(joints([0.0, 6.0]), np.array([1.0])), LIMITS, at_rest=False)
    assert law.time[-1] == pytest.approx(2.0, rel=1e-6)
    assert law.speed_load.max() == pytest.approx(1.0)


# what holds for every line


@given(seed=st.integers(0, 10**6), at_rest=st.booleans(), hard=st.sampled_from([1.0, 0.05]))
@settings(max_examples=40, deadline=None)
def test_samples_keep_the_limits_and_the_law_is_no_faster_than_wanted(seed, at_rest, hard):
    q, times = random_line(seed)
    limits = JointLimits(LIMITS.speed, LIMITS.acceleration * hard)
    law = fastest_law(rounded_line(q, times), limits, at_rest)
    assert max(sampled_loads(law, limits)) <= 1.001
    assert (np.diff(law.node_times) >= times * (1.0 - 1e-9)).all()
    assert max(law.speed_load.max(), law.acceleration_load.max()) <= 1.0 + 1e-4
    ends = law.configurations(np.array([0.0, law.time[-1]]))
    np.testing.assert_allclose(ends, q[[0, -1]], atol=1e-9)
    if at_rest:
        assert law.path_speed[[0, -1]] == pytest.approx(0.0, abs=1e-6)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_the_line_leaves_configurations_and_straight_moves_by_no_more_than_the_cut(seed):
    q, times = random_line(seed)
    line = rounded_line(q, times)
    assert np.abs(line.configurations(line.nodes) - q).max() <= CORNER_CUT + 1e-12
    places = np.linspace(0.0, line.nodes[-1], 2000)
    straight = np.stack([np.interp(places, line.nodes, joint) for joint in q.T], axis=-1)
    assert np.abs(line.configurations(places) - straight).max() <= CORNER_CUT + 1e-12
    middles = (line.nodes[:-1] + line.nodes[1:]) / 2.0
    np.testing.assert_allclose(line.configurations(middles), (q[:-1] + q[1:]) / 2.0, atol=1e-9)


def test_an_even_motion_is_a_straight_line_however_its_moves_are_cut():
    times = np.array([0.01, 0.2, 0.03, 0.4])
    q = np.outer(np.concatenate([[0.0], np.cumsum(times)]), [0.3, -0.2, 0.1, 0.5, 0.0, 0.4])
    law = fastest_law(rounded_line(q, times), LIMITS, at_rest=False)
    assert law.node_times == pytest.approx(law.line.nodes, abs=1e-12)
    assert law.acceleration_load.max() < 1e-6


@pytest.mark.parametrize("hard", [1.0, 0.05])
def test_the_law_is_nearly_as_fast_as_a_linear_program_finds_possible(hard):
    q, times = random_line(7, n=80)
    limits = JointLimits(LIMITS.speed, LIMITS.acceleration * hard)
    law = fastest_law(rounded_line(q, times), limits, at_rest=True)
    least = fastest_by_linear_program(law.place, law.line.slopes(law.place), limits)
    assert least <= law.time[-1] * (1.0 + 1e-3)
    assert law.time[-1] <= least * 1.1


def fastest_by_linear_program(place, slope, limits):
    """Return the time of the largest squared paces that keep the limits at all ends of pieces."""
    length = np.diff(place)
    bend = np.diff(slope, axis=0) / length[:, None]
    rows, columns, values = [], [], []
    row = 0
    for i, step in enumerate(length):
        for end in (0, 1):
            for joint in range(6):
                gain = slope[i + end, joint] / (2.0 * step)
                both = np.array([-gain, gain])
                both[end] += bend[i, joint]
                for sign in (1.0, -1.0):
                    rows += [row, row]
                    columns += [i, i + 1]
                    values += (sign * both / limits.acceleration[joint]).tolist()
                    row += 1
    most = 1.0 / np.maximum(np.abs(slope) / limits.speed, 1.0).max(axis=1) ** 2
    most[[0, -1]] = 0.0
    weight = np.append(length, 0.0) + np.insert(length, 0, 0.0)
    matrix = coo_matrix((values, (rows, columns))).tocsr()
    bounds = np.column_stack([np.zeros(len(place)), most])
    found = linprog(-weight, A_ub=matrix, b_ub=np.ones(row), bounds=bounds, method="highs")
    path_speed = np.sqrt(np.maximum(found.x, 0.0))
    return float((2.0 * length / (path_speed[:-1] + path_speed[1:])).sum())


def test_the_same_line_has_the_same_law_to_the_bit():
    q, times = random_line(3)
    first, second = (fastest_law(rounded_line(q, times), LIMITS, at_rest=True) for _ in range(2))
    assert first.time.tobytes() == second.time.tobytes()


@pytest.mark.parametrize("seed", [2, 8, 22, 33])
@pytest.mark.parametrize("creep", [1e-6, 1e-7, 1e-9])
def test_where_the_joints_all_but_stand_still_a_law_is_found_as_well(seed, creep):
    """A cylinder of the strangers: its joints rested while the contact slid along it."""
    speed = creep * np.random.default_rng(seed).normal(size=(40, 6))
    speed[20:] += np.array([0.02, 0.0, -0.01, 0.0, -0.05, -0.05])
    times = np.full(40, 0.00428)
    q = np.vstack([np.zeros(6), np.cumsum(speed * times[:, None], axis=0)])
    law = fastest_law(rounded_line(q, times), LIMITS, at_rest=False)
    assert max(sampled_loads(law, LIMITS)) <= 1.001
    assert law.time[-1] < 1.1 * times.sum()


def test_a_law_beyond_a_limit_is_refused_with_the_joint():
    law = fastest_law(rounded_line(*random_line(5)), LIMITS, at_rest=True)
    hurried = TimeLaw(
        law.line, law.place, 1.1 * law.path_speed, law.speed_load, law.acceleration_load
    )
    with pytest.raises(UnsafeError, match=r"uses 1\d\d\.\d\d % of the acceleration of joint"):
        require_limits(hurried, LIMITS)
