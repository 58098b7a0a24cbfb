"""Yaskawa INFORM jobs (.JBI): written from a program, read from any controller.

INFORM calls the frame at the end of the arm TOOL; here that is the workpiece, which the robot holds
while the wheel stands still. Joint moves between pulse positions do not depend on it.
"""

from opl.program.inform.faults import job_faults
from opl.program.inform.parse import parse, read_jobs, unparse
from opl.program.inform.post import write_jobs
from opl.program.inform.render import TEMPLATE, render

__all__ = ["TEMPLATE", "job_faults", "parse", "read_jobs", "render", "unparse", "write_jobs"]
