"""What job and cell files say, validated, in SI: values, without what reads them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from opl.cell.robot import Robot
from opl.cell.workcell import JointLimit, PairRules, WorkCell, wheel_solid
from opl.errors import InputError
from opl.geometry.frames import Array
from opl.geometry.passes import MachinedSurface, Passes
from opl.geometry.shapes import Body
from opl.geometry.touched import TouchedFit
from opl.geometry.wheel import ContactWheel
from opl.job.methods import Search
from opl.job.pairs import GivenPairs
from opl.job.source import Source
from opl.motion.process_settings import ProcessSettings
from opl.program.settings import ProgramSettings


@dataclass(frozen=True)
class PlacedWheel:
    """A wheel in the base frame, and how it came there.

    Attributes:
        name: What the cell calls it.
        wheel: The wheel.
        max_belt_penetration: How deep a part may sink into its belt in [m].
        fit: How its touched points fit; None if it was given as a pose.
    """

    name: str
    wheel: ContactWheel
    max_belt_penetration: float
    fit: TouchedFit | None


@dataclass(frozen=True)
class Cell:
    """What a cell file says, validated, in SI, in the base frame of its robot.

    Attributes:
        path: The file, None if a job gives all this itself.
        robot: The arm.
        T_cell_base: Where its base frame is in the frame of the cell, shape (4, 4).
        wheels: The wheels.
        obstacles: What stands around, in the base frame.
        gripper: Bodies fixed to the flange, in the flange frame.
        clearance: Distance to keep where no pair says otherwise, in [m].
        pairs: The pairs that may touch or keep another distance.
        limits: Limits of joints and sums of joints beside the robot's own.
        home: Joint positions in [rad], shape (6,); None if the job says them.
    """

    path: Path | None
    robot: Robot
    T_cell_base: Array
    wheels: tuple[PlacedWheel, ...]
    obstacles: tuple[Body, ...]
    gripper: tuple[Body, ...]
    clearance: float
    pairs: GivenPairs
    limits: tuple[JointLimit, ...]
    home: Array | None

    def pick(self, name: str | None, where: str) -> PlacedWheel:
        """Return the wheel of a name, the only one without.

        Args:
            name: The name, None if none is given.
            where: What is to blame for a wrong one.

        Raises:
            InputError: If there is none of the name, or several and none is named.
        """
        names = [wheel.name for wheel in self.wheels]
        if name is None:
            if len(names) > 1:
                raise InputError(where, f"is missing: {self.path} has wheels {', '.join(names)}")
            return self.wheels[0]
        if name not in names:
            raise InputError(where, f"no wheel {name!r} in {self.path}; has: {', '.join(names)}")
        return self.wheels[names.index(name)]

    def around(self, picked: PlacedWheel) -> tuple[Body, ...]:
        """Return the obstacles, the wheels that are not picked among them."""
        others = (
            wheel_solid(wheel.wheel, wheel.name) for wheel in self.wheels if wheel is not picked
        )
        return (*self.obstacles, *others)


@dataclass(frozen=True)
class Surroundings:
    """What is around the part: from the job file, or from the cell file that it names.

    Attributes:
        cell: The cell; that of a job without a cell file has no path.
        placed: The wheel, and how it was found.
        pairs: The pairs that keep another distance, or none.
        home: Joint positions in [rad], shape (6,).
        home_key: File and key that give them.
        wheel_key: What gives the place of the wheel.
    """

    cell: Cell
    placed: PlacedWheel
    pairs: PairRules
    home: Array
    home_key: str
    wheel_key: str


@dataclass(frozen=True)
class Job:
    """Everything a job file says, validated, in SI.

    Attributes:
        source: The file or mapping; for messages.
        name: Name of the program.
        cell: Robot, wheel, part and surroundings.
        around: Where the surroundings come from.
        surface: The surface to be ground, in the workpiece frame.
        passes: How the surface is cut.
        search: How the path is searched.
        process: Speeds, approach and home.
        program: How the program is written.
        inputs: SHA-256 of everything it is made of, by name; see `opl.job.inputs`.
    """

    source: Source
    name: str
    cell: WorkCell
    around: Surroundings
    surface: MachinedSurface
    passes: Passes
    search: Search
    process: ProcessSettings
    program: ProgramSettings
    inputs: Mapping[str, str] = field(default_factory=dict)
