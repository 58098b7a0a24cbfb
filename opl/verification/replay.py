"""Replay of a motion in PyBullet: a second opinion that shares no code with the planner."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from opl.cell.workcell import WorkCell
from opl.files.beside import Beside
from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion, TimedMotion, VerifiedMotion
from opl.verification.engine import version
from opl.verification.extremes import Extreme
from opl.verification.kinematic_checks import limit_findings, missing_points
from opl.verification.stretch import HORIZON, Checked, Replaying
from opl.verification.world import World

AT_ONCE = 50  # moves of a stretch


@dataclass(frozen=True)
class Verification:
    """What a replay found.

    Attributes:
        engine: The software that replayed the motion.
        poses: Number of poses checked.
        collisions: Number of poses in which some pair was too near.
        min_clearance: Smallest distance of any pair that counts in [m], links of the arm among
            themselves included, part on wheel aside; `HORIZON` if nothing came nearer than that.
        max_contact_error: Largest distance of the ground point from the wheel's surface in [m].
        limit_violations: Number of configurations beyond a joint limit or moves beyond a joint
            speed.
        findings: What is wrong, worst of each kind and place.
        verified: The motion with its clearances, or None if anything is wrong.
        nearest: Where the smallest distance was, None if that is `HORIZON`.
        worst_contact: Where the largest contact error was, None without contact.
        deepest: Where the part was deepest in the belt, None if it never was. On the wheel the
            distance of solids is known to `GAP_ACCURACY`.
        allowed_penetration: How deep it may be in [m].
    """

    engine: str
    poses: int
    collisions: int
    min_clearance: float
    max_contact_error: float
    limit_violations: int
    findings: tuple[Finding, ...]
    verified: VerifiedMotion | None
    nearest: Extreme | None = None
    worst_contact: Extreme | None = None
    deepest: Extreme | None = None
    allowed_penetration: float = 0.0


def replay(
    cell: WorkCell,
    points: CutterPoints,
    timed: TimedMotion,
    max_contact_error: float,
    progress: Callable[[float], None] = lambda fraction: None,
    beside: Beside | None = None,
) -> Verification:
    """Replay a motion and check collisions, contact, limits, speeds and completeness.

    Args:
        cell: The cell.
        points: The cutter points that are to be ground.
        timed: The motion and its times.
        max_contact_error: Largest distance of the ground point from the wheel's surface allowed,
            in [m].
        progress: Called with the part of the motion that is done, 0 to 1.
        beside: What may work beside this process, if anything.
    """
    motion = timed.motion
    given = cell, points, motion, max_contact_error
    stretches = [
        range(first, min(first + AT_ONCE, len(motion))) for first in range(0, len(motion), AT_ONCE)
    ]
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1])).max(axis=1)
    run, *others = (beside or Beside()).share(
        _replaying, given, stretches, progress, lambda moves: turned[moves.start : moves.stop].sum()
    )
    for other in others:
        run.add(other)
    limits = limit_findings(cell, timed)
    worst = (finding for _, finding in run.worst.values())
    findings = (*worst, *limits, *missing_points(points, motion))
    return Verification(
        engine=f"PyBullet {version()}",
        poses=run.poses,
        collisions=run.collisions,
        min_clearance=float(min(HORIZON, np.min(run.clearance))),
        max_contact_error=max(0.0, -run.contact.amount),
        limit_violations=len(limits),
        findings=findings,
        verified=None if findings else VerifiedMotion(timed, run.clearance),
        nearest=run.nearest.found(motion),
        worst_contact=run.contact.found(motion, -1.0),
        deepest=run.gap.found(motion, -1.0),
        allowed_penetration=cell.max_belt_penetration,
    )


@contextmanager
def _replaying(
    cell: WorkCell, points: CutterPoints, motion: Motion, max_contact_error: float
) -> Iterator[Callable[[range], Checked]]:
    """Open what replays stretches of a motion."""
    with World(cell) as world:
        yield Replaying(cell, world, points, motion, max_contact_error).checked
