import numpy as np
import pytest
from click.testing import CliRunner

from opl.cell.robot import load_robot
from opl.cli.commands import main
from opl.errors import InputError, SettingError
from opl.program.parameters import read_parameters
from opl.program.pulses import PulseScale, require_accepted
from opl.program.ratios import ratio_file, with_ratios
from tests.support.program_samples import ROBOT, UNVERIFIED

# What a public backup of a GP88 with YRC1000 holds.
GP88_RATIOS = (
    (48576, 391), (171, -1), (2454, 14), (57378, -650), (83640, -950), (1057472, -21780)
)  # fmt: skip
GP88_UPPER = (254434, 301568, 179493, 361570, 125216, 198871)
GP88_LOWER = (-254434, -175104, -159549, -361570, -125216, -198871)
GP88_PULSES_PER_DEGREE = (1413.52, 1945.60, 1994.36, 1004.36, 1001.72, 552.42)
YRC1000 = {"rows": 200, "over": 1100, "under": 1090, "upper": 1030, "lower": 1040}
DX = {"rows": 120, "over": 980, "under": 972, "upper": 924, "lower": 932}


def parameter_text(layout, links=(150, 760, 200, 795, 100), line_end="\r\n", **changes):
    """A parameter file with nothing in it but what is of interest."""
    values = [0] * (10 * layout["rows"])
    for place, link in zip((1, 3, 5, 8, 12), links, strict=True):
        values[place] = link * 1000
    for axis, (over, under) in enumerate(GP88_RATIOS):
        values[layout["over"] + axis], values[layout["under"] + axis] = over, under
        values[layout["upper"] + axis] = GP88_UPPER[axis]
        values[layout["lower"] + axis] = GP88_LOWER[axis]
    for place, value in changes.items():
        values[layout[place]] = value
    rows = [",".join(map(str, values[k : k + 10])) for k in range(0, len(values), 10)]
    lines = ["/PARAMETER", "//RC", "///RC1G", *rows, "///RC2G", *["1" + 9 * ",1"] * 300, ""]
    return line_end.join(lines)


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
@pytest.mark.parametrize(("layout", "name"), [(YRC1000, "YRC1000"), (DX, "DX100/DX200")])
def test_ratios_and_soft_limits_are_those_of_the_controller(layout, name, line_end):
    found = read_parameters(parameter_text(layout, line_end=line_end), "RC.PRM")
    assert found.layout == name
    assert tuple(round(ratio, 2) for ratio in found.pulses_per_degree) == GP88_PULSES_PER_DEGREE
    assert (found.upper, found.lower) == (GP88_UPPER, GP88_LOWER)
    degrees = np.array(GP88_UPPER) / found.pulses_per_degree
    np.testing.assert_allclose(degrees, [180, 155, 90, 360, 125, 360], atol=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "RC.PRM: holds no section ///RC1G"),
        (parameter_text({**DX, "rows": 100}).replace("///RC1G", "///RC1X"), "holds no section"),
        ("///RC1G\n" + 99 * (9 * "0," + "0\n"), "has 99 rows; DX controllers have 100 or more"),
        ("///RC1G\n1,2,3\n", "line 2: must hold 10 whole numbers, got '1,2,3'"),
        ("///RC1G\n" + 9 * "0," + "x\n", "line 2: must hold 10 whole"),
        (parameter_text(DX, over=0), "axis 1 has the ratio 0/391"),
        (parameter_text(DX, under=0), "axis 1 has the ratio 48576/0"),
        (parameter_text(DX, upper=-254434), "axis 1 has the soft limits -254434, -254434"),
    ],
)
def test_file_that_gives_no_ratios_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        read_parameters(text, "RC.PRM")


def test_imported_ratios_replace_those_of_the_robot_and_count_as_verified(tmp_path):
    robot = load_robot("mh24")
    own = tmp_path / "own.yaml"
    own.write_text(ratio_file(robot, read_parameters(parameter_text(YRC1000), "RC.PRM"), "RC.PRM"))
    found = with_ratios(robot, own)
    assert robot.unverified_pulses and found.unverified_pulses == ()
    np.testing.assert_allclose(
        np.deg2rad(found.pulses_per_radian), GP88_PULSES_PER_DEGREE, atol=5e-3
    )
    # of two limits the narrower one: U may go to 90 there and to -86 here
    assert np.rad2deg(found.upper[2]) == pytest.approx(90.0, abs=1e-3)
    assert np.rad2deg(found.lower[2]) == pytest.approx(-80.0, abs=1e-3)
    assert found.lower[5] == pytest.approx(-2.0 * np.pi, abs=1e-4)
    lower, upper = PulseScale.of(found).soft_limits
    assert (upper[2], lower[2]) == (GP88_UPPER[2], GP88_LOWER[2])


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


def test_command_writes_the_file_a_job_can_name(tmp_path):
    source, out = tmp_path / "RC.PRM", tmp_path / "own.yaml"
    source.write_text(parameter_text(YRC1000))
    done = CliRunner().invoke(
        main, ["robots", "import-params", str(source), "--robot", "mh24", "--out", str(out)]
    )
    assert done.exit_code == 0
    assert "T 552.42 pulses per degree" in done.output and "caution" not in done.output
    assert with_ratios(load_robot("mh24"), out).unverified_pulses == ()


def test_parameters_of_another_arm_are_told_apart(tmp_path):
    source, out = tmp_path / "RC.PRM", tmp_path / "own.yaml"
    source.write_text(parameter_text(YRC1000, links=(318, 870, 208, 1026, 175)))
    done = CliRunner().invoke(
        main, ["robots", "import-params", str(source), "--robot", "mh24", "--out", str(out)]
    )
    assert "links of 318 870 208 1026 175 mm, Motoman MH24 has 150 760 200 795 100" in done.output
    assert "# caution: the file is of an arm" in out.read_text()


def test_robots_without_a_subcommand_still_lists_them():
    assert "Motoman MH24" in CliRunner().invoke(main, ["robots"]).output
    assert '"unverified_pulse_ratios"' in CliRunner().invoke(main, ["robots", "--json"]).output
