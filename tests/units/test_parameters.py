from fractions import Fraction

import numpy as np
import pytest
from click.testing import CliRunner

from opl.cell.robot_loading import load_robot
from opl.cli.commands import main
from opl.errors import InputError, SettingError
from opl.program.parameters import read_parameters
from opl.program.pulses import PulseScale, require_accepted
from opl.program.ratios import with_ratios
from tests.support.program_samples import ROBOT, UNVERIFIED

# What a public backup of a GP88 with YRC1000 holds.
GP88 = {
    "ratios": (
        (48576, 391), (171, -1), (2454, 14), (57378, -650), (83640, -950), (1057472, -21780)
    ),
    "upper": (254434, 301568, 179493, 361570, 125216, 198871),
    "lower": (-254434, -175104, -159549, -361570, -125216, -198871),
    "links": (318, 870, 208, 1026, 175),
}  # fmt: skip
GP88_PULSES_PER_DEGREE = (1413.52, 1945.60, 1994.36, 1004.36, 1001.72, 552.42)
YRC1000 = {"rows": 200, "over": 1100, "under": 1090, "upper": 1030, "lower": 1040}
DX = {"rows": 120, "over": 980, "under": 972, "upper": 924, "lower": 932}
ZONES_UM = (12500, 25000, 50000, 75000, 100000, 200000, 300000, 500000)


def own_arm(robot, degrees=None, **changes):
    """What a controller of a robot could hold: ratios as gears have them, soft limits in degrees.

    The ratio of T is not that of the robot's data, which nobody has confirmed.
    """
    per_degree = np.append(np.deg2rad(robot.pulses_per_radian)[:5], 536.606)
    gears = [Fraction(ratio * 360 / 4096).limit_denominator(20000) for ratio in per_degree]
    lower, upper = np.rad2deg(robot.lower), np.rad2deg(robot.upper)
    for joint, (low, high) in (degrees or {}).items():
        lower[joint], upper[joint] = low, high
    return {
        "ratios": [(gear.numerator, -gear.denominator) for gear in gears],
        "upper": np.rint(upper * per_degree).astype(int).tolist(),
        "lower": np.rint(lower * per_degree).astype(int).tolist(),
        "links": (150, 760, 200, 795, 100),
        **changes,
    }


def section(kind, number, layout, arm):
    """A group of axes with nothing in it but what is of interest."""
    values = [0] * (10 * layout["rows"])
    for place, link in zip((1, 3, 5, 8, 12), arm["links"], strict=True):
        values[place] = link * 1000
    for axis, (over, under) in enumerate(arm["ratios"]):
        values[layout["over"] + axis], values[layout["under"] + axis] = over, under
        values[layout["upper"] + axis] = arm["upper"][axis]
        values[layout["lower"] + axis] = arm["lower"][axis]
    return [f"///{kind}{number}G", *rows_of(values)]


def rows_of(values):
    return [",".join(map(str, values[k : k + 10])) for k in range(0, len(values), 10)]


def parameter_text(layout, *arms, line_end="\r\n", zones=None):
    """A parameter file of some arms; the last group of a real one is not in use."""
    lines = ["/PARAMETER", "//RC"]
    for number, arm in enumerate(arms, start=1):
        lines += section("RC", number, layout, arm)
    lines += [f"///RC{len(arms) + 1}G", *rows_of([0] * (10 * layout["rows"]))]
    lines += ["///RC1X", "this,is,nothing"]
    if zones is not None:
        lines += ["//SC", "///S1C1G", *rows_of([*[7] * 33, *zones, *[0] * 9])]
    return line_end.join([*lines, ""])


def imported(tmp_path, text, robot, *more):
    source, out = tmp_path / "ALL.PRM", tmp_path / "own.yaml"
    source.write_text(text)
    command = ["robots", "import-params", str(source), "--robot", robot, "--out", str(out)]
    return CliRunner().invoke(main, [*command, *more]), out


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize(("layout", "name"), [(YRC1000, "YRC1000"), (DX, "DX100/DX200")])
def test_ratios_and_soft_limits_are_those_of_the_controller(layout, name, line_end):
    (group,) = read_parameters(parameter_text(layout, GP88, line_end=line_end), "RC.PRM")
    found = group.axes()
    assert (found.group, found.layout, found.zones) == (1, name, None)
    assert tuple(round(ratio, 2) for ratio in found.pulses_per_degree) == GP88_PULSES_PER_DEGREE
    assert (found.upper, found.lower) == (GP88["upper"], GP88["lower"])
    degrees = np.array(GP88["upper"]) / found.pulses_per_degree
    np.testing.assert_allclose(degrees, [180, 155, 90, 360, 125, 360], atol=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "RC.PRM: holds no section ///RC1G"),
        ("///RC1X\n" + 200 * (9 * "1," + "1\n"), "holds no section"),
        ("///RC1G\n" + 99 * (9 * "0," + "0\n"), "has 99 rows; DX controllers have 100 or more"),
        ("///RC1G\n1,2,3\n", "line 2: must hold 10 whole numbers, got '1,2,3'"),
        ("///RC1G\n" + 9 * "0," + "x\n", "line 2: must hold 10 whole"),
        (parameter_text(DX), "no axis of it has soft limits"),
    ],
)
def test_file_that_holds_no_arm_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        read_parameters(text, "RC.PRM")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ratios": [(0, 391)] + 5 * [(1, 1)]}, "axis 1 has the ratio 0/391"),
        ({"ratios": [(1, 0)] + 5 * [(1, 1)]}, "axis 1 has the ratio 1/0"),
        ({"upper": (-254434, *GP88["upper"][1:])}, "axis 1 has the soft limits -254434, -254434"),
        ({key: [*GP88[key], GP88[key][5]] for key in ("ratios", "upper", "lower")}, "has 7 axes"),
    ],
)
def test_group_that_is_no_arm_of_six_axes_is_refused(tmp_path, changes, message):
    done, out = imported(tmp_path, parameter_text(DX, {**GP88, **changes}), "mh24")
    assert done.exit_code == 2 and not out.exists()
    assert f"///RC1G: {message}" in done.output


def test_imported_ratios_replace_those_of_the_robot_and_count_as_verified(tmp_path):
    robot = load_robot("mh24")
    arm = own_arm(robot, degrees={2: (-80.0, 165.0)})
    done, own = imported(tmp_path, parameter_text(YRC1000, arm), "mh24")
    assert done.exit_code == 0, done.output
    found = with_ratios(robot, own)
    assert robot.unverified_pulses and found.unverified_pulses == ()
    assert np.deg2rad(found.pulses_per_radian[5]) == pytest.approx(536.606, abs=1e-3)
    # of two limits the narrower one: U may go from -80 there and to 163 here
    assert np.rad2deg(found.lower[2]) == pytest.approx(-80.0, abs=1e-3)
    assert found.upper[2] == robot.upper[2]
    assert PulseScale.of(found).soft_limits[0][2] == arm["lower"][2]


def test_what_was_compared_is_told(tmp_path):
    done, _ = imported(tmp_path, parameter_text(DX, own_arm(load_robot("mh24"))), "mh24")
    for line in (
        "group 1 of ALL.PRM, compared with Motoman MH24:",
        "axes: 6, as Motoman MH24",
        "soft limits: S -180.0 to 180.0, L -105.0 to 155.0",
        "pulses per degree of S L U: agree within 0.2 %",
        "pulses per degree of T: 536.61 instead of 454.76 unverified",
        "links: 150 760 200 795 100 mm, within 10 mm of the drawing",
        "T 536.61 pulses per degree",
        "zones of the position levels: not in the file",
    ):
        assert line in done.output


@pytest.mark.parametrize("robot", ["mh24", "gp25", "gp12", "mh50", "ar2010", "ur10e"])
def test_parameters_of_another_arm_are_refused_with_all_that_contradicts(tmp_path, robot):
    done, out = imported(tmp_path, parameter_text(YRC1000, GP88), robot)
    assert done.exit_code == 2 and not out.exists()
    assert f"is not of a {load_robot(robot).title}" in done.output


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"degrees": {3: (-360.0, 360.0)}}, "soft limits of R: -360.0 to 360.0 deg, the arm turns"),
        ({"links": (150, 760, 200, 1082, 100)}, "links of 150 760 200 1082 100 mm, the arm has"),
        ({"ratios": [GP88["ratios"][0]] * 6}, "pulses per degree of S: 1413.52, the arm has 1341"),
    ],
)
def test_each_contradiction_alone_is_enough(tmp_path, change, message):
    text = parameter_text(YRC1000, own_arm(load_robot("mh24"), **change))
    done, out = imported(tmp_path, text, "mh24")
    assert done.exit_code == 2 and message in done.output and not out.exists()


def test_the_group_of_a_controller_with_two_arms_is_found_or_named(tmp_path):
    own = own_arm(load_robot("mh24"))
    done, out = imported(tmp_path, parameter_text(DX, GP88, own), "mh24")
    assert done.exit_code == 0 and "group 2 of ALL.PRM" in done.output
    assert "group 2, layout of DX100/DX200" in out.read_text()

    done, _ = imported(tmp_path, parameter_text(DX, GP88, own), "mh24", "--group", "1")
    assert done.exit_code == 2 and "group 1: links of 318" in done.output
    done, _ = imported(tmp_path, parameter_text(DX, GP88, own), "mh24", "--group", "3")
    assert "holds no group 3; have: 1 (6 axes), 2 (6 axes)" in done.output

    both = parameter_text(DX, own, own)
    done, _ = imported(tmp_path, both, "mh24")
    assert done.exit_code == 2 and "groups 1 and 2 could both be the Motoman MH24" in done.output
    done, _ = imported(tmp_path, both, "mh24", "--group", "2")
    assert done.exit_code == 0 and "group 2 of ALL.PRM" in done.output


def test_zones_of_the_position_levels_come_with_the_ratios(tmp_path):
    robot = load_robot("mh24")
    text = parameter_text(YRC1000, own_arm(robot), zones=ZONES_UM)
    done, own = imported(tmp_path, text, "mh24")
    assert "zones of PL=1 to PL=8: 12.5 25 50 75 100 200 300 500 mm" in done.output
    assert robot.position_level_zones is None
    found = with_ratios(robot, own).position_level_zones
    assert found == pytest.approx([zone * 1e-6 for zone in ZONES_UM])
    own.write_text(own.read_text().replace("[12.5, 25,", "[30, 25,"))
    with pytest.raises(InputError, match="must not get narrower from level to level"):
        with_ratios(robot, own)


@pytest.mark.parametrize("zones", [(0,) * 8, (12500, 5000, *ZONES_UM[2:])])
def test_numbers_that_are_no_zones_are_not_taken_for_some(tmp_path, zones):
    arm = own_arm(load_robot("mh24"))
    done, own = imported(tmp_path, parameter_text(YRC1000, arm, zones=zones), "mh24")
    assert done.exit_code == 0 and "zones of the position levels: not in the file" in done.output
    assert "zones" not in own.read_text()


AXIS = "robot: mh24\nsource: pendant\naxes:\n  - {}\n"
READINGS = "{{name: T, readings: [{{pulses: {}, degrees: {}}}, {{pulses: {}, degrees: {}}}]}}"


def test_two_readings_at_the_pendant_give_the_ratio(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text(AXIS.format(READINGS.format(-4548, -10.0, 40928, 90.0)))
    found = with_ratios(UNVERIFIED, own)
    assert np.deg2rad(found.pulses_per_radian[5]) == pytest.approx(454.76)
    assert found.unverified_pulses == ("R", "B")
    np.testing.assert_array_equal(found.pulses_per_radian[:5], ROBOT.pulses_per_radian[:5])


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        (READINGS.format(0, 0.0, 4548, 10.0), "readings must be 20 degrees apart or more"),
        (READINGS.format(0, 0.0, -45476, 100.0), "must grow in pulses as in degrees"),
        (READINGS.format(100, 0.0, 45576, 100.0), "through 0 pulses at 0 degrees"),
        ("{name: T}", "needs either per_degree or readings"),
        ("{name: T, per_degree: -1.0}", "per_degree: must be more than 0"),
        ("{name: Z, per_degree: 1.0}", "axes.0.name: no such joint 'Z'; have: S, L, U"),
        ("{name: T, per_degree: 1.0, lower_pulses: 5, upper_pulses: 5}", "must be below upper"),
        ("{name: T, per_degree: 1.0, lower_pulses: 500}", "joint T: no range is left"),
        ("{name: T, per_degree: 1.0}\n  - {name: T, per_degree: 1.0}", "joint T is given twice"),
    ],
)
def test_ratio_file_with_nonsense_is_refused(tmp_path, axis, message):
    own = tmp_path / "own.yaml"
    own.write_text(AXIS.format(axis))
    with pytest.raises(InputError, match=message):
        with_ratios(UNVERIFIED, own)


def test_ratio_file_of_another_robot_is_refused(tmp_path):
    own = tmp_path / "own.yaml"
    own.write_text(AXIS.format("{name: T, per_degree: 1.0}").replace("mh24", "gp88"))
    with pytest.raises(InputError, match="robot: must be 'mh24', got 'gp88'"):
        with_ratios(UNVERIFIED, own)


def test_unverified_ratios_must_be_accepted_by_name():
    require_accepted(("R", "T"), ("T", "R", "B"))
    with pytest.raises(SettingError, match=r"accepted_pulses: .* of T are not .*: \[T\]"):
        require_accepted(("R", "T"), ("R",))


def test_robots_without_a_subcommand_still_lists_them():
    assert "Motoman MH24" in CliRunner().invoke(main, ["robots"]).output
    assert '"unverified_pulse_ratios"' in CliRunner().invoke(main, ["robots", "--json"]).output
