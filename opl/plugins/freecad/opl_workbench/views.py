"""What the objects look like in the 3D view: passes and marks on the part; the cell at a moment."""

from __future__ import annotations

import os
from itertools import groupby
from typing import Any

import FreeCADGui
from pivy import coin

from . import drawing
from .found import cell_of, cutter_points, marked, motion_of
from .job_object import placement

ICONS = os.path.join(os.path.dirname(os.path.dirname(__file__)), "icons")
PASS, POINT, MARK = (0.05, 0.35, 0.75), (0.95, 0.55, 0.05), (0.85, 0.05, 0.1)
ROBOT = ((0.90, 0.63, 0.24), (0.82, 0.84, 0.86))  # neighbours differ
COLOURS = {"wheel": (0.42, 0.36, 0.29), "part": (0.62, 0.71, 0.77)}
HELD, STANDING = (0.36, 0.40, 0.44), (0.56, 0.63, 0.68)
LIFT = 0.3  # [mm] of lines above the surface
MARK_RADIUS, AXES = 2.0, 60.0  # [mm]


class _View:
    """What both have: a scene that is made anew when what it shows has changed."""

    icon = "job.svg"
    shown: tuple[str, ...] = ()  # properties that the scene is made of

    def __init__(self, view: Any) -> None:
        view.Proxy = self

    def attach(self, view: Any) -> None:
        """Add the scene to the 3D view."""
        self.root = coin.SoSeparator()
        view.addDisplayMode(self.root, "Shown")
        self.fill(view.Object)

    def fill(self, obj: Any) -> None:
        """Make the scene of an object."""
        raise NotImplementedError

    def updateData(self, obj: Any, name: str) -> None:
        """Make the scene anew if it shows the property."""
        if name in self.shown and hasattr(self, "root"):
            self.fill(obj)

    def getDisplayModes(self, view: Any) -> list[str]:
        """Return the only way in which it is shown."""
        return ["Shown"]

    def getDefaultDisplayMode(self) -> str:
        """Return the only way in which it is shown."""
        return "Shown"

    def setDisplayMode(self, mode: str) -> str:
        """Return the only way in which it is shown."""
        return mode

    def getIcon(self) -> str:
        """Return the file of the icon in the tree."""
        return os.path.join(ICONS, self.icon)

    def __getstate__(self) -> None:
        return None

    def __setstate__(self, state: None) -> None:
        return None

    dumps, loads = __getstate__, __setstate__


class JobView(_View):
    """Passes and cutter points on the part, the flange, and where a run failed."""

    shown = ("PointsKept", "Message", "Flange")

    def fill(self, obj: Any) -> None:
        """Make the scene of a job."""
        self.root.removeAllChildren()
        self.root.addChild(drawing.axes(obj.Flange, AXES))
        add_passes(self.root, obj)

    def doubleClicked(self, view: Any) -> bool:
        """Open the panel of the job."""
        FreeCADGui.activateWorkbench("OplWorkbench")  # which knows the command
        FreeCADGui.Selection.clearSelection()
        FreeCADGui.Selection.addSelection(view.Object)
        FreeCADGui.runCommand("Opl_OpenJob")
        return True


class CellView(_View):
    """Robot, part, wheel and all that stands around, at one moment."""

    icon = "motion.svg"
    shown = ("Job", "Seconds")

    def fill(self, obj: Any) -> None:
        """Make the scene of a motion: a group for each joint, that moves all it holds."""
        self.root.removeAllChildren()
        self.joints: list[Any] = []
        cell = None if obj.Job is None else cell_of(obj.Job)
        if cell is None:
            return
        for number in range(7):
            group, at = coin.SoSeparator(), drawing.moved()
            group.addChild(at)
            self.joints.append(at)
            for found in cell.solids:
                if found["joint"] == number:
                    group.addChild(_placed(found))
            if number == 6:
                part, held = coin.SoSeparator(), drawing.moved()
                drawing.move(held, cell.T_joint_workpiece)
                part.addChild(held)
                add_passes(part, obj.Job)
                group.addChild(part)
            self.root.addChild(group)
        self.pose(obj)

    def updateData(self, obj: Any, name: str) -> None:
        """Move the joints, or make the scene anew."""
        super().updateData(obj, name)
        if name == "Posture" and hasattr(self, "root"):
            self.pose(obj)

    def pose(self, obj: Any) -> None:
        """Move the joints to the moment of the object."""
        cell = None if obj.Job is None else cell_of(obj.Job)
        if cell is None or not self.joints:
            return
        motion = motion_of(obj.Job)
        q = cell.home if motion is None else motion.posture(obj.Moment)
        for node, pose in zip(self.joints, cell.joints(q)):
            drawing.move(node, pose)


def add_passes(group: Any, job: Any) -> None:
    """Add the passes of a job, its cutter points and the marked ones, in the workpiece frame."""
    points = cutter_points(job)
    places = [point.place + point.normal * LIFT for point in points]
    both = list(zip(points, places))
    rows = [[place for _, place in row] for _, row in groupby(both, key=lambda pair: pair[0].pass_)]
    group.addChild(drawing.lines(rows, PASS))
    group.addChild(drawing.dots(places, POINT))
    marks = [places[k] for k in marked(job) if k < len(places)]
    group.addChild(drawing.balls(marks, MARK, MARK_RADIUS))


def _placed(found: dict[str, Any]) -> Any:
    if found["robot"]:
        colour = ROBOT[found["joint"] % 2]
    else:
        colour = COLOURS.get(found["name"], HELD if found["joint"] else STANDING)
    around = not found["robot"] and found["joint"] == 0 and found["name"] != "wheel"
    group = drawing.coloured(colour, 0.6 if around else 0.0)
    at = drawing.moved()
    drawing.move(at, placement(found["T_mm"]))
    group.addChild(at)
    group.addChild(drawing.solid(found))
    return group
