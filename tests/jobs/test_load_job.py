"""A job from a mapping, and from values that a program has made."""

from dataclasses import replace

import numpy as np
import pytest

from opl.errors import InputError
from opl.geometry.machined import load_faces
from opl.geometry.mesh import load_mesh
from opl.geometry.passes import PassKind
from opl.geometry.patchwork import Patchwork
from opl.job import keys
from opl.job.file import JobFile
from opl.job.load import load_job
from opl.run.surfacing import cut_surface
from tests.support.jobs import V_JOB, V_SHAPE, document, write_job

SURFACE = load_faces(V_SHAPE / "surface.json")[0].surface
PART = load_mesh(V_SHAPE / "v_shape.stl", "mm")


def refusal(source, **arguments):
    with pytest.raises(InputError) as caught:
        load_job(source, **arguments)
    return str(caught.value)


def without_files():
    content = document()
    del content["workpiece"]
    return content


def test_a_mapping_gives_the_job_of_its_file(tmp_path):
    of_file, of_mapping = load_job(write_job(tmp_path)), load_job(document(), folder=V_SHAPE)
    np.testing.assert_array_equal(of_mapping.cell.part.vertices, of_file.cell.part.vertices)
    np.testing.assert_array_equal(of_mapping.process.home, of_file.process.home)
    assert of_mapping.search.interpolation == of_file.search.interpolation
    assert of_mapping.source.label == "job"


def test_names_in_a_mapping_are_those_of_the_current_folder(tmp_path, monkeypatch):
    write_job(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert load_job(document()).cell.part.volume > 0.0
    monkeypatch.chdir(tmp_path.parent)
    assert refusal(document()).startswith("job: workpiece.mesh: v_shape.stl: ")


def test_a_folder_may_be_named_for_a_file(tmp_path):
    path = tmp_path / "alone.yaml"
    path.write_text(V_JOB.read_text(encoding="utf-8"), encoding="utf-8")
    assert load_job(path, folder=V_SHAPE).source.folder == V_SHAPE


def test_the_mapping_is_left_as_it_was():
    content = without_files()
    load_job(content, surface=SURFACE, part=PART)
    assert content == without_files()


def test_surface_and_part_may_be_values():
    job = load_job(without_files(), surface=SURFACE, part=PART)
    assert job.cell.part is PART
    assert job.surface.faces[0].surface is SURFACE


def test_one_of_them_may_be_a_value():
    content = document()
    content["workpiece"] = {"mesh": "v_shape.stl", "mesh_unit": "mm"}
    assert load_job(content, folder=V_SHAPE, surface=SURFACE).cell.part.volume > 0.0
    content["workpiece"] = {"surface": "surface.json"}
    assert load_job(content, folder=V_SHAPE, part=PART).cell.part is PART


def test_what_is_a_value_is_no_key_as_well():
    told = refusal(document(), folder=V_SHAPE, surface=SURFACE)
    assert told == (
        "job: workpiece.surface: the argument surface is given as well; leave one out, "
        "got 'surface.json'"
    )
    told = refusal(document(), folder=V_SHAPE, part=PART)
    assert told.splitlines()[1].startswith("workpiece.mesh: the argument part is given as well")
    assert told.splitlines()[2].startswith("workpiece.mesh_unit: the argument part is given")


def test_keys_of_a_surface_file_need_one():
    content = document()
    content["workpiece"] = {"reversed_normal": True}
    told = refusal(content, surface=SURFACE, part=PART)
    assert told == "job: workpiece: reversed_normal goes with surface, a file"


@pytest.mark.parametrize("key", ["surface", "mesh", "mesh_unit"])
def test_without_values_every_key_is_needed(key):
    content = document()
    del content["workpiece"][key]
    assert refusal(content, folder=V_SHAPE) == f"job: workpiece.{key}: is missing"


def test_values_are_looked_at_like_files():
    face = load_faces(V_SHAPE / "surface.json")[0]
    inward = Patchwork((replace(face, outward=-face.outward),))
    told = refusal(without_files(), surface=inward, part=PART)
    assert told.startswith("job: surface: normals point into the solid at 100 % of the surface")
    huge = replace(SURFACE, control_points=1e3 * SURFACE.control_points)
    told = refusal(without_files(), surface=huge, part=PART)
    assert told.startswith("job: surface: is ")
    inches = replace(PART, vertices=1e3 * PART.vertices)
    told = refusal(without_files(), surface=SURFACE, part=inches)
    assert told.startswith("job: part: is ")


def test_another_method_may_be_asked_for():
    assert load_job(V_JOB, method="recursive").search.method.value == "recursive"


# key paths


def exists(schema, definitions, parts):
    """Return whether a key path is one of a JSON schema."""
    options = schema.get("anyOf", [schema])
    for option in options:
        option = definitions[option["$ref"].rsplit("/")[-1]] if "$ref" in option else option
        inner = option.get("properties", {})
        if not parts or (parts[0] in inner and exists(inner[parts[0]], definitions, parts[1:])):
            return True
    return False


CONSTANTS = {name: value for name, value in vars(keys).items() if name.isupper()}
NAMED = [value for value in CONSTANTS.values() if isinstance(value, str)]


@pytest.mark.parametrize(
    "path", [*NAMED, *keys.OF_PASSES.values(), *keys.OF_PROGRAM.values(), *sorted(keys.OF_A_JOB)]
)
def test_every_named_key_path_is_one_of_a_job(path):
    schema = JobFile.model_json_schema()
    assert exists({"properties": schema["properties"]}, schema["$defs"], path.split("."))
    assert not exists(
        {"properties": schema["properties"]}, schema["$defs"], [*path.split("."), "x"]
    )


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("plane_normal", np.zeros(3)),
        ("pitch", 0.0),
        ("max_bow_height", 0.0),
        ("largest_step", 0.0),
        ("rows", 1000),
        ("repeats", 0),
    ],
)
def test_a_refused_value_of_the_passes_is_named_by_its_key(attribute, value):
    job = load_job(V_JOB)
    with pytest.raises(InputError) as caught:
        cut_surface(replace(job, passes=replace(job.passes, **{attribute: value})))
    assert caught.value.where == f"{V_JOB}: {keys.OF_PASSES[attribute]}"


def test_a_refused_kind_of_passes_is_named_by_its_key():
    job = load_job(V_JOB)
    two = Patchwork((*job.surface.faces, *job.surface.faces))
    with pytest.raises(InputError) as caught:
        cut_surface(replace(job, surface=two, passes=replace(job.passes, kind=PassKind.ALONG_U)))
    assert caught.value.where == f"{V_JOB}: passes.kind"
    assert caught.value.message == "along_u needs a single NURBS face"
