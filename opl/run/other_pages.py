"""Pages of what is no run: cutter points, a cell."""

from __future__ import annotations

import numpy as np

from opl.cell.drawn_cell import BASE, FLANGE, DrawnSolid, drawn_chain, drawn_links
from opl.cell.workcell import PART, wheel_solid
from opl.geometry.shapes import Body
from opl.job.values import Cell
from opl.report.drawn import drawn_cell, drawn_wheel, views, views_of_part
from opl.report.html import bullets, page, section, text
from opl.report.packing import Packer
from opl.report.view_frame import view_frame
from opl.run.descriptions import describe_cell
from opl.run.page_data import EMPTY, joints_data, passes_data
from opl.run.values import Surfaced


def points_page(surfaced: Surfaced, figures: str) -> str:
    """Return the page of cutter points: the part, its passes and frames.

    Args:
        surfaced: The cutter points.
        figures: Their figures, in a line.
    """
    job, packer = surfaced.job, Packer()
    points, paints = passes_data(surfaced, packer)
    missed = surfaced.inspection.uncovered.points
    part = DrawnSolid(Body(PART, job.cell.part, np.eye(4)), BASE, False)
    normal = surfaced.points.Ts_workpiece_cutter[:, :3, 2].mean(axis=0)
    data = {
        **EMPTY,
        "name": f"{job.name}_points",
        "cell": drawn_cell(None, [part], packer),
        "views": views_of_part(job.cell.part, normal),
        "points": points,
        "paints": paints,
    }
    body = "\n".join(
        [
            f"<header><h1>{text(job.name)}: what will be ground</h1>"
            f"<p>{text(figures)}</p></header>",
            view_frame("The part", data["views"], ["pass", "ridge", "none"], ["frames"], False),
            bullets(["orange dots: no pass comes by here"] if len(missed) else []),
            section("warnings", "Warnings", bullets(map(str, surfaced.warnings))),
        ]
    )
    return page(f"{job.name}: cutter points", body, data, packer.block())


def cell_page(cell: Cell) -> str:
    """Return the page of a cell: what stands where, the robot at home or at zero."""
    packer, wheel, chain = Packer(), cell.wheels[0].wheel, drawn_chain(cell.robot)
    name = cell.robot.name if cell.path is None else cell.path.stem
    solids = [
        *drawn_links(cell.robot),
        *(
            DrawnSolid(
                Body(body.name, body.shape, chain.T_joint_flange @ body.T_parent_body),
                FLANGE,
                False,
            )
            for body in cell.gripper
        ),
        *(DrawnSolid(wheel_solid(one.wheel, one.name), BASE, False) for one in cell.wheels),
        *(DrawnSolid(body, BASE, False) for body in cell.obstacles),
    ]
    data = {
        **EMPTY,
        "name": name,
        "joints": joints_data(cell.robot),
        "cell": drawn_cell(chain, solids, packer, [one.name for one in cell.wheels]),
        "views": views(wheel),
        "home": (np.zeros(6) if cell.home is None else cell.home).tolist(),
        "wheel": drawn_wheel(wheel),
    }
    body = "\n".join(
        [
            f"<header><h1>{text(name)}</h1></header>",
            view_frame("The cell", data["views"], [], ["section", "robot", "surroundings"], False),
            section("words", "What it holds", bullets(describe_cell(cell))),
        ]
    )
    return page(f"{name}: cell", body, data, packer.block())
