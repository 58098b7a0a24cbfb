"""A stretch of a motion replayed in PyBullet, densely.

The controller moves all joints linearly between the configurations of the program, so that is what
is replayed: between two checked poses no corner of the held part's box moves more than `STEP` and
no joint turns more than `TURN`.

A pair of solids is measured only when it could have come too near: since it was last measured its
distance cannot have shrunk by more than the joints between the two moved times their levers. That
leaves out nothing; it covers the moves between the checked poses as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.findings import Finding, Level
from opl.geometry.frames import Array, transform
from opl.geometry.mesh import box_corners
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion, MoveKind
from opl.verification.extremes import Least
from opl.verification.world import GAP_ACCURACY, World

STEP = 1e-3  # [m]
TURN = np.deg2rad(0.5)
HORIZON = 0.1  # [m] clearances beyond this are not measured, only known to be more
AHEAD = 0.03  # [m] measured beyond what is needed: for that long a pair can be left alone after
FARTHEST_GAP = 0.005  # [m] between part and wheel that is measured while grinding

# What a kind of move means for the contact is written here anew: a mistake in `MoveKind` must not
# go through the proof unseen.
ON_WHEEL = (MoveKind.GRIND, MoveKind.BETWEEN)
ALONG_LEAD = (MoveKind.APPROACH, MoveKind.RETRACT)


# of each kind, pass and subject the worst finding, and by how much it is wrong
Worst = dict[tuple[str, str, int, str], tuple[float, Finding]]


@dataclass(eq=False)
class Checked:
    """What was found on a stretch.

    Attributes:
        clearance: Smallest distance of any pair that counts on each move in [m], `HORIZON` at the
            most, shape (moves,).
        poses: Number of poses checked.
        collisions: Number of poses in which some pair was too near.
        nearest: The smallest distance of any pair that counts.
        contact: The largest contact error, negative.
        gap: The smallest distance between part and wheel where they may touch.
        worst: What is wrong.
    """

    clearance: Array
    poses: int = 0
    collisions: int = 0
    nearest: Least = field(default_factory=lambda: Least(HORIZON))
    contact: Least = field(default_factory=Least)
    gap: Least = field(default_factory=Least)
    worst: Worst = field(default_factory=dict)

    def add(self, other: Checked) -> None:
        """Add what was found on the next stretch."""
        self.clearance = np.append(self.clearance, other.clearance)
        self.poses += other.poses
        self.collisions += other.collisions
        self.nearest.add(other.nearest)
        self.contact.add(other.contact)
        self.gap.add(other.gap)
        for key, (amount, finding) in other.worst.items():
            self.note(key, amount, finding)

    def note(self, key: tuple[str, str, int, str], amount: float, finding: Finding) -> None:
        """Keep a finding if it is the worst of its kind, place and subject."""
        if key not in self.worst or amount > self.worst[key][0]:
            self.worst[key] = amount, finding


class Replaying:
    """A motion being replayed, one stretch after another.

    Args:
        cell: The cell.
        world: The same in PyBullet.
        points: The cutter points that are to be ground.
        motion: The motion.
        max_contact_error: Largest distance of the ground point from the wheel's surface allowed,
            in [m].
    """

    def __init__(
        self,
        cell: WorkCell,
        world: World,
        points: CutterPoints,
        motion: Motion,
        max_contact_error: float,
    ) -> None:
        self._cell = cell
        self._points = points
        self._world = world
        self._motion = motion
        self._allowed_error = max_contact_error
        self._pairs = world.pairs()
        self._needed = np.array([pair.clearance for pair in self._pairs])
        self._counts = np.array([pair.counts for pair in self._pairs], dtype=bool)
        self._levers = world.levers(self._pairs)
        self._corners = box_corners(cell.part.vertices)
        # of the move that ends at each configuration
        self._clearance = np.full(len(motion), HORIZON)

    def checked(self, moves: range) -> Checked:
        """Return what is found on moves that follow each other, given by where they end."""
        self._found = found = Checked(self._clearance[moves.start : moves.stop])
        # what each pair is at least apart, as far as known, in [m]
        self._apart = np.full(len(self._pairs), -np.inf)
        self._q = self._motion.q[max(moves.start - 1, 0)]
        self._at = transform(self._world.move_to(self._q), self._corners)
        if moves.start == 0:
            for name in self._world.surrounding():
                found.collisions += 1
                self._note("collision", 0, f"robot and {name}", np.inf, "one in the other")
        for move in moves:
            self._make_move(move)
        return found

    def _make_move(self, move: int) -> None:
        """Go on to a configuration, checking the poses on the move."""
        start, target = self._q, self._motion.q[move]
        done = 0.0
        stride = 1.0 / max(np.abs(target - start).max() / TURN, 1.0)
        while done < 1.0:
            # a stride that proves too long is shortened, one that proves short is lengthened
            ahead = min(done + stride, 1.0)
            if 1.0 - ahead < 1e-6:
                ahead = 1.0
            q = start + ahead * (target - start)
            T_base_workpiece = self._world.move_to(q)
            corners = transform(T_base_workpiece, self._corners)
            moved = np.sqrt(np.square(corners - self._at).sum(axis=1).max()) / STEP
            longest = max(moved, np.abs(q - self._q).max() / TURN)
            stride = (ahead - done) * 0.95 / max(longest, 0.1)
            if longest > 1.0:
                continue
            done = ahead
            self._at = corners
            self._check(move, q)
            self._check_contact(move, done, T_base_workpiece)

    def _check(self, move: int, q: Array) -> None:
        """Check the pose that the world is in."""
        self._found.poses += 1
        self._apart -= self._levers @ np.abs(q - self._q)
        self._q = q
        hit = False
        # near pairs are measured at every pose, so that the smallest clearance is found too; the
        # nearest first: it leaves the least to measure of the others
        most = np.maximum(self._needed, np.where(self._counts, self._clearance[move], 0.0))
        near = np.flatnonzero(self._apart <= most)
        for k in near[self._apart[near].argsort(kind="stable")].tolist():
            pair = self._pairs[k]
            wanted = max(pair.clearance, self._clearance[move] if self._counts[k] else 0.0)
            if self._apart[k] > wanted:
                continue
            within = wanted + AHEAD
            distance = self._world.distance(pair.first, pair.second, within + pair.rounding)
            distance -= pair.rounding
            self._apart[k] = min(distance, within)
            names = f"{pair.first.name} and {pair.second.name}"
            if self._counts[k]:
                self._clearance[move] = min(self._clearance[move], distance)
                self._found.nearest.note(distance, names, move, q)
            if distance < pair.clearance or distance <= 0.0:
                hit = True
                self._too_near(move, names, distance, pair.clearance)
        hit |= self._check_wheel(move)
        self._found.collisions += hit

    def _check_wheel(self, move: int) -> bool:
        """Check part against wheel as bodies; return whether they collide."""
        motion, cell = self._motion, self._cell
        grinding = motion.kind[move] in ON_WHEEL
        touching_down = grinding and motion.kind[move - 1] not in ON_WHEEL
        free = not grinding and motion.kind[move] not in ALONG_LEAD
        off_wheel = cell.pairs.required.get(frozenset((PART, WHEEL)), cell.required_clearance)
        needed = off_wheel if free else -cell.max_belt_penetration
        # triangles lie below the surface; whether the ground point lies on the wheel is checked
        # without that
        farthest = self._allowed_error + GAP_ACCURACY if grinding and not touching_down else np.inf
        # where it may touch, what is not as deep as it ever was need not be known
        counts = needed if free else max(needed, self._found.gap.amount)
        gap = self._world.gap(farthest if farthest < np.inf else counts, counts)
        if not free:
            self._found.gap.note(gap, f"{PART} and {WHEEL}", move, self._q)
        if gap < needed:
            self._too_near(move, f"{PART} and {WHEEL}", gap, needed)
            return True
        if farthest < gap:
            gap = self._world.gap(FARTHEST_GAP)
            self._contact_lost(move, gap, "part and wheel do not touch")
        return False

    def _check_contact(self, move: int, fraction: float, T_base_workpiece: Array) -> None:
        """Check that the point to be ground lies on the wheel's surface.

        `fraction` of the move is done; T_base_workpiece has shape (4, 4).
        """
        motion = self._motion
        if motion.kind[move] not in ON_WHEEL:
            return
        place = motion.cutter_point[move]
        if motion.kind[move - 1] in ON_WHEEL:
            place -= (1.0 - fraction) * (place - motion.cutter_point[move - 1])
        elif fraction < 1.0:
            return  # touching down
        points = self._points.Ts_workpiece_cutter[:, :3, 3]
        before = int(place)
        after = min(before + 1, len(points) - 1)
        point = points[before] + (place - before) * (points[after] - points[before])
        error = abs(self._world.distance_to_wheel(transform(T_base_workpiece, point)))
        self._found.contact.note(-error, "ground point", move, self._q)
        if error > self._allowed_error:
            self._contact_lost(move, error, "ground point")

    def _contact_lost(self, move: int, error: float, subject: str) -> None:
        known = error < np.inf
        away = f"{1e3 * error:.3f} mm" if known else f"more than {1e3 * FARTHEST_GAP:g} mm"
        message = f"{away} from the wheel's surface, {1e3 * self._allowed_error:g} mm allowed"
        self._note("contact", move, subject, error, message)

    def _too_near(self, move: int, subject: str, distance: float, needed: float) -> None:
        message = (
            f"{1e3 * distance:.2f} mm apart, {1e3 * needed:g} mm needed"
            if distance > 0.0
            else f"{-1e3 * distance:.2f} mm into each other"
        )
        self._note("collision", move, subject, needed - distance, message)

    def _note(self, kind: str, move: int, subject: str, amount: float, message: str) -> None:
        motion = self._motion
        finding = Finding(Level.ERROR, kind, motion.place(move), f"{subject}: {message}")
        key = kind, motion.kind[move].value, int(motion.pass_index[move]), subject
        self._found.note(key, amount, finding)
