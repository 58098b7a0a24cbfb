"""What a program does besides moving: exactly what its job asks for, in its order and place."""

import re
from dataclasses import replace

import pytest

from opl.files.digests import keeps_stamp
from opl.program.actions import Actions
from opl.program.events import meanings
from opl.program.inform import TEMPLATE
from opl.proof.digest import other_inputs
from opl.proof.events import event_findings, expected_events, name_findings
from opl.proof.prove import prove
from tests.attacks.faults import KINDS
from tests.attacks.inject import case_of, outcome
from tests.support.small_programs import ARMS, small_program

# how each language writes what is asked for, and what is not
SWITCHED = {
    "DX200": ("DOUT OT#(12) ON", "DOUT OT#(12) OFF"),
    "RAPID": ("SetDO do12, 1;", "SetDO do12, 0;"),
    "KRL": ("$OUT[12] = TRUE", "$OUT[12] = FALSE"),
    "FANUC": ("DO[12]=ON", "DO[12]=OFF"),
    "URSCRIPT": ("set_standard_digital_out(12, True)", "set_standard_digital_out(12, False)"),
}
TIMED = {
    "DX200": ("TIMER T=0.50", "TIMER T=60.00"),
    "RAPID": ("WaitTime 0.50;", "WaitTime 60.00;"),
    "KRL": ("WAIT SEC 0.50", "WAIT SEC 60.00"),
    "FANUC": ("WAIT 0.50(sec)", "WAIT 60.00(sec)"),
    "URSCRIPT": ("sleep(0.50)", "sleep(60.00)"),
}
MOVE = {
    "DX200": r"MOVJ C",
    "RAPID": r" *MoveAbsJ ",
    "KRL": r"PTP \{",
    "FANUC": r" *\d+: *J P",
    "URSCRIPT": r" *movej\(",
}


@pytest.fixture(scope="module", params=ARMS)
def program(request):
    return small_program(request.param)


def controller(program):
    return program.job.program.controller


def findings(program, lines):
    """Return what is found of the events of a program with these lines."""
    reading = program.read("".join(lines))
    assert reading.playback is not None, reading.findings
    return [str(one) for one in event_findings(program.job, program.motion, reading.playback)]


def lines_of(program):
    return program.text.splitlines(keepends=True)


def where(lines, words):
    """Return at which lines some words stand."""
    return [k for k, line in enumerate(lines) if words in line]


def test_what_a_run_writes_is_what_its_job_asks_for(program):
    assert findings(program, lines_of(program)) == []
    reading = program.read(program.text)
    assert [*name_findings(program.job, reading.name)] == []
    texts = [event.text for event in reading.playback.events]
    on, off = SWITCHED[controller(program)]
    n = program.points.n_passes
    assert n == 2 and len(where(texts, on)) == len(where(texts, off)) == n
    assert sum(map(len, expected_events(program.job, program.motion).values())) == len(texts)


def test_a_dropped_an_inverted_and_a_repeated_output_are_found(program):
    lines, (on, off) = lines_of(program), SWITCHED[controller(program)]
    at = where(lines, on)[1]
    dropped = findings(program, [*lines[:at], *lines[at + 1 :]])
    assert len(dropped) == 1 and on in dropped[0] and "is missing" in dropped[0]
    assert "event at free move" in dropped[0] or "event at link" in dropped[0]
    inverted = findings(program, [*lines[:at], lines[at].replace(on, off), *lines[at + 1 :]])
    assert len(inverted) == 2 and off in inverted[0] and "not what the job asks" in inverted[0]
    repeated = findings(program, [*lines[: at + 1], *lines[at:]])
    assert len(repeated) == 1 and "not what the job asks" in repeated[0]


def test_an_event_one_move_too_late_is_found(program):
    lines, (on, _) = lines_of(program), SWITCHED[controller(program)]
    at = where(lines, on)[0]
    after = next(k for k in range(at, len(lines)) if re.match(MOVE[controller(program)], lines[k]))
    moved = [*lines[:at], *lines[at + 1 : after + 1], lines[at], *lines[after + 1 :]]
    found = findings(program, moved)
    assert len(found) == 2 and "is missing" in found[0] and "not what the job asks" in found[1]


def test_two_events_exchanged_are_found(program):
    lines = lines_of(program)
    at = where(lines, TIMED[controller(program)][0])[0]
    on = where(lines, SWITCHED[controller(program)][0])[0]
    lines[at], lines[on] = lines[on], lines[at]
    assert len(findings(program, lines)) >= 2


def test_another_time_is_found_and_other_spaces_and_zeros_are_not(program):
    lines, (right, wrong) = lines_of(program), TIMED[controller(program)]
    at = where(lines, right)[0]
    same = lines[at].replace("0.50", "0.5").replace("  ", " ")
    assert findings(program, [*lines[:at], same, *lines[at + 1 :]]) == []
    found = findings(program, [*lines[:at], lines[at].replace(right, wrong), *lines[at + 1 :]])
    assert len(found) == 2 and wrong in found[0]


def test_standing_still_on_the_running_belt_is_found(program):
    lines = lines_of(program)
    moves = [k for k, line in enumerate(lines) if re.match(MOVE[controller(program)], line)]
    at = moves[len(moves) // 4]  # in the first pass
    assert program.motion.kind[len(moves) // 4].on_wheel
    timer = lines[where(lines, TIMED[controller(program)][0])[0]]
    found = findings(program, [*lines[: at + 1], timer, *lines[at + 1 :]])
    assert len(found) == 1 and found[0].startswith("wait at pass 1, cutter point")
    output = lines[where(lines, SWITCHED[controller(program)][0])[0]]
    found = findings(program, [*lines[: at + 1], output, *lines[at + 1 :]])
    assert len(found) == 1 and found[0].startswith("event at pass 1, cutter point")


def test_a_program_of_a_job_that_asks_for_nothing_may_do_nothing(program):
    quiet = replace(program.job.program, actions=Actions())
    reading = program.read(program.text)
    job = replace(program.job, program=quiet)
    found = [*event_findings(job, program.motion, reading.playback)]
    asked = sum(map(len, expected_events(job, program.motion).values()))  # by the layout
    assert len(found) == len(reading.playback.events) - asked > 10


def test_programs_of_every_language_hold_digests_of_inputs_and_of_themselves(program):
    content, inputs = program.text.encode("ascii"), program.job.inputs
    assert keeps_stamp(content) is True
    assert other_inputs(content, inputs, None) == []
    assert other_inputs(content, {**inputs, "job": "0"}, None) == ["unknown which"]
    at = len(content) // 2
    changed = content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]
    assert keeps_stamp(changed) is False


# Yaskawa jobs: what only they have


def proof(text, job=None):
    program = small_program("DX200")
    found = prove(job or program.job, program.points, {program.name: text.encode("ascii")})
    return [str(one) for one in found.findings]


def test_an_untouched_program_with_actions_is_proven():
    assert proof(small_program("DX200").text) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("///GROUP1 RB1\r\n", "", "///GROUP1 must be RB1, is missing"),
        ("NPOS {n},0,0,0,", "NPOS {n},0,0,1,", "P00001 overwrites the variable"),
        ("///ATTR SC,RW", "///ATTR SC,RW,RJ", "///ATTR must be SC,RW, is SC,RW,RJ"),
        ("///TOOL 0", "///TOOL 1", "moves with tool 1; the job's is 0"),
        ("C00009 VJ", "C00009 ACC=20 VJ", "must have no ramps of its own, has ACC=20"),
        ("NAME V_SHAPE", "NAME V_SHAPE2", "is called V_SHAPE2, the program of the job V_SHAPE"),
        ("///DATE", "///SPEEDY 3\r\n///DATE", "nobody can tell from the file what ///SPEEDY 3"),
    ],
)
def test_what_else_a_controller_would_act_on_is_found(old, new, told):
    program = small_program("DX200")
    n = len(program.motion)
    old, new = old.replace("{n}", str(n)), new.replace("{n}", str(n))
    text = program.text.replace(old, new, 1)
    if "P00001" in told:
        text = text.replace("//INST", "P00001=0,0,0,0,0,0\r\n//INST")
    assert text != program.text
    assert any(told in one for one in proof(text)), proof(text)


def test_a_jump_to_itself_on_the_belt_is_found():
    program = small_program("DX200")
    text = re.sub(r"(MOVJ C00020 .*\r\n)", r"\1*HERE\r\nJUMP *HERE\r\n", program.text)
    found = proof(text)
    assert any("*HERE is not what the job asks for here" in one for one in found)
    assert any("JUMP *HERE" in one for one in found)


def test_what_a_template_adds_at_both_ends_is_asked_for(tmp_path):
    own = tmp_path / "own.j2"
    layout = TEMPLATE.read_text().replace("NOP\n", 'NOP\nMSG "GRINDING"\n')
    own.write_text(layout.replace("END\n", "DOUT OT#(9) OFF\nEND\n"))
    program = small_program("DX200")
    with_own = replace(program.job, program=replace(program.job.program, template=own))
    text = program.text.replace("NOP\r\n", 'NOP\r\nMSG "GRINDING"\r\n')
    text = text.replace("\r\nEND", "\r\nDOUT OT#(9) OFF\r\nEND")
    assert proof(text, with_own) == []
    assert len(proof(text)) == 2


def test_labels_differ_by_their_places_not_by_their_numbers():
    one = ["*WAIT1", "JUMP *WAIT1 IF IN#(3)=OFF"]
    assert meanings(one) == meanings(["*WAIT7", "JUMP *WAIT7 IF IN#(3)=OFF"])
    assert meanings(one) != meanings(["*WAIT7", "JUMP *WAIT1 IF IN#(3)=OFF"])
    assert meanings(["LBL[4]", "JMP LBL[6]"]) == meanings(["LBL[1]", "JMP LBL[3]"])
    assert meanings(["TIMER T=0.50"]) == meanings(["TIMER  T=0.5"]) != meanings(["TIMER T=5.0"])


# a sample of the attacks; `python -m tests.attacks.inject` makes all of them


def test_a_sample_of_all_kinds_of_faults_is_caught(program):
    first = list(ARMS).index(controller(program))
    case = case_of(program)
    for kind in list(KINDS.values())[first::71]:
        found = outcome(kind, program, case)
        assert not found.bad, f"{kind.name}: {found}"


def test_the_attacks_put_a_program_together_as_it_was(program):
    case = case_of(program)
    assert case.render(case.script) == program.text
    assert sum(not kind.harmless for kind in KINDS.values()) >= 100
