"""opl points, opl faces, and what bad surfaces end with."""

import csv
import io
import json

import numpy as np
import pytest
import trimesh
from jobs import opl, write_job

from opl.job import load
from opl.resources import folder
from opl.surfacing import cut_surface

PARTS = ("v_shape", "s_shape", "faucet", "turbine_blade", "bent_tube")


def job_of(part):
    return folder("workpieces") / part / "job.yaml"


@pytest.mark.parametrize("part", PARTS)
def test_points_of_every_part_are_written_as_a_table_and_a_picture(tmp_path, part):
    ended = opl("points", job_of(part), "--out", tmp_path, "--json")
    assert ended.status == 0, ended.err
    told = json.loads(ended.out)
    table, picture = (tmp_path / f"{told['job']}_points.{end}" for end in ("csv", "svg"))
    rows = list(csv.DictReader(io.StringIO(table.read_text())))
    assert len(rows) == told["cutter_points"]
    assert int(rows[-1]["pass"]) == told["passes"]
    normals = np.array([[float(row[f"normal_{k}"]) for k in "xyz"] for row in rows])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=2e-6)
    assert picture.read_text().startswith("<?xml")


def test_points_are_the_same_to_the_byte_every_time(tmp_path):
    for folder_name in ("once", "again"):
        assert opl("points", job_of("s_shape"), "--out", tmp_path / folder_name).status == 0
    for name in ("S_SHAPE_points.csv", "S_SHAPE_points.svg"):
        once, again = (tmp_path / folder_name / name for folder_name in ("once", "again"))
        assert once.read_bytes() == again.read_bytes()


@pytest.mark.parametrize("part", PARTS)
def test_cutter_points_of_every_part_lie_on_its_solid_with_normals_outward(part):
    job = load(job_of(part))
    Ts = cut_surface(job).points.Ts_workpiece_cutter
    solid = trimesh.Trimesh(job.cell.part.vertices, job.cell.part.faces, process=False)
    centres = solid.triangles.mean(axis=1)
    for T in Ts[:: max(len(Ts) // 25, 1)]:
        near = np.argsort(np.linalg.norm(centres - T[:3, 3], axis=1))[:400]
        feet = trimesh.triangles.closest_point(
            solid.triangles[near], np.tile(T[:3, 3], (len(near), 1))
        )
        gaps = np.linalg.norm(feet - T[:3, 3], axis=1)
        assert gaps.min() < 0.05e-3  # chord error of mesh and solid
        touched = near[gaps < gaps.min() + 1e-6]
        assert (solid.face_normals[touched] @ T[:3, 2]).max() > 0.9


def test_check_warns_of_the_hollow_of_the_s_part():
    ended = opl("check", job_of("s_shape"))
    assert ended.status == 0
    assert "warning: hollow at cutter points 0-" in ended.out
    assert "radius 57.7 mm along the path" in ended.out
    told = json.loads(opl("check", job_of("s_shape"), "--json").out)
    assert len(told["warnings"]) == 1


def test_faces_of_a_mesh_need_its_unit():
    mesh = folder("workpieces") / "v_shape" / "v_shape.stl"
    ended = opl("faces", mesh)
    assert ended.status == 2
    assert "a mesh does not say its unit" in ended.err
    told = json.loads(opl("faces", mesh, "--unit", "mm", "--json").out)
    assert [one["id"] for one in told] == [1, 2, 3, 4]
    top = told[2]
    assert top["area_mm2"] == pytest.approx(2 * (46.843 + 1.132 * 61.774) * 25.0, rel=1e-3)
    assert top["mean_normal"][2] > 0.5


def mesh_job(home, **changes):
    """Return a job on the top of the V part's own mesh."""
    keys = {
        "workpiece.surface": "v_shape.stl",
        "workpiece.surface_unit": "mm",
        "workpiece.faces": [3],
        **{f"workpiece.{key}": value for key, value in changes.items()},
    }
    return write_job(home, {key: value for key, value in keys.items() if value is not None})


def test_a_region_of_a_mesh_can_be_ground(tmp_path):
    path = mesh_job(tmp_path)
    smooth = cut_surface(load(write_job(tmp_path / "smooth"))).points
    meshed = cut_surface(load(path)).points
    assert meshed.n_passes == smooth.n_passes
    for one in (smooth, meshed):
        np.testing.assert_allclose(
            one.Ts_workpiece_cutter[0, :3, 3], smooth.Ts_workpiece_cutter[0, :3, 3], atol=1e-5
        )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"surface_unit": None}, "workpiece: surface_unit is missing"),
        ({"surface_unit": "m"}, "workpiece.surface_unit: is 151646 mm long"),
        ({"mesh_unit": "m"}, "workpiece.mesh_unit: is 151646 mm long"),
        ({"faces": [9]}, "workpiece.faces: no face 9; v_shape.stl has 1 to 4"),
        ({"reversed_normal": True}, "reversed_normal is not for meshes"),
        ({"surface": "none.stl"}, "cannot be read"),
        ({"surface": "surface.txt", "surface_unit": None}, "must be one of .json"),
    ],
)
def test_what_does_not_fit_is_refused_with_status_2(tmp_path, changes, message):
    ended = opl("check", mesh_job(tmp_path, **changes))
    assert ended.status == 2
    assert message in ended.err


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_surface_that_is_a_thousand_times_off_is_refused(tmp_path, scale):
    path = write_job(tmp_path)
    content = json.loads((tmp_path / "surface.json").read_text())
    content["control_points_mm"] = (scale * np.array(content["control_points_mm"])).tolist()
    (tmp_path / "surface.json").write_text(json.dumps(content))
    ended = opl("check", path)
    assert ended.status == 2
    assert "workpiece.surface: is" in ended.err and "unit" in ended.err


def through(mesh):
    """Return a solid and a second one that goes through it, in one mesh."""
    vertices = np.vstack([mesh.vertices, mesh.vertices + np.array([3.0, 4.0, 5.0])])
    faces = np.vstack([mesh.faces, mesh.faces + len(mesh.vertices)])
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.mark.parametrize(
    ("break_mesh", "message"),
    [
        (through, "workpiece.mesh: {path}: crosses itself: triangles"),
        (lambda m: trimesh.Trimesh(m.vertices, m.faces[:-1], process=False), "is not closed"),
        (lambda m: trimesh.Trimesh(m.vertices * [1, 1, 0], m.faces, process=False),
         "not closed|encloses no volume|no triangle"),
    ],
)  # fmt: skip
def test_a_solid_that_is_open_flat_or_crosses_itself_is_refused(tmp_path, break_mesh, message):
    path = write_job(tmp_path)
    mesh = trimesh.load(tmp_path / "v_shape.stl")
    break_mesh(mesh).export(tmp_path / "v_shape.stl")
    ended = opl("check", path)
    assert ended.status == 2
    message = message.format(path=tmp_path / "v_shape.stl")
    assert any(part in ended.err for part in message.split("|"))


@pytest.mark.parametrize(
    ("name", "key", "message"),
    [("surface.json", "surface", "is empty"), ("v_shape.stl", "mesh", "holds no triangles")],
)
def test_an_empty_file_is_refused(tmp_path, name, key, message):
    path = write_job(tmp_path)
    (tmp_path / name).write_text("")
    ended = opl("check", path)
    assert ended.status == 2
    assert f"workpiece.{key}: {tmp_path / name}: {message}" in ended.err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"control_points_mm": [[[0, y, 0] for y in (0, 5, 9)]] * 3}, "control_points: span no"),
        ({"control_points_mm": [[[x, 2 * x, 0]] * 3 for x in (1, 2, 9)]}, "control_points: span"),
        ({"trim_loops": [[[0, 0], [0.5, 0.5], [1, 1]]]}, "trim_loops: enclose no area"),
        ({"trim_loops": [[[2, 2], [3, 2], [3, 3]]]}, "trim_loops: lie outside the parameters"),
    ],
)
def test_a_face_without_area_is_refused(tmp_path, changes, message):
    path = write_job(tmp_path)
    face = {
        "degree_u": 2,
        "degree_v": 2,
        "knots_u": [0, 0, 0, 1, 1, 1],
        "knots_v": [0, 0, 0, 1, 1, 1],
        "control_points_mm": [[[x, y, 0] for y in (0, 5, 9)] for x in (0, 5, 9)],
        "weights": np.ones((3, 3)).tolist(),
    }
    (tmp_path / "surface.json").write_text(json.dumps({"faces": [face, {**face, **changes}]}))
    ended = opl("check", path)
    assert ended.status == 2
    assert f"{tmp_path / 'surface.json'}: faces.1.{message}" in ended.err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"passes.scallop_mm": 0.01}, "needs either pitch_mm or scallop_mm"),
        ({"passes.kind": "along_u"}, "plane_normal goes with kind: sections"),
        ({"passes.order": "spiral"}, "passes.order: must be"),
        ({"passes.repeats": 0}, "passes.repeats: must be at least 1"),
    ],
)
def test_passes_that_contradict_themselves_are_refused(tmp_path, changes, message):
    ended = opl("check", write_job(tmp_path, changes))
    assert ended.status == 2
    assert message in ended.err
