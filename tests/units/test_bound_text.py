"""What the command line says of lower bounds."""

from types import SimpleNamespace

import pytest

from opl.cli.bound_text import bound_lines

NOT_FOUND = "which cutter points hold the joint range sum up was not found in the work for it"


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, True),
        ({"lower_bound_rad": 0.0}, False),  # at rest nothing holds the sum up
        ({"method": "recursive", "lower_bound_rad": None, "gap": None}, False),
        ({"objective": "travel"}, False),
    ],
)
def test_that_nothing_is_known_to_hold_the_sum_up_is_said_where_it_was_looked_for(changes, told):
    known = SimpleNamespace(lower_bound=1.0, value=1.1, gap=0.1)
    path = {
        "method": "optimal",
        "objective": "range",
        "lower_bound_rad": 1.0,
        "gap": 0.0009,
        "open_because": None,
        "held_by": [],
        **changes,
    }
    path["objective_value"] = known if path["objective"] == "travel" else None
    lines = list(bound_lines(SimpleNamespace(path=SimpleNamespace(**path))))
    assert (NOT_FOUND in lines) == told
