"""What is spared for tracks along which the part sinks too deep between two places."""

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.motion.collision_check import CollidingMove
from opl.motion.motion import Phase
from opl.planning.box_columns import ColumnSampler
from opl.planning.families import Families, few_columns
from opl.planning.images import Images, seams_of
from opl.planning.multi_start import tracks_from_best_start
from opl.planning.open_matrix import open_matrices
from opl.planning.problem import wheel_distances
from opl.planning.sides import ANY_SIDE
from opl.planning.sinking import places_for, shallower, spare_for, sunk_between
from opl.planning.track_check import Collides, check_track
from opl.search.joint_limits import UNLIMITED
from tests.support.planned import small_problem


def test_moves_that_sink_are_those_between_their_columns():
    problem = small_problem()
    matrices = open_matrices(problem)
    for track in tracks_from_best_start(matrices):
        found = check_track(problem, matrices[track.matrix].nodes, track.rows)
        if hasattr(found, "motion"):
            break
    grinding = [k for k, phase in enumerate(found.motion.phase) if phase is Phase.GRINDING]
    approach = grinding[0] - 1
    faults = [CollidingMove(k, (PART, WHEEL), False) for k in [approach, *grinding]]
    sunk = sunk_between(problem, Collides(found.motion, tuple(faults)))
    assert (sunk[~problem.off_wheel] > 0.0).all()
    assert (sunk[problem.off_wheel] == 0.0).all()
    others = [CollidingMove(k, ("R_link", WHEEL), False) for k in grinding]
    assert not sunk_between(problem, Collides(found.motion, tuple(others))).any()


def test_depth_is_spared_at_both_ends_and_where_it_is_of_no_use_places_are_taken_in():
    sunk = np.array([0.0, 4e-6, 0.0, 0.0])
    spare = spare_for(np.zeros(5), sunk)
    np.testing.assert_allclose(spare, [0.0, 5e-6, 5e-6, 0.0, 0.0])
    assert shallower(sunk, None)
    assert shallower(np.array([3e-6, 1e-6, 0.0, 0.0]), sunk)
    assert not shallower(np.array([0.0, 4e-6, 0.0, 0.0]), sunk)
    places = np.array([0.0, 1.0, 1.5, 2.0, 3.0])
    assert [(one.first, one.last, one.parts) for one in places_for(places, sunk)] == [(1.0, 1.5, 2)]
    assert not places_for(np.array([0.0, 1.0, 1.001, 2.0, 3.0]), sunk)


def test_nodes_leave_the_depth_that_is_spared():
    problem = small_problem()
    points, t = problem.points, problem.field.contact_positions
    q = problem.solutions(few_columns(points.pass_index))
    seams, none = seams_of(q), [[ANY_SIDE]] * points.n_passes
    images = Images(problem.cell.robot, seams, 10.0)
    families = Families(images, q, problem.cuts, points.pass_index, t, none)
    box = families.smallest_grown()
    placements, _ = families.hold(box, {}, set(), 0.1)
    sampler = ColumnSampler(problem, seams, UNLIMITED)
    columns = sampler.columns(box, placements, np.arange(len(points), dtype=float))
    depth = problem.cell.planned_penetration
    distance = wheel_distances(
        problem.scene, points, columns.t, None, np.full((len(points), 1), 1.0)
    )
    spare = np.where(np.arange(len(points)) % 2 == 0, depth + np.median(distance), 0.0)
    found = sampler.spared(columns, spare)
    wanted = columns.free & ((distance >= spare[:, None] - depth) | (spare == 0.0)[:, None])
    np.testing.assert_array_equal(found.free, wanted)
    assert 0 < found.free[::2].sum() < columns.free[::2].sum()
