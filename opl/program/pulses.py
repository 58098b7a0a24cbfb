"""Joint angles to encoder pulses and back, within the controller's soft limits.

A Yaskawa job counts each joint in pulses from its calibrated zero. In jobs of serial arms the count
of a joint depends on that joint alone: the controller itself corrects the mechanical coupling of
the wrist. Its sign is the joint's own.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot
from opl.errors import InputError, SettingError, UnsafeError
from opl.geometry.frames import Array

Pulses = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PulseScale:
    """How a controller counts the joints of its robot.

    Attributes:
        joint_names: As people at the pendant call them.
        pulses_per_radian: Ratio of each joint in [1/rad], shape (6,); NaN where it is not known.
        lower: Lower joint limits in [rad], shape (6,).
        upper: Upper joint limits in [rad], shape (6,).
        unverified: Names of the joints whose ratio nobody has confirmed on a controller.
    """

    joint_names: tuple[str, ...]
    pulses_per_radian: Array
    lower: Array
    upper: Array
    unverified: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("pulses_per_radian", "lower", "upper"):
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != (len(self.joint_names),):
                raise ValueError(
                    f"{name} has shape {value.shape} for {len(self.joint_names)} joints"
                )
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        unknown_ratio = np.isnan(self.pulses_per_radian)
        if not np.all(unknown_ratio | (self.pulses_per_radian > 0.0)) or np.any(
            np.isinf(self.pulses_per_radian)
        ):
            raise ValueError(f"pulses per radian must be positive, got {self.pulses_per_radian}")
        if unknown := set(self.unverified) - set(self.joint_names):
            raise ValueError(f"no such joints: {sorted(unknown)}; have: {self.joint_names}")

    @classmethod
    def of(cls, robot: Robot) -> PulseScale:
        """Return how the controller of a robot counts, as far as is known."""
        return cls(
            robot.joint_names,
            robot.pulses_per_radian,
            robot.lower,
            robot.upper,
            robot.unverified_pulses,
        )

    @property
    def complete(self) -> bool:
        """Whether the ratio of every joint is known."""
        return not np.isnan(self.pulses_per_radian).any()

    @property
    def soft_limits(self) -> tuple[Pulses, Pulses]:
        """Lower and upper limits in pulses, as the controller keeps them, shapes (6,)."""
        return self._nearest(self.lower), self._nearest(self.upper)

    def to_pulses(self, q: Array, inwards: bool = False) -> Pulses:
        """Return the pulses nearest to joint positions.

        Args:
            q: Joint positions in [rad], shape (..., 6).
            inwards: Whether a joint at its limit is rounded inwards, if that limit is no whole
                number of pulses.

        Returns:
            Pulses, shape (..., 6).

        Raises:
            InputError: If the ratio of a joint is not known.
            UnsafeError: If a joint is beyond its soft limit; the first such configuration is named.
        """
        if not self.complete:
            raise InputError("", "the pulses per degree are not known")
        stack = np.atleast_2d(q)
        if not np.all(np.isfinite(stack)):
            raise UnsafeError("a joint position is not a number")
        pulses = self._nearest(stack)
        lower, upper = self.soft_limits
        beyond = np.argwhere((pulses < lower) | (pulses > upper))
        if len(beyond):
            *_, joint = place = tuple(beyond[0])
            raise UnsafeError(
                f"configuration {place[-2]}: joint {self.joint_names[joint]} at "
                f"{np.rad2deg(stack[place]):.3f} deg is {pulses[place]} pulses, the soft limits "
                f"are {lower[joint]} and {upper[joint]}"
            )
        if inwards:
            slack = 1e-6  # pulses
            lowest = np.ceil(self.lower * self.pulses_per_radian - slack)
            highest = np.floor(self.upper * self.pulses_per_radian + slack)
            pulses = np.clip(pulses, lowest, highest).astype(np.int64)
        return pulses.reshape(np.shape(q))

    def to_angles(self, pulses: NDArray[np.generic]) -> Array:
        """Return the joint positions [rad] of pulses, both of shape (..., 6)."""
        return np.asarray(pulses, dtype=float) / self.pulses_per_radian

    def _nearest(self, q: Array) -> Pulses:
        return np.rint(q * self.pulses_per_radian).astype(np.int64)


def require_known(robot: Robot) -> None:
    """Refuse to count a robot in pulses that are not known.

    Raises:
        SettingError: If the ratio of a joint is missing; names what gives it.
    """
    missing = ", ".join(robot.missing_pulses)
    if missing:
        raise SettingError(
            "pulses_per_radian",
            f"no pulses per degree are known of {missing} of {robot.title} (robot: {robot.name}), "
            "so its program cannot be written in pulses; give the controller's own (opl robots "
            "import-params)",
        )


def require_accepted(unverified: Collection[str], accepted: Collection[str]) -> None:
    """Refuse pulses of joints whose ratio nobody has confirmed and the user has not accepted.

    Args:
        unverified: Names of the joints whose ratio is not confirmed.
        accepted: Names of the joints the user accepts all the same.

    Raises:
        SettingError: If a joint is missing; names what helps.
    """
    missing = [name for name in unverified if name not in accepted]
    if missing:
        raise SettingError(
            "accepted_pulses",
            f"the pulses per degree of {', '.join(missing)} are not verified, so a pulse program "
            "may lead anywhere; give the file of the controller's own (opl robots import-params), "
            f"or accept them by name: [{', '.join(missing)}]",
        )
