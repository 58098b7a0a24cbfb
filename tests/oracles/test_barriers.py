"""Contact positions that a pass stays on one side of, held against all vertices of the part."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.stranger_jobs import draw_job
from opl.cell.wheel_distance import signed_wheel_distance
from opl.errors import NoPathError
from opl.geometry.frames import inverse, transform
from opl.job.load import load_job
from opl.run.searches import search_path
from opl.search.walls import Line, Piece
from opl.walls.barriers import all_sides, barriers
from opl.walls.cut_cells import cells_of, rows_of
from opl.walls.sides import ANY_SIDE, Barrier, sides_of
from tests.support.jobs import write_trough
from tests.support.planned import problem_of, small_problem


def never(*_):
    return False


@pytest.mark.parametrize("drawn", [(20261125, 31, 0), (20261202, 94, 0)])
def test_a_concave_part_is_too_deep_in_the_wheel_all_along_each_barrier(tmp_path, drawn):
    draw_job(*drawn, tmp_path)
    job = load_job(tmp_path / "job.yaml")
    problem = problem_of(job)
    points, wheel = problem.points, job.cell.wheel
    corners = problem.scene.part.triangles.reshape(-1, 3)
    for index, sides in enumerate(all_sides(problem)):
        found = barriers(problem, index)
        assert found and 2 <= len(sides) <= 3
        for one in found:
            for place in np.linspace(one.first, one.last, 7 * int(one.last - one.first)):
                T = wheel.T_contact0_contact(one.contact_position)
                T = T @ inverse(points.frames_at(np.array([place]))[0])
                deepest = wheel.signed_distance(transform(T, corners)).min()
                assert deepest < -job.cell.planned_penetration


def test_a_pass_that_comes_in_on_one_side_and_leaves_on_the_other_is_proven_to_have_no_motion(
    tmp_path,
):
    draw_job(20262301, 27, 0, tmp_path)
    job = load_job(tmp_path / "job.yaml")
    problem = problem_of(job)
    points, wheel = problem.points, job.cell.wheel
    # place by place the runs of contact positions at which no vertex is too deep
    corners = np.unique(problem.scene.part.triangles.reshape(-1, 3), axis=0)
    t = np.linspace(-1.0, 1.0, 401) * wheel.last_position
    reached = np.ones(len(t), dtype=bool)
    for place in np.arange(40.0, 58.0):
        Ts = wheel.T_contact0_contact(t) @ inverse(points.frames_at(np.array([place]))[0])
        deepest = np.array([wheel.signed_distance(transform(T, corners)).min() for T in Ts])
        free = deepest >= -job.cell.planned_penetration
        assert free.any()
        run = np.cumsum(np.diff(free, prepend=False))
        reached = free & np.isin(run, run[free & reached])
    assert not reached.any()
    with pytest.raises(NoPathError, match="proven: no motion along these passes"):
        search_path(job.search, problem)


def test_what_is_left_out_along_a_row_is_too_deep_in_the_wheel(tmp_path):
    draw_job(20261125, 31, 0, tmp_path)
    problem = problem_of(load_job(tmp_path / "job.yaml"))
    points, cell = problem.points, problem.cell
    own = np.flatnonzero(points.pass_index == 0)
    t = problem.field.contact_positions[:: len(problem.field.contact_positions) // 12].tolist()
    grids = [np.arange(own[0], own[-1] + 1.0)] * len(t)
    runs, cuts = rows_of(cell, problem.scene.part, points, grids, t)
    shut = 0
    for contact_position, ends, cut in zip(t, runs, cuts, strict=True):
        for k in np.flatnonzero(cut)[::4]:
            shut += 1
            places = np.linspace(ends[k], ends[k + 1], 6)
            T_contact0_contact = cell.wheel.T_contact0_contact(contact_position)
            Ts = T_contact0_contact @ inverse(points.frames_at(places))
            allowed = -cell.planned_penetration
            assert (
                signed_wheel_distance(problem.scene.part, cell.wheel, Ts, allowed) < allowed
            ).all()
    assert shut > 20
    assert not all(cut.all() for cut in cuts)


def test_what_is_left_out_of_a_column_is_too_deep_in_the_wheel(tmp_path):
    # a saddle that is hardly deeper than allowed all over the flat
    draw_job(20261202, 25, 0, tmp_path)
    problem = problem_of(load_job(tmp_path / "job.yaml"))
    points, cell, part = problem.points, problem.cell, problem.scene.part
    Ts = points.frames_at(np.linspace(0.0, len(points) - 1.0, 5))
    last = np.full(len(Ts), cell.wheel.last_position)
    ends, cuts = cells_of(cell, part, Ts, -last, last)
    # cells are not cut smaller without end
    assert max(map(len, ends)) < 500
    for T, t, cut in zip(Ts, ends, cuts, strict=True):
        assert cut.any()
        some = np.concatenate([t[:-1][cut], (t[:-1] + t[1:])[cut] / 2.0, t[1:][cut]])
        distance = signed_wheel_distance(
            part, cell.wheel, cell.wheel.T_contact0_contact(some) @ inverse(T), 0.0
        )
        assert (distance < -cell.planned_penetration).all()


def test_a_column_where_the_part_begins_to_be_too_deep_is_not_cut_into_thousands_of_cells(tmp_path):
    # along a blade it begins between two cutter points, all along the flat at once
    draw_job(20263001, 24, 0, tmp_path)
    problem = problem_of(load_job(tmp_path / "job.yaml"))
    points, cell, part = problem.points, problem.cell, problem.scene.part
    allowed = -cell.planned_penetration

    def over(place):
        T = points.frames_at(np.array([place]))
        Ts = cell.wheel.T_contact0_contact(np.array([10.0])) @ inverse(T)
        return allowed - signed_wheel_distance(part, cell.wheel, Ts, allowed)[0]

    free, deep = 50.0, 50.05
    assert over(free) <= 0.0 < over(deep)
    while over(deep) > 5e-8:  # less than distances are told to
        middle = (free + deep) / 2.0
        free, deep = (middle, deep) if over(middle) <= 0.0 else (free, middle)
    last = np.full(1, cell.wheel.last_position)
    ends, _ = cells_of(cell, part, points.frames_at(np.array([deep])), -last, last)
    assert len(ends[0]) < 300


@pytest.mark.parametrize("depth_mm", [1.5, 5.0])
def test_a_wheel_that_fits_between_two_walls_comes_from_one_to_the_other(tmp_path, depth_mm):
    # 5 mm of room on either side of the wheel, and cutter points 16 mm apart
    job = load_job(write_trough(tmp_path, width_mm=60.0, depth_mm=depth_mm))
    problem = problem_of(job)
    both = problem.cuts[:-1] & problem.cuts[1:]
    assert both.any(axis=1).all() and problem.shut.any() and not problem.shut[both].all()
    assert not problem.shut[~both].any()
    points, t = problem.points, np.linspace(-25.0, 25.0, 501)
    room = 5.0 + 1e3 * job.cell.planned_penetration
    for place in np.linspace(0.0, len(points) - 1, 31):
        at = np.array([place])
        cuts = problem.cuts_at(at, points.at_places(at), t[None])[0]
        # how far the middle of the wheel is from that of the trough
        along = np.interp(place, np.arange(len(points)), 1e3 * points.arc_length)
        off = np.abs(24.0 - along - t)
        assert not cuts[off < room - 0.05].any()
        assert cuts[off > room + 0.05].all()
    plan = search_path(job.search, problem).plan
    assert plan.path.joint_range_sum < 0.02


def test_a_part_that_touches_the_wheel_everywhere_has_no_barrier():
    problem = small_problem()
    assert not barriers(problem, 0)
    assert all(sides == [ANY_SIDE] for sides in all_sides(problem))


def test_a_cell_with_a_barrier_is_of_both_sides_and_a_row_is_of_one():
    at = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    nothing = np.zeros((4, 6))
    below, above = sides_of([Barrier(2.0, 5.0, 0.5)], never, 8)
    column = Piece(0, Line(np.eye(4)), at, np.zeros((5, 6)), nothing, nothing)

    def parts(piece, place):
        return [
            (part.side, part.at[0], part.at[-1])
            for side in (below, above)
            for part in side.parts(piece, place)
        ]

    assert parts(column, 4.5) == [(0, -3.0, 1.0), (1, 0.0, 3.0)]
    assert parts(column, 5.5) == [(0, -3.0, 3.0), (1, -3.0, 3.0)]
    # along a contact position, cells that are not wholly on the barrier are left
    row = replace(column, line=Line(None, 0.0), at=np.array([0.0, 1.5, 3.0, 4.5, 6.0]))
    assert parts(row, None) == [(0, 0.0, 6.0), (1, 0.0, 3.0), (1, 4.5, 6.0)]


def test_barriers_that_meet_leave_no_way_between_them_where_it_is_shut():
    one, other = Barrier(0.0, 5.0, -1.0), Barrier(5.0, 9.0, 1.0)
    # where both are, it cannot be below the lower one and above the other
    assert len(sides_of([one, other], never, 8)) == 3
    sides = sides_of([one, other], lambda place, low, high: (place, low, high) == (5, -1, 1), 8)
    assert [(len(side.above), len(side.below)) for side in sides] == [(0, 2), (2, 0)]
    assert sides_of([one, other], never, 2) == sides_of([one], never, 2)


@given(
    st.lists(st.tuples(st.integers(0, 8), st.integers(1, 8), st.integers(0, 8)), max_size=4),
    st.lists(st.integers(0, 8), min_size=9, max_size=9),
)
def test_a_track_that_no_barrier_stops_is_on_one_of_the_sides(drawn, contact):
    """Contact positions between those of barriers, changed where no barrier is."""
    barriers = [Barrier(a + 0.25, a + b + 0.25, t) for a, b, t in drawn]
    # from the middle of each place on, another contact position; the change goes over all between
    t = [contact[0] + 0.5]
    for place, wanted in enumerate(contact):
        before, after = t[-1], wanted + 0.5
        stops = [b for b in barriers if b.first <= place <= b.last]
        low, high = min(before, after), max(before, after)
        t.append(before if any(low < b.contact_position < high for b in stops) else after)
    places = np.repeat(np.arange(9.0), 2)
    along = np.stack([t[:-1], t[1:]], axis=1).reshape(-1, 1)
    sides = sides_of(barriers, never, 16)
    assert sum(side.holds(places, along).all() for side in sides) >= 1


@pytest.mark.parametrize("drawn", [(20261202, 25, 0), (20261202, 79, 0)])
def test_concave_parts_are_ground_with_the_least_motion(tmp_path, drawn):
    draw_job(*drawn, tmp_path)
    job = load_job(tmp_path / "job.yaml")
    plan = search_path(job.search, problem_of(job)).plan
    assert plan.lower_bound >= plan.path.joint_range_sum * (1.0 - 1e-3)
