"""From the surface of a job to its cutter points, and what is doubtful about them."""

from __future__ import annotations

from functools import partial

from opl.errors import InputError
from opl.geometry.inspection import inspect
from opl.geometry.nurbs import DegenerateNormalError
from opl.geometry.passes import PassesError, lay_passes
from opl.geometry.surface_on_solid import heights_of_solid
from opl.job import keys
from opl.job.values import Job
from opl.motion.pass_order import quickest_order
from opl.run.values import Surfaced
from opl.run.watch import Stage, Watch

# in a matrix of cutter points by contact positions: a run of the V with 1.4 million takes 2.3 GB
MOST_NODES = 1_600_000


def cut_surface(job: Job, watch: Watch | None = None) -> Surfaced:
    """Cut the surface of a job into passes of cutter points and inspect them.

    Raises:
        InputError: If that cannot be done; names the key that is to blame.
        Cancelled: If the run was cancelled.
    """
    with (watch or Watch()).stage(Stage.CUTTER_POINTS):
        try:
            order = partial(quickest_order, job.cell, job.process)
            laid = lay_passes(job.surface, job.passes, order)
        except DegenerateNormalError as error:
            raise InputError(job.source.at(keys.SURFACE), str(error)) from error
        except PassesError as error:
            key = keys.OF_PASSES[error.attribute]
            raise InputError(job.source.at(key), error.message) from error
        except ValueError as error:
            raise InputError(job.source.at(keys.PASSES), str(error)) from error
        _check_count(job, len(laid.points))
        cell = job.cell
        heights = heights_of_solid(laid.points.Ts_workpiece_cutter, cell.part)
        found = inspect(
            job.surface, job.passes, laid, cell.wheel, cell.max_belt_penetration, heights
        )
        return Surfaced(job, laid, found)


def _check_count(job: Job, n_points: int) -> None:
    """Refuse a matrix that is too large for what plans on it.

    Raises:
        InputError: If it is.
    """
    per_point = job.search.n_contact_positions
    if n_points * per_point > MOST_NODES:
        raise InputError(
            job.source.at(keys.SEARCH_CONTACT_POSITIONS),
            f"{per_point} at each of {n_points} cutter points make {n_points * per_point} nodes, "
            f"at most {MOST_NODES} are searched: fewer of them, longer steps or fewer rows",
        )
