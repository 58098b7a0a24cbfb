import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.errors import UnsafeError
from opl.program.pulses import PulseScale
from tests.support.program_samples import HOME, JOINT_NAMES, SCALE

SHARES = st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6)


@given(SHARES)
def test_angles_come_back_within_half_a_pulse(shares):
    q = SCALE.lower + np.array(shares) * (SCALE.upper - SCALE.lower)
    error = (SCALE.to_angles(SCALE.to_pulses(q)) - q) * SCALE.pulses_per_radian
    assert np.abs(error).max() <= 0.5 + 1e-6


def test_pulses_are_the_nearest_and_not_cut_off():
    q = np.array([[0.6, -0.6, 0.4, -0.4, 0.0, 1.5001]]) / SCALE.pulses_per_radian
    assert SCALE.to_pulses(q).tolist() == [[1, -1, 0, 0, 0, 2]]


def test_known_readings():
    assert SCALE.to_pulses(HOME).tolist() == [0, -38000, 16000, 0, -58800, 0]


@pytest.mark.parametrize("joint", range(6))
def test_the_limits_themselves_are_allowed_and_a_pulse_beyond_is_not(joint):
    for limit, sign in ((SCALE.lower, -1.0), (SCALE.upper, 1.0)):
        q = HOME.copy()
        q[joint] = limit[joint]
        SCALE.to_pulses(q)
        q[joint] += sign * 1.1 / SCALE.pulses_per_radian[joint]
        with pytest.raises(UnsafeError, match=f"joint {JOINT_NAMES[joint]} at .* soft limits"):
            SCALE.to_pulses(q)


def test_error_names_configuration_angle_and_limits():
    q = np.array([HOME, HOME])
    q[1, 1] = np.deg2rad(160.0)
    message = "configuration 1: joint L at 160.000 deg is 304000 pulses, .* -199500 and 294500"
    with pytest.raises(UnsafeError, match=message):
        SCALE.to_pulses(q)


def test_a_configuration_that_is_no_number_is_refused():
    with pytest.raises(UnsafeError, match="not a number"):
        SCALE.to_pulses(np.full(6, np.nan))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pulses_per_radian": np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0])}, "must be positive"),
        ({"pulses_per_radian": np.ones(5)}, "has shape"),
        ({"unverified": ("S", "Z")}, r"no such joints: \['Z'\]"),
    ],
)
def test_nonsense_scales_are_refused(change, message):
    values = {
        "joint_names": JOINT_NAMES,
        "pulses_per_radian": np.ones(6),
        "lower": -np.ones(6),
        "upper": np.ones(6),
    }
    with pytest.raises(ValueError, match=message):
        PulseScale(**{**values, **change})


def test_scale_keeps_its_own_read_only_copy():
    lower = -np.ones(6)
    scale = PulseScale(JOINT_NAMES, np.ones(6), lower, np.ones(6))
    lower[0] = -9.0
    assert scale.lower[0] == -1.0
    assert not scale.upper.flags.writeable
