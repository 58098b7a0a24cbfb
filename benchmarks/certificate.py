"""Checks printed bounds by other means than the search. By hand: python benchmarks/certificate.py.

Takes the walls that a proof rests on, cell by cell, and solves one integer program over them with
HiGHS: which cell of each wall the box meets, and where in it. No code of the search is used, and
what HiGHS proves is compared with what was printed. The cells themselves are held against sampled
inverse solutions.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, vstack

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.job.load import load_job
from opl.planning.multi_start import plan_recursive
from opl.planning.optimal import OptimalSearch
from opl.planning.problem import GrindingProblem
from opl.planning.scene import planning_scene
from opl.run.preparing import problem_in
from opl.run.surfacing import cut_surface
from opl.search.walls import Piece, Wall

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"
CASES = ("v_shape:1", "s_shape:1")
SAMPLES = 2001  # of a piece
SECONDS = 300.0  # that HiGHS may take
GAP = 2e-4  # to which it is to solve


def least_box(walls: list[Wall], largest: float) -> float:
    """Return what HiGHS proves of the least box that meets a cell of each wall, in [rad].

    Every wall's own family is free to differ: that can only make the box smaller.

    Args:
        walls: All of one pass.
        largest: A box that is known to be enough, in [rad].
    """
    rows, count, owner = [], 12, []
    cells = []
    for index, wall in enumerate(walls):
        for piece in wall.pieces:
            for k in range(len(piece.pad_low)):
                cells.append((piece, k))
                owner.append(index)
    n = len(cells)
    count += 2 * n
    limits = []
    for index in range(len(walls)):
        own = np.flatnonzero(np.array(owner) == index)
        for joint in range(6):
            start = np.array([cells[c][0].corners[cells[c][1], joint] for c in own])
            end = np.array([cells[c][0].corners[cells[c][1] + 1, joint] for c in own])
            low = start + np.array([cells[c][0].pad_low[cells[c][1], joint] for c in own])
            high = start + np.array([cells[c][0].pad_high[cells[c][1], joint] for c in own])
            for face, value, sign in ((6 + joint, low, 1.0), (joint, high, -1.0)):
                # sign * face >= sign * (value z + (end - start) x)
                columns = np.concatenate([[face], 12 + own, 12 + n + own])
                entries = np.concatenate([[sign], -sign * value, -sign * (end - start)])
                rows.append(
                    csr_array((entries, (np.zeros(len(columns), int), columns)), (1, count))
                )
                limits.append((0.0, np.inf))
        one = csr_array((np.ones(len(own)), (np.zeros(len(own), int), 12 + own)), (1, count))
        rows.append(one)
        limits.append((1.0, 1.0))
    eye = csr_array(
        (
            np.concatenate([np.ones(n), -np.ones(n)]),
            (np.tile(np.arange(n), 2), np.concatenate([12 + np.arange(n), 12 + n + np.arange(n)])),
        ),
        (n, count),
    )
    matrix = vstack([*rows, eye])
    low, high = np.array([*limits, *[(0.0, np.inf)] * n]).T
    corners = np.concatenate([piece.corners for wall in walls for piece in wall.pieces])
    least, most = corners.min(axis=0) - largest, corners.max(axis=0) + largest
    bounds = Bounds(
        np.concatenate([least, least, np.zeros(2 * n)]),
        np.concatenate([most, most, np.ones(2 * n)]),
    )
    cost = np.concatenate([-np.ones(6), np.ones(6), np.zeros(2 * n)])
    integrality = np.concatenate([np.zeros(12), np.ones(n), np.zeros(n)])
    found = milp(
        cost,
        integrality=integrality,
        bounds=bounds,
        constraints=LinearConstraint(matrix, low, high),
        options={"time_limit": SECONDS, "mip_rel_gap": GAP},
    )
    return float(found.mip_dual_bound)


def worst_outside(problem: GrindingProblem, piece: Piece) -> float:
    """Return by how much a sampled posture leaves its cell, in [rad]; not positive if none does."""
    at = np.linspace(piece.at[0], piece.at[-1], SAMPLES)[1:-1]
    line, cell = piece.line, problem.cell
    if line.T_workpiece_cutter is None:
        frames, t = problem.points.frames_at(at), np.full(len(at), line.contact_position)
    else:
        frames, t = np.broadcast_to(line.T_workpiece_cutter, (len(at), 4, 4)), at
    q = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(t, frames))[:, piece.family]
    k = np.clip(np.searchsorted(piece.at, at) - 1, 0, len(piece.at) - 2)
    x = ((at - piece.at[k]) / (piece.at[k + 1] - piece.at[k]))[:, None]
    away = q - (1.0 - x) * piece.corners[k] - x * piece.corners[k + 1]
    away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
    return float(np.nanmax(np.maximum(away - piece.pad_high[k], piece.pad_low[k] - away)))


def check(part: str, rows: int) -> bool:
    """Print what was proven by the search and by other means; return whether they agree."""
    job = load_job(WORKPIECES / part / "job.yaml")
    job = replace(job, passes=replace(job.passes, rows=rows))
    problem = problem_in(planning_scene(job.cell), job, cut_surface(job).points)
    search = OptimalSearch(problem, job.search.optimal, plan_recursive(problem))
    while not search.finished:
        search.step()
    walls = search.proof.walls
    outside = max(worst_outside(problem, piece) for wall in walls for piece in wall.pieces)
    start = time.perf_counter()
    proven = least_box(walls, search.plan.path.joint_range_sum)
    spent = time.perf_counter() - start
    agree = outside <= 1e-9 and proven >= search.lower_bound * (1.0 - GAP)
    print(
        f"{part}, {rows} rows: printed {search.lower_bound:.5f} rad over {len(walls)} walls; HiGHS "
        f"proves {proven:.5f} in {spent:.1f} s; sampled postures stay {-outside:.1e} rad inside: "
        f"{'agreed' if agree else 'NOT AGREED'}"
    )
    return agree


def main() -> None:
    """Check the cases; parts and rows may be named as arguments, like ``v_shape:1``."""
    agreed = []
    for case in sys.argv[1:] or CASES:
        part, _, rows = case.partition(":")
        agreed.append(check(part, int(rows)))
    raise SystemExit(0 if all(agreed) else 1)


if __name__ == "__main__":
    main()
