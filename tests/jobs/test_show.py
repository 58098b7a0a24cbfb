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
        "1 C position: BASE, tool 0",
        "1 C position: PULSE, tool 0",
        "1 C position: USER, tool 0",
        "1 MOVJ, VJ 50",
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


def shown(text, encoding="ascii"):
    return describe_file("A.JBI", text.replace("\n", "\r\n").encode(encoding), ROBOT)


def test_what_no_controller_would_take_is_told():
    assert not [line for line in shown(JOB) if "caution" in line]
    text = JOB.replace("NPOS 3,", "NPOS 4,").replace("'HERE WE GO", "'" + 33 * "X")
    cautions = [line for line in shown(text) if "caution" in line]
    assert [caution.partition(": ")[2] for caution in cautions] == [
        "///NPOS is 4,0,0,0,0,0, there are 3,0,0,0,0,0",
        "line 23: comment has 33 characters, NX100 takes 32: '" + 33 * "X" + "'",
    ]


def test_job_is_held_against_the_controller_it_fits_best():
    text = written().replace("\r\n", "\n").replace("NOP\n", 'NOP\nSKILLSND "X"\n')
    assert not [line for line in shown(text) if "caution" in line]  # known on DX100 alone
    broken = [line for line in shown(text.replace("VJ=", "VJ=2000")) if "caution" in line]
    assert all(line.startswith("caution, on DX100: line ") for line in broken[:10])
    assert broken[10].endswith("more of this kind")


@pytest.mark.parametrize(
    ("encoding", "remark", "named"),
    [
        ("latin-1", "Gr\u00f6\u00dfe \u00e4ndern", "Latin-1"),
        ("latin-1", "45\u00b0", "Latin-1"),
        ("cp932", "\u7814\u524a\u958b\u59cb", "Shift-JIS"),
        ("cp932", "\uff8d\uff9e\uff99\uff84", "Shift-JIS"),
        ("utf-8", "Gr\u00f6\u00dfe", "UTF-8"),
    ],
)
def test_code_page_is_found_by_trial_and_said(encoding, remark, named):
    lines = shown(JOB.replace("HERE WE GO", remark), encoding)
    assert f"text in {named}, found by trial; controllers need ASCII" in lines
    assert any("line 23: must be printable ASCII" in line for line in lines)
    assert any(line.endswith(f"  '{remark}") for line in lines)


ALL_KINDS = (
    "/JOB\n//NAME KINDS\n//POS\n///NPOS 1,1,1,2,1,1\n///TOOL 0\n///POSTYPE PULSE\n///PULSE\n"
    "C00000=1300,0,0,0,-58800,0\nBC00000=700\nEC00000=-389729,12\nP00001=0,1900,0,0,0,0\n"
    "P00002=0,0,0,0,0,0,5\nBP00003=-42\nEX00004=157730\n//ARGINFO\n///ARGTYPE B,,,\n///COMMENT\n"
    "HEIGHT\n\n\n//ALIAS\nD010  V_MOVE\n///LVARS 1,0,0,0,0,0,0,0\n"
    "//INST\n///DATE 2024/03/05 07:09\n///ATTR SC,RW\n///GROUP1 RB1,BS1\n///GROUP2 ST1\nNOP\n"
    "MOVJ C00000 BC00000 VJ=100.0  +MOVJ EC00000 VJ=50\nTCPON TL#(1)\nMOVL P001 BP003 V=V_MOVE\n"
    "TCPOF\nIFTHENEXP IN#(1)=ON ANDEXP B001>3 OREXP IN#(2)=OFF\n\tMOVJ P002 VJ=5.00\nENDIF\n"
    "MOVJ EX004 VJ=5.00\nMOVJ P077 VJ=5.00\nEND\n"
)


def test_job_with_all_that_real_ones_have_is_read_and_shown_without_a_fault():
    lines = shown(ALL_KINDS)
    text = "\n".join(lines)
    assert "caution" not in text
    assert "alias: D010 V_MOVE" in lines
    for where in (
        "       C00000 angles S 1.000 L 0.000 U 0.000 R 0.000 B -60.000 T 0.000",
        "       BC00000 700 pulses",
        "       EC00000 -389729 12 pulses",
        "       P00001 angles S 0.000 L 1.000 U",
        "       BP00003 -42 pulses",
        "       P00002 0 0 0 0 0 0 5 pulses",
        "       EX00004 157730 pulses",
        "       P077 is not in the file, the controller has it",
    ):
        assert where in text, where


def test_job_without_postype_is_in_pulses_all_the_same():
    text = JOB.replace("///POSTYPE PULSE\n///PULSE\n", "")
    assert parse(text).positions[0].coordinates == "PULSE"
    alone = ALL_KINDS.replace("///POSTYPE PULSE\n///PULSE\n", "")
    lines = shown(alone)
    assert "no ///POSTYPE: whole numbers are taken for pulses" in lines
    assert not [line for line in lines if "caution" in line]
    assert differences_in_meaning(parse(alone), parse(alone), ROBOT) == []


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
    assert differences_in_meaning(parse(JOB), parse(JOB.replace(old, new)), ROBOT) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("=1300,0,", "=1301,0,", "1   24 / 24        S 1.000 -> 1.001 deg"),
        ("=1300,0,", "=2600,0,", "1   24 / 24        S 1.000 -> 2.000 deg"),
        ("V=120.0", "V=121.0", "3   28 / 28        V 120 -> 121"),
        ("MOVL C00001", "MOVJ C00001", "2   27 / 27        move MOVL -> MOVJ"),
        ("C00001=1.000,", "C00001=1.500,", "2   27 / 27        x 1.000 -> 1.500 mm"),
        ("///USER 2", "///USER 3", "2   27 / 27        frame USER 2 -> USER 3"),
        ("///TOOL 0", "///TOOL 1", "every tool 0 is 1 now (3 moves)"),
        ("RCONF 1,0,0", "RCONF 0,0,0", "every RCONF 1,0,0,0,0,0 is 0,0,0,0,0,0 now (2 moves)"),
        ("OT#(12) ON", "OT#(13) ON", "- line 25: DOUT OT#(12) ON"),
        ("CALL JOB:PARK\n", "", "- line 29: CALL JOB:PARK"),
        ("//NAME ONE", "//NAME TWO", "+: job TWO"),
        ("EDTLCK TIMER T=1.00", "TIMER T=2.00", "+ line 31: TIMER T=2"),
        ("MOVL C00002 V=120.0 PL=1\n", "", "3   28 / -         only in the first: move MOVL"),
    ],
)
def test_what_changes_the_meaning_is_told(old, new, told):
    assert old in JOB
    lines = differences_in_meaning(parse(JOB), parse(JOB.replace(old, new)), ROBOT)
    assert any(line.strip().startswith(told) for line in lines), "\n".join(lines)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("B001>3 OREXP IN#(2)=OFF", "IN#(2)=OFF OREXP B001>3"),
        ("IN#(1)=ON ANDEXP B001>3", "B001>3 ANDEXP IN#(1)=ON"),
        ("ANDEXP", "OREXP"),
        ("D010  V_MOVE", "D011 V_MOVE"),
        ("V=V_MOVE", "V=V_FAST"),
    ],
)
def test_conditions_are_compared_in_order_and_aliases_by_what_they_stand_for(old, new):
    assert old in ALL_KINDS
    assert differences_in_meaning(parse(ALL_KINDS), parse(ALL_KINDS.replace(old, new)), ROBOT)
    spaced = ALL_KINDS.replace("D010  V_MOVE", "D010 V_MOVE").replace("ON ANDEXP", "ON  ANDEXP")
    assert differences_in_meaning(parse(ALL_KINDS), parse(spaced), ROBOT) == []


def test_what_changed_in_all_moves_is_one_line():
    text = written()
    moves = len(parse(text).moves)
    slower = re.sub(r"VJ=([0-9.]+)", lambda m: f"VJ={float(m[1]) / 2:.2f}", text)
    lines = differences_in_meaning(parse(text), parse(slower), ROBOT)
    assert lines == [
        f"{moves} moves: {moves} differ",
        f"every VJ is 0.5 times as much ({moves} moves)",
    ]

    def turned(match):
        return f"{match[1]}={int(match[2]) + 2600},"

    shifted = re.sub(r"(C[0-9]{5})=(-?[0-9]+),", turned, text).replace("PL=1", "PL=2")
    lines = differences_in_meaning(parse(text), parse(shifted), ROBOT)
    levels = text.count("PL=1")
    assert lines == [
        f"{moves} moves: {moves} differ",
        f"every PL 1 is 2 now ({levels} moves)",
        "every S: +2.000 deg",
    ]


@given(st.sets(st.integers(0, 26)), st.sets(st.integers(0, 26)))
def test_moves_left_out_of_either_job_are_named_and_no_others(first, second):
    """Of two jobs that lack some moves of a third, each names what the other lacks."""
    steps = [f"MOVJ P{k:03d} VJ=5.00" for k in range(27)]
    head = "/JOB\n//NAME A\n//POS\n///NPOS 0,0,0,27,0,0\n///TOOL 0\n///POSTYPE PULSE\n///PULSE\n"
    head += "".join(f"P{k:05d}={k},0,0,0,0,0\n" for k in range(27)) + "//INST\nNOP\n"

    def job(without):
        kept = [step for k, step in enumerate(steps) if k not in without]
        return parse("\n".join([head + "\n".join(kept), "END", ""]))

    def named(lines, mark):
        return {
            int(found[1]) for line in lines if (found := re.match(rf"{mark}.*MOVJ P(\d+)", line))
        }

    lines = differences_in_meaning(job(first), job(second), ROBOT)
    assert named(lines, "-") == second - first
    assert named(lines, r"\+") == first - second


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
    assert other.exit_code == 1
    assert "20 moves: 1 differ" in other.output and "VJ 5 -> 6" in other.output


@pytest.mark.parametrize(
    ("content", "message"), [(None, "cannot be read"), (b"\x00", "a job begins with /JOB")]
)
def test_show_of_what_is_no_job_is_refused(tmp_path, content, message):
    path = tmp_path / "A.JBI"
    if content is not None:
        path.write_bytes(content)
    done = CliRunner().invoke(main, ["show", str(path)])
    assert done.exit_code == 2 and message in done.output
