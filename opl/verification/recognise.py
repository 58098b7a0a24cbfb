"""What a robot grinds, recognised from its configurations alone, without knowing its passes.

Moves are sampled near the wheel, since most cutter points are passed and not stopped at.
Configurations and cutter points are aligned like two texts: both keep their order, a configuration
may lie between two cutter points or off the wheel, and a cutter point that no configuration brings
to the wheel is left out, which costs much. Between two cutter points the frame changes evenly;
configurations there get places that never go back and lie nearest to the contact model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.cell.workcell import WorkCell
from opl.findings import Finding, Level
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion, MoveKind, TimedMotion
from opl.verification.align import Course, align
from opl.verification.contact_segments import ContactSegment, ContactSegments
from opl.verification.passing import Samples
from opl.verification.seen import Seen, see

# [m] that a configuration which is written at a cutter point may be off the contact model there:
# what the digits of a position leave. Of several that grind a point the nearest is taken by this
AT_POINT = 5e-5
# belt units that t changes by at the most between two samples: the part moves 1 mm and turns 0.5
# degrees
SAMPLE_STEP = 1.5
ALIGNED = np.deg2rad(0.1)  # that it may be turned there
ASIDE = 2e-4  # [m] that a configuration of an approach may be beside its way
FARTHER = 1e-3  # [m] than the approach is long that still is approach


@dataclass(frozen=True)
class Rule:
    """What a motion over the wheel has to keep to be recognised as one.

    Attributes:
        max_contact_error: Farthest that a ground point may be from where the contact model has it,
            in [m].
        max_contact_step: Largest change of t between neighbouring configurations on the wheel.
        approach_length: Of approach and retract in [m].
        approach_turn: What they turn by in [rad]: 0 if they run along the contact normal, else they
            are arcs that begin and end along the belt, y of the contact frame.
        approach_run: How far the part moves on along the pass at the most while it lifts off, on a
            quarter of a circle, in [m].
        feed: Speed of the ground point along the surface in [m/s], where it is not slower.
    """

    max_contact_error: float
    max_contact_step: float
    approach_length: float
    approach_turn: float
    approach_run: float
    feed: float


@dataclass(frozen=True, eq=False)
class Recognition:
    """A motion with its meaning.

    Attributes:
        timed: The configurations, labelled, and those at which a move passes a cutter point, which
            are not written; one that grinds several cutter points at once is repeated, the move to
            itself taking no time.
        source: Index of each of them in the configurations that were given, of those passed that of
            the end of the move, shape (n,).
        findings: Configurations between two cutter points that are off the contact model.
    """

    timed: TimedMotion
    source: NDArray[np.intp]
    findings: tuple[Finding, ...]


def recognise(
    cell: WorkCell,
    points: CutterPoints,
    q: Array,
    duration: Array,
    stations: NDArray[np.intp],
    rule: Rule,
    seen: Seen | None = None,
) -> Recognition:
    """Find out which cutter points a motion grinds, where on the wheel, and what the rest is.

    Args:
        cell: The cell.
        points: The cutter points that may be ground.
        q: Joint positions in [rad], joined by linear joint interpolation, shape (n, 6).
        duration: Time of the move that ends at each configuration in [s], shape (n,).
        stations: Indices of the configurations that are written, in order.
        rule: What a motion over the wheel has to keep.
        seen: What is seen of configurations; taken if they are these to the last bit.
    """
    if seen is None or not np.array_equal(seen.q, q):
        seen = see(cell, points, q, rule.max_contact_error)
    samples, touches = seen.samples, seen.touches
    duration = samples.share * duration[samples.source]
    step = max(rule.max_contact_step, SAMPLE_STEP)
    written = np.isin(touches.configuration, samples.given[stations])
    time = np.cumsum(duration)[touches.configuration]
    ground = align(touches, Course.of(points, rule.feed), AT_POINT, step, written, time)
    Ts = samples.Ts_contact0_workpiece
    segments = ContactSegments(cell.wheel, points, Ts, duration, touches)
    ground = segments.settled(ground, rule.max_contact_error)
    labels = _Labels(segments, rule, samples.given)
    labels.grind(ground)
    return labels.recognition(samples, stations)


class _Labels:
    """What each configuration is, being found out."""

    def __init__(self, segments: ContactSegments, rule: Rule, given: NDArray[np.intp]) -> None:
        n = len(segments.duration)
        # a lead ends where a move ends, not at a sample that lies on its way as well
        self._given = np.isin(np.arange(n), given)
        self._segments = segments
        self._rule = rule
        self._kind = [MoveKind.HOME] * n
        self._t = np.full(n, np.nan)
        self._place = np.full(n, np.nan)
        self._pass = np.full(n, -1)
        # more cutter points at a configuration: its index, the point and t
        self._also: list[tuple[int, int, float]] = []
        self._astray: list[tuple[int, float]] = []

    def grind(self, ground: NDArray[np.intp]) -> None:
        """Label everything, given which touches are the ground cutter points."""
        touches = self._segments.touches
        configuration, point = touches.configuration[ground], touches.point[ground]
        t = touches.contact_position[ground]
        pass_index = self._segments.points.pass_index[point]
        for k, i, position, index in zip(configuration, point, t, pass_index, strict=True):
            if self._kind[k] is MoveKind.GRIND:
                self._also.append((int(k), int(i), float(position)))
                continue
            self._mark(k, MoveKind.GRIND, index, position, i)
        for m in np.flatnonzero(np.diff(pass_index) == 0):
            segment = self._segments.between(int(ground[m]), int(ground[m + 1]))
            self._fill_in(segment, int(pass_index[m]))
        self._label_free_moves(*self._label_leads(configuration, point, t, pass_index))

    def recognition(self, samples: Samples, stations: NDArray[np.intp]) -> Recognition:
        """Return the labelled motion: the given configurations, and where points are passed."""
        also = np.array(self._also).reshape(-1, 3)
        at = also[:, 0].astype(np.intp)
        row = np.insert(np.arange(len(samples.q)), at + 1, at)
        is_ground = np.array([kind is MoveKind.GRIND for kind in self._kind])
        written = np.zeros(len(samples.q), dtype=bool)
        written[samples.given[stations]] = True
        motion = Motion(
            q=samples.q[row],
            kind=tuple(self._kind[k] for k in row),
            contact_position=np.insert(self._t, at + 1, also[:, 2]),
            cutter_point=np.insert(self._place, at + 1, also[:, 1]),
            pass_index=self._pass[row],
            written=written[row]
            & np.where(
                self._pass_ends()[row], np.diff(row, append=-1) != 0, np.diff(row, prepend=-1) != 0
            ),
        )
        findings = tuple(
            Finding(
                Level.ERROR,
                "contact",
                motion.place(int(np.searchsorted(row, k))),
                f"{1e3 * amount:.3f} mm off the contact model before the next cutter point, "
                f"{1e3 * self._rule.max_contact_error:g} mm allowed",
            )
            for k, amount in self._astray
        )
        timed = TimedMotion(motion, np.insert(self._segments.duration, at + 1, 0.0))
        kept = np.flatnonzero(np.isin(row, samples.given) | is_ground[row])
        return Recognition(timed.take(kept), samples.source[row[kept]], findings)

    def _pass_ends(self) -> NDArray[np.bool_]:
        """Return at which configurations a pass ends that was not begun there, shape (n,).

        Where one is repeated, the last of them is written there, else the first: as the time of a
        program has it (`opl.motion.repeats.named_of`).
        """
        on_pass = np.where([kind.on_wheel for kind in self._kind], self._pass, -1)
        begins, ends = np.diff(on_pass, prepend=-1) != 0, np.diff(on_pass, append=-1) != 0
        return np.asarray(ends & ~begins & (on_pass >= 0))

    def _mark(self, k: int, kind: MoveKind, pass_index: int, t: float, place: float) -> None:
        self._kind[k], self._pass[k] = kind, pass_index
        self._t[k], self._place[k] = t, place

    def _fill_in(self, segment: ContactSegment, pass_index: int) -> None:
        """Label the configurations between two that grind cutter points."""
        placed = (segment.configurations, segment.place, segment.contact_position, segment.apart)
        for k, place, t, apart in zip(*placed, strict=True):
            self._mark(int(k), MoveKind.BETWEEN, pass_index, t, place)
            if apart > self._rule.max_contact_error:
                self._astray.append((int(k), float(apart)))

    def _label_leads(
        self,
        configuration: NDArray[np.intp],
        point: NDArray[np.intp],
        t: Array,
        pass_index: NDArray[np.int64],
    ) -> tuple[list[int], list[int]]:
        """Label approaches and retracts; return where each pass begins and ends, leads included."""
        firsts, lasts = [], []
        for index in np.unique(pass_index):
            on_pass = np.flatnonzero(pass_index == index)
            begin, end = on_pass[0], on_pass[-1]
            before, met = self._lead(configuration[begin], point[begin], t[begin], -1)
            # the move to the farthest of them is free, unless it is one of the way back as well
            for k in before if met else before[:-1]:
                self._mark(k, MoveKind.APPROACH, index, np.nan, np.nan)
            firsts.append(min(before, default=int(configuration[begin])))
            after, _ = self._lead(configuration[end], point[end], t[end], 1)
            for k in after:
                self._mark(k, MoveKind.RETRACT, index, np.nan, np.nan)
            lasts.append(max(after, default=int(configuration[end])))
        return firsts, lasts

    def _lead(self, k: int, point: int, t: float, side: int) -> tuple[list[int], bool]:
        """Return the configurations off the wheel along the lead next to k, nearest first.

        And whether it goes on to the end of the retract before it: a part that turns back on its
        row comes the way it left, with no free move in between.
        """
        T_workpiece_cutter = self._segments.points.Ts_workpiece_cutter[point]
        T_contact_contact0 = inverse(self._segments.wheel.T_contact0_contact(t))
        direction = self._segments.points.direction_at(point)
        farthest = 0.0
        found: list[int] = []
        j = int(k) + side
        while 0 <= j < len(self._kind) and self._kind[j] in (MoveKind.HOME, MoveKind.RETRACT):
            if not self._given[j]:
                j += side
                continue
            T_contact0_workpiece = self._segments.Ts_contact0_workpiece[j]
            T_contact_cutter = T_contact_contact0 @ T_contact0_workpiece @ T_workpiece_cutter
            along, aside = self._along_lead(T_contact_cutter[:3, 3], side, direction)
            turned = np.linalg.norm(T_contact_cutter[:3, :3] - np.eye(3)) / np.sqrt(2.0)
            if aside > ASIDE or turned > ALIGNED or not along > farthest:
                break
            if along > self._rule.approach_length + self._rule.approach_run + FARTHER:
                break
            if self._kind[j] is MoveKind.RETRACT:
                return found, along > farthest + AT_POINT
            farthest = along
            found.append(j)
            j += side
        return found, False

    def _along_lead(self, p_contact: Array, side: int, direction: float) -> tuple[float, float]:
        """Return how far along approach or retract a point is and how far beside it, in [m].

        `p_contact` is the ground point in the contact frame, whose z points into the wheel, shape
        (3,); `side` is -1 for the approach, which comes from -y, 1 for the retract; `direction` is
        1 where the pass runs along x, else -1. What has moved on along the pass must have lifted
        off as on the quarter of a circle, or more.
        """
        x, y, z = (float(v) for v in p_contact)
        if self._rule.approach_turn == 0.0:
            off, aside = -z, abs(y)
        else:
            radius = self._rule.approach_length / self._rule.approach_turn
            y, z = side * y, z + radius  # seen from the centre of the arc
            off, aside = radius * float(np.arctan2(y, z)), abs(float(np.hypot(y, z)) - radius)
        run, on = min(self._rule.approach_run, self._rule.approach_length), -side * direction * x
        lift = run - float(np.sqrt(max(run * run - on * on, 0.0)))
        return off + on, max(aside, -on, on - run, lift - off)

    def _label_free_moves(self, firsts: list[int], lasts: list[int]) -> None:
        """Tell the free moves from and to home from the links between passes."""
        for k in range(1, len(self._kind)):
            following = next((m for m, first in enumerate(firsts) if k <= first), None)
            if self._kind[k] is not MoveKind.HOME or following is None:
                continue
            self._pass[k] = self._pass[lasts[following]]
            if following > 0:
                self._kind[k] = MoveKind.LINK
