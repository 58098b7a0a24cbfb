"""Puts every kind of fault into small programs of every language and says what became of it.

    python -m tests.attacks.inject [--write docs/faults.md] [PROGRAM ...]

A fault is caught if the program is refused or not proven. It is looked for as `opl verify` looks
without a result.json, and never with one: beside its result every changed byte is found, as is a
byte changed in a program that still holds the digest of itself; both are asserted for every fault.
Ends with status 1 if a fault is missed that is not below what is resolved, or if what does no harm
is refused.
"""

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import opl.proof.prove as proving
from opl.cell.robot import forward_kinematics
from opl.errors import OplError
from opl.files.digests import keeps_stamp
from opl.geometry.frames import inverse, transform
from opl.proof.corners import CornerProof
from opl.proof.digest import changed_since
from opl.proof.prove import prove
from opl.verification.replay import Verification
from tests.attacks.faults import KINDS, Case
from tests.support.small_programs import PROGRAMS, small_program

# what a fault may do and not be seen: how far a ground point passes beside its contact, and the
# part of its time that a pass takes more or less than the job asks for
PLACE = 1e-4  # [m]
SPEED = 0.02
WORDS = ("caught", "below", "missed", "proven", "refused", "-")
ALL_KINDS = tuple(KINDS.values())
NOTHING = Verification("", 0, 0, 0.0, 0.0, 0, (), None)
NO_CORNERS = CornerProof(0, 0, 0.0, "", 0.0, 0.0, ())


INTRODUCTION = """# Faults that are caught, and what cannot be

Written by `python -m tests.attacks.inject --write docs/faults.md`, which puts each of these faults
into small programs of every language, as somebody with an editor would, and holds the file against
its job as `opl verify` does. DX200 to URSCRIPT are rows of the V part on an arm of the maker, in
joint moves, KRL straight the same in straight ones; then rows of the S part, and of a bar with an
arched top that does not come with opl.

- **caught** (by what): refused, or not proven. **-**: the language has no place for it.
- **below**: what it does is less than is resolved, so the program is proven as it stands. In mm:
  so far beside its contact the ground point now passes, less than 0.1 mm, the contact limit of
  these jobs; along the axle does not count on the flat of the belt, where another place of it
  grinds the same, nor does a little sooner or later along the pass. In % of a pass: so much the
  time of the pass is off what the job asks for, 2 % at the most, because speeds of few digits are
  off by nearly as much; a single move may be 1.3 times as slow or as fast where others make up for
  it, and 0.25 mm ahead of the feed, since places between two cutter points are recognised less well
  than the points. "Straight, and replayed so": the other way of the move was replayed in the cell,
  and is free and on the contact model.
- **proven**: it does no harm, and must be proven.

An event (an output, a wait, a dwell, a call, a jump) has no size: none is below.

A ratio that is wrong by 0.02 % or more is caught unless the ground point moves by less than 0.1 mm:
of an axis that hardly turns, or turns about the ground point, no contact tells.

All of this is without `result.json`. Beside the `result.json` of its run every changed byte is
refused, and a program tells by the digest in it that it was changed; both are asserted for every
fault here.

What no file can tell: whether the wheel, the part and the tool of the cell are where the job says,
whether pulse ratios are those of the arm, what the controller does in corners beyond the limits
given, what programs do that are called and are the user's own, and what a person changes at the
pendant after the program was verified. Nobody has proven the move to the first configuration.
"""


@dataclass(frozen=True)
class Outcome:
    """What became of a fault: one of `WORDS`, and by what or how much."""

    word: str
    why: str = ""

    @property
    def bad(self):
        return self.word in ("missed", "refused")

    def __str__(self):
        return f"{self.word}: {self.why}" if self.why else self.word


def case_of(program):
    motion = program.motion
    labels = [kind.name for kind in motion.kind]
    return Case(program.job.program.controller, program.text, labels, list(motion.pass_index))


def findings_of(program, text):
    """Return the kinds of what is found, the cheap half of the proof first."""
    files = {program.name: text.encode("utf-8")}
    real = proving.replay, proving.corner_proof
    proving.replay = lambda *arguments: NOTHING
    proving.corner_proof = lambda *arguments: NO_CORNERS
    try:
        found = prove(program.job, program.points, files).findings
    except OplError as error:
        return ["refused"], str(error)
    finally:
        proving.replay, proving.corner_proof = real
    found = found or prove(program.job, program.points, files).findings
    return [one.kind for one in found], str(found[0]) if found else ""


def outcome(kind, program, case):
    """Return what becomes of a kind of fault in a program."""
    text = kind.apply(case)
    if text is None or text == program.text:
        return Outcome("-")
    content = text.encode("utf-8")
    assert changed_since(program.name, content, [program.digest]), kind.name
    assert keeps_stamp(content) is not True, kind.name
    kinds, first = findings_of(program, text)
    if kind.harmless:
        return Outcome("refused", first) if kinds else Outcome("proven")
    if kinds:
        return Outcome("caught", ", ".join(dict.fromkeys(kinds)))
    return _missed(kind, program, text)


def _missed(kind, program, text):
    """Say by how much a program that is proven differs from what was written."""
    before, after = program.read(program.text).playback, program.read(text).playback
    if len(before.stations) != len(after.stations):
        return Outcome("missed", "other moves")
    if [move.straight for move in before.moves] != [move.straight for move in after.moves]:
        return Outcome("below", "straight, and replayed so")
    rows = np.flatnonzero(program.motion.on_wheel)
    moved = np.ptp([each.q[each.stations][rows] for each in (before, after)], axis=0).any()
    far = _off_contact(program, before, after) if moved else 0.0
    takes, took = _times(after), _times(before)
    if moved:
        why = f"{1e3 * far:.3f} mm"
        return Outcome("below" if far < PLACE else "missed", why)
    if (takes != took).any():
        late = max(_off_time(program, takes), key=abs)
        return Outcome(
            "below" if abs(late) <= SPEED else "missed", f"{100.0 * late:+.2f} % of a pass"
        )
    if kind.group in ("target", "ratio"):
        return Outcome("below", "the same configurations")
    return Outcome("missed", "nothing that moves")


def _times(playback):
    """Return the time of each move in [s]; a straight one is played in several steps."""
    ends = np.cumsum(playback.duration)[playback.stations]
    return np.diff(ends, prepend=0.0)


def _off_time(program, takes):
    """Return by how much the time of each pass is off what is asked for, as parts of that."""
    motion, asked = program.motion, program.asked_times
    passes = [motion.grinding & (motion.pass_index == k) for k in range(program.points.n_passes)]
    return [float(takes[own].sum() / asked[own].sum() - 1.0) for own in passes]


def _off_contact(program, before, after):
    """Return how far ground points now pass beside where their contact was, the most of it in [m].

    Each is followed from the move before the one that grinds it to the move after. On the flat of
    the belt its place along the axle does not count: the contact position is free there, another
    place of the belt grinds the same. On an edge every direction counts.
    """
    rows = np.flatnonzero(program.motion.on_wheel)
    places = program.points.Ts_workpiece_cutter[:, :3, 3]
    nearest = np.clip(np.round(program.motion.cutter_point[rows]).astype(int), 0, len(places) - 1)
    own = places[nearest]
    wheel = program.job.cell.wheel
    q = after.q[after.stations]
    fractions = np.linspace(0.0, 1.0, 41)[:, None]
    (was,) = _in_contact0(program, before.q[before.stations][None, rows], own)
    free = np.where(np.abs(was[:, :1]) < wheel.width / 2.0, [0.0, 1.0, 1.0], 1.0)
    beside = [
        np.linalg.norm(free * (_in_contact0(program, lines, own) - was), axis=-1).min(axis=0)
        for lines in (
            q[rows - 1] + fractions[:, None] * (q[rows] - q[rows - 1]),
            q[rows] + fractions[:, None] * (q[rows + 1] - q[rows]),
        )
    ]
    return float(np.minimum(*beside).max())


def _in_contact0(program, q, p_workpiece):
    """Return points of the part in contact frame 0, shape (k, n, 3), at postures (k, n, 6)."""
    cell = program.job.cell
    Ts_base_flange = forward_kinematics(cell.robot, q.reshape(-1, 6)).reshape(*q.shape[:2], 4, 4)
    Ts_contact0_workpiece = (
        inverse(cell.wheel.T_base_contact0) @ Ts_base_flange @ cell.T_flange_workpiece
    )
    return transform(Ts_contact0_workpiece, p_workpiece)


def outcomes_in(name, kinds=ALL_KINDS):
    """Return what becomes of kinds of faults in a program, by the name of the kind."""
    program = small_program(**PROGRAMS[name])
    case = case_of(program)
    found = {kind.name: outcome(kind, program, case) for kind in kinds}
    for kind, one in found.items():
        if one.bad:
            print(f"{name}: {kind}: {one}", flush=True)
    return found


def page(found):
    """Return the table as Markdown, given the outcomes of each program by the name of the kind."""
    words = Counter(one.word for own in found.values() for one in own.values())
    total = ", ".join(f"{words[word]} {word}" for word in WORDS if words[word])
    kinds = sum(not kind.harmless for kind in KINDS.values())
    lines = [INTRODUCTION, f"{kinds} kinds of faults, put into {len(found)} programs: {total}."]
    group = None
    for kind in KINDS.values():
        if kind.group != group:
            group = kind.group
            lines += ["", f"## {group.capitalize()}", ""]
            lines += [f"| fault | {' | '.join(found)} |", "|---" * (len(found) + 1) + "|"]
        cells = (str(own[kind.name]) for own in found.values())
        lines.append(f"| {kind.name} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", type=Path, help="write the table as Markdown")
    parser.add_argument("programs", nargs="*", help=f"of {', '.join(PROGRAMS)}")
    arguments = parser.parse_args()
    found = {}
    for name in arguments.programs or PROGRAMS:
        found[name] = outcomes_in(name)
        words = Counter(one.word for one in found[name].values())
        print(f"{name}: {', '.join(f'{words[word]} {word}' for word in WORDS)}", flush=True)
        if arguments.write:
            arguments.write.write_text(page(found), encoding="utf-8")
    sys.exit(any(one.bad for own in found.values() for one in own.values()))


if __name__ == "__main__":
    main()
