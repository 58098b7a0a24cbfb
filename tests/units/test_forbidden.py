"""What is forbidden of walls, each flip of the wrist for itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.search.forbidden import crossed_by_any
from opl.search.least_box import BoxProof
from opl.search.walls import Image, Line, Piece, Wall

# the wrist flipped makes the fifth joint negative
FLIPPED = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])
IMAGES = Image(np.ones(6), np.zeros(6), (0,)), Image(FLIPPED, np.zeros(6), (1,))


def ramp(place, joint):
    """Return a wall over which one joint turns from 0 to 1 rad, the fifth at half a radian."""
    corners = np.outer(np.linspace(0.0, 1.0, 11), np.eye(6)[joint]) + 0.5 * np.eye(6)[4]
    nothing = np.zeros((10, 6))
    piece = Piece(0, Line(np.eye(4)), np.linspace(0.0, 1.0, 11), corners, nothing, nothing)
    return Wall(0, place, (piece,))


class LowCells:
    """Forbids what a wall has below some share of it, for each flip another."""

    def __init__(self, walls, shares):
        self._shares = {
            id(wall.pieces[0]): share for wall, share in zip(walls, shares, strict=True)
        }

    @property
    def n_flips(self):
        return 2

    def clear(self, piece, flip, first, end, looks):
        share = self._shares.get(id(piece), (0.0, 0.0))[flip]
        low = np.clip(10.0 * share - np.arange(len(piece.pad_low)), 0.0, 1.0)
        high = np.ones(len(low))
        low[low == 1.0], high[low == 1.0] = 1.0, 0.0
        return low, high


def least(shares):
    """Return the least box over two walls and whether the motion has the wrist flipped."""
    walls = ramp(0.0, 0), ramp(1.0, 1)
    proof = BoxProof(lambda _: IMAGES, lambda *_: (), 3.0, 1e-4, LowCells(walls, shares))
    for wall in walls:
        proof.add(wall)
    while not proof.closed:
        candidate = proof.take_next()
        if candidate is not None:
            return candidate.bound, candidate.mirrored
    return np.inf, None


def test_a_motion_keeps_its_range_where_the_same_is_allowed_with_the_wrist_flipped():
    bound, mirrored = least([(0.7, 0.0), (0.7, 0.0)])
    assert bound == pytest.approx(0.0, abs=1e-3)
    assert mirrored


def test_cells_are_cut_where_the_forbidden_part_ends():
    # the walls turn different joints: where both begin, nothing turns
    for flips in ([(0.25, 0.4), (0.35, 0.55)], [(0.4, 0.25), (0.55, 0.35)]):
        bound, mirrored = least(flips)
        assert bound == pytest.approx(0.25 + 0.35, abs=1e-3)
        assert mirrored == (flips[0][0] > flips[0][1])


def test_nothing_is_left_where_all_flips_of_a_wall_are_forbidden():
    assert least([(1.0, 1.0), (0.0, 0.0)])[0] == np.inf


KINDS = [(family, side) for family in (0, 1) for side in (0, 1)]
# of each kind of posture whether it has a piece, and whether either flip of it is forbidden
SHUT = st.tuples(*[st.tuples(st.booleans(), st.booleans(), st.booleans()) for _ in KINDS])


@given(st.lists(st.tuples(st.integers(0, 1), SHUT), min_size=1, max_size=5))
def test_a_pass_needs_one_posture_in_which_all_its_walls_can_be_crossed(drawn):
    template = ramp(0.0, 0).pieces[0]
    pieces = [
        [
            replace(template, family=f, side=s) if of[0] else None
            for (f, s), of in zip(KINDS, shut, strict=True)
        ]
        for _, shut in drawn
    ]
    walls = [
        Wall(index, float(k), tuple(piece for piece in pieces[k] if piece is not None))
        for k, (index, _) in enumerate(drawn)
    ]
    forbidden = LowCells([], [])
    for own, (_, shut) in zip(pieces, drawn, strict=True):
        for piece, (_, one, other) in zip(own, shut, strict=True):
            forbidden._shares[id(piece)] = float(one), float(other)

    def open_to(index, kind, flip):
        return all(of[kind][0] and not of[kind][1 + flip] for own, of in drawn if own == index)

    wanted = all(
        any(open_to(index, kind, flip) for kind in range(len(KINDS)) for flip in (0, 1))
        for index in {index for index, _ in drawn}
    )
    assert crossed_by_any(walls, forbidden) == wanted
    with_pieces = all(
        any(all(of[k][0] for own, of in drawn if own == index) for k in range(len(KINDS)))
        for index in {index for index, _ in drawn}
    )
    assert crossed_by_any(walls, None) == with_pieces


def test_a_wall_is_looked_at_as_far_as_its_first_cell_that_is_left_and_no_further():
    corners = np.outer(np.linspace(0.0, 1.0, 101), np.eye(6)[0])
    nothing = np.zeros((100, 6))
    piece = Piece(0, Line(np.eye(4)), np.linspace(0.0, 1.0, 101), corners, nothing, nothing)
    asked = []

    class Cells(LowCells):
        def clear(self, piece, flip, first, end, looks):
            asked.append((flip, first, end))
            low, high = super().clear(piece, flip, 0, 100, looks)
            outside = np.arange(100) < first, np.arange(100) >= end
            high[outside[0] | outside[1]] = 1.0  # what is not asked about is not known
            return low, high

    walls = [Wall(0, 0.0, (piece,))]
    assert crossed_by_any(walls, Cells(walls, [(5.0, 5.0)]))  # half of it, for either flip
    assert asked == [(0, 0, 32), (0, 32, 64)]
    asked.clear()
    assert not crossed_by_any(walls, Cells(walls, [(10.0, 10.0)]))
    assert [flip for flip, _, _ in asked] == [0] * 4 + [1] * 4
    assert asked[3] == (0, 96, 100)


class OnlySeenClosely(LowCells):
    """Forbids what `LowCells` does of a piece once it is looked at so closely, and notes where."""

    def __init__(self, walls, shares, looks):
        super().__init__(walls, shares)
        self._looks, self.seen = looks, []

    def clear(self, piece, flip, first, end, looks):
        if looks >= self._looks:
            self.seen.append((piece, first, end))
        if not any(seen is piece for seen, *_ in self.seen):
            none = np.zeros(len(piece.pad_low))
            return none, none + 1.0
        return super().clear(piece, flip, first, end, looks)


def proposed(proof):
    """Return the first candidate of a proof."""
    while (candidate := proof.take_next()) is None:
        pass
    return candidate


def proof_with_a_chain(cells, share, looks, images):
    """Return a proof of a column and a chain of cells, a share of which is seen closely only."""
    chain = replace(ramp(0.5, 1), chain=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    walls = [ramp(0.0, 0), replace(chain, pieces=(chain.pieces[0].part(0, cells),))]
    forbidden = OnlySeenClosely(walls, [(0.0, 0.0), (share, share)], looks)
    proof = BoxProof(lambda _: images, lambda *_: (), 3.0, 1e-4, forbidden)
    for wall in walls:
        proof.add(wall)
    assert proposed(proof).bound == pytest.approx(0.0, abs=1e-3)
    return proof, forbidden


def test_chains_are_looked_at_closely_only_where_they_are_asked_for():
    proof, _ = proof_with_a_chain(10, 0.4, 2, IMAGES)
    assert not proof.clear([0.0], chains=False)
    assert proof.clear([0.0], chains=True)
    proof.put_back()
    assert proposed(proof).bound == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize("cells", [1, 10])
def test_one_cell_of_a_chain_alone_is_looked_at_as_closely_as_can_be(cells):
    proof, forbidden = proof_with_a_chain(cells, 0.05, 3, IMAGES[:1])
    assert not proof.clear([0.0], chains=False)
    assert proof.clear([0.0], chains=True) == (cells == 1)
    assert [where for _, *where in forbidden.seen] == ([[0, 1]] if cells == 1 else [])
