"""Kinds of faults in written programs: none missed that can be seen.

A sample, each program with kinds of its own: every third kind is put into one of the programs.
`python -m tests.attacks.inject --write docs/faults.md` puts every kind into every program.
"""

import pytest

from tests.attacks.faults import KINDS
from tests.attacks.inject import case_of, outcomes_in
from tests.support.small_programs import PROGRAMS, small_program

EVERY = 3


@pytest.mark.parametrize("name", PROGRAMS)
def test_no_fault_is_missed_and_nothing_harmless_refused(name):
    own = list(KINDS.values())[list(PROGRAMS).index(name) :: EVERY * len(PROGRAMS)]
    found = outcomes_in(name, own)
    assert {kind: str(one) for kind, one in found.items() if one.bad} == {}
    events = {found[kind.name].word for kind in own if kind.group == "event"}
    assert events <= {"caught", "-"}


@pytest.mark.parametrize("name", PROGRAMS)
def test_at_least_a_hundred_kinds_apply_to_a_program(name):
    program = small_program(**PROGRAMS[name])
    case = case_of(program)
    texts = [kind.apply(case) for kind in KINDS.values() if not kind.harmless]
    assert len({text for text in texts if text not in (None, program.text)}) >= 100
