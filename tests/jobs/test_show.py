import re

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from opl.cli.commands import main
from opl.errors import InputError
from opl.program.inform import parse, read_jobs, unparse, write_jobs
from opl.program.inform.compare import differences_in_meaning
from opl.program.inform.parse import decode
from opl.program.inform.post import describe_file
from opl.program.inform.summary import describe
from opl.program.moves import plan_moves
from opl.program.profiles import DX200
from opl.program.settings import ProgramSettings
from tests.support.program_samples import DATE, ROBOT, verified_motion

HEAD = "/JOB\n//NAME ONE\n//POS\n///NPOS 3,0,0,0,0,0\n///TOOL 0\n"
POSITIONS = (
    "///POSTYPE PULSE\n///PULSE\nC00000=1300,0,0,0,-58800,0\n"
    "///USER 2\n///POSTYPE USER\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n"
    "C00001=1.000,2.000,3.000,0.0000,90.0000,-90.0000\n"
    "///POSTYPE BASE\nC00002=1200.000,0.000,500.000,180.0000,-30.0000,0.0000\n"
)
STEPS = (
    "//INST\n///DATE 2024/03/05 07:09\n///COMM A JOB\n///ATTR SC,RW,RJ\n////FRAME BASE\n"
    "///GROUP1 RB1\nNOP\n'HERE WE GO\nMOVJ C00000 VJ=50.00 PL=0  //FIRST\nDOUT OT#(12) ON\n"
    "WAIT IN#(3)=ON T=5.00\nMOVL C00001 V=100.0\nMOVL C00002 V=120.0 PL=1\nCALL JOB:PARK\n"
    "COMM DOUT OT#(12) OFF\nEDTLCK TIMER T=1.00\nEND\n"
)
JOB = HEAD + POSITIONS + STEPS


def written():
    program = plan_moves(verified_motion(), "SAMPLE", ROBOT.max_speed)
    return write_jobs(program, ROBOT, ProgramSettings(), DX200, DATE).files["SAMPLE.JBI"]


def test_summary_tells_what_the_job_does():
    lines = describe(parse(JOB), ROBOT)
    summary = lines[: lines.index("")]
    assert summary == [
        "job ONE, 2024/03/05 07:09, group RB1, attributes SC,RW,RJ, frame BASE",
        "comment: A JOB",
        "1 C positions: BASE, tool 0",
        "1 C positions: PULSE, tool 0",
        "1 C positions: USER, tool 0",
        "1 MOVJ, VJ 50 to 50",
        "2 MOVL, V 100 to 120",
        "calls: PARK",
        "signals: OT#(12), IN#(3)",
        "switched off: line 30",
    ]


def test_positions_are_shown_as_angles_and_poses():
    text = "\n".join(describe(parse(JOB), ROBOT))
    assert "C00000 angles S 1.000 L 0.000 U 0.000 R 0.000 B -60.000 T 0.000" in text
    x, y = (float(re.search(rf"C00000 flange .*\b{axis} (\S+)", text)[1]) for axis in "xy")
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(1.0, abs=1e-4)
    assert "C00001 in USER 2: x 1.000 y 2.000 z 3.000 rx 0.0000 ry 90.0000 rz -90.0000" in text
    assert "C00001 angles" not in text  # nobody but the controller knows its user frames
    assert "C00002 in BASE: x 1200.000" in text and "C00002 angles S 0.000 L" in text


def test_wrong_count_of_positions_is_told():
    lines = describe(parse(JOB.replace("NPOS 3,", "NPOS 4,")), ROBOT)
    assert "caution: ///NPOS is 4,0,0,0,0,0, there are 3,0,0,0,0,0" in lines


def test_job_written_by_opl_is_shown_configuration_by_configuration():
    shown = "\n".join(describe(parse(written()), ROBOT))
    rows = re.findall(r"angles S (\S+) L (\S+) U (\S+) R (\S+) B (\S+) T (\S+)", shown)
    q = plan_moves(verified_motion(), "A", ROBOT.max_speed).moves
    wanted = np.rad2deg([move.q for move in q])
    np.testing.assert_allclose(np.array(rows, dtype=float), wanted, atol=2e-3)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("2024/03/05 07:09", "1999/01/01 00:00"),
        ("'HERE WE GO\n", ""),
        ("  //FIRST", ""),
        ("VJ=50.00 PL=0", "PL=0 VJ=50.0"),
        ("///RCONF 1,0,0,0,0,0,0,0", "///RCONF 1,0,0,0,0,0"),
        ("COMM DOUT OT#(12) OFF\n", ""),
        ("///COMM A JOB\n", ""),
        ("C00002", "C00007"),
        ("=1300,0,", "=1300, 0,"),
    ],
)
def test_what_does_not_change_the_meaning_is_no_difference(old, new):
    assert old in JOB
    assert differences_in_meaning(parse(JOB), parse(JOB.replace(old, new))) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("=1300,0,", "=1301,0,", ["- line 23: MOVJ to 1300,", "+ line 23: MOVJ to 1301,"]),
        ("V=120.0", "V=121.0", ["- line 27: MOVL to 1200,", "+ line 27: MOVL to 1200,"]),
        ("OT#(12) ON", "OT#(13) ON", ["- line 24: DOUT OT#(12)", "+ line 24: DOUT OT#(13)"]),
        ("CALL JOB:PARK\n", "", ["- line 28: CALL JOB:PARK"]),
        ("///USER 2", "///USER 3", ["- line 26: MOVL to 1,2,3", "+ line 26: MOVL to 1,2,3"]),
        ("///TOOL 0", "///TOOL 1", ["- line 23: MOVJ", "- line 24", "- line 26", "+ line 23"]),
        ("//NAME ONE", "//NAME TWO", ["- name: ONE", "+ name: TWO"]),
        ("EDTLCK TIMER T=1.00", "TIMER T=2.00", ["- line 30: TIMER T=1", "+ line 30: TIMER T=2"]),
    ],
)
def test_what_changes_the_meaning_is_told(old, new, told):
    assert old in JOB
    lines = differences_in_meaning(parse(JOB), parse(JOB.replace(old, new)))
    for part in told[:1] + told[-1:]:
        assert any(line.startswith(part[:8]) for line in lines), lines
    assert lines


def test_locked_moves_are_moves():
    job = parse(JOB.replace("MOVL C00001", "EDTLCK MOVL C00001"))
    assert [move.word for move in job.moves] == ["MOVJ", "MOVL", "MOVL"]
    assert not parse(JOB.replace("'HERE", "*MOVE1\n'HERE")).instructions[0].moves


def test_file_of_several_jobs_is_read_one_by_one():
    first, second = read_jobs(JOB + JOB.replace("ONE", "TWO"))
    assert (first.name, second.name, len(second.positions)) == ("ONE", "TWO", 3)
    with pytest.raises(InputError, match=r"A.JBI \(2\): line .*: the job ends without END"):
        read_jobs(JOB + JOB.replace("END\n", ""), "A.JBI")


@pytest.mark.parametrize("encoding", ["ascii", "utf-8", "utf-8-sig", "cp932", "latin-1"])
def test_bytes_of_any_encoding_come_back(encoding):
    remark = {"ascii": "GO", "latin-1": "gr\u00f6\u00dfe\u00ff"}.get(encoding, "\u958b\u59cb")
    data = JOB.replace("HERE WE GO", remark).replace("\n", "\r\n").encode(encoding)
    text, found = decode(data)
    assert unparse(parse(text)).encode(found) == data
    assert any("job ONE" in line for line in describe_file("A.JBI", data, ROBOT))


@given(st.binary())
def test_any_bytes_have_a_text_that_gives_them_again(data):
    text, encoding = decode(data)
    assert text.encode(encoding) == data


def test_job_of_the_first_generation_is_read():
    text = (
        "/JOB\n//NAME 1\n//POS\n///NPOS 2,0,0,0\n///TOOL 0\n///RECTAN\n///RCONF 1,0,0,0,0\n"
        "C000=1.5,.5,-3,0.00,90.00,0.00\nC001=1,2,3,0.00,90.00,0.00\n//INST\n"
        "///DATE 1996/01/01 00:00\n///ATTR 0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n///FRAME BASE\n"
        "NOP  //START\nMOVJ C000 VJ=50.00\nMOVL C001 V=46.0 CONT\nEND\n\x1a"
    )
    job = parse(text)
    assert [position.values[1] for position in job.positions] == [0.5, 2.0]
    assert job.moves[1].operands == ("C001", "CONT")
    assert unparse(job) == text.replace("\n", "\r\n")


# commands


@pytest.fixture
def files(tmp_path):
    one, other = tmp_path / "ONE.JBI", tmp_path / "OTHER.JBI"
    one.write_text(written())
    other.write_text(written().replace("VJ=5.00", "VJ=6.00"))
    return str(one), str(other)


def test_show_says_whose_robot_the_positions_are_read_for(files):
    done = CliRunner().invoke(main, ["show", files[0]])
    assert done.exit_code == 0
    assert "Motoman MH24, whose pulse ratios of R, B, T are not verified" in done.output
    assert "job SAMPLE, 2024/03/05 07:09" in done.output


def test_diff_ends_with_a_status_that_scripts_can_use(files):
    same = CliRunner().invoke(main, ["show", files[0], "--diff", files[0]])
    assert (same.exit_code, same.output) == (0, "both do the same\n")
    other = CliRunner().invoke(main, ["show", files[0], "--diff", files[1]])
    assert other.exit_code == 1 and other.output.count("\n") == 2


@pytest.mark.parametrize(
    ("content", "message"), [(None, "cannot be read"), (b"\x00", "a job begins with /JOB")]
)
def test_show_of_what_is_no_job_is_refused(tmp_path, content, message):
    path = tmp_path / "A.JBI"
    if content is not None:
        path.write_bytes(content)
    done = CliRunner().invoke(main, ["show", str(path)])
    assert done.exit_code == 2 and message in done.output
