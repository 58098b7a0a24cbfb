"""What few jobs have: small and wide wheels, short passes, short leads, large clearances, scans.

A random job is changed in all of these at once. Much of what is drawn so is impossible, and is to
be refused with its reason.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.stranger_parts import Array, Part, sheet_of

MOST_ROWS = 25
MOST_ROLL = 90.0  # [deg]


def uncommon_wheel(random: np.random.Generator) -> tuple[float, float, float]:
    """Return radius and width of a wheel in [mm], and its roll in [deg]."""
    radius, width = (
        float(np.round(np.exp(random.uniform(*np.log(span))), 1))
        for span in ((12.0, 350.0), (4.0, 150.0))
    )
    return radius, width, float(random.choice([0.0, *random.uniform(2.0, MOST_ROLL, 5)]).round())


def uncommon_count(random: np.random.Generator, most: float) -> int:
    """Return a count of 1 at the least, small ones as likely as large ones."""
    return int(np.exp(random.uniform(0.0, np.log(most))))


def make_uncommon(
    random: np.random.Generator, job: dict[str, Any], part: Part, folder: Path
) -> None:
    """Change a job in its file's form; the surface of some parts becomes a scan in the folder."""
    passes, process, search = job["passes"], job["process"], job["search"]
    passes["order"] = _one_of(random, "zigzag", "one_way", "shortest", "both")
    if random.random() < 0.3:
        passes["margin_mm"] = 0.0
    if random.random() < 0.15 and passes["rows"] < 8:
        passes.update(repeats=2, shift_mm=round(0.5 * passes["pitch_mm"], 3))
    job["wheel"]["max_belt_penetration_mm"] = _one_of(random, 0.05, 0.2, 1.0, 3.0)
    job["clearance_mm"] = _one_of(random, 0.5, 2.0, 5.0, 10.0, 20.0)
    process["approach_mm"] = _one_of(random, 5.0, 20.0, 50.0, 120.0)
    process["approach_turn_deg"] = _one_of(random, 0.0, 0.0, 30.0, 60.0, 90.0)
    search["contact_positions"] = int(random.integers(15, 400))
    search["max_contact_step"] = _one_of(random, 0.3, 1.0, 5.0, 20.0)
    search["max_contact_error_mm"] = _one_of(random, 0.06, 0.1, 0.5)
    if part.fillet is not None:
        return
    if random.random() < 0.3:
        passes["end_margin_mm"] = _one_of(random, 1.0, 5.0)
    if random.random() < 0.25:
        passes["kind"] = _one_of(random, "along_u", "along_v")
        del passes["plane_normal"], passes["margin_mm"]
    elif part.walls is None and random.random() < 0.25:
        noise = _one_of(random, 0.0, 0.005)
        _scan(sheet_of(part.at), noise, random).export(folder / "scan.stl")
        job["workpiece"].update(surface="scan.stl", surface_unit="mm")


def _one_of(random: np.random.Generator, *values: Any) -> Any:
    return values[int(random.integers(len(values)))]


def _scan(sheet: Array, noise: float, random: np.random.Generator) -> trimesh.Trimesh:
    """Return triangles over a sheet of points, shape (m, n, 3), with a noise in [mm]."""
    m, n = sheet.shape[:2]
    at = np.arange(m * n).reshape(m, n)
    p, q, r, s = (x.ravel() for x in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    corners = sheet.reshape(-1, 3) + noise * random.normal(size=(m * n, 3))
    faces = np.concatenate([np.stack([p, q, r], -1), np.stack([p, r, s], -1)])
    return trimesh.Trimesh(corners, faces, process=False)
