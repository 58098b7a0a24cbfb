"""Tracks at contact positions of their own, between those of the field, and nodes about them.

And through places between cutter points, where a way is longer than from posture to posture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.geometry.frames import Array
from opl.motion.path import GrindingPath
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem

SAMPLES = 17  # contact positions about each of a track
ABOUT = 2.0  # spacings of the field to either side, where nothing nearer is wanted


@dataclass(frozen=True)
class OwnTrack:
    """A track over some places.

    Attributes:
        places: Fractional cutter points, shape (n,).
        ik_branch: Slot of the inverse kinematics of each, shape (n,).
        t: Contact positions in belt units, shape (n,).
        q: Joint positions in [rad], shape (n, 6).
        cost: What it costs; infinite where that is not known.
    """

    places: Array
    ik_branch: np.ndarray
    t: Array
    q: Array
    cost: float = np.inf

    def at(self, places: Array) -> OwnTrack:
        """Return it over more places, all of one pass: those between by interpolation."""
        t = np.interp(places, self.places, self.t)
        q = np.stack([np.interp(places, self.places, joint) for joint in self.q.T], axis=-1)
        return OwnTrack(places, np.full(len(places), self.ik_branch[0]), t, q)


def tracks_of(path: GrindingPath) -> list[OwnTrack]:
    """Return the tracks of the passes of a path."""
    found = []
    for index, ik_branch in enumerate(path.ik_branches.tolist()):
        rows = np.flatnonzero((path.pass_index == index) & (path.cutter_point % 1.0 == 0.0))
        branches, t = np.full(len(rows), ik_branch), path.contact_position[rows]
        found.append(OwnTrack(path.cutter_point[rows], branches, t, path.q[rows]))
    return found


def joined(tracks: Sequence[OwnTrack]) -> OwnTrack:
    """Return tracks of the passes as one."""
    return OwnTrack(
        np.concatenate([one.places for one in tracks]),
        np.concatenate([one.ik_branch for one in tracks]),
        np.concatenate([one.t for one in tracks]),
        np.concatenate([one.q for one in tracks]),
        sum(one.cost for one in tracks),
    )


def nodes_about(
    problem: GrindingProblem, track: OwnTrack, about: float = ABOUT
) -> tuple[Array, Array]:
    """Sample contact positions about those of a track, its own in the middle.

    Args:
        problem: What is to be planned.
        track: The track.
        about: How far they lie to either side, in spacings of the field.

    Returns:
        Contact positions, shape (n, `SAMPLES`); joint positions in [rad], NaN out of reach, beyond
        the limits and where the part cuts into the wheel, shape (n, `SAMPLES`, 6).
    """
    positions = problem.field.contact_positions
    last, apart = positions[-1], about * np.diff(positions).mean()
    t = np.clip(track.t[:, None] + apart * np.linspace(-1.0, 1.0, SAMPLES), -last, last)
    points = problem.points.at_places(track.places)
    solutions = inverse_solutions(problem.cell, points.Ts_workpiece_cutter[:, None], t)
    branch = track.ik_branch[:, None, None, None]
    q = nearest_turn(np.take_along_axis(solutions, branch, axis=2)[:, :, 0], track.q[:, None])
    exists = problem.cell.within_limits(q)
    exists &= ~problem.cuts_at(track.places, points, t)
    q[~exists] = np.nan
    return t, q
