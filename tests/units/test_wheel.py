"""The belt wheel: contact frames against the paper's table, distance against other geometry."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.geometry.frames import pose
from opl.geometry.wheel import ContactWheel

WIDTH, RADIUS, ROLL = 0.05, 0.15, np.radians(45.0)
T_BASE_CONTACT0 = pose(
    np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([0.89, 0.24, 0.32])
)
WHEEL = ContactWheel(WIDTH, RADIUS, ROLL, T_BASE_CONTACT0)

points = st.tuples(*[st.floats(-0.4, 0.4)] * 3).map(np.array)


def table_of_the_paper(t):
    """Return T_contact0_contact in mm and degrees as equations 6 to 13 print it."""
    w = 50.0
    T = np.eye(4)
    if t < -w / 2:
        d = np.radians(-(w / 2) - t)
        T[:3, :3] = [[np.cos(d), 0, -np.sin(d)], [0, 1, 0], [np.sin(d), 0, np.cos(d)]]
        T[0, 3] = w / 2
    elif t > w / 2:
        d = np.radians(t - w / 2)
        T[:3, :3] = [[np.cos(d), 0, np.sin(d)], [0, 1, 0], [-np.sin(d), 0, np.cos(d)]]
        T[0, 3] = -w / 2
    else:
        T[0, 3] = -t
    T[:3, 3] /= 1000.0
    return T


@pytest.mark.parametrize("t", [-70, -69.9, -40, -25.001, -25, -24.9, -3, 0, 8, 25, 25.1, 50, 70])
def test_the_contact_frame_is_that_of_the_papers_table(t):
    np.testing.assert_allclose(WHEEL.T_contact0_contact(t), table_of_the_paper(t), atol=1e-15)


@given(st.floats(-70.0, 70.0))
def test_the_contact_frame_is_a_proper_pose(t):
    T = WHEEL.T_contact0_contact(t)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-14)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_array_equal(T[3], [0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("end", [-25.0, 25.0])
def test_the_contact_frame_is_continuous_where_the_flat_ends(end):
    before, after = WHEEL.T_contact0_contact(np.array([end - 1e-9, end + 1e-9]))
    np.testing.assert_allclose(before, after, atol=1e-10)


@given(st.floats(-70.0, 70.0))
def test_the_contact_point_lies_on_the_rim_line(t):
    x, y, z = WHEEL.T_contact0_contact(t)[:3, 3]
    assert abs(x) <= WIDTH / 2
    assert (y, z) == (0.0, 0.0)
    assert WHEEL.signed_distance(np.array([x, y, z])) == pytest.approx(0.0, abs=1e-15)


@given(st.floats(25.0, 70.0), st.sampled_from([-1.0, 1.0]))
def test_a_rolled_flat_part_touches_only_the_edge(t, side):
    # a part's flat surface lies in the plane z = 0 of the contact frame, the part at z < 0
    T = WHEEL.T_contact0_contact(side * t)
    flat = np.stack(np.meshgrid(np.linspace(-0.1, 0.1, 21), np.linspace(-0.1, 0.1, 21)), -1)
    flat = np.concatenate([flat, np.zeros((21, 21, 1))], axis=-1).reshape(-1, 3)
    assert WHEEL.signed_distance(flat @ T[:3, :3].T + T[:3, 3]).min() > -1e-15


def test_contact_positions_run_evenly_from_end_to_end():
    t = WHEEL.positions(141)
    assert (t[0], t[-1]) == pytest.approx((-70.0, 70.0))
    np.testing.assert_allclose(np.diff(t), 1.0, atol=1e-12)
    assert WHEEL.flat_end == pytest.approx(25.0)


def test_stacks_and_single_positions_agree():
    t = np.array([[-60.0, 0.0], [25.0, 70.0]])
    Ts = WHEEL.T_base_contact(t)
    assert Ts.shape == (2, 2, 4, 4)
    for index in np.ndindex(2, 2):
        wanted = T_BASE_CONTACT0 @ table_of_the_paper(t[index])
        np.testing.assert_allclose(Ts[index], wanted, atol=1e-15)


def test_the_pose_is_a_read_only_copy():
    T = T_BASE_CONTACT0.copy()
    wheel = ContactWheel(WIDTH, RADIUS, ROLL, T)
    T[0, 3] = 99.0
    assert wheel.T_base_contact0[0, 3] == 0.89
    with pytest.raises(ValueError, match="read-only"):
        wheel.T_base_contact0[0, 3] = 1.0


# distance


def brute_force_distance(p):
    """Return the distance to the nearest of many points of the cylinder's surface."""
    angle = np.linspace(0.0, 2.0 * np.pi, 801)
    x = np.linspace(-WIDTH / 2, WIDTH / 2, 61)
    r = np.linspace(0.0, RADIUS, 151)
    y, z = np.cos(angle), RADIUS + RADIUS * np.sin(angle)
    side = np.stack(np.broadcast_arrays(x[:, None], RADIUS * y, z), -1).reshape(-1, 3)
    z = RADIUS + r[:, None] * np.sin(angle)
    ends = [
        np.stack(np.broadcast_arrays(end, r[:, None] * np.cos(angle), z), -1).reshape(-1, 3)
        for end in (-WIDTH / 2, WIDTH / 2)
    ]
    return np.linalg.norm(np.concatenate([side, *ends]) - p, axis=1).min()


def test_clearance_is_the_distance_to_the_nearest_point_of_the_surface():
    random = np.random.default_rng(0)
    for p in random.uniform([-0.06, -0.2, -0.05], [0.06, 0.2, 0.35], (40, 3)):
        assert abs(WHEEL.signed_distance(p)) == pytest.approx(brute_force_distance(p), abs=1e-3)


def test_clearance_agrees_with_a_fine_mesh():
    cylinder = trimesh.creation.cylinder(RADIUS, WIDTH, sections=512)
    # trimesh's axis is z: turn it to x, then shift the rim to the origin
    T = np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, RADIUS], [0, 0, 0, 1.0]])
    cylinder.apply_transform(T)
    p = np.random.default_rng(1).uniform([-0.06, -0.2, -0.05], [0.06, 0.2, 0.35], (150, 3))
    nearest, _, _ = trimesh.proximity.closest_point_naive(cylinder, p)
    sagitta = RADIUS * (1.0 - np.cos(np.pi / 512))
    distance = np.linalg.norm(nearest - p, axis=1)
    np.testing.assert_allclose(np.abs(WHEEL.signed_distance(p)), distance, atol=sagitta + 1e-9)


@given(points)
def test_the_sign_says_inside_or_outside(p):
    inside = abs(p[0]) < WIDTH / 2 and np.hypot(p[1], p[2] - RADIUS) < RADIUS
    distance = WHEEL.signed_distance(p)
    assert distance < 0.0 if inside else distance >= 0.0


@settings(max_examples=300)
@given(points, points)
def test_clearance_changes_no_faster_than_the_point_moves(p, other):
    difference = abs(WHEEL.signed_distance(p) - WHEEL.signed_distance(other))
    assert difference <= np.linalg.norm(p - other) * (1 + 1e-12) + 1e-15


@pytest.mark.parametrize(
    ("p", "wanted"),
    [
        ((0.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, -0.02), 0.02),
        ((0.0, 0.0, 0.002), -0.002),
        ((0.0, 0.0, 0.15), -0.025),  # the centre: the ends of a narrow wheel are nearest
        ((0.045, 0.0, 0.15), 0.02),
        ((0.028, 0.0, -0.004), 0.005),  # off the edge
    ],
)
def test_clearance_at_places_that_are_known(p, wanted):
    assert WHEEL.signed_distance(np.array(p)) == pytest.approx(wanted, abs=1e-15)
