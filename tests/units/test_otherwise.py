"""Where the proof finds no motion, another search gets all of the work that is left."""

from types import SimpleNamespace

import numpy as np
import pytest

from opl.least import least_range
from opl.least.least_range import NoMotionError, plan_optimal


class GivenUp:
    """A proof that gave up with most of its work left, or one that never ends."""

    plan, lower_bound, finished = None, 1.5, True

    def __init__(self, *_):
        self.work_share = 0.25 if self.finished else 0.0

    def step(self):
        self.work_share += 0.1

    def keep(self, plan):
        assert plan is None


@pytest.mark.parametrize(("finished", "left"), [(True, 750.0), (False, 300.0)])
def test_another_search_gets_what_is_left(finished, left, monkeypatch):
    monkeypatch.setattr(GivenUp, "finished", finished)
    monkeypatch.setattr(least_range, "OptimalSearch", GivenUp)
    robot = SimpleNamespace(lower=np.full(6, -1.0), upper=np.full(6, 1.0))
    problem = SimpleNamespace(cell=SimpleNamespace(robot=robot))
    given = []
    with pytest.raises(NoMotionError, match="none is below"):
        plan_optimal(problem, SimpleNamespace(max_subproblems=1000), None, otherwise=given.append)
    assert given == pytest.approx([left])
