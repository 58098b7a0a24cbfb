import json
from itertools import pairwise, permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from opl.files.resources import folder
from opl.geometry.coverage import uncovered
from opl.geometry.frames import rotation_angle
from opl.geometry.machined import load_faces
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.order import MOST_EXACT, least_tour, shortest_links
from opl.geometry.passes import Order, Passes, PassKind, lay_passes
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.scallop import row_pitch, scallop_pitch
from opl.geometry.trim import Trim
from tests.support.solids import ORIGINS, cylinder, lay, sphere, torus
from tests.support.surfaces import cylinder_patch, graph, plane_patch

X, Y, Z = np.eye(3)


def square(hole=None, size=0.04):
    """Return a plane patch of a square, with a round hole or not."""
    surface = plane_patch(size, size)
    if hole is None:
        return Face(surface)
    angles = np.linspace(0.0, 2.0 * np.pi, 361)[:-1]
    round_hole = 0.5 + hole / size * np.stack([np.cos(angles), np.sin(angles)], 1)
    border = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return Face(surface, trim=Trim((border, round_hole)))


def pass_ends(points):
    Ts = points.Ts_workpiece_cutter
    first = np.flatnonzero(np.diff(points.pass_index, prepend=-1))
    last = np.append(first[1:], len(points)) - 1
    return Ts[first][ORIGINS], Ts[last][ORIGINS]


# breaks of the curvature


def test_a_cutter_point_lies_where_flank_and_tip_of_the_v_part_meet():
    (face,) = load_faces(folder("workpieces") / "v_shape" / "surface.json")
    laid = lay(Patchwork((face,)), X, rows=1, largest_step=5e-3)
    arc_length = laid.points.arc_length
    for joint in (46.843e-3, 46.843e-3 + 2.0 * 1.132 * 61.774e-3):
        assert np.abs(arc_length - joint).min() < 1e-8
    # the middle of the tip is a knot too, but nothing changes there
    tip = arc_length[(arc_length > 46.842e-3) & (arc_length < 0.18)]
    steps = np.diff(tip)
    assert steps.min() > 0.95 * steps.max()


def test_steps_are_balanced_between_breaks():
    (face,) = load_faces(folder("workpieces") / "v_shape" / "surface.json")
    arc_length = lay(Patchwork((face,)), X, rows=1, largest_step=4e-3).points.arc_length
    flank = np.diff(arc_length[arc_length <= 46.8431e-3])
    assert flank.min() > 0.95 * flank.max()
    assert len(flank) == 12


def test_the_knots_of_an_exact_circle_are_no_breaks():
    laid = lay(cylinder(whole=True).surface, Z, rows=1, pitch=1.0, largest_step=1.0)
    steps = np.diff(laid.points.arc_length)
    assert steps.min() > 0.95 * steps.max()


def test_a_kink_inside_a_surface_gets_a_cutter_point():
    net = np.array([[[0.0, y, 0.0], [0.02, y, 0.01], [0.05, y, 0.0]] for y in (0.0, 0.03)])
    line = np.array([0.0, 0.0, 1.0, 1.0])
    roof = NurbsSurface(1, 1, line, np.array([0.0, 0.0, 0.4, 1.0, 1.0]), net, np.ones((2, 3)))
    laid = lay(roof, Y, rows=1, largest_step=1.0)
    assert len(laid.points) == 3
    np.testing.assert_allclose(laid.points.Ts_workpiece_cutter[1, [0, 2], 3], [0.02, 0.01])


# trimmed faces and faces that join


def test_a_pass_breaks_at_a_hole():
    laid = lay(Patchwork((square(hole=8e-3),)), Y, rows=1, pitch=1.0, largest_step=5e-3)
    assert laid.points.n_passes == 2
    starts, ends = pass_ends(laid.points)
    np.testing.assert_allclose(
        np.sort([*starts[:, 0], *ends[:, 0]]), [0, 0.012, 0.028, 0.04], atol=2e-6
    )
    beside = lay(Patchwork((square(hole=8e-3),)), Y, pitch=18e-3, margin=1e-3)
    assert beside.points.n_passes == 4


def test_the_border_of_a_round_face_ends_its_passes_where_it_should():
    angles = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    disc = Trim((0.5 + 0.5 * np.stack([np.cos(angles), np.sin(angles)], 1),))
    face = Face(plane_patch(0.04, 0.04), trim=disc)
    assert Patchwork((face,)).extent_along(Y) == pytest.approx((0.0, 0.04), abs=1e-6)
    laid = lay(Patchwork((face,)), Y, pitch=8e-3, margin=4e-3)
    for start, end in zip(*pass_ends(laid.points), strict=True):
        for point in (start, end):
            assert np.linalg.norm(point - [0.02, 0.02, 0.0]) == pytest.approx(0.02, abs=2e-6)


def faces_of_a_bent_sheet(gap=0.0, kink=0.0):
    """A flat face along +x, then a quarter of a cylinder, tangent at x = 0.04."""
    flat = plane_patch(0.04, 0.03)
    radius, lower = 0.03, np.pi / 2 - kink
    c, s = np.cos(lower - 1.0), np.sin(lower - 1.0)
    half = 0.5
    profile = [
        (np.cos(lower), np.sin(lower)),
        (np.cos(lower - half) / np.cos(half), np.sin(lower - half) / np.cos(half)),
        (c, s),
    ]
    shift = np.array([0.04 + gap - radius * profile[0][0], -radius * profile[0][1]])
    net = [
        [[shift[0] + radius * a, y, shift[1] + radius * b] for y in (0.0, 0.03)] for a, b in profile
    ]
    weights = np.outer([1.0, np.cos(half), 1.0], [1.0, 1.0])
    bend = NurbsSurface(2, 1, np.repeat([0.0, 1.0], 3), np.array([0.0, 0, 1, 1]), net, weights)
    return Patchwork((Face(bend), Face(flat)))


def test_tangent_faces_join_and_their_border_is_a_cutter_point():
    laid = lay(faces_of_a_bent_sheet(), Y, rows=1, pitch=1.0)
    assert laid.points.n_passes == 1
    Ts = laid.points.Ts_workpiece_cutter
    assert (np.diff(laid.points.arc_length) > 0.0).all()
    assert laid.points.arc_length[-1] == pytest.approx(0.04 + 0.03, abs=1e-8)
    assert np.abs(laid.points.arc_length - 0.03).min() < 1e-8 or (
        np.abs(laid.points.arc_length - 0.04).min() < 1e-8
    )
    assert rotation_angle(Ts[:-1], Ts[1:]).max() < 0.2


@pytest.mark.parametrize("change", [{"gap": 0.1e-3}, {"kink": 0.05}])
def test_faces_that_do_not_meet_or_are_not_tangent_are_passes_of_their_own(change):
    assert lay(faces_of_a_bent_sheet(**change), Y, rows=1, pitch=1.0).points.n_passes == 2


def test_the_faucet_is_ground_over_both_its_faces_in_one_pass():
    faces = load_faces(folder("workpieces") / "faucet" / "surface.json")
    laid = lay(Patchwork(faces), X, rows=3, pitch=4e-3)
    assert laid.points.n_passes == 3


def test_a_pass_round_a_periodic_surface_is_one_closed_curve_without_a_kink(tmp_path):
    # a fluted knob: its ring is a periodic cubic spline, given once round
    count = 16
    angles = 2.0 * np.pi * np.arange(count) / count
    radii = 20.0 + 1.5 * (np.arange(count) % 2)
    ring = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    content = {
        "degree_u": 3,
        "degree_v": 1,
        "knots_u": list(range(count + 1)),
        "knots_v": [0, 0, 1, 1],
        "periodic_u": True,
        "control_points_mm": [[[x, y, z] for z in (0.0, 30.0)] for x, y in ring.tolist()],
        "weights": np.ones((count, 2)).tolist(),
    }
    path = tmp_path / "knob.json"
    path.write_text(json.dumps(content))
    bow = 0.01e-3
    laid = lay(Patchwork(load_faces(path)), Z, pitch=9e-3, margin=3e-3, max_bow_height=bow)
    assert laid.points.n_passes == 3
    # the spline itself, wound on as far as its support reaches
    knots = np.arange(-3.0, count + 4.0)
    spline = BSpline(knots, 1e-3 * ring[np.arange(count + 3) % count], 3)
    dense = spline(np.linspace(0.0, count, 200_001))
    length = np.linalg.norm(np.diff(dense, axis=0), axis=1).sum()
    for index in range(3):
        here = laid.points.pass_index == index
        Ts = laid.points.Ts_workpiece_cutter[here]
        distance, _ = cKDTree(dense).query(Ts[:, :2, 3])
        assert distance.max() < 0.5e-6  # half of how dense it is
        np.testing.assert_allclose(Ts[0], Ts[-1], atol=1e-9)
        assert laid.points.arc_length[here][-1] == pytest.approx(length, rel=1e-6)
        assert rotation_angle(Ts[:-1], Ts[1:]).max() < 0.35
        chords = np.diff(Ts[:, :2, 3], axis=0)
        near = cKDTree(dense).query(Ts[:, :2, 3])[1]
        for start, chord, a, b in zip(Ts[:, :2, 3], chords, near, near[1:], strict=False):
            between = dense[min(a, b) : max(a, b)] if abs(a - b) < 100_000 else dense[:0]
            across = np.array([-chord[1], chord[0]]) / np.linalg.norm(chord)
            away = np.abs((between - start) @ across)
            assert away.max(initial=0.0) <= bow + 1e-9


# order, repeats, margins


def test_both_directions_grind_every_row_there_and_back():
    laid = lay(cylinder_patch(), Z, pitch=10e-3, order=Order.BOTH).points
    once = lay(cylinder_patch(), Z, pitch=10e-3).points
    assert laid.n_passes == 2 * once.n_passes
    first, second = (laid.Ts_workpiece_cutter[laid.pass_index == k] for k in (0, 1))
    np.testing.assert_array_equal(first, second[::-1])


def test_repeats_are_shifted_and_stay_inside_the_margins():
    surface = plane_patch(0.04, 0.03)
    laid = lay(surface, Y, pitch=10e-3, margin=4e-3, repeats=2, shift=5e-3).points
    rows = [round(1e3 * float(start[1]), 6) for start in pass_ends(laid)[0]]
    assert rows == [5.0, 15.0, 25.0, 10.0, 20.0]


def test_margins_at_the_ends_shorten_open_passes_and_not_closed_ones():
    laid = lay(plane_patch(0.04), Y, rows=1, end_margin=3e-3).points
    np.testing.assert_allclose([p[0][0] for p in pass_ends(laid)], [37e-3, 3e-3], atol=1e-9)
    assert laid.arc_length[0] == 0.0
    ring = lay(cylinder(whole=True).surface, Z, rows=1, end_margin=3e-3).points
    assert ring.arc_length[-1] == pytest.approx(2.0 * np.pi * 0.03, rel=1e-6)
    with pytest.raises(ValueError, match="margins of 20 mm leave nothing of its passes"):
        lay(plane_patch(0.04), Y, rows=1, end_margin=20e-3)


def test_the_shortest_order_is_shorter_where_a_hole_splits_the_rows():
    holed = Patchwork((square(hole=12e-3),))
    changes = {"pitch": 4e-3, "margin": 2e-3}
    ways = {}
    for order in (Order.ONE_WAY, Order.ZIGZAG, Order.SHORTEST):
        points = lay(holed, Y, order=order, **changes).points
        ways[order] = points.link_length
        assert len(np.unique(points.Ts_workpiece_cutter[ORIGINS].round(9), axis=0)) == len(points)
    assert ways[Order.SHORTEST] < 0.7 * ways[Order.ZIGZAG] < ways[Order.ONE_WAY]


def tour_cost(links, home, tour):
    """Return what a tour costs, from home to home."""
    starts = [2 * index + (step < 0) for index, step in tour]
    way = sum(links[a ^ 1, b] for a, b in pairwise(starts))
    return home[starts[0]] + way + home[starts[-1] ^ 1]


def every_tour(n):
    for order in permutations(range(n)):
        for signs in product((1, -1), repeat=n):
            yield list(zip(order, signs, strict=True))


@given(st.integers(1, 5), st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_the_cheapest_of_few_passes_is_the_best_of_all_orders_and_directions(n, seed):
    links, home = scattered(n, seed)
    found = least_tour(links, home)
    assert sorted(index for index, _ in found) == list(range(n))
    best = min(tour_cost(links, home, tour) for tour in every_tour(n))
    assert tour_cost(links, home, found) == pytest.approx(best, abs=1e-7)
    assert found[0][0] <= found[-1][0]  # the same way back costs the same


def scattered(n, seed):
    """Return what links cost between the ends of passes in the plane, and to a home."""
    rng = np.random.default_rng(seed)
    ends = rng.random((2 * n, 2))
    links = np.linalg.norm(ends[:, None] - ends, axis=-1)
    return links, np.linalg.norm(ends - rng.random(2), axis=-1)


def test_the_order_of_many_passes_is_no_worse_than_row_by_row_and_near_the_best():
    links, home = scattered(MOST_EXACT + 2, 3)
    found = tour_cost(links, home, least_tour(links, home))
    by_rows = [(index, 1 if index % 2 == 0 else -1) for index in range(MOST_EXACT + 2)]
    assert found < 0.7 * tour_cost(links, home, by_rows)
    # one pass fewer cannot cost more where distances keep the triangle inequality
    few = 2 * MOST_EXACT
    least = least_tour(links[:few, :few], home[:few])
    assert found > tour_cost(links, home, least) - 1e-9


def test_shortest_links_leave_no_shorter_way_between_passes():
    rng = np.random.default_rng(5)
    Ts = np.tile(np.eye(4), (4, 2, 1, 1))
    Ts[..., :3, 3] = rng.random((4, 2, 3))
    ends = Ts.reshape(8, 4, 4)[:, :3, 3]
    links = np.linalg.norm(ends[:, None] - ends, axis=-1)
    best = min(tour_cost(links, np.zeros(8), tour) for tour in every_tour(4))
    assert tour_cost(links, np.zeros(8), shortest_links(Ts)) == pytest.approx(best, abs=1e-7)


# lines of constant parameter


def test_lines_of_constant_parameter_follow_the_net():
    surface = torus().surface
    whole = Patchwork((Face(surface),))
    for kind, axis in ((PassKind.ALONG_U, 0), (PassKind.ALONG_V, 1)):
        plan = Passes(np.zeros(3), 4e-3, 0.02e-3, 5e-3, margin=1e-3, kind=kind)
        laid = lay_passes(whole, plan)
        Ts = laid.points.Ts_workpiece_cutter
        solid = torus()
        assert np.abs(solid.distance(Ts[ORIGINS])).max() < 1e-9
        np.testing.assert_allclose(Ts[:, :3, 2], solid.normal(Ts[ORIGINS]), atol=1e-8)
        for index in range(laid.points.n_passes):
            row = Ts[laid.points.pass_index == index]
            fixed = row[:, 2, 3] if axis == 0 else np.arctan2(row[:, 1, 3], row[:, 0, 3])
            np.testing.assert_allclose(fixed, fixed[0], atol=1e-9)
            chords = np.diff(row[ORIGINS], axis=0)
            assert (np.sum(chords * row[1:, :3, 0], axis=1) > 0.0).all()


def test_lines_of_constant_parameter_need_a_single_face():
    faces = load_faces(folder("workpieces") / "faucet" / "surface.json")
    plan = Passes(np.zeros(3), 4e-3, 0.02e-3, 5e-3, kind=PassKind.ALONG_U)
    with pytest.raises(ValueError, match="kind: along_u needs a single NURBS face"):
        lay_passes(Patchwork(faces), plan)


# pitch and coverage


@pytest.mark.parametrize("radius", [np.inf, 0.04, 0.3, -0.4])
def test_the_pitch_of_a_scallop_leaves_a_ridge_of_that_height(radius):
    wheel, height = 0.15, 0.02e-3
    curvature = 0.0 if np.isinf(radius) else 1.0 / radius
    pitch = float(scallop_pitch(np.array(curvature), height, wheel))
    # the ridge by bisection: the point above the middle that lies on both wheels
    if np.isinf(radius):
        centre = np.array([0.5 * pitch, wheel])
        foot, up = np.zeros(2), np.array([0.0, 1.0])
    else:
        angle = 0.5 * pitch / radius
        centre = (radius + wheel) * np.array([np.sin(angle), np.cos(angle)])
        foot, up = np.array([0.0, radius]), np.array([0.0, 1.0])
    low, high = 0.0, 1e-3
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = np.linalg.norm(foot + middle * up - centre) < wheel
        low, high = (low, middle) if inside else (middle, high)
    assert low == pytest.approx(height, rel=1e-6)


def test_a_hollow_that_the_wheel_fills_limits_no_pitch():
    assert np.isinf(scallop_pitch(np.array(-1.0 / 0.1), 0.02e-3, 0.15))
    inside = Patchwork((Face(cylinder(radius=0.05, length=0.02).surface, -1.0),))
    with pytest.raises(ValueError, match="nowhere rounder than the wheel"):
        row_pitch(inside, X + Y, 0.02e-3, 0.15)


def test_the_pitch_of_a_cylinder_is_that_of_its_straight_side():
    whole = Patchwork((Face(cylinder(length=0.1).surface),))
    expected = 2.0 * np.sqrt(2.0 * 0.15 * 0.02e-3 - 0.02e-3**2)
    assert row_pitch(whole, Z, 0.02e-3, 0.15) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("radius", [0.03, 0.2])
def test_rows_of_a_scallop_pitch_leave_no_higher_ridges_on_a_round_surface(radius):
    height, wheel = 0.03e-3, 0.15
    # rows along z on a cylinder, so that all of it can be seen in the plane of x and y
    whole = Patchwork((Face(cylinder_patch(radius, 1.0, 2.2)),))
    pitch = row_pitch(whole, X, height, wheel)
    laid = lay(whole, X, pitch=pitch)
    Ts = laid.points.Ts_workpiece_cutter
    centres = np.unique((Ts[:, :2, 3] + wheel * Ts[:, :2, 2]).round(9), axis=0)
    assert len(centres) == laid.points.n_passes > 5
    angles = np.arctan2(centres[:, 1], centres[:, 0])
    ridges = []
    for angle in np.linspace(angles.min(), angles.max(), 2000):
        # what stands along the normal until the first wheel is met
        up = np.array([np.cos(angle), np.sin(angle)])
        along, square = centres @ up, np.sum(centres**2, axis=1)
        reach = along**2 - square + wheel**2
        met = along[reach > 0.0] - np.sqrt(reach[reach > 0.0])
        ridges.append(met.min() - radius)
    assert max(ridges) <= height * 1.001
    assert max(ridges) > 0.85 * height
    assert min(ridges) > -1e-9


def test_coverage_counts_what_no_pass_comes_by():
    whole = Patchwork((Face(plane_patch(0.04, 0.04)),))
    plan = Passes(Y, 5e-3, 0.05e-3, 4e-3, rows=4)  # rows 12.5 .. 27.5: covers 10 to 30 of 40
    points = lay_passes(whole, plan).points
    samples = whole.area_samples(0.4e-3)
    assert samples.areas.sum() == pytest.approx(0.04**2)
    missed = uncovered(samples, points, 5e-3)
    y = samples.points[:, 1]
    np.testing.assert_array_equal(missed, (y < 10e-3) | (y > 30e-3))


def test_bending_at_cutter_points_is_that_of_the_solid():
    laid = lay(cylinder().surface, Z)
    np.testing.assert_allclose(laid.bending[:, 0, 0], 1.0 / 0.03, rtol=1e-9)
    np.testing.assert_allclose(laid.bending[:, 1, 1], 0.0, atol=1e-9)
    laid = lay(sphere().surface, Z)
    np.testing.assert_allclose(
        laid.bending, np.tile(np.eye(2) / 0.03, (len(laid.points), 1, 1)), atol=1e-7
    )


def test_frames_do_not_flip_at_inflections():
    i = np.arange(12)
    waves = graph(np.tile(4e-3 * np.sin(1.3 * i), (12, 1)))
    laid = lay(waves, X, rows=1, pitch=1.0)
    Ts = laid.points.Ts_workpiece_cutter
    assert (laid.bending[:, 0, 0] < 0.0).any() and (laid.bending[:, 0, 0] > 0.0).any()
    assert (Ts[:, 2, 2] > 0.0).all()
    assert rotation_angle(Ts[:-1], Ts[1:]).max() < 0.3
