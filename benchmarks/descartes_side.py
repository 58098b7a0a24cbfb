"""Tesseract's Descartes on a cell and nodes from files; run by `benchmarks.descartes`.

    PYTHON benchmarks/descartes_side.py FOLDER

PYTHON has tesseract-robotics-nanobind, and nothing of opl. Prints one line of JSON. Collision
checks, edges and search are Tesseract's compiled code; Python calls it three times for a posture.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np
from tesseract_robotics import tesseract_collision as collision
from tesseract_robotics import tesseract_command_language as language
from tesseract_robotics import tesseract_common as common
from tesseract_robotics import tesseract_motion_planners_descartes as descartes
from tesseract_robotics.tesseract_environment import Environment
from tesseract_robotics.tesseract_motion_planners import PlannerRequest

PROFILE = "grinding"
PLANNER = "descartes"


class Rung(descartes.DescartesWaypointSamplerD):
    """The configurations of one cutter point that touch nothing."""

    def __init__(self, check, configurations, spent):
        super().__init__()
        self._check, self._configurations, self._spent = check, configurations, spent

    def sample(self):
        """Return the samples of the rung, by Tesseract's name."""
        start = time.perf_counter()
        found = [
            descartes.DescartesStateSampleD(descartes.DescartesStateD(q), 0.0)
            for q in self._configurations
            if not self._check(q)
        ]
        self._spent.append((time.perf_counter() - start, len(found)))
        return found


class Rungs(descartes.DescartesMoveProfileD):
    """Gives each cutter point its rung; edges cost the distance of their ends in joint space."""

    def __init__(self, q, free, check):
        super().__init__()
        self._q, self._free, self._check = q, free, check
        self._usual = descartes.DescartesDefaultMoveProfileD()
        self._usual.enable_collision = False
        self.spent: list[tuple[float, int]] = []
        self._kept = []

    def createWaypointSampler(self, move_instruction, composite_manip_info, env):
        """Return the rung of an instruction, which is described by its number."""
        number = int(move_instruction.getDescription())
        rung = Rung(self._check, list(self._q[number][self._free[number]]), self.spent)
        self._kept.append(rung)
        return rung

    def createEdgeEvaluator(self, move_instruction, composite_manip_info, env):
        """Return Tesseract's own."""
        return self._usual.createEdgeEvaluator(move_instruction, composite_manip_info, env)

    def createStateEvaluator(self, move_instruction, composite_manip_info, env):
        """Return Tesseract's own."""
        return self._usual.createStateEvaluator(move_instruction, composite_manip_info, env)


def main() -> None:
    """Plan and print."""
    folder = Path(sys.argv[1])
    loaded = np.load(folder / "nodes.npz")
    q, free = loaded["q"], loaded["free"]
    environment = Environment()
    if not environment.init(
        common.FilesystemPath(str(folder / "cell.urdf")),
        common.FilesystemPath(str(folder / "cell.srdf")),
        common.GeneralResourceLocator(),
    ):
        sys.exit("the cell cannot be read")
    names = json.loads((folder / "joints.json").read_text(encoding="utf-8"))
    check = collisions(environment, names, json.loads((folder / "margins.json").read_text()))
    info = common.ManipulatorInfo()
    info.manipulator, info.tcp_frame, info.working_frame = "arm", "tool0", "base_link"
    program = language.CompositeInstruction(PROFILE)
    program.setManipulatorInfo(info)
    for number in range(len(q)):
        # what a rung is made of comes from its sampler, not from this waypoint
        waypoint = language.CartesianWaypoint(common.Isometry3d.Identity())
        move = language.MoveInstruction(
            language.CartesianWaypointPoly_wrap_CartesianWaypoint(waypoint),
            language.MoveInstructionType_LINEAR,
            PROFILE,
        )
        move.setDescription(str(number))
        program.appendMoveInstruction(language.MoveInstructionPoly_wrap_MoveInstruction(move))
    rungs = Rungs(q, free, check)
    profiles = language.ProfileDictionary()
    profiles.addProfile(PLANNER, PROFILE, descartes.cast_DescartesMoveProfileD(rungs))
    request = PlannerRequest()
    request.instructions, request.env, request.profiles = program, environment, profiles
    planner = descartes.DescartesMotionPlannerD(PLANNER)
    start = time.perf_counter()
    answer = planner.solve(request)
    seconds = time.perf_counter() - start
    if not answer.successful:
        sys.exit(f"no path: {answer.message}")
    track = np.array([_configuration(one) for one in answer.results])
    print(
        json.dumps(
            {
                "seconds": seconds,
                "nodes": sum(one for one, _ in rungs.spent),
                "free": sum(count for _, count in rungs.spent),
                "travel": float(np.abs(np.diff(track, axis=0)).sum()),
            }
        )
    )


def collisions(environment, names, margins):
    """Return what says whether a configuration touches anything, by the contact manager."""
    manager = environment.getDiscreteContactManager()
    manager.setActiveCollisionObjects(environment.getActiveLinkNames())
    manager.setDefaultCollisionMargin(0.0)
    for first, second, margin in margins:
        manager.setCollisionMarginPair(first, second, margin)
    solver = environment.getStateSolver()
    request = collision.ContactRequest(collision.ContactTestType_FIRST)

    def touches(q):
        manager.setCollisionObjectsTransform(solver.getState(names, q).link_transforms)
        found = collision.ContactResultMap()
        manager.contactTest(found, request)
        return len(found) > 0

    return touches


def _configuration(instruction):
    move = language.InstructionPoly_as_MoveInstructionPoly(instruction)
    state = language.WaypointPoly_as_StateWaypointPoly(move.getWaypoint())
    return np.asarray(state.getPosition()).ravel()


if __name__ == "__main__":
    main()
