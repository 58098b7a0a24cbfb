"""``result.json``: what became of a job, for other programs. Its keys are stable."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from opl.cell.inverse_kinematics import ik_branch_name
from opl.motion.feed import SlowStretch
from opl.motion.figures import Figures
from opl.outcome import Outcome
from opl.planning.objective import ObjectiveWeights, WeightedValue
from opl.planning.plan import Plan, Refinement
from opl.proof.digest import digest
from opl.proof.read_back import FileProof

MM = 1e3


def result(outcome: Outcome) -> dict[str, Any]:
    """Return the result of a run; null stands for what was not computed."""
    points, robot = outcome.points, outcome.job.cell.robot
    return {
        "status": outcome.status,
        "job": outcome.job.name,
        "robot": {"name": robot.name, "unverified_pulse_ratios": list(robot.unverified_pulses)},
        "cutter_points": None if points is None else len(points),
        "passes": None if points is None else points.n_passes,
        "warnings": [str(finding) for finding in outcome.warnings],
        "reasons": reasons(outcome),
        "remedies": outcome.remedies,
        "fixed": _fixed(outcome),
        "path": _path(outcome, outcome.plan),
        "compared": {
            name: _figures(figures, outcome.job.search.weights_asked)
            for name, figures in outcome.compared.items()
        },
        "feed": _feed(outcome),
        "cycle": _cycle(outcome),
        "verification": _verification(outcome),
        "program": _program(outcome),
        "seconds": {stage: round(spent, 4) for stage, spent in _seconds(outcome).items()},
    }


def render(outcome: Outcome) -> str:
    """Return the text of ``result.json``."""
    return json.dumps(result(outcome), indent=2) + "\n"


def reasons(outcome: Outcome) -> list[str]:
    """Return why there is no program, one line each; empty if there is one."""
    if outcome.refusal is not None:
        return [outcome.refusal.message, *outcome.refusal.reasons]
    if outcome.verification is not None:
        read_back = () if outcome.file is None else outcome.file.findings
        return [str(finding) for finding in (*outcome.verification.findings, *read_back)]
    return []


def search_seconds(outcome: Outcome) -> float:
    """Return the time of the search with its collision checks, clearance layer included, in [s]."""
    return outcome.seconds.get("clearance", 0.0) + outcome.seconds.get("search", 0.0)


def _seconds(outcome: Outcome) -> dict[str, float]:
    return {**outcome.seconds, "total": sum(outcome.seconds.values())}


def _fixed(outcome: Outcome) -> dict[str, Any] | None:
    fixed = outcome.fixed
    if fixed is None:
        return None
    ranges = fixed.joint_ranges
    return {
        "joint_ranges_rad": None if ranges is None else _rounded(ranges),
        "joint_range_sum_rad": None if ranges is None else _rounded(ranges.sum()),
        "joint_ranges_by_pass_rad": _by_pass(outcome),
        "feasible": fixed.feasible,
        "reason": fixed.reason,
    }


def _by_pass(outcome: Outcome) -> list[list[float]] | None:
    """Return the joint ranges of each pass by itself; the paper's figures are of one pass."""
    fixed, points = outcome.fixed, outcome.points
    if fixed is None or fixed.q is None or points is None:
        return None
    passes = [fixed.q[points.pass_index == k] for k in range(points.n_passes)]
    return [_rounded(np.ptp(q, axis=0)) for q in passes]


def _figures(figures: Figures, weights: ObjectiveWeights | None) -> dict[str, Any]:
    return {
        "joint_ranges_rad": _rounded(figures.joint_ranges),
        "joint_range_sum_rad": _rounded(figures.joint_range_sum),
        "joint_travel_rad": _rounded(figures.joint_travel),
        "contact_travel": _rounded(figures.contact_travel),
        "seconds_on_wheel": _rounded(figures.seconds),
        "weighted_sum": None if weights is None else _rounded(weights.value(figures)),
    }


def _path(outcome: Outcome, plan: Plan | None) -> dict[str, Any] | None:
    if plan is None:
        return None
    path, bound = plan.path, plan.lower_bound
    return {
        "method": outcome.job.search.method.value,
        "objective": outcome.job.search.objective.value,
        "branch": ik_branch_name(path.branch),
        "joint_ranges_rad": _rounded(path.joint_ranges),
        "joint_range_sum_rad": _rounded(path.joint_range_sum),
        "joint_travel_rad": _rounded(path.joint_travel),
        "contact_travel": _rounded(path.contact_travel),
        "nodes": len(path.q) - path.n_intermediate,
        "intermediate_nodes": path.n_intermediate,
        "lower_bound_rad": None if bound is None else _rounded(bound),
        "gap": None if plan.gap is None else _rounded(plan.gap),
        "refinement": _refinement(plan.refinement),
        "weighted": _weighted(plan.weighted),
    }


def _weighted(weighted: WeightedValue | None) -> dict[str, Any] | None:
    if weighted is None:
        return None
    return {
        "value": _rounded(weighted.value),
        "lower_bound": _rounded(weighted.lower_bound),
        "gap": _rounded(weighted.gap),
    }


def _refinement(refinement: Refinement | None) -> dict[str, Any] | None:
    """Return what there was at the contact positions of the job, and what was gained on it."""
    if refinement is None:
        return None
    bound = refinement.lower_bound
    return {
        "field_joint_range_sum_rad": _rounded(refinement.joint_range_sum),
        "field_lower_bound_rad": None if bound is None else _rounded(bound),
        "gain_rad": _rounded(refinement.gain),
        "rounds": refinement.rounds,
        "bound_contact_positions": refinement.bound_positions,
    }


def _feed(outcome: Outcome) -> dict[str, Any] | None:
    slow, pace = outcome.slow, outcome.job.pace
    if slow is None:
        return None
    dwell = max(slow, key=lambda one: one.dwell, default=None)
    return {
        "set_mm_s": _rounded(pace.feed * MM),
        "lowered": [_slow_stretch(one, outcome.job.cell.robot.joint_names) for one in slow],
        "longest_dwell_s": 0.0 if dwell is None else round(dwell.dwell, 3),
        "longest_dwell_at": None if dwell is None or not dwell.dwell else round(dwell.dwell_at, 3),
        "max_dwell_s": pace.max_dwell,
    }


def _slow_stretch(one: SlowStretch, joint_names: Sequence[str]) -> dict[str, Any]:
    return {
        "pass": one.pass_index + 1,
        "from_cutter_point": round(one.start, 3),
        "to_cutter_point": round(one.end, 3),
        "lowest_mm_s": round(one.slowest * MM, 3),
        "lowest_at": round(one.slowest_at, 3),
        "longer_s": round(one.longer, 3),
        "limits": [
            {
                "kind": share.cause.value,
                "joint": None if share.joint is None else joint_names[share.joint],
                "longer_s": round(share.longer, 3),
            }
            for share in one.shares
        ],
        "dwell_s": round(one.dwell, 3),
    }


def _cycle(outcome: Outcome) -> dict[str, Any] | None:
    cycle = None if outcome.program is None else outcome.program.cycle
    if cycle is None:
        return None
    return {
        "passes_s": round(cycle.passes, 3),
        "approach_and_retract_s": round(cycle.leads, 3),
        "air_s": round(cycle.air, 3),
        "waits_s": round(cycle.waits, 3),
        "total_s": round(cycle.total, 3),
        "ramps_s": round(cycle.ramps, 3),
        "open_ended": cycle.open_ended,
        "accelerations_assumed": outcome.job.cell.robot.acceleration_assumed,
    }


def _verification(outcome: Outcome) -> dict[str, Any] | None:
    found = outcome.verification
    if found is None:
        return None
    return {
        "engine": found.engine,
        "poses": found.poses,
        "collisions": found.collisions,
        "min_clearance_mm": round(found.min_clearance * MM, 3),
        "max_contact_error_mm": round(found.max_contact_error * MM, 4),
        "limit_violations": found.limit_violations,
        "file": _file(outcome.file),
    }


def _file(proof: FileProof | None) -> dict[str, Any] | None:
    if proof is None:
        return None
    return {
        "proven": proof.proven,
        "files": list(proof.files),
        "postures": proof.postures,
        "largest_rounding_mm": round(proof.largest_rounding * MM, 4),
        "largest_difference_mm": round(proof.largest_difference * MM, 4),
        "replayed": proof.replayed,
    }


def _program(outcome: Outcome) -> dict[str, Any] | None:
    if outcome.program is None or outcome.verification is None:
        return None
    verified = outcome.verification.verified
    assert verified is not None
    return {
        "files": list(outcome.files),
        "sha256": {name: digest(text.encode()) for name, text in outcome.files.items()},
        # false where the controller's language has no reader: written, nothing more is claimed
        "read_back": outcome.file is not None,
        "moves": len(outcome.program.moves),
        "duration_s": round(float(verified.motion.duration.sum()), 3),
        "passes": [
            {"wanted_s": round(time.wanted, 3), "written_s": round(time.written, 3)}
            for time in outcome.program.pass_times
        ],
    }


def _rounded(value: Any) -> Any:
    return np.round(value, 6).tolist()
