"""Contact frame 0 from touched points: found again, with its residuals, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from opl.geometry.frames import pose, rotation_angle, transform
from opl.geometry.touched import KINDS, TouchedError, fit_touched

WIDTH, RADIUS = 0.05, 0.15
ALLOWED = 5e-4
THREE = {"left_edge": 1, "right_edge": 1, "axle": 1}
SIDE_AND_RIM = {"left_side": 3, "rim": 4, "front": 1}
MANY = {"left_edge": 2, "right_edge": 2, "axle": 2, "rim": 6, "left_side": 4, "right_side": 4}


def pose_of(random):
    R = Rotation.random(random_state=int(random.integers(2**31))).as_matrix()
    return pose(R, random.uniform(-1.5, 1.5, 3))


def place(kind, x, angle, share):
    """Return a point of a kind in contact frame 0, written out apart from the equations.

    Args:
        kind: What is touched.
        x: Where across the width, -1 to 1.
        angle: Where around the axle in [rad], 0 in front.
        share: How far from the axle on a side, 0 to 1.
    """
    h = WIDTH / 2.0

    def around(r):
        return r * np.sin(angle), RADIUS - r * np.cos(angle)

    return np.array(
        {
            "left_edge": (h, 0.0, 0.0),
            "right_edge": (-h, 0.0, 0.0),
            "front": (x * h, 0.0, 0.0),
            "axle": (3.0 * x * h, 0.0, RADIUS),
            "rim": (x * h, *around(RADIUS)),
            "left_side": (h, *around(share * RADIUS)),
            "right_side": (-h, *around(share * RADIUS)),
        }[kind]
    )


def touch(T_base_contact0, counts, random, error=0.0):
    """Return points as a careful person touches them: spread out, each off by up to an error."""
    points = {}
    for kind, count in counts.items():
        angles = np.linspace(-1.9, 1.9, count) + random.uniform(-0.1, 0.1, count)
        across = np.linspace(-0.8, 0.8, count)
        random.shuffle(across)
        found = []
        for x, angle in zip(across, angles, strict=True):
            p = transform(T_base_contact0, place(kind, x, angle, random.uniform(0.6, 0.95)))
            off = random.normal(size=3)
            found.append(p + error * random.uniform() * off / np.linalg.norm(off))
        points[kind] = found
    return points


def moved(one, other):
    """Return how far the origin moved in [m] and the frame turned in [rad]."""
    return np.linalg.norm(one[:3, 3] - other[:3, 3]), float(rotation_angle(one, other))


@pytest.mark.parametrize("counts", [THREE, SIDE_AND_RIM, MANY])
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_exact_points_give_the_frame_back(counts, seed):
    random = np.random.default_rng(seed)
    T = pose_of(random)
    fit = fit_touched(touch(T, counts, random), WIDTH, RADIUS, ALLOWED)
    assert moved(fit.T_base_contact0, T) < (1e-8, 1e-7)
    assert fit.residuals.max() < 1e-8
    assert len(fit.residuals) == len(fit.labels) == sum(counts.values())


@pytest.mark.parametrize("counts", [THREE, MANY])
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**31), error=st.floats(0.0, 2e-4))
def test_errors_of_touching_move_the_frame_no_more_than_stated(counts, seed, error):
    random = np.random.default_rng(seed)
    T = pose_of(random)
    fit = fit_touched(touch(T, counts, random, error), WIDTH, RADIUS, ALLOWED)
    origin, turn = moved(fit.T_base_contact0, T)
    # each equation is off by the error at most, so all of them together by its root
    most = error * np.sqrt(fit.spare + 6)
    assert origin <= 1.05 * fit.origin_per_error * most + 1e-9
    assert turn <= 1.05 * fit.turn_per_error * most + 1e-9
    assert fit.residuals.max() <= most + 1e-9


def test_more_points_fix_the_frame_better():
    random = np.random.default_rng(0)
    T = pose_of(random)
    few, many = (
        fit_touched(touch(T, counts, random), WIDTH, RADIUS, ALLOWED) for counts in (THREE, MANY)
    )
    assert many.turn_per_error < few.turn_per_error / 4.0
    assert (few.spare, many.spare) == (2, 24)


def test_residuals_are_those_of_a_wheel_with_another_width():
    # the edges are 2 h apart, told to be 0.4 mm more: each is off by half of the difference
    T = pose_of(np.random.default_rng(1))
    points = touch(T, THREE, np.random.default_rng(1))
    fit = fit_touched(points, WIDTH + 4e-4, RADIUS, ALLOWED)
    assert fit.labels == ("left_edge 1", "right_edge 1", "axle 1")
    np.testing.assert_allclose(fit.residuals, [2e-4, 2e-4, 0.0], atol=1e-9)
    assert moved(fit.T_base_contact0, T) < (1e-8, 1e-7)


@pytest.mark.parametrize(
    ("counts", "told"),
    [
        ({}, "0 equations from 0 points, 6 are needed"),
        ({"rim": 5}, "5 equations from 5 points"),
        ({"rim": 4, "front": 1}, "turned about z|moved along x"),
        ({"left_edge": 1, "right_edge": 1}, "turned about x"),
        ({"left_edge": 1, "right_edge": 1, "rim": 1}, "two places of the wheel"),
        ({"rim": 4, "left_side": 3}, "turned about x"),
    ],
)
def test_points_that_leave_something_open_are_refused(counts, told):
    random = np.random.default_rng(2)
    with pytest.raises(TouchedError, match=told):
        fit_touched(touch(pose_of(random), counts, random), WIDTH, RADIUS, ALLOWED)


def test_collinear_points_are_refused():
    line = np.array([0.2, -0.1, 0.4])
    points = {
        "left_edge": [0.025 * line / np.linalg.norm(line)],
        "right_edge": [-0.025 * line / np.linalg.norm(line)],
        "axle": [0.15 * line / np.linalg.norm(line)],
    }
    with pytest.raises(TouchedError, match=r"mm from where the other points put it|leave open"):
        fit_touched(points, WIDTH, RADIUS, ALLOWED)


@pytest.mark.parametrize("kind", KINDS)
def test_a_point_that_is_off_is_refused_with_the_amount(kind):
    random = np.random.default_rng(3)
    T = pose_of(random)
    points = touch(T, {**dict.fromkeys(KINDS, 2), "rim": 5, "left_side": 3}, random)
    away = [1.0, 0.0, 0.0] if kind.endswith("side") else [0.0, 0.6, 0.8]
    points[kind][1] = points[kind][1] + T[:3, :3] @ np.array(away) * 0.01
    with pytest.raises(TouchedError, match="mm allowed; residuals in mm: left_edge 1 ") as refused:
        fit_touched(points, WIDTH, RADIUS, ALLOWED)
    assert str(refused.value).startswith(f"{kind} 2 is ")


def test_a_point_beside_the_wheel_is_none_of_its_rim():
    random = np.random.default_rng(4)
    T = pose_of(random)
    points = touch(T, THREE, random)
    points["rim"] = [transform(T, np.array([0.03, 0.0, 0.0]))]  # on the cylinder, beyond the edge
    with pytest.raises(TouchedError, match=r"rim 1 is 5\.00 mm from"):
        fit_touched(points, WIDTH, RADIUS, ALLOWED)
