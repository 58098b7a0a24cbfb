"""From the surface of a job to its cutter points, and what is doubtful about them."""

from __future__ import annotations

from dataclasses import dataclass

from opl.errors import InputError
from opl.findings import Finding
from opl.geometry.inspection import Inspection, inspect
from opl.geometry.nurbs import DegenerateNormalError
from opl.geometry.passes import LaidPasses, PassesError, lay_passes
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.job.load import Job


@dataclass(frozen=True)
class Surfacing:
    """Cutter points of a job.

    Attributes:
        laid: The cutter points, and how the surface bends there.
        inspection: What is doubtful about them.
    """

    laid: LaidPasses
    inspection: Inspection

    @property
    def points(self) -> CutterPoints:
        """Return the cutter points."""
        return self.laid.points

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Return what is doubtful about them."""
        return self.inspection.findings


def cut_surface(job: Job) -> Surfacing:
    """Cut the surface of a job into passes and look at them.

    Raises:
        InputError: If that cannot be done; names the key that is to blame.
    """
    try:
        laid = lay_passes(job.surface, job.passes)
    except DegenerateNormalError as error:
        raise InputError(job.source.at(keys.SURFACE), str(error)) from error
    except PassesError as error:
        raise InputError(job.source.at(keys.OF_PASSES[error.attribute]), error.message) from error
    except ValueError as error:
        raise InputError(job.source.at(keys.PASSES), str(error)) from error
    cell = job.cell
    found = inspect(job.surface, job.passes, laid, cell.wheel, cell.max_belt_penetration)
    return Surfacing(laid, found)
