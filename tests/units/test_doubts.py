"""What seems free since all of the field around it is, and is measured where a motion sank."""

import numpy as np

from opl.files.resources import folder
from opl.job.load import load_job
from opl.least.doubts import Doubts
from opl.planning.depths import nearer_nodes
from tests.support.planned import problem_of, small_problem, with_positions


def between(problem):
    """Return places on the passes with contact positions of their own, and as cutter points."""
    random = np.random.default_rng(2)
    places = np.sort(random.uniform(0.0, len(problem.points) - 1, 60))
    on_pass = problem.points.pass_index[np.floor(places).astype(int)]
    places = places[on_pass == problem.points.pass_index[np.ceil(places).astype(int)]]
    last = problem.field.contact_positions[-1]
    return places, problem.points.at_places(places), random.uniform(-last, last, (len(places), 40))


def test_what_is_doubted_is_measured_and_nothing_else_changes():
    job = load_job(folder("workpieces") / "s_shape" / "job.yaml")
    problem = problem_of(with_positions(job, 6))  # few, so that between them much is not known
    places, points, t = between(problem)
    deep = nearer_nodes(problem.scene, points, t, np.ones(t.shape, dtype=bool))
    seems = problem.cuts_at(places, points, t)
    unseen = deep & ~seems
    assert unseen.any() and (deep & seems).any()
    some = unseen & (np.arange(t.shape[1]) % 2 == 0)
    assert some.any()
    np.testing.assert_array_equal(problem.cuts_at(places, points, t, some), seems | some)
    measured = problem.cuts_at(places, points, t, True)
    assert (measured >= deep).all()
    # what is not deep though all four around it are is left out all the same
    np.testing.assert_array_equal(measured & ~deep, seems & ~deep)


def test_a_posture_that_sank_makes_what_is_around_it_doubted_on_its_pass():
    problem = small_problem()
    doubts, positions = Doubts(problem), problem.field.contact_positions
    middle = (positions[4] + positions[5]) / 2.0
    passes = np.array([0, problem.points.n_passes - 1])
    assert doubts.count == 0 and doubts.note(passes[:1], np.array([middle]))
    assert not doubts.note(passes[:1], np.array([middle]))
    t = np.stack([(positions[:-1] + positions[1:]) / 2.0] * 2)
    first, last = doubts.at(passes, t)
    assert np.flatnonzero(first).tolist() == [3, 4, 5]
    assert not last.any()
    # at either end of the wheel there is less around it
    assert doubts.note(passes[1:], positions[-1:])
    assert doubts.at(passes[1:], positions[None, -1:]).all()
