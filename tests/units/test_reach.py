"""Which images are within reach, held against each image moved and measured by itself."""

from itertools import product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from opl.search.reach import Reach
from opl.search.walls import Image, Moves

TURNS = 2.0 * np.pi * np.arange(-1, 2)
FLIPPED = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])
IMAGES = [
    Image(sign, np.array(shift), (flip,))
    for flip, sign in enumerate((np.ones(6), FLIPPED))
    for shift in product(TURNS, [0.0], [0.5], TURNS, [0.0, np.pi], TURNS)
]

STAYS = Image(np.ones(6), np.zeros(6), (0,))


def boxes(seed, n):
    """Return what holds a wall, by family."""
    random = np.random.default_rng(seed)
    middle, half = random.normal(0.0, 3.0, (n, 6)), random.uniform(0.0, 2.0, (n, 6))
    return dict(enumerate(np.stack([middle - half, middle + half], axis=1)))


@given(st.integers(0, 2**32), st.integers(1, 4), st.floats(0.1, 30.0))
def test_an_image_is_near_if_its_box_is_nearer_to_some_box_of_the_first_wall_than_a_size(
    seed, n, size
):
    first, around = boxes(seed, n), boxes(seed + 1, 1)
    reach = Reach(size)
    assert len(reach.near(first, 0, Moves.of([STAYS]))) == 1  # the first wall is near itself
    near = set(reach.near(around, 0, Moves.of(IMAGES)).tolist())
    for number, image in enumerate(IMAGES):
        low, high = np.sort(image.sign * around[0] + image.shift, axis=0)
        away = min(
            float(np.maximum(np.maximum(low - one[1], one[0] - high), 0.0).sum())
            for one in first.values()
        )
        assert (number in near) == (away < size) or abs(away - size) < 1e-9
