"""What was proven, and of what: digests of every input and output, in result.json and program."""

import hashlib
import json
import shutil
from dataclasses import replace

import pytest

from opl.files.digests import STAMP, keeps_stamp, stamped
from opl.job.load import load_job
from opl.version import VERSION
from tests.support.jobs import V_JOB, document, opl, write_job, write_robot
from tests.support.surfaces import load_surface

pytestmark = pytest.mark.usefixtures("no_pictures")

SHORT = {
    "search.method": "recursive",
    "passes.end_margin_mm": 70,
    "process.home_deg": [20, -30, -55, -5, 48, 120],
}


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Return a folder with job.yaml and out/."""
    folder = tmp_path_factory.mktemp("inputs")
    ended = opl("run", write_job(folder, SHORT), "--out", folder / "out")
    assert ended.status == 0, ended.err
    return folder


@pytest.fixture
def copy(home, tmp_path):
    """Return a copy of the folder, to be changed."""
    return shutil.copytree(home, tmp_path / "copy")


def verified(folder, program="V_SHAPE.JBI"):
    ended = opl("verify", folder / "job.yaml", folder / "out" / program, "--json")
    return ended, json.loads(ended.out)


def test_every_input_has_its_digest_in_the_result(home):
    result = json.loads((home / "out" / "result.json").read_text())
    assert result["opl"] == VERSION
    inputs = result["inputs"]
    assert {"job", "surface.json", "v_shape.stl", "robot: robot.yaml"} < inputs.keys()
    for name in ("surface.json", "v_shape.stl"):
        assert inputs[name] == hashlib.sha256((home / name).read_bytes()).hexdigest()


def test_the_same_inputs_elsewhere_are_the_same(home, tmp_path):
    job = write_job(tmp_path / "else where", SHORT)
    job.write_text("# a remark\n" + job.read_text().replace("passes:", "passes:  # rows"))
    assert load_job(job).inputs == load_job(home / "job.yaml").inputs


def test_every_input_counts(home, tmp_path):
    before = load_job(home / "job.yaml").inputs
    write_robot(tmp_path / "arm", {"S": (-170, 170)})
    job = write_job(tmp_path, {**SHORT, "robot": "arm"})
    after = load_job(job).inputs
    assert {n for n in before if before[n] != after[n]} == {"job", "robot: robot.yaml"}
    in_cell = load_job("workpieces/v_in_cell/job.yaml").inputs
    assert "../cells/belt_cell.yaml" in in_cell
    assert any(name.endswith(": gripper.stl") for name in in_cell)


def test_values_that_a_program_gives_count_to_the_last_bit():
    job = document(SHORT)
    del job["workpiece"]
    part = load_job(V_JOB).cell.part
    moved = replace(part, vertices=part.vertices * (1.0 + 1e-15))
    surface = load_surface(V_JOB.parent / "surface.json")
    first, same, other = (
        load_job(job, surface=surface, part=one).inputs for one in (part, part, moved)
    )
    assert first == same and {n for n in first if first[n] != other[n]} == {"argument part"}


def test_an_untouched_program_tells_that_it_is_one(home):
    ended, told = verified(home)
    assert ended.status == 0
    assert (told["as_written"], told["changed"], told["other_inputs"]) == (True, False, [])


def test_a_mesh_exchanged_after_the_proof_is_told(copy):
    mesh = copy / "v_shape.stl"
    data = bytearray(mesh.read_bytes())
    data[3] ^= 1  # in the header of the file: the same triangles
    mesh.write_bytes(bytes(data))
    _, told = verified(copy)
    assert told["other_inputs"] == ["v_shape.stl"] and told["as_written"] is True
    words = opl("verify", copy / "job.yaml", copy / "out" / "V_SHAPE.JBI").out
    assert "other inputs than it was made of: v_shape.stl" in words
    # without the result the program still knows that something is another
    (copy / "out" / "result.json").unlink()
    _, told = verified(copy)
    assert told["other_inputs"] == ["unknown which"] and told["as_written"] is None


def test_a_program_of_another_version_of_opl_is_told(copy):
    path = copy / "out" / "result.json"
    path.write_text(path.read_text().replace(f'"opl": "{VERSION}"', '"opl": "0.0.1"'))
    assert verified(copy)[1]["other_inputs"] == ["opl"]


def test_a_renamed_program_is_known_by_its_bytes(copy):
    out = copy / "out"
    (out / "V_SHAPE.JBI").rename(out / "OTHER.JBI")
    assert verified(copy, "OTHER.JBI")[1]["as_written"] is True
    text = (out / "OTHER.JBI").read_bytes()
    (out / "OTHER.JBI").write_bytes(text.replace(b"'HOME\r\n", b"'HOMF\r\n", 1))
    ended, told = verified(copy, "OTHER.JBI")
    assert ended.status == 4 and told["as_written"] is False and told["changed"] is True
    assert "not the bytes that opl run proved" in ended.err
    # without the result what it says is proven, and that it was changed is told
    (out / "result.json").unlink()
    ended, told = verified(copy, "OTHER.JBI")
    assert ended.status == 0 and told["changed"] is True
    words = opl("verify", copy / "job.yaml", out / "OTHER.JBI").out
    assert "changed since opl wrote it" in words


def test_a_text_without_a_stamp_tells_nothing():
    assert stamped("MOVJ C00000") == "MOVJ C00000" and keeps_stamp(b"MOVJ C00000") is None
    assert keeps_stamp(stamped(f"'{STAMP}\r\nEND").encode()) is True
