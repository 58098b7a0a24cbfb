"""Times of a motion to be written, by the places that a proof of its program recognises.

A plan knows where each configuration grinds to what its moves leave of it, up to the largest
contact error; a program is judged by where a reader finds that it grinds. On the way over the edge
of the wheel both may be hundredths of a millimetre apart, which is much of a short move. So the
times that are written are those of the recognised places. Where the part all but stands still while
the contact slides along it, nothing but the times tells which places are recognised; there they are
recognised anew by the new times, until both agree.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.toolpath import CutterPoints
from opl.job.values import Job
from opl.motion.motion import Motion
from opl.motion.timing import Timing, time_motion
from opl.proof.prove import rule_of
from opl.proof.speeds import BETWEEN
from opl.verification.recognise import recognise
from opl.verification.seen import Seen, see

MOST_ROUNDS = 12  # of recognising by the times of the round before


def recognised_times(job: Job, points: CutterPoints, motion: Motion) -> tuple[Timing, Seen]:
    """Return the times of a motion to be written, with the places that a proof will recognise.

    And what is seen of its configurations, which the proof can take.

    Args:
        job: What is requested.
        points: Its cutter points.
        motion: What is planned, in the digits of the program.

    Raises:
        UnsafeError: If the time law does not keep the limits it was given.
    """
    timing = time_motion(motion, points, job.process, job.cell.robot)
    written, duration = timing.timed.motion, timing.timed.duration
    stations, rule = np.arange(len(written)), rule_of(job)
    seen = see(job.cell, points, written.q, rule.max_contact_error)
    for _ in range(MOST_ROUNDS):
        found = recognise(job.cell, points, written.q, duration, stations, rule, seen)
        timing = time_motion(found.timed.motion, points, job.process, job.cell.robot)
        before, duration = duration, timing.timed.duration
        if np.abs(duration - before).max() * job.process.feed <= BETWEEN:
            break
    return timing, seen
