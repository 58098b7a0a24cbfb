import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest

from opl.cell.robot_loading import load_robot
from opl.motion.path import GrindingPath
from opl.report import chart, pictures
from opl.report.canvas import png, svg

SVG = "{http://www.w3.org/2000/svg}"
NAMES = ("free", "out of reach", "beyond joint limits", "part cuts into wheel", "robot collides")
LOWER, UPPER = np.deg2rad([[-180.0] * 6, [180.0] * 6])


def contact_arguments(n_passes=5, n_points=60, n_positions=140, state=3):
    """A zigzag of passes over a blocked disc, with a node between any two cutter points."""
    pass_index = np.repeat(np.arange(n_passes), n_points)
    across = np.tile(np.linspace(-1.0, 1.0, n_points), n_passes)
    t = np.linspace(-70.0, 70.0, n_positions)
    blocked = np.hypot(across[:, None], t / 70.0) < 0.4
    place = np.arange(0.0, len(pass_index) - 0.5, 0.5)
    return {
        "title": "v_shape: where the part touches the wheel",
        "contact_positions": t,
        "states": np.where(blocked, state, 0).astype(np.uint8),
        "state_names": NAMES,
        "pass_index": pass_index,
        "flat_end": 25.0,
        "path": GrindingPath(
            np.zeros(n_passes, dtype=int),
            np.zeros((len(place), 6)),
            40.0 + 5.0 * np.sin(place),
            place,
            pass_index[place.astype(int)],
        ),
    }


def joint_arguments(n_passes=5, n_points=60, fixed=True):
    pass_index = np.repeat(np.arange(n_passes), n_points)
    place = np.arange(0.0, len(pass_index) - 0.5, 0.5)
    swing = np.deg2rad([10.0, 20.0, 5.0, 60.0, 30.0, 0.0])
    return {
        "title": "v_shape: joint angles along the path",
        "robot": replace(load_robot("mh24"), lower=LOWER, upper=UPPER),
        "path": GrindingPath(
            np.zeros(n_passes, dtype=int),
            np.sin(place)[:, None] * swing,
            np.zeros(len(place)),
            place,
            pass_index[place.astype(int)],
        ),
        "fixed_q": 2.0 * np.cos(np.arange(len(pass_index)))[:, None] * swing if fixed else None,
        "pass_index": pass_index,
    }


def contact_chart(**arguments):
    return svg(pictures.contact_chart(**arguments), arguments["title"])


def joint_chart(**arguments):
    return svg(pictures.joint_chart(**arguments), arguments["title"])


@cache
def contact_svg(*size):
    return contact_chart(**contact_arguments(*size))


@cache
def joint_svg(*size):
    return joint_chart(**joint_arguments(*size))


def texts(svg):
    """All that can be read in a picture; parsing it is the test that it is well-formed."""
    return ["".join(text.itertext()) for text in ElementTree.fromstring(svg).iter(f"{SVG}text")]


def n_lines(svg, name):
    """How many separate pieces the line of this name is drawn in."""
    group = next(g for g in ElementTree.fromstring(svg).iter(f"{SVG}g") if g.get("id") == name)
    return [path.get("d").count("M") for path in group.iter(f"{SVG}path")][-1]


@pytest.mark.parametrize(
    ("chart", "arguments", "svg"),
    [(contact_chart, contact_arguments, contact_svg), (joint_chart, joint_arguments, joint_svg)],
)
def test_same_input_gives_same_bytes_whatever_matplotlib_is_set_to(chart, arguments, svg):
    first = svg()
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "svg.fonttype": "path"}):
        again = chart(**arguments())
        assert matplotlib.rcParams["font.size"] == 30
    assert first == again
    assert "<dc:date>" not in first


def test_a_chart_is_a_png_too_with_the_same_bytes_every_time():
    first, again = (png(pictures.contact_chart(**contact_arguments())) for _ in range(2))
    assert first == again and first[:8] == b"\x89PNG\r\n\x1a\n" and b"Matplotlib" not in first


def test_title_is_shown_as_it_is():
    title = "a<&b> $x$: größte"
    assert title in texts(contact_chart(**{**contact_arguments(), "title": title}))
    assert title in texts(joint_chart(**{**joint_arguments(), "title": title}))


def test_pictures_do_not_load_pyplot():
    code = "import sys, opl.report.pictures; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("state", [1, 2, 3, 4])
def test_legend_shows_the_states_that_occur_and_no_others(state):
    shown = texts(contact_chart(**contact_arguments(state=state)))
    listed = {name for name in NAMES for text in shown if text.startswith(name)}
    assert listed == {"free", NAMES[state]}
    assert "found path" in shown


def test_shares_neither_hide_a_few_nodes_nor_claim_all():
    arguments = contact_arguments()
    arguments["states"] = np.zeros((300, 140), dtype=np.uint8)
    assert "free 100 %" in texts(contact_chart(**arguments))
    arguments["states"][7, 7] = 4
    shown = texts(contact_chart(**arguments))
    assert "free > 99 %" in shown and "robot collides < 1 %" in shown


def test_passes_are_counted_from_one():
    shown = texts(contact_svg())
    assert [text for text in shown if text.startswith("pass")] == [f"pass {k}" for k in range(1, 6)]


def test_many_passes_share_the_room_for_their_numbers():
    shown = texts(contact_svg(80, 5))
    assert "pass 1" in shown and "pass 2" not in shown


def test_zones_of_the_wheel_are_named_where_they_are():
    zones = {"left edge", "flat", "right edge"}
    assert zones <= set(texts(contact_svg()))
    only_flat = {**contact_arguments(), "flat_end": 80.0}
    assert zones & set(texts(contact_chart(**only_flat))) == {"flat"}


@pytest.mark.parametrize("size", [(5, 60), (1, 2), (1, 1), (3, 1)])
def test_path_is_one_line_per_pass_be_it_of_one_point(size):
    assert n_lines(contact_svg(*size), "found") == size[0]
    for joint in range(6):
        assert n_lines(joint_svg(*size), f"found_{joint}") == size[0]
        assert n_lines(joint_svg(*size), f"fixed_{joint}") == size[0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [(1, 2, 2), (2, 2, 1)])
def test_few_contact_positions_are_drawn(size):
    assert "free" in " ".join(texts(contact_svg(*size)))


def test_ranges_are_in_degrees():
    shown = texts(joint_svg())
    assert {"S", "L", "U", "R", "B", "T"} <= set(shown)
    assert "range 0.0 deg (fixed 0.0 deg)" in shown
    ranges = [re.fullmatch(r"range (.+) deg \(fixed (.+) deg\)", text) for text in shown]
    found, fixed = map(float, [match for match in ranges if match][3].groups())
    assert found == pytest.approx(120.0, abs=0.2) and fixed == pytest.approx(240.0, abs=0.2)


def test_without_a_fixed_path_nothing_is_compared():
    shown = texts(joint_svg(2, 5, False))
    assert "found path" in shown and "contact kept at t = 0" not in shown
    assert not any("fixed" in text for text in shown)


@pytest.mark.parametrize(("limit", "drawn"), [(50.0, True), (125.0, True), (160.0, False)])
def test_limit_is_drawn_only_in_or_near_the_angles(limit, drawn):
    """R reaches 120 deg and moves by 240 deg with the contact fixed."""
    upper = UPPER.copy()
    upper[3] = np.deg2rad(limit)
    arguments = joint_arguments(n_passes=1)
    svg = joint_chart(**{**arguments, "robot": replace(arguments["robot"], upper=upper)})
    assert ("joint limit" in texts(svg)) == drawn


def test_contact_chart_stays_small():
    arguments = contact_arguments()
    states = np.random.default_rng(0).integers(0, 5, (300, 140)).astype(np.uint8)
    assert len(contact_svg()) < 60_000
    assert len(contact_chart(**{**arguments, "states": states})) < 150_000


def test_what_holds_the_joint_range_sum_up_is_marked_on_the_path():
    held = contact_chart(**contact_arguments(), held_at=[12.0, 171.5])
    assert "holds the joint range sum up" in texts(held)
    assert "holds the joint range sum up" not in texts(contact_svg())


def test_a_chart_painted_in_strips_is_the_same(monkeypatch):
    random = np.random.default_rng(3)
    states = random.integers(0, len(chart.HATCHES), (23, 14))
    states[:, :7] = 0
    clearance = np.where(random.random((6, 4)) < 0.2, np.nan, random.uniform(0.0, 0.2, (6, 4)))
    grid = np.array([0, 4, 9, 13, 18, 22]), np.array([0, 5, 9, 13])
    singular = random.random(states.shape) < 0.3
    whole = chart.chart_image(states, singular, clearance, grid)
    for strip in (1, 5):
        monkeypatch.setattr(chart, "STRIP", strip)
        assert chart.chart_image(states, singular, clearance, grid) == whole
