"""The table of a motion (CSV): what the robot does, configuration by configuration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from opl.files import resources
from opl.geometry.frames import Array, roll_pitch_yaw
from opl.motion.motion import VerifiedMotion
from opl.program.digits import fixed
from opl.program.layout import fill
from opl.program.posts import Written
from opl.program.pulses import PulseScale

TEMPLATE = resources.folder("templates") / "csv" / "table.csv.j2"


def render_table(
    verified: VerifiedMotion,
    written: Written,
    scale: PulseScale,
    Ts_controller_flange: Array,
    *,
    template: Path | None = None,
) -> str:
    """Return the table, one row for each configuration of the motion.

    Passes count from 1 as in the job's comments, cutter points from 0. A cell is empty where a
    quantity is not defined: pass at home, cutter point and t off the wheel. Columns of pulses are
    there if all are known. Speed is what the program says, and
    programmed_s the time of the move at it; both are empty for a configuration that repeats the one
    before and so has no move of its own (the time of that row is in the move that follows), and
    programmed_s where nobody knows from where it comes.

    Args:
        verified: The motion.
        written: The program written from it.
        scale: Pulses of the robot.
        Ts_controller_flange: Pose of the flange at each configuration, as the pendant of the robot
            shows it, origin in [m], shape (n, 4, 4).
        template: Layout of the table; None for the one that comes with opl.

    Raises:
        UnsafeError: If a configuration is beyond the soft limits.
        InputError: If the template is unusable.
    """
    motion = verified.motion
    pulses = scale.to_pulses(motion.q).tolist() if scale.complete else [()] * len(motion)
    angles = np.rad2deg(motion.q)
    positions = Ts_controller_flange[:, :3, 3] * 1e3
    rotations = np.rad2deg(roll_pitch_yaw(Ts_controller_flange))
    columns = _columns(scale.joint_names, scale.complete)
    rows = [
        (
            str(motion.pass_index[i] + 1) if motion.pass_index[i] >= 0 else "",
            _fixed(motion.cutter_point[i], 4),
            motion.kind[i].value,
            _fixed(motion.contact_position[i], 4),
            *(_fixed(angle, 4) for angle in angles[i]),
            *map(str, pulses[i]),
            *(_fixed(length, 3) for length in positions[i]),
            *(_fixed(angle, 4) for angle in rotations[i]),
            _fixed(verified.timed.duration[i], 4),
            _fixed(written.times.get(i, np.nan), 4),
            written.speeds.get(i, ""),
            _fixed(verified.clearance[i] * 1e3, 3),
        )
        for i in range(len(motion))
    ]
    values = {
        "columns": columns,
        "rows": [dict(zip(columns, row, strict=True)) for row in rows],
    }
    return fill(TEMPLATE if template is None else template, values)


def _columns(joint_names: Sequence[str], with_pulses: bool) -> tuple[str, ...]:
    return (
        *("pass", "cutter_point", "kind", "t"),
        *(f"{name}_deg" for name in joint_names),
        *(f"{name}_pulses" for name in joint_names if with_pulses),
        *("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"),
        *("time_s", "programmed_s", "speed", "clearance_mm"),
    )


def _fixed(value: float, decimals: int) -> str:
    """Return a number with fixed decimals, never -0; empty for NaN."""
    return "" if np.isnan(value) else fixed(float(value), decimals)
