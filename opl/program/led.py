"""What a straight move leads along a line: the tool in the hand, or the part past one that stands.

A controller that knows stationary tools moves the held part so that the standing tool point runs
straight over it; the speed of a move is then that of the tool point over the part. With the tool
point in the middle of the wheel that is the surface feed where the part is ground there; elsewhere
it differs by what the part turns and the contact moves meanwhile. The time is always that wanted.
"""

from __future__ import annotations

from dataclasses import dataclass

from opl.cell.robot import Robot
from opl.geometry.frames import Array, inverse


@dataclass(frozen=True, eq=False)
class HandTool:
    """A tool in the hand, led along lines that stand still.

    Attributes:
        T_flange_tool: The tool, shape (4, 4).
    """

    T_flange_tool: Array

    def frames(self, Ts_base_flange: Array) -> Array:
        """Return the poses that run straight, T_base_tool, shape (..., 4, 4)."""
        return Ts_base_flange @ self.T_flange_tool

    def flanges(self, Ts_base_tool: Array) -> Array:
        """Return the poses of the flange that belong to such poses, shape (..., 4, 4)."""
        return Ts_base_tool @ inverse(self.T_flange_tool)

    def as_counted(self, frames: Array, robot: Robot) -> Array:
        """Return such poses as the controller counts them: from its own base frame."""
        return robot.T_controller_base @ frames

    def from_counted(self, frames: Array, robot: Robot) -> Array:
        """Return the poses that a controller counts so."""
        return inverse(robot.T_controller_base) @ frames


@dataclass(frozen=True, eq=False)
class StationaryTool:
    """A tool that stands; lines lie in the held part.

    Attributes:
        T_base_tool: The tool, shape (4, 4).
        T_flange_part: The part, shape (4, 4).
    """

    T_base_tool: Array
    T_flange_part: Array

    def frames(self, Ts_base_flange: Array) -> Array:
        """Return the poses that run straight, T_part_tool, shape (..., 4, 4)."""
        return inverse(Ts_base_flange @ self.T_flange_part) @ self.T_base_tool

    def flanges(self, Ts_part_tool: Array) -> Array:
        """Return the poses of the flange that belong to such poses, shape (..., 4, 4)."""
        return self.T_base_tool @ inverse(Ts_part_tool) @ inverse(self.T_flange_part)

    def as_counted(self, frames: Array, robot: Robot) -> Array:
        """Return such poses as the controller counts them: from the part, wherever its base is."""
        return frames

    def from_counted(self, frames: Array, robot: Robot) -> Array:
        """Return the poses that a controller counts so."""
        return frames


Led = HandTool | StationaryTool
