"""How far a chord is outside of a box: that bends only where a joint comes to the box."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from opl.search.outside import BISECTIONS, nearest_on_chord

# many on one another: joints at a bound of the box, or that do not turn
angle = st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]) | st.floats(-2.0, 2.0)
joints = arrays(float, 6, elements=angle)


def away(q, low, high):
    """Return how far a configuration is outside of a box, all joints added up."""
    return float((np.maximum(q - high, 0.0) + np.maximum(low - q, 0.0)).sum())


def least_away(a, b, low, high):
    """Return the least along a chord: at an end, or where some joint enters or leaves the box."""
    with np.errstate(divide="ignore", invalid="ignore"):
        bends = np.concatenate([(low - a) / (b - a), (high - a) / (b - a)])
    places = [0.0, 1.0, *bends[(bends > 0.0) & (bends < 1.0)]]
    return min(away(a + x * (b - a), low, high) for x in places)


@given(joints, joints, joints, joints)
def test_it_is_nearest_where_it_bends_or_ends(a, b, one, other):
    low, high = np.minimum(one, other), np.maximum(one, other)
    found, place = nearest_on_chord(a, b, low, high, np.inf)
    near = 1e-12 + 2.0**-BISECTIONS * np.abs(b - a).sum()
    least = least_away(a, b, low, high)
    assert least - 1e-12 <= found <= least + near
    assert 0.0 <= place <= 1.0
    assert abs(away(a + place * (b - a), low, high) - found) < 1e-12
    # what is no nearer than something else is not told of
    assert nearest_on_chord(a, b, low, high, 0.9 * least) == (0.9 * least, -1.0)
