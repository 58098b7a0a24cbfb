import numpy as np
import pytest

from opl.files.resources import folder
from opl.geometry.frames import inverse, rotation_angle
from opl.geometry.nurbs import DegenerateNormalError, NurbsSurface
from opl.geometry.passes import Order, Passes, lay_passes
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.toolpath import CutterPoints
from tests.support.surfaces import (
    cylinder_patch,
    graph,
    load_surface,
    plane_patch,
    sphere_patch,
)

X, Y, Z = np.eye(3)
ORIGINS = np.s_[:, :3, 3]
DEFAULTS = {
    "pitch": 5e-3,
    "margin": 2.5e-3,
    "rows": None,
    "max_bow_height": 0.05e-3,
    "largest_step": 4e-3,
}


def passes(surface, plane_normal, zigzag=False, reversed_normal=False, **changes):
    order = Order.ZIGZAG if zigzag else Order.ONE_WAY
    plan = Passes(plane_normal, order=order, **{**DEFAULTS, **changes})
    whole = Patchwork((Face(surface, -1.0 if reversed_normal else 1.0),))
    return lay_passes(whole, plan).points


def v_part():
    return load_surface(folder("workpieces") / "v_shape" / "surface.json")


def wavy(n=12, height=8e-3, seed=3):
    return graph(height * np.random.default_rng(seed).random((n, n)))


def hills(size=0.1):
    """Two hills on a plain, apart along y."""
    i, j = np.meshgrid(np.arange(20), np.arange(20), indexing="ij")
    squares = [(i - 9.5) ** 2 + (j - middle) ** 2 for middle in (4.5, 14.5)]
    return graph(0.02 * sum(np.exp(-square / 6.0) for square in squares), size)


def bow_height(curve, chord):
    """Return the largest distance of dense points (k, 3) from a chord (2, 3)."""
    direction = (chord[1] - chord[0]) / np.linalg.norm(chord[1] - chord[0])
    return np.linalg.norm(np.cross(curve - chord[0], direction), axis=1).max()


def assert_frames_are_sound(Ts):
    R = Ts[:, :3, :3]
    identity = np.broadcast_to(np.eye(3), R.shape)
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, identity, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)


def test_rows_of_the_v_part_lie_where_the_paper_has_them():
    points = passes(v_part(), X)
    assert points.n_passes == 5
    for row, x in enumerate((-10.0, -5.0, 0.0, 5.0, 10.0)):
        origins = points.Ts_workpiece_cutter[points.pass_index == row][ORIGINS]
        np.testing.assert_allclose(1e3 * origins[:, 0], x, atol=1e-6)


def test_the_v_part_is_travelled_towards_plus_y_with_the_frames_of_its_profile():
    points = passes(v_part(), X)
    Ts = points.Ts_workpiece_cutter
    assert_frames_are_sound(Ts)
    first = points.pass_index == 0
    assert (np.diff(Ts[first][:, 1, 3]) > 0.0).all()
    np.testing.assert_allclose(Ts[:, :3, 1], np.tile(-X, (len(Ts), 1)), atol=1e-12)
    turn = rotation_angle(Ts[first][:1], Ts[first][-1:])
    np.testing.assert_allclose(turn, 2.0 * 1.132, atol=1e-9)
    length = 2.0 * (46.843 + 1.132 * 61.774)
    for row in range(5):
        arc_length = points.arc_length[points.pass_index == row]
        assert arc_length[0] == 0.0
        assert 1e3 * arc_length[-1] == pytest.approx(length, abs=1e-6)


def test_neighbouring_frames_turn_no_more_than_the_curvature_says():
    points = passes(v_part(), X)
    Ts, one_pass = points.Ts_workpiece_cutter, np.diff(points.pass_index) == 0
    turns = rotation_angle(Ts[:-1], Ts[1:])[one_pass]
    steps = np.diff(points.arc_length)[one_pass]
    assert (turns <= steps / 61.774e-3 + 1e-9).all()


@pytest.mark.parametrize("radius", [0.004, 0.05, 0.6])
@pytest.mark.parametrize("max_bow_height", [0.002e-3, 0.05e-3, 0.3e-3])
def test_on_a_circle_the_number_of_steps_is_that_of_the_closed_form(radius, max_bow_height):
    turn = 1.8
    surface = cylinder_patch(radius, 0.3, 0.3 + turn)
    points = passes(surface, Z, rows=1, max_bow_height=max_bow_height, largest_step=10.0 * radius)
    chord = 2.0 * np.sqrt(2.0 * radius * max_bow_height - max_bow_height**2)
    n_exact = int(np.ceil(turn / (2.0 * np.arcsin(0.5 * chord / radius))))
    assert n_exact <= len(points) - 1 <= n_exact + 1
    chords = np.linalg.norm(np.diff(points.Ts_workpiece_cutter[ORIGINS], axis=0), axis=1)
    bows = radius - np.sqrt(radius**2 - 0.25 * chords**2)
    assert bows.max() <= max_bow_height
    np.testing.assert_allclose(points.arc_length[-1], radius * turn, rtol=1e-6)


def test_a_flat_part_takes_the_largest_step():
    surface = plane_patch(width=0.04, length=0.03)
    points = passes(surface, Y, pitch=10e-3, margin=5e-3, largest_step=4e-3)
    assert points.n_passes == 3
    np.testing.assert_allclose(points.arc_length[:11], np.arange(11) * 4e-3, atol=1e-9)
    for n in range(1, 30):  # no sliver of a step where rounding leaves one
        assert len(passes(surface, Y, rows=1, largest_step=0.04 / n)) == n + 1
    points = passes(surface, Y, rows=1, largest_step=1.0)
    np.testing.assert_allclose(points.arc_length, [0.0, 0.04], atol=1e-12)


def test_the_last_step_is_as_long_as_the_others():
    surface = plane_patch(width=0.041)
    steps = np.diff(passes(surface, Y, rows=1, largest_step=4e-3).arc_length)
    assert len(steps) == 11
    assert steps.min() > 0.95 * steps.max()
    surface = cylinder_patch(0.05)
    steps = np.diff(passes(surface, Z, rows=1, largest_step=1.0).arc_length)
    assert steps.min() > 0.95 * steps.max()


@pytest.mark.parametrize(("max_bow_height", "largest_step"), [(0.05e-3, 50e-3), (0.2e-3, 6e-3)])
def test_the_bow_height_is_kept_and_used_on_a_wavy_surface(max_bow_height, largest_step):
    surface = wavy()
    points = passes(
        surface,
        X,
        pitch=20e-3,
        margin=5e-3,
        max_bow_height=max_bow_height,
        largest_step=largest_step,
    )
    assert points.n_passes == 5
    used = []
    for row in range(5):
        Ts = points.Ts_workpiece_cutter[points.pass_index == row]
        for chord in zip(Ts[:-1, :3, 3], Ts[1:, :3, 3], strict=True):
            # x = 0.1 u and y = 0.1 v, so the exact curve is known without any section
            (x, y0, _), (_, y1, _) = chord
            v = np.linspace(y0, y1, 500) / 0.1
            uv = np.stack([np.full_like(v, x / 0.1), v], axis=1)
            curve = surface.point(np.clip(uv, 0.0, 1.0))
            length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
            assert length <= largest_step * (1.0 + 1e-6)
            bow = bow_height(curve, np.array(chord))
            assert bow <= max_bow_height
            used.append(max(bow / max_bow_height, (length / largest_step) ** 2))
    assert np.mean(used) > 0.8


def test_points_lie_on_surface_and_plane_and_normals_are_exact_on_an_oblique_circle():
    radius = 0.05
    normal = np.array([0.3, -0.5, 1.0])
    normal /= np.linalg.norm(normal)
    points = passes(sphere_patch(radius), normal, pitch=7e-3, margin=10e-3)
    Ts = points.Ts_workpiece_cutter
    assert_frames_are_sound(Ts)
    np.testing.assert_allclose(np.linalg.norm(Ts[ORIGINS], axis=1), radius, atol=1e-9)
    np.testing.assert_allclose(Ts[:, :3, 2], Ts[ORIGINS] / radius, atol=1e-9)
    offsets = Ts[ORIGINS] @ normal
    for row in range(points.n_passes):
        here = points.pass_index == row
        np.testing.assert_allclose(offsets[here], offsets[here][0], atol=2e-9)
        # the section is a circle, and the arc length is its angle times its radius
        spokes = Ts[here][ORIGINS] - offsets[here][0] * normal
        circle = np.linalg.norm(spokes[0])
        steps = 2.0 * np.arcsin(0.5 * np.linalg.norm(np.diff(spokes, axis=0), axis=1) / circle)
        np.testing.assert_allclose(
            points.arc_length[here], circle * np.append(0.0, np.cumsum(steps)), atol=1e-7
        )
        tangents = np.cross(Ts[here][:, :3, 2], normal)
        assert (np.sum(np.diff(spokes, axis=0) * tangents[1:], axis=1) > 0.0).all()


def test_rows_are_centred_even_where_the_extreme_lies_inside_the_surface():
    # the outermost point of the arc from 0.3 to 2.1 rad along y is its crown at y = 0.05
    radius = 0.05
    points = passes(cylinder_patch(radius), Y, pitch=3e-3, margin=2e-3, rows=3)
    lowest = radius * min(np.sin(0.3), np.sin(2.1))
    middle = 0.5 * (lowest + radius)
    levels = np.unique(np.round(points.Ts_workpiece_cutter[:, 1, 3], 8))
    np.testing.assert_allclose(levels, middle + np.array([-3e-3, 0.0, 3e-3]), atol=1e-8)


def test_as_many_rows_as_fit_reach_from_margin_to_margin():
    points = passes(v_part(), X, margin=0.0)
    x = 1e3 * np.unique(np.round(points.Ts_workpiece_cutter[:, 0, 3], 9))
    np.testing.assert_allclose(x, [-12.5, -7.5, -2.5, 2.5, 7.5, 12.5], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": 6}, "rows: 6 rows of pitch 5 mm do not fit; .* 25 mm there is room for 5"),
        ({"rows": 0}, "rows: 0 rows"),
        ({"margin": 13e-3}, "rows: a row .* room for 0"),
        ({"pitch": 0.0}, "pitch: must be positive, got 0"),
        ({"max_bow_height": -1.0}, "max_bow_height: must be positive, got -1"),
        ({"largest_step": np.nan}, "largest_step: must be positive, got nan"),
        ({"plane_normal": np.zeros(3)}, "plane_normal: must not be zero"),
    ],
)
def test_what_cannot_be_laid_out_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        passes(v_part(), **{"plane_normal": X, **changes})


def test_zigzag_turns_every_second_row_round_but_not_its_frames():
    one_way, zigzag = passes(v_part(), X), passes(v_part(), X, zigzag=True)
    np.testing.assert_array_equal(one_way.pass_index, zigzag.pass_index)
    for row in range(5):
        here = one_way.pass_index == row
        order = np.s_[::-1] if row % 2 else np.s_[:]
        np.testing.assert_array_equal(
            zigzag.Ts_workpiece_cutter[here], one_way.Ts_workpiece_cutter[here][order]
        )
        arc_length = zigzag.arc_length[here]
        assert arc_length[0] == 0.0
        assert (np.diff(arc_length) > 0.0).all()
        np.testing.assert_allclose(
            np.diff(arc_length), np.diff(one_way.arc_length[here])[order], atol=1e-12
        )


def test_a_reversed_normal_turns_the_frames_about_y_and_the_travel_round():
    outward, inward = passes(v_part(), X), passes(v_part(), X, reversed_normal=True)
    here = outward.pass_index == 0
    first, last = inward.Ts_workpiece_cutter[here][[0, -1]]
    half_turn = np.diag([-1.0, 1.0, -1.0, 1.0])
    np.testing.assert_allclose(first, outward.Ts_workpiece_cutter[here][-1] @ half_turn, atol=1e-12)
    np.testing.assert_allclose(last, outward.Ts_workpiece_cutter[here][0] @ half_turn, atol=1e-12)


def test_the_direction_of_the_planes_normal_matters_and_its_length_does_not():
    once, thrice = passes(v_part(), X), passes(v_part(), 3.0 * X)
    np.testing.assert_array_equal(once.Ts_workpiece_cutter, thrice.Ts_workpiece_cutter)
    other = passes(v_part(), -X)
    np.testing.assert_allclose(other.Ts_workpiece_cutter[0, :3, 1], X, atol=1e-12)
    assert other.Ts_workpiece_cutter[0, 0, 3] == pytest.approx(10e-3)


def test_every_curve_of_a_plane_is_a_pass_of_its_own_closed_ones_too():
    # at half their height each of the two hills has a round contour
    points = passes(hills(), Z, rows=1, pitch=1e-3, margin=0.0, largest_step=2e-3)
    assert points.n_passes == 2
    Ts = points.Ts_workpiece_cutter
    assert_frames_are_sound(Ts)
    np.testing.assert_allclose(Ts[:, 2, 3], Ts[0, 2, 3], atol=2e-9)
    for index in range(2):
        origins = Ts[points.pass_index == index][ORIGINS]
        np.testing.assert_allclose(origins[0], origins[-1], atol=1e-9)
        # outward normal cross plane normal: seen from above, clockwise round the hill
        spokes = origins - origins[:-1].mean(axis=0)
        assert (np.cross(spokes[:-1], spokes[1:])[:, 2] < 0.0).all()


def test_zigzag_travels_all_the_curves_of_a_row_backwards():
    vault = cylinder_patch(0.05, 0.3, 2.8)  # a plane below its crown cuts it twice
    one_way, zigzag = (
        passes(vault, Y, pitch=5e-3, margin=15e-3, rows=2, zigzag=zigzag)
        for zigzag in (False, True)
    )
    assert one_way.n_passes == zigzag.n_passes == 4
    second_row = one_way.pass_index >= 2
    np.testing.assert_array_equal(
        zigzag.Ts_workpiece_cutter[second_row], one_way.Ts_workpiece_cutter[second_row][::-1]
    )


def test_a_pass_through_a_pole_keeps_the_normals_of_the_sphere():
    cap = sphere_patch(0.05, longitude=(0.0, 2.0), latitude=(0.2, np.pi / 2))
    bisector = np.array([-np.sin(1.0), np.cos(1.0), 0.0])
    Ts = passes(cap, bisector, rows=1).Ts_workpiece_cutter
    np.testing.assert_allclose(Ts[:, :3, 2], Ts[ORIGINS] / 0.05, atol=1e-5)
    assert np.linalg.norm(Ts[ORIGINS] - 0.05 * Z, axis=1).min() < 1e-5
    assert passes(cap, Z, rows=3).n_passes == 3


def test_a_pass_through_a_cusp_is_refused_and_the_place_named():
    # both control points of the middle row coincide with their neighbours: du vanishes there
    net = np.array(
        [[[0.0, y, 0.0], [0.02, y, 0.01], [0.02, y, 0.01], [0.03, y, 0.0]] for y in (0.0, 0.03)]
    )
    knots = np.array([0.0, 0.0, 0.4, 0.6, 1.0, 1.0])
    line = np.array([0.0, 0.0, 1.0, 1.0])
    cusp = NurbsSurface(1, 1, line, knots, net, np.ones((2, 4)))
    with pytest.raises(DegenerateNormalError, match=r"no normal at \(u, v\) = \(.*, 0\.4\)"):
        passes(cusp, Y, rows=1)


def test_a_plane_that_only_touches_the_surface_is_refused():
    with pytest.raises(ValueError, match=r"touches the surface|does not cut"):
        passes(plane_patch(), Z, rows=1, margin=0.0)


def test_cutter_points_are_read_only_copies():
    Ts = np.tile(np.eye(4), (3, 1, 1))
    points = CutterPoints(Ts, [0, 0, 1], [0.0, 1.0, 0.0])
    Ts[:] = 7.0
    assert len(points) == 3
    assert points.n_passes == 2
    np.testing.assert_allclose(inverse(points.Ts_workpiece_cutter), np.tile(np.eye(4), (3, 1, 1)))
    with pytest.raises(ValueError, match="read-only"):
        points.arc_length[0] = 1.0


@pytest.mark.parametrize("pass_index", [[1, 1, 2], [0, 2, 2], [0, 1, 0]])
def test_cutter_points_refuse_passes_that_do_not_count_up(pass_index):
    with pytest.raises(ValueError, match="pass_index: must count up from 0"):
        CutterPoints(np.tile(np.eye(4), (3, 1, 1)), pass_index, np.zeros(3))


def test_cutter_points_refuse_arrays_of_different_length():
    with pytest.raises(ValueError, match="shapes must be"):
        CutterPoints(np.tile(np.eye(4), (3, 1, 1)), [0, 0], np.zeros(3))


def test_a_folded_surface_is_refused_and_the_place_named():
    net = np.array(
        [
            [[0.0, y, z], [0.06, y, z], [-0.03, y, 2 * z], [0.03, y, z]]
            for y, z in ((0.0, 0.0), (0.03, 0.01))
        ]
    ).transpose(1, 0, 2)
    knots = np.repeat([0.0, 1.0], [4, 4])
    folded = NurbsSurface(3, 1, knots, np.array([0.0, 0.0, 1.0, 1.0]), net, np.ones((4, 2)))
    with pytest.raises(ValueError, match=r"cannot be followed near \(|no normal at"):
        passes(folded, Y, rows=1)


def test_a_pass_round_a_closed_cylinder_ends_where_it_began():
    weights = np.array([1.0, np.sqrt(0.5)] * 4 + [1.0])
    angles = 0.25 * np.pi * np.arange(9)
    circle = 0.03 * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], 1) / weights[:, None]
    knots = np.array([0.0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4])
    surface = NurbsSurface(
        2,
        1,
        knots,
        np.array([0.0, 0.0, 1.0, 1.0]),
        np.stack([circle, circle + 0.05 * Z], axis=1),
        np.stack([weights, weights], axis=1),
    )
    points = passes(surface, Z, pitch=20e-3, margin=5e-3)
    assert points.n_passes == 3
    for row in range(3):
        here = points.pass_index == row
        first, last = points.Ts_workpiece_cutter[here][[0, -1]]
        np.testing.assert_allclose(first, last, atol=1e-9)
        assert points.arc_length[here][-1] == pytest.approx(2.0 * np.pi * 0.03, abs=1e-9)
