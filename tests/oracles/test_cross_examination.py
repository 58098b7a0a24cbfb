"""Cross-examination: coal, PyBullet and fcl asked the same of random configurations of the V and S
cells.

600 configurations each; `python tests/test_cross_examination.py` asks 2000 and prints the counts.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from opl.cell.collision import CollisionScene
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.part_tree import part_tree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.files.resources import folder
from opl.job.load import load_job
from opl.run.surfacing import cut_surface
from opl.verification.world import GAP_ACCURACY, World
from tests.support.bare_cells import random_configurations
from tests.support.fcl_scene import FclScene

PARTS = ("v_shape", "s_shape")
COUNT = 600
LOOKED_AT = 0.005  # [m] beyond the clearance within which PyBullet measures
# [m] from its clearance that a pair may be where two libraries disagree: Bullet rounds the edges of
# the links by up to 0.1 mm, those of both in a pair of links; coal and fcl round nothing
STATED = {("coal", "PyBullet"): 2e-4, ("coal", "fcl"): 1e-4}
# [m] the same for part and wheel: Bullet blows both up by its margin of 0.01 mm
TOO_NEAR = 3e-5


@dataclass(frozen=True)
class Examined:
    """What was answered of each configuration.

    Attributes:
        collides: By library, shape (n,) of bool.
        margins: How far the pair nearest to its clearance, or deepest beyond it, is from it in [m],
            by PyBullet and by fcl, shape (n,).
        exact: Distance of part and wheel in [m], on the triangles, shape (n,).
        gap: The same by PyBullet.
    """

    collides: dict
    margins: dict
    exact: np.ndarray
    gap: np.ndarray


def configurations_of_interest(job, points, count):
    """Return random configurations: a quarter anywhere, the others near some on the wheel."""
    random = np.random.default_rng(0)
    robot, n = job.cell.robot, count // 4
    anywhere = random_configurations(robot, n)
    column = random.integers(len(points), size=20 * count)
    t = random.uniform(-1.0, 1.0, len(column)) * job.cell.wheel.last_position
    Ts = job.cell.Ts_base_flange(t, points.Ts_workpiece_cutter[column])
    slots = inverse_kinematics(robot.arm, Ts)[
        np.arange(len(column)), random.integers(8, size=len(column))
    ]
    within = ((slots >= robot.lower) & (slots <= robot.upper)).all(axis=1)
    on_wheel = slots[within][: count - n]
    # some stay within hundredths of a millimetre of the wheel, some come near to other things
    scale = np.repeat([1e-5, 1e-3, 0.1], len(on_wheel) // 3 + 1)[: len(on_wheel), None]
    near = on_wheel + scale * random.normal(size=on_wheel.shape)
    return np.concatenate([anywhere, np.clip(near, robot.lower, robot.upper)])


@cache
def examined(part, count=COUNT):
    """Ask all libraries about the same configurations."""
    job = load_job(folder("workpieces") / part / "job.yaml")
    cell = job.cell
    configurations = configurations_of_interest(job, cut_surface(job).points, count)
    Ts = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, configurations))
    exact = signed_wheel_distance(part_tree(cell.part), cell.wheel, Ts, 0.02)
    fcl_scene = FclScene(cell)
    by_fcl = [min(fcl_scene.clearances(q).values(), default=np.inf) for q in configurations]
    by_bullet, as_held_to, gap = [], [], []
    with World(cell) as world:
        pairs = world.pairs()
        for q in configurations:
            world.move_to(q)
            beyond = np.array(
                [
                    world.distance(pair.first, pair.second, pair.clearance + LOOKED_AT)
                    - pair.clearance
                    for pair in pairs
                ]
            )
            by_bullet.append(beyond.min())
            as_held_to.append((beyond - [pair.rounding for pair in pairs]).min())
            gap.append(world.gap(0.02))
    margins = {
        "PyBullet": np.array(by_bullet),
        "the replay": np.array(as_held_to),
        "fcl": np.array(by_fcl),
    }
    collides = {name: margin <= 0.0 for name, margin in margins.items()}
    scene = CollisionScene(cell)
    collides["coal"] = scene.collides(configurations)
    collides["the planner"] = scene.for_second_opinion().collides(configurations)
    return Examined(collides, margins, exact, np.array(gap))


def disagreements(found, first, second):
    return np.flatnonzero(found.collides[first] ^ found.collides[second])


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("second", ["PyBullet", "fcl"])
def test_the_planners_library_agrees_but_within_the_stated_margin(part, second):
    found = examined(part)
    assert 0.1 * COUNT < found.collides["coal"].sum() < 0.8 * COUNT
    differ = disagreements(found, "coal", second)
    # where they differ, the nearest pair lies that near to what it needs
    assert (np.abs(found.margins[second][differ]) < STATED["coal", second]).all()


@pytest.mark.parametrize("part", PARTS)
def test_what_the_planner_calls_free_the_replay_calls_free(part):
    found = examined(part)
    free = ~found.collides["the planner"]
    assert free.sum() > 0.2 * COUNT
    assert not found.collides["the replay"][free].any()
    # and it keeps hardly more than it must
    refused = found.collides["the planner"] & ~found.collides["the replay"]
    assert (found.margins["the replay"][refused] < STATED["coal", "PyBullet"]).all()


@pytest.mark.parametrize("part", PARTS)
def test_part_and_wheel_touch_by_both_but_within_the_stated_margin(part):
    found = examined(part)
    touch, touch_too = found.exact <= 0.0, found.gap <= 0.0
    assert 0.1 * COUNT < touch.sum() < 0.9 * COUNT
    differ = np.flatnonzero(touch ^ touch_too)
    assert (np.abs(found.exact[differ]) < GAP_ACCURACY).all()
    near = (found.exact > 0.0) & (found.exact < 0.02) & (found.gap > 0.0)
    assert near.sum() > 0.05 * COUNT
    off = found.gap[near] - found.exact[near]
    assert off.min() > -TOO_NEAR
    assert off.max() <= 0.0
    # a depth is the shortest way out by both
    deep = (found.exact < -1e-4) & (found.exact > -0.005)
    assert deep.sum() > 0.01 * COUNT
    assert (np.abs(found.gap[deep] - found.exact[deep]) < GAP_ACCURACY).all()


def main():
    for part in PARTS:
        found = examined(part, 2000)
        counts = {name: int(hits.sum()) for name, hits in found.collides.items()}
        print(f"{part}: of {len(found.exact)} configurations collide {counts}")
        for second in ("PyBullet", "fcl"):
            differ = disagreements(found, "coal", second)
            most = 1e3 * np.abs(found.margins[second][differ]).max(initial=0.0)
            print(f"  coal and {second} differ at {len(differ)}, {most:.3f} mm at most")
        touch, touch_too = found.exact <= 0.0, found.gap <= 0.0
        differ = np.flatnonzero(touch ^ touch_too)
        most = 1e3 * np.abs(found.exact[differ]).max(initial=0.0)
        print(
            f"  part and wheel touch at {touch.sum()}, by PyBullet at {touch_too.sum()}; ", end=""
        )
        print(f"differ at {len(differ)}, {most:.4f} mm at most")
        near = (found.exact > 0.0) & (found.exact < 0.02) & (found.gap > 0.0)
        off = 1e3 * (found.gap[near] - found.exact[near])
        print(f"  apart at {near.sum()}: PyBullet off by {off.min():.4f} to {off.max():.4f} mm")


if __name__ == "__main__":
    main()
