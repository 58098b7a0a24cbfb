"""Cells of walls with what holds the postures over each: pads of chords, and angles themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import UNKNOWN

MOST_PARTS = 16  # of a cell whose pads are large, at once
COARSE = 5e-4  # [rad] sum of the pads that is small enough
WIDEST = 0.5  # [rad] that an angle is enclosed to; wider is not known
ROUND_OFF = 1e-9  # [rad] of inverse kinematics and enclosures


@dataclass(frozen=True)
class EnclosedCells:
    """The cells of several places, one place after the other.

    Attributes:
        Ts_workpiece_cutter: The places, shape (k, 4, 4).
        grids: Ends of the cells of each.
        cuts: In which cells of each the part surely cuts into the wheel.
        first: First cell of each, shape (k,).
        q: Postures at the ends, principal angles in [rad], shape (n + k, 8, 6).
        pad_low: As in `Piece`, of the s families that matter, shape (s, 6, n).
        pad_high: As in `Piece`.
        known: Which pads are, shape (s, 6, n).
        middle: Middle of what holds the angle all over a cell in [rad], shape (s, 6, n).
        radius: Half of what holds it, shape (s, 6, n).
        none: Where there is certainly no posture, shape (s, n).
    """

    Ts_workpiece_cutter: Array
    grids: list[Array]
    cuts: list[np.ndarray]
    first: np.ndarray
    q: Array
    pad_low: Array
    pad_high: Array
    known: np.ndarray
    middle: Array
    radius: Array
    none: np.ndarray

    def parts(self) -> list[np.ndarray]:
        """Return into how many parts each cell of each place should be cut."""
        bent = np.where(self.known, self.pad_high - self.pad_low, np.nan)
        about = 2.0 * self.radius
        pads = np.fmin(bent, about).sum(axis=1)
        # what is known of the bend falls with the square
        wanted = np.where((bent <= about).all(axis=1), np.ceil(np.sqrt(pads / COARSE)), MOST_PARTS)
        wanted = np.where(pads <= COARSE, 1, wanted)
        wanted = np.where(self.none, 1, wanted)
        parts = np.minimum(wanted.max(axis=0), MOST_PARTS).astype(int)
        return np.split(parts, self.first[1:])


def enclosing(corners: Array, middle: Array, radius: Array) -> tuple[Array, Array]:
    """Return the pads of chords that hold angles known only up to a radius and full turns.

    Args:
        corners: Ends of the chords in [rad], shape (n + 1, 6).
        middle: Of the angles over each cell, shape (n, 6).
        radius: Of what holds them, shape (n, 6).
    """
    low, high = np.minimum(corners[:-1], corners[1:]), np.maximum(corners[:-1], corners[1:])
    turns = np.round(((low + high) / 2.0 - middle) / (2.0 * np.pi))
    middle = middle + 2.0 * np.pi * turns
    known = radius <= WIDEST
    below = np.where(known, np.minimum(middle - radius - high, 0.0) - ROUND_OFF, -UNKNOWN)
    above = np.where(known, np.maximum(middle + radius - low, 0.0) + ROUND_OFF, UNKNOWN)
    return below, above
