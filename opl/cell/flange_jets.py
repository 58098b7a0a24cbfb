"""Motions of the flange on the wheel, enclosed: over contact positions, and along the path."""

from __future__ import annotations

import numpy as np

from opl.cell.inverse_jets import Axes, FlangeJets
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.geometry.jets import Jet, constant, variable, wave
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel


def contact_jets(
    wheel: ContactWheel, Ts_cutter_flange: Array, t: Array, radius: Array
) -> FlangeJets:
    """Enclose the motion of the flange while a place of the part moves over the wheel.

    Args:
        wheel: The wheel.
        Ts_cutter_flange: The place of each cell, shape (n, 4, 4).
        t: Middle of each cell, all of it on the flat or on one edge, shape (n,).
        radius: Half its width, shape (n,).
    """
    T0 = wheel.T_base_contact0
    slide = np.clip(t, -wheel.flat_end, wheel.flat_end)
    rolled = np.abs(t) > wheel.flat_end
    # axes and origin of the flange in the frame of the cutter, each along each axis of the base
    x, y, z = np.moveaxis(Ts_cutter_flange[:, :3], 0, -1)
    x0, y0, z0, p0 = (T0[:3, k, None, None] for k in range(4))
    cosine, sine = x0 * x + z0 * z, x0 * z - z0 * x
    jets = wave(cosine, sine, t - slide, np.where(rolled, radius, 0.0), np.deg2rad(1.0))
    jets.data[2:] *= rolled
    jets.data[0] += y0 * y
    jets.data[0, :, 3] += p0[..., 0]
    sliding = variable(slide, np.where(rolled, 0.0, radius))
    sliding.data[2, rolled] = 0.0
    origin = Jet(jets.data[:, :, 3]) + sliding.scaled(-x0[..., 0] / MM_PER_M)
    x_axis, y_axis, z_axis = (_axes(jets.data[:, :, k]) for k in range(3))
    return FlangeJets(x_axis, y_axis, z_axis, _axes(origin.data))


def path_jets(
    points: CutterPoints,
    Ts_base_contact: Array,
    T_flange_workpiece: Array,
    at: Array,
    radius: Array,
) -> FlangeJets:
    """Enclose the motion of the flange along the path, the contact position the same.

    Args:
        points: The cutter points.
        Ts_base_contact: The contact frame of each cell, shape (n, 4, 4).
        T_flange_workpiece: How the part is held, shape (4, 4).
        at: Middle of each cell, a fractional cutter point, shape (n,).
        radius: Half its width, all of it between the same two, shape (n,).
    """
    before = np.floor(at).astype(int)
    one, other = points.Ts_workpiece_cutter[before], points.Ts_workpiece_cutter[before + 1]
    share = variable(at - before, radius)

    def blend(column: int) -> Axes:
        a, b = one[:, :3, column], other[:, :3, column]
        x, y, z = (share.scaled(b[:, k] - a[:, k]).plus(a[:, k]) for k in range(3))
        return x, y, z

    z = _unit(blend(2))
    x_free = blend(0)
    along = _dot(x_free, z)
    x = _unit(_minus(x_free, (z[0] * along, z[1] * along, z[2] * along)))
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    p = blend(3)
    T_workpiece_flange = frames.inverse(T_flange_workpiece)

    def in_base(v: Axes) -> Axes:
        in_cutter = (_dot(x, v), _dot(y, v), _dot(z, v))
        a, b, c = (
            in_cutter[0].scaled(Ts_base_contact[:, k, 0])
            + in_cutter[1].scaled(Ts_base_contact[:, k, 1])
            + in_cutter[2].scaled(Ts_base_contact[:, k, 2])
            for k in range(3)
        )
        return a, b, c

    def fixed(v: Array) -> Axes:
        a, b, c = (constant(float(v[k]), at) for k in range(3))
        return a, b, c

    axes = [in_base(fixed(T_workpiece_flange[:3, k])) for k in range(3)]
    origin = in_base(_minus(fixed(T_workpiece_flange[:3, 3]), p))
    a, b, c = (origin[k].plus(Ts_base_contact[:, k, 3]) for k in range(3))
    return FlangeJets(axes[0], axes[1], axes[2], (a, b, c))


def _axes(data: Array) -> Axes:
    """Return the coordinates of a vector by axis, of data of shape (6, 3, n)."""
    a, b, c = (Jet(np.ascontiguousarray(data[:, k])) for k in range(3))
    return a, b, c


def _dot(a: Axes, b: Axes) -> Jet:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a: Axes, b: Axes) -> Axes:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _unit(v: Axes) -> Axes:
    length = _dot(v, v).root()
    return v[0] / length, v[1] / length, v[2] / length
