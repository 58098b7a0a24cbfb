"""Readers of every file format on files with anything in them: an answer or a refusal in words.

Hypothesis takes files that are right and deletes, doubles, exchanges and rewrites what stands in
them, which comes farther into a reader than bytes that are no file at all. Each example has limited
computing time, so a reader that does not end fails.
"""

import copy
import re
import signal
from contextlib import contextmanager
from functools import cache

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from opl.cell.robot_loading import load_robot
from opl.cell.urdf_arm import arm_of_urdf
from opl.cell.urdf_tree import UrdfTree
from opl.errors import InputError, OplError
from opl.files import yaml_text
from opl.files.resources import folder
from opl.geometry.machined import load_faces
from opl.job.cell import load_cell
from opl.job.load import load_job
from opl.program.parameters import read_parameters
from opl.program.posts import find_post, known_posts
from opl.program.settings import ProgramSettings
from opl.proof.digest import digests_in, read_result
from tests.attacks.scripts import LANGUAGES
from tests.conftest import GOLDEN
from tests.support.jobs import V_SHAPE, document
from tests.units.test_parameters import GP88, YRC1000, parameter_text

MOST_COMPUTING = 10.0  # [s] for one file
SAMPLES = {
    "YRC1000": ("mh24", "YRC1000/user/SAMPLE.JBI", "YRC1000/user/UFRAME.CND"),
    "DX200": ("mh24", "DX200/joint/SAMPLE.JBI"),
    "RAPID": ("irb2600", "RAPID/straight/SAMPLE.mod"),
    "KRL": ("kr16", "KRL/straight/SAMPLE.src"),
    "FANUC": ("m20ia", "FANUC/straight/SAMPLE.LS"),
    "URSCRIPT": ("ur10e", "URSCRIPT/straight/SAMPLE.script"),
}
TOKEN = re.compile(r"[A-Za-z_$]+|[-+]?[0-9]+(?:\.[0-9]*)?|\s+|.", re.DOTALL)
HOSTILE = (
    "", "0", "-0", "-", "+", ".", "1e999", "-1e-999", "nan", "NaN", "inf", "9" * 18, "9" * 400,
    "0.0000000000000000001", "1.2.3", "\u0663", "\u00b2", "\u00bd", "\uff11", "(", ")", "[", "]",
    "{", "}", "((((((((", '"', "'", ";", ":=", "=", ",", ",,", "#", "!", "/", "\\", "\0", "\t",
    "\x1a", "\r", "\n", "\u2028", "\ufeff", "\ud800", "%s", "{0}", "None", "END", "NOP", "def",
)  # fmt: skip
SPOILING = ("word", "word", "word", "line", "out", "twice", "swap", "cut")
LOTS = settings(
    max_examples=400, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True
)


@contextmanager
def ends():
    """Fail if what is done takes more computing than a file may."""

    def late(number, frame):
        raise AssertionError("does not end")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, MOST_COMPUTING)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@cache
def tokens_of(text):
    return TOKEN.findall(text)


@st.composite
def spoiled(draw, text, vocabulary=()):
    """Texts with lines and words of a right one deleted, doubled, exchanged and replaced."""
    lines = text.splitlines(keepends=True)
    for _ in range(draw(st.integers(1, 6))):
        k = draw(st.integers(0, len(lines) - 1))
        kind = draw(
            st.sampled_from(["word", "word", "word", "line", "out", "twice", "swap", "cut"])
        )
        other = draw(st.integers(0, len(lines) - 1))
        if kind == "out" and len(lines) > 1:
            del lines[k]
        elif kind == "twice":
            lines.insert(other, lines[k])
        elif kind == "swap":
            lines[k], lines[other] = lines[other], lines[k]
        elif kind == "cut":
            lines[k] = lines[k][: draw(st.integers(0, len(lines[k])))]
        elif kind == "line":
            new = st.sampled_from([*vocabulary, *HOSTILE]) | st.text(max_size=30)
            lines.insert(k, draw(new) + draw(st.sampled_from(["\r\n", "\n", "\r", " "])))
        else:
            words = tokens_of(lines[k])
            if words:
                new = st.sampled_from([*HOSTILE, *tokens_of(lines[other])]) | st.text(max_size=8)
                at = draw(st.integers(0, len(words) - 1))
                lines[k] = "".join([*words[:at], draw(new), *words[at + 1 :]])
    return "".join(lines)


def as_bytes(text):
    return text.encode("utf-8", "surrogatepass")


@pytest.mark.parametrize("controller", SAMPLES)
def test_programs(controller):
    name, *files = SAMPLES[controller]
    robot, reader = load_robot(name), find_post(controller).reader
    texts = {file.split("/")[-1]: (GOLDEN / file).read_bytes().decode("ascii") for file in files}
    words = LANGUAGES[controller if controller in LANGUAGES else "DX200"].words.values()

    @settings(LOTS, max_examples=120)  # each is read three times
    @given(st.sampled_from(sorted(texts)), st.data())
    def run(which, data):
        right = {file: text.encode("ascii") for file, text in texts.items()}
        text = data.draw(spoiled(texts[which], tuple(words)))
        wrong = {**right, which: as_bytes(text)}
        main = files[0].split("/")[-1]
        one, other = (main, right[main]), (main, wrong[main])
        with ends():
            for function, *arguments in (
                (reader.read, wrong, robot, ProgramSettings(controller)),
                (reader.describe, *other, robot),
                (reader.differences, one, other, robot),
            ):
                try:
                    found = function(*arguments)
                except OplError as error:
                    assert str(error)
                else:
                    assert found is not None

    run()


PARAMETERS = parameter_text(YRC1000, GP88, GP88, zones=range(10, 18))


@LOTS
@given(spoiled(PARAMETERS))
def test_parameter_files(text):
    with ends():
        try:
            for group in read_parameters(text, "ALL.PRM"):
                group.axes()
        except InputError as error:
            assert str(error).startswith(("ALL.PRM", "///"))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=12)
    | st.sampled_from([1e23, 1e-300, 10**400, "surface.json", "mm", "mh24", "../..", "a\0b"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.text(max_size=6) | st.integers() | st.none(), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


def paths(value, path=()):
    if path:
        yield path
    if isinstance(value, (dict, list)):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield from paths(value[key], (*path, key))


@st.composite
def changed(draw, content, least=1):
    """Keys and values with some replaced, dropped or added."""
    content = copy.deepcopy(content)
    for _ in range(draw(st.integers(least, 3))):
        places = list(paths(content))
        if not places:
            break
        *parents, key = draw(st.sampled_from(places))
        inner = content
        for parent in parents:
            inner = inner[parent]
        kind = draw(st.sampled_from(["value", "value", "value", "scale", "out", "more"]))
        if kind == "out":
            del inner[key]
        elif kind == "more" and isinstance(inner, dict):
            inner[draw(st.text(max_size=8))] = draw(VALUES)
        elif kind == "scale" and isinstance(inner[key], (int, float)):
            inner[key] *= draw(st.sampled_from([-1, 0, 1e-9, 1e-3, 1e3, 1e9, 1e300]))
        else:
            inner[key] = draw(VALUES)
    return content


@LOTS
@given(changed(document()))
def test_jobs(content):
    with ends():
        try:
            load_job(content, folder=V_SHAPE)
        except OplError as error:
            assert str(error)


CELL = {
    "robot": "mh24",
    "wheels": [
        {
            "name": "belt",
            "width_mm": 50,
            "radius_mm": 150,
            "max_roll_deg": 45,
            "pendant": {"xyz_mm": [900, 0, 300], "rx_ry_rz_deg": [0, 90, 0]},
        }
    ],
    "obstacles": [{"name": "post", "box_mm": [60, 60, 400], "at_mm": [800, 235, 320]}],
}


@LOTS
@given(changed(CELL, least=0))
def test_cells(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "cell.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    with ends():
        try:
            load_cell(path)
        except InputError as error:
            assert str(error)


@LOTS
@given(spoiled((V_SHAPE / "job.yaml").read_text(encoding="utf-8")) | st.text(max_size=200))
def test_yaml(text):
    with ends():
        try:
            yaml_text.load(as_bytes(text).decode("utf-8", "replace"))
        except yaml_text.YamlError as error:
            assert str(error)


@LOTS
@given(spoiled('{"job": "V", "program": {"files": ["V.JBI"], "sha256": {"V.JBI": "ab"}}}')
       | st.text(max_size=50))  # fmt: skip
def test_results(text):
    with ends():
        assert isinstance(digests_in(read_result(as_bytes(text))), dict)


URDF = (folder("robots") / "mh24" / "mh24.urdf").read_text(encoding="utf-8")


@LOTS
@given(spoiled(URDF) | st.text(max_size=60))
def test_urdfs(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "arm.urdf"
    path.write_bytes(as_bytes(text))
    with ends():
        try:
            tree = UrdfTree(path)
            tree.base_frame()
            tree.set_base(0.5)
            tree.gather_shapes()
            tree.collect_meshes()
            arm_of_urdf(path)
        except InputError as error:
            assert str(error)


@LOTS
@given(spoiled((V_SHAPE / "surface.json").read_text(encoding="utf-8")))
def test_surfaces(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "surface.json"
    path.write_bytes(as_bytes(text))
    with ends():
        try:
            load_faces(path)
        except InputError as error:
            assert str(error)


def test_readers_are_all_attacked():
    """A language that is added is attacked too."""
    suffixes = {files[0].rpartition(".")[2] for _, *files in SAMPLES.values()}
    for name in known_posts():
        reader = find_post(name).reader
        assert reader is None or reader.suffix.lstrip(".") in suffixes
