"""The order of passes that takes the least time between them, against all orders there are.

Where the arm is at the ends of the passes is known from the contact-fixed path of the planner.
"""

from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np
import pytest

from opl.geometry.order import shortest_links
from opl.geometry.passes import Order
from opl.motion.pass_order import quickest_order
from opl.run.surfacing import cut_surface
from tests.support.small_programs import small_program

FAR_HOME = (60, -40, 20, 100, -60, -90)


@pytest.fixture(scope="module")
def by_rows():
    prepared = small_program("RAPID", motion="straight").run.proven.planned.prepared
    points, q = prepared.problem.points, prepared.fixed.q
    on_pass = [np.flatnonzero(points.pass_index == one) for one in range(points.n_passes)]
    frames = [points.Ts_workpiece_cutter[one] for one in on_pass]
    return prepared.surfaced.job, frames, [q[one][[0, -1]] for one in on_pass]


def seconds(job, process, ends, tour):
    """Return the time of straight moves from home through all passes and home again."""
    between = [process.home] if process.home_between else []
    visits = [process.home]
    for number, (index, step) in enumerate(tour):
        visits += (between if number else []) + list(ends[index][::step])
    visits.append(process.home)
    per_pass = 3 if process.home_between else 2
    moves = [pair for k, pair in enumerate(pairwise(visits)) if k % per_pass != 1]
    return sum((np.abs(b - a) / job.cell.robot.max_speed).max() for a, b in moves)


@pytest.mark.parametrize("home_between", [False, True])
@pytest.mark.parametrize("home_deg", [None, FAR_HOME])
def test_no_order_of_the_passes_takes_less_time_than_the_quickest(by_rows, home_between, home_deg):
    job, frames, ends = by_rows
    process = replace(job.process, home_between=home_between)
    if home_deg is not None:
        process = replace(process, home=np.deg2rad(home_deg))
    tours = [
        list(zip(order, steps, strict=True))
        for order in permutations(range(len(ends)))
        for steps in product((1, -1), repeat=len(ends))
    ]
    times = [seconds(job, process, ends, tour) for tour in tours]
    found = seconds(job, process, ends, quickest_order(job.cell, process, frames))
    assert found == pytest.approx(min(times), abs=1e-6)
    assert home_between or max(times) > 1.05 * min(times)


def test_a_job_whose_order_is_shortest_has_that_of_the_least_time(by_rows):
    job, frames, _ = by_rows
    points = cut_surface(replace(job, passes=replace(job.passes, order=Order.SHORTEST))).points
    order = quickest_order(job.cell, job.process, frames)
    wanted = np.concatenate([frames[index][::step] for index, step in order])
    np.testing.assert_allclose(points.Ts_workpiece_cutter, wanted, atol=1e-12)


def test_passes_out_of_reach_in_the_middle_are_ordered_by_their_links(by_rows):
    job, frames, _ = by_rows
    away = [np.array(one) for one in frames]
    for one in away:
        one[:, 0, 3] += 5.0
    assert quickest_order(job.cell, job.process, away) == shortest_links(away)
