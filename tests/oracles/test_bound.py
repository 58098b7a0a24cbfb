"""The bound that knows the ways between the cutter points, against enumeration and real motions."""

from itertools import pairwise, product

import numpy as np
import pytest

from opl.files.resources import folder
from opl.job.load import load_job
from opl.planning.bound import StripProof, raise_bound
from opl.planning.filling import BrokenEdgeError, fill_in
from opl.planning.open_matrix import open_matrices
from opl.planning.refine import RefinedProblem, refine
from opl.search.certificate import least_box
from opl.search.ladder import Ladder
from opl.search.strips import Strips, no_strips, strips_of
from tests.support.planned import problem_of, with_positions

NOTHING = np.empty(0, dtype=np.int64)


def random_strips(seed):
    """Return a small ladder, and strips with up to three cells for some of its steps."""
    random = np.random.default_rng(seed)
    n_columns, n_rows = int(random.integers(2, 4)), int(random.integers(2, 4))
    ladder = Ladder(
        q=random.uniform(-1.0, 1.0, (n_columns, n_rows, 6)),
        free=random.random((n_columns, n_rows)) > 0.1,
        contact_position=np.arange(float(n_rows)),
        off_wheel=np.zeros(n_columns - 1, dtype=bool),
        max_contact_step=1.0,
        max_joint_step=10.0,
    )
    start = np.concatenate([[0], np.cumsum(random.integers(0, 4, n_columns - 1))])
    low, high = np.sort(random.uniform(-1.5, 1.5, (2, 2, start[-1], 6, n_rows)), axis=0)
    return ladder, Strips(start, low[0], high[0], low[1], high[1])


def ways(strips, step, here, there):
    """Yield what every way through a strip crosses: (lows, highs) of each row and gap."""
    cells = range(strips.start[step], strips.start[step + 1])
    n_rows = strips.row_low.shape[2]
    if not len(cells):
        yield []
        return
    for ends in product(
        (here, here + 1), *[range(1, n_rows)] * (len(cells) - 1), (there, there + 1)
    ):
        crossed = []
        for cell, (before, after) in zip(cells, pairwise(ends), strict=True):
            rows = range(min(before, after), max(before, after))
            crossed += [(strips.row_low[cell, :, r], strips.row_high[cell, :, r]) for r in rows]
            if cell != cells[-1]:
                crossed.append((strips.gap_low[cell, :, after], strips.gap_high[cell, :, after]))
        yield crossed


def least_by_enumeration(ladder, strips):
    """Return the smallest box over all tracks and all their ways."""
    n_columns, n_rows = ladder.free.shape
    least = np.inf
    for rows in product(range(n_rows), repeat=n_columns):
        if not ladder.free[np.arange(n_columns), list(rows)].all():
            continue
        nodes = [(ladder.q[c, r], ladder.q[c, r]) for c, r in enumerate(rows)]
        steps = [list(ways(strips, c, rows[c], rows[c + 1])) for c in range(n_columns - 1)]
        for way in product(*steps):
            crossed = nodes + [item for part in way for item in part]
            highest = np.max([low for low, _ in crossed], axis=0)
            lowest = np.min([high for _, high in crossed], axis=0)
            least = min(least, float(np.maximum(highest - lowest, 0.0).sum()))
    return least


def proven(ladder, strips):
    proof = StripProof(ladder, NOTHING, np.inf, strips)
    while proof.open_bound() < proof.held:
        proof.take_next()
    return min(proof.open_bound(), proof.held)


def test_the_bound_never_exceeds_what_enumeration_finds_and_mostly_reaches_it():
    met, better = 0, 0
    for seed in range(40):
        ladder, strips = random_strips(seed)
        least = least_by_enumeration(ladder, strips)
        bound = proven(ladder, strips)
        of_nodes = least_box(ladder, NOTHING).lower_bound
        assert bound <= least + 1e-9
        assert bound >= of_nodes - 1e-8
        met += bound >= least - 1e-8
        better += bound > of_nodes + 1e-8
    assert met >= 20
    assert better >= 10


def test_without_strips_the_bound_is_that_of_the_nodes():
    for seed in range(40):
        ladder, _ = random_strips(seed)
        bound = proven(ladder, no_strips(*ladder.free.shape))
        assert bound == pytest.approx(least_box(ladder, NOTHING).lower_bound, abs=1e-8)


def configuration(s, t):
    """Return a smooth motion with a corner where t passes 0.3, as at an edge of the wheel."""
    s, t = np.broadcast_arrays(s, t)
    corner = np.maximum(t - 0.3, 0.0)
    return np.stack(
        [
            np.sin(s + t),
            np.cos(2.0 * s) * t - 3.0 * corner,
            s**2 - t,
            t - 2.0 * corner,
            np.exp(0.3 * s * t),
            s * corner,
        ],
        axis=-1,
    )


@pytest.mark.parametrize("n_cells", [2, 4, 8])
def test_the_intervals_of_a_strip_hold_what_passes_there(n_cells):
    t_rows = np.linspace(-1.0, 1.0, 12)
    places = np.linspace(0.0, 1.0, n_cells + 1)
    exact = np.isin(places, [0.0, 1.0])
    strips = strips_of(configuration(places[:, None], t_rows[None, :]), exact, in_order=True)
    for cell, (before, after) in enumerate(pairwise(places)):
        s = np.linspace(before, after, 50)
        passed = configuration(s[:, None], t_rows[None, :])  # (50, n_rows, 6)
        assert np.greater_equal(passed.min(axis=0).T + 1e-12, strips.row_low[cell]).all()
        assert np.less_equal(passed.max(axis=0).T - 1e-12, strips.row_high[cell]).all()
        for row in range(1, len(t_rows)):
            passed = configuration(after, np.linspace(t_rows[row - 1], t_rows[row], 50))
            assert (passed.min(axis=0) >= strips.gap_low[cell, :, row] - 1e-12).all()
            assert (passed.max(axis=0) <= strips.gap_high[cell, :, row] + 1e-12).all()


def test_no_motion_of_the_s_part_is_below_the_raised_bound():
    s_job = load_job(folder("workpieces") / "s_shape" / "job.yaml")
    problem = problem_of(with_positions(s_job, 70), points_of=slice(0, 14))
    finer = refine(
        RefinedProblem(problem, np.arange(14.0)),
        (np.arange(13)[:, None] + np.array([0.25, 0.5, 0.75])).ravel(),
    )
    all_between = open_matrices(finer.problem)
    random = np.random.default_rng(0)
    raised = 0
    for branch, between in zip(open_matrices(problem), all_between, strict=True):
        certificate = least_box(branch.ladder, NOTHING, gap=1e-6)
        if certificate.box is None:
            continue
        size = certificate.box.size
        bound = raise_bound(problem, branch, certificate.lower_bound, 1.1 * size, np.inf)
        raised += bound > size + 1e-6
        tried = 0
        for widening in np.linspace(0.05, 0.5, 20):
            # tracks that wander about near the least box, between the cutter points too
            q = np.nan_to_num(between.nodes.q, nan=np.inf)
            inside = between.free & certificate.box.widened(widening).holds(q)
            if not inside.any(axis=1).all():
                continue
            rows = np.array([random.choice(np.flatnonzero(column)) for column in inside])
            path = _filled(finer.problem, between, rows)
            if path is not None:
                tried += 1
                assert path.joint_range_sum >= bound
        # and the best track that the nodes know, with all that it passes
        path = _filled(problem, branch, certificate.rows)
        assert tried > 5
        assert path is None or path.joint_range_sum >= bound
    assert raised


def _filled(problem, branch, rows):
    try:
        return fill_in(problem.cell, problem.points, branch.nodes, rows, problem.interpolation)
    except BrokenEdgeError:
        return None
