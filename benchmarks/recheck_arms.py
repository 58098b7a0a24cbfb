"""Postures of arms over cells of poses, in closed form and interval arithmetic.

For `benchmarks.recheck` alone, which shares no code with opl. Lengths are in [m], angles in [rad].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import Array, Jet, Vector, angle_of, dot, still

TURN = 2.0 * np.pi
SURE = 1e-9  # more than the round-off of sums of some hundred numbers about 1

Flags = NDArray[np.bool_]
Flip = tuple[int, Array, Array]  # by how much the family changes, and sign * q + shift
AS_IT_IS: Flip = (0, np.ones(6), np.zeros(6))


@dataclass(frozen=True)
class Posture:
    """Joint positions over cells, and where there is none."""

    q: list[Jet]
    out_of_reach: Flags

    def part(self, cells: slice) -> Posture:
        """Return those over some of the cells."""
        return Posture([joint.part(cells) for joint in self.q], self.out_of_reach[cells])


@dataclass(frozen=True)
class Heading:
    """Axis 1 turned to where a point lies ahead of it, in [m]; its angle, with cosine and sine."""

    ahead: Jet
    angle: Jet
    cosine: Jet
    sine: Jet
    out_of_reach: Flags


@dataclass(frozen=True)
class Links:
    """Two links that reach a point: angle of the first, what the second is bent by, its direction.

    Angles from upright towards ahead; cosine and sine are those of the second link.
    """

    first: Jet
    bend: Jet
    cosine: Jet
    sine: Jet
    out_of_reach: Flags


def headings(point: Vector, beside: float) -> Iterator[Heading]:
    """Turn axis 1 either way so that a point is as far beside the arm as that, in [m]."""
    offset = still(beside, point[0].value.low)
    around = point[0] * point[0] + point[1] * point[1]
    square = around - still(beside**2, point[0].value.low)
    for ahead in (square.root(), -square.root()):
        yield Heading(
            ahead,
            angle_of(point[1], point[0]) - angle_of(offset, ahead),
            (point[0] * ahead + point[1] * offset) / around,
            (point[1] * ahead - point[0] * offset) / around,
            square.value.high < -SURE,
        )


def two_links(forward: Jet, up: Jet, first: float, second: float) -> Iterator[Links]:
    """Bend two links of these lengths in [m] either way to where they reach a point."""
    cells = forward.value.low

    def number(value: float) -> Jet:
        return still(value, cells)

    away = forward * forward + up * up
    cosine = (away - number(first**2 + second**2)) / number(2.0 * first * second)
    out = (cosine.value.low > 1.0 + SURE) | (cosine.value.high < -1.0 - SURE)
    sine = (number(1.0) - cosine * cosine).root()
    for bent in (sine, -sine):
        along, across = number(first) + number(second) * cosine, number(second) * bent
        sin_first = (forward * along - up * across) / away
        cos_first = (up * along + forward * across) / away
        yield Links(
            angle_of(sin_first, cos_first),
            angle_of(bent, cosine),
            (up - number(first) * cos_first) / number(second),
            (forward - number(first) * sin_first) / number(second),
            out,
        )


@dataclass(frozen=True)
class SphericalWrist:
    """The closed form of an arm with a spherical wrist, upright with all angles zero.

    In the notation of Brandstoetter, Angerer and Hofbaur (2014).
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    offsets: Sequence[float]
    signs: Sequence[int]

    def postures(self, x: Vector, y: Vector, z: Vector, p: Vector) -> Iterator[Posture]:
        """Yield shoulder and elbow both ways, the wrist to one side."""
        cells = p[0].value.low

        def number(value: float) -> Jet:
            return still(value, cells)

        wrist = [p[k] - number(self.c4) * z[k] for k in range(3)]
        forearm, tilt0 = float(np.hypot(self.a2, self.c3)), float(np.arctan2(self.a2, self.c3))
        for heading in headings(wrist, self.b):
            cos1, sin1 = heading.cosine, heading.sine
            forward, up = heading.ahead - number(self.a1), wrist[2] - number(self.c1)
            for links in two_links(forward, up, self.c2, forearm):
                cos_link, sin_link = links.cosine, links.sine
                c, s = number(np.cos(tilt0)), number(np.sin(tilt0))
                sin_tilt, cos_tilt = sin_link * c - cos_link * s, cos_link * c + sin_link * s
                e1 = [cos_tilt * cos1, cos_tilt * sin1, -sin_tilt]
                e3 = [sin_tilt * cos1, sin_tilt * sin1, cos_tilt]
                z1, z2 = dot(e1, z), cos1 * z[1] - sin1 * z[0]
                theta = (
                    heading.angle,
                    links.first,
                    links.bend - number(tilt0),
                    angle_of(z2, z1),
                    angle_of((z1 * z1 + z2 * z2).root(), dot(e3, z)),
                    angle_of(dot(e3, y), -dot(e3, x)),
                )
                out = heading.out_of_reach | links.out_of_reach
                yield Posture(in_joints(theta, self.offsets, self.signs), out)

    def flips(self) -> list[Flip]:
        """Return what brings the wrist to either side of one to this."""
        sign, shift = np.ones(6), np.zeros(6)
        sign[4], shift[4] = -1.0, 2.0 * self.offsets[4] * self.signs[4]
        shift[3] = shift[5] = np.pi
        return [AS_IT_IS, (4, sign, shift)]


@dataclass(frozen=True)
class ParallelAxes:
    """The closed form of an arm whose axes 2, 3 and 4 are parallel, upright with all angles zero.

    Axis 5 lies ``b`` beside axis 1 and crosses axis 6 ``c5`` behind the flange; ``c4``, ``c3`` and
    ``c2`` lead from there down to axis 4, 3 and 2, which is ``c1`` above the base frame and ``a1``
    ahead of axis 1.
    """

    a1: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float
    offsets: Sequence[float]
    signs: Sequence[int]

    def postures(self, x: Vector, y: Vector, z: Vector, p: Vector) -> Iterator[Posture]:
        """Yield shoulder, wrist and elbow both ways."""
        cells = p[0].value.low

        def number(value: float) -> Jet:
            return still(value, cells)

        crossing = [p[k] - number(self.c5) * z[k] for k in range(3)]
        for heading in headings(crossing, self.b):
            cos1, sin1 = heading.cosine, heading.sine
            # along the heading of the arm, and upwards
            x1, y1, z1 = (cos1 * v[0] + sin1 * v[1] for v in (x, y, z))
            for sin5 in ((z1 * z1 + z[2] * z[2]).root(), -(z1 * z1 + z[2] * z[2]).root()):
                theta5 = angle_of(sin5, cos1 * z[1] - sin1 * z[0])
                cos_tilt, sin_tilt = -(z1 / sin5), z[2] / sin5
                theta6 = angle_of(
                    -(sin_tilt * x1 + cos_tilt * x[2]), -(sin_tilt * y1 + cos_tilt * y[2])
                )
                forward = heading.ahead - number(self.a1) - number(self.c4) * sin_tilt
                up = crossing[2] - number(self.c1) - number(self.c4) * cos_tilt
                for links in two_links(forward, up, self.c2, self.c3):
                    cos_link, sin_link = links.cosine, links.sine
                    theta = (
                        heading.angle,
                        links.first,
                        links.bend,
                        angle_of(
                            sin_tilt * cos_link - cos_tilt * sin_link,
                            cos_tilt * cos_link + sin_tilt * sin_link,
                        ),
                        theta5,
                        theta6,
                    )
                    out = heading.out_of_reach | links.out_of_reach
                    yield Posture(in_joints(theta, self.offsets, self.signs), out)

    def flips(self) -> list[Flip]:
        """Return what brings the wrist to either side: here the whole arm moves with it."""
        return [AS_IT_IS]


def in_joints(theta: Sequence[Jet], offsets: Sequence[float], signs: Sequence[int]) -> list[Jet]:
    """Return joint positions as the maker counts them."""
    joints = zip(theta, offsets, signs, strict=True)
    known = [(one + still(offset, one.value.low), sign) for one, offset, sign in joints]
    return [one if sign > 0 else -one for one, sign in known]


Arm = SphericalWrist | ParallelAxes


def arm_of(lengths: dict[str, Any]) -> Arm:
    """Return the arm of a certificate, by the lengths that it has."""
    return ParallelAxes(**lengths) if "c5" in lengths else SphericalWrist(**lengths)
