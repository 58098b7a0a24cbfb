"""Make machine_frame.stl and gripper.stl, the meshes of belt_cell.yaml, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres. Both are boxes that overlap: a body only stands in the way, so it need not be one
closed surface.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

FOLDER = Path(__file__).resolve().parent

Corners = tuple[tuple[float, float, float], tuple[float, float, float]]

# in the frame of the cell: four legs of square tube, rails between them, a plate for the belt drive
TUBE = 60.0
X, Y, Z = (1500.0, 1900.0), (-17.5, 482.5), (0.0, 1200.0)
RAILS = (60.0, 1140.0)  # heights at which rails join the legs

# in the frame of the flange, before it is turned as the part is: palm and two fingers
PALM: Corners = ((-30.0, -15.0, 30.0), (30.0, 15.0, 85.0))
FINGER = ((13.5, -15.0, 80.0), (21.5, 15.0, 118.0))


def machine_frame() -> list[Corners]:
    """Return the boxes of the frame."""
    half = TUBE / 2.0
    xs, ys = ((low + half, high - half) for low, high in (X, Y))
    legs: list[Corners] = [
        ((x - half, y - half, Z[0]), (x + half, y + half, Z[1])) for x in xs for y in ys
    ]
    rails: list[Corners] = []
    for z in RAILS:
        rails += [((X[0], y - half, z - half), (X[1], y + half, z + half)) for y in ys]
        rails += [((x - half, Y[0], z - half), (x + half, Y[1], z + half)) for x in xs]
    drive: Corners = ((X[1] - TUBE, Y[0], 600.0), (X[1], Y[1], 1050.0))
    return [*legs, *rails, drive]


def gripper() -> list[Corners]:
    """Return the boxes of the gripper: the fingers hold the part by its two flat sides."""
    (x0, y0, z0), (x1, y1, z1) = FINGER
    return [PALM, FINGER, ((-x1, y0, z0), (-x0, y1, z1))]


def write(name: str, boxes: list[Corners]) -> None:
    """Write boxes as one mesh."""
    solids = []
    for low, high in boxes:
        box = trimesh.creation.box(np.subtract(high, low))
        box.apply_translation(0.5 * np.add(low, high))
        solids.append(box)
    trimesh.util.concatenate(solids).export(FOLDER / name)


if __name__ == "__main__":
    write("machine_frame.stl", machine_frame())
    write("gripper.stl", gripper())
