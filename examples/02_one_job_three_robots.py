"""The same job on three robots, compared.

Run it with ``python examples/02_one_job_three_robots.py [FOLDER]``. It takes a quarter of a minute
and prints a table; the programs are left in the folder.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import opl

ROBOTS = ("mh24", "gp25", "ar2010")

# A job as a mapping: the keys of a YAML file. One coarse row over the V-shaped part.
JOB = {
    "name": "COMPARED",
    "wheel": {
        "T_base_contact0_mm": [[0, 0, 1, 890], [1, 0, 0, 236], [0, 1, 0, 323], [0, 0, 0, 1]],
        "width_mm": 50,
        "radius_mm": 150,
        "max_roll_deg": 45,
        "max_belt_penetration_mm": 1.0,
    },
    "fixture": {
        "T_flange_workpiece_mm": [
            [0.9237, 0.3827, 0.0158, 9.6032],
            [-0.3826, 0.9239, -0.0067, -3.9836],
            [-0.0171, 0.0001, 1, 85.6760],
            [0, 0, 0, 1],
        ]
    },
    "workpiece": {"surface": "surface.json", "mesh": "v_shape.stl", "mesh_unit": "mm"},
    "passes": {
        "plane_normal": [1, 0, 0],
        "pitch_mm": 5,
        "rows": 1,
        "max_chord_error_mm": 0.3,
        "max_step_mm": 20,
    },
    "search": {"contact_positions": 40, "max_contact_step": 5, "max_contact_error_mm": 0.5},
    "process": {
        "feed_mm_s": 20,
        "approach_mm": 20,
        "max_dwell_s": 5,
        "home_deg": [15, -45, -50, 0, 50, -180],
    },
}


def run_on(robot: str, part: Path) -> opl.Run:
    """Run the job on a robot, taking its pulse ratios as they are."""
    unverified = list(opl.load_robot(robot).unverified_pulses)
    program = {"controller": "DX200", "accept_unverified_pulses": unverified}
    job = opl.load_job({**JOB, "robot": robot, "program": program}, folder=part)
    return opl.run_job(job)


def main(folder: Path) -> None:
    """Run the job on every robot and print how they compare."""
    part = folder / "part"
    opl.start_job(part)  # the V part of the examples: surface.json and v_shape.stl
    print("robot    range sum rad   joint travel rad   cycle s   clearance mm")
    for robot in ROBOTS:
        run = run_on(robot, part)
        if isinstance(run, opl.Refused):
            print(f"{robot:8} {run.reasons[0]}")
            continue
        opl.deliver(run, folder / robot)
        report = opl.make_report(run)
        print(
            f"{robot:8} {report.path.joint_range_sum_rad:13.3f} "
            f"{report.path.joint_travel_rad:18.2f} {report.cycle.total_s:9.1f} "
            f"{report.verification.min_clearance_mm:14.1f}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp(prefix="opl-")))
