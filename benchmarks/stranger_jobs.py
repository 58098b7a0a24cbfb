"""Random jobs: a part, a wheel, how the arm holds the one before the other, rows, and a cell.

Drawn so that a motion is likely, not so that the search has it easy: the arm reaches every place
looked at, in one posture, at some contact position where the part does not sink too deep. Written
as the YAML, JSON, STEP and STL files of a user; `opl run` takes them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

import opl
from benchmarks.stranger_parts import FAMILIES, Array, Part, draw_part
from benchmarks.uncommon import MOST_ROWS, make_uncommon, uncommon_count, uncommon_wheel
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry.frames import inverse, pose
from opl.geometry.wheel import ContactWheel

LANGUAGES = {"ABB": "RAPID", "KUKA": "KRL", "FANUC": "FANUC", "Universal Robots": "URSCRIPT"}
PLACEMENTS = 300  # of wheel and part that are tried for one part
LOOKED_AT = (3, 11)  # places of the surface, across and along
POSITIONS = 15  # contact positions that are looked at
RETREAT = (0.25, 0.2, 0.15, 0.1)  # [m] from the wheel to home, the largest that can be reached


@dataclass(frozen=True)
class Stranger:
    """A job that was drawn.

    Attributes:
        family: Of its part.
        robot: Its arm.
        axle: ``horizontal``, ``tilted`` or ``upright``.
        points: How many cutter points were aimed at.
        job: The job file.
    """

    family: str
    robot: str
    axle: str
    points: int
    job: Path


@dataclass(frozen=True)
class _Placed:
    """Where the wheel is, how the part is held, and a posture to come from."""

    wheel: ContactWheel
    T_flange_workpiece: Array
    home: Array


def draw_job(
    seed: int,
    index: int,
    attempt: int,
    folder: Path,
    objective: str = "range",
    families: Sequence[str] = tuple(FAMILIES),
    uncommon: bool = False,
) -> Stranger | None:
    """Draw a job and write its files.

    Args:
        seed: Of all jobs.
        index: Which job.
        attempt: Which draw of it; each is another.
        folder: Where its files are written, empty.
        objective: What the search keeps small.
        families: Of parts, one of which is drawn.
        uncommon: Whether the job has what few jobs have.

    Returns:
        The job; None if the arm did not reach the part however both were placed.
    """
    random = np.random.default_rng([seed, index, attempt])
    name = str(random.choice(opl.known_robots()))
    robot = opl.load_robot(name)
    size = np.round(random.uniform(60.0, 200.0)), np.round(random.uniform(12.0, 60.0))
    roll = float(random.choice([0.0, *random.uniform(10.0, 60.0, 5)]).round())
    if uncommon:
        *size, roll = uncommon_wheel(random)
    family = str(random.choice(list(families)))
    part = draw_part(family, random, size)
    across = family == "box" or part.walls is not None or random.random() < 0.7
    normal = np.array([1.0, 0.0, 0.0] if across else [0.0, 1.0, 0.0])
    if not across and random.random() < 0.5:
        angle = random.uniform(0.0, np.pi)
        normal = np.array([np.cos(angle), np.sin(angle), 0.0])
    normal = normal * float(random.choice([-1.0, 1.0]))
    axle = str(random.choice(["horizontal", "tilted", "upright"], p=[0.5, 0.25, 0.25]))
    placed = _placed(random, robot, part, normal, axle, size, np.deg2rad(roll))
    if placed is None:
        return None
    points = int(random.integers(60, 300))
    rows = int(random.integers(1, 7))
    if uncommon:
        points, rows = 20 * uncommon_count(random, 45), uncommon_count(random, MOST_ROWS)
    surface = part.write(folder)
    job = _document(random, robot, part, placed, normal, (points, rows), roll)
    job["name"] = f"S{seed}_{index}"
    job["workpiece"]["surface"] = surface
    if uncommon:
        make_uncommon(random, job, part, folder)
    if objective != "range":  # which is the default
        job["search"]["objective"] = objective
    if surface.endswith(".step"):
        job["workpiece"]["faces"] = _box_faces(folder / surface)
    path = folder / "job.yaml"
    head = f"# Drawn by benchmarks/strangers.py: seed {seed}, job {index}, draw {attempt}.\n"
    plain = json.loads(json.dumps(job))  # numpy's numbers are no numbers of YAML's
    text = yaml.safe_dump(plain, sort_keys=False, default_flow_style=None, width=120)
    path.write_text(head + text, encoding="utf-8")
    return Stranger(part.family, name, axle, points, path)


def _placed(
    random: np.random.Generator,
    robot: opl.Robot,
    part: Part,
    normal: Array,
    axle: str,
    size: tuple[float, float],
    roll: float,
) -> _Placed | None:
    """Place wheel and part until the arm reaches every place that is looked at."""
    frames = part.frames(normal, LOOKED_AT)
    for _ in range(PLACEMENTS):
        wheel = ContactWheel(
            1e-3 * size[1], 1e-3 * size[0], roll, _contact0(random, axle, robot.reach)
        )
        T_flange_workpiece = _held(random, part)
        t = wheel.positions(POSITIONS)
        Ts_flange_contact = T_flange_workpiece @ frames
        Ts = wheel.T_base_contact(t)[None] @ inverse(Ts_flange_contact)[:, None]
        q = _within(robot, inverse_kinematics(robot.arm, Ts))
        reached = np.asarray(np.isfinite(q).all(axis=-1))  # place, t, branch
        whole = np.all(np.any(reached, axis=1), axis=0)
        for branch in np.flatnonzero(whole):
            place = len(frames) // 2
            row = int(np.argmin(np.where(reached[place, :, branch], np.abs(t), np.inf)))
            for back in RETREAT:
                T = Ts[place, row].copy()
                T[:3, 3] -= back * wheel.T_base_contact(t[row])[:3, 2]
                home = _within(robot, inverse_kinematics(robot.arm, T))[branch]
                if np.isfinite(home).all():
                    return _Placed(wheel, T_flange_workpiece, home)
    return None


def _within(robot: opl.Robot, q: Array) -> Array:
    """Return angles turned to where they are nearest to the middle of their limits, else NaN."""
    middle = (robot.lower + robot.upper) / 2.0
    q = q + 2.0 * np.pi * np.round((middle - q) / (2.0 * np.pi))
    return np.asarray(np.where((q > robot.lower) & (q < robot.upper), q, np.nan))


def _contact0(random: np.random.Generator, axle: str, reach: float) -> Array:
    """Draw where the wheel is: in front of the arm or beside it, its axle as told."""
    around = random.uniform(-1.0, 1.0)
    distance = reach * random.uniform(0.4, 0.8)
    p = np.array([distance * np.cos(around), distance * np.sin(around), random.uniform(-0.3, 0.5)])
    # into the wheel: away from the arm, up to 50 degrees to a side and 35 up or down; or downwards
    heading = around + random.uniform(-0.9, 0.9)
    pitch = -1.4 if random.random() < 0.1 else random.uniform(-0.6, 0.6)
    z = np.array([np.cos(pitch) * np.cos(heading), np.cos(pitch) * np.sin(heading), np.sin(pitch)])
    level = np.array([-np.sin(heading), np.cos(heading), 0.0])  # horizontal, across z
    upright = np.cross(z, level)
    lean = {"horizontal": 0.0, "upright": np.pi / 2.0}.get(axle, random.uniform(0.3, 1.3))
    lean *= float(random.choice([-1.0, 1.0]))
    x = float(random.choice([-1.0, 1.0])) * (np.cos(lean) * level + np.sin(lean) * upright)
    return pose(np.stack([x, np.cross(z, x), z], axis=1), p)


def _held(random: np.random.Generator, part: Part) -> Array:
    """Draw how the part is held: tilted up to a right angle, so far out that it clears the arm."""
    tilt = float(np.arccos(random.uniform(0.0, 1.0)))
    spin, azimuth = random.uniform(-np.pi, np.pi, 2)
    R = Rotation.from_rotvec(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    R = R * Rotation.from_rotvec([0.0, 0.0, spin])
    away = random.uniform(60.0, 140.0) + np.hypot(*part.half) * np.sin(tilt)
    return pose(R.as_matrix(), 1e-3 * np.array([0.0, 0.0, away]))


def _document(
    random: np.random.Generator,
    robot: opl.Robot,
    part: Part,
    placed: _Placed,
    normal: Array,
    counts: tuple[int, int],
    roll: float,
) -> dict[str, Any]:
    """Return the content of the job file, the surface of the workpiece still missing.

    `counts` are how many cutter points are aimed at, and how many rows.
    """
    points, rows = counts
    wheel = placed.wheel
    frames = part.frames(normal, (2, 41))
    p = 1e3 * frames[:, :3, 3].reshape(2, 41, 3)
    length = float(np.linalg.norm(np.diff(p, axis=1), axis=2).sum(axis=1).max())
    across = float(np.ptp(p.reshape(-1, 3) @ normal))
    if abs(normal[0]) < 0.9:  # rows across the part: as long as it is wide
        length = 2.0 * part.half[0]
    pitch = 0.9 * across / rows
    process = {
        "feed_mm_s": float(random.choice([10, 20, 40])),
        "approach_mm": float(random.choice([20, 50])),
        "home_deg": np.rad2deg(placed.home).round(4).tolist(),
        "max_dwell_s": 30.0,  # how long the belt may stay on one spot is not what is tried
    }
    passes = {
        "plane_normal": normal.round(6).tolist(),
        "pitch_mm": round(pitch, 3),
        "margin_mm": round(0.04 * across, 3),
        "rows": rows,
        "max_chord_error_mm": 0.05,
        "max_step_mm": round(max(length * rows / points, 0.5), 3),
        "order": str(random.choice(["zigzag", "one_way", "shortest"])),
    }
    if part.fillet is not None:
        top = float(part.at(np.zeros(1), np.zeros(1))[0, 2])
        passes["end_margin_mm"] = round(0.5 * (top - part.fillet), 3)
    maker = robot.maker
    program: dict[str, Any] = {"controller": LANGUAGES.get(maker, "DX200")}
    if robot.missing_pulses:
        program["controller"] = "RAPID"  # the search is tried, not the pulses that nobody knows
    elif robot.unverified_pulses:
        program["accept_unverified_pulses"] = list(robot.unverified_pulses)
    away = 1e3 * placed.T_flange_workpiece[2, 3]
    return {
        "name": "",
        "robot": robot.name,
        "wheel": {
            "T_base_contact0_mm": _in_mm(wheel.T_base_contact0),
            "width_mm": round(1e3 * wheel.width, 6),
            "radius_mm": round(1e3 * wheel.radius, 6),
            "max_roll_deg": roll,
            "max_belt_penetration_mm": float(random.choice([0.3, 0.5, 0.8])),
        },
        "clearance_mm": float(random.choice([3, 5])),
        "obstacles": _obstacles(random, wheel, robot),
        "fixture": {
            "T_flange_workpiece_mm": _in_mm(placed.T_flange_workpiece),
            "bodies": [
                {
                    "name": "stem",
                    "cylinder_mm": [12.0, round(away, 3)],
                    "at_mm": [0.0, 0.0, round(away / 2.0, 3)],
                }
            ],
        },
        "workpiece": {"surface": "", "mesh": "part.stl", "mesh_unit": "mm"},
        "passes": passes,
        "search": {
            "contact_positions": int(random.integers(60, 200)),
            "max_contact_step": float(random.choice([1, 2])),
            "max_contact_error_mm": 0.15,
        },
        "process": process,
        "program": program,
    }


def _in_mm(T: Array) -> list[list[float]]:
    scaled = T.copy()
    scaled[:3, 3] *= 1e3
    # digits enough that the axes stay at right angles
    return [[float(round(value, 8)) for value in row] for row in scaled]


def _obstacles(
    random: np.random.Generator, wheel: ContactWheel, robot: opl.Robot
) -> list[dict[str, Any]]:
    """Draw what stands around: the machine behind the wheel, a post beside it, the floor."""
    found: list[dict[str, Any]] = []
    T = wheel.T_base_contact0

    def beside(name: str, size: list[float], at: Array) -> None:
        place = (1e3 * (T[:3, 3] + T[:3, :3] @ at)).round(3).tolist()
        turned = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True).round(6).tolist()
        found.append({"name": name, "box_mm": size, "at_mm": place, "rotation_deg": turned})

    if random.random() < 0.6:
        beside("machine", [60.0, 200.0, 300.0], np.array([0.0, 0.0, 2.0 * wheel.radius + 0.2]))
    if random.random() < 0.25:
        side = float(random.choice([-1.0, 1.0])) * random.uniform(0.25, 0.5)
        beside("post", [40.0, 500.0, 40.0], np.array([side, 0.0, random.uniform(-0.05, 0.2)]))
    if random.random() < 0.3:
        low = round(-1e3 * robot.base_height - 12.0, 3)
        found.append({"name": "floor", "box_mm": [4000.0, 4000.0, 20.0], "at_mm": [0.0, 0.0, low]})
    return found


def _box_faces(path: Path) -> list[int]:
    """Return top, fillets and sides of a box by their numbers."""
    faces = opl.list_faces(path, None, np.deg2rad(30.0))
    return [f.number for f in faces if abs(f.normal[0]) < 0.3 and f.normal[2] > -0.3]
