"""Would a controller load and play this job? Every limit that its text alone can break."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

from opl.errors import InputError
from opl.program.controller import ControllerProfile
from opl.program.inform.job import POSITION_KINDS, InformJob, Instruction
from opl.program.inform.parse import parse

# Order in which controllers write the headers that occur once. Others hold for the positions after
# them and stand among those, or stand in any order: //ARGINFO, //ALIAS, ///LVARS.
_HEADER_ORDER = (
    "/JOB", "//NAME", "///FOLDERNAME", "//POS", "///NPOS", "//INST", "///DATE", "///COMM",
    "///ATTR", "////FRAME", "///GROUP1", "///GROUP2", "///GROUP3",
)  # fmt: skip
# Comments on arguments follow one a line, some of them empty.
_MAY_BE_EMPTY = "///COMMENT"
_REQUIRED_HEADERS = ("//POS", "///NPOS", "//INST", "///DATE", "///ATTR")
_DATE = re.compile(r"[0-9]{4}/[0-9]{2}/[0-9]{2} [0-9]{2}:[0-9]{2}")
_NOT_PRINTABLE = re.compile(r"[^\t -~]")
_DECIMAL = re.compile(r"[0-9]+(?:\.[0-9]+)?")
_SIGNAL = re.compile(r"\b(IN|OT)#\(([0-9]{1,9})\)")
# a variable, or its alias
_VARIABLE = re.compile(r"[A-Z][A-Z0-9_]*(?:\[.*\])?")


def job_faults(text: str, profile: ControllerProfile) -> tuple[str, ...]:
    """Return what a controller would refuse or misread in a whole file, one line each."""
    try:
        job = parse(text)
    except InputError as error:
        return (str(error),)
    return faults_of(job, text, profile)


def faults_of(job: InformJob, text: str, profile: ControllerProfile) -> tuple[str, ...]:
    """Return what a controller would refuse or misread in the job that a whole file holds."""
    return (
        *_text_faults(text, job),
        *_header_faults(job, profile),
        *_position_faults(job, profile),
        *_instruction_faults(job, profile),
    )


def _text_faults(text: str, job: InformJob) -> Iterator[str]:
    # a job of bare line feeds is refused at load: the controller finds neither NOP nor END
    if "\n" in text.replace("\r\n", "") or "\r" in text.replace("\r\n", ""):
        yield "lines must end in CR LF"
    if job.lines[-2:] != ("END", ""):
        yield "the file must end with END and CR LF"
    header = ""
    for number, line in enumerate(job.lines[:-1], start=1):
        if found := _NOT_PRINTABLE.search(line):
            yield f"line {number}: must be printable ASCII, got {found[0]!r}"
        header = line.split()[0] if line.startswith("/") else header
        if not line.strip():
            if header != _MAY_BE_EMPTY:
                yield f"line {number}: is empty"
        elif line.startswith(" "):
            yield f"line {number}: begins with a space"


def _header_faults(job: InformJob, profile: ControllerProfile) -> Iterator[str]:
    if fault := profile.name_fault(job.name):
        yield f"//NAME {fault}"
    for comment in job.values("///COMM"):
        if fault := profile.comment_fault(comment):
            yield f"///COMM {fault}"
    for date in job.values("///DATE"):
        if not _DATE.fullmatch(date):
            yield f"///DATE must be YYYY/MM/DD HH:MM, got {date!r}"
    ordered = [header for header in job.headers if header.key in _HEADER_ORDER]
    for before, header in pairwise(ordered):
        if _HEADER_ORDER.index(header.key) <= _HEADER_ORDER.index(before.key):
            yield f"line {header.line}: {header.key} must not come after {before.key}"
    present = {header.key for header in ordered}
    yield from (f"{key} is missing" for key in _REQUIRED_HEADERS if key not in present)


def _position_faults(job: InformJob, profile: ControllerProfile) -> Iterator[str]:
    counts = Counter(position.kind for position in job.positions)
    true = tuple(counts[kind] for kind in POSITION_KINDS)
    if job.npos != true:
        yield f"///NPOS is {_listed(job.npos)}, there are {_listed(true)}"
    if counts["C"] > profile.step_limit:
        yield f"{counts['C']} positions, {profile.name} takes {profile.step_limit} in a job"
    most = profile.rconf_fields
    for position in job.positions:
        if not position.coordinates or position.tool is None:
            yield f"line {position.line}: ///TOOL and ///POSTYPE must come before the positions"
        elif (
            position.coordinates == "RECTAN"
            and position.kind == "C"
            and not (profile.least_rconf_fields <= len(position.rconf) <= most)
        ):
            yield f"line {position.line}: RCONF has {most} numbers, here {len(position.rconf)}"
        elif not 0 <= position.tool <= profile.highest_tool:
            yield f"line {position.line}: tools are 0 to {profile.highest_tool}"
        if position.kind == "C" and len(position.label) != 1 + profile.label_digits:
            yield f"line {position.line}: C labels have {profile.label_digits} digits"
    for kind in ("C", "BC", "EC"):
        numbers = [position.number for position in job.positions if position.kind == kind]
        if numbers != list(range(len(numbers))):
            yield f"the {kind} positions must be numbered 0, 1, 2 ... in order"
        # a taught position that no move uses, or that two use, raises an alarm
        used = [n for step in job.instructions for k, n in step.positions if k == kind]
        given, times = set(numbers), Counter(used)
        for number in sorted(given | times.keys()):
            label = f"{kind}{number:0{profile.label_digits}d}"
            if number not in given:
                yield f"{label} is used but not given"
            elif times[number] != 1:
                yield f"{label} must be used once, is used {times[number]} times"
        if used != sorted(used):
            yield f"the {kind} positions must be used in ascending order"


def _instruction_faults(job: InformJob, profile: ControllerProfile) -> Iterator[str]:
    if len(job.instructions) > profile.line_limit:
        yield (
            f"{len(job.instructions)} instructions, {profile.name} takes {profile.line_limit} "
            "in a job"
        )
    for step in job.instructions:
        yield from _word_faults(step, profile)
        if step.comment is not None and (fault := profile.comment_fault(step.comment)):
            yield f"line {step.line}: comment {fault}"
        for move in (step, *step.coupled):
            if "MOV" in move.word:
                yield from _move_faults(move, profile)
    for name in job.calls:
        if fault := profile.name_fault(name):
            yield f"CALL: job name {fault}"


def _word_faults(step: Instruction, profile: ControllerProfile) -> Iterator[str]:
    if step.word.startswith("*"):
        if not 1 < len(step.word) <= 1 + profile.label_length:
            yield f"line {step.line}: labels have 1 to {profile.label_length} characters"
    elif step.word and step.word not in profile.instructions:
        yield f"line {step.line}: {step.word} is no instruction of {profile.name} that opl knows"
    time = step.tag("T")
    if step.word in ("TIMER", "WAIT", "PULSE") and time and re.fullmatch(r"[0-9.]{1,9}", time):
        timer = profile.timer
        if not _DECIMAL.fullmatch(time) or not timer.lowest <= float(time) <= timer.highest:
            yield f"line {step.line}: T must be {timer.lowest} to {timer.highest}, got {time}"
    for kind, number in _SIGNAL.findall(" ".join(step.operands + tuple(k for k, _ in step.tags))):
        if not 1 <= int(number) <= profile.highest_signal:
            yield (f"line {step.line}: {kind} must be 1 to {profile.highest_signal}, got {number}")


def _move_faults(move: Instruction, profile: ControllerProfile) -> Iterator[str]:
    if move.tag("CR") is not None and move.word.endswith("J"):
        yield f"line {move.line}: CR is for straight moves, not for {move.word}"
    spans = {
        "VJ": profile.joint_speed,
        "V": profile.linear_speed,
        "VR": profile.angular_speed,
        "CR": profile.corner_radius,
    }
    ramp, levels = profile.ramp_percent, (0, profile.position_levels)
    whole = {"ACC": ramp, "DEC": ramp, "PL": levels}
    for name in (*spans, *whole):
        text = move.tag(name)
        if text is None or _VARIABLE.fullmatch(text):
            continue
        if name in whole:
            low, high = whole[name]
            if text not in map(str, range(low, high + 1)):
                yield f"line {move.line}: {name} must be {low} to {high}, got {text}"
            continue
        allowed = spans[name]
        # controllers write all decimals, and take fewer
        if not re.fullmatch(rf"[0-9]{{1,9}}(?:\.[0-9]{{1,{allowed.decimals}}})?", text):
            yield f"line {move.line}: {name} takes {allowed.decimals} decimals, got {text}"
        elif not allowed.lowest <= float(text) <= allowed.highest:
            span = f"{allowed.lowest} to {allowed.highest}"
            yield f"line {move.line}: {name} must be {span}, got {text}"


def _listed(counts: tuple[int, ...]) -> str:
    return ",".join(map(str, counts)) or "missing"
