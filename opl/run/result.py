"""``result.json`` as a value: what is reported of a run, in plain numbers.

The fields are the keys of the file, which are stable, in its units and with its digits. A trailing
underscore is no part of a key: ``pass_`` is ``pass``. None stands for what was not computed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from opl.run.proof_result import VerificationReport

RESULT, PAGE = "result.json", "report.html"  # files of a run


@dataclass(frozen=True)
class RobotReport:
    """The robot of a job."""

    name: str
    unverified_pulse_ratios: Sequence[str]


@dataclass(frozen=True)
class FixedReport:
    """The path with the contact kept at t = 0."""

    joint_ranges_rad: Sequence[float] | None
    joint_range_sum_rad: float | None
    joint_ranges_by_pass_rad: Sequence[Sequence[float]] | None  # the paper's are of one pass
    feasible: bool
    reason: str  # why it is not


@dataclass(frozen=True)
class ObjectiveReport:
    """Travel in rad, time in s or weighted sum of the path, and its lower bound.

    The gap is 0 where the value is below 1e-4, which is not looked into further.
    """

    value: float
    lower_bound: float
    gap: float


@dataclass(frozen=True)
class HolderReport:
    """A cutter point, fractional between two, that keeps the joint range sum from being smaller."""

    cutter_point: float
    pass_: int
    joints: Sequence[str]  # whose range it holds, the dearest first
    bound_without_rad: float  # no path has a smaller sum, even if this need not be ground
    most_gain_rad: float  # what changing nothing else could gain at the most


@dataclass(frozen=True)
class FiguresReport:
    """The figures by which paths are compared; a weighted sum only if that is the objective."""

    joint_ranges_rad: Sequence[float]
    joint_range_sum_rad: float
    joint_travel_rad: float
    contact_travel: float
    seconds_on_wheel: float
    weighted_sum: float | None


@dataclass(frozen=True)
class PathReport:
    """The path that was found."""

    method: str
    objective: str
    branch: str  # of the inverse kinematics, in words; with its passes where these differ in it
    joint_ranges_rad: Sequence[float]
    joint_range_sum_rad: float
    joint_travel_rad: float
    contact_travel: float
    nodes: int
    intermediate_nodes: int
    lower_bound_rad: float | None  # no motion kept as clear has a smaller sum
    held_by: Sequence[HolderReport]
    gap: float | None  # fraction by which the sum may be above the least there is; 0 at rest (1e-6)
    open_because: str | None  # why the gap is wider than wanted
    weighted: ObjectiveReport | None
    objective_value: ObjectiveReport | None  # of travel, time or weighted sum


@dataclass(frozen=True)
class SlowLimitReport:
    """What makes the ground point slow, the joint if one is to blame, and what it costs."""

    kind: str
    joint: str | None
    longer_s: float


@dataclass(frozen=True)
class SlowReport:
    """A part of a pass that is slower than the feed; passes count from 1."""

    pass_: int
    from_cutter_point: float
    to_cutter_point: float
    lowest_mm_s: float
    lowest_at: float
    longer_s: float
    limits: Sequence[SlowLimitReport]  # the dearest first
    dwell_s: float  # longest time beyond that at the feed on one spot


@dataclass(frozen=True)
class FeedReport:
    """The feed, and where the ground point is slower."""

    set_mm_s: float
    lowered: Sequence[SlowReport]
    longest_dwell_s: float
    longest_dwell_at: float | None
    max_dwell_s: float
    # of neighbouring moves of a pass and its leads, along the surface; a speed below a fifth of the
    # feed counts as that, and not at all where pivoting alone makes it so slow
    largest_speed_ratio: float


@dataclass(frozen=True)
class PartReport:
    """How long a part of the program runs, ramps included, waits not; passes count from 1."""

    part: str  # from_home, approach, pass, retract, link, to_home
    pass_: int | None  # the pass it grinds, or leads to or from; None for to_home
    seconds: float


@dataclass(frozen=True)
class CycleReport:
    """How long the program runs, ramps included."""

    passes_s: float
    approach_and_retract_s: float
    air_s: float
    waits_s: float
    total_s: float
    ramps_s: float  # of all this, coming up to speed and to rest
    open_ended: bool  # it also waits for inputs or runs other programs
    accelerations_assumed: bool
    parts: Sequence[PartReport]  # in the order of the program


@dataclass(frozen=True)
class PassTimeReport:
    """How long a pass should take, takes, and by how much that and a single move of it is off."""

    wanted_s: float
    written_s: float
    error_percent: float
    largest_move_error_percent: float


@dataclass(frozen=True)
class ProgramReport:
    """The program, and the SHA-256 of every file of the run."""

    files: Sequence[str]
    sha256: Mapping[str, str]
    read_back: bool  # false where the language has no reader: nothing is claimed of the file itself
    moves: int
    duration_s: float
    passes: Sequence[PassTimeReport]


@dataclass(frozen=True)
class Report:
    """What is reported of a run: the content of its ``result.json``.

    Attributes:
        status: ``ok``, ``no_path`` or ``unsafe``.
        reasons: Why there is no program, one line each.
        remedies: Single changes that would open the job, one line each.
        tried_in_vain: Kinds of changes that were tried and do not, one line each.
        compared: The figures of the paths that exist: ``fixed``, ``paper_start``, ``recursive``,
            ``optimal``.
        seconds: Time of each stage, and their ``total``.
        opl: Version of opl.
        inputs: SHA-256 of everything the job is made of, by name: job and cell file by what they
            say, all other files by their bytes.
    """

    status: str
    job: str
    robot: RobotReport
    cutter_points: int
    passes: int
    warnings: Sequence[str]
    reasons: Sequence[str]
    remedies: Sequence[str]
    tried_in_vain: Sequence[str]
    fixed: FixedReport
    path: PathReport | None
    compared: Mapping[str, FiguresReport]
    feed: FeedReport | None
    cycle: CycleReport | None
    verification: VerificationReport | None
    program: ProgramReport | None
    seconds: Mapping[str, float]
    opl: str
    inputs: Mapping[str, str]


def read_report(content: bytes) -> Report:
    """Return what a ``result.json`` of this version of opl says.

    Raises:
        ValueError: If it is none.
    """
    try:
        found: Report = _made(Report, json.loads(content))
        return found
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"is no {RESULT} of this version: {error}") from error


_types = cache(get_type_hints)


def _made(kind: Any, value: Any) -> Any:
    """Return plain values as what a type says: reports, alone, in sequences and in mappings."""
    if isinstance(kind, type) and is_dataclass(kind):
        types = _types(kind)
        named = ((one.name, value[one.name.rstrip("_")]) for one in fields(kind))
        return kind(**{name: _made(types[name], inner) for name, inner in named})
    arguments = get_args(kind)
    if value is None or not arguments:
        return value
    if get_origin(kind) in (Union, UnionType):
        (meant,) = (one for one in arguments if one is not type(None))
        return _made(meant, value)
    if isinstance(value, dict):
        return {key: _made(arguments[1], inner) for key, inner in value.items()}
    return [_made(arguments[0], inner) for inner in value]


def to_json(value: Any) -> str:
    """Return reports and rows of a batch, alone or in lists and mappings, as JSON text."""
    return json.dumps(value, indent=2, default=_plain)


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {field.name.rstrip("_"): getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no place in JSON")
