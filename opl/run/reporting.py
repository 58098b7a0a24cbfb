"""From a finished run to its report: SI in, the units and digits of ``result.json`` out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from opl.cell.inverse_kinematics import ik_branch_name
from opl.cell.robot import Robot
from opl.files.digests import digest
from opl.job.methods import Objective
from opl.motion.feed import SlowStretch
from opl.planning.fixed_contact import runs_of
from opl.program.moves import CycleTime
from opl.proof.corners import CornerProof
from opl.proof.read_back import FileProof
from opl.run import result
from opl.run.proof_result import (
    CornersReport,
    FileReport,
    PlaceReport,
    VerificationReport,
)
from opl.run.result import Report
from opl.run.values import Planned, Prepared, Proven, Refused, Written
from opl.verification.extremes import Extreme
from opl.verification.replay import Verification
from opl.version import VERSION

if TYPE_CHECKING:
    from opl.planning.plan import Holder


MM = 1e3


def make_report(run: Written | Refused) -> Report:
    """Return what is reported of a finished run."""
    surfaced, robot = run.surfaced, run.surfaced.job.cell.robot
    written = run if isinstance(run, Written) else None
    refused = run if isinstance(run, Refused) else None
    reached = run.proven if isinstance(run, Written) else run.reached
    outcome = run.read_back if isinstance(run, Written) else run.cause
    planned: Planned | None
    found: Verification | None
    if isinstance(reached, Proven):
        planned, found = reached.planned, reached.verification
    else:
        planned = reached if isinstance(reached, Planned) else None
        found = outcome if isinstance(outcome, Verification) else None
    proof = outcome if isinstance(outcome, FileProof) else None
    seconds = {stage.value: round(time, 4) for stage, time in run.seconds.items()}
    return Report(
        status=run.status,
        job=surfaced.job.name,
        robot=result.RobotReport(robot.name, robot.unverified_pulses),
        cutter_points=len(surfaced.points),
        passes=surfaced.points.n_passes,
        warnings=[str(finding) for finding in surfaced.warnings],
        reasons=() if refused is None else refused.reasons,
        remedies=() if refused is None else refused.remedies,
        tried_in_vain=() if refused is None else refused.in_vain,
        fixed=_fixed(reached if isinstance(reached, Prepared) else reached.prepared),
        path=None if planned is None else _path(planned),
        compared={} if planned is None else _compared(planned),
        feed=None if planned is None else _feed(planned),
        cycle=None if written is None else _cycle(written.program.cycle, robot),
        verification=None if found is None else replay_report(found, proof),
        program=None if written is None else _program(written),
        seconds={**seconds, "total": round(sum(run.seconds.values()), 4)},
        opl=VERSION,
        inputs=surfaced.job.inputs,
    )


def _fixed(prepared: Prepared) -> result.FixedReport:
    fixed, points = prepared.fixed, prepared.surfaced.points
    if fixed.q is None:
        return result.FixedReport(None, None, None, fixed.feasible, fixed.reason)
    ranges = np.ptp(fixed.q, axis=0)
    passes = [fixed.q[points.pass_index == k] for k in range(points.n_passes)]
    by_pass = [_rounded(np.ptp(q, axis=0)) for q in passes]
    return result.FixedReport(
        _rounded(ranges), _rounded(ranges.sum()), by_pass, fixed.feasible, fixed.reason
    )


def _compared(planned: Planned) -> dict[str, result.FiguresReport]:
    weights = planned.surfaced.job.search.requested_weights
    return {
        name: result.FiguresReport(
            _rounded(figures.joint_ranges),
            _rounded(figures.joint_range_sum),
            _rounded(figures.joint_travel),
            _rounded(figures.contact_travel),
            _rounded(figures.seconds),
            weighted_sum=None if weights is None else _rounded(weights.value(figures)),
        )
        for name, figures in planned.compared.items()
    }


def _path(planned: Planned) -> result.PathReport:
    plan, search = planned.plan, planned.surfaced.job.search
    robot = planned.surfaced.job.cell.robot
    path, known = plan.path, plan.objective
    objective = None
    if known is not None:
        objective = result.ObjectiveReport(
            *map(_rounded, (known.value, known.lower_bound, known.gap))
        )
    return result.PathReport(
        method=search.method.value,
        objective=search.objective.value,
        branch=_branch(path.ik_branches),
        joint_ranges_rad=_rounded(path.joint_ranges),
        joint_range_sum_rad=_rounded(path.joint_range_sum),
        joint_travel_rad=_rounded(path.joint_travel),
        contact_travel=_rounded(path.contact_travel),
        nodes=len(path.q) - path.n_intermediate,
        intermediate_nodes=path.n_intermediate,
        lower_bound_rad=_rounded(plan.lower_bound),
        held_by=[_holder(one, path.joint_range_sum, robot) for one in plan.holders],
        gap=_rounded(plan.gap),
        open_because=plan.open_because,
        weighted=objective if search.objective is Objective.WEIGHTED else None,
        objective_value=objective,
    )


def _branch(ik_branches: np.ndarray) -> str:
    """Return the IK branch of all passes in words; where they differ, of each pass."""
    slots = dict.fromkeys(ik_branches.tolist())
    if len(slots) == 1:
        return ik_branch_name(*slots)
    return "; ".join(
        f"{ik_branch_name(slot)} on pass {runs_of(np.flatnonzero(ik_branches == slot) + 1)}"
        for slot in slots
    )


def _holder(one: Holder, value: float, robot: Robot) -> result.HolderReport:
    return result.HolderReport(
        cutter_point=round(one.place, 3),
        pass_=one.pass_index + 1,
        joints=[robot.joint_names[joint] for joint in one.joints],
        bound_without_rad=_rounded(one.bound_without),
        most_gain_rad=_rounded(max(value - one.bound_without, 0.0)),
    )


def _feed(planned: Planned) -> result.FeedReport:
    process, robot = planned.surfaced.job.process, planned.surfaced.job.cell.robot
    dwell = max(planned.slow, key=lambda one: one.dwell, default=None)
    return result.FeedReport(
        set_mm_s=_rounded(process.feed * MM),
        lowered=[_slow(one, robot) for one in planned.slow],
        longest_dwell_s=0.0 if dwell is None else round(dwell.dwell, 3),
        longest_dwell_at=None if dwell is None or not dwell.dwell else round(dwell.dwell_at, 3),
        max_dwell_s=process.max_dwell,
        largest_speed_ratio=round(planned.timing.speed_ratio, 3),
    )


def _slow(one: SlowStretch, robot: Robot) -> result.SlowReport:
    limits = [
        result.SlowLimitReport(
            share.cause.value,
            None if share.joint is None else robot.joint_names[share.joint],
            round(share.longer, 3),
        )
        for share in one.shares
    ]
    return result.SlowReport(
        pass_=one.pass_index + 1,
        from_cutter_point=round(one.start, 3),
        to_cutter_point=round(one.end, 3),
        lowest_mm_s=round(one.slowest * MM, 3),
        lowest_at=round(one.slowest_at, 3),
        longer_s=round(one.longer, 3),
        limits=limits,
        dwell_s=round(one.dwell, 3),
    )


def _cycle(cycle: CycleTime | None, robot: Robot) -> result.CycleReport | None:
    if cycle is None:
        return None
    return result.CycleReport(
        passes_s=round(cycle.passes, 3),
        approach_and_retract_s=round(cycle.leads, 3),
        air_s=round(cycle.air, 3),
        waits_s=round(cycle.waits, 3),
        total_s=round(cycle.total, 3),
        ramps_s=round(cycle.ramps, 3),
        open_ended=cycle.open_ended,
        accelerations_assumed=robot.acceleration_assumed,
        parts=[
            result.PartReport(
                one.part.value,
                one.pass_index + 1 if one.pass_index >= 0 else None,
                round(one.seconds, 3),
            )
            for one in cycle.parts
        ],
    )


def corners_report(found: CornerProof | None) -> CornersReport | None:
    """Return what is reported of the corners of a program, None if they were not looked at."""
    if found is None:
        return None
    return CornersReport(
        found.rounded,
        found.unknown,
        round(found.max_contact_error * MM, 4),
        found.place,
        round(found.allowed * MM, 4),
        round(found.at_ends * MM, 4),
    )


def replay_report(found: Verification, proof: FileProof | None) -> VerificationReport:
    """Return what is reported of a replay, and of the files of its motion if they were read."""
    return VerificationReport(
        found.engine,
        found.poses,
        found.collisions,
        round(found.min_clearance * MM, 3),
        round(found.max_contact_error * MM, 4),
        found.limit_violations,
        None
        if proof is None
        else FileReport(
            proof.proven,
            proof.files,
            proof.configurations,
            round(proof.largest_rounding * MM, 4),
            round(proof.largest_difference * MM, 4),
            proof.replayed,
            corners_report(proof.corners),
        ),
        0.0 if found.deepest is None else round(found.deepest.amount * MM, 3),
        round(found.allowed_penetration * MM, 3),
        *map(_place, (found.nearest, found.worst_contact, found.deepest)),
    )


def _place(one: Extreme | None) -> PlaceReport | None:
    if one is None:
        return None
    return PlaceReport(one.subject, one.place, np.rad2deg(one.q).round(3).tolist())


def _program(written: Written) -> result.ProgramReport:
    return result.ProgramReport(
        files=list(written.contents),
        sha256={name: digest(content) for name, content in written.contents.items()},
        read_back=written.read_back is not None,
        moves=len(written.program.moves),
        duration_s=round(written.proven.motion.timed.seconds, 3),
        passes=[
            result.PassTimeReport(
                round(time.wanted, 3),
                round(time.written, 3),
                round(100.0 * time.error, 4),
                round(100.0 * time.single, 4),
            )
            for time in written.program.pass_times
        ],
    )


def _rounded(value: Any) -> Any:
    return None if value is None else np.round(value, 6).tolist()
