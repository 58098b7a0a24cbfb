"""The job file: YAML in, values in SI out. Keys, units and defaults are known only here.

Its sections, and the cell file that many jobs share, are the modules named ``job_...``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from opl.cell.workcell import WorkCell
from opl.documents import read
from opl.errors import InputError
from opl.geometry.passes import MachinedSurface, Passes
from opl.job.around import Surroundings, check_home, surroundings
from opl.job.bodies import bodies_in_si, pose_of
from opl.job.file import JobFile
from opl.job.search import Method, Search
from opl.motion.process import ProcessSettings
from opl.program.settings import ProgramSettings


@dataclass(frozen=True)
class Job:
    """Everything a job file says, validated, in SI.

    Attributes:
        path: The file, as the user named it.
        name: Name of the program.
        cell: Robot, wheel, part and surroundings.
        around: Where the surroundings come from.
        surface: The surface to be ground, in the workpiece frame.
        passes: How the surface is cut.
        search: How the path is sought.
        process: Speeds, approach and home.
        program: How the program is written.
    """

    path: Path
    name: str
    cell: WorkCell
    around: Surroundings
    surface: MachinedSurface
    passes: Passes
    search: Search
    process: ProcessSettings
    program: ProgramSettings


def load(path: Path, method: str | None = None) -> Job:
    """Read and validate a job file and the files it names, relative to its folder.

    Args:
        path: The file.
        method: Search to use instead of the job's own.

    Raises:
        InputError: If anything in it is unusable; names file and key path.
    """
    file = read(path, JobFile)
    around = surroundings(path, file)
    robot = file.program.robot_as_counted(path, around.robot)
    robot = file.process.robot_as_limited(robot)
    fixture = (*around.gripper, *bodies_in_si(path, "fixture.bodies", file.fixture.bodies))
    if file.search.max_contact_error_mm <= file.passes.bow_height_mm:
        raise InputError(
            f"{path}: search.max_contact_error_mm",
            f"must be larger than passes.bow_height_mm, which is part of it, "
            f"got {file.search.max_contact_error_mm:g} and {file.passes.bow_height_mm:g}",
        )
    part = file.workpiece.load_part(path)
    surface = file.workpiece.load_surface(path)
    file.workpiece.check_sizes(path, surface, part)
    file.workpiece.check_outside(path, surface, part)
    cell = WorkCell(
        robot=robot,
        wheel=around.placed.wheel,
        obstacles=around.obstacles,
        part=part,
        fixture=fixture,
        T_flange_workpiece=pose_of(file.fixture.T_flange_workpiece_mm),
        contact_allowance=around.placed.contact_allowance,
        required_clearance=around.clearance,
        pairs=around.pairs,
        limits=around.limits,
    )
    check_home(around.home_key, cell, around.home)
    search = file.search.in_si(file.passes.bow_height_mm)
    if method is not None:
        search = replace(search, method=Method(method))
    return Job(
        path=path,
        name=file.name,
        cell=cell,
        around=around,
        surface=surface,
        passes=file.passes.in_si(path, surface, cell.wheel.radius),
        search=search,
        process=file.process.in_si(around.home),
        program=file.program.in_si(path, file.name, robot, around.home),
    )
