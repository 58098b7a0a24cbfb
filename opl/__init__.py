"""Offline programming for robotic belt grinding: from a job to a proven robot program.

A job says what is ground, on which wheel, by which robot. A run takes it through four stages. Each
makes a value that holds those before it, so the type of a value says how far the run has come::

    Job -> cut_surface -> Surfaced -> plan_path -> Planned
        -> verify_motion -> Proven -> write_program -> Written -> deliver -> files

A run that cannot go on ends as `Refused`, which holds the reason and never a program::

    from pathlib import Path
    import opl

    job = opl.load_job("job.yaml")
    run = opl.run_job(job)                          # all stages; they can be called one by one
    if isinstance(run, opl.Refused):
        raise run.error                             # why there is no program, and what would help
    print(opl.make_report(run).path)                # the figures of result.json
    opl.deliver(run, Path("programs"))              # the files, whole or not at all

Inside, lengths are in metres and angles in radians; keys of job files and fields of reports carry
their units in their names. Whatever opl refuses is an `OplError`. Names are loaded when they are
first used, so ``import opl`` costs next to nothing. It comes before ``import numpy``: then the same
job gives the same bytes on every x86-64 processor with AVX2. The folder ``examples`` shows more;
``help(opl.load_job)`` explains a name.

Jobs
    `load_job`          a file or a mapping -> `Job`
    `NurbsSurface`      a surface made by a program, instead of one from a file
    `TriangleMesh`      a solid made by a program
    `start_job`         copies the V-shaped example, to be changed

Runs
    `run_job`           `Job` -> `Run`, which is `Written` or `Refused`
    `job_ahead`         job file -> `Job`, its surface cut meanwhile in a process of its own
    `cut_surface`       `Job` -> `Surfaced`: cutter points, with warnings
    `plan_path`         `Surfaced` -> `Planned`; `Prepared` is what its search is given
    `verify_motion`     `Planned` -> `Proven`
    `write_program`     `Proven` -> `Written`: the program as texts, read back and proven
    `Watch`             reports each `Stage` of a run while it goes on, ends its search with the
                        best so far (`SoFar` says what is known of it), and cancels it

Many jobs
    `run_batch`         job files -> a `BatchRow` each, run in processes as `BatchSettings` say;
                        what has not changed is left as it is; `find_jobs` finds them
    `write_batch_page`  `BatchRow`s -> a page of all, with links to theirs; `junit` -> JUnit XML
    `batch_standing`    what a batch would do: a `JobStanding` each; `audit` reads all files again
    `watch_inbox`       runs what comes into a folder, until it is stopped
    `open_store`        folder -> the `Store` of its `StoredJob`s

Results
    `make_report`       `Run` -> `Report`: the content of ``result.json``
    `deliver`           `Run` -> program, table, pictures, page and ``result.json`` in a folder
    `with_png`          `Run` -> the same, its charts as PNG too
    `run_page`          `Run` -> its page: HTML that opens from disk; `find_page` finds one
    `claim_folder`      keeps a folder for the run of one job, from before its work
    `release_folders`   of this process, where a signal ends it
    `report_points`     `Surfaced` -> figures of its cutter points
    `points_files`      `Surfaced` -> table and picture of its cutter points, as texts
    `to_json`           any of these figures -> JSON text

Programs of a controller
    `prove_program`     program files and their `Job` -> `ProgramProof`
    `describe_program`  a program file in words
    `compare_programs`  how two program files differ in what they do

Cells and robots
    `load_cell`         a cell file -> `Cell`; `cell_page` shows it
    `load_robot`        a name or a folder -> `Robot`; `known_robots` lists the names
    `import_urdf`       a URDF -> the folder of a robot of your own
    `import_pulse_ratios`  parameters of a controller -> file of pulse ratios
    `with_ratios`       a `Robot` with the ratios of such a file

Errors
    `OplError`          root of all; `InputError`, `UnsafeError` and `Cancelled` are below it
    `NoPathError`       no path over the wheel; `NoFreeMoveError`: over it, but not to or from it
    `Finding`           one thing that a check found: kind, place, message

For command lines and editors, which show what is in files
    `describe_job`, `describe_cell`, `cell_figures`      jobs and cells in words and figures
    `list_faces`, `preview_face`, `FaceSummary`          the faces of a part file; `face_figures`
    `robot_path`, `read_robot_file`, `arm_view`          a robot: its data with sources; a picture
    `known_posts`, `find_post`                           controllers, and what their templates get
    `json_schema`, `keys_page`, `keys`                   keys of job and cell files
    `check_folder`, `write_files`, `write_file`          files written whole or not at all
    `read_text`                                          a file read up to a size

Jobs over HTTP
    `serve`             answers requests until it is stopped, as its `ServiceSettings` say;
                        `opl.client` talks to it, and needs nothing of opl
    `install_plugin`    copies the workbench for FreeCAD, which talks to it too
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from opl.processor import round_alike
from opl.version import VERSION

if TYPE_CHECKING:
    from opl.cell.robot import Robot as Robot
    from opl.cell.robot_file import read_robot_file as read_robot_file
    from opl.cell.robot_loading import known_robots as known_robots
    from opl.cell.robot_loading import load_robot as load_robot
    from opl.cell.robot_loading import robot_path as robot_path
    from opl.cell.urdf_import import import_urdf as import_urdf
    from opl.errors import Cancelled as Cancelled
    from opl.errors import InputError as InputError
    from opl.errors import NoFreeMoveError as NoFreeMoveError
    from opl.errors import NoPathError as NoPathError
    from opl.errors import OplError as OplError
    from opl.errors import UnsafeError as UnsafeError
    from opl.files.claiming import release_folders as release_folders
    from opl.files.claiming import write_files as write_files
    from opl.files.reading import read_text as read_text
    from opl.files.resources import install_plugin as install_plugin
    from opl.files.resources import start_job as start_job
    from opl.files.writing import check_folder as check_folder
    from opl.files.writing import write_file as write_file
    from opl.findings import Finding as Finding
    from opl.geometry.faces import FaceSummary as FaceSummary
    from opl.geometry.faces import list_faces as list_faces
    from opl.geometry.faces import preview_face as preview_face
    from opl.geometry.mesh import TriangleMesh as TriangleMesh
    from opl.geometry.nurbs import NurbsSurface as NurbsSurface
    from opl.job import keys as keys
    from opl.job.cell import load_cell as load_cell
    from opl.job.load import load_job as load_job
    from opl.job.reference import json_schema as json_schema
    from opl.job.reference import keys_page as keys_page
    from opl.job.values import Cell as Cell
    from opl.job.values import Job as Job
    from opl.planning.so_far import SoFar as SoFar
    from opl.program.posts import find_post as find_post
    from opl.program.posts import known_posts as known_posts
    from opl.program.ratios import import_pulse_ratios as import_pulse_ratios
    from opl.program.ratios import with_ratios as with_ratios
    from opl.report.arm_view import arm_view as arm_view
    from opl.run.ahead import job_ahead as job_ahead
    from opl.run.batch import BatchRow as BatchRow
    from opl.run.batch import find_jobs as find_jobs
    from opl.run.delivery import deliver as deliver
    from opl.run.descriptions import cell_figures as cell_figures
    from opl.run.descriptions import describe_cell as describe_cell
    from opl.run.descriptions import describe_job as describe_job
    from opl.run.descriptions import face_figures as face_figures
    from opl.run.exporting import with_png as with_png
    from opl.run.job_folder import claim_folder as claim_folder
    from opl.run.listings import compare_programs as compare_programs
    from opl.run.listings import describe_program as describe_program
    from opl.run.other_pages import cell_page as cell_page
    from opl.run.page import run_page as run_page
    from opl.run.points import points_files as points_files
    from opl.run.points import report_points as report_points
    from opl.run.programs import ProgramProof as ProgramProof
    from opl.run.programs import prove_program as prove_program
    from opl.run.reporting import make_report as make_report
    from opl.run.result import Report as Report
    from opl.run.result import to_json as to_json
    from opl.run.stages import plan_path as plan_path
    from opl.run.stages import run_job as run_job
    from opl.run.stages import verify_motion as verify_motion
    from opl.run.stages import write_program as write_program
    from opl.run.surfacing import cut_surface as cut_surface
    from opl.run.values import Planned as Planned
    from opl.run.values import Prepared as Prepared
    from opl.run.values import Proven as Proven
    from opl.run.values import Refused as Refused
    from opl.run.values import Run as Run
    from opl.run.values import Surfaced as Surfaced
    from opl.run.values import Written as Written
    from opl.run.viewing import find_page as find_page
    from opl.run.watch import Stage as Stage
    from opl.run.watch import Watch as Watch
    from opl.service.serving import ServiceSettings as ServiceSettings
    from opl.service.serving import serve as serve
    from opl.store.jobs import Store as Store
    from opl.store.values import StoredJob as StoredJob
    from opl.work.batch import BatchSettings as BatchSettings
    from opl.work.batch import run_batch as run_batch
    from opl.work.batch import write_batch_page as write_batch_page
    from opl.work.inbox import watch_inbox as watch_inbox
    from opl.work.junit import junit as junit
    from opl.work.state import JobStanding as JobStanding
    from opl.work.state import audit as audit
    from opl.work.state import batch_standing as batch_standing
    from opl.work.state import open_store as open_store

round_alike()

__version__ = VERSION

# where each name is defined
_HOMES = {
    "opl.cell.robot": "Robot",
    "opl.cell.robot_file": "read_robot_file",
    "opl.cell.robot_loading": "known_robots load_robot robot_path",
    "opl.cell.urdf_import": "import_urdf",
    "opl.errors": "Cancelled InputError NoFreeMoveError NoPathError OplError UnsafeError",
    "opl.files.claiming": "release_folders write_files",
    "opl.files.reading": "read_text",
    "opl.files.resources": "install_plugin start_job",
    "opl.files.writing": "check_folder write_file",
    "opl.findings": "Finding",
    "opl.geometry.faces": "FaceSummary list_faces preview_face",
    "opl.geometry.mesh": "TriangleMesh",
    "opl.geometry.nurbs": "NurbsSurface",
    "opl.job": "keys",
    "opl.job.cell": "load_cell",
    "opl.job.load": "load_job",
    "opl.job.reference": "json_schema keys_page",
    "opl.job.values": "Cell Job",
    "opl.program.posts": "find_post known_posts",
    "opl.program.ratios": "import_pulse_ratios with_ratios",
    "opl.report.arm_view": "arm_view",
    "opl.run.ahead": "job_ahead",
    "opl.run.batch": "BatchRow find_jobs",
    "opl.run.delivery": "deliver",
    "opl.run.job_folder": "claim_folder",
    "opl.run.exporting": "with_png",
    "opl.run.descriptions": "cell_figures describe_cell describe_job face_figures",
    "opl.run.other_pages": "cell_page",
    "opl.run.page": "run_page",
    "opl.run.points": "points_files report_points",
    "opl.run.listings": "compare_programs describe_program",
    "opl.run.programs": "ProgramProof prove_program",
    "opl.run.reporting": "make_report",
    "opl.run.result": "Report to_json",
    "opl.run.stages": "plan_path run_job verify_motion write_program",
    "opl.run.surfacing": "cut_surface",
    "opl.run.values": "Planned Prepared Proven Refused Run Surfaced Written",
    "opl.run.viewing": "find_page",
    "opl.planning.so_far": "SoFar",
    "opl.run.watch": "Stage Watch",
    "opl.service.serving": "ServiceSettings serve",
    "opl.store.jobs": "Store",
    "opl.store.values": "StoredJob",
    "opl.work.batch": "BatchSettings run_batch write_batch_page",
    "opl.work.inbox": "watch_inbox",
    "opl.work.junit": "junit",
    "opl.work.state": "JobStanding audit batch_standing open_store",
}
__all__ = sorted(name for names in _HOMES.values() for name in names.split())


if not TYPE_CHECKING:  # a type checker would take any name for one that is here

    def __getattr__(name: str) -> Any:
        """Load a name of the front door when it is first used (PEP 562)."""
        for home, names in _HOMES.items():
            if name in names.split():
                module = import_module(home)
                # a home without the attribute is the package of a module of that name
                value = getattr(module, name, None) or import_module(f"{home}.{name}")
                globals()[name] = value
                return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
