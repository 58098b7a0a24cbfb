"""Approach and retract: in feed along the pass, then along the contact normal or an arc."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import transform
from opl.job.load import load_job
from opl.motion.gradual import SPEED_RATIO, counted, gradual, largest_ratio
from opl.motion.leads import LEAD_SPACING, LEAD_TIME, RUN_TURN, LeadShape
from opl.motion.motion import MoveKind, Phase
from tests.support.jobs import opl, write_job
from tests.support.planned import small_job, small_problem, small_timed, tiny_problem, tiny_timed

SIDES = {MoveKind.APPROACH: -1.0, MoveKind.RETRACT: 1.0}
LENGTHS = st.floats(0.002, 0.3)
TURNS = st.floats(np.deg2rad(0.5), np.deg2rad(90.0))
RUNS = st.floats(0.001, 0.02)
STRETCHES = st.sampled_from(list(SIDES))
DIRECTIONS = st.sampled_from([1.0, -1.0])

LENGTH_MM, TURN_DEG, RUN_MM = 20.0, 60.0, 4.0
JOB = {
    "process.approach_turn_deg": TURN_DEG,
    "process.approach_run_mm": RUN_MM,
    "process.home_deg": [20, -30, -55, -5, 48, 120],
    "search.method": "recursive",
}


def shape_of(length, turn, run, feed=0.02, speed=0.05, slow=0.01):
    return LeadShape(length, turn, run, slow, feed, speed)


def integrated(shape, side, direction, n=20001):
    """Return points of a lead from its directions alone.

    Along the pass it turns evenly from all to nothing, off the wheel from nothing to all of its
    speed; off the wheel it turns evenly from the belt's direction to the end of its arc.
    """
    run = min(shape.run, shape.length)
    quarter = run * np.pi / 2.0
    s = np.linspace(0.0, quarter + shape.length - run, n)
    lifting = np.minimum(s / run, np.pi / 2.0)
    steps = np.diff(s)[:, None]

    def summed(slope):
        slope = slope.reshape(n, -1)
        return np.concatenate(
            [
                np.zeros((1, slope.shape[1])),
                np.cumsum((slope[1:] + slope[:-1]) / 2.0 * steps, axis=0),
            ]
        )

    along = summed(np.cos(lifting))[:, 0]
    off = summed(np.sin(lifting))[:, 0]
    if shape.turn == 0.0:
        normal = np.stack([np.zeros(n), -off], axis=1)
    else:
        angle = shape.turn * off / shape.length
        speed = np.sin(lifting)
        normal = summed(np.stack([side * speed * np.cos(angle), -speed * np.sin(angle)], axis=1))
    return s, np.column_stack([-side * direction * along, normal])


@settings(max_examples=50, deadline=None, derandomize=True)
@given(LENGTHS, st.one_of(st.just(0.0), TURNS), RUNS, STRETCHES, DIRECTIONS)
def test_a_lead_is_a_quarter_of_a_circle_and_then_leads_off(length, turn, run, stretch, direction):
    shape = shape_of(length, turn, run)
    offsets, places = shape.offsets(stretch, direction), shape.places()
    s, points = integrated(shape, SIDES[stretch], direction)
    assert places[-1] == pytest.approx(s[-1])
    for axis in range(3):
        expected = np.interp(places, s, points[:, axis])
        np.testing.assert_allclose(offsets[:, axis], expected, atol=1e-6 * length)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(LENGTHS, st.one_of(st.just(0.0), TURNS), RUNS, st.floats(0.001, 0.3), st.floats(0.01, 0.5))
def test_configurations_of_a_lead_are_as_dense_as_speeds_and_bends_ask(
    length, turn, run, feed, speed
):
    shape = shape_of(length, turn, run, feed, speed)
    steps = np.diff(shape.places(), prepend=0.0)
    assert (steps > 0.0).all()
    # the last one may have taken up what is left
    most = np.full(len(steps), LEAD_SPACING)
    most[shape.places() - steps < shape.radius * np.pi / 2.0] = shape.radius * RUN_TURN
    most = np.minimum(most, LEAD_SPACING)
    most[-1] *= 1.5
    assert (steps <= most * (1.0 + 1e-9)).all()
    assert steps[0] <= 1.5 * feed * LEAD_TIME
    # near the contact no move takes longer than a lead's should, and none is much shorter
    grown = feed * SPEED_RATIO ** np.arange(len(steps))
    assert (steps <= 1.5 * np.maximum(grown, feed) * LEAD_TIME * (1.0 + 1e-9)).all()


@settings(max_examples=100, deadline=None, derandomize=True)
@given(
    LENGTHS,
    st.one_of(st.just(0.0), TURNS),
    RUNS,
    STRETCHES,
    DIRECTIONS,
    st.floats(-70.0, 70.0),
)
def test_the_ground_point_moves_away_from_the_wheel_all_the_way(
    length, turn, run, stretch, direction, t
):
    wheel = small_job().cell.wheel
    offsets = shape_of(length, turn, run).offsets(stretch, direction)
    corners = np.concatenate([np.zeros((1, 3)), offsets])
    # where the point was ground, seen along the tangent plane: lifted by as much as it has moved
    lifted = -corners[:, 2]
    assert (np.diff(lifted) > 0.0).all()
    # along the pass it moves on by the run at the most, and never back
    moved_on = -SIDES[stretch] * direction * corners[:, 0]
    assert (np.diff(moved_on) >= -1e-15).all() and moved_on[-1] == pytest.approx(min(run, length))
    distance = wheel.signed_distance(transform(wheel.T_contact0_contact(t), corners))
    assert (distance[1:] > 0.0).all()


@settings(max_examples=100, deadline=None, derandomize=True)
@given(RUNS, st.floats(1e-5, 1e-3))
def test_the_belt_is_left_within_a_stated_way(run, penetration):
    # what the documentation says of how far beyond the last point the belt may grind
    run = max(run, penetration)
    _, points = integrated(shape_of(0.3, 0.0, run), 1.0, 1.0)
    beyond = np.interp(penetration, -points[:, 2], -points[:, 0])
    assert beyond == pytest.approx(np.sqrt((2.0 * run - penetration) * penetration), rel=1e-2)


# in motion


def runs_of(timed):
    """Yield the moves from rest to rest, the moves of a pass with both of its leads."""
    motion = timed.motion
    for index in range(motion.pass_index.max() + 1):
        yield [
            move
            for phase, moves in motion.runs()
            for move in moves
            if phase is not Phase.FREE and motion.pass_index[move] == index
        ]


def speeds_of(problem, timed, moves):
    """Return the speed of each move over the part or through the air, from positions alone."""
    motion, cell = timed.motion, problem.cell
    p = forward_kinematics(cell.robot, motion.q)[:, :3, 3]
    arc = np.interp(motion.cutter_point, np.arange(len(problem.points)), problem.points.arc_length)
    found = []
    for move in moves:
        ground = abs(arc[move] - arc[move - 1])
        way = np.linalg.norm(p[move] - p[move - 1]) if np.isnan(ground) else ground
        found.append(way / timed.duration[move])
    return np.array(found)


@pytest.mark.parametrize("of", [(small_problem, small_timed), (tiny_problem, tiny_timed)])
def test_speeds_change_gradually_from_lift_off_to_touch_down(of):
    problem, timed = of[0](), of[1]()
    feed = problem.process.feed
    for moves in runs_of(timed):
        speed = np.maximum(speeds_of(problem, timed, moves), 0.2 * feed)
        ratio = speed[1:] / speed[:-1]
        # a slower one that takes less than 0.04 s counts the less the shorter it is
        slower = np.where(ratio < 1.0, timed.duration[moves][1:], timed.duration[moves][:-1])
        ratio = np.maximum(ratio, 1.0 / ratio) * 0.2 ** np.maximum(1.0 - slower / 0.04, 0.0)
        # where the contact pivots faster than the ground point can follow, its speed says nothing
        change = np.abs(np.diff(timed.motion.contact_position, prepend=np.nan))[moves]
        pivots = (
            change / problem.process.contact_speed * 0.4 * feed
            > speeds_of(problem, timed, moves) * timed.duration[moves]
        )
        counted = ~pivots[1:] & ~pivots[:-1]
        assert counted.sum() > 0.7 * len(counted)
        assert ratio[counted].max() <= SPEED_RATIO
        phases = [timed.motion.phase[move] for move in moves]
        onto = phases.index(Phase.GRINDING) - 1  # the move that ends on the wheel
        off = phases.index(Phase.RETRACTING)
        assert speed[[onto, off]].max() <= feed * (1.0 + 1e-9)
        near = [k for k, phase in enumerate(phases) if phase is not Phase.GRINDING]
        near = [k for k in near if min(abs(k - onto), abs(k - off)) < 4]  # within 10 mm of way
        assert speed[near].max() <= max(feed, problem.process.approach_speed) * (1.0 + 1e-9)


def moves_lasting(shortest):
    """Draw ways in [m] and times in [s]."""
    move = st.tuples(st.floats(1e-6, 0.05), st.floats(shortest, 2.0))
    return st.lists(move, min_size=1, max_size=30).map(lambda moves: np.array(moves).T)


FEEDS = st.floats(0.005, 0.3)


COUNTS = st.lists(st.floats(0.0, 1.0), min_size=30, max_size=30).map(np.array)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(moves_lasting(0.004), COUNTS, FEEDS)
def test_speeds_of_neighbours_differ_by_a_step_at_the_most(moves, counts, feed):
    distance, seconds = moves
    for weights in (np.ones(len(seconds)), np.round(counts[: len(seconds)])):
        found = gradual(distance, seconds, weights, feed)
        assert (found >= seconds * (1.0 - 1e-12)).all()
        np.testing.assert_allclose(found[weights == 0.0], seconds[weights == 0.0])
        assert largest_ratio(distance, found, weights, feed) <= SPEED_RATIO


@settings(max_examples=200, deadline=None, derandomize=True)
@given(moves_lasting(0.04), FEEDS)
def test_only_the_faster_of_two_neighbours_is_slowed(moves, feed):
    distance, seconds = moves
    # none is slowed that no slow one is near to: the largest speeds of all that keep the ratio
    speed = np.maximum(distance / seconds, 0.2 * feed)
    k = np.arange(len(speed))
    cone = (speed[None] * 1.28 ** np.abs(k[:, None] - k)).min(axis=1)
    expected = np.maximum(seconds, distance / cone)
    found = gradual(distance, seconds, np.ones(len(seconds)), feed)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(moves_lasting(0.002), COUNTS, FEEDS, st.randoms(use_true_random=False))
def test_a_micrometre_hardly_changes_times(moves, counts, feed, random):
    (distance, seconds), counts = moves, counts[: moves.shape[1]]
    off = np.array([random.uniform(-1e-6, 1e-6) for _ in distance])
    nudged = np.maximum(distance + off, 0.0)
    one, other = gradual(distance, seconds, counts, feed), gradual(nudged, seconds, counts, feed)
    # a speed counts as 0.2 of the feed at least; who is held against one that lasts s of 0.04 s is
    # at 0.2 ** (s - 1) of it at the least, so what s leaves of the way weighs as much less
    shares = np.linspace(0.05, 1.0, 100)
    least = (shares * 0.04 * feed * 0.2**shares).min()
    assert np.abs(np.log(one / other)).max() <= 2e-6 / least


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.floats(0.0, 1.2), st.floats(1e-3, 2.0), FEEDS)
def test_the_slower_the_ground_point_pivots_the_less_its_speed_counts(share, least, feed):
    weight, nudged = counted(
        least * feed * np.array([share, share + 1e-6]), np.full(2, least), feed
    )
    assert 0.0 <= weight <= nudged <= weight + 1e-5
    if share >= 0.4:
        assert weight == 1.0
    elif share <= 0.2:
        assert weight == 0.0


# a whole job


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Plan, prove and write a program with arcs; return its folder."""
    home = tmp_path_factory.mktemp("arc")
    job = write_job(home, JOB)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("opl.run.stages.draw_charts", lambda *_: {})
        ended = opl("run", job, "--out", home / "out")
    assert ended.status == 0, ended.err
    return home


def test_a_program_comes_and_goes_on_arcs(planned):
    wheel = load_job(planned / "job.yaml").cell.wheel
    with (planned / "out" / "V_SHAPE.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    flange = np.array([[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in rows])
    kinds = [row["kind"] for row in rows]
    shape = shape_of(1e-3 * LENGTH_MM, np.deg2rad(TURN_DEG), 1e-3 * RUN_MM)
    for kind, side in (("approach", -1.0), ("retract", 1.0)):
        lead = [k for k, one in enumerate(kinds) if one == kind]
        if kind == "approach":  # from the contact away; the free move ends at the far end
            lead = [lead[0] - 1, *lead][::-1]
        touch = lead[0] - int(side)
        # cut short where the straight free move from there is free
        assert len(lead) > 1 and rows[touch]["kind"] == "grind"
        R = wheel.T_base_contact(float(rows[touch]["t"]))[:3, :3]
        offsets = 1e3 * shape.offsets(MoveKind(kind), 1.0)[: len(lead)]
        # pulses and printed digits
        np.testing.assert_allclose((flange[lead] - flange[touch]) @ R, offsets, atol=0.02)


def test_a_program_with_arcs_is_proven_from_its_file(planned):
    ended = opl("verify", planned / "job.yaml", planned / "out" / "V_SHAPE.JBI")
    assert ended.status == 0, ended.err


@pytest.mark.parametrize("turn", [0, 90])
def test_arcs_that_the_job_does_not_ask_for_are_refused(planned, tmp_path, turn):
    job = write_job(tmp_path, {**JOB, "process.approach_turn_deg": turn})
    program = tmp_path / "V_SHAPE.JBI"
    program.write_bytes((planned / "out" / "V_SHAPE.JBI").read_bytes())
    ended = opl("verify", job, program)
    assert ended.status == 4
    assert "part and wheel" in ended.err


@pytest.mark.parametrize("turn", [-1, 91])
def test_a_turn_out_of_range_is_refused_by_key(tmp_path, turn):
    ended = opl("check", write_job(tmp_path, {"process.approach_turn_deg": turn}))
    assert ended.status == 2
    assert "process.approach_turn_deg" in ended.err


def test_a_job_that_does_not_say_leads_straight(tmp_path):
    process = load_job(write_job(tmp_path)).process
    assert process.approach_turn == 0.0
    said = load_job(write_job(tmp_path, {"process.approach_turn_deg": 0})).process
    np.testing.assert_array_equal(said.home, process.home)
    assert replace(said, home=None) == replace(process, home=None)
