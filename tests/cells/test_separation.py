"""Lower bounds of distances, and what rests on them, against every pair measured one by one."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell import separation as separation_module
from opl.cell.collision import A_CALL, TOLD, CollisionScene
from opl.cell.nearest import nearest_pairs
from opl.cell.robot_loading import load_robot
from opl.cell.separation import Bodies, Separation
from opl.geometry.frames import pose
from opl.geometry.rotations import from_rotation_vector
from opl.geometry.shapes import Body, Box, Cylinder
from tests.support.planned import v_job


def turned(rng):
    """A pose somewhere around the robot."""
    return pose(from_rotation_vector(rng.normal(size=3)), rng.uniform(-1.2, 1.2, 3))


def crowded(robot, seed):
    """The V part held by a robot among boxes and cylinders that lie about at random."""
    rng = np.random.default_rng(seed)
    shapes = [Box(rng.uniform(0.05, 0.6, 3)) for _ in range(3)]
    shapes += [Cylinder(rng.uniform(0.02, 0.3), rng.uniform(0.05, 0.8)) for _ in range(3)]
    solids = tuple(Body(f"solid {k}", shape, turned(rng)) for k, shape in enumerate(shapes))
    return replace(v_job().cell, robot=load_robot(robot), obstacles=solids, required_clearance=0.02)


def configurations(robot, seed, n=40):
    """Some far apart and some that follow each other closely."""
    rng = np.random.default_rng(seed)
    far = rng.uniform(robot.lower, robot.upper, (n, 6))
    return np.concatenate([far, far[-1] + np.cumsum(rng.normal(0.0, 0.01, (n, 6)), axis=0)])


def all_distances(scene, q):
    """The distance of every pair, measured."""
    found = []
    for one in q:
        scene.place(one)
        found.append([scene.distance(k) for k in range(len(scene._pairs))])
    return np.array(found)


@pytest.mark.parametrize("robot", ["mh24", "ur10e"])
@given(seed=st.integers(0, 2**20))
@settings(max_examples=4, deadline=None)
def test_no_bound_is_above_the_distance(robot, seed):
    cell = crowded(robot, seed)
    scene = CollisionScene(cell)
    every = np.arange(len(scene._pairs))
    q = configurations(cell.robot, seed)
    distances = all_distances(scene, q)
    for enough in (0.0, 0.05, 10.0):
        separation = scene.separation(every)
        for one, distance in zip(q, distances, strict=True):
            near = separation.near(one[None], np.full(len(every), enough))[0]
            # into each other coal tells depths of its own
            assert (separation.apart <= np.maximum(distance, 0.0) + 1e-6).all()
            assert (near == (separation.apart <= enough)).all()


@pytest.mark.parametrize("robot", ["mh24", "gp25", "ur10e"])
def test_collisions_are_those_of_every_pair_asked_one_by_one(robot):
    cell = crowded(robot, seed=5)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=6, n=80)
    for one in (scene, scene.for_second_opinion()):
        data = one._geometry_data
        wanted = []
        for configuration in q:
            one.place(configuration)
            count = len(one._pairs)
            wanted.append([pin.computeCollision(one._geometry, data, k) for k in range(count)])
        hit = np.any(wanted, axis=1)
        assert 0.05 < hit.mean() < 0.95
        np.testing.assert_array_equal(one.collides(q), hit)
        for configuration, pairs in zip(q[:20], wanted, strict=False):
            names = {one.pair(k) for k in np.flatnonzero(pairs)}
            assert set(one.colliding_pairs(configuration)) == names


def test_collisions_in_parts_are_the_same_in_threads_and_without_any(monkeypatch):
    cell = crowded("mh24", seed=5)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=6, n=80)
    hit = scene.collides(q)
    monkeypatch.setattr(separation_module, "PART", 7)
    np.testing.assert_array_equal(scene.collides(q), hit)
    in_parts = scene.separation(np.arange(len(scene._pairs)))
    in_parts.near(q, scene._enough)
    distances = all_distances(scene, q[-1:])[0]
    assert (in_parts.apart <= np.maximum(distances, 0.0) + 1e-6).all()
    monkeypatch.setattr(separation_module, "threads_are_allowed", lambda: False)
    np.testing.assert_array_equal(scene.collides(q), hit)


def test_the_first_that_collides_is_the_one_asked_one_by_one_and_most_behind_it_are_not_asked(
    monkeypatch,
):
    cell = crowded("mh24", seed=5)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=6, n=80)
    hit = scene.collides(q)
    free, shut = q[~hit], q[hit]
    asked = []
    look = CollisionScene._look
    monkeypatch.setattr(
        CollisionScene, "_look", lambda self, q: asked.append(len(q)) or look(self, q)
    )
    for count in (0, 1, 7, 8, 9, 30):
        for some in (free[:count], np.concatenate([free[:count], shut[:2], free[:3], free])):
            asked.clear()
            assert scene.first_colliding(some) == count
            # eight at first, then twice as many each time
            assert sum(asked) <= min(max(8, 3 * (count + 1)), len(some))


def test_work_of_queries_is_counted_for_all_scenes_made_of_one():
    cell = crowded("mh24", seed=5)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=6, n=80)
    before = scene.queries
    hit = scene.collides(q)
    one = scene.queries - before
    # a call, all that are told without coal, and what coal looks at: all that collide but for those
    # that are surely deep in each other
    assert A_CALL + TOLD * len(q) <= one <= A_CALL + (TOLD + 1.0) * len(q)
    assert hit.any()
    scene.wider(0.01).collides(q)
    assert scene.queries - before >= 2.0 * (A_CALL + TOLD * len(q))


def test_configurations_may_be_read_only():
    scene = CollisionScene(v_job().cell)
    q = np.tile(v_job().process.home, (3, 1))
    q.setflags(write=False)
    assert not scene.collides(q).any()
    assert scene.colliding_pairs(q[0]) == []


def test_the_nearest_pair_is_the_least_of_all_pairs_that_keep_a_distance():
    cell = crowded("mh24", seed=8)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=9)
    found = nearest_pairs(scene, q)
    least = all_distances(scene, q)[:, scene.kept_apart].min(axis=1)
    np.testing.assert_allclose(found.distance, least, atol=5e-6)
    ends = np.linalg.norm(found.points[:, 0] - found.points[:, 1], axis=1)
    apart = least > 0.0
    np.testing.assert_allclose(ends[apart], least[apart], atol=1e-5)


def test_bounds_of_boxes_and_cylinders_apart_along_a_face_or_an_axis_are_exact():
    # two cubes on one joint-less chain: 0.3 m between faces, whatever lies across
    chain = Bodies(
        np.eye(4)[None],
        np.array([[0.0, 0.0, 1.0]]),
        np.zeros(3, dtype=np.int64),
        np.array(
            [pose(np.eye(3), np.array([x, y, 0.0])) for x, y in ((0, 0), (0.5, 0.15), (2, 0))]
        ),
        np.array([[0.1, 0.1, 0.1], [0.1, 0.1, 0.1], [0.4, 0.2, -1.0]]),
        np.ones(3, dtype=bool),
        np.zeros((3, 1)),
    )
    separation = Separation(chain, np.array([[0, 1], [0, 2]]))
    separation.near(np.zeros((1, 1)), np.full(2, 10.0))
    np.testing.assert_allclose(separation.apart, [0.3, 1.5], atol=1e-12)


def test_how_near_a_pair_may_be_is_asked_of_each_configuration():
    cell = crowded("mh24", seed=5)
    scene = CollisionScene(cell)
    q = configurations(cell.robot, seed=6, n=80)
    rng = np.random.default_rng(1)
    turned = rng.uniform(0.0, 0.2, q.shape) * rng.integers(0, 2, q.shape)
    apart = turned @ scene._separation.levers.T
    wanted = [
        scene._stay(one, np.ones(len(scene._pairs), dtype=bool), less)
        for one, less in zip(q, apart, strict=True)
    ]
    assert 0.05 < np.mean(wanted) < 0.95
    np.testing.assert_array_equal(scene.collides_throughout(q, turned), wanted)
