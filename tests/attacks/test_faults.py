"""Every kind of fault in a small program of every language: none missed that can be seen.

Ten minutes; `python -m tests.attacks.inject --write docs/faults.md` writes the table of it.
"""

import pytest

from tests.attacks.faults import KINDS
from tests.attacks.inject import outcomes_in
from tests.support.small_programs import PROGRAMS


@pytest.mark.parametrize("name", PROGRAMS)
def test_no_fault_is_missed_and_nothing_harmless_refused(name):
    found = outcomes_in(name)
    assert {kind: str(one) for kind, one in found.items() if one.bad} == {}
    events = [one for kind in KINDS.values() if kind.group == "event" for one in [found[kind.name]]]
    assert {one.word for one in events} <= {"caught", "-"}
