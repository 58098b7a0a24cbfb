"""Every key is explained, and the page and the schema agree with the models of the files."""

import ast
import json
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel

import opl as package
from opl.cell.robot_file import RobotFile
from opl.files import documents
from opl.geometry.machined import _SurfaceFile
from opl.job.bodies import BodySection
from opl.job.cell_file import CellFile
from opl.job.file import JobFile
from opl.job.process import ProcessSection
from opl.job.reference import json_schema, keys_page, unit_of
from opl.job.search import ObjectiveWeightsSection, SearchSection, WeightsSection
from opl.program.ratios import _RatioFile
from tests.support.jobs import document, opl

PAGE = Path(__file__).parents[2] / "docs" / "keys.md"


def models_in(model, path=""):
    """Yield (key path, model) of a file and of all its sections."""
    yield path, model
    for key, field in model.model_fields.items():
        inner = documents.model_in(field.annotation)
        if inner is not None:
            yield from models_in(inner, f"{path}{key}.")


MODELS = [*models_in(JobFile), *models_in(CellFile)]
FIELDS = [
    pytest.param(key, field, id=f"{model.__name__}-{path}{key}")
    for path, model in MODELS
    for key, field in model.model_fields.items()
]


# the models


@pytest.mark.parametrize(("key", "field"), FIELDS)
def test_every_key_has_a_description(key, field):
    assert field.description, f"{key} has no description"
    assert field.description.endswith(".")


@pytest.mark.parametrize("model", dict.fromkeys(model for _, model in MODELS))
def test_an_old_name_leads_to_a_key(model):
    for old, new in model.renamed.items():
        assert old not in model.model_fields
        assert new in model.model_fields


def test_old_names_of_a_job_are_told_their_new_ones():
    content = document()
    content["wheel"]["contact_allowance_mm"] = content["wheel"].pop("max_belt_penetration_mm")
    content["passes"]["bow_height_mm"] = content["passes"].pop("max_chord_error_mm")
    content["program"]["levels"] = {"on_wheel": 1}
    content["program"]["acceleration_percent"] = {"air": 50}
    with pytest.raises(documents.InputError) as caught:
        documents.check(content, JobFile, "job.yaml")
    assert caught.value.message.split("\n") == [
        "4 faults",
        "wheel.contact_allowance_mm: was renamed, write max_belt_penetration_mm",
        "passes.bow_height_mm: was renamed, write max_chord_error_mm",
        "program.acceleration_percent.air: was renamed, write free_move",
        "program.levels: was renamed, write position_levels",
    ]


def test_old_names_of_a_cell_are_told_their_new_ones():
    with pytest.raises(documents.InputError) as caught:
        documents.check(
            {"robot": "mh24", "wheels": [], "stands": {"at_mm": [0, 0, 0]}, "clearances": []},
            CellFile,
            "cell.yaml",
        )
    assert "stands: was renamed, write mounting_face" in caught.value.message
    assert "clearances: was renamed, write pair_clearances" in caught.value.message


def test_a_key_that_is_gone_is_refused_with_the_reason():
    content = document()
    content["search"]["time_limit_s"] = 60.0
    with pytest.raises(documents.InputError) as caught:
        documents.check(content, JobFile, "job.yaml")
    assert caught.value.message == (
        "search.time_limit_s: no longer exists, remove it: the search is bounded by counted work, "
        "see max_subproblems"
    )


# the page and the schema


def test_the_page_is_that_of_the_models():
    assert PAGE.read_text(encoding="utf-8") == keys_page(), "opl schema --markdown > docs/keys.md"
    assert opl("schema", "--markdown").out == keys_page()


@pytest.mark.parametrize(("path", "model"), MODELS)
def test_every_key_has_a_row_on_the_page(path, model):
    rows = [line.split(" | ") for line in keys_page().splitlines() if line.startswith("| `")]
    for key, field in model.model_fields.items():
        found = [row for row in rows if row[0] == f"| `{key}`"]
        assert any(row[-1] == f"{field.description} |" for row in found), f"{path}{key}"


@pytest.mark.parametrize("kind", ["job", "cell"])
def test_descriptions_of_the_schema_end_with_unit_default_and_range(kind):
    made = json_schema(kind)
    assert json.loads(json.dumps(made)) == made
    wheel = made["$defs"]["WheelSection" if kind == "job" else "CellWheelSection"]["properties"]
    assert wheel["max_belt_penetration_mm"]["description"] == (
        "How deep the part may sink into the belt. [mm] Default: 0.5. Allowed: >= 0, <= 50."
    )
    assert wheel["max_roll_deg"]["description"].endswith("[deg] Allowed: >= 0, <= 90.")


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("feed_mm_s", "mm/s"),
        ("width_mm", "mm"),
        ("home_deg", "deg"),
        ("max_acceleration_deg_s2", "deg/s2"),
        ("dwell_s", "s"),
        ("acceleration_percent", "%"),
        ("rows", ""),
    ],
)
def test_a_unit_is_read_off_the_key(key, unit):
    assert unit_of(key, {}) == unit


def test_the_default_on_the_page_is_that_of_the_model():
    made = {model.__name__: model for _, model in MODELS}
    for name, model in made.items():
        properties = model.model_json_schema()["properties"]
        for key, field in model.model_fields.items():
            default = properties[key].get("default")
            if not field.is_required() and not isinstance(field.default, BaseModel):
                assert default == field.default, f"{name}.{key}"


# what a file says comes back


def values(schema, definitions):
    """Return a strategy for values that fit a JSON schema of numbers, lists and choices."""
    if "$ref" in schema:
        return mappings(definitions[schema["$ref"].removeprefix("#/$defs/")], definitions)
    if "anyOf" in schema:
        return st.one_of(*(values(option, definitions) for option in schema["anyOf"]))
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if schema["type"] == "null":
        return st.none()
    if schema["type"] == "boolean":
        return st.booleans()
    if schema["type"] == "string":
        return st.text(min_size=schema.get("minLength", 0), max_size=8)
    if schema["type"] == "array":
        return st.lists(
            values(schema["items"], definitions),
            min_size=schema.get("minItems", 0),
            max_size=schema.get("maxItems", 3),
        )
    if schema["type"] == "integer":
        return st.integers(schema.get("minimum", -1000), schema.get("maximum", 1000))
    low, high = schema.get("minimum"), schema.get("maximum")
    above = schema.get("exclusiveMinimum")
    return st.floats(
        low if above is None else above,
        high,
        exclude_min=above is not None,
        allow_nan=False,
        allow_infinity=False,
    )


def mappings(schema, definitions):
    needed = schema.get("required", [])
    known = {key: values(value, definitions) for key, value in schema["properties"].items()}
    return st.fixed_dictionaries(
        {key: known[key] for key in needed},
        optional={key: value for key, value in known.items() if key not in needed},
    )


FREE = [SearchSection, ProcessSection, WeightsSection]  # no rule between their keys


@pytest.mark.parametrize("model", FREE)
@settings(max_examples=40, deadline=None)  # files are written; a busy machine takes its time
@given(data=st.data())
def test_what_the_schema_allows_is_read_and_comes_back_the_same(model, data, tmp_path_factory):
    made = model.model_json_schema()
    weights = made.get("$defs", {}).pop("ObjectiveWeightsSection", None)
    if weights is not None:  # one of the three is above zero
        del made["properties"]["objective_weights"]
    content = data.draw(mappings(made, made.get("$defs", {})))
    path = tmp_path_factory.mktemp("section") / "section.yaml"
    path.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
    first = documents.read(path, model)
    path.write_text(json.dumps(first.model_dump(exclude_unset=True)), encoding="utf-8")
    second = documents.read(path, model)
    assert first == second
    assert second.model_fields_set == set(content)
    for key, field in model.model_fields.items():
        if key not in content:
            assert getattr(second, key) == field.default


@given(
    weights=st.fixed_dictionaries(
        {}, optional={key: st.floats(0.0, 1e5) for key in ("range", "travel", "time")}
    )
)
def test_objective_weights_need_one_above_zero(weights):
    full = {"range": 1.0, "travel": 0.1, "time": 0.0, **weights}
    if any(full.values()):
        made = documents.check(weights, ObjectiveWeightsSection, "x")
        assert made.model_dump() == full
    else:
        with pytest.raises(documents.InputError, match="at least one of range, travel and time"):
            documents.check(weights, ObjectiveWeightsSection, "x")


LENGTHS = st.floats(1e-3, 1e5)
SHAPES = {
    "box_mm": st.lists(LENGTHS, min_size=3, max_size=3),
    "cylinder_mm": st.lists(LENGTHS, min_size=2, max_size=2),
    "mesh": st.just("x.stl"),
}


@given(chosen=st.fixed_dictionaries({}, optional=SHAPES))
def test_a_body_has_exactly_one_shape(chosen):
    content = {"name": "post", "at_mm": [0, 0, 0], **chosen}
    if "mesh" in chosen:
        content["mesh_unit"] = "mm"
    if len(chosen) == 1:
        made = documents.check(content, BodySection, "x")
        assert made.model_dump(exclude_unset=True) == content
    else:
        with pytest.raises(documents.InputError, match="needs either box_mm"):
            documents.check(content, BodySection, "x")


def numbers_in(schema, place):
    """Yield the place and the schema of every number and every list that a schema allows."""
    if schema.get("type") in ("number", "integer", "array"):
        yield place, schema
    for one in [*schema.get("anyOf", []), schema.get("items"), schema.get("additionalProperties")]:
        if isinstance(one, dict):
            yield from numbers_in(one, place)


@pytest.mark.parametrize(
    "model", [JobFile, CellFile, RobotFile, _RatioFile, _SurfaceFile], ids=lambda one: one.__name__
)
def test_every_number_has_bounds_on_both_sides(model):
    made = model.model_json_schema()
    seen = 0
    for name, section in {model.__name__: made, **made.get("$defs", {})}.items():
        for key, value in section["properties"].items():
            for place, one in numbers_in(value, f"{name}.{key}"):
                seen += 1
                if one["type"] == "array":  # how much a surface has is bounded by its file
                    assert "maxItems" in one or model is _SurfaceFile, place
                    continue
                if "enum" in one:
                    continue
                for end in ("inimum", "aximum"):
                    assert {f"m{end}", f"exclusiveM{end}"} & one.keys(), place
    assert seen > 5


def test_the_v_job_comes_back_the_same_with_all_defaults_written_out():
    first = documents.check(document(quick=False), JobFile, "job")
    whole = json.loads(first.model_dump_json())
    assert documents.check(whole, JobFile, "job") == first


# keys are known in one room only


def key_paths():
    """Return every dotted key path of job and cell files, list numbers left out."""
    return {f"{path}{key}" for path, model in MODELS for key in model.model_fields if path}


def texts_of(path):
    """Yield the texts of a module that a user may come to read; docstrings are left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    kept_out = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and node.body
        if isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in kept_out:
            yield node.value


def named_outside(folder):
    """Return {key path: modules} for the texts of all rooms but that of the job."""
    known, found = key_paths(), {}
    for path in sorted(folder.rglob("*.py")):
        module = path.relative_to(folder).as_posix()
        # guests know of opl what its documents tell
        if module.startswith(("job/", "plugins/")):
            continue
        for text in texts_of(path):
            for dotted in re.findall(r"\b\w+(?:\.\w+)+\b", text):
                if dotted in known:
                    found.setdefault(dotted, set()).add(module)
    return found


def test_no_other_room_names_keys():
    assert named_outside(Path(package.__file__).parent) == {}


def test_a_key_in_another_room_is_found(tmp_path):
    (tmp_path / "job").mkdir()
    (tmp_path / "job" / "a.py").write_text("KEY = 'process.feed_mm_s'")
    (tmp_path / "b.py").write_text('"""Of process.feed_mm_s."""\nx = 1\n')
    assert named_outside(tmp_path) == {}
    (tmp_path / "c.py").write_text("def f(v):\n    return f'raise process.feed_mm_s to {v}'\n")
    assert named_outside(tmp_path) == {"process.feed_mm_s": {"c.py"}}
