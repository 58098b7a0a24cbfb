"""The motion as an object of the document: the whole cell, at one moment of it.

The document's origin is then the robot's base frame, and what stands at the part's place is hidden.
"""

from __future__ import annotations

import math
from typing import Any

from .found import cell_of, motion_of
from .job_object import Proxy, is_of

KIND = "OplMotion"


class MotionView(Proxy):
    """The cell at a moment."""

    def __init__(self, obj: Any, job: Any) -> None:
        super().__init__(obj, KIND)
        add = obj.addProperty
        add("App::PropertyLink", "Job", "Motion", "The job whose motion this is")
        add("App::PropertyFloat", "Moment", "Motion", "Time since the start in s")
        add("App::PropertyFloat", "Seconds", "Motion", "How long the motion takes", 1)
        add("App::PropertyString", "Where", "Motion", "What is done at this moment", 1)
        add("App::PropertyFloatList", "Posture", "Motion", "Joint positions in degrees", 1)
        add("App::PropertyPlacement", "Part", "Motion", "The part in the robot's base frame", 1)
        obj.Job = job

    def execute(self, obj: Any) -> None:
        """Take the posture of the moment: without a motion, the one at home."""
        if obj.Job is None:
            return
        motion, cell = motion_of(obj.Job), cell_of(obj.Job)
        if cell is None:
            return
        obj.Seconds = 0.0 if motion is None else motion.seconds
        q = cell.home if motion is None else motion.posture(obj.Moment)
        obj.Where = "at home, no motion" if motion is None else motion.where(obj.Moment)
        obj.Part = cell.part(q)
        obj.Posture = [math.degrees(angle) for angle in q]


def motion_view_of(job: Any) -> Any:
    """Return the object that shows the motion of a job, made if there is none."""
    for obj in job.InList:
        if is_of(obj, KIND):
            return obj
    obj = job.Document.addObject("App::FeaturePython", "Motion")
    MotionView(obj, job)
    return obj


def show_moment(obj: Any, moment: float) -> None:
    """Show another moment of the motion."""
    obj.Moment = moment
    obj.recompute()
