"""The job file: YAML in, values in SI out. Keys, units and defaults are known only in this room.

Its sections, and the cell file that many jobs share, are the other modules of the room.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from opl.cell.workcell import WorkCell
from opl.errors import InputError
from opl.files.documents import check, content_of
from opl.geometry.mesh import TriangleMesh
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.passes import MachinedSurface
from opl.geometry.patchwork import Face, Patchwork
from opl.job.around import check_home, surroundings
from opl.job.bodies import bodies_in_si, pose_of
from opl.job.file import JobFile
from opl.job.inputs import input_digests
from opl.job.methods import Method
from opl.job.process import check_leads
from opl.job.source import Source
from opl.job.sweeps import with_value
from opl.job.user_frame import home_in_user_frame
from opl.job.values import Job
from opl.job.workpiece import GIVEN
from opl.program.led import StationaryTool


def load_job(
    source: Path | str | Mapping[str, Any],
    *,
    folder: Path | None = None,
    method: str | None = None,
    changes: Mapping[str, Any] | None = None,
    surface: NurbsSurface | MachinedSurface | None = None,
    part: TriangleMesh | None = None,
) -> Job:
    """Read and validate a job and the files that it names.

    Args:
        source: A job file, or a mapping of the same keys.
        folder: Where the relative file names in it are looked up; else the folder of the file, or
            the current folder for a mapping.
        method: Search to use instead of the job's own.
        changes: Values by key path, as ``wheel.radius_mm``, that stand instead of the job's own.
        surface: The surface to be ground, in the workpiece frame, instead of the one that
            ``workpiece`` names. The outside of a `NurbsSurface` is that of du x dv.
        part: The solid for collisions, in the workpiece frame, instead of the one that
            ``workpiece`` names.

    Raises:
        InputError: If anything in it is unusable; names file and key path. Messages on a mapping
            begin with ``job``.
    """
    given = {key for key, value in (("surface", surface), ("part", part)) if value is not None}
    checked = check_job(source, folder, changes, given)
    if isinstance(surface, NurbsSurface):
        surface = Patchwork((Face(surface),))
    return job_in_si(checked, method, surface, part)


@dataclass(frozen=True)
class CheckedJob:
    """What a job says, before any file that it names is read.

    Attributes:
        source: The file or mapping.
        content: Its keys and values.
        file: The same, validated.
    """

    source: Source
    content: object
    file: JobFile


def check_job(
    source: Path | str | Mapping[str, Any],
    folder: Path | None = None,
    changes: Mapping[str, Any] | None = None,
    given: Set[str] = frozenset(),
) -> CheckedJob:
    """Read and validate a job alone; arguments and errors are those of `load_job`.

    Args:
        source: A job file, or a mapping of the same keys.
        folder: Where the relative file names in it are looked up.
        changes: Values by key path that stand instead of the job's own.
        given: What a program gives beside it, of ``surface`` and ``part``.
    """
    content: object
    if isinstance(source, Mapping):
        origin, content = Source("job", folder or Path()), dict(source)
    else:
        origin, content = Source.of_file(Path(source)), content_of(Path(source))
        origin = replace(origin, folder=folder or origin.folder)
    for path, value in (changes or {}).items():
        content = with_value(content, path, value)
    if len(given) == 2 and isinstance(content, dict):
        content = {"workpiece": {}, **content}  # nothing is left for it to say
    return CheckedJob(origin, content, check(content, JobFile, origin.label, {GIVEN: given}))


def job_in_si(
    checked: CheckedJob,
    method: str | None = None,
    surface: MachinedSurface | None = None,
    part: TriangleMesh | None = None,
) -> Job:
    """Return a job that is validated, with the files that it names; see `load_job`."""
    job = _in_si(checked.file, checked.source, method, surface, part)
    values = {"surface": surface, "part": part}
    inputs = input_digests(checked.source, checked.content, job.cell.robot, values)
    return replace(job, inputs=inputs)


def _in_si(file: JobFile, source: Source, method: str | None,
           surface: MachinedSurface | None, part: TriangleMesh | None) -> Job:  # fmt: skip
    around = surroundings(source, file)
    robot = file.program.robot_as_counted(source, around.cell.robot)
    robot = file.process.robot_as_limited(robot)
    fixture = (*around.cell.gripper, *bodies_in_si(source, "fixture.bodies", file.fixture.bodies))
    if file.search.max_contact_error_mm <= file.passes.max_chord_error_mm:
        raise InputError(
            source.at("search.max_contact_error_mm"),
            f"must be larger than passes.max_chord_error_mm, which is part of it, "
            f"got {file.search.max_contact_error_mm:g} and {file.passes.max_chord_error_mm:g}",
        )
    part = file.workpiece.load_part(source) if part is None else part
    surface = file.workpiece.load_surface(source) if surface is None else surface
    file.workpiece.check_sizes(source, surface, part)
    file.workpiece.check_outside(source, surface, part)
    cell = WorkCell(
        robot=robot,
        wheel=around.placed.wheel,
        obstacles=around.cell.around(around.placed),
        part=part,
        fixture=fixture,
        T_flange_workpiece=pose_of(file.fixture.T_flange_workpiece_mm),
        max_belt_penetration=around.placed.max_belt_penetration,
        required_clearance=around.cell.clearance,
        pairs=around.pairs,
        limits=around.cell.limits,
    )
    check_home(around.home_key, cell, around.home)
    process = file.process.in_si(around.home, file.program.one_job_per_pass)
    check_leads(source, process, cell.part_from_wheel)
    search = file.search.in_si(file.passes.max_chord_error_mm)
    if method is not None:
        search = replace(search, method=Method(method))
    home = around.home
    if file.program.positions == "user":
        home = home_in_user_frame(robot, home)
    at_wheel = StationaryTool(cell.wheel.T_base_contact0, cell.T_flange_workpiece)
    load = file.workpiece.load_in_hand(part, cell.T_flange_workpiece)
    if file.program.gripper is not None and load is None:
        raise InputError(source.at("program.gripper"), "goes with workpiece.density_kg_m3")
    return Job(
        source=source,
        name=file.name,
        cell=cell,
        around=around,
        surface=surface,
        passes=file.passes.in_si(source, surface, cell.wheel.radius),
        search=search,
        process=replace(process, home=home),
        program=file.program.in_si(source, file.name, robot, home, at_wheel, load),
    )
