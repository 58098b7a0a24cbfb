"""Where moves pass cutter points: also beside the end of the flat, where sliding ends."""

import numpy as np
import pytest

from opl.geometry.frames import pose
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import LEVER, contact_positions, misfit
from opl.verification.passing import _passed

ALLOWED = 1e-4
WHEEL = ContactWheel(0.05, 0.15, np.deg2rad(45.0), np.eye(4))
POINTS = CutterPoints(np.eye(4)[None], np.zeros(1, dtype=np.int64), np.zeros(1))


def rolled(angle, x):
    c, s = np.cos(angle), np.sin(angle)
    return pose(np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), np.array([x, 0.0, 0.0]))


def off(T):
    t = contact_positions(WHEEL, T)
    distance, angle = misfit(WHEEL, T, t)
    return np.hypot(distance, LEVER * angle)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("start", "end"),
    [
        # beside the rim, and a little past it on the flat: it passes the edge on its way (a row of
        # the V with five times the points)
        ((0.001193, 0.025685), (-0.000921, 0.024879)),
        ((-0.000921, 0.024879), (0.001193, 0.025685)),
        # on the flat
        ((0.004, 0.0240), (-0.002, 0.0232)),
    ],
)
def test_a_point_is_looked_at_where_it_comes_nearest(side, start, end):
    poses = [rolled(side * angle, side * x) for angle, x in (start, end)]
    Ts = np.stack(poses)
    at = _passed(WHEEL, POINTS, Ts, np.array([0.0, 1.0]), np.array([0]), ALLOWED)
    share = np.linspace(0.0, 1.0, 401)
    angles, xs = (side * ((1.0 - share) * a + share * b) for a, b in zip(start, end, strict=True))
    whole = np.array([off(rolled(a, x)) for a, x in zip(angles, xs, strict=True)])
    best = float(share[whole.argmin()])
    assert len(at) == 1
    assert at[0] == pytest.approx(best, abs=0.02)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_next_to_the_largest_roll_a_point_is_looked_at_where_it_is_nearest_without_rolling(side):
    """A filleted box of the strangers: it was looked at beyond the largest roll alone."""
    (first, x0), (last, x1) = (0.7840, -0.02488), (0.7900, -0.02504)
    Ts = np.stack([rolled(side * first, side * x0), rolled(side * last, side * x1)])
    at = _passed(WHEEL, POINTS, Ts, np.array([0.0, 1.0]), np.array([0]), ALLOWED)
    share = np.linspace(0.0, 1.0, 401)
    angles, xs = first + share * (last - first), x0 + share * (x1 - x0)
    whole = np.array([off(rolled(side * a, side * x)) for a, x in zip(angles, xs, strict=True)])
    assert whole.min() < ALLOWED
    assert np.abs(at - share[whole.argmin()]).min() < 0.02
