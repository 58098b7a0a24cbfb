"""YAML and JSON as people write them, right and wrong."""

import json
import os
from pathlib import Path
from typing import ClassVar

import pytest

from opl.errors import InputError
from opl.files import documents, yaml_text
from opl.files.documents import Document


class Part(Document):
    size_mm: float
    count: int = 1


class Sample(Document):
    name: str = "x"
    ratio: float = 0.0
    sharp: bool = False
    part: Part | None = None
    parts: list[Part] = []  # noqa: RUF012, pydantic copies it
    numbers: list[float] = []  # noqa: RUF012


def read(tmp_path, text):
    path = tmp_path / "sample.yaml"
    path.write_text(text, encoding="utf-8")
    return documents.read(path, Sample)


def refusal(tmp_path, text):
    """Return what is said of a file, without the folder that it lies in."""
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "sample.yaml"))
    return str(caught.value).removeprefix(f"{tmp_path / 'sample.yaml'}: ")


def test_a_number_may_be_written_without_its_point(tmp_path):
    assert read(tmp_path, "ratio: 3").ratio == 3.0


@pytest.mark.parametrize("text", ["1e-05", "1E3", "-2e4", "1.5e-7", "6.1e-17"])
def test_numbers_are_read_as_json_writes_them(tmp_path, text):
    assert read(tmp_path, f"ratio: {text}").ratio == float(text)


def test_every_float_survives_json(tmp_path):
    numbers = [1e-05, 1e16, -1e-300, 0.1, 5.0, 1.7976931348623157e308]
    assert read(tmp_path, json.dumps({"numbers": numbers})).numbers == numbers


def test_anchors_and_merges_of_yaml_work(tmp_path):
    text = "part: &a {size_mm: 2, count: 3}\nparts:\n- {<<: *a, count: 5}\n"
    sample = read(tmp_path, text)
    assert (sample.parts[0].size_mm, sample.parts[0].count) == (2.0, 5)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10), ("0o10", 8), ("0x1F", 31), ("+3", 3), ("1.", 1.0), (".5", 0.5), ("1e3", 1e3),
        ("yes", "yes"), ("on", "on"), ("1:30", "1:30"), ("2024-01-02", "2024-01-02"),
        ("true", True), ("'true'", "true"), ("~", None), ("!!str 010", "010"), ("- ", [None]),
        ("0b1", "0b1"), ("1_0", "1_0"), ("=", "="), ("<<", "<<"), ("{1: 2}", {1: 2}),
    ],
)  # fmt: skip
def test_words_are_those_of_yaml_1_2(text, value):
    found = yaml_text.load(text)
    assert found == value and type(found) is type(value)


def bomb(levels):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        # some parsers read ahead, up to a limit of their own
        ("[" * 100_000, r"line 1, column (61|1001): is nested more than 60 deep"),
        ("- " * 100_000, "line 1, column 121: is nested more than 60 deep"),
        ("{a: " * 100_000, r"line 1, column \d+: is nested more than 60 deep"),
        ("&a [" * 50 + "]" * 50 + "\n", "line 1"),
        (
            "a: &a " + "[" * 40 + "]" * 40 + "\nb: " + "[" * 30 + "*a" + "]" * 30,
            "line 2, column 34",
        ),
        (bomb(9), "line 6, column 30: holds more than 600000 values"),
        ("ratio: " + "9" * 65, "line 1, column 8: a number of more than 64 characters"),
    ],
)
def test_text_that_grows_is_refused(text, told):
    if told == "line 1":  # deep, but not too deep
        yaml_text.load(text)
    else:
        with pytest.raises(yaml_text.YamlError, match=f"^{told}"):
            yaml_text.load(text)


def test_merges_give_way_to_what_stands_there():
    text = "a: &a {x: 1, y: 1}\nb: &b {y: 2, z: 2}\nc: {z: 3, <<: [*a, *b]}\n"
    assert yaml_text.load(text)["c"] == {"x": 1, "y": 1, "z": 3}


def test_of_many_faults_the_first_are_told(tmp_path):
    text = "".join(f"k{n}: 1\n" for n in range(50_000))
    lines = refusal(tmp_path, text).split("\n")
    assert (lines[0], len(lines), lines[-1]) == ("50000 faults", 22, "and 49980 more")


def test_pipes_devices_and_links_in_a_ring_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "ring").symlink_to("ring")
    for place in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(InputError, match="cannot be read: Is not a file"):
            documents.read(place, Sample)
    with pytest.raises(InputError, match="cannot be read: Too many levels of symbolic links"):
        documents.read(tmp_path / "ring", Sample)


def test_files_of_a_size_that_nobody_writes_are_refused(tmp_path):
    with (tmp_path / "huge.yaml").open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match="is larger than 4 MB, which no such file is"):
        documents.read(tmp_path / "huge.yaml", Sample)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"ratio": 1, "ratio": 2}', "is not JSON: key 'ratio' is given twice"),
        ('{"ratio": 1', "line 1, column 12: is not JSON, Expecting ',' delimiter"),
        ("[" * 100_000, "is nested too deep"),
        ('{"ratio": NaN}', "ratio: must be finite, got .nan"),
        ('{"ratio": 1e999}', "ratio: must be finite, got .inf"),
        ('{"ratio": ' + "9" * 5000 + "}", "is not JSON: "),
        ('{"ratio": ' + "9" * 500 + "}", "ratio: "),
        ("[" + "0," * 1_000_001 + "0]", "is not JSON: holds more than 600000 values"),
    ],
)
def test_json_is_read_as_such(tmp_path, text, told):
    path = tmp_path / "sample.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        documents.read(path, Sample)
    assert str(caught.value).startswith(f"{path}: {told}")


def test_a_mark_at_the_start_of_the_file_is_passed_over(tmp_path):
    assert read(tmp_path, "\ufeffname: y\n").name == "y"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"),
        ("# nothing but a remark\n", "is empty"),
        ("hello", "must hold keys and values, holds 'hello'"),
        ("- 1\n- 2\n", "must hold keys and values, holds [1, 2]"),
        ("name: a: b\n", "line 1, column 8: mapping values are not allowed in this context"),
        ("part: {size_mm: 1\n", "line 2, column 1: while parsing a flow mapping, did not find"),
        ("name: a\nratio: 1\nname: b\n", "line 3, column 1: key 'name' is given twice"),
        ("part:\n  count: 1\n  count: 1\n", "line 3, column 3: key 'count' is given twice"),
        ("name: a\n---\nname: b\n", "line 2, column 1: expected a single document"),
        ("name: !!python/name:os.system\n", "line 1, column 7: tags such as tag:yaml.org,2002:pyt"),
        ("? [a]\n: 1\n", "line 1, column 3: a key must be text or a number"),
        ("part: *a\n", "line 1, column 7: nothing whole is named a"),
        ("part: &a {count: *a}\n", "line 1, column 18: nothing whole is named a"),
        ("<<: [1]\n", "line 1, column 7: << must name keys and values"),
        ("ratio: 0b1\n", "ratio: must be a number, without its unit, got '0b1'"),
        ("ratio: 1:30\n", "ratio: must be a number, without its unit, got '1:30'"),
        ("ratio: 1_000\n", "ratio: must be a number, without its unit, got '1_000'"),
        ("sharp: yes\n", "sharp: must be true or false, got 'yes'"),
        ("sharp: off\n", "sharp: must be true or false, got 'off'"),
        ("name: \0\n", "is not YAML"),
        ("name: 7\n", "name: must be text, got 7"),
        ("name: null\n", "name: must be text, got null"),
        ("ratio: 5 mm\n", "ratio: must be a number, without its unit, got '5 mm'"),
        ("ratio: true\n", "ratio: must be a number, without its unit, got true"),
        ("ratio: .nan\n", "ratio: must be finite, got .nan"),
        ("ratio: -.inf\n", "ratio: must be finite, got -.inf"),
        ("numbers: [1, .inf]\n", "numbers.1: must be finite, got .inf"),
        ("numbers: 1\n", "numbers: must be a list, got 1"),
        ("sharp: 1\n", "sharp: must be true or false, got 1"),
        ("part: 3\n", "part: must hold keys and values, got 3"),
        ("part: {}\n", "part.size_mm: is missing"),
        ("part: {size_mm: 1, count: 1.5}\n", "part.count: must be a whole number, got 1.5"),
        ("part: {size_mm: 1, size_cm: 1}\n", "part.size_cm: unknown key; known here: count, size"),
        (
            "parts: [{size_mm: 1, colour: red}]\n",
            "parts.0.colour: unknown key; known here: count, size_mm",
        ),
        ("colour: red\n", "colour: unknown key; known here: name, numbers, part, parts, ratio, sh"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path, text, told):
    message = refusal(tmp_path, text)
    assert message.startswith(told)
    assert "\n" not in message


def test_all_faults_are_told_at_once_one_a_line(tmp_path):
    assert refusal(tmp_path, "name: 1\npart: {count: x}\n").split("\n") == [
        "3 faults",
        "name: must be text, got 1",
        "part.size_mm: is missing",
        "part.count: must be a whole number, got 'x'",
    ]


def test_a_long_value_is_cut_short(tmp_path):
    assert refusal(tmp_path, f"ratio: {'x' * 500}\n").endswith("xxx...")


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "sample.yaml"
    path.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match=r"sample\.yaml: is not text in UTF-8"):
        documents.read(path, Sample)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: cannot be read: No such file"):
        documents.read(tmp_path / "none.yaml", Sample)
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        documents.read(tmp_path, Sample)


class Wheel(Document):
    renamed: ClassVar = {"gap_mm": "clearance_mm", "speed": "speed_mm_s"}

    clearance_mm: float
    speed_mm_s: float = 1.0


class Cell(Document):
    wheels: list[Wheel] = []  # noqa: RUF012, pydantic copies it


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("wheels: [{gap_mm: 3}]\n", "wheels.0.gap_mm: was renamed, write clearance_mm"),
        (
            "wheels: [{clearance_mm: 3, speed: 2}]\n",
            "wheels.0.speed: was renamed, write speed_mm_s",
        ),
        (
            "wheels: [{gap_mm: 3, clearance_mm: 3}]\n",
            "wheels.0.gap_mm: was renamed, write clearance_mm",
        ),
        ("gap_mm: 3\n", "gap_mm: unknown key; known here: wheels"),
        ("wheels: [{speed_mm_s: 3}]\n", "wheels.0.clearance_mm: is missing"),
    ],
)
def test_a_key_of_an_earlier_version_is_told_its_new_name(tmp_path, text, told):
    path = tmp_path / "sample.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        documents.read(path, Cell)
    assert caught.value.message == told
