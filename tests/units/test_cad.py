import json
import re

import numpy as np
import pytest
import yaml
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.IGESControl import IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.StlAPI import StlAPI_Writer
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from scipy.spatial import cKDTree

from opl.errors import InputError
from opl.geometry import cad
from opl.geometry.machined import load_machined
from opl.geometry.mesh import load_mesh, load_triangles
from opl.geometry.patchwork import Patchwork
from tests.support.jobs import document, opl
from tests.support.solids import ORIGINS, lay

X, Y, Z = np.eye(3)


def write_step(shape, path, unit="MM"):
    writer = STEPControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def block():
    """A block 60 x 40 x 20 with two rounded edges and a hole of radius 5 through its top."""
    box = BRepPrimAPI_MakeBox(60.0, 40.0, 20.0).Shape()
    fillet = BRepFilletAPI_MakeFillet(box)
    explorer = TopExp_Explorer(box, TopAbs_ShapeEnum.TopAbs_EDGE)
    for number in range(1, 7):
        if number in (2, 6):
            fillet.Add(6.0, TopoDS.Edge_s(explorer.Current()))
        explorer.Next()
    drill = gp_Ax2(gp_Pnt(30, 20, -1), gp_Dir(0, 0, 1))
    return BRepAlgoAPI_Cut(
        fillet.Shape(), BRepPrimAPI_MakeCylinder(drill, 5.0, 40.0).Shape()
    ).Shape()


def tilted_pipe():
    """A pipe with a thin wall, a branch through it at an angle, and both bores."""
    lying = gp_Ax2(gp_Pnt(-40, 0, 0), gp_Dir(1, 0, 0))
    rising = gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0.4, 0.1, 1))
    outer, inner = (
        BRepAlgoAPI_Fuse(
            BRepPrimAPI_MakeCylinder(lying, radius, 80.0).Shape(),
            BRepPrimAPI_MakeCylinder(rising, 0.7 * radius, 40.0).Shape(),
        ).Shape()
        for radius in (12.0, 10.5)
    )
    return BRepAlgoAPI_Cut(outer, inner).Shape()


def write_stl(shape, path, deflection=0.006, angle=0.5):
    BRepMesh_IncrementalMesh(shape, deflection, False, angle)
    writer = StlAPI_Writer()
    writer.ASCIIMode = False
    writer.Write(shape, str(path))
    return path


@pytest.mark.parametrize(
    ("shape", "kind", "distance", "area"),
    [
        (BRepPrimAPI_MakeSphere(30.0), "sphere",
         lambda p: np.linalg.norm(p, axis=1) - 0.03, 4 * np.pi * 900),
        (BRepPrimAPI_MakeTorus(40.0, 12.0), "torus",
         lambda p: np.hypot(np.hypot(p[:, 0], p[:, 1]) - 0.04, p[:, 2]) - 0.012,
         4 * np.pi**2 * 480),
        (BRepPrimAPI_MakeCylinder(20.0, 50.0), "cylinder",
         lambda p: np.hypot(p[:, 0], p[:, 1]) - 0.02, 2 * np.pi * 1000),
        (BRepPrimAPI_MakeCone(20.0, 10.0, 50.0), "cone",
         lambda p: (np.hypot(p[:, 0], p[:, 1]) + 0.2 * p[:, 2] - 0.02) / np.hypot(1, 0.2),
         np.pi * 30 * np.hypot(50, 10)),
    ],
)  # fmt: skip
def test_faces_are_exact_and_face_outward(tmp_path, shape, kind, distance, area):
    found = cad.load_cad_faces(write_step(shape.Shape(), tmp_path / "part.step"))
    assert found[0].type == kind
    samples = found[0].area_samples(0.5e-3)
    assert np.abs(distance(samples.points)).max() < 1e-9
    assert (distance(samples.points + 1e-4 * samples.normals) > 0.9e-4).all()
    assert 1e6 * samples.areas.sum() == pytest.approx(area, rel=2e-3)


@pytest.mark.usefixtures("warm_processes")
def test_a_hole_breaks_the_passes_and_a_fillet_joins_them(tmp_path):
    path = write_step(block(), tmp_path / "block.step")
    faces = cad.load_cad_faces(path)
    top = [
        k
        for k, one in enumerate(faces, 1)
        if one.trim is not None
        and len(one.trim.loops) == 2
        and one.area_samples(2e-3).normals[0, 2] > 0.9
    ]
    rounded = [k for k, one in enumerate(faces, 1) if one.type == "cylinder" and one.outward > 0.0]
    assert len(top) == 1 and len(rounded) == 2
    flat = load_machined(path, top, False, "mm", 0.5)
    laid = lay(flat, Y, rows=1, pitch=1.0)
    assert laid.points.n_passes == 2
    x = np.sort(laid.points.Ts_workpiece_cutter[:, 0, 3])
    gap = np.diff(x).argmax()
    np.testing.assert_allclose(x[[gap, gap + 1]], [0.025, 0.035], atol=2e-6)
    # over both fillets: one pass beside the hole, two across it
    whole = load_machined(path, [*top, *rounded], False, "mm", 0.5)
    beside = lay(whole, Y, pitch=24e-3, margin=8e-3).points
    assert beside.n_passes == 2
    across = lay(whole, Y, rows=1, pitch=1.0).points
    assert across.n_passes == 2
    for points, count in ((beside, 2), (across, 2)):
        ends = [points.arc_length[points.pass_index == k][-1] for k in range(count)]
        arcs = 2 * 6e-3 * np.pi / 2
        total = 48e-3 + arcs if points is beside else 0.5 * (48e-3 - 10e-3 + arcs)
        np.testing.assert_allclose(ends, total, atol=4e-6)


@pytest.mark.parametrize(
    "shape", [BRepPrimAPI_MakeTorus(24.0, 8.0), BRepPrimAPI_MakeCone(30.0, 18.0, 50.0)]
)
def test_a_part_and_its_own_fine_mesh_give_the_same_passes_within_two_hundredths(tmp_path, shape):
    step = write_step(shape.Shape(), tmp_path / "part.step")
    stl = write_stl(shape.Shape(), tmp_path / "part.stl")
    exact = Patchwork((cad.load_cad_faces(step)[0],))
    meshed = load_machined(stl, [1], False, "mm", np.deg2rad(20.0))
    normal = np.array([0.1, 0.2, 1.0]) / np.sqrt(1.05)
    one, other = (
        lay(surface, normal, pitch=6e-3, margin=4e-3, rows=3) for surface in (exact, meshed)
    )
    assert one.points.n_passes == other.points.n_passes
    for index in range(one.points.n_passes):
        a, b = (
            laid.points.Ts_workpiece_cutter[laid.points.pass_index == index][ORIGINS]
            for laid in (one, other)
        )
        curves = exact.curves(normal, float(a[0] @ normal), 1e-8)
        dense = np.concatenate([c.positions(np.linspace(0.0, c.length, 40_000)) for c in curves])
        distance, _ = cKDTree(dense).query(b)
        assert distance.max() < 0.02e-3
        assert len(b) == pytest.approx(len(a), rel=0.1)
        middle = [points.mean(axis=0) for points in (a, b)]
        np.testing.assert_allclose(*middle, atol=3e-3)  # the same curve of the row


def test_a_file_in_metres_or_inches_is_read_in_its_own_unit(tmp_path):
    for unit in ("M", "INCH"):
        path = write_step(BRepPrimAPI_MakeCylinder(20.0, 50.0).Shape(), tmp_path / "p.step", unit)
        (side, *_) = cad.load_cad_faces(path)
        assert Patchwork((side,)).extent_along(Z) == pytest.approx((0.0, 0.05), abs=1e-9)


def test_an_iges_file_has_the_same_faces(tmp_path):
    writer = IGESControl_Writer()
    writer.AddShape(BRepPrimAPI_MakeCylinder(20.0, 50.0).Shape())
    writer.Write(str(tmp_path / "part.igs"))
    found = cad.load_cad_faces(tmp_path / "part.igs")
    assert len(found) == 3
    lengths = [np.ptp(Patchwork((one,)).extent_along(Z)) for one in found]
    assert max(lengths) == pytest.approx(0.05, abs=1e-9)


def test_the_meshes_of_cad_parts_do_not_cross_themselves(tmp_path):
    shapes = (block(), BRepPrimAPI_MakeTorus(24.0, 8.0).Shape(), tilted_pipe())
    for number, shape in enumerate(shapes):
        for deflection, angle in ((0.01, 0.2), (0.1, 0.5)):
            stl = write_stl(shape, tmp_path / f"{number}_{deflection}.stl", deflection, angle)
            assert load_mesh(stl, "mm").volume > 0.0


@pytest.mark.usefixtures("warm_processes")
def test_a_cut_file_or_one_with_a_face_of_no_area_ends_with_status_2(tmp_path):
    step = write_step(block(), tmp_path / "block.step").read_text()
    writer = IGESControl_Writer()
    writer.AddShape(block())
    writer.Write(str(tmp_path / "block.igs"))
    iges = (tmp_path / "block.igs").read_text()
    box = write_step(BRepPrimAPI_MakeBox(60.0, 40.0, 20.0).Shape(), tmp_path / "box.step")
    flat = re.sub(r"(\(\S+?,\S+?,)20\.\)", r"\g<1>0.)", box.read_text())
    write_stl(block(), tmp_path / "block.stl", 0.05, 0.2)
    cases = [("step", step[: len(step) * part // 100], "whole STEP file") for part in (5, 50, 99)]
    cases += [("igs", iges[: len(iges) * part // 100], "whole IGES file") for part in (5, 50, 99)]
    cases += [("step", flat, "face 1: has no area"), ("step", "", "is empty")]
    content = document({"workpiece.mesh": "block.stl"})
    for suffix, text, message in cases:
        bad = tmp_path / f"bad.{suffix}"
        bad.write_text(text)
        content["workpiece"]["surface"] = bad.name
        (tmp_path / "job.yaml").write_text(yaml.safe_dump(content))
        for ended in (opl("faces", bad), opl("check", tmp_path / "job.yaml")):
            assert ended.status == 2
            assert bad.name in ended.err and message in ended.err
    assert "workpiece.surface" in ended.err


@pytest.mark.usefixtures("warm_processes")
@pytest.mark.parametrize("size", [30.0 * 1000.0, 30.0 / 1000.0])
def test_a_step_file_a_thousand_times_off_ends_with_status_2(tmp_path, size):
    write_step(BRepPrimAPI_MakeBox(2 * size, size, size).Shape(), tmp_path / "box.step")
    write_stl(BRepPrimAPI_MakeBox(60.0, 30.0, 30.0).Shape(), tmp_path / "box.stl")
    content = document({"workpiece.mesh": "box.stl", "workpiece.surface": "box.step"})
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(content))
    ended = opl("check", tmp_path / "job.yaml")
    assert ended.status == 2
    assert "workpiece.surface: is" in ended.err and "unit" in ended.err


@pytest.mark.usefixtures("warm_processes")
def test_bad_files_are_refused(tmp_path):
    path = write_step(block(), tmp_path / "block.step")
    text = path.read_text()
    cases = {
        "": "is empty",
        text[: len(text) // 2]: "whole",
        text[:300]: "whole",
        "no step file": "whole",
    }
    for content, message in cases.items():
        bad = tmp_path / "bad.step"
        bad.write_text(content)
        with pytest.raises(InputError, match=message):
            cad.load_cad_faces(bad)
    with pytest.raises(InputError, match="cannot be read"):
        cad.load_cad_faces(tmp_path / "none.step")
    with pytest.raises(ValueError, match=r"no face 12; block\.step has 1 to 9"):
        load_machined(path, [12], False, "mm", 0.5)


def test_opl_faces_lists_id_type_area_and_size(tmp_path):
    path = write_step(block(), tmp_path / "block.step")
    ended = opl("faces", path, "--json")
    told = json.loads(ended.out)
    assert [one["id"] for one in told] == list(range(1, 10))
    assert sorted({one["type"] for one in told}) == ["cylinder", "plane"]
    assert max(one["holes"] for one in told) == 1
    text = opl("faces", path).out
    assert "face 1: plane, 560 mm2, 0 x 40 x 14 mm" in text
    assert "####" in text


def test_a_job_names_faces_of_a_step_file_by_id(tmp_path):
    path = write_step(block(), tmp_path / "block.step")
    stl = write_stl(block(), tmp_path / "block.stl", 0.05, 0.2)
    assert len(load_triangles(stl, "mm").faces) > 20
    changes = {
        "workpiece.surface": path.name,
        "workpiece.mesh": stl.name,
        "workpiece.faces": [8],
        "passes.plane_normal": [0, 1, 0],
        "passes.rows": 3,
    }
    job = tmp_path / "job.yaml"
    content = document()
    for key, value in changes.items():
        section, name = key.split(".")
        content[section][name] = value
    job.write_text(yaml.safe_dump(content))
    ended = opl("check", job)
    assert ended.status == 0, ended.err
    content["workpiece"]["faces"] = [77]
    job.write_text(yaml.safe_dump(content))
    ended = opl("check", job)
    assert ended.status == 2
    assert "workpiece.faces: no face 77; block.step has 1 to 9" in ended.err
