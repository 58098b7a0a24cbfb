"""From a job in YAML to a proven robot program.

Run it with ``python examples/01_from_yaml_to_program.py [FOLDER]``. It takes a few seconds, prints
what was found, and leaves the files of the program in the folder.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import opl

# One row over the V-shaped part, coarse, so that it is quick. Lengths in mm, angles in degrees.
JOB = """
name: FIRST
robot: mh24

wheel:
  T_base_contact0_mm:       # contact frame 0 in the base frame: z into the wheel, x along its axle
    - [0, 0, 1, 890]
    - [1, 0, 0, 236]
    - [0, 1, 0, 323]
    - [0, 0, 0, 1]
  width_mm: 50
  radius_mm: 150
  max_roll_deg: 45
  max_belt_penetration_mm: 1.0

obstacles:
  - {name: floor, box_mm: [4000, 4000, 20], at_mm: [0, 0, -516]}

fixture:
  T_flange_workpiece_mm:
    - [0.9237, 0.3827, 0.0158, 9.6032]
    - [-0.3826, 0.9239, -0.0067, -3.9836]
    - [-0.0171, 0.0001, 1, 85.6760]
    - [0, 0, 0, 1]

workpiece: {surface: surface.json, mesh: v_shape.stl, mesh_unit: mm}
passes: {plane_normal: [1, 0, 0], pitch_mm: 5, rows: 1, max_chord_error_mm: 0.3, max_step_mm: 20}
search: {contact_positions: 40, max_contact_step: 5, max_contact_error_mm: 0.5}
process: {feed_mm_s: 20, approach_mm: 20, home_deg: [15, -45, -50, 0, 50, -180]}
program: {controller: DX200, accept_unverified_pulses: [R, B, T]}
"""


def main(folder: Path) -> None:
    """Plan, verify, write and prove a program; leave its files in a folder."""
    part = folder / "part"
    opl.start_job(part)  # the V part of the examples: surface.json and v_shape.stl
    file = part / "first.yaml"
    file.write_text(JOB, encoding="utf-8")

    surfaced = opl.cut_surface(opl.load_job(file))
    print("\n".join(opl.describe_job(surfaced)))

    watch = opl.Watch(lambda stage, done: print(f"  {stage.value}: {100 * done:.0f} %"))
    planned = opl.plan_path(surfaced, watch)
    proven = planned if isinstance(planned, opl.Refused) else opl.verify_motion(planned, watch)
    run = proven if isinstance(proven, opl.Refused) else opl.write_program(proven, watch)
    if isinstance(run, opl.Refused):
        raise run.error

    files = opl.deliver(run, folder / "program")
    report = opl.make_report(run)
    print(f"joint range sum {report.path.joint_range_sum_rad:.3f} rad")
    print(f"clearance {report.verification.min_clearance_mm:.1f} mm or more")
    print(f"cycle time {report.cycle.total_s:.1f} s")

    # what the controller will read is proven once more, from its bytes
    program = [path for path in files if path.suffix == ".JBI"]
    proof = opl.prove_program(surfaced.job, program)
    print(f"{', '.join(map(str, program))}: {'proven' if proof.proven else proof.findings}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp(prefix="opl-")))
