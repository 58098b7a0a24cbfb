"""Which part of a motion a move is, as a person would look for it."""

from __future__ import annotations

from opl.motion.motion import Motion, Stretch


def where(motion: Motion, move: int) -> str:
    """Name the place of the move that ends at posture ``move``."""
    index = motion.pass_index[move] + 1  # people count passes from 1
    stretch = motion.stretch[move]
    if stretch in (Stretch.GRIND, Stretch.BETWEEN):
        return f"pass {index}, cutter point {motion.cutter_point[move]:.4g}"
    if stretch is Stretch.HOME:
        return "way home" if index == 0 and move > 0 else "way from home"
    return f"{stretch.value} of pass {index}"
