"""A surface and a solid made in Python, ground without any file.

Run it with ``python examples/03_surface_from_python.py``. The part is a bar with an arched top. It
takes a few seconds and prints the first lines of the program.
"""

from __future__ import annotations

import numpy as np

import opl

LENGTH, WIDTH, HEIGHT, ARCH = 0.080, 0.025, 0.040, 0.008  # of the bar in [m]
BASE = 0.060  # the bottom of the bar above the origin of the workpiece frame in [m]

JOB = {
    "name": "ARCH",
    "robot": "gp25",
    "wheel": {
        "T_base_contact0_mm": [[0, 0, 1, 890], [1, 0, 0, 236], [0, 1, 0, 323], [0, 0, 0, 1]],
        "width_mm": 50,
        "radius_mm": 150,
        "max_roll_deg": 45,
        "max_belt_penetration_mm": 0.5,
    },
    "fixture": {"T_flange_workpiece_mm": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 85], [0, 0, 0, 1]]},
    "passes": {
        "plane_normal": [1, 0, 0],
        "pitch_mm": 10,
        "end_margin_mm": 5,
        "max_chord_error_mm": 0.1,
        "max_step_mm": 10,
        "order": "zigzag",
    },
    "search": {"contact_positions": 40, "max_contact_step": 5, "max_contact_error_mm": 0.3},
    "process": {"feed_mm_s": 20, "approach_mm": 20, "home_deg": [15, -45, -50, 0, 50, -180]},
    "program": {"controller": "DX200"},
}


def arched_top() -> opl.NurbsSurface:
    """Return the top: straight along x, a parabola along y; du x dv points out of the bar."""
    x, y = 0.5 * WIDTH, 0.5 * LENGTH
    low, high = BASE + HEIGHT, BASE + HEIGHT + 2.0 * ARCH  # the middle point pulls it to ARCH
    rows = [[(side, -y, low), (side, 0.0, high), (side, y, low)] for side in (-x, x)]
    knots_u, knots_v = np.array([0.0, 0, 1, 1]), np.array([0.0, 0, 0, 1, 1, 1])
    return opl.NurbsSurface(1, 2, knots_u, knots_v, np.array(rows), np.ones((2, 3)))


def bar(n: int = 100) -> opl.TriangleMesh:
    """Return the solid: its side view has the bottom and n + 1 points of the arch."""
    y = np.linspace(-0.5, 0.5, n + 1) * LENGTH
    z = BASE + HEIGHT + ARCH * (1.0 - np.square(2.0 * y / LENGTH))
    side_view = np.vstack([np.column_stack([y, z])[::-1], [[y[0], BASE], [y[-1], BASE]]])
    m = len(side_view)
    vertices = np.vstack([np.column_stack([np.full(m, x), side_view]) for x in (-1.0, 1.0)])
    vertices[:, 0] *= 0.5 * WIDTH
    around = [(i, (i + 1) % m) for i in range(m)]
    faces = [face for i, j in around for face in ((i, j, j + m), (i, j + m, i + m))]
    for i in range(1, m - 1):  # the ends, seen from outside
        faces += [(0, i + 1, i), (m, m + i, m + i + 1)]
    return opl.TriangleMesh(vertices, np.array(faces))


def main() -> None:
    """Plan, verify and write a program for the bar; print how it begins."""
    job = opl.load_job(JOB, surface=arched_top(), part=bar())
    run = opl.run_job(job)
    if isinstance(run, opl.Refused):
        raise run.error
    report = opl.make_report(run)
    print(f"{report.cutter_points} cutter points in {report.passes} passes, proven:")
    print("\n".join(run.files["ARCH.JBI"].splitlines()[:12]))


if __name__ == "__main__":
    main()
