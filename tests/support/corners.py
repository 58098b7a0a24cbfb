"""Which configuration of a program is needed most."""

import numpy as np


def needed(q, numbers):
    """Return the number of that which is farthest from the line past it, from its two neighbours.

    Others may be there for the speed alone: without one a file grinds as well and is proven.
    """

    def away(number):
        start, here, end = q[number - 1], q[number], q[number + 1]
        share = (here - start) @ (end - start) / np.square(end - start).sum()
        return np.abs(here - start - share * (end - start)).max()

    return int(max(numbers, key=away))
