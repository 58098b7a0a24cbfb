"""The files of a job, made of its object: what is sent to the service."""

from __future__ import annotations

import hashlib
import json
import os
from typing import Any

from .cell_files import CELL
from .keeping import kept
from .shapes import placed_shape, shape_figures, step_file, stl_file

JOB, SURFACE, MESH = "job.yaml", "part.step", "part.stl"


def job_files(obj: Any) -> dict[str, bytes]:
    """Return the files of a job by their names; the job itself is JSON, which is YAML too.

    Raises:
        ValueError: If something of the object cannot be used; says which property.
    """
    part, names = _picked(obj)
    shape = placed_shape(part)
    try:
        step, numbers = step_file(shape, names)
        files = {SURFACE: step, MESH: stl_file(shape)}
    except ValueError as error:
        raise ValueError(f"Faces: {part.Label}: {error}") from error
    document = _document(obj, numbers)
    document["workpiece"].update(surface=SURFACE, faces=numbers, mesh=MESH, mesh_unit="mm")

    flange = obj.Flange.inverse()
    held = [_solid(one, f"gripper_{k}.stl", flange, files) for k, one in enumerate(obj.Gripper)]
    if held:
        document["fixture"]["bodies"] = held
    if obj.CellFile:
        files.update(kept(obj, "CellKept"))
    elif obj.Obstacles:
        document["obstacles"] = [
            _solid(one, f"obstacle_{k}.stl", None, files) for k, one in enumerate(obj.Obstacles)
        ]
    for path, text in sorted(dict(obj.FurtherKeys).items()):
        _put(document, path, text)
    files[JOB] = (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode("utf-8")
    return files


def asked_digest(obj: Any) -> str:
    """Return a digest of all that a job asks for; of what it links to, its shapes."""
    linked = [obj.Faces[0] if obj.Faces else None, *obj.Gripper, *obj.Obstacles]
    shapes = [shape_figures(placed_shape(one)) for one in linked if hasattr(one, "Shape")]
    names = list(obj.Faces[1]) if obj.Faces else []
    cell = {name: hashlib.sha256(data).hexdigest() for name, data in kept(obj, "CellKept").items()}
    further = dict(obj.FurtherKeys)
    whole = json.dumps([_document(obj, []), names, shapes, cell, further], sort_keys=True)
    return hashlib.sha256(whole.encode("utf-8")).hexdigest()


def _picked(obj: Any) -> tuple[Any, list[str]]:
    if not obj.Faces or not [name for name in obj.Faces[1] if name]:
        raise ValueError("Faces: pick the faces of the part that are to be ground")
    part, names = obj.Faces
    if wrong := [name for name in names if not name.startswith("Face")]:
        raise ValueError(f"Faces: {wrong[0]} is no face")
    return part, list(names)


def _document(obj: Any, numbers: list[int]) -> dict[str, Any]:
    """Return the job without the files of its shapes."""
    document: dict[str, Any] = {"name": obj.JobName}
    if obj.CellFile:
        document["cell"] = CELL + os.path.basename(obj.CellFile)
        if obj.WheelName:
            document["wheel_name"] = obj.WheelName
    else:
        document["robot"] = obj.Robot
        document["wheel"] = {
            "T_base_contact0_mm": _rows(obj.ContactFrame),
            "width_mm": obj.WheelWidth.Value,
            "radius_mm": obj.WheelRadius.Value,
            "max_roll_deg": obj.MaxRoll.Value,
            "max_belt_penetration_mm": obj.MaxBeltPenetration.Value,
        }
        document["clearance_mm"] = obj.Clearance.Value
    document["fixture"] = {"T_flange_workpiece_mm": _rows(obj.Flange.inverse())}
    document["workpiece"] = {}
    document["passes"] = {
        "plane_normal": list(obj.PlaneNormal),
        "pitch_mm": obj.Pitch.Value,
        "margin_mm": obj.Margin.Value,
        "end_margin_mm": obj.EndMargin.Value,
        "max_chord_error_mm": obj.MaxChordError.Value,
        "max_step_mm": obj.MaxStep.Value,
        "order": obj.Order,
    }
    if obj.Rows:
        document["passes"]["rows"] = obj.Rows
    document["search"] = {
        "method": obj.Method,
        "contact_positions": obj.ContactPositions,
        "max_contact_step": obj.MaxContactStep,
        "max_contact_error_mm": obj.MaxContactError.Value,
    }
    document["process"] = {
        "feed_mm_s": obj.Feed,
        "approach_mm": obj.Approach.Value,
        "approach_mm_s": obj.ApproachSpeed,
        "free_move_speed_percent": obj.FreeMoveSpeed,
    }
    if obj.Home:
        document["process"]["home_deg"] = list(obj.Home)
    document["program"] = {
        "controller": obj.Controller,
        "accept_unverified_pulses": list(obj.AcceptUnverifiedPulses),
    }
    return document


def _rows(placement: Any) -> list[list[float]]:
    """Return the matrix of a placement, row by row; no negative zero."""
    values = [round(value, 9) + 0.0 for value in placement.toMatrix().A]
    return [values[4 * k : 4 * k + 4] for k in range(4)]


def _solid(one: Any, file: str, moved: Any, files: dict[str, bytes]) -> dict[str, Any]:
    """Add a solid's mesh to the files, in another frame if wanted; return its keys."""
    shape = placed_shape(one)
    if moved is not None:
        shape.Placement = moved.multiply(shape.Placement)
    files[file] = stl_file(shape)
    return {"name": one.Label, "mesh": file, "mesh_unit": "mm", "at_mm": [0.0, 0.0, 0.0]}


def _put(document: dict[str, Any], path: str, text: str) -> None:
    """Set a key by its path."""
    try:
        value = json.loads(text)
    except ValueError:
        value = text  # a word needs no quotes
    *parents, key = path.split(".")
    place = document
    for parent in parents:
        place = place.setdefault(parent, {})
        if not isinstance(place, dict):
            raise ValueError(f"FurtherKeys: {path}: {parent} has no keys")
    place[key] = value
