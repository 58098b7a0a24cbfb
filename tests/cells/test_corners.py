"""Corners as a controller may round them, against closed forms and dense samples of blends."""

import re
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import opl.proof.too_wide
from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import load_robot
from opl.files.beside import Beside
from opl.geometry.frames import inverse
from opl.motion.fewest import ChainRule, fewest
from opl.motion.line_error import line_errors, screws_of
from opl.motion.motion import Motion, MoveKind
from opl.planning.positions import PositionRule, on_wheel_runs, with_fewest_positions
from opl.program.played import Corner, Playback, ReadMove, SpeedUnit, WrittenSpeed
from opl.proof.corners import contact_errors, corner_proof
from opl.proof.read_back import position_rule
from opl.proof.roundings import MOST_CUT, roundings, tool_points_of, zones_of
from opl.verification.contact import contact_positions
from opl.verification.triangles import FINEST, Triangles
from opl.verification.world import World
from tests.support.bare_cells import bare_cell, block, with_obstacle
from tests.support.planned import small_job, small_motion, small_problem


def free_motion(q):
    return Motion.off_wheel(np.asarray(q, dtype=float), MoveKind.HOME, -1)


@pytest.mark.parametrize("zone", [0.002, 0.05, 0.4])
def test_a_zone_cuts_off_as_much_as_the_closed_form_says(zone):
    """Axis 1 moves the flange on a circle: the chord of the angle that is cut off is the zone."""
    robot = load_robot("mh24")
    q = np.zeros((3, 6))
    q[1, 0], q[2] = 1.0, [1.0, 0.0, 0.0, 0.0, 0.0, 2.0]

    def tool_points(configurations):
        return forward_kinematics(robot, configurations)[..., :3, 3]

    radius = np.linalg.norm(tool_points(q)[0, :2])
    (corner,) = roundings(free_motion(q), np.array([0.0, zone, 0.0]), tool_points)
    angle = 2.0 * np.arcsin(zone / (2.0 * radius))
    # the flange stays where it is when the last axis turns: nothing but half of the move limits it
    assert corner.cuts == pytest.approx((min(angle, MOST_CUT), MOST_CUT), rel=1e-3)


def test_no_corner_is_rounded_where_the_robot_stops_and_half_of_a_move_where_nobody_knows():
    q = np.cumsum(np.eye(6)[:5], axis=0)
    zones = np.array([np.inf, 0.0, np.inf, 0.0, np.inf])
    (corner,) = roundings(free_motion(q), zones, lambda configurations: configurations[..., :3])
    assert corner.k == 2 and corner.cuts == (MOST_CUT, MOST_CUT)
    triangle, off = corner.triangle()
    np.testing.assert_allclose(triangle, [(q[1] + q[2]) / 2.0, q[2], (q[2] + q[3]) / 2.0])
    np.testing.assert_allclose(off, 0.0, atol=1e-12)


@cache
def few_positions():
    """Return the small motion with the fewest positions for exact corners."""
    problem, motion, job = small_problem(), small_motion(), small_job()
    nothing = PositionRule(1e-4, 5e-5, 0.0, 0.0, tool_points_of(job), lambda motion: ())
    q, written = motion.q.copy(), np.array(motion.written)
    screws = screws_of(job.cell.robot)
    for first, run in on_wheel_runs(job.cell, problem.points, motion, job.process, nothing):
        chain = fewest(screws, run, ChainRule(0.0))
        written[first : first + len(run.q)] = False
        written[first + chain] = True
        for start, end in pairwise(chain):
            share = line_errors(screws, run, start, end)[0][:, None]
            q[first + start + 1 : first + end] = run.q[start] + share * (run.q[end] - run.q[start])
    return replace(motion, q=q, written=written)


@cache
def rounded(zone):
    motion = few_positions()
    zones = np.where(motion.on_wheel[motion.positions], zone, 0.0)
    corners = list(roundings(motion, zones, tool_points_of(small_job())))
    errors = contact_errors(small_job(), small_problem().points, motion, corners)
    return [(corner, told[-1]) for corner, told in zip(corners, errors, strict=True)]


def off_by_hand(corner, left, begun):
    """Return how far a configuration of a rounding is from the wheel, from places close together.

    Shares of both moves are left and begun; the place on the pass is that which comes to the edge,
    or where both moves add up to.
    """
    job, points, wheel = small_job(), small_problem().points, small_job().cell.wheel
    place = corner.before.place_at(left) + corner.after.place_at(begun) - corner.before.place[0]
    q = corner.before.q_at(left) + corner.after.q_at(begun) - corner.before.q[0]
    T = inverse(wheel.T_base_contact0) @ forward_kinematics(job.cell.robot, q)
    pass_places = points.pass_index == points.pass_index[int(corner.before.place[0])]
    first, last = np.flatnonzero(pass_places)[[0, -1]]
    rolls, reach = False, 0.7
    for _ in range(2):  # the second time a hundred times closer together
        near = np.clip(place + np.linspace(-reach, reach, 701), first, last)
        Ts = T @ job.cell.T_flange_workpiece @ points.frames_at(near)
        t = contact_positions(wheel, Ts)
        seen = (inverse(wheel.T_contact0_contact(t)) @ Ts)[:, :3, 3]
        rolls |= abs(t[350]) > wheel.flat_end
        at = int(np.abs(seen[:, 0]).argmin()) if rolls else 350
        place, reach = near[at], reach / 100.0
    return max(abs(seen[at, 2]), abs(float(wheel.signed_distance(Ts[at, :3, 3]))))


@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.02, 1.0),
    st.sampled_from(["chord", "parabola", "arc", "late"]),
    st.sampled_from([np.inf, 0.004]),
)
def test_no_blend_leaves_more_contact_error_than_is_told(which, depth, blend, zone):
    corners = [one for one in rounded(zone) if all(one[0].grinds)]
    corner, told = corners[which % len(corners)]
    u = np.linspace(0.02, 0.98, 9)
    left, begun = {
        "chord": (1.0 - u, u),
        "parabola": ((1.0 - u) ** 2, u**2),
        "arc": (1.0 - np.sin(u * np.pi / 2.0), 1.0 - np.cos(u * np.pi / 2.0)),
        "late": ((1.0 - u) ** 3, u),
    }[blend]
    assert (left + begun <= 1.0 + 1e-12).all()
    first, second = corner.cuts
    worst = max(
        off_by_hand(corner, depth * first * a, depth * second * b)
        for a, b in zip(left, begun, strict=True)
    )
    assert worst <= told + 1e-6


def test_narrower_zones_leave_less():
    wide, narrow = ({c.k: error for c, error in rounded(zone)} for zone in (np.inf, 0.004))
    assert wide.keys() == narrow.keys()
    assert all(narrow[k] <= wide[k] + 2e-6 for k in wide)
    assert any(narrow[k] < 0.8 * wide[k] for k in wide)


def test_what_is_known_of_the_last_motion_changes_no_corner(monkeypatch):
    job, points, part = small_job(), small_problem().points, small_problem().scene.part
    motion, random = few_positions(), np.random.default_rng(0)
    looks = []
    contact = opl.proof.too_wide.contact_errors
    monkeypatch.setattr(
        opl.proof.too_wide,
        "contact_errors",
        lambda *given: looks.append(len(given[-1])) or contact(*given),
    )

    def seen(tell, tried):
        looks.clear()
        return list(tell(tried)), sum(looks)

    kept = opl.proof.too_wide.TooWide(job, points, part, np.inf)
    found = []
    for turn in range(6):
        written = np.array(motion.written)
        others = np.flatnonzero(motion.on_wheel & ~written)
        written[random.choice(others, turn)] = True
        tried = replace(motion, written=written)
        corners, looked_at = seen(kept, tried)
        anew, all_of_them = seen(opl.proof.too_wide.TooWide(job, points, part, np.inf), tried)
        assert corners == anew
        assert looked_at == all_of_them if turn == 0 else looked_at < all_of_them
        assert seen(kept, tried) == (corners, 0)
        found.append(tuple(corners))
    assert all(found)
    assert len(set(found)) > 1


@pytest.mark.parametrize(("share", "wide"), [(0.985, False), (0.995, True)])
def test_corners_leave_a_little_of_the_error_to_the_proof_of_the_file(monkeypatch, share, wide):
    job, points, part = small_job(), small_problem().points, small_problem().scene.part

    def errors(_job, _points, _motion, corners):
        return np.full((len(corners), 1), share * job.search.max_contact_error)

    monkeypatch.setattr(opl.proof.too_wide, "contact_errors", errors)
    monkeypatch.setattr(
        opl.proof.too_wide.TooWide, "_deep", lambda _self, corners: np.zeros(len(corners), bool)
    )
    found = list(opl.proof.too_wide.TooWide(job, points, part, np.inf)(few_positions()))
    assert bool(found) == wide


def straight_moves(radius, count):
    """Return straight moves, each with an arc at its end."""
    corner = Corner(1e3 * radius, f"CR={1e3 * radius:.1f}", radius, arc=True)
    speed = WrittenSpeed(SpeedUnit.TOOL_POINT, 0.02, "V=20.0")
    return [
        ReadMove(np.zeros(6), True, speed, corner, "0", f"line {k}", np.zeros(6))
        for k in range(count)
    ]


@pytest.mark.parametrize(("turn", "factor"), [(5, 1), (90, 1), (120, 3**0.5), (150, 2 + 3**0.5)])
def test_an_arc_touches_its_lines_no_farther_from_the_corner_than_is_taken(turn, factor):
    q = np.zeros((3, 6))
    angle = np.deg2rad(turn)
    q[1, 0], q[2, :2] = 2.0, [2.0 + 3.0 * np.cos(angle), 3.0 * np.sin(angle)]
    moves = straight_moves(0.3, 3)
    found = zones_of(moves, q, lambda configurations: configurations[..., :3])
    np.testing.assert_allclose(found[1], 0.3 * factor)
    moves[2] = replace(moves[2], straight=False)  # next to a joint move nobody knows
    assert np.isinf(zones_of(moves, q, lambda configurations: configurations[..., :3])[1])


def test_positions_are_the_same_whoever_chooses_them():
    job, points, scene = small_job(), small_problem().points, small_problem().scene
    rule = position_rule(job, points, scene.part)
    given = scene, points, small_motion(), job.process, rule
    alone, corners = with_fewest_positions(*given)
    assert corners == list(rule.too_wide(alone))
    assert 0 < alone.written.sum() < len(alone)
    with Beside(True) as beside:
        beside.start(job, points, scene, scene.part)
        shared, same_corners = with_fewest_positions(*given, beside)
    assert corners == same_corners
    np.testing.assert_array_equal(alone.q, shared.q)
    np.testing.assert_array_equal(alone.written, shared.written)


def test_a_radius_too_wide_is_refused_with_the_error_and_the_radius_that_would_do():
    job, points, motion = small_job(), small_problem().points, few_positions()
    positions = motion.positions
    on_wheel = motion.on_wheel[positions]
    stop = Corner(0.0, "PL=0")

    def proof(radius):
        moves = [
            move if on else replace(move, corner=stop)
            for move, on in zip(straight_moves(radius, len(positions)), on_wheel, strict=True)
        ]
        q = motion.q[positions]
        playback = Playback(q, np.zeros(len(q)), np.arange(len(q)), tuple(moves))
        found = corner_proof(job, points, motion, playback)
        told = {one.where: one.message for one in found.findings if "ground point" in one.message}
        return found, told

    found, told = proof(1.0)
    first, *_ = told.values()
    assert first.startswith("CR=1000.0 (zone 1000 mm) leaves the ground point ")
    assert f" {1e3 * found.max_contact_error:.3f} mm from the wheel" in first
    assert f"{1e3 * found.allowed:g} mm allowed; a corner radius of" in first
    radii = [float(re.search(r"radius of ([0-9.]+) mm would do", one)[1]) for one in told.values()]
    narrower, others = proof(1e-3 * min(radii))
    assert narrower.max_contact_error < found.max_contact_error
    assert not told.keys() & others.keys()


@pytest.mark.parametrize("seed", range(6))
def test_a_triangle_is_free_exactly_where_all_of_it_is(seed):
    random = np.random.default_rng(seed)
    cell = bare_cell(block((0.1, 0.06, 0.04)), clearance=0.01)
    start = np.array([0.2, -0.3, -0.4, 0.1, 0.5, 0.0])
    corners = start + random.normal(scale=0.08, size=(3, 6))
    middle = corners.mean(axis=0)
    T = forward_kinematics(cell.robot, middle) @ cell.T_flange_workpiece
    p = T[:3, 3] + random.normal(size=3) * 0.09
    cell = with_obstacle(cell, p, (0.02, 0.02, 0.02))
    with World(cell) as world:
        found = Triangles(world).too_near(corners, np.zeros(6), False)
        pairs = world.pairs()
        nearest = {}
        for weights in random.dirichlet([0.7, 0.7, 0.7], size=400):
            world.move_to(weights @ corners)
            for k, pair in enumerate(pairs):
                distance = world.distance(pair.first, pair.second, 0.3) - pair.rounding
                nearest[k] = min(nearest.get(k, np.inf), distance)
    missing = max(pair.clearance - nearest[k] for k, pair in enumerate(pairs))
    if found is None:
        assert missing <= FINEST
    else:
        assert found.distance < found.needed and missing > -0.01


@pytest.mark.parametrize("seed", range(4))
def test_what_was_measured_at_triangles_before_hides_nothing(seed):
    random = np.random.default_rng(seed)
    cell = bare_cell(block((0.1, 0.06, 0.04)), clearance=0.01)
    way = np.cumsum(random.normal(scale=0.03, size=(30, 6)), axis=0)
    triangles = np.array([0.2, -0.3, -0.4, 0.1, 0.5, 0.0]) + way[:, None]
    triangles = triangles + random.normal(scale=0.02, size=(30, 3, 6))
    T = forward_kinematics(cell.robot, triangles[15].mean(axis=0)) @ cell.T_flange_workpiece
    cell = with_obstacle(cell, T[:3, 3] + np.array([0.0, 0.0, 0.09]), (0.02, 0.02, 0.02))
    asked = []
    with World(cell) as world:
        measured = world.distance
        world.distance = lambda *given: asked.append(given) or measured(*given)
        following, found = Triangles(world), []
        for corners in triangles:
            found.append(following.too_near(corners, np.zeros(6), False))
        n_following = len(asked)
        for corners, known in zip(triangles, found, strict=True):
            following.forget()
            alone = following.too_near(corners, np.zeros(6), False)
            assert (known is None) == (alone is None)
            assert known is None or known.names == alone.names
    assert None in found and any(found)
    assert n_following < len(asked) - n_following
