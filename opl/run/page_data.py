"""What the viewer of a page draws of a run: cell, nodes, motion, and the places to go to."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.drawn_cell import drawn_chain, drawn_solids
from opl.cell.nearest import Nearest, nearest_pairs
from opl.cell.robot import Robot
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.geometry.frames import Array
from opl.geometry.scallop import ridge_height
from opl.motion.motion import Motion, MoveKind, TimedMotion
from opl.motion.timing import Timing
from opl.planning.survey import CODES, NodeState, NodeSurvey
from opl.report import curves
from opl.report.chart import NEAR_SINGULAR, chart_cells, chart_image, measured_clearance
from opl.report.drawn import drawn_cell, drawn_passes, drawn_wheel, painted, views
from opl.report.packing import Packer
from opl.run.proof_result import PlaceReport
from opl.run.result import Report
from opl.run.values import Drawn, Prepared, Surfaced

MM, MICRONS = 1e3, 1e6
# of a page: what a viewer without a run, an arm or a part goes without
EMPTY: dict[str, Any] = {
    "joints": [],
    "home": None,
    "wheel": None,
    "points": None,
    "field": None,
    "motion": None,
    "clearance": None,
    "curves": {},
    "paints": {},
    "program": None,
    "marks": {},
}
MOST_LOOKS = 600  # at the nearest pair along the motion, evenly in time, beside those on the wheel
KINDS = tuple(MoveKind)
NEARLY_FREE = (
    NodeState.FREE,
    NodeState.SCENE,
    NodeState.ROBOT,
    NodeState.WHEEL,
    NodeState.LIMITS,
    NodeState.REACH,
)

Data = dict[str, Any]


def cell_data(cell: WorkCell, home: Array, packer: Packer) -> Data:
    """Return a page's data with a cell and nothing else, the robot at home."""
    return {
        **EMPTY,
        "joints": joints_data(cell.robot),
        "cell": drawn_cell(drawn_chain(cell.robot), drawn_solids(cell), packer),
        "views": views(cell.wheel),
        "home": home.tolist(),
        "wheel": drawn_wheel(cell.wheel),
    }


def joints_data(robot: Robot) -> list[Data]:
    """Return names and limits of the joints."""
    limits = zip(robot.joint_names, robot.lower.tolist(), robot.upper.tolist(), strict=True)
    return [{"name": name, "lower": lower, "upper": upper} for name, lower, upper in limits]


def passes_data(surfaced: Surfaced, packer: Packer) -> tuple[Data, Data]:
    """Return the passes as drawn on the part, and what they can be coloured by."""
    job, points = surfaced.job, surfaced.points
    across = surfaced.laid.bending[:, 1, 1]
    ridge = MICRONS * ridge_height(across, job.passes.pitch, job.cell.wheel.radius)
    paints = {
        "ridge": painted(ridge, "micrometres of ridge", packer),
        "pass": painted(points.pass_index.astype(np.float64) + 1.0, "pass", packer),
    }
    missed = surfaced.inspection.uncovered.points
    return drawn_passes(points, job.passes.pitch, missed, packer), paints


def drawn_run(
    prepared: Prepared, survey: NodeSurvey, moved: tuple[TimedMotion, Timing] | None
) -> Drawn:
    """Return what the viewer draws of a run as far as it came.

    Args:
        prepared: What the search was given.
        survey: Every node of the IK branch that is shown of each pass.
        moved: The motion as it is passed, and what is written of it; None without one.
    """
    packer, surfaced = Packer(), prepared.surfaced
    job = surfaced.job
    data = {"name": job.name, **cell_data(job.cell, job.process.home, packer)}
    data["points"], data["paints"] = passes_data(surfaced, packer)
    data["field"] = _field(prepared, survey, packer)
    if moved is not None:
        timed, timing = moved
        scene = prepared.problem.scene
        times, nearest = _nearest_along(timed, scene.collision)
        data["motion"] = _motion(timed, packer)
        data["clearance"] = {
            "time": packer.floats(times),
            "distance": packer.floats(nearest.distance),
            "pair": packer.counts(nearest.pair),
            "points": packer.floats(nearest.points),
            "pairs": [list(pair) for pair in nearest.pairs],
        }
        robot, feed = scene.cell.robot, job.process.feed
        data["curves"] = {
            "joints": curves.joint_panels(timed, robot, prepared.fixed.q, packer),
            "speeds": curves.speed_panels(timing, robot, packer),
            "accelerations": curves.acceleration_panels(timing, robot, packer),
            "feed": curves.feed_panels(timing, timed, feed, robot, packer),
            "clearance": curves.clearance_panels(times, nearest, packer),
        }
        paints = _paints(len(surfaced.points), moved, times, nearest, packer)
        data["paints"] = {**paints, **data["paints"]}
    image = chart_image(
        survey.states,
        survey.singularity < NEAR_SINGULAR,
        measured_clearance(survey.measured, survey.clearance),
        (survey.columns, survey.positions),
    )
    return Drawn(data, packer, image)


def blocked_place(reason: str, survey: NodeSurvey, distance: Array) -> tuple[int, int] | None:
    """Return the cutter point that a reason begins with, and a contact position of it.

    It is the middle one of a run of cutter points, at the contact position that comes nearest to
    being free; None if the reason begins with no cutter point.

    Args:
        reason: Why there is no path.
        survey: The nodes.
        distance: Of part and wheel at each node in [m], shape (N, M).
    """
    found = re.match(r"cutter points? (\d+)(?: to (\d+))?", reason)
    if found is None:
        return None
    point = (int(found[1]) + int(found[2] or found[1])) // 2
    ranks = [NEARLY_FREE.index(state) for state in NodeState]
    rank = np.array(ranks)[survey.states[point]]
    rows = np.flatnonzero(rank == rank.min())
    return point, int(rows[distance[point, rows].argmax()])


def colliding(survey: NodeSurvey, node: tuple[int, int]) -> list[str]:
    """Return the names of the two bodies that collide at a node; none where none do."""
    if survey.states[node] == CODES[NodeState.WHEEL]:
        return [PART, WHEEL]
    return list(survey.pairs[survey.hit[node]]) if survey.hit[node] >= 0 else []


def extremes(report: Report) -> list[tuple[str, str, PlaceReport]]:
    """Return marks, words and places of what the replay found least or largest."""
    found = report.verification
    if found is None:
        return []
    belt = f"deepest in the belt, {found.max_belt_penetration_mm:.3f} mm"
    belt += f" of {found.allowed_belt_penetration_mm:g} mm allowed"
    places = [
        ("nearest", f"least clearance, {found.min_clearance_mm:.3f} mm", found.min_clearance_at),
        ("off", f"contact error, {found.max_contact_error_mm:.4f} mm", found.max_contact_error_at),
        ("deepest", belt, found.max_belt_penetration_at),
    ]
    return [
        (mark, f"{said}: {place.subject}, {place.place}", place)
        for mark, said, place in places
        if place is not None
    ]


def slow_marks(report: Report) -> list[tuple[str, float]]:
    """Return the marks of the slow stretches and the cutter points they lead to."""
    lowered = () if report.feed is None else report.feed.lowered
    return [(f"slow-{k}", one.lowest_at) for k, one in enumerate(lowered)]


def moves_at(motion: Motion, wheres: Sequence[str]) -> list[int | None]:
    """Return the first move at each of some places as findings name them; None where none is."""
    places: dict[str, int] = {}
    for move in range(len(motion)):
        places.setdefault(motion.place(move), move)
    return [places.get(where) for where in wheres]


def move_to(motion: Motion, cutter_point: float) -> int:
    """Return the move on the wheel that ends nearest to a cutter point, fractional or not."""
    return int(np.nanargmin(np.abs(motion.cutter_point - cutter_point)))


def _field(prepared: Prepared, survey: NodeSurvey, packer: Packer) -> Data:
    return chart_cells(
        prepared.problem.field.contact_positions,
        survey.states,
        [state.value for state in NodeState],
        survey.q,
        (survey.hit, survey.pairs),
        survey.singularity,
        (survey.columns, survey.positions, survey.measured),
        survey.clearance,
        packer,
    )


def _motion(timed: TimedMotion, packer: Packer) -> Data:
    motion = timed.motion
    return {
        "q": packer.floats(motion.q),
        "time": packer.floats(curves.moments(timed)),
        "t": packer.floats(motion.contact_position),
        "point": packer.floats(motion.cutter_point),
        "pass": packer.counts(motion.pass_index),
        "kind": packer.counts([KINDS.index(kind) for kind in motion.kind]),
        "kinds": [kind.value for kind in KINDS],
    }


def _nearest_along(timed: TimedMotion, scene: CollisionScene) -> tuple[Array, Nearest]:
    """Return moments in [s] and the nearest pair at each, for the whole motion."""
    moments = curves.moments(timed)
    ground = timed.motion.on_wheel & (timed.motion.cutter_point % 1.0 == 0.0)
    times = np.union1d(np.linspace(0.0, moments[-1], MOST_LOOKS), moments[ground])
    rows = np.arange(len(moments), dtype=float)
    at = np.interp(times, moments, rows)
    q = np.stack([np.interp(at, rows, joint) for joint in timed.motion.q.T], axis=1)
    return times, nearest_pairs(scene, q)


def _paints(
    n_points: int,
    moved: tuple[TimedMotion, Timing],
    times: Array,
    nearest: Nearest,
    packer: Packer,
) -> Mapping[str, Data]:
    """Return what the passes of a planned motion can be coloured by."""
    timed, timing = moved
    motion, moments = timed.motion, curves.moments(timed)
    rows = np.flatnonzero(motion.on_wheel & (motion.cutter_point % 1.0 == 0.0))
    point = motion.cutter_point[rows].astype(int)
    passed_by = np.searchsorted(motion.positions, rows)  # the written move that leads there
    speed = MM * curves.surface_speed(timing)[passed_by]
    near = MM * np.interp(moments[rows], times, nearest.distance)

    def at_points(values: Array, unit: str) -> Data:
        every = np.full(n_points, np.nan)
        every[point] = values
        return painted(every, unit, packer)

    return {
        "t": at_points(motion.contact_position[rows], "mm or deg of t"),
        "clearance": at_points(near, "mm of clearance"),
        "feed": at_points(speed, "mm/s"),
    }
