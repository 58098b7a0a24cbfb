"""What joint range sum is hoped for: the proof of the least looks at smaller boxes only.

What a box that holds a posture of every place tells, or a motion; a guess where neither does. When
it is proven that nothing is as good, a little more is hoped for, soon much more.
"""

from __future__ import annotations

from opl.planning.plan import AT_REST

RAISED = 1.004  # times what was hoped for and does not exist: what is hoped for next
GUESSED = 1.5  # times what is proven: what is hoped for where no box tells
LITTLE = 0.1  # of all work: what is hoped for rises faster where that tells that it does not exist
FIRST_GUESS = 0.5  # [rad] what is hoped for where nothing is proven either


class Hope:
    """What is hoped for.

    Args:
        told: Whether a motion tells.
    """

    def __init__(self, told: bool) -> None:
        self._told = told
        self._raised = RAISED  # grows as long as no new box tells, and rising costs little
        self._least = 0.0  # what is proven not to exist

    def told(self, size: float, hoped: float) -> float:
        """Return what is hoped for in [rad] where a box of a size tells; so much was before."""
        self._told = True
        # a size of 0 could not be raised; below this a motion counts as at rest anyhow
        least = max(size, self._least, AT_REST)
        if least >= hoped:
            return hoped
        self._raised = RAISED
        return least

    def guess(self, proven: float, best: float) -> float:
        """Return what to hope for at first, in [rad]: all images of all walls are many."""
        return best if self._told else min(max(GUESSED * proven, FIRST_GUESS), best)

    def more(self, hoped: float, best: float, found: bool, share: float) -> float:
        """Return what is hoped for next where what was does not exist, in [rad].

        Args:
            hoped: What was hoped for.
            best: The best motion known, or more than any has.
            found: Whether a motion is known.
            share: How much of all work so far it took to find out.
        """
        raised = self._raised if self._told else GUESSED
        faster = not found or share < LITTLE
        self._raised = min(self._raised**2, GUESSED) if faster else RAISED
        # boxes may lower a guess, but not to what does not exist, which they would tell again
        self._least = min(best, hoped * RAISED)
        return min(best, hoped * raised)
