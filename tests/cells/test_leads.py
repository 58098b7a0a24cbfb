"""Approach and retract: straight along the contact normal, or an arc along the belt."""

import csv
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.geometry.frames import transform
from opl.job.load import load_job
from opl.motion.leads import LEAD_SPACING, LEAD_TURN, lead_count, lead_offsets
from opl.motion.motion import MoveKind
from tests.support.jobs import opl, write_job
from tests.support.planned import small_job

SIDES = {MoveKind.APPROACH: -1.0, MoveKind.RETRACT: 1.0}
LENGTHS = st.floats(0.002, 0.3)
TURNS = st.floats(np.deg2rad(0.5), np.deg2rad(90.0))
STRETCHES = st.sampled_from(list(SIDES))

LENGTH_MM, TURN_DEG = 20.0, 60.0
JOB = {
    "process.approach_turn_deg": TURN_DEG,
    "process.home_deg": [20, -30, -55, -5, 48, 120],
    "search.method": "recursive",
}


def integrated(length, turn, side, n=4001):
    """Return points of the arc, from its direction alone: along the belt, then turned evenly."""
    s = np.linspace(0.0, length, n)
    direction = np.stack([side * np.cos(turn * s / length), -np.sin(turn * s / length)], axis=-1)
    steps = (direction[1:] + direction[:-1]) / 2.0 * (s[1] - s[0])
    return s, np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


@settings(max_examples=50, deadline=None, derandomize=True)
@given(LENGTHS, TURNS, STRETCHES)
def test_an_arc_has_its_length_and_leaves_along_the_belt(length, turn, stretch):
    offsets = lead_offsets(length, turn, stretch)
    s, points = integrated(length, turn, SIDES[stretch])
    at = length * np.arange(1, len(offsets) + 1) / len(offsets)
    np.testing.assert_allclose(offsets[:, 0], 0.0)
    for axis in (0, 1):
        np.testing.assert_allclose(
            offsets[:, axis + 1], np.interp(at, s, points[:, axis]), atol=1e-6 * length
        )


@settings(max_examples=50, deadline=None, derandomize=True)
@given(LENGTHS, TURNS, STRETCHES)
def test_chords_of_an_arc_are_short_and_even(length, turn, stretch):
    offsets = lead_offsets(length, turn, stretch)
    chords = np.diff(offsets, axis=0, prepend=np.zeros((1, 3)))
    step, n = turn / len(offsets), len(offsets)
    assert step <= LEAD_TURN * (1.0 + 1e-6)
    assert np.linalg.norm(chords, axis=1).max() <= LEAD_SPACING
    # the tangent at the contact is y: a chord lies half a step beyond the one where it begins
    leaning = np.arctan2(-chords[:, 2], SIDES[stretch] * chords[:, 1])
    np.testing.assert_allclose(leaning, (np.arange(n) + 0.5) * step, atol=1e-9)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(LENGTHS, st.one_of(st.just(0.0), TURNS), STRETCHES, st.floats(-70.0, 70.0))
def test_the_ground_point_moves_away_from_the_wheel_all_the_way(length, turn, stretch, t):
    wheel = small_job().cell.wheel
    corners = np.concatenate([np.zeros((1, 3)), lead_offsets(length, turn, stretch)])
    fraction = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    on_the_way = [a + fraction * (b - a) for a, b in pairwise(corners)]
    way = np.concatenate([*on_the_way, corners[-1:]])
    distance = wheel.signed_distance(transform(wheel.T_contact0_contact(t), way))
    assert distance[0] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(distance) > 0.0).all()


@pytest.mark.parametrize("stretch", SIDES)
@pytest.mark.parametrize(("length", "count"), [(0.05, 10), (0.0021, 1), (0.0501, 11)])
def test_without_a_turn_a_lead_is_straight_along_the_normal(stretch, length, count):
    offsets = lead_offsets(length, 0.0, stretch)
    expected = np.zeros((count, 3))
    expected[:, 2] = [-length * k / count for k in range(1, count + 1)]
    np.testing.assert_array_equal(offsets, expected)


@pytest.mark.parametrize(
    ("length", "turn_deg", "count"), [(0.02, 60, 12), (0.2, 60, 40), (0.02, 61, 13), (0.01, 1, 2)]
)
def test_an_arc_is_cut_by_length_and_turn(length, turn_deg, count):
    assert lead_count(length, np.deg2rad(turn_deg)) == count


# a whole job


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Plan, prove and write a program with arcs; return its folder."""
    home = tmp_path_factory.mktemp("arc")
    job = write_job(home, JOB)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("opl.run.stages.draw_charts", lambda planned: {})
        ended = opl("run", job, "--out", home / "out")
    assert ended.status == 0, ended.err
    return home


def test_a_program_comes_and_goes_on_arcs(planned):
    wheel = load_job(planned / "job.yaml").cell.wheel
    with (planned / "out" / "V_SHAPE.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    flange = np.array([[float(row[f"{axis}_mm"]) for axis in "xyz"] for row in rows])
    kinds = [row["kind"] for row in rows]
    radius = LENGTH_MM / np.deg2rad(TURN_DEG)
    for kind, side in (("approach", -1.0), ("retract", 1.0)):
        lead = [k for k, one in enumerate(kinds) if one == kind]
        if kind == "approach":  # from the contact away; the free move ends at the far end
            lead = [lead[0] - 1, *lead][::-1]
        touch = lead[0] - int(side)
        # cut short where the straight free move from there is free
        assert 1 < len(lead) <= 12 and rows[touch]["kind"] == "grind"
        R = wheel.T_base_contact(float(rows[touch]["t"]))[:3, :3]
        x, y, z = ((flange[lead] - flange[touch]) @ R).T
        angle = np.deg2rad(5.0) * np.arange(1, len(lead) + 1)
        np.testing.assert_allclose(x, 0.0, atol=0.02)  # pulses and printed digits
        np.testing.assert_allclose(y, side * radius * np.sin(angle), atol=0.02)
        np.testing.assert_allclose(z, -radius * (1.0 - np.cos(angle)), atol=0.02)


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
