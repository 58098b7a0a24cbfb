"""What the user has picked in the 3D view."""

from __future__ import annotations

from typing import Any

import FreeCADGui


def picked_faces() -> tuple[Any, list[str]]:
    """Return the part and the names of its faces that are picked.

    Raises:
        ValueError: If no faces are picked, or faces of several parts.
    """
    picked = [
        (one.Object, name)
        for one in FreeCADGui.Selection.getSelectionEx()
        for name in one.SubElementNames
        if name.startswith("Face")
    ]
    if not picked:
        raise ValueError("pick the faces of the part that are to be ground, in the 3D view")
    parts = {obj.Name for obj, _ in picked}
    if len(parts) > 1:
        raise ValueError("the faces picked are of several parts; a job is for one")
    return picked[0][0], [name for _, name in picked]


def picked_solids(job: Any) -> list[Any]:
    """Return the objects with a shape that are picked, other than the part of a job."""
    part = job.Faces[0] if job.Faces else None
    picked = FreeCADGui.Selection.getSelection()
    return [obj for obj in picked if hasattr(obj, "Shape") and obj is not part]


def picked_job(jobs: list[Any]) -> Any:
    """Return the job that is picked, or the only one there is; None if that is not clear."""
    picked = [obj for obj in FreeCADGui.Selection.getSelection() if obj in jobs]
    found = picked or jobs
    return found[0] if len(found) == 1 else None
