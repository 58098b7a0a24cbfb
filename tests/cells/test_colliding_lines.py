"""Lines that hit something, held against choices that learn of one chain's lines at a time."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from opl.cell.collision import CollisionScene
from opl.motion.colliding_lines import CollidingLines
from opl.motion.collision_check import MoveCheck, colliding_moves
from opl.motion.fewest import ChainRule, Lines, fewest
from opl.motion.line_error import screws_of
from opl.planning.positions import on_wheel_runs
from opl.proof.read_back import position_rule
from tests.support.planned import small_job, small_motion, small_problem

COUNT = 110  # configurations of the run
RULE = ChainRule(0.0)


def in_a_belt(depth_mm):
    """Return the cell with a belt that lets the part in so far, a run, and the run's motion."""
    job, problem = small_job(), small_problem()
    cell = replace(job.cell, max_belt_penetration=depth_mm * 1e-3)
    rule, motion = position_rule(job, problem.points, problem.scene.part), small_motion()
    first, _ = next(on_wheel_runs(cell, problem.points, motion, job.process, rule))
    rows = np.arange(first, first + COUNT)
    on_wheel = motion.take(rows)
    _, run = next(on_wheel_runs(cell, problem.points, on_wheel, job.process, rule))
    return cell, run, on_wheel


def between_others(lines):
    """Return which of some lines are not between neighbours: those have no others to take."""
    return frozenset((start, end) for start, end in lines if end > start + 1)


@pytest.mark.parametrize(("depth_mm", "fewer"), [(0.2, 1), (0.1, 2), (0.06, 10)])
def test_the_choice_is_that_of_one_chain_at_a_time_with_fewer_choices(depth_mm, fewer):
    cell, run, motion = in_a_belt(depth_mm)
    screws, part = screws_of(cell.robot), small_problem().scene.part
    scene, alone = CollisionScene(cell), {}

    def hits(line):
        if line not in alone:
            ends = motion.take(np.array(line))
            alone[line] = bool(colliding_moves(cell, scene, part, ends, np.array([False, True])))
        return alone[line]

    blocked, choices = frozenset(), 0
    while True:
        chain, choices = fewest(screws, run, RULE, blocked), choices + 1
        found = {line for line in between_others(pairwise(chain.tolist())) if hits(line)}
        if found <= blocked:
            break
        blocked |= found

    lines, known, mine = Lines(screws, run), frozenset(), 0
    colliding = CollidingLines(MoveCheck(cell, scene, part), motion, lines)
    while True:
        kept, mine = fewest(screws, run, RULE, known, lines), mine + 1
        before, known = known, between_others(colliding.known_after(kept))
        if known == before:
            break

    np.testing.assert_array_equal(kept, chain)
    assert all(hits(line) for line in known)
    assert known >= {line for line in between_others(pairwise(kept.tolist())) if hits(line)}
    assert bool(known) == (fewer > 1)
    assert mine <= choices / fewer
