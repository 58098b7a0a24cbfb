"""Jobs and cells in words and figures: what stands where, and what a run would do."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array, roll_pitch_yaw
from opl.geometry.shapes import Body, Box, Cylinder
from opl.job.values import Cell, PlacedWheel
from opl.run.values import Surfaced

if TYPE_CHECKING:  # what reads part files is not loaded for a run
    from opl.geometry.faces import FaceSummary

MM = 1e3
PENDANT = ("X", "Y", "Z", "Rx", "Ry", "Rz")
TOUCHING = 1e-4  # [m] an error of touching that people can think of


def describe_job(surfaced: Surfaced) -> list[str]:
    """Return in words what a run of a job would do, one line each."""
    job, points = surfaced.job, surfaced.points
    cell, wheel, search = job.cell, job.cell.wheel, job.search
    lines = [
        f"program {job.name} for {cell.robot.title}",
        f"wheel {MM * wheel.width:g} mm wide, radius {MM * wheel.radius:g} mm, roll up to "
        f"{np.rad2deg(wheel.max_roll):g} deg about its edges",
        f"{len(points)} cutter points in {points.n_passes} passes ({job.passes.order.value}), bow "
        f"height {MM * job.passes.max_bow_height:g} mm",
        f"node matrix {len(points)} x {search.n_contact_positions}, search "
        f"{search.method.value} for the least {search.objective.value}",
    ]
    around = job.around
    if around.cell.path is not None:
        lines.append(f"cell {around.cell.path}:")
        lines += [f"  {line}" for line in describe_cell(around.cell)]
    else:
        lines += _fit_lines(around.placed)
        lines.append(f"obstacles: {', '.join(body.name for body in cell.obstacles) or 'none'}")
    if cell.robot.unverified_pulses:
        lines.append(f"pulse ratios not verified: {', '.join(cell.robot.unverified_pulses)}")
    return [*lines, *(f"warning: {finding}" for finding in surfaced.warnings)]


def describe_cell(cell: Cell) -> list[str]:
    """Return what a cell holds in words, one line each."""
    figures = cell_figures(cell)
    x, y, z, *turned = pendant_figures(cell.T_cell_base)
    turn = f", turned {_numbers(turned)} deg about x, y, z" if any(turned) else ""
    lines = [
        f"robot {cell.robot.title}, its base frame at {_numbers((x, y, z))} mm in the cell{turn}"
    ]
    for placed, wheel in zip(cell.wheels, figures["wheels"], strict=True):
        shown = [*wheel["pendant"]["xyz_mm"], *wheel["pendant"]["rx_ry_rz_deg"]]
        place = " ".join(f"{name} {value:.3f}" for name, value in zip(PENDANT, shown, strict=True))
        lines.append(
            f"{placed.name}: {wheel['width_mm']:g} mm wide, radius {wheel['radius_mm']:g} mm, "
            f"contact frame 0 on the pendant: {place}"
        )
        lines += _fit_lines(placed)
    kept = "".join(
        f", {' and '.join(one['pair'])} {one['clearance_mm']:g} mm" for one in figures["clearances"]
    )
    touching = ", ".join(" and ".join(pair) for pair in figures["allowed_contacts"])
    limits = ", ".join(
        f"{one['name']} {one['lower_deg']:g} to {one['upper_deg']:g} deg"
        for one in figures["limits"]
    )
    lines += [
        f"obstacles: {_bodies(cell.obstacles)}",
        f"gripper: {_bodies(cell.gripper)}",
        f"clearance {figures['clearance_mm']:g} mm{kept}",
        f"may touch: {touching or 'nothing'}",
        f"limits beside the robot's own: {limits or 'none'}",
    ]
    if cell.home is not None:
        lines.append(f"home {_numbers(figures['home_deg'])} deg")
    return lines


def _fit_lines(placed: PlacedWheel) -> Iterator[str]:
    """Yield how well the touched points of a wheel fit, nothing if it was not found by touching."""
    fit = placed.fit
    if fit is None:
        return
    points = ", ".join(
        f"{label} {MM * off:.3f}" for label, off in zip(fit.labels, fit.residuals, strict=True)
    )
    yield f"  residuals of its touched points in mm: {points}"
    yield (
        f"  {fit.spare} equations more than needed; touching within {MM * TOUCHING:g} mm fixes the "
        f"origin within {MM * TOUCHING * fit.origin_per_error:.2f} mm, the axle within "
        f"{np.rad2deg(TOUCHING * fit.turn_per_error):.2f} deg"
    )


def cell_figures(cell: Cell) -> dict[str, Any]:
    """Return what a cell holds in plain numbers, in mm and degrees."""
    return {
        "cell": str(cell.path),
        "robot": cell.robot.name,
        "T_cell_base_mm": _matrix(cell.T_cell_base),
        "wheels": [_wheel_figures(cell.robot, placed) for placed in cell.wheels],
        "obstacles": [body.name for body in cell.obstacles],
        "gripper": [body.name for body in cell.gripper],
        "clearance_mm": MM * cell.clearance,
        "clearances": [
            {"pair": list(pair), "clearance_mm": MM * distance}
            for pair, distance in cell.pairs.given
            if distance is not None
        ],
        "allowed_contacts": [list(pair) for pair, distance in cell.pairs.given if distance is None],
        "limits": [
            {
                "name": limit.name,
                "coefficients": limit.coefficients.tolist(),
                "lower_deg": round(float(np.rad2deg(limit.lower)), 6),
                "upper_deg": round(float(np.rad2deg(limit.upper)), 6),
            }
            for limit in cell.limits
        ],
        "home_deg": None if cell.home is None else np.round(np.rad2deg(cell.home), 6).tolist(),
    }


def _wheel_figures(robot: Robot, placed: PlacedWheel) -> dict[str, Any]:
    wheel, fit = placed.wheel, placed.fit
    shown = pendant_figures(robot.T_controller_base @ wheel.T_base_contact0)
    return {
        "name": placed.name,
        "width_mm": MM * wheel.width,
        "radius_mm": MM * wheel.radius,
        "T_base_contact0_mm": _matrix(wheel.T_base_contact0),
        "pendant": {"xyz_mm": list(shown[:3]), "rx_ry_rz_deg": list(shown[3:])},
        "residuals_mm": None
        if fit is None
        else {
            label: round(MM * float(off), 4)
            for label, off in zip(fit.labels, fit.residuals, strict=True)
        },
        "spare_equations": None if fit is None else fit.spare,
    }


def face_figures(face: FaceSummary) -> dict[str, object]:
    """Return a face of a part file in plain numbers, in mm."""
    return {
        "id": face.number,
        "type": face.type,
        "area_mm2": round(1e6 * face.area, 3),
        "low_mm": (1e3 * face.low).round(3).tolist(),
        "high_mm": (1e3 * face.high).round(3).tolist(),
        "mean_normal": face.normal.round(4).tolist(),
        "holes": face.holes,
    }


def pendant_figures(T: Array) -> tuple[float, ...]:
    """Return X Y Z in mm and Rx Ry Rz in degrees."""
    figures = np.concatenate([MM * T[:3, 3], np.rad2deg(roll_pitch_yaw(T))])
    return tuple(float(value) + 0.0 for value in np.round(figures, 4))  # no negative zero


def _matrix(T: Array) -> list[list[float]]:
    in_mm = T.copy()
    in_mm[:3, 3] *= MM
    rows: list[list[float]] = (np.round(in_mm, 9) + 0.0).tolist()
    return rows


def _numbers(values: Any) -> str:
    return " ".join(f"{value:g}" for value in values)


def _bodies(bodies: tuple[Body, ...]) -> str:
    return ", ".join(f"{body.name} ({_shape(body)})" for body in bodies) or "none"


def _shape(body: Body) -> str:
    if isinstance(body.shape, Box):
        return "box"
    if isinstance(body.shape, Cylinder):
        return "cylinder"
    size = " x ".join(f"{MM * edge:.0f}" for edge in np.ptp(body.shape.vertices, axis=0))
    return f"mesh of {len(body.shape.faces)} triangles, {size} mm"
