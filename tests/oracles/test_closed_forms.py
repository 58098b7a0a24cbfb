"""Closed forms: what a surface, a pass and its chords must be on plane, cylinder, sphere, ..."""

import numpy as np
import pytest

from opl.geometry.frames import rotation_angle
from opl.geometry.surface_grid import sample_grid
from tests.support.solids import ORIGINS, Closed, cone, cylinder, lay, plane, sphere, torus
from tests.support.surfaces import principal_curvatures

X, Y, Z = np.eye(3)
SOLIDS = [plane(), cylinder(), cone(), sphere(), torus()]
OBLIQUE = np.array([0.2, -0.4, 1.0])


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: solid.name)
def test_points_normals_and_curvatures_are_those_of_the_closed_form(solid: Closed):
    surface = solid.surface
    lower, upper = surface.domain
    inside = np.random.default_rng(1).uniform(0.02, 0.98, (500, 2))
    uv = lower + inside * (upper - lower)
    points = surface.point(uv)
    assert np.abs(solid.distance(points)).max() < 1e-12
    np.testing.assert_allclose(surface.normal(uv), solid.normal(points), atol=1e-9)
    expected = np.sort(solid.curvatures(points), axis=1)
    # where both are equal they part by the square root of a rounding error
    loose = 1e-6 if solid.name == "sphere" else 1e-9
    size = np.abs(expected).max() or 1.0
    np.testing.assert_allclose(
        principal_curvatures(surface, uv) / size, expected / size, atol=loose
    )


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: solid.name)
@pytest.mark.parametrize("direction", [X, OBLIQUE], ids=["x", "oblique"])
def test_passes_lie_on_the_solid_keep_the_chord_error_and_do_not_flip(solid, direction):
    if solid.name == "plane" and direction is not OBLIQUE:
        direction = Y
    bow = 0.03e-3
    laid = lay(
        solid.surface,
        direction,
        pitch=9e-3,
        margin=3e-3,
        max_bow_height=bow,
        largest_step=20e-3,
    )
    Ts, pass_index = laid.points.Ts_workpiece_cutter, laid.points.pass_index
    assert np.abs(solid.distance(Ts[ORIGINS])).max() < 1e-9
    np.testing.assert_allclose(Ts[:, :3, 2], solid.normal(Ts[ORIGINS]), atol=1e-8)
    np.testing.assert_allclose(np.linalg.det(Ts[:, :3, :3]), 1.0)
    one_pass = np.diff(pass_index) == 0
    turns = rotation_angle(Ts[:-1], Ts[1:])[one_pass]
    assert turns.max() < 0.5
    # the largest distance of chord and section, found densely: points of the chord are brought
    # onto the solid within the plane by Newton's method on the closed form
    starts, ends = Ts[:-1][one_pass][ORIGINS], Ts[1:][one_pass][ORIGINS]
    fraction = np.linspace(0.05, 0.95, 19)[:, None, None]
    on_chord = (1.0 - fraction) * starts + fraction * ends
    n = direction / np.linalg.norm(direction)
    feet = on_chord.copy()
    for _ in range(12):
        normal = solid.normal(feet)
        in_plane = normal - (normal @ n)[..., None] * n
        slope = np.sum(in_plane * normal, axis=-1, keepdims=True)
        feet -= in_plane * solid.distance(feet)[..., None] / slope
    assert np.abs(solid.distance(feet)).max() < 1e-9
    chord = (ends - starts) / np.linalg.norm(ends - starts, axis=-1, keepdims=True)
    away = np.linalg.norm(np.cross(feet - starts, chord), axis=-1)
    assert away.max() <= bow


def test_passes_round_a_closed_ring_are_one_pass_each_whatever_the_seam():
    ring = torus(whole=True)
    radius, tube = 0.04, 0.012
    laid = lay(ring.surface, Z, pitch=6e-3, margin=5e-3, rows=3, largest_step=5e-3)
    # above and below the middle, and in it: each an outer and an inner circle
    assert laid.points.n_passes == 6
    for index in range(6):
        Ts = laid.points.Ts_workpiece_cutter[laid.points.pass_index == index]
        np.testing.assert_allclose(Ts[0], Ts[-1], atol=1e-8)
        assert rotation_angle(Ts[:-1], Ts[1:]).max() < 0.5
        circle = np.linalg.norm(Ts[0, :2, 3])
        height = Ts[0, 2, 3]
        assert abs(abs(circle - radius) - np.sqrt(tube**2 - height**2)) < 1e-9
        length = laid.points.arc_length[laid.points.pass_index == index][-1]
        assert length == pytest.approx(2.0 * np.pi * circle, rel=1e-6)


def test_a_section_across_both_seams_of_a_ring_is_joined():
    ring = torus(whole=True)
    laid = lay(ring.surface, np.array([0.3, 1.0, 0.2]), rows=1, pitch=1.0, largest_step=5e-3)
    for index in range(laid.points.n_passes):
        Ts = laid.points.Ts_workpiece_cutter[laid.points.pass_index == index]
        np.testing.assert_allclose(Ts[0], Ts[-1], atol=1e-6)
    assert laid.points.n_passes == 2


def test_a_pass_over_both_poles_of_a_sphere_keeps_its_frames():
    ball = sphere(whole=True)
    laid = lay(ball.surface, Y, rows=1, pitch=1.0, largest_step=4e-3)
    Ts = laid.points.Ts_workpiece_cutter
    assert laid.points.n_passes == 1
    np.testing.assert_allclose(Ts[:, :3, 2], Ts[ORIGINS] / 0.03, atol=1e-6)
    np.testing.assert_allclose(np.abs(Ts[:, :3, 1]), np.tile(Y, (len(Ts), 1)), atol=1e-4)
    assert laid.points.arc_length[-1] == pytest.approx(2.0 * np.pi * 0.03, rel=1e-5)
    assert rotation_angle(Ts[:-1], Ts[1:]).max() < 0.2


@pytest.mark.parametrize("bow", [0.01e-3, 0.1e-3])
def test_on_a_whole_circle_the_count_is_within_one_of_the_exact_answer(bow):
    tube = cylinder(whole=True)
    laid = lay(tube.surface, Z, rows=1, pitch=1.0, max_bow_height=bow, largest_step=1.0)
    exact = int(np.ceil(np.pi / np.arccos(1.0 - bow / 0.03)))
    assert exact <= len(laid.points) - 1 <= exact + 1


def test_the_grid_of_a_surface_holds_its_knots():
    surface = torus(whole=True).surface
    grid = sample_grid(surface)
    assert np.isin(np.unique(surface.knots_u), grid.u).all()
