import numpy as np
import pytest

from opl.geometry.inspection import inspect
from opl.geometry.mesh_surface import MeshSurface
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.passes import Order, Passes, lay_passes
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.wheel import ContactWheel
from tests.support.solids import cylinder, tessellated
from tests.support.surfaces import cylinder_patch, plane_patch

X, Y, Z = np.eye(3)


def wheel(radius=0.15, roll=45.0):
    return ContactWheel(0.05, radius, np.deg2rad(roll), np.eye(4))


def found(surface, plane_normal, penetration=0.5e-3, on=None, above=0.0, **changes):
    plan = Passes(
        plane_normal, **{"pitch": 5e-3, "max_bow_height": 0.05e-3, "largest_step": 4e-3, **changes}
    )
    laid = lay_passes(surface, plan)
    heights = np.full(len(laid.points), above)
    looked_at = inspect(surface, plan, laid, on or wheel(), penetration, heights)
    return laid, {f.kind: f for f in looked_at.findings}


def hollow(radius, outward=-1.0, **shape):
    return Patchwork((Face(cylinder_patch(radius, **shape), outward),))


def test_a_round_part_that_is_covered_gives_no_warning():
    _, findings = found(Patchwork((Face(cylinder_patch(0.05)),)), Z, margin=2.5e-3)
    assert not findings


def test_a_hollow_along_the_path_names_points_radius_and_the_flat():
    laid, findings = found(hollow(0.06), Z, margin=2.5e-3)
    message = str(findings["hollow"])
    assert f"cutter points 0-{len(laid.points) - 1}" in message
    assert "radius 60.0 mm along the path" in message
    assert "flat of 50 mm, which would cut in 5.2 mm (0.5 mm allowed): where the" in message
    assert "where the hollow is that long, only an edge" in message
    _, findings = found(hollow(0.06), Z, margin=2.5e-3, on=wheel(roll=0.0))
    assert "where the hollow is that long, no wheel grinds it" in str(findings["hollow"])
    _, findings = found(hollow(0.06), Z, margin=2.5e-3, penetration=6e-3)
    assert not findings


@pytest.mark.parametrize(("radius", "warned"), [(0.10, True), (0.14, True), (0.16, False)])
def test_a_hollow_across_the_path_is_too_tight_only_if_tighter_than_the_wheel(radius, warned):
    # the planes hold the axis, so that the paths are straight and the hollow lies across
    surface = hollow(radius, first=1.2, last=1.8)
    _, findings = found(surface, X, pitch=8e-3, margin=4e-3)
    assert ("hollow" in findings) is warned
    if warned:
        message = findings["hollow"].message
        assert f"radius {1e3 * radius:.1f} mm across the path" in message
        assert "against a wheel of 150 mm: the wheel cannot enter" in message


def test_normals_that_jump_are_named():
    net = np.array([[[0.0, y, 0.0], [0.02, y, 0.02], [0.05, y, 0.0]] for y in (0.0, 0.03)])
    line = np.array([0.0, 0.0, 1.0, 1.0])
    roof = NurbsSurface(1, 1, line, np.array([0.0, 0.0, 0.4, 1.0, 1.0]), net, np.ones((2, 3)))
    _, findings = found(Patchwork((Face(roof, -1.0),)), Y, rows=1, largest_step=1.0)
    assert "deg within" in findings["normal jumps"].message


def test_short_segments_are_named():
    net = np.array(
        [
            [[x, y, z] for x, z in ((0.0, 0.0), (0.02, 0.0), (0.02001, 1e-6), (0.04, 0.0))]
            for y in (0.0, 0.03)
        ]
    )
    knots = np.array([0.0, 0.0, 0.3, 0.6, 1.0, 1.0])
    line = np.array([0.0, 0.0, 1.0, 1.0])
    rough = NurbsSurface(1, 1, line, knots, net, np.ones((2, 4)))
    _, findings = found(Patchwork((Face(rough),)), Y, rows=1)
    assert "less than the bow height" in findings["short segment"].message


def test_passes_that_lie_on_each_other_are_named_unless_the_job_asks_for_them():
    twice = Patchwork((Face(plane_patch()), Face(plane_patch(0.02))))
    laid, findings = found(twice, Y, pitch=8e-3, margin=4e-3)
    assert laid.points.n_passes == 6
    assert "pass 2 lies on pass 1, pass 4 lies on pass 3" in findings["duplicate"].message
    once = Patchwork((Face(plane_patch()),))
    for changes in ({}, {"order": Order.BOTH}, {"repeats": 2}):
        assert "duplicate" not in found(once, Y, **changes)[1]


def test_passes_that_only_cross_or_run_beside_each_other_are_no_duplicates():
    _, findings = found(Patchwork((Face(cylinder(whole=True).surface),)), X, margin=1e-3)
    assert "duplicate" not in findings


def test_the_points_that_warnings_name_are_known():
    plan = Passes(Z, 5e-3, 0.05e-3, 4e-3)
    surface = hollow(0.06)
    laid = lay_passes(surface, plan)
    looked_at = inspect(surface, plan, laid, wheel(), 0.5e-3, np.zeros(len(laid.points)))
    assert looked_at.doubtful.all()
    assert looked_at.uncovered_fraction == pytest.approx(
        looked_at.uncovered.areas.sum() / surface.area_samples(1e-3).areas.sum(), rel=1e-2, abs=1e-3
    )


def test_uncovered_area_is_told_in_percent():
    _, findings = found(Patchwork((Face(plane_patch(0.04, 0.04)),)), Y, rows=4)
    percent = float(findings["coverage"].message.split(" %")[0])
    assert percent == pytest.approx(50.0, abs=2.0)


def test_a_mesh_coarser_than_the_bow_height_is_told():
    coarse = MeshSurface(tessellated(cylinder().surface, 6, 4))
    _, findings = found(coarse, Z, margin=2.5e-3)
    assert "export a finer mesh" in findings["mesh"].message
    fine = MeshSurface(tessellated(cylinder().surface, 60, 20))
    assert "mesh" not in found(fine, Z, margin=2.5e-3)[1]


@pytest.mark.parametrize(
    ("above", "told"),
    [
        (0.09e-3, None),
        (-0.09e-3, None),
        (0.3e-3, "up to 0.3 mm above"),
        (-0.3e-3, "up to 0.3 mm below"),
        (-np.inf, "far below"),
    ],
)
def test_a_solid_that_lies_off_the_surface_is_told(above, told):
    _, findings = found(Patchwork((Face(cylinder_patch(0.05)),)), Z, margin=2.5e-3, above=above)
    message = str(findings.get("solid"))
    assert message == "None" if told is None else told in message
