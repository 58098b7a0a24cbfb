"""The job as an object of the document: what is asked for, and what became of it."""

from __future__ import annotations

from typing import Any

import FreeCAD

KIND = "OplJob"
HIDDEN, READ_ONLY = 4, 1
NO_RECOMPUTE = 16  # results do not make the job look changed

ORDERS = ["one_way", "zigzag", "both", "shortest"]
METHODS = ["optimal", "recursive"]
CONTROLLERS = ["DX200", "NX100", "DX100", "YRC1000", "RAPID", "KRL", "FANUC", "URSCRIPT"]

# name, type, group, value of a new job, meaning
ASKED: tuple[tuple[str, str, str, Any, str], ...] = (
    ("Faces", "LinkSub", "Part", None, "Faces of the part to be ground"),
    ("JobName", "String", "Part", "PART", "Name of the program and of its files"),
    ("Robot", "String", "Cell", "mh24", "Robot as listed by opl robots; not with a cell file"),
    ("CellFile", "String", "Cell", "", "Cell file that the cell was read from, or none"),
    ("WheelName", "String", "Cell", "", "Which wheel of the cell file, where it has several"),
    ("Clearance", "Length", "Cell", 5.0, "Least distance of what moves; not with a cell file"),
    ("Obstacles", "LinkList", "Cell", [],
     "Solids; the document's origin is then the robot's base frame; not with a cell file"),
    ("ContactFrame", "Placement", "Wheel", None,
     "Contact frame 0 in the robot's base frame: z into the wheel, x along its axle"),
    ("WheelWidth", "Length", "Wheel", 50.0, "Width of the flat"),
    ("WheelRadius", "Length", "Wheel", 150.0, "Radius with the belt on"),
    ("MaxRoll", "Angle", "Wheel", 45.0, "Largest roll of the part about either edge"),
    ("MaxBeltPenetration", "Length", "Wheel", 0.5, "How deep the part may sink into the belt"),
    ("Flange", "Placement", "Gripper", None, "The robot's flange where it holds the part"),
    ("Gripper", "LinkList", "Gripper", [], "Solids between flange and part, where they hold it"),
    ("PlaneNormal", "Vector", "Passes", None, "Normal of the planes that make the passes"),
    ("Pitch", "Length", "Passes", 5.0, "Distance of neighbouring rows"),
    ("Rows", "Integer", "Passes", 0, "Number of rows; 0 for as many as fit"),
    ("Margin", "Length", "Passes", 0.0, "Least distance of a row from the ends of the faces"),
    ("EndMargin", "Length", "Passes", 0.0, "What is left out at both ends of a pass"),
    ("MaxChordError", "Length", "Passes", 0.05, "Largest bow height between cutter points"),
    ("MaxStep", "Length", "Passes", 4.0, "Largest distance of cutter points"),
    ("Order", "Enumeration", "Passes", ORDERS, "Order and direction of the passes"),
    ("Method", "Enumeration", "Search", METHODS, "How the path is searched"),
    ("ContactPositions", "Integer", "Search", 140, "Contact positions of each cutter point"),
    ("MaxContactStep", "Float", "Search", 1.0, "Largest change between positions, mm or degrees"),
    ("MaxContactError", "Length", "Search", 0.1, "Largest distance of ground and touching point"),
    ("Feed", "Float", "Process", 20.0, "Speed along the surface in mm/s"),
    ("Approach", "Length", "Process", 50.0, "Longest approach and retract"),
    ("ApproachSpeed", "Float", "Process", 50.0, "Largest speed near the contact in mm/s"),
    ("FreeMoveSpeed", "Float", "Process", 10.0, "Speed of free moves in percent"),
    ("Home", "FloatList", "Process", [],
     "Joints in degrees at start and end; none: as in the cell file"),
    ("Controller", "String", "Program", "DX200", "Controller or language of the program"),
    ("AcceptUnverifiedPulses", "StringList", "Program", [],
     "Joints whose pulse ratios nobody has verified and you accept"),
    ("FurtherKeys", "Map", "Program", {},
     "Any other key of a job by its path, as passes.repeats; values as JSON"),
    ("CellKept", "FileIncluded", "Kept", "", "Cell file and what it names"),
)  # fmt: skip

FOUND = (
    ("Status", "String", "", "What became of the job; 'changed' if it is older than its inputs"),
    ("Message", "String", "", "Why there is no program"),
    ("Figures", "String", "", "What was found, in a line"),
    ("JobId", "String", "", "Id of the last run at the service"),
    ("Asked", "String", "", "Digest of what was asked for"),
    ("PointsKept", "FileIncluded", "", "Cutter points and cell"),
    ("RunKept", "FileIncluded", "", "Job, result and program of the last run"),
)

V_CONTACT = ((0.007, 0.0, 1.0, 890.0), (1.0, 0.0, -0.007, 235.0), (0.0, 1.0, 0.0, 323.0))


class Proxy:
    """What FreeCAD asks of an object of the workbench; a document keeps which kind it is."""

    def __init__(self, obj: Any, kind: str) -> None:
        self.Type = kind
        obj.Proxy = self

    def __getstate__(self) -> str:
        return self.Type

    def __setstate__(self, state: str) -> None:
        self.Type = state

    dumps, loads = __getstate__, __setstate__  # their names from FreeCAD 0.21.2 on


class Job(Proxy):
    """What is asked for, and what became of it."""

    def __init__(self, obj: Any) -> None:
        super().__init__(obj, KIND)
        for name, kind, group, value, meaning in ASKED:
            obj.addProperty(f"App::Property{kind}", name, group, meaning)
            if value is not None:
                setattr(obj, name, value)
        obj.ContactFrame = placement(V_CONTACT)
        obj.Flange = FreeCAD.Placement(
            FreeCAD.Vector(0.0, 0.0, -100.0), FreeCAD.Rotation(0.0, 0.0, 0.0)
        )
        obj.PlaneNormal = FreeCAD.Vector(1.0, 0.0, 0.0)
        obj.Order = "zigzag"
        for name, kind, value, meaning in FOUND:
            obj.addProperty(
                f"App::Property{kind}", name, "Result", meaning, READ_ONLY | NO_RECOMPUTE
            )
            if value:
                setattr(obj, name, value)

    def execute(self, obj: Any) -> None:
        """Say that a result is older than what is asked for now."""
        from .job_text import asked_digest

        if obj.Asked and obj.Status and asked_digest(obj) != obj.Asked:
            obj.Status = "changed"


def make_job(document: Any, part: Any = None, faces: Any = ()) -> Any:
    """Add a job to a document, for some faces of a part; return its object."""
    obj = document.addObject("App::FeaturePython", "Job")
    Job(obj)
    if part is not None:
        obj.Faces = (part, list(faces))
        name = "".join(c if c.isalnum() else "_" for c in part.Label.upper())
        obj.JobName = name.encode("ascii", "replace").decode().replace("?", "_")[:28] or "PART"
    return obj


def jobs_of(document: Any) -> list[Any]:
    """Return the jobs of a document."""
    objects = document.Objects if document is not None else ()
    return [obj for obj in objects if is_of(obj, KIND)]


def is_of(obj: Any, kind: str) -> bool:
    """Return whether an object of a document is one of the workbench, of a kind."""
    return getattr(getattr(obj, "Proxy", None), "Type", None) == kind


def placement(rows: Any) -> Any:
    """Return the placement of a matrix of three or four rows in mm.

    Its rotation is the nearest to the matrix, as in opl: a document stores axis and angle, and
    FreeCAD reads another rotation back if the matrix it was made of was only almost a rotation.

    Raises:
        ValueError: If the matrix is far from a rotation.
    """
    rows = [[float(value) for value in row] for row in list(rows)[:3]]
    a, b, c = (FreeCAD.Vector(*row[:3]) for row in rows)
    for _ in range(8):  # Newton's iteration: the mean of a matrix and its inverse transposed
        volume = a.dot(b.cross(c))
        if volume < 0.5:
            raise ValueError("the matrix of a placement is no rotation")
        part = 0.5 / volume
        a, b, c = (
            a * 0.5 + b.cross(c) * part,
            b * 0.5 + c.cross(a) * part,
            c * 0.5 + a.cross(b) * part,
        )
    turn = FreeCAD.Rotation(FreeCAD.Matrix(*a, 0.0, *b, 0.0, *c, 0.0))
    return FreeCAD.Placement(FreeCAD.Vector(*(row[3] for row in rows)), turn)
