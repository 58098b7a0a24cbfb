"""The least box over walls that are added while the proof goes on, held against samples of them."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from opl.search import least_box
from opl.search.least_box import BoxProof
from opl.search.walls import Image, Line, Piece, Wall

SAME = (Image(np.ones(6), np.zeros(6), (0,)),)
GAP = 1e-3
N_WALLS, CELLS, SAMPLES = 7, 6, 9


class Bent:
    """A wall along a parabola in three joints."""

    def __init__(self, random):
        self._q = np.zeros((3, 6))
        self._q[:, :3] = random.normal(size=(3, 3)) * [[1.0], [0.7], [0.4]]

    def at(self, t):
        t = np.asarray(t)[..., None]
        return self._q[0] + t * self._q[1] + t**2 * self._q[2]

    def piece(self, t):
        """Return cells between places along it; a chord is off by h^2 / 8 times the bend."""
        bend = np.diff(t)[:, None] ** 2 / 4.0 * self._q[2]
        pads = np.minimum(-bend, 0.0), np.maximum(-bend, 0.0)
        return Piece(id(self), Line(np.eye(4)), t, self.at(t), *pads)


def crossing(curves, in_pieces):
    """Return walls along curves, whole or each cell a piece, and what cuts their cells."""
    by_family = {id(curve): curve for curve in curves}

    def cut(piece, cell):
        start, end = piece.at[cell : cell + 2]
        return (by_family[piece.family].piece(np.linspace(start, end, 4)),)

    at = np.linspace(-1.0, 1.0, CELLS + 1)
    runs = [at[k : k + 2] for k in range(CELLS)] if in_pieces else [at]
    walls = [
        Wall(k, float(k), tuple(curve.piece(run) for run in runs)) for k, curve in enumerate(curves)
    ]
    return walls, cut


def grown(q):
    """Return the least box over samples of curves, shape (n, m, 6), added one by one."""
    low, high = q[0], q[0]
    for one in q[1:]:
        low = np.minimum(low[:, None], one).reshape(-1, 6)
        high = np.maximum(high[:, None], one).reshape(-1, 6)
        low, high = least_of_all(low, high)
    return float((high - low).sum(axis=1).min())


def least_of_all(low, high):
    """Return the boxes that hold no other of some boxes, the thousand smallest at the most."""
    order = np.argsort((high - low).sum(axis=1), kind="stable")[:1000]
    return low[order], high[order]


def take(proof, candidate):
    """Look for less than the box of a candidate, or give it up."""
    size = float((candidate.high - candidate.low).sum())
    if size >= proof.threshold:
        proof.give_up()
    else:
        proof.threshold = size
        proof.put_back()


def proven(curves, late, in_pieces=False):
    """Return the bound, with walls added when a box misses them, and the bounds on the way."""
    walls, cut = crossing(curves, in_pieces)
    proof = BoxProof(lambda _: SAME, cut, 20.0, GAP)
    left = walls[2:] if late else []
    for wall in walls if not late else walls[:2]:
        proof.add(wall)
    bounds = []
    while not proof.closed:
        bounds.append(proof.lower_bound)
        candidate = proof.take_next()
        if candidate is None:
            continue
        if left:
            proof.add(left.pop(0))
            proof.put_back()
        else:
            take(proof, candidate)
    return proof.lower_bound, bounds


@pytest.mark.parametrize("in_pieces", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_walls_added_late_and_trees_begun_anew_lead_to_the_same_bound(seed, in_pieces, monkeypatch):
    random = np.random.default_rng(seed)
    curves = [Bent(random) for _ in range(N_WALLS)]
    at_once, _ = proven(curves, late=False)
    monkeypatch.setattr(least_box, "FEWEST_BEFORE_ANEW", 3)
    late, bounds = proven(curves, late=True, in_pieces=in_pieces)
    assert (np.diff(bounds) >= -1e-12).all()
    assert late == pytest.approx(at_once, rel=2.0 * GAP)
    samples = grown(np.stack([curve.at(np.linspace(-1.0, 1.0, SAMPLES)) for curve in curves]))
    assert late <= samples


TURNED = tuple(
    Image(np.ones(6), 2.0 * np.pi * np.array([one, other, 0, 0, 0, 0]), (0, one, other))
    for one in sorted(range(-2, 3), key=abs)
    for other in sorted(range(-2, 3), key=abs)
)


def far_apart(seed):
    """Return walls so far apart that full turns bring some nearer, and what cuts their cells."""
    random = np.random.default_rng(seed)
    curves = [Bent(random) for _ in range(4)]
    for curve in curves:
        curve._q[0, :2] += 2.0 * np.pi * random.integers(-1, 2, size=2)
    return crossing(curves, False)


def proof_over(walls, cut, threshold):
    """Return a proof over walls with full turns, for boxes below a size in [rad]."""
    proof = BoxProof(lambda _: TURNED, cut, threshold, GAP)
    for wall in walls:
        proof.add(wall)
    return proof


def closed_at(proof):
    """Return the least box of a proof in the images of its walls, nothing added on the way."""
    while not proof.closed:
        candidate = proof.take_next()
        if candidate is not None:
            take(proof, candidate)
    return proof.lower_bound


@pytest.mark.parametrize("seed", range(8))
def test_images_out_of_reach_do_not_matter_and_are_there_where_larger_boxes_are_asked_about(seed):
    walls, cut = far_apart(seed)
    every = proof_over(walls, cut, 100.0)
    least = closed_at(every)
    few = proof_over(walls, cut, 1.01 * least)
    assert few._cells._n_sources < every._cells._n_sources
    assert closed_at(few) == pytest.approx(least, rel=2.0 * GAP)
    # none is so small; begun again for larger ones it has the images that those need
    small = proof_over(walls, cut, 0.5 * least)
    assert closed_at(small) >= 0.5 * least * (1.0 - 2.0 * GAP)
    assert closed_at(small.again(2.0 * least)) == pytest.approx(least, rel=2.0 * GAP)


@pytest.mark.parametrize("seed", range(6))
def test_without_a_wall_the_others_are_proven_as_if_it_had_never_been_there(seed):
    walls, cut = far_apart(seed)
    whole = proof_over(walls, cut, 20.0)
    least = closed_at(whole)
    for k in range(len(walls)):
        found = closed_at(whole.without(k))
        # for boxes of the same size: what a settled one may miss grows with it
        alone = closed_at(proof_over(walls[:k] + walls[k + 1 :], cut, whole.threshold))
        assert found == pytest.approx(alone, rel=GAP)
        assert found <= least * (1.0 + GAP)
    assert len(whole.walls) == len(walls)
    assert closed_at(whole.again(20.0)) == pytest.approx(least, rel=GAP)


def before_a_pass(seed):
    """Return a wall, and those of a pass that two families cross; curves, what cuts their cells.

    They are straight, and the same but for a joint, which is far off in one family at one wall.
    """
    random = np.random.default_rng(seed)
    at, curves, of_line, walls = np.linspace(-1.0, 1.0, CELLS + 1), {}, {}, []
    for place in range(4):
        pieces, straight = [], Bent(random)
        straight._q[2] = 0.0
        for family in (0, 1) if place else (0,):
            curve = curves[family, place] = deepcopy(straight)
            curve._q[0, 3] = 2.0 * (place == family + 1)
            piece = replace(curve.piece(at), family=family)
            of_line[id(piece.line)] = curve
            pieces.append(piece)
        walls.append(Wall(min(place, 1), float(place), tuple(pieces)))

    def cut(piece, cell):
        finer = of_line[id(piece.line)].piece(np.linspace(*piece.at[cell : cell + 2], 4))
        return (replace(finer, family=piece.family, line=piece.line),)

    return walls, curves, cut


@pytest.mark.parametrize("seed", range(12))
def test_a_box_is_settled_where_a_pass_meets_it_with_one_family(seed):
    walls, curves, cut = before_a_pass(seed)
    proof = BoxProof(lambda _: SAME, cut, 20.0, GAP)
    for wall in walls:
        proof.add(wall)
    fine, settled = np.linspace(-1.0, 1.0, 4001), 0
    while not proof.closed:
        candidate = proof.take_next()
        if candidate is None:
            continue
        settled += 1
        missed = dict.fromkeys(curves, 0.0)
        for key, curve in curves.items():
            q = curve.at(fine)
            away = np.maximum(q - candidate.high, 0.0) + np.maximum(candidate.low - q, 0.0)
            missed[key] = away.sum(axis=1).min()
        size = float((candidate.high - candidate.low).sum())
        worst = [max(missed[family, place] for place in (1, 2, 3)) for family in (0, 1)]
        assert min(worst) < 0.02 * size
        take(proof, candidate)
    assert settled
    samples = [
        grown(
            np.stack(
                [curves[key].at(fine[::500]) for key in ((0, 0), *((n, k) for k in (1, 2, 3)))]
            )
        )
        for n in (0, 1)
    ]
    assert proof.lower_bound <= min(samples)
