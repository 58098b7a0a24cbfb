"""Small programs in every language, with actions around their passes, planned and proven once.

Two short rows of the V part from a home near the wheel, on an arm of the language's maker.
"""

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job, load_job
from opl.motion.motion import Motion
from opl.proof.prove import reader_of
from opl.run import stages
from opl.run.stages import run_job
from opl.run.surfacing import cut_surface
from opl.run.values import Written
from tests.support.jobs import GONE, write_job

# robot and home in [deg]
ARMS = {
    "DX200": ("mh24", (20, -30, -55, -5, 48, 120)),
    "RAPID": ("irb2600", (31, -15, 49, 44, -44, -13)),
    "KRL": ("kr16", (146, -115, -93, 128, -43, 22)),
    "FANUC": ("m20ia", (-148, -6, 188, -65, -34, 38)),
    "URSCRIPT": ("ur10e", (-136, -95, -102, -163, -58, -68)),
}
ACTIONS = {
    "program.at_start": [
        {"comment": "BELT MUST RUN"},
        {"output": 5, "state": True},
        {"wait_input": 3, "state": True, "timeout_s": 2.5},
    ],
    "program.before_pass": [
        {"output": 12, "state": True},
        {"wait_input": 4, "state": True, "timeout_s": 1.5},
        {"dwell_s": 0.5},
    ],
    "program.after_pass": [{"output": 12, "state": False}, {"wait_input": 4, "state": False}],
    "program.at_end": [{"output": 5, "state": False}, {"call": "PARK"}],
}


@dataclass(frozen=True, eq=False)
class SmallProgram:
    """A program that a run wrote.

    Attributes:
        job: Its job.
        points: The cutter points of the job.
        run: The run that wrote it.
        name: Of its file.
        text: What stands in it.
    """

    job: Job
    points: CutterPoints
    run: Written
    name: str
    text: str

    @property
    def motion(self) -> Motion:
        """The proven configurations that are written, one for each move."""
        rows = [move.motion_index for move in self.run.program.moves]
        return self.run.proven.motion.motion.take(rows)

    def read(self, text):
        """Read a text as this program is read."""
        files = {self.name: text.encode("ascii")}
        return reader_of(self.job).read(files, self.job.cell.robot, self.job.program)


def small_program(controller, changes=()):
    """Return the small program of a controller, its job changed by values of dotted key paths."""
    return _made(controller, tuple(dict(changes).items()))


@cache
def _made(controller, changes):
    robot, home = ARMS[controller]
    keys = {
        "robot": robot,
        "search.method": "recursive",
        "passes.rows": 2,
        "passes.end_margin_mm": 70,
        "process.home_deg": list(home),
        "program.controller": controller,
        **ACTIONS,
        **dict(changes),
    }
    if controller != "DX200":
        keys["program.accept_unverified_pulses"] = GONE
    drawn = stages.draw_charts
    stages.draw_charts = lambda planned: {}  # pictures take longer than all the rest
    try:
        with tempfile.TemporaryDirectory() as folder:
            job = load_job(write_job(Path(folder), keys))
            run = run_job(job)
    finally:
        stages.draw_charts = drawn
    assert isinstance(run, Written), run.reasons
    suffix = reader_of(job).suffix
    ((name, text),) = ((n, t) for n, t in run.files.items() if n.endswith(suffix))
    return SmallProgram(job, cut_surface(job).points, run, name, text)
