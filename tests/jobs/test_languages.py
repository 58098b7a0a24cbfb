"""Programs of every language are read back and proven, and faults put into their files are found.

A short row of the V part, on an arm of the language's maker and from a home near the wheel. Faults
in INFORM jobs are in test_verify.py and test_faults.py.
"""

import csv
import json
import re
import shutil
from dataclasses import dataclass

import numpy as np
import pytest

from opl.geometry.toolpath import CutterPoints
from opl.job.load import load_job
from opl.job.values import Job
from opl.program.posts import find_post
from opl.proof.prove import prove
from opl.run.surfacing import cut_surface
from tests.support.corners import needed
from tests.support.example_post import install_example_post
from tests.support.jobs import GONE, opl, write_job

pytestmark = pytest.mark.usefixtures("no_pictures")

SHORT = {
    "search.method": "recursive",
    "passes.end_margin_mm": 70,
    "program.accept_unverified_pulses": GONE,
}


@dataclass(frozen=True)
class Language:
    """How a language writes what is tampered with.

    Attributes:
        robot: An arm of its maker.
        home: Joint positions in [deg] near the wheel.
        target: The numbers of a target, the first group.
        speed: The number of a speed or time, the first group.
        fast: What it becomes when the move is made too fast.
        first: The speed of the first move, and a faster one.
        stop: The end of a move that stops, and one that does not.
        dropped: Finds the whole move to a target, given the number of the move from 1.
        tool: The tool as written, and another one.
        foreign: A call of a program that the job does not call, and a line nobody knows.
        wait: A line that lets the robot stand still.
        line: A whole line, for a FANUC program with its number.
    """

    robot: str
    home: tuple
    target: str
    speed: str
    fast: str
    first: tuple
    stop: tuple
    dropped: str
    tool: tuple
    foreign: tuple
    wait: str
    line: str = "{}\r\n"


LANGUAGES = {
    "RAPID": Language(
        robot="irb2600",
        home=(31, -15, 49, 44, -44, -13),
        target=r"MoveAbsJ \[\[([^]]*)\]",
        speed=r"\\T:=([0-9.]+)",
        fast="0.0100",
        first=("v50,", "v500,"),
        stop=(" fine,", " z50,"),
        dropped=r"MoveAbsJ [^\r]*\r\n",
        tool=(", tool0;", ", tool1;"),
        foreign=("OTHER;", "SingArea\\Wrist;"),
        wait="WaitTime 2.00;",
    ),
    "KRL": Language(
        robot="kr16",
        home=(146, -115, -93, 128, -43, 22),
        target=r"PTP \{([^}]*)\}",
        speed=r"BAS\(#VEL_PTP, ([0-9]+)\)",
        fast="100",
        first=("BAS(#VEL_PTP, 5)", "BAS(#VEL_PTP, 50)"),
        stop=("}\r\n", "} C_PTP\r\n"),
        dropped=r"PTP \{[^\r]*\r\n",
        tool=("$TOOL = $NULLFRAME", "$TOOL = TOOL_DATA[2]"),
        foreign=("OTHER()", "$BASE = BASE_DATA[1]"),
        wait="WAIT SEC 2.00",
    ),
    "FANUC": Language(
        robot="m20ia",
        home=(-148, -6, 188, -65, -34, 38),
        target=r"(J1= [^}]*?) deg\r\n\};",
        speed=r" ([0-9]+)msec ",
        fast="10",
        first=(" 5% ", " 50% "),
        stop=("FINE", "CNT50"),
        dropped=r" *\d+:[JL] P\[{}\] [^\r]*\r\n",
        tool=("UTOOL_NUM=0", "UTOOL_NUM=1"),
        foreign=("  CALL OTHER", "  OFFSET CONDITION PR[1]"),
        wait="  WAIT 2.00(sec)",
        line="   1:{} ;\r\n",
    ),
    "URSCRIPT": Language(
        robot="ur10e",
        home=(-136, -95, -102, -163, -58, -68),
        target=r"movej\(\[([^]]*)\]",
        speed=r"t=([0-9.]+)",
        fast="0.0100",
        first=("v=0.1", "v=1.1"),
        stop=("r=0.00000", "r=0.05000"),
        dropped=r"  movej[^\n]*\n",
        tool=("set_tcp(p[0.000000,", "set_tcp(p[0.000100,"),
        foreign=("OTHER()", "stopj(2.0)"),
        wait="sleep(2.00)",
        line="{}\n",
    ),
}


@dataclass(frozen=True, eq=False)
class Written:
    """A program as opl run wrote it.

    Attributes:
        language: Its language.
        controller: Its name.
        job: Its job.
        points: The cutter points.
        file: The program, with result.json beside it.
        text: What stands in it.
        move: Number of the move of the pass that is needed most, counted from 0.
    """

    language: Language
    controller: str
    job: Job
    points: CutterPoints
    file: object
    text: str
    move: int

    def spans(self, pattern, text=None):
        """Return where the first group of a pattern stands, all of them in order."""
        return [found.span(1) for found in re.finditer(pattern, text or self.text)]

    def target(self, number):
        """Return the numbers of the target of a move, as text."""
        start, end = self.spans(self.language.target)[number]
        return self.text[start:end]

    def with_target(self, number, target, text=None):
        """Return the text with another target of a move."""
        text = text or self.text
        start, end = self.spans(self.language.target, text)[number]
        return text[:start] + target + text[end:]

    def with_line(self, line):
        """Return the text with a line after the move in the middle."""
        end = self.moves(self.text)[self.move].end()
        return self.text[:end] + self.language.line.format(line) + self.text[end:]

    def moves(self, text):
        """Return the matches of whole moves in order."""
        pattern = self.language.dropped.replace("{}", r"\d+")
        return list(re.finditer(pattern, text))

    def proof(self, text):
        """Prove a text as the program of the job."""
        assert text != self.text
        return prove(self.job, self.points, {self.file.name: text.encode("ascii")})


@pytest.fixture(scope="module", params=LANGUAGES)
def written(request, tmp_path_factory):
    """Plan and write the short program of a language."""
    language = LANGUAGES[request.param]
    home = tmp_path_factory.mktemp("languages") / request.param
    changes = {
        **SHORT,
        "robot": language.robot,
        "process.home_deg": list(language.home),
        "program.controller": request.param,
        "program.motion": "joint",
    }
    if request.param == "KRL":  # whole percents are too coarse for moves as slow as the others'
        changes["process.feed_mm_s"] = 60.0
    path = write_job(home, changes)
    job = load_job(path)
    ended = opl("run", path, "--out", home / "out")
    assert ended.status == 0, ended.err
    file = home / "out" / (job.name + find_post(request.param).reader.suffix)
    points = cut_surface(job).points
    lines = (home / "out" / f"{job.name}.csv").read_text().splitlines()
    rows = [row for row in csv.DictReader(lines) if row["speed"]]
    labels = [float(row["cutter_point"] or "nan") for row in rows]
    text = file.read_bytes().decode("ascii")
    result = json.loads((home / "out" / "result.json").read_text())
    assert result["program"]["read_back"] is True
    assert len(labels) == result["program"]["moves"]
    names = job.cell.robot.joint_names
    q = np.array([[float(row[f"{name}_deg"]) for name in names] for row in rows])
    move = needed(q, np.flatnonzero(~np.isnan(labels))[2:-2])
    return Written(language, request.param, job, points, file, text, move)


def refuses(proof, *words):
    """Assert that a program is not proven for a reason that holds these words."""
    assert not proof.proven
    found = [str(finding) for finding in proof.findings]
    assert any(all(word in line for word in words) for line in found), found
    return True


def digit_changed(text, at, by):
    """Return a text with one of its digits changed."""
    assert text[at].isdigit()
    return text[:at] + str((int(text[at]) + by) % 10) + text[at + 1 :]


def test_what_is_read_back_is_what_was_proven(written):
    result = json.loads((written.file.parent / "result.json").read_text())
    file = result["verification"]["file"]
    assert file["proven"] is True and file["replayed"] is False
    assert file["largest_difference_mm"] == 0.0 and 0.0 < file["largest_rounding_mm"] < 0.05
    assert file["postures"] == result["program"]["moves"]
    ended = opl("verify", written.job.source.label, written.file, "--json")
    assert ended.status == 0, ended.err
    proof = json.loads(ended.out)
    assert proof["proven"] is True and proof["as_written"] is True
    assert proof["cutter_points_ground"] == len(written.points) > 8
    assert proof["duration_s"] == pytest.approx(result["program"]["duration_s"], rel=0.02)


def test_one_digit_is_found(written):
    """The first digit behind the point of an angle, or the second of radians."""
    target = written.target(written.move)
    at = target.index(".") + (2 if written.controller == "URSCRIPT" else 1)
    text = written.with_target(written.move, digit_changed(target, at, 5))
    assert refuses(written.proof(text), "contact at pass 1, cutter point")


def test_the_last_digit_is_found_beside_the_result_of_the_run(written, tmp_path):
    shutil.copy(written.file.parent / "result.json", tmp_path)
    target = written.target(written.move)
    at = max(k for k, sign in enumerate(target) if sign.isdigit())
    by = -1 if target[at] == "9" else 1
    file = tmp_path / written.file.name
    text = written.with_target(written.move, digit_changed(target, at, by))
    file.write_bytes(text.encode("ascii"))
    ended = opl("verify", written.job.source.label, file)
    assert ended.status == 4
    assert "not the bytes that opl run proved" in ended.err
    assert len(ended.err.splitlines()) == 2  # nothing else is wrong


def test_two_points_exchanged_are_found(written):
    here, there = written.move, written.move + 1
    text = written.with_target(here, written.target(there))
    proof = written.proof(written.with_target(there, written.target(here), text))
    assert refuses(proof, "at pass 1, cutter point")


def test_a_dropped_point_is_found(written):
    found = written.moves(written.text)[written.move]
    proof = written.proof(written.text[: found.start()] + written.text[found.end() :])
    # half a millimetre is allowed in this job: where the line past it is nearer, its time tells
    assert refuses(proof, "at pass 1, cutter point")


def test_a_move_at_full_speed_is_found(written):
    # the first move has no time, but KRL sets the speed of every move alike
    number = written.move - (written.controller != "KRL")
    start, end = written.spans(written.language.speed)[number]
    text = written.text[:start] + written.language.fast + written.text[end:]
    proof = written.proof(text)
    assert refuses(proof, "speed at pass 1, cutter point", "times the feed")


def test_another_tool_is_found(written):
    proof = written.proof(written.text.replace(*written.language.tool, 1))
    assert refuses(proof, "program at", written.file.name, "tool")


def test_a_fast_first_move_a_missing_stop_and_a_wait_on_the_wheel_are_found(written):
    text = written.with_line(written.language.wait).replace(*written.language.first, 1)
    begin = written.moves(text)[2].start()  # a stop after the first moves
    text = text[:begin] + text[begin:].replace(*written.language.stop, 1)
    proof = written.proof(text)
    assert refuses(proof, "speed at", "line", "a program begins with")
    assert refuses(proof, "level at", "at most, got")
    assert refuses(proof, "wait at pass 1, cutter point", "stands still")


def test_what_nobody_can_follow_is_found(written):
    call, unknown = written.language.foreign
    proof = written.proof(written.with_line(call))
    assert refuses(proof, "program at", "calls OTHER, which the job does not call")
    assert refuses(written.proof(written.with_line(unknown)), "program at", "nobody can tell")
    assert refuses(written.proof(written.text.rstrip()[:-3]), "program at", "does not end")


def test_other_spaces_letters_and_comments_change_nothing(written):
    sign = {"RAPID": "!", "KRL": ";", "FANUC": "!", "URSCRIPT": "#"}[written.controller]
    text = written.with_line(f"{sign} a remark")
    if written.controller in ("RAPID", "KRL"):
        text = text.lower()
    if written.controller != "FANUC":
        text = text.replace(",", " ,  ")
    proof = written.proof(text)
    assert proof.proven, proof.findings


def test_it_is_shown_in_words_and_compared_by_meaning(written, tmp_path):
    robot = written.language.robot
    shown = opl("show", written.file, "--robot", robot)
    assert shown.status == 0 and f"program {written.job.name}" in shown.out
    first = next(line for line in shown.out.splitlines() if "angles" in line)
    assert all(f" {angle:.3f}" in first for angle in written.language.home)
    same = opl("show", written.file, "--diff", written.file)
    assert (same.status, same.out) == (0, "both do the same\n")
    other = tmp_path / written.file.name
    start, end = written.spans(written.language.speed)[written.move]
    text = written.text[:start] + written.language.fast + written.text[end:]
    other.write_bytes(text.encode("ascii"))
    changed = opl("show", written.file, "--diff", other)
    # KRL sets its speeds in lines of their own
    found = [line for line in changed.out.splitlines() if " -> " in line or line.startswith("+")]
    assert changed.status == 1 and [written.language.fast in line for line in found] == [True]


def test_a_file_of_another_language_is_refused(written, tmp_path):
    other = tmp_path / "V_SHAPE.JBI"
    other.write_bytes(written.file.read_bytes())
    ended = opl("verify", written.job.source.label, other)
    assert ended.status == 2 and "program.controller" in ended.err
    ended = opl("show", written.file, "--diff", other)
    assert ended.status == 2 and "is not of the language" in ended.err


def test_a_program_without_a_reader_is_written_and_not_read_back(tmp_path, monkeypatch):
    install_example_post(tmp_path, monkeypatch)
    changes = {**SHORT, "program.controller": "OUR_CELL", "robot": "gp25"}
    job = write_job(tmp_path / "job", changes)
    monkeypatch.setattr("opl.run.stages.draw_charts", lambda *_: {})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "written, not read back" in " ".join(ended.out.split())
    assert "read back from" not in ended.out
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["verification"]["file"] is None and result["program"]["read_back"] is False
    ended = opl("verify", job, tmp_path / "out" / "V_SHAPE.txt")
    assert ended.status == 2 and "our own cell are written, not read back" in ended.err
