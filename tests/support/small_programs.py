"""Small programs in every language, with actions around their passes, planned and proven once.

Two short rows of the V part from a home near the wheel, on an arm of the language's maker; rows of
the S part; and of a bar with an arched top, which is no part that comes with opl.
"""

import copy
import json
import runpy
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import trimesh
import yaml

from opl.files.digests import digest
from opl.files.resources import folder
from opl.geometry.toolpath import CutterPoints
from opl.job.load import load_job
from opl.job.values import Job
from opl.motion.motion import Motion
from opl.proof.prove import reader_of
from opl.run import stages
from opl.run.stages import run_job
from opl.run.surfacing import cut_surface
from opl.run.values import Written
from tests.support.jobs import GONE, write_job

EXAMPLE = Path(__file__).parents[2] / "examples" / "03_surface_from_python.py"
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
# of the S part instead of the V part
S_PART = {
    "passes.end_margin_mm": 40,
    "search.contact_positions": 45,
    "process.approach_mm": 20,
    "process.home_deg": [25, -20, -66, 84, -85, -69],
}
# what attacks take: a controller, and a part
PROGRAMS = {
    **{name: {"controller": name} for name in ARMS},
    "KRL straight": {"controller": "KRL", "motion": "straight"},
    "S part": {"controller": "DX200", "part": "s_shape"},
    "arch": {"controller": "DX200", "part": "arch"},
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
    def digest(self) -> str:
        """Digest of its file."""
        return digest(self.text.encode("ascii"))

    @property
    def motion(self) -> Motion:
        """The proven configurations that are written, one for each move."""
        rows = [move.motion_index for move in self.run.program.moves]
        return self.run.proven.motion.motion.take(rows)

    @property
    def asked_times(self) -> np.ndarray:
        """The time in [s] that the feed asks of each of these moves."""
        rows = [move.motion_index for move in self.run.program.moves]
        ends = np.cumsum(self.run.proven.motion.timed.duration)[rows]
        return np.diff(ends, prepend=0.0)

    def read(self, text):
        """Read a text as this program is read."""
        files = {self.name: text.encode("ascii")}
        return reader_of(self.job).read(files, self.job.cell.robot, self.job.program)


def small_program(controller, part="v_shape", motion="joint"):
    """Return the small program of a controller: of a part that comes with opl, or ``arch``.

    Of joint moves, or with straight ones on the wheel, or those past a stationary tool on request.
    """
    return _made(controller, part, motion)


@cache
def _made(controller, part, motion):
    drawn = stages.draw_charts
    stages.draw_charts = lambda *_: {}  # pictures take longer than all the rest
    try:
        with tempfile.TemporaryDirectory() as folder:
            job = _arch() if part == "arch" else _shipped(controller, part, motion, Path(folder))
            run = run_job(job)
    finally:
        stages.draw_charts = drawn
    assert isinstance(run, Written), run.reasons
    suffix = reader_of(job).suffix
    ((name, text),) = ((n, t) for n, t in run.files.items() if n.endswith(suffix))
    return SmallProgram(job, cut_surface(job).points, run, name, text)


def _shipped(controller, part, motion, home):
    robot, home_deg = ARMS[controller]
    keys = {
        "robot": robot,
        "search.method": "recursive",
        "passes.rows": 2,
        "passes.end_margin_mm": 75,
        "passes.max_step_mm": 12,
        "passes.max_chord_error_mm": 0.05,
        "search.max_contact_error_mm": 0.1,
        "wheel.max_belt_penetration_mm": 0.5,
        "process.home_deg": list(home_deg),
        # rows this short end where the arms pivot; what is attacked is the file
        "process.max_dwell_s": 10,
        "program.controller": controller,
        "program.motion": "straight" if motion == "stationary" else motion,
        **ACTIONS,
    }
    if motion == "stationary":
        keys["program.stationary_tool"] = True
    if controller != "DX200":
        keys["program.accept_unverified_pulses"] = GONE
    if part == "v_shape":
        return load_job(write_job(home, keys))
    shutil.copytree(folder("workpieces") / part, home, dirs_exist_ok=True)
    content = yaml.safe_load((home / "job.yaml").read_text())
    for path, value in {**keys, **S_PART}.items():
        section, key = path.split(".") if "." in path else (None, path)
        (content if section is None else content[section])[key] = value
    (home / "job.yaml").write_text(yaml.safe_dump(content))
    return load_job(home / "job.yaml")


def _arch():
    """Return the job of the example with a surface from Python, with the actions of the others."""
    content, surface, part = _arched_bar()
    content["passes"].update(end_margin_mm=25, max_chord_error_mm=0.05)
    content["search"].update(max_contact_error_mm=0.1, method="recursive")
    for path, value in ACTIONS.items():
        content["program"][path.split(".")[1]] = value
    return load_job(content, surface=surface, part=part)


def _arched_bar():
    example = runpy.run_path(str(EXAMPLE))
    return copy.deepcopy(example["JOB"]), example["arched_top"](), example["bar"]()


def write_arch(home):
    """Write the example with a surface from Python as files, the job searched as by default."""
    content, surface, part = _arched_bar()
    home.mkdir(parents=True)
    net = {
        "degree_u": surface.degree_u,
        "degree_v": surface.degree_v,
        "knots_u": surface.knots_u.tolist(),
        "knots_v": surface.knots_v.tolist(),
        "control_points_mm": (1e3 * surface.control_points).tolist(),
        "weights": surface.weights.tolist(),
    }
    (home / "arch.json").write_text(json.dumps(net), encoding="utf-8")
    trimesh.Trimesh(1e3 * part.vertices, part.faces).export(home / "arch.stl")
    content["workpiece"] = {"surface": "arch.json", "mesh": "arch.stl", "mesh_unit": "mm"}
    path = home / "job.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path
