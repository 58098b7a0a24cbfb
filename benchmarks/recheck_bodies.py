"""Cells of walls in which bodies surely collide, for `benchmarks.recheck`.

Lengths are in [m], angles in [rad].
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.intervals import Array
from benchmarks.recheck_arms import SURE, Flags
from benchmarks.recheck_walls import Cells, joined

PROJECTED = 40  # times that a point is brought from one body to the other
DEEPER = 40  # steps to where it is deepest in both
FIRST_STEP = 0.05  # [m] of these
SHORTER = 0.8  # each than the one before
CORNERS = 500  # of a mesh that are looked at, at the most
BLOCK = 200  # configurations at once for those
CUT = 6  # halvings of a cell in which bodies collide, but not for sure all over it


class Bodies:
    """Bodies on a chain of joints, and which pairs of them must stay apart.

    Args:
        facts: ``Ts_before_joint``, poses of the joints at zero in the frame of the one before;
            ``axes``, in their own frames; ``joint``, the number of the joint that moves each body,
            0 for none; ``Ts_joint_body``, middles and axes of the bodies; ``sizes``, half the edges
            of a box, or radius, half length and -1 of a cylinder about z, for a mesh a box around
            it; ``corners`` of meshes, in the frame of the joint, empty for boxes and cylinders;
            ``pairs``, first body, second body and how far apart they must be.
    """

    def __init__(self, facts: dict[str, Any]) -> None:
        self._Ts_before = np.array(facts["Ts_before_joint"])
        self._axes = np.array(facts["axes"])
        self._joint = np.array(facts["joint"], dtype=int)
        self._Ts_joint_body = np.array(facts["Ts_joint_body"])
        self._sizes = np.array(facts["sizes"])
        self._corners = [
            np.array(corners)[:: 1 + len(corners) // CORNERS] for corners in facts["corners"]
        ]
        self._pairs = [(int(a), int(b), float(margin)) for a, b, margin in facts["pairs"]]

    def cleared(self, cells: Cells, which: Flags) -> Cells:
        """Return cells without what surely collides of some of them, which are cut for that."""
        index = np.flatnonzero(which)
        low, high = np.zeros(len(index)), np.ones(len(index))
        kept = [cells.pick(~which)]
        order = [(np.flatnonzero(~which), np.zeros((~which).sum()))]
        for halving in range(CUT + 1):
            own = cells.pick(index)
            step = own.end - own.start
            middle = own.start + ((low + high) / 2.0)[:, None] * step
            middle += (own.pad_low + own.pad_high) / 2.0
            turned = np.abs(step) * ((high - low) / 2.0)[:, None]
            turned += (own.pad_high - own.pad_low) / 2.0
            surely, near = self.collide(middle, turned)
            cut = near & ~surely & (halving < CUT)
            stay = ~surely & ~cut
            a, b = low[stay, None], high[stay, None]
            left, step = own.pick(stay), step[stay]
            kept.append(replace(left, start=left.start + a * step, end=left.start + b * step))
            order.append((index[stay], low[stay]))
            half = (low + high)[cut] / 2.0
            index = np.tile(index[cut], 2)
            low, high = np.append(low[cut], half), np.append(half, high[cut])
            if not len(index):
                break
        number, share = (np.concatenate(parts) for parts in zip(*order, strict=True))
        return joined(kept).pick(np.lexsort([share, number]))

    def collide(self, q: Array, turned: Array) -> tuple[Flags, Flags]:
        """Return where bodies collide however little the joints turn from there, and where at all.

        Args:
            q: In [rad], shape (n, 6).
            turned: How far each joint may be off, shape (n, 6).
        """
        surely, near = np.zeros(len(q), dtype=bool), np.zeros(len(q), dtype=bool)
        Ts = self._placed(q)
        reach = np.linalg.norm(np.where(self._sizes < 0.0, self._sizes[:, :1], self._sizes), axis=1)
        for first, second, margin in self._pairs:
            a, b = sorted((first, second), key=lambda one: self._joint[one])
            Ta, Tb = (Ts[self._joint[one]] @ self._Ts_joint_body[one] for one in (a, b))
            apart = np.linalg.norm(Ta[:, :3, 3] - Tb[:, :3, 3], axis=1) - reach[a] - reach[b]
            some = np.flatnonzero((apart < margin) & ~surely)
            if not len(some):
                continue
            meshes = [one for one in (a, b) if len(self._corners[one])]
            if len(meshes) == 2:
                continue
            if meshes:
                solid, T_base_solid = (b, Tb) if meshes[0] == a else (a, Ta)
                T_base_joint = Ts[self._joint[meshes[0]]]
                x, depth = self._corner(meshes[0], T_base_joint[some], solid, T_base_solid[some])
            else:
                x, depth = self._between(a, b, Ta[some], Tb[some])
            hit = depth < margin
            some, x, depth = some[hit], x[hit], depth[hit]
            near[some] = True
            moved = np.zeros(len(some))
            # one joint after the other, the first one first: those after it are still in the middle
            for joint in range(self._joint[a] + 1, self._joint[b] + 1):
                T = Ts[joint][some]
                axis = T[:, :3, :3] @ self._axes[joint - 1]
                lever = np.linalg.norm(np.cross(axis, x - T[:, :3, 3]), axis=1)
                moved += turned[some, joint - 1] * lever
            surely[some] |= depth + moved + SURE < margin
        return surely, near

    def _placed(self, q: Array) -> list[Array]:
        """Return the poses of all joints, that which does not move first, each (n, 4, 4)."""
        Ts = [np.tile(np.eye(4), (len(q), 1, 1))]
        for joint, (before, axis) in enumerate(zip(self._Ts_before, self._axes, strict=True)):
            turn = np.tile(np.eye(4), (len(q), 1, 1))
            c, s = np.cos(q[:, joint]), np.sin(q[:, joint])
            x, y, z = axis
            across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
            along = np.outer(axis, axis)
            turn[:, :3, :3] = (
                c[:, None, None] * (np.eye(3) - along) + s[:, None, None] * across + along
            )
            Ts.append(Ts[-1] @ before @ turn)
        return Ts

    def _between(self, a: int, b: int, Ta: Array, Tb: Array) -> tuple[Array, Array]:
        """Return points between two bodies or in both, and their distances to both added up.

        A distance is negative inside. What is less than that apart from one of them is so close to
        the other as well: no more than the sum is between the two.
        """
        x = (Ta[:, :3, 3] + Tb[:, :3, 3]) / 2.0
        for _ in range(PROJECTED):
            for body, T in ((a, Ta), (b, Tb)):
                away, way = self._away(body, T, x)
                x = x - np.maximum(away, 0.0)[:, None] * way
        best, least, step = x, np.full(len(x), np.inf), FIRST_STEP
        for _ in range(DEEPER):
            (one, to_one), (other, to_other) = self._away(a, Ta, x), self._away(b, Tb, x)
            less = one + other < least
            best, least = np.where(less[:, None], x, best), np.where(less, one + other, least)
            x = best - step * np.where(less[:, None], to_one + to_other, to_one) / 2.0
            step *= SHORTER
        return best, least

    def _corner(self, mesh: int, Ts: Array, solid: int, T_base_solid: Array) -> tuple[Array, Array]:
        """Return the corner of a mesh that is nearest to a body or deepest in it, and how far.

        Args:
            mesh: Which body is the mesh.
            Ts: Poses of the joint that moves it, shape (n, 4, 4).
            solid: Which one is the box or cylinder.
            T_base_solid: Its poses, shape (n, 4, 4).
        """
        x, depth = np.empty((len(Ts), 3)), np.empty(len(Ts))
        corners = self._corners[mesh]
        for first in range(0, len(Ts), BLOCK):
            now = slice(first, first + BLOCK)
            places = corners @ np.swapaxes(Ts[now, :3, :3], 1, 2) + Ts[now, None, :3, 3]
            n, k = places.shape[:2]
            T = np.repeat(T_base_solid[now], k, axis=0)
            away = self._away(solid, T, places.reshape(-1, 3))[0].reshape(n, k)
            nearest = away.argmin(axis=1)
            x[now], depth[now] = places[np.arange(n), nearest], away.min(axis=1)
        return x, depth

    def _away(self, body: int, T: Array, x: Array) -> tuple[Array, Array]:
        """Return how far points are from a body, negative inside, and the way that grows."""
        local = np.einsum("nji,nj->ni", T[:, :3, :3], x - T[:, :3, 3])
        size = self._sizes[body]
        if size[2] < 0.0:
            around = np.maximum(np.hypot(local[:, 0], local[:, 1]), 1e-12)
            beyond = np.stack([around - size[0], np.abs(local[:, 2]) - size[1]], axis=1)
            out = local[:, :2] / around[:, None]
            zero = np.zeros(len(x))
            ways = np.stack(
                [
                    np.column_stack([out, zero]),
                    np.column_stack([zero, zero, np.sign(local[:, 2])]),
                ],
                axis=1,
            )
        else:
            beyond = np.abs(local) - size
            ways = np.sign(local)[:, :, None] * np.eye(3)
        outside = np.maximum(beyond, 0.0)
        away = np.linalg.norm(outside, axis=1)
        deepest = beyond.max(axis=1)
        share = np.where(
            (away > 0.0)[:, None],
            outside / np.maximum(away, 1e-300)[:, None],
            beyond == deepest[:, None],
        )
        way = np.einsum("nk,nki->ni", share, ways)
        turned = np.einsum("nij,nj->ni", T[:, :3, :3], way)
        return np.where(away > 0.0, away, deepest), turned
