"""opl points, opl faces, and what bad surfaces end with."""

import csv
import io
import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
import trimesh

from opl.files.resources import folder
from opl.job.load import load_job
from opl.run.surfacing import cut_surface
from tests.support.jobs import GONE, opl, write_job

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


@pytest.mark.parametrize(
    ("part", "doubtful", "missed", "passes"),
    [("v_shape", False, False, 5), ("s_shape", True, False, 5), ("faucet", True, True, 7)],
)
def test_the_picture_numbers_the_passes_and_marks_what_is_doubtful(
    tmp_path, part, doubtful, missed, passes
):
    assert opl("points", job_of(part), "--out", tmp_path).status == 0
    (picture,) = tmp_path.glob("*.svg")
    text = picture.read_text()
    assert ("cutter point with a warning" in text) is doubtful
    assert ("no pass comes by" in text) is missed
    for view in ("oblique", "from above", "from beside"):
        assert f">{view}<" in text
    assert text.count(">20 mm<") == 3
    # each pass has its number in two of the views
    assert [text.count(f">{number}<") for number in range(1, passes + 2)] == [2] * passes + [0]
    assert f" in {passes} passes, pitch " in text


def laid_by(tmp_path, **changes):
    """Return pass, position and arc length of the cutter points of the V job, all in mm."""
    path = write_job(tmp_path, {f"passes.{key}": value for key, value in changes.items()})
    assert opl("points", path, "--out", tmp_path).status == 0
    (table,) = tmp_path.glob("*.csv")
    rows = list(csv.DictReader(io.StringIO(table.read_text())))
    columns = ("pass", "x_mm", "y_mm", "z_mm", "arc_mm")
    return np.array([[float(row[column]) for column in columns] for row in rows])


def test_rows_of_a_job_lie_where_its_keys_say(tmp_path):
    def x_of_rows(**changes):
        found = laid_by(tmp_path, **{"rows": GONE, "margin_mm": 2.5, **changes})
        return [float(x) for x in dict(found[:, :2]).values()]

    assert x_of_rows() == [-10.0, -5.0, 0.0, 5.0, 10.0]
    assert x_of_rows(margin_mm=5) == [-7.5, -2.5, 2.5, 7.5]
    assert x_of_rows(rows=2) == [-2.5, 2.5]
    assert x_of_rows(order="both", rows=2) == [-2.5, -2.5, 2.5, 2.5]
    assert x_of_rows(repeats=2, shift_mm=2.5) == [-10, -5, 0, 5, 10, -7.5, -2.5, 2.5, 7.5]
    turned = x_of_rows(plane_normal=GONE, kind="along_v")
    np.testing.assert_allclose(turned, [-10.0, -5.0, 0.0, 5.0, 10.0], atol=1e-6)


def test_margins_at_the_ends_of_the_passes_of_a_job_are_left_out(tmp_path):
    whole, short = (laid_by(tmp_path, end_margin_mm=margin) for margin in (0, 4))
    np.testing.assert_allclose(whole[-1, 4] - short[-1, 4], 8.0, atol=1e-5)
    # the ends are straight flanks
    gaps = np.linalg.norm(whole[[0, -1], 1:4] - short[[0, -1], 1:4], axis=1)
    np.testing.assert_allclose(gaps, 4.0, atol=1e-5)


def test_a_hole_in_the_surface_of_a_job_breaks_its_passes(tmp_path):
    write_job(tmp_path)
    content = json.loads((tmp_path / "surface.json").read_text())
    (u0, u1), (v0, v1) = (np.array(content[f"knots_{axis}"])[[0, -1]] for axis in "uv")
    border = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]]
    hole = [[u, v] for u, v in ((u0 + 8, v0 + 20), (u0 + 17, v0 + 20), (u0 + 17, v0 + 32))]
    content["trim_loops"] = [border, [*hole, [u0 + 8, v0 + 32]]]
    job = write_job(tmp_path, {"passes.rows": 5})
    (tmp_path / "surface.json").write_text(json.dumps(content))
    told = json.loads(opl("points", job, "--out", tmp_path, "--json").out)
    # the hole lies between x = -4.5 and 4.5 mm: the rows at -10, -5, 5 and 10 pass by it
    assert told["passes"] == 6
    whole = sum(2.0 * (46.843 + 1.132 * 61.774) for _ in range(5))
    assert told["path_mm"] == pytest.approx(whole - 12.0, abs=0.05)


@pytest.mark.parametrize("part", PARTS)
def test_the_geometry_of_a_part_is_what_its_script_makes(tmp_path, part):
    shutil.copy(job_of(part).parent / "make_geometry.py", tmp_path)
    subprocess.run([sys.executable, "make_geometry.py"], cwd=tmp_path, check=True)
    made = sorted(path.name for path in tmp_path.iterdir() if path.suffix != ".py")
    kept = sorted(path.name for path in job_of(part).parent.iterdir())
    assert made == [name for name in kept if name.endswith((".json", ".stl", ".ply"))]
    for name in made:
        again, there = tmp_path / name, job_of(part).parent / name
        if again.suffix == ".json":
            assert rounded(json.loads(again.read_text())) == rounded(json.loads(there.read_text()))
        else:
            again, there = (trimesh.load(path, process=False) for path in (again, there))
            np.testing.assert_array_equal(again.faces, there.faces)
            np.testing.assert_allclose(again.vertices, there.vertices, rtol=0.0, atol=2e-5)


def rounded(content):
    """Return what a JSON file holds, numbers to the nearest nanometre of a millimetre."""
    if isinstance(content, dict):
        return {key: rounded(value) for key, value in content.items()}
    if isinstance(content, list):
        return [rounded(value) for value in content]
    return pytest.approx(content, abs=1e-9)


def test_points_are_the_same_to_the_byte_every_time(tmp_path):
    for folder_name in ("once", "again"):
        assert opl("points", job_of("s_shape"), "--out", tmp_path / folder_name).status == 0
    for name in ("S_SHAPE_points.csv", "S_SHAPE_points.svg"):
        once, again = (tmp_path / folder_name / name for folder_name in ("once", "again"))
        assert once.read_bytes() == again.read_bytes()


@pytest.mark.parametrize("part", PARTS)
def test_cutter_points_of_every_part_lie_on_its_solid_with_normals_outward(part):
    job = load_job(job_of(part))
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
    assert "a mesh file has no unit" in ended.err
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
    smooth = cut_surface(load_job(write_job(tmp_path / "smooth"))).points
    meshed = cut_surface(load_job(path)).points
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


def test_who_lacks_the_extra_is_told_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)  # as if it were not installed

    (tmp_path / "part.step").write_text("ISO-10303-21;")
    job = write_job(tmp_path, {"workpiece.surface": "part.step"})
    for ended in (opl("faces", tmp_path / "part.step"), opl("check", job)):
        assert ended.status == 2
        assert "needs the optional extra for STEP and IGES: pip install 'opl[cad]'" in ended.err


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
        ({"passes.scallop_height_mm": 0.01}, "needs either pitch_mm or scallop_height_mm"),
        ({"passes.kind": "along_u"}, "plane_normal goes with kind: sections"),
        ({"passes.order": "spiral"}, "passes.order: must be"),
        ({"passes.repeats": 0}, "passes.repeats: must be at least 1"),
    ],
)
def test_passes_that_contradict_themselves_are_refused(tmp_path, changes, message):
    ended = opl("check", write_job(tmp_path, changes))
    assert ended.status == 2
    assert message in ended.err
