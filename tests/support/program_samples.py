"""A small made-up motion and robot, shared by the tests of opl.program."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from opl.cell.robot_loading import load_robot
from opl.motion.motion import Motion, MoveKind, TimedMotion, VerifiedMotion
from opl.program.pulses import PulseScale

JOINT_NAMES = ("S", "L", "U", "R", "B", "T")
DATE = datetime(2024, 3, 5, 7, 9)
MAX_SPEED = np.deg2rad([197.0, 190.0, 210.0, 410.0, 410.0, 620.0])
# An MH24 with made-up pulses, all of them verified.
ROBOT = replace(
    load_robot("mh24"),
    pulses_per_radian=np.rad2deg([1300.0, 1900.0, 1600.0, 1000.0, 980.0, 450.0]),
    unverified_pulses=(),
)
UNVERIFIED = replace(ROBOT, unverified_pulses=("R", "B", "T"))
SCALE = PulseScale.of(ROBOT)
HOME = np.deg2rad([0.0, -20.0, 10.0, 0.0, -60.0, 0.0])


def verified_motion(n_passes=2, n_points=4, home_between=False):
    """Passes of n_points cutter points with one node between the first two of them.

    The approach ends where the grinding begins, so that configuration is given twice. On request
    the robot comes home between passes.
    """
    q, rows = [HOME], [(0.0, MoveKind.HOME, np.nan, np.nan, -1, 0.5)]

    def go(configuration, *row):
        q.append(configuration)
        rows.append(row)

    for k in range(n_passes):
        start = np.deg2rad([30.0, 10.0 + k % 7, 0.0, 20.0, -80.0, 40.0])
        before = start + np.deg2rad([0.0, -3.0, 0.0, 0.0, 1.0, 0.0])
        free = MoveKind.LINK if k else MoveKind.HOME
        if k and home_between:
            go(HOME, 1.5, free, np.nan, np.nan, k, 0.5)
        go(before, 1.0, free, np.nan, np.nan, k, 0.08)
        go((before + start) / 2, 0.1, MoveKind.APPROACH, np.nan, np.nan, k, 0.03)
        go(start, 0.1, MoveKind.APPROACH, np.nan, np.nan, k, 0.001)
        places = sorted([0.5, *range(n_points)])
        for place in places:
            configuration = start + place * np.deg2rad([0.11, 0.05, -0.07, 0.3, 0.02, -0.4])
            kind = MoveKind.BETWEEN if place == 0.5 else MoveKind.GRIND
            step = 0.0 if place == 0 else 0.05 if place in (0.5, 1) else 0.1
            go(configuration, step, kind, place - 1.0, k * n_points + place, k, 0.002)
        end = q[-1]
        for share in (0.5, 1.0):
            away = end + share * (before - start)
            go(away, 0.1, MoveKind.RETRACT, np.nan, np.nan, k, 0.1)
    go(HOME, 1.5, MoveKind.HOME, np.nan, np.nan, -1, 0.5)
    duration, kind, contact, cutter, pass_index, clearance = zip(*rows, strict=True)
    motion = Motion(np.array(q), kind, np.array(contact), np.array(cutter), np.array(pass_index))
    return VerifiedMotion(TimedMotion(motion, np.array(duration)), np.array(clearance))


def with_times(verified, duration, q=None):
    """Return a verified motion with other times, and other configurations if given."""
    motion = verified.motion if q is None else replace(verified.motion, q=q)
    return replace(verified, timed=TimedMotion(motion, np.asarray(duration, dtype=float)))


def slowed(verified, factor):
    """Return a verified motion with its passes ground in a multiple of their time."""
    on_wheel, duration = verified.motion.on_wheel, verified.timed.duration
    return with_times(verified, np.where(on_wheel, duration * factor, duration))
