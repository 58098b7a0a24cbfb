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
        around = wrist[0] * wrist[0] + wrist[1] * wrist[1]
        beside = around - number(self.b**2)
        for ahead in (beside.root(), -beside.root()):
            theta1 = angle_of(wrist[1], wrist[0]) - angle_of(number(self.b), ahead)
            cos1 = (wrist[0] * ahead + wrist[1] * number(self.b)) / around
            sin1 = (wrist[1] * ahead - wrist[0] * number(self.b)) / around
            forward, up = ahead - number(self.a1), wrist[2] - number(self.c1)
            away = forward * forward + up * up
            cosine = (away - number(self.c2**2 + forearm**2)) / number(2.0 * self.c2 * forearm)
            out = (beside.value.high < -SURE) | (cosine.value.low > 1.0 + SURE)
            out |= cosine.value.high < -1.0 - SURE
            sine = (number(1.0) - cosine * cosine).root()
            for bent in (sine, -sine):
                along, across = number(self.c2) + number(forearm) * cosine, number(forearm) * bent
                sin2 = (forward * along - up * across) / away
                cos2 = (up * along + forward * across) / away
                theta2, bend = angle_of(sin2, cos2), angle_of(bent, cosine)
                sin_link = (forward - number(self.c2) * sin2) / number(forearm)
                cos_link = (up - number(self.c2) * cos2) / number(forearm)
                c, s = number(np.cos(tilt0)), number(np.sin(tilt0))
                sin_tilt, cos_tilt = sin_link * c - cos_link * s, cos_link * c + sin_link * s
                e1 = [cos_tilt * cos1, cos_tilt * sin1, -sin_tilt]
                e3 = [sin_tilt * cos1, sin_tilt * sin1, cos_tilt]
                z1, z2 = dot(e1, z), cos1 * z[1] - sin1 * z[0]
                theta = (
                    theta1,
                    theta2,
                    bend - number(tilt0),
                    angle_of(z2, z1),
                    angle_of((z1 * z1 + z2 * z2).root(), dot(e3, z)),
                    angle_of(dot(e3, y), -dot(e3, x)),
                )
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
        around = crossing[0] * crossing[0] + crossing[1] * crossing[1]
        beside = around - number(self.b**2)
        for ahead in (beside.root(), -beside.root()):
            theta1 = angle_of(crossing[1], crossing[0]) - angle_of(number(self.b), ahead)
            cos1 = (crossing[0] * ahead + crossing[1] * number(self.b)) / around
            sin1 = (crossing[1] * ahead - crossing[0] * number(self.b)) / around
            # along the heading of the arm, and upwards
            x1, y1, z1 = (cos1 * v[0] + sin1 * v[1] for v in (x, y, z))
            for sin5 in ((z1 * z1 + z[2] * z[2]).root(), -(z1 * z1 + z[2] * z[2]).root()):
                theta5 = angle_of(sin5, cos1 * z[1] - sin1 * z[0])
                cos_tilt, sin_tilt = -(z1 / sin5), z[2] / sin5
                theta6 = angle_of(
                    -(sin_tilt * x1 + cos_tilt * x[2]), -(sin_tilt * y1 + cos_tilt * y[2])
                )
                forward = ahead - number(self.a1) - number(self.c4) * sin_tilt
                up = crossing[2] - number(self.c1) - number(self.c4) * cos_tilt
                away = forward * forward + up * up
                cosine = away - number(self.c2**2 + self.c3**2)
                cosine = cosine / number(2.0 * self.c2 * self.c3)
                out = (beside.value.high < -SURE) | (cosine.value.low > 1.0 + SURE)
                out |= cosine.value.high < -1.0 - SURE
                sine = (number(1.0) - cosine * cosine).root()
                for bent in (sine, -sine):
                    along = number(self.c2) + number(self.c3) * cosine
                    across = number(self.c3) * bent
                    sin2 = (forward * along - up * across) / away
                    cos2 = (up * along + forward * across) / away
                    sin_link = (forward - number(self.c2) * sin2) / number(self.c3)
                    cos_link = (up - number(self.c2) * cos2) / number(self.c3)
                    theta = (
                        theta1,
                        angle_of(sin2, cos2),
                        angle_of(bent, cosine),
                        angle_of(
                            sin_tilt * cos_link - cos_tilt * sin_link,
                            cos_tilt * cos_link + sin_tilt * sin_link,
                        ),
                        theta5,
                        theta6,
                    )
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
