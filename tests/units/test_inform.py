import re
from dataclasses import replace
from datetime import datetime
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.errors import InputError, OplError, UnsafeError
from opl.program.inform import TEMPLATE, job_faults, parse, unparse, write_jobs
from opl.program.inform import render as render_part
from opl.program.moves import Move, Program, plan_moves
from opl.program.profiles import DX200
from opl.program.settings import ProgramSettings
from tests.support.program_samples import (
    DATE,
    JOINT_NAMES,
    MAX_SPEED,
    ROBOT,
    SCALE,
    UNVERIFIED,
    verified_motion,
)


def render_jobs(program, robot, date, *, profile=DX200, **settings):
    accepting = ProgramSettings(accepted_pulses=JOINT_NAMES, **settings)
    return dict(write_jobs(program, robot, accepting, profile, date).files)


def render(program, robot, date, **options):
    job, *_ = render_jobs(program, robot, date, **options).values()
    return job


def sample(**options):
    return plan_moves(
        verified_motion(**options), "SAMPLE", MAX_SPEED, ("MADE BY THE TESTS", "CELL 7")
    )


def program_of(configurations, speed=0.1):
    return Program("ANY", moves=tuple(Move(q, speed, True, False, 0) for q in configurations))


def job_text(**changes):
    """A legal job of two moves, one part of it exchanged at a time."""
    parts = {
        "name": "//NAME TWO",
        "npos": "///NPOS 2,0,0,0,0,0",
        "modal": "///TOOL 0\n///POSTYPE PULSE\n///PULSE",
        "positions": "C00000=0,0,0,0,0,0\nC00001=10,-20,30,-40,50,-60",
        "date": "///DATE 2024/03/05 07:09",
        "attr": "///ATTR SC,RW\n///GROUP1 RB1",
        "steps": "MOVJ C00000 VJ=50.00 PL=0\nMOVL C00001 V=100.0 PL=1  //THERE",
        "end": "END\n",
    }
    parts.update(changes)
    order = "/JOB\n{name}\n//POS\n{npos}\n{modal}\n{positions}\n//INST\n{date}\n{attr}\nNOP\n"
    return (order + "{steps}\n{end}").format(**parts).replace("\n", "\r\n")


# the whole job


def test_job_is_the_golden_one(assert_golden):
    (job,) = render_jobs(sample(), UNVERIFIED, DATE).items()
    assert_golden(*job)


def test_split_jobs_are_the_golden_ones(assert_golden):
    small = replace(DX200, step_limit=12)
    for name, text in render_jobs(sample(), UNVERIFIED, DATE, profile=small).items():
        assert_golden(f"split/{name}", text)


def test_same_input_gives_the_same_bytes():
    assert render_jobs(sample(), ROBOT, DATE) == render_jobs(sample(), ROBOT, DATE)


def test_job_is_ascii_of_whole_crlf_lines():
    text = render(sample(), UNVERIFIED, DATE)
    assert text.isascii()
    assert text.replace("\r\n", "").isprintable()
    assert text.startswith("/JOB\r\n//NAME SAMPLE\r\n//POS\r\n///NPOS 20,0,0,0,0,0\r\n")
    assert text.endswith("\r\nEND\r\n")


def test_every_position_is_counted_and_used_once_in_order():
    job = parse(render(sample(), ROBOT, DATE))
    assert job.npos == (len(job.positions), 0, 0, 0, 0, 0)
    labels = [position.label for position in job.positions]
    assert labels == [f"C{n:05d}" for n in range(20)]
    assert [move.operands for move in job.moves] == [(label,) for label in labels]


def test_stops_and_passes_have_their_levels():
    program = sample()
    job = parse(render(program, ROBOT, DATE))
    assert [move.tag("PL") == "0" for move in job.moves] == [m.exact_stop for m in program.moves]


def test_programmed_time_of_each_pass_is_the_wanted_one_within_two_percent():
    timed = verified_motion(n_points=60).timed
    motion = timed.motion
    job = parse(render(sample(n_points=60), ROBOT, DATE))
    pulses = np.array([position.values for position in job.positions])
    q = SCALE.to_angles(pulses)
    speed = np.array([float(move.tag("VJ")) / 100.0 for move in job.moves])
    times = (np.abs(np.diff(q, axis=0)) / MAX_SPEED).max(axis=1) / speed[1:]
    configuration = np.array([move.motion_index for move in sample(n_points=60).moves])
    for pass_index in (0, 1):
        ground = (motion.pass_index == pass_index) & ~np.isnan(motion.contact_position)
        written = times[ground[configuration[1:]] & ground[configuration[:-1] + 1]].sum()
        assert written == pytest.approx(timed.duration[ground].sum(), rel=0.02)


def test_unverified_ratios_are_said_at_the_top_of_every_job():
    many = replace(UNVERIFIED, unverified_pulses=JOINT_NAMES)
    small = replace(DX200, step_limit=12)
    for text in render_jobs(sample(), many, DATE, profile=small).values():
        lines = text.split("\r\n")
        assert "'PULSE RATIO NOT VERIFIED: S L U" in lines
        assert "'R B T" in lines
    assert "VERIFIED" not in render(sample(), ROBOT, DATE)


def test_date_and_tool_are_the_ones_given():
    text = render(sample(), ROBOT, datetime(1999, 12, 31, 23, 59, 58), tool=7)
    assert "///DATE 1999/12/31 23:59\r\n" in text
    assert parse(text).positions[3].tool == 7


@given(
    st.lists(st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), min_size=1, max_size=5),
    st.floats(0.0, 1.0, exclude_min=True),
)
def test_configurations_come_back_within_half_a_pulse_and_speeds_in_range(shares, speed):
    q = SCALE.lower + np.array(shares) * (SCALE.upper - SCALE.lower)
    job = parse(render(program_of(q, speed), ROBOT, DATE))
    pulses = np.array([position.values for position in job.positions])
    assert np.abs(pulses - q * SCALE.pulses_per_radian).max() <= 0.5 + 1e-6
    for move in job.moves:
        assert re.fullmatch(r"\d{1,3}\.\d\d", move.tag("VJ"))
        assert 0.01 <= float(move.tag("VJ")) <= 100.0
        assert float(move.tag("VJ")) == pytest.approx(100.0 * speed, abs=0.0100001)


def test_configuration_beyond_the_soft_limits_gives_no_job():
    with pytest.raises(UnsafeError, match=r"joint S .* soft limits"):
        render(program_of([SCALE.upper + 0.01]), ROBOT, DATE)


# splitting


def test_five_thousand_points_are_split_and_the_master_calls_every_part():
    program = sample(n_passes=50, n_points=100)
    jobs = render_jobs(program, ROBOT, DATE)
    assert list(jobs) == ["SAMPLE.JBI", "SAMPLE01.JBI", "SAMPLE02.JBI", "SAMPLE03.JBI"]
    master = parse(jobs["SAMPLE.JBI"])
    assert [f"{call}.JBI" for call in master.calls] == list(jobs)[1:]
    assert "///NPOS 0,0,0,0,0,0\r\n//INST\r\n" in jobs["SAMPLE.JBI"]
    parts = [parse(text) for name, text in jobs.items() if name != "SAMPLE.JBI"]
    assert all(len(part.positions) <= DX200.step_limit for part in parts)
    for before, after in pairwise(parts):
        assert before.positions[-1].values == after.positions[0].values
        assert before.moves[-1].tag("PL") == "0"
    assert sum(len(part.moves) for part in parts) == len(program.moves) + len(parts) - 1


def test_names_are_made_to_fit_and_those_of_two_programs_stay_apart():
    small = replace(DX200, step_limit=12)
    long = "A" * 31
    names = [*render_jobs(replace(sample(), name=long), ROBOT, DATE, profile=small)]
    others = [*render_jobs(replace(sample(), name=long + "B"), ROBOT, DATE, profile=small)]
    assert names == [*render_jobs(replace(sample(), name=long), ROBOT, DATE, profile=small)]
    assert all(len(name) <= 36 for name in (*names, *others))
    assert len({*names, *others}) == len(names) + len(others)


def test_one_job_over_the_limit_is_refused():
    small = replace(DX200, step_limit=19)
    with pytest.raises(InputError, match="20 positions, DX200 takes 19 in a job"):
        render_part(sample(), ROBOT, ProgramSettings(), small, DATE)


# names and comments


@pytest.mark.parametrize("name", ["", "lower", "A B", "A.B", "ÄPFEL", "A\r\nEND"])
def test_illegal_name_is_refused_with_what_is_allowed(name):
    with pytest.raises(InputError, match="program name: must be of A-Z"):
        render(replace(sample(), name=name), ROBOT, DATE)


@pytest.mark.parametrize("comment", ["größe", "two\nlines", "tab\there", "c" * 33])
def test_illegal_comment_is_refused(comment):
    with pytest.raises(InputError, match=r"program comment: (must be printable|has 33)"):
        render(replace(sample(), comments=(comment,)), ROBOT, DATE)
    first, *others = sample().moves
    moves = (replace(first, comment=comment), *others)
    with pytest.raises(InputError, match="program comment"):
        render(replace(sample(), moves=moves), ROBOT, DATE)


@pytest.mark.parametrize("tool", [-1, 64])
def test_tool_the_controller_does_not_have_is_refused(tool):
    with pytest.raises(InputError, match=f"tool: must be 0 to 63, got {tool}"):
        render(sample(), ROBOT, DATE, tool=tool)


# templates


@pytest.mark.usefixtures("warm_processes")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("in steps %}\n{% if step.rconf", "in steps[1:] %}\n{% if step.rconf",
         "NPOS is 20,0,0,0,0,0, there are 19"),
        ("={{ step.values }}", "=0,0,0,0,0,0", r"position 1: must be C00000=0,-38000"),
        ("{{ step.word }}", "MOVL", r"move 1: must be MOVJ C00000 VJ=5.00 PL=0, is MOVL"),
        ("{{ step.speed }}", "VJ=100.00", "move 1: must be MOVJ C00000 VJ=5.00"),
        ("{{ step.corner }}", "", "is MOVJ C00000 VJ=5.00$"),
        ("{{ step.word }}", "COMM MOVJ", "move 1: .* is missing"),
        ("{{ step.corner }}", "{{ step.corner }} UNTIL IN#(1)=ON", "move 1: .* UNTIL"),
        ("NOP\n", "NOP\nMOVJ P001 VJ=1.00\n", "move 1: .* is MOVJ P001"),
        ("NOP\n", "NOP\nSFTON P001\n", "SFTON shifts"),
        ("NOP\n", "NOP\nIMOV P001 V=10.0 RF\n", "move 1: .* is IMOV P001"),
        ("///TOOL {{ tool }}", "///TOOL 3", "position 1: .*tool 3"),
        ("//NAME {{ name }}", "//NAME OTHER", "the name is OTHER, must be SAMPLE"),
        ("'{{ comment }}\n", "'X\n", "comment 'MADE BY THE TESTS' is missing"),
        ("{% for call in calls %}", "\n{% for call in calls %}", "is empty"),
        ("END\n", "END", "must end with END and CR LF"),
        ("END\n", "", "ends without END"),
        ("///ATTR {{ attributes }}\n", "", "///ATTR is missing"),
        ("{{ attributes }}", "SC,RW,RJ", "///ATTR is SC,RW,RJ, must be SC,RW"),
        ("NOP\n", "NOP\nBLAST\n", "BLAST is no instruction of DX200"),
        ("NOP\n", "NOP\nDOUT OT#(5000) ON\n", "OT must be 1 to 4096, got 5000"),
        ("NOP\n", "NOP\n*MUCHTOOLONG\n", "labels have 1 to 8 characters"),
        ("NOP\n", "NOP\nCALL JOB:lower\n", "CALL: job name must be of A-Z"),
        ("NOP\n", "NOP\nTIMER T=700.00\n", "T must be 0.01 to 655.35"),
        ("//INST\n///DATE {{ date }}", "///DATE {{ date }}\n//INST", "must not come after"),
        ("{{ name }}", "{{ nam }}", "'nam' is undefined"),
        ("{% endfor %}", "{% endfro %}", "line [0-9]+: Encountered unknown tag 'endfro'"),
        ("{{ name }}", "{{ 1 // 0 }}", "division"),
        ("{{ name }}", "{{ name.__class__.__mro__ }}", "unsafe"),
    ],
)  # fmt: skip
def test_template_that_gives_another_job_is_refused(tmp_path, old, new, message):
    text = TEMPLATE.read_text()
    assert old in text
    own = tmp_path / "own.jbi.j2"
    own.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        render(sample(), ROBOT, DATE, template=own)
    assert caught.value.where.startswith(str(own))


def test_template_whose_master_skips_a_part_is_refused(tmp_path):
    own = tmp_path / "own.jbi.j2"
    own.write_text(TEMPLATE.read_text().replace("in calls %}", "in calls[1:] %}"))
    with pytest.raises(InputError, match="call 1: must be SAMPLE01, is SAMPLE02"):
        render_jobs(sample(), ROBOT, DATE, profile=replace(DX200, step_limit=12), template=own)


def test_template_may_add_what_does_not_move_the_robot(tmp_path):
    own = tmp_path / "own.jbi.j2"
    text = TEMPLATE.read_text().replace("NOP\n", "NOP\nDOUT OT#(1) ON\nCALL JOB:BELT-ON\n")
    own.write_text(text.replace("{{ step.corner }}", "{{ step.corner }} ACC=50  //NOTE"))
    job = parse(render(sample(), ROBOT, DATE, template=own))
    assert job.calls == ("BELT-ON",)


@pytest.mark.parametrize("content", [None, b"\xff\xfe"])
def test_unreadable_template_is_refused(tmp_path, content):
    own = tmp_path / "own.jbi.j2"
    if content is not None:
        own.write_bytes(content)
    with pytest.raises(InputError, match=r"own.jbi.j2: (cannot be read|is not text)"):
        render(sample(), ROBOT, DATE, template=own)


# faults


def test_legal_job_has_no_faults():
    assert job_faults(job_text(), DX200) == ()


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"npos": "///NPOS 3,0,0,0,0,0"}, "NPOS is 3,0,0,0,0,0, there are 2,0,0,0,0,0"),
        ({"npos": "///TOOL 0"}, "NPOS is missing, there are 2"),
        ({"positions": "C00001=0,0,0,0,0,0\nC00000=1,1,1,1,1,1"}, "numbered 0, 1, 2"),
        ({"positions": "C0000=0,0,0,0,0,0\nC00001=1,1,1,1,1,1"}, "labels have 5 digits"),
        ({"modal": "///PULSE"}, "///TOOL and ///POSTYPE must come before"),
        ({"modal": "///TOOL 64\n///POSTYPE PULSE"}, "tools are 0 to 63"),
        ({"steps": "MOVJ C00000 VJ=1.00\nMOVJ C00000 VJ=1.00"}, "C00000 must be used once, is u"),
        ({"steps": "MOVJ C00000 VJ=1.00"}, "C00001 must be used once, is used 0 times"),
        ({"steps": "MOVJ C00001 VJ=1.00\nMOVJ C00000 VJ=1.00"}, "used in ascending order"),
        ({"steps": "MOVJ C00002 VJ=1.00"}, "C00002 is used but not given"),
        ({"steps": "MOVJ C00000 VJ=0.00"}, "VJ must be 0.01 to 100.0, got 0.00"),
        ({"steps": "MOVJ C00000 VJ=100.01"}, "VJ must be 0.01 to 100.0"),
        ({"steps": "MOVJ C00000 VJ=50.000"}, "VJ takes 2 decimals, got 50.000"),
        ({"steps": "MOVL C00000 V=1500.1"}, "V must be 0.1 to 1500.0"),
        ({"steps": "MOVJ C00000 VJ=1.00  +MOVJ EC00000 VJ=200.00"}, "VJ must be 0.01 to 100.0"),
        ({"steps": "MOVJ C00000 VJ=1.00 PL=9"}, "PL must be 0 to 8, got 9"),
        ({"steps": "MOVL C00000 V=1.0 CR=0.0"}, "CR must be 0.1 to 6553.5, got 0.0"),
        ({"steps": "MOVL C00000 V=1.0 CR=1.25"}, "CR takes 1 decimals, got 1.25"),
        ({"steps": "MOVJ C00000 VJ=1.00 CR=5.0"}, "CR is for straight moves, not for MOVJ"),
        ({"steps": "'" + 33 * "x"}, "comment has 33 characters"),
        ({"steps": "NOP  //" + 33 * "x"}, "comment has 33 characters"),
        ({"steps": "'ö"}, "must be printable ASCII, got 'ö'"),
        ({"steps": " MOVJ C00000 VJ=1.00"}, "begins with a space"),
        ({"date": "///DATE 2024-03-05"}, "DATE must be YYYY"),
        ({"date": "///DATE 2024/03/05 07:09\n///COMM " + 33 * "x"}, "COMM has 33"),
        ({"name": "//NAME two"}, "NAME must be of A-Z"),
        ({"end": "END\n\n"}, "must end with END"),
    ],
)
def test_fault_is_found(changes, fault):
    assert fault in "\n".join(job_faults(job_text(**changes), DX200))


def test_bare_line_feeds_are_a_fault():
    assert "lines must end in CR LF" in job_faults(job_text().replace("\r\n", "\n"), DX200)


# reading


def test_headers_hold_until_they_change():
    text = job_text(
        npos="///NPOS 1,0,1,3,0,0",
        modal="///USER 12\n///TOOL 4\n///POSTYPE USER\n///RECTAN\n///RCONF 1,0,0",
        positions="C00000=1.5,-2.25,3.000,0.0000,90.0000,-90.0000\n///LIMIT ON\n"
        "///POSTYPE ROBOT\n///RCONF 0,1,1\nP00091=1,2,3,4,5,6\n///UNHEARD OF\n"
        "///POSTYPE ANGLE\n///ANGLE\nEC00000=90.0000\n"
        "///TOOL 2\n///POSTYPE PULSE\n///PULSE\nP00092=1,2,3,4,5,6\nP92=7,8,9,0,1,2",
    )
    job = parse(text)
    seen = [(p.frame, p.coordinates, p.tool, p.user, p.rconf) for p in job.positions]
    assert seen == [
        ("USER", "RECTAN", 4, 12, (1, 0, 0)),
        ("ROBOT", "RECTAN", 4, 12, (0, 1, 1)),
        ("ANGLE", "ANGLE", 4, 12, (0, 1, 1)),
        ("PULSE", "PULSE", 2, 12, (0, 1, 1)),
        ("PULSE", "PULSE", 2, 12, (0, 1, 1)),
    ]
    assert job.positions[0].values == (1.5, -2.25, 3.0, 0.0, 90.0, -90.0)
    assert (job.positions[4].kind, job.positions[4].number) == ("P", 92)
    assert unparse(job) == text


def test_instructions_are_taken_apart():
    steps = [
        "'JUST //TEXT",
        "SMOVL C00001 BC00001 V=10.0 PL=0  +MOVJ EC00001  +MOVJ EC00002  //GO",
        "\t MOVJ P091 VJ=LI005",
        "COMM MOVS C00004 V=16.0",
        'MSG "A // B"  //C',
        "SET B000 EXPRESS B001 + B002",
        "CALL JOB:SUB-1 IF IN#(7)=ON",
        "*LABEL",
    ]
    comment, move, indented, disabled, message, sum_, call, label = parse(
        job_text(steps="\n".join(steps))
    ).instructions
    assert (comment.word, comment.comment) == ("'", "JUST //TEXT")
    assert move.positions == (("C", 1), ("BC", 1), ("EC", 1), ("EC", 2))
    assert (move.tag("V"), move.tag("VJ"), move.comment) == ("10.0", None, "GO")
    assert (indented.word, indented.positions, indented.tag("VJ")) == (
        "MOVJ",
        (("P", 91),),
        "LI005",
    )
    assert disabled.disabled and not disabled.moves and disabled.word == "MOVS"
    assert (message.comment, sum_.coupled) == ("C", ())
    assert (call.operands, call.tag("IN#(7)")) == (("JOB:SUB-1", "IF"), "ON")
    assert label.word == "*LABEL"


def test_job_without_positions_and_with_arguments_is_read():
    text = job_text(
        npos="///NPOS 0,0,0,0,0,0",
        modal="//ARGINFO\n///ARGTYPE B,,,\n///COMMENT",
        positions="NOP\nA1=5",
        attr="///ATTR SC,RW,RJ\n////FRAME USER 3\n///GROUP1 RB1,BS1\n///GROUP2 ST1",
        steps="CALL JOB:A",
    )
    job = parse(text)
    assert (job.positions, job.calls, job.npos) == ((), ("A",), (0, 0, 0, 0, 0, 0))
    assert [*job.values("///GROUP1"), *job.values("////FRAME")] == ["RB1,BS1", "USER 3"]
    assert unparse(job) == text


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("end", ["END", "END\n", "END\n\n"])
def test_written_again_only_line_ends_change(line_end, end):
    text = job_text(end=end, modal="///TOOL 0\n///STRANGE 1, 2\n///POSTYPE PULSE\n///PULSE")
    assert unparse(parse(text.replace("\r\n", line_end))) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "job: line 1: a job begins with /JOB, got ''"),
        ("NOTHING" * 9, r"line 1: .*\.\.\."),
        ("/JOB\n//NAME A\n//POS\n///NPOS 0,0\n//INST\nNOP\n", "line 7: the job ends without END"),
        ("/JOB\n//NAME A\nEND\nNOP\n//INST\n", "ends without NOP"),
        ("/JOB\n//NAME A\n", "ends without //INST"),
        ("/JOB\n//INST\nNOP\nEND\n", "one //NAME, this one has 0"),
        (job_text() * 2, "line 18: a second job"),
        (job_text(npos="///NPOS 2,x"), "line 4: ///NPOS takes whole numbers, got '2,x'"),
        (job_text(modal="///TOOL A\n///PULSE"), "line 5: ///TOOL takes whole"),
        (job_text(positions="C00000=1,2.5"), "line 8: pulses are whole numbers"),
        (job_text(modal="///RECTAN", positions="C00000=1,nan"), "line 6: positions are numbers"),
        (job_text(positions="C00000 =1,2"), "line 8: is neither a header nor a position"),
        (job_text(positions="X00000=1,2"), "line 8: is neither"),
        (job_text(positions="C00000=" + "9" * 5000), "line 8: pulses are whole"),
        (job_text(positions="C00000="), "line 8: pulses are whole"),
        (job_text(positions="C00000=\u0661"), "line 8: pulses are whole"),
    ],
)
def test_what_is_no_job_is_refused_with_its_line(text, message):
    with pytest.raises(InputError, match=message):
        parse(text)


def test_error_names_the_file():
    with pytest.raises(InputError, match=r"^A.JBI: line 1: "):
        parse("", source="A.JBI")


FRAGMENTS = st.sampled_from(
    [*job_text().split("\r\n"), "///RCONF 1,", "BC00000=1", "P1=1.5,", "+MOVJ", 'MSG "', "COMM"]
)


@settings(max_examples=300)
@given(st.one_of(st.text(), st.lists(st.one_of(FRAGMENTS, st.text(max_size=8))).map("\n".join)))
def test_any_text_is_read_or_refused_but_never_crashes(text):
    try:
        job = parse(text)
    except InputError:
        assert job_faults(text, DX200)
    else:
        job_faults(text, DX200)
        assert unparse(job) == re.sub("\r\n?|\n", "\r\n", text)


LINES = render(sample(n_passes=1), ROBOT, DATE).split("\r\n")


@settings(max_examples=200)
@given(st.data())
def test_a_damaged_job_is_read_or_refused_but_never_crashes(data):
    lines = [*LINES]
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(lines) - 1))
        lines[place] = data.draw(st.one_of(FRAGMENTS, st.text(max_size=8)))
    try:
        job = parse("\n".join(lines))
    except OplError as error:
        assert re.match("job: line [0-9]+: ", str(error))
    else:
        job_faults(unparse(job), DX200)
