"""A proven motion as JSON, for viewers and programs of others."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.motion.motion import VerifiedMotion

MM = 1e3


def motion_trace(verified: VerifiedMotion, job: str, joint_names: Sequence[str]) -> str:
    """Return a list for each quantity, one item for each configuration; null where there is none.

    Between two configurations all joints turn in step. Passes count from 1, cutter points from 0.
    The clearance is the least on the move that ends there.
    """
    motion = verified.motion
    fields: dict[str, object] = {
        "job": job,
        "joints": list(joint_names),
        "time_s": _numbers(np.cumsum(verified.timed.duration), 6),
        "q_rad": [_numbers(q, 9) for q in motion.q],
        "kind": [kind.value for kind in motion.kind],
        "pass": [int(index) + 1 if index >= 0 else None for index in motion.pass_index],
        "cutter_point": _numbers(motion.cutter_point, 6),
        "t": _numbers(motion.contact_position, 6),
        "clearance_mm": _numbers(MM * verified.clearance, 3),
    }
    lines = (f" {json.dumps(name)}: {json.dumps(value)}" for name, value in fields.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _numbers(values: Array, digits: int) -> list[float | None]:
    """Return numbers with so many decimals, None for NaN; no negative zero."""
    return [None if np.isnan(value) else round(float(value), digits) + 0.0 for value in values]
