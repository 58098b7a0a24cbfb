"""The V job on other arms than its own: nothing changes but robot, home and controller."""

import csv
import importlib
import json
import re

import numpy as np
import pytest

from opl.cell.robot_loading import load_robot
from opl.cell.urdf_import import import_urdf
from opl.errors import InputError, UnsafeError
from opl.job.load import load_job
from opl.program.moves import Move, Program
from opl.program.pulses import PulseScale, require_known
from opl.program.settings import ProgramSettings
from tests.support.jobs import GONE, opl, write_job
from tests.support.program_samples import DATE, HOME, SCALE

ACCEPT = "program.accept_unverified_pulses"
# the home of the V job in the angles of an IRB 2600
IRB2600 = {"robot": "irb2600", "process.home_deg": [15.0, -45.0, 50.0, 0.0, -50.0, 0.0]}


def program(**keys):
    return {ACCEPT: GONE, **{f"program.{key}": value for key, value in keys.items()}}


def test_another_yaskawa_arm_needs_only_its_name(tmp_path):
    job = write_job(tmp_path, {"robot": "gp25", ACCEPT: GONE})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    text = (tmp_path / "out" / "V_SHAPE.JBI").read_text(encoding="ascii")
    assert "NOT VERIFIED" not in text
    assert "not verified" not in ended.out


def test_an_abb_arm_gets_a_proven_program_in_rapid(tmp_path):
    job = write_job(tmp_path, {**IRB2600, **program(controller="RAPID")})
    ended = opl("run", job, "--out", tmp_path / "out", "--json")
    assert ended.status == 0, ended.err
    told = json.loads(ended.out)
    assert told["status"] == "ok" and told["verification"]["collisions"] == 0
    assert told["robot"] == {"name": "irb2600", "unverified_pulse_ratios": []}
    assert "MoveAbsJ [[15.0000,-45.0000,50.0000" in (tmp_path / "out" / "V_SHAPE.mod").read_text(
        encoding="ascii"
    )
    with (tmp_path / "out" / "V_SHAPE.csv").open(newline="") as file:
        columns = csv.DictReader(file).fieldnames
    assert "J1_deg" in columns and not any("pulses" in column for column in columns)


UR10E = {"robot": "ur10e", "process.home_deg": [0.0, -110.0, 110.0, -90.0, -90.0, 0.0]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {**UR10E, "robot": "mine", **program(positions="base")},
            r"program\.positions: must be pulses: poses of DX200 name a configuration as that of "
            r"an arm with a spherical wrist, which mine has not",
        ),
        (
            {**IRB2600, **program()},
            r"job\.yaml: program\.controller: DX200 counts pulses, of which ABB IRB 2600-12/1\.65 "
            r"\(robot: irb2600, made by ABB\) has none; name the controller .* RAPID",
        ),
        (
            {"robot": "gp12", **program()},
            r"job\.yaml: program\.pulse_ratios: no pulses per degree are known of S, L, U, R, B, T "
            r"of Motoman GP12 \(robot: gp12\).* import-params",
        ),
        (
            {"robot": "mh12", **program()},
            r"accept_unverified_pulses: the pulses per degree of S, L, U, R, B, T are not verified",
        ),
    ],
)
def test_a_program_in_pulses_nobody_knows_is_refused(changes, message, tmp_path):
    if changes["robot"] == "mine":
        import_urdf(load_robot("ur10e").urdf, "mine", tmp_path / "mine")
    with pytest.raises(InputError, match=message):
        load_job(write_job(tmp_path, changes))


def test_a_yaskawa_arm_without_ratios_may_be_told_in_poses_or_given_them(tmp_path):
    home = {"robot": "gp12", "process.home_deg": [15, -45, -50, 0, -50, 0]}
    assert (
        load_job(write_job(tmp_path, {**home, **program(positions="base")})).cell.robot.name
        == "gp12"
    )
    ratios = "".join(f"\n  - {{name: {name}, per_degree: 1000}}" for name in "SLURBT")
    (tmp_path / "mine.yaml").write_text(f"robot: gp12\nsource: read at the pendant\naxes:{ratios}")
    robot = load_job(write_job(tmp_path, {**home, **program(pulse_ratios="mine.yaml")})).cell.robot
    assert robot.missing_pulses == robot.unverified_pulses == ()
    np.testing.assert_allclose(np.deg2rad(robot.pulses_per_radian), 1000.0)


def test_unknown_ratios_give_no_pulses():
    scale = PulseScale.of(load_robot("kr16"))
    assert not scale.complete and SCALE.complete
    with pytest.raises(InputError, match="pulses per degree are not known"):
        scale.to_pulses(HOME)
    assert np.isnan(scale.to_angles(np.ones(6))).all()
    with pytest.raises(InputError, match="no pulses per degree are known of A1, A2"):
        require_known(load_robot("kr16"))
    require_known(load_robot("mh24"))


def test_a_gp12_in_poses_still_keeps_its_limits(tmp_path):
    beyond = {"robot": "gp12", "process.home_deg": [175, -45, -50, 0, -50, 0]}
    with pytest.raises((InputError, UnsafeError), match=r"joint S must be in -170 to 170, got 175"):
        load_job(write_job(tmp_path, {**beyond, **program(positions="base")}))


@pytest.mark.parametrize(("maker", "height"), [("krl", 640.0), ("rapid", 640.0)])
def test_straight_moves_are_told_from_where_the_controller_counts(maker, height):
    post = importlib.import_module(f"opl.program.{maker}").POST
    q = np.array([[0.0, 0, 0, 0, 0, 0], [0.1, 0, 0, 0, 0, 0]])
    moves = tuple(
        Move(
            configuration,
            0.1,
            exact_stop=True,
            on_wheel=False,
            motion_index=k,
            duration=d,
            straight=k > 0,
        )
        for k, (configuration, d) in enumerate(zip(q, (None, 1.0), strict=True))
    )
    settings = ProgramSettings(controller=maker.upper())
    written = post.write(Program("SAMPLE", moves=moves), load_robot("kr16"), settings, DATE)
    (text,) = written.files.values()
    (line,) = (line for line in text.splitlines() if line.strip().startswith(("LIN", "MoveL")))
    told = re.search(r"Z (-?[0-9.]+)|\[\[[^,]*,[^,]*,(-?[0-9.]+)\]", line)
    assert float(told[1] or told[2]) == pytest.approx(height)  # above the floor, not above axis 2


# the command line


def test_robots_are_listed_in_80_columns():
    ended = opl("robots")
    assert max(map(len, ended.out.splitlines())) <= 80
    for name, reach, told in (
        ("gp25", "1730", "verified"),
        ("gp12", "1440", "not known"),
        ("kr16", "1611", "A1 to A6        not needed"),
    ):
        (line,) = (line for line in ended.out.splitlines() if line.startswith(name))
        assert reach in line and told in line
    figures = {robot["name"]: robot for robot in json.loads(opl("robots", "--json").out)}
    assert figures["gp25"]["payload_kg"] == 25 and figures["gp25"]["missing_pulse_ratios"] == []
    assert figures["m20ia"]["maker"] == "FANUC" and len(figures["m20ia"]["joint_names"]) == 6


@pytest.mark.parametrize("name", ["mh24", "gp25", "kr16", "mh12"])
def test_a_robot_is_shown_with_sources(name):
    ended = opl("robots", "show", name)
    assert ended.status == 0
    assert max(map(len, ended.out.splitlines())) <= 80
    assert "(certainty high)" in ended.out or "(certainty\n" in ended.out
    assert "[1]" in ended.out and "deg/s" in ended.out and "reach" in ended.out
    file = json.loads(opl("robots", "show", name, "--json").out)
    assert len(file["joints"]) == 6 and file["joints"][0]["limits"]["source"]


def test_an_unknown_robot_is_not_shown():
    ended = opl("robots", "show", "mh99")
    assert ended.status == 2 and "unknown robot 'mh99'" in ended.err
