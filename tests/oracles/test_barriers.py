"""Contact positions that a pass stays on one side of, held against all vertices of the part."""

import numpy as np

from benchmarks.stranger_jobs import draw_job
from opl.cell.wheel_distance import signed_wheel_distance
from opl.geometry.frames import inverse, transform
from opl.job.load import load_job
from opl.planning.barriers import barriers, on_sides
from opl.planning.cut_cells import rows_of
from opl.search.walls import Line, Piece
from tests.support.planned import problem_of, small_problem


def test_a_concave_part_is_too_deep_in_the_wheel_all_along_each_barrier(tmp_path):
    draw_job(20261125, 31, 0, tmp_path)
    job = load_job(tmp_path / "job.yaml")
    problem = problem_of(job)
    points, wheel = problem.points, job.cell.wheel
    found = barriers(problem)
    assert [len(t) for t in found] == [1] * points.n_passes
    corners = problem.scene.part.triangles.reshape(-1, 3)
    for index, (t,) in enumerate(found):
        own = np.flatnonzero(points.pass_index == index)
        for place in np.linspace(own[0], own[-1], 7 * len(own)):
            T = wheel.T_contact0_contact(t) @ inverse(points.frames_at(np.array([place]))[0])
            deepest = wheel.signed_distance(transform(T, corners)).min()
            assert deepest < -job.cell.planned_penetration


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


def test_a_part_that_touches_the_wheel_everywhere_has_no_barrier():
    assert all(len(t) == 0 for t in barriers(small_problem()))


def test_a_cell_with_a_barrier_is_of_both_sides_and_a_row_is_of_one():
    at = np.array([-3.0, -1.0, 0.0, 1.0, 3.0])
    nothing = np.zeros((4, 6))
    column = Piece(0, Line(np.eye(4)), at, np.zeros((5, 6)), nothing, nothing)
    sides = [(part.side, part.at[0], part.at[-1]) for part in on_sides(column, np.array([0.5]))]
    assert sides == [(0, -3.0, 1.0), (1, 0.0, 3.0)]
    row = Piece(0, Line(None, 2.0), at, np.zeros((5, 6)), nothing, nothing)
    assert [part.side for part in on_sides(row, np.array([0.5, 4.0]))] == [1]
