import json

import numpy as np
import pytest
from geomdl.evaluators import SurfaceEvaluatorRational

from opl.errors import InputError
from opl.files.resources import folder
from opl.geometry.machined import load_faces
from opl.geometry.nurbs import DegenerateNormalError, NurbsSurface
from tests.support.surfaces import (
    cylinder_patch,
    graph,
    load_surface,
    parameters,
    plane_patch,
    principal_curvatures,
    profile_distance,
    random_surface,
    sphere_patch,
)

GOOD_FILE = {
    "degree_u": 1,
    "degree_v": 1,
    "knots_u": [0, 0, 1, 1],
    "knots_v": [0, 0, 1, 1],
    "control_points_mm": [[[0, 0, 0], [0, 20, 0]], [[10, 0, 0], [10, 20, 0]]],
    "weights": [[1, 1], [1, 1]],
}


def test_plane_has_its_position_its_normal_and_no_curvature():
    surface = plane_patch(width=0.04, length=0.03)
    uv = parameters(surface)
    expected = np.column_stack([uv * [0.04, 0.03], np.zeros(len(uv))])
    np.testing.assert_allclose(surface.point(uv), expected, atol=1e-12)
    np.testing.assert_allclose(surface.normal(uv), np.tile([0.0, 0.0, 1.0], (len(uv), 1)))
    np.testing.assert_allclose(principal_curvatures(surface, uv), 0.0, atol=1e-9)


def test_cylinder_is_round_across_and_straight_along_its_axis():
    radius = 0.05
    surface = cylinder_patch(radius)
    uv = parameters(surface)
    points = surface.point(uv)
    outward = points * [1.0, 1.0, 0.0] / radius
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(surface.normal(uv), outward, atol=1e-9)
    curvatures = principal_curvatures(surface, uv)
    np.testing.assert_allclose(curvatures * radius, np.tile([0.0, 1.0], (len(uv), 1)), atol=1e-9)


def test_sphere_is_equally_round_in_all_directions():
    radius = 0.05
    surface = sphere_patch(radius)
    uv = parameters(surface)
    outward = surface.point(uv) / radius
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(surface.normal(uv), outward, atol=1e-9)
    # the two roots of the same quadratic equation part by the square root of a rounding error
    curvatures = principal_curvatures(surface, uv)
    np.testing.assert_allclose(curvatures.mean(axis=1) * radius, 1.0, atol=1e-9)
    np.testing.assert_allclose(curvatures * radius, 1.0, atol=1e-6)


def test_a_hollow_has_negative_curvature():
    bowl = graph(np.array([[(i - 2.5) ** 2 + (j - 2.5) ** 2 for i in range(6)] for j in range(6)]))
    assert bowl.normal(np.array([0.5, 0.5]))[2] > 0.99
    assert (principal_curvatures(bowl, np.array([0.5, 0.5])) < 0.0).all()


def homogeneous(surface):
    """Return the control net of geomdl: weighted points and weights."""
    weights = surface.weights[..., None]
    return np.concatenate([surface.control_points * weights, weights], axis=-1)


def test_points_and_derivatives_agree_with_geomdl_on_a_thousand_random_rational_surfaces():
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(1000):
        surface = random_surface(rng)
        uv = rng.random(2)
        # the algorithm itself: building a geomdl surface costs more than asking it
        found = SurfaceEvaluatorRational().derivatives(
            {
                "degree": (surface.degree_u, surface.degree_v),
                "knotvector": (surface.knots_u.tolist(), surface.knots_v.tolist()),
                "control_points": tuple(homogeneous(surface).reshape(-1, 4).tolist()),
                "size": surface.weights.shape,
                "dimension": 3,
                "pdimension": 2,
                "rational": True,
                "precision": 18,
            },
            parpos=tuple(uv),
            deriv_order=2,
        )
        expected, derivatives = np.array(found), surface.derivatives(uv, 2)
        for k, m in [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]:
            scale = 1.0 + np.abs(expected[k, m]).max()
            worst = max(worst, np.abs(derivatives[k, m] - expected[k, m]).max() / scale)
    assert worst < 1e-10


def test_results_have_the_shape_of_the_parameters():
    surface = cylinder_patch()
    uv = np.full((2, 5, 2), 0.5)
    assert surface.point(uv).shape == (2, 5, 3)
    assert surface.derivatives(uv, 2).shape == (2, 5, 3, 3, 3)
    assert surface.normal(uv[0, 0]).shape == (3,)
    assert principal_curvatures(surface, uv).shape == (2, 5, 2)


def test_arrays_are_read_only_copies():
    net = np.array(plane_patch().control_points)
    surface = NurbsSurface(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net, np.ones((2, 2)))
    net[0, 0] = 7.0
    np.testing.assert_array_equal(surface.point(np.zeros(2)), 0.0)
    with pytest.raises(ValueError, match="read-only"):
        surface.control_points[0, 0] = 7.0


def test_there_is_no_point_outside_the_domain():
    surface = plane_patch()
    assert np.isnan(surface.point(np.array([1.1, 0.5]))).all()
    with pytest.raises(DegenerateNormalError):
        surface.normal(np.array([1.1, 0.5]))


def test_a_pole_has_no_normal_and_the_error_names_the_place():
    surface = sphere_patch(radius=0.05, latitude=(0.2, np.pi / 2))
    uv = np.array([[0.5, 0.5], [0.25, 1.0]])
    surface.normal(uv[:1])
    with pytest.raises(DegenerateNormalError, match=r"\(0\.25, 1\).*50\) mm") as caught:
        surface.normal(uv)
    np.testing.assert_array_equal(caught.value.uv, uv[1])
    np.testing.assert_allclose(caught.value.point, [0.0, 0.0, 0.05], atol=1e-12)
    with pytest.raises(DegenerateNormalError):
        principal_curvatures(surface, uv[1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"degree_u": 0}, "degree_u: must lie between 1 and 1"),
        ({"degree_v": 2}, "degree_v: must lie between 1 and 1"),
        ({"knots_u": [0, 0, 1]}, r"knots_u: must be 4 values .*, got 3"),
        ({"knots_v": [0, 1, 0, 1]}, "knots_v: must not decrease"),
        ({"knots_v": [0, 1, 1, 2]}, "knots_v: the domain from 1 to 1 is empty"),
        ({"knots_u": [0, 0, np.nan, 1]}, "knots_u: must be finite"),
        ({"weights": [[1, 1], [0, 1]]}, "weights: must be positive, got 0"),
        ({"weights": [[1, 1]]}, r"weights: must have the shape of the control net, \(2, 2\)"),
        ({"control_points": np.zeros((2, 2, 2))}, r"control_points: must have shape"),
    ],
)
def test_a_surface_refuses_what_makes_no_surface(change, message):
    attributes = {
        "degree_u": 1,
        "degree_v": 1,
        "knots_u": [0, 0, 1, 1],
        "knots_v": [0, 0, 1, 1],
        "control_points": plane_patch().control_points,
        "weights": np.ones((2, 2)),
    }
    with pytest.raises(ValueError, match=message):
        NurbsSurface(**{**attributes, **change})


def test_a_surface_that_tears_at_a_knot_is_refused():
    knots_u = [0, 0, 0, 0.5, 0.5, 0.5, 1, 1, 1]
    with pytest.raises(ValueError, match=r"knots_u: inner knots .* at most 2 times .*, got 0\.5"):
        NurbsSurface(2, 1, knots_u, [0, 0, 1, 1], np.zeros((6, 2, 3)), np.ones((6, 2)))


def test_a_file_in_millimetres_becomes_a_surface_in_metres(tmp_path):
    path = tmp_path / "surface.json"
    path.write_text(json.dumps(GOOD_FILE))
    surface = load_surface(path)
    np.testing.assert_allclose(surface.point(np.array([1.0, 1.0])), [0.01, 0.02, 0.0])
    np.testing.assert_allclose(surface.normal(np.array([0.5, 0.5])), [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"knots_u": None}, "knots_u: is missing"),
        ({"degree": 2}, "degree: unknown key"),
        ({"knots_u": [0, 0, "1", 1]}, r"knots_u\.2: .*'1'"),
        ({"knots_u": [0, 0, 1]}, r"knots_u: must be 4 values"),
        ({"weights": [[1, 1], [1]]}, r"weights: must be rows of one length, got \[2, 1\]"),
        ({"weights": [[1, 1], [1, -3]]}, "weights: must be positive, got -3"),
        (
            {"control_points_mm": [[[0, 0, 0], [0, 20]], [[10, 0, 0], [10, 20, 0]]]},
            r"control_points_mm\.0\.1: .* 3 ",
        ),
        (
            {"control_points_mm": [[[0, 0, 0]], [[10, 0, 0], [10, 20, 0]]]},
            r"control_points_mm: must be rows of one length, got \[1, 2\]",
        ),
        ({"control_points_mm": []}, "control_points_mm: .*at least 1"),
        ({"control_points_mm": [[], []]}, r"control_points_mm\.1: .*at least 1"),
    ],
)
def test_a_bad_file_is_refused_with_file_and_key(tmp_path, change, message):
    content = {key: value for key, value in {**GOOD_FILE, **change}.items() if value is not None}
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=message) as caught:
        load_surface(path)
    assert str(caught.value).startswith(str(path))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_surface(tmp_path / "none.json")


def test_a_periodic_surface_closes_smoothly(tmp_path):
    angles = 2.0 * np.pi * np.arange(8) / 8
    ring = [[[20 * np.cos(a), 20 * np.sin(a), z] for z in (0.0, 30.0)] for a in angles]
    content = {
        "degree_u": 3,
        "degree_v": 1,
        "knots_u": list(range(9)),
        "knots_v": [0, 0, 1, 1],
        "periodic_u": True,
        "control_points_mm": ring,
        "weights": np.ones((8, 2)).tolist(),
    }
    path = tmp_path / "ring.json"
    path.write_text(json.dumps(content))
    surface = load_surface(path)
    np.testing.assert_array_equal(surface.domain, [[0.0, 0.0], [8.0, 1.0]])
    start, end = (surface.derivatives(np.array([u, 0.5]), 2) for u in (0.0, 8.0))
    np.testing.assert_allclose(start, end, atol=1e-15)
    # turned by one control point it is the same surface
    first, second = surface.point(np.array([[0.3, 0.0], [1.3, 0.0]]))
    c = np.cos(np.pi / 4)
    np.testing.assert_allclose(
        [c * first[0] - c * first[1], c * first[0] + c * first[1]], second[:2], atol=1e-15
    )
    path.write_text(json.dumps({**content, "knots_u": list(range(12))}))
    with pytest.raises(InputError, match=r"knots_u: must be 9 values, one more .*periodic.*got 12"):
        load_surface(path)


def test_a_file_may_hold_several_faces_and_holes(tmp_path):
    path = tmp_path / "faces.json"
    loops = [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.4, 0.4], [0.6, 0.4], [0.5, 0.6]]]
    path.write_text(json.dumps({"faces": [GOOD_FILE, {**GOOD_FILE, "trim_loops": loops}]}))
    whole, holed = load_faces(path)
    assert whole.trim is None
    inside = holed.trim.contains(np.array([[0.1, 0.1], [0.5, 0.5], [1.1, 0.5]]))
    np.testing.assert_array_equal(inside, [True, False, False])
    bad = {**GOOD_FILE, "weights": [[1, 1], [1, -3]]}
    path.write_text(json.dumps({"faces": [GOOD_FILE, bad]}))
    with pytest.raises(InputError, match=r"faces\.1\.weights: must be positive, got -3"):
        load_faces(path)


def test_the_v_part_has_the_stated_profile():
    surface = load_surface(folder("workpieces") / "v_shape" / "surface.json")
    uv = parameters(surface, n=2000)
    points = 1e3 * surface.point(uv)
    np.testing.assert_allclose(profile_distance(points[:, 1:]), 0.0, atol=1e-9)
    np.testing.assert_allclose([points[:, 0].min(), points[:, 0].max()], [-12.5, 12.5])
    apex = surface.domain.mean(axis=0)
    np.testing.assert_allclose(1e3 * surface.point(apex), [0.0, -24.572, 96.5], atol=1e-9)
    np.testing.assert_allclose(surface.normal(apex), [0.0, 0.0, 1.0], atol=1e-9)
    curvatures = principal_curvatures(surface, apex - [0.0, 1.0])
    np.testing.assert_allclose(curvatures, [0.0, 1e3 / 61.774], atol=1e-9)


def test_the_v_part_bends_without_a_kink():
    surface = load_surface(folder("workpieces") / "v_shape" / "surface.json")
    joints = np.unique(surface.knots_v)[1:-1]
    before, after = (
        surface.normal(np.stack([np.zeros(len(joints)), joints + gap], axis=1))
        for gap in (-1e-9, 1e-9)
    )
    np.testing.assert_allclose(before, after, atol=1e-9)
