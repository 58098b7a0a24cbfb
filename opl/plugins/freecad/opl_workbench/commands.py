"""The commands of the workbench."""

from __future__ import annotations

import os
from typing import Any

import FreeCAD
import FreeCADGui

from .job_object import jobs_of, make_job
from .panel import open_panel
from .picked import picked_faces, picked_job
from .views import ICONS, JobView

COMMANDS = ["Opl_NewJob", "Opl_OpenJob"]


class _Command:
    """What FreeCAD asks of a command."""

    icon = text = tip = ""

    def GetResources(self) -> dict[str, str]:
        """Return icon and texts."""
        icon = os.path.join(ICONS, self.icon)
        return {"Pixmap": icon, "MenuText": self.text, "ToolTip": self.tip}


class NewJob(_Command):
    """Makes a job of the faces that are picked, and opens its panel."""

    icon, text = "job.svg", "New grinding job"
    tip = "Make a job of the faces that are picked"

    def IsActive(self) -> bool:
        """Return whether there is a document."""
        return FreeCAD.ActiveDocument is not None

    def Activated(self) -> None:
        """Make the job."""
        try:
            part, faces = picked_faces()
        except ValueError as error:
            FreeCAD.Console.PrintWarning(f"opl: {error}\n")
            part, faces = None, []
        document = FreeCAD.ActiveDocument
        document.openTransaction(self.text)
        job = make_job(document, part, faces)
        JobView(job.ViewObject)
        document.recompute()
        document.commitTransaction()
        open_panel(job)


class OpenJob(_Command):
    """Opens the panel of a job."""

    icon, text = "motion.svg", "Open grinding job"
    tip = "Open the panel of the job that is picked: passes, run, motion, programs"

    def IsActive(self) -> bool:
        """Return whether it is clear which job is meant."""
        return picked_job(jobs_of(FreeCAD.ActiveDocument)) is not None

    def Activated(self) -> None:
        """Open the panel."""
        job: Any = picked_job(jobs_of(FreeCAD.ActiveDocument))
        if job is not None:
            open_panel(job)


def add_commands() -> None:
    """Make the commands known to FreeCAD."""
    FreeCADGui.addCommand(COMMANDS[0], NewJob())
    FreeCADGui.addCommand(COMMANDS[1], OpenJob())
