"""How far a joint line leads from where it should, at every place that it passes.

The numbers are exact: no linear stand-in for the kinematics. A place of a run is a frame of the
part and where that frame should be; the line passes it where it comes nearest to that. The contact
may slide along the axle or roll about an edge there: what is left counts, a distance and an angle
along `LEVER`, as the proof of a program counts them. A line that all but stands still, such sliding
left aside, passes a place when its time has come: a straight part on the flat of the wheel touches
in many places at once.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot, forward_kinematics
from opl.files.kernels import kernel
from opl.geometry.frames import Array, inverse

LEVER = 0.05  # [m] from the ground point; weighs angles against distances
SLIDES, ROLLS = 0, 4  # what a contact may do where it is: slide along x or roll about y

_AHEAD = 1e-3  # of a line, for the derivative along it
# What a place may be passed faster than the process allows, and slower where it allows no more than
# is planned; and slower where joints or neighbours make it slow, where nothing but the belt counts.
_PACE = 0.04
_SLOWER = 0.3
_ROUND_OFF = 5e-4  # [s] that the digits of a position leave of the time of a short way
# [m] that a line which all but stands still moves a place at the most, sliding left aside
_STILL = 2e-5


@dataclass(frozen=True, eq=False)
class Run:
    """Configurations through which a line should lead, and what is at each of them.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        Ts_flange_place: The frame of the part that is at its place, shape (n, 4, 4).
        Ts_base_target: Where it should be, shape (n, 4, 4).
        freedom: What the contact may do, `SLIDES` or `ROLLS`, shape (n,).
        room: How far it may do so either way, in [m], angles along `LEVER`, shape (n, 2).
        allowed: Largest error there in [m], shape (n,).
        pace: Three times since the start in [s], shape (n, 3): that it takes through all of the
            configurations, the least that the process allows, and that of the ground point at the
            feed.
        tool: The tool point that zones are counted by, in [m], shape (n, 3).
    """

    q: Array
    Ts_flange_place: Array
    Ts_base_target: Array
    freedom: NDArray[np.int64]
    room: Array
    allowed: Array
    pace: Array
    tool: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            value = np.ascontiguousarray(getattr(self, field.name))
            object.__setattr__(self, field.name, value)

    @property
    def arrays(self) -> tuple[NDArray[np.generic], ...]:
        """The fields in order."""
        return tuple(getattr(self, field.name) for field in fields(self))


@dataclass(frozen=True, eq=False)
class Screws:
    """An arm as the axes its joints turn about, with all joints at 0.

    Attributes:
        axes: Direction of each axis and a point on it in [m], in the base frame, shape (6, 6).
        T_base_flange: The flange there, shape (4, 4).
    """

    axes: Array
    T_base_flange: Array


def screws_of(robot: Robot) -> Screws:
    """Return an arm as screws, found by turning one joint at a time by a quarter."""
    turned = np.vstack([np.zeros(6), np.eye(6) * np.pi / 2.0])
    Ts_base_flange = forward_kinematics(robot, turned)
    axes = []
    for T_zero_turned in Ts_base_flange[1:] @ inverse(Ts_base_flange[0]):
        R = T_zero_turned[:3, :3]
        axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
        # the point of the axis next to the origin
        rows = np.vstack([np.eye(3) - R, axis])
        point = np.linalg.lstsq(rows, np.append(T_zero_turned[:3, 3], 0.0), rcond=None)[0]
        axes.append(np.concatenate([axis, point]))
    return Screws(np.array(axes), np.ascontiguousarray(Ts_base_flange[0]))


def line_errors(screws: Screws, run: Run, start: int, end: int) -> tuple[Array, Array]:
    """Return where a line between two configurations passes those between, and how far off.

    Returns:
        Fractions of the line, ascending, and errors in [m]; each of shape (end - start - 1,).
    """
    shares, errors = np.empty((2, end - start - 1))
    arm = screws.axes, screws.T_base_flange
    _along(*arm, *run.arrays[:-1], start, end, shares, errors)
    return shares, errors


@kernel()
def flange_at(axes, T0, q, T):  # type: ignore[no-untyped-def]
    """Put the flange pose of a configuration into T, shape (3, 4)."""
    for a in range(3):
        for b in range(4):
            T[a, b] = T0[a, b]
    for joint in range(5, -1, -1):
        c, s = np.cos(q[joint]), np.sin(q[joint])
        x, y, z = axes[joint, 0], axes[joint, 1], axes[joint, 2]
        for a in range(3):
            T[a, 3] -= axes[joint, 3 + a]
        for b in range(4):
            u, v, w = T[0, b], T[1, b], T[2, b]
            along = (x * u + y * v + z * w) * (1.0 - c)
            T[0, b] = u * c + (y * w - z * v) * s + x * along
            T[1, b] = v * c + (z * u - x * w) * s + y * along
            T[2, b] = w * c + (x * v - y * u) * s + z * along
        for a in range(3):
            T[a, 3] += axes[joint, 3 + a]


@kernel()
def off_target(T, place, target, off):  # type: ignore[no-untyped-def]
    """Put how far a place of a flange at T is from its target, seen from there, into off, (6,)."""
    d0, d1, d2 = T[0, 3] - target[0, 3], T[1, 3] - target[1, 3], T[2, 3] - target[2, 3]
    for b in range(3):
        d0 += T[0, b] * place[b, 3]
        d1 += T[1, b] * place[b, 3]
        d2 += T[2, b] * place[b, 3]
    w0 = w1 = w2 = 0.0
    for b in range(3):
        x0 = T[0, 0] * place[0, b] + T[0, 1] * place[1, b] + T[0, 2] * place[2, b]
        x1 = T[1, 0] * place[0, b] + T[1, 1] * place[1, b] + T[1, 2] * place[2, b]
        x2 = T[2, 0] * place[0, b] + T[2, 1] * place[1, b] + T[2, 2] * place[2, b]
        w0 += target[1, b] * x2 - target[2, b] * x1
        w1 += target[2, b] * x0 - target[0, b] * x2
        w2 += target[0, b] * x1 - target[1, b] * x0
    half = 0.5 * LEVER
    for b in range(3):
        off[b] = target[0, b] * d0 + target[1, b] * d1 + target[2, b] * d2
        off[3 + b] = half * (target[0, b] * w0 + target[1, b] * w1 + target[2, b] * w2)


@kernel()
def _left(off, freedom, room):  # type: ignore[no-untyped-def]
    """Return what is left of an error where the contact may slide or roll."""
    total = 0.0
    for k in range(6):
        own = off[k]
        if k == freedom:
            own -= min(max(own, room[0]), room[1])
        total += own * own
    return np.sqrt(total)


@kernel()
def _pass_by(axes, T0, q, places, targets, freedom, room, pace, i, j, k, least, T, work):  # type: ignore[no-untyped-def]
    """Return at which fraction the line from i to j passes place k, and its error there."""
    point, off, ahead = work[0], work[1], work[2]
    s = (pace[k, 0] - pace[i, 0]) / max(pace[j, 0] - pace[i, 0], 1e-12)
    for step in range(3):
        for c in range(6):
            point[c] = q[i, c] + s * (q[j, c] - q[i, c])
        flange_at(axes, T0, point, T)
        off_target(T, places[k], targets[k], off)
        if step == 2:
            break
        if step == 0:
            for c in range(6):
                point[c] += _AHEAD * (q[j, c] - q[i, c])
            flange_at(axes, T0, point, T)
            off_target(T, places[k], targets[k], ahead)
            for c in range(6):
                ahead[c] = (ahead[c] - off[c]) / _AHEAD
        along = squared = slid = 0.0
        for c in range(6):
            along += off[c] * ahead[c]
            squared += ahead[c] * ahead[c]
            if c == freedom[k]:
                slid = ahead[c] * ahead[c]
        if squared - slid > _STILL * _STILL:
            s -= along / squared
        s = min(max(s, least), 1.0)
    return s, _left(off, freedom[k], room[k])


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,:,::1],float64[:,:,::1],"
    "int64[::1],float64[:,::1],float64[::1],float64[:,::1],int64,int64,float64[::1],float64[::1])",
    early=True,
    makes_arrays=True,
)
def _along(axes, T0, q, places, targets, freedom, room, allowed, pace, i, j, shares, errors):  # type: ignore[no-untyped-def]
    """Fill in where the line from i to j passes the places between, none before the one ahead."""
    T, work, last = np.empty((3, 4)), np.empty((3, 6)), 0.0
    for k in range(i + 1, j):
        last, error = _pass_by(
            axes, T0, q, places, targets, freedom, room, pace, i, j, k, last, T, work
        )
        shares[k - i - 1], errors[k - i - 1] = last, error


@kernel()
def _bow(before, here, after, allowed, k):  # type: ignore[no-untyped-def]
    """Return the vertex of the parabola through errors at place k and both of its neighbours.

    As a multiple of what is allowed there; 0 if it is not between them.
    """
    slope, bend = 0.5 * (after - before), before - 2.0 * here + after
    if bend >= 0.0 or abs(slope) >= -bend:
        return 0.0
    share = abs(slope) / -bend
    beside = allowed[k + 1] if slope > 0.0 else allowed[k - 1]
    return (here - 0.5 * slope * slope / bend) / (allowed[k] + share * (beside - allowed[k]))


@kernel()
def straight_off(  # type: ignore[no-untyped-def]
    axes, T0, q, places, targets, freedom, room, allowed, pace, i, j, suspect, T, work
):
    """Return the largest error of the line from i to j as a multiple of what is allowed.

    Infinite where it is more than allowed; then also a place that tells so, to be tried first.
    """
    if i < suspect < j:
        _, error = _pass_by(
            axes, T0, q, places, targets, freedom, room, pace, i, j, suspect, 0.0, T, work
        )
        if error > 2.0 * allowed[suspect]:
            return np.inf, suspect
    worst = last = one = other = 0.0  # errors at the last place and at the one before it
    for k in range(i + 1, j + 1):
        before, error = last, 0.0
        if k < j:
            last, error = _pass_by(
                axes, T0, q, places, targets, freedom, room, pace, i, j, k, last, T, work
            )
        worst = max(worst, error / allowed[k])
        if k > i + 1:
            worst = max(worst, _bow(other, one, error, allowed, k - 1))
        if worst > 1.0 or (k < j and not _keeps_pace(pace, i, j, k, last - before)):
            return np.inf, min(k, j - 1)
        other, one = one, error
    if j > i + 1 and not _keeps_pace(pace, i, j, j, 1.0 - last):
        return np.inf, -1
    return worst, -1


@kernel()
def _keeps_pace(pace, i, j, k, share):  # type: ignore[no-untyped-def]
    """Return whether the line from i to j gives the way to place k from the one before its time.

    `share` is that way as a fraction of the line, which is run through evenly.
    """
    takes = share * (pace[j, 0] - pace[i, 0])
    planned, least = pace[k, 0] - pace[k - 1, 0], pace[k, 1] - pace[k - 1, 1]
    most = _PACE if planned <= (1.0 + _PACE) * least else _SLOWER
    return takes >= least / (1.0 + _PACE) - _ROUND_OFF and takes <= planned * (1.0 + most) + (
        _ROUND_OFF
    )
