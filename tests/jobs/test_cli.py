"""The commands as a user meets them: the V job from end to end, once, and what each one prints."""

import csv
import json
import math
import os
import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from opl.cli.commands import main
from tests.support.jobs import V_JOB, Ended, document, opl, write_job
from tests.support.schema_check import schema_faults

EPOCH = "1700000000"
FILES = [
    "V_SHAPE.JBI",
    "V_SHAPE.csv",
    "V_SHAPE_contact.svg",
    "V_SHAPE_joints.svg",
    "V_SHAPE_motion.json",
]
JOINTS = "SLURBT"


def opl_process(*arguments):
    """Run a command in a process of its own, where C code too could print."""
    command = [sys.executable, "-c", "from opl.cli.commands import main; main(prog_name='opl')"]
    return subprocess.run(
        [*command, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "SOURCE_DATE_EPOCH": EPOCH},
    )


LEFT = """
import atexit
from opl.cli.commands import main

class Loaded:
    def __del__(self):
        print("taken apart")

kept = Loaded()
atexit.register(print, "done at the end")
main()
"""


@pytest.mark.parametrize(("argument", "status"), [("robots", 0), ("no-such-command", 2)])
def test_what_is_to_be_done_at_the_end_is_done_and_nothing_taken_apart(argument, status):
    command = [sys.executable, "-c", LEFT, argument]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == status
    assert ended.stdout.endswith("done at the end\n")


@pytest.fixture(scope="session")
def v_run(tmp_path_factory):
    """Run the V job once; return the folder and the ended process."""
    out = tmp_path_factory.mktemp("v_shape")
    return out, opl_process("run", V_JOB, "--out", out, "--json")


@pytest.fixture(scope="session")
def result(v_run):
    return json.loads((v_run[0] / "result.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def table(v_run):
    """Return the rows of the CSV as text, by column."""
    with (v_run[0] / "V_SHAPE.csv").open(newline="", encoding="ascii") as file:
        return list(csv.DictReader(file))


def on_wheel(table):
    """Return rows, joint angles in rad and passes of what lies on the wheel."""
    rows = [row for row in table if row["kind"] in ("grind", "between")]
    q = np.deg2rad([[float(row[f"{name}_deg"]) for name in JOINTS] for row in rows])
    return rows, q, np.array([int(row["pass"]) for row in rows])


# the V job, whole


def test_the_v_job_ends_well_and_leaves_its_files(v_run):
    out, ended = v_run
    assert ended.returncode == 0, ended.stderr
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [*FILES, "report.html", "result.json"]
    )


def test_json_prints_the_result_and_nothing_else(v_run):
    out, ended = v_run
    assert ended.stdout == (out / "result.json").read_text(encoding="utf-8")
    assert ended.stderr == ""


def test_the_result_has_every_key_of_the_design_with_its_type(result):
    numbers = (int, float)

    def six(values):
        return len(values) == 6 and all(isinstance(value, float) for value in values)

    assert result["status"] == "ok"
    assert result["reasons"] == []
    assert type(result["cutter_points"]) is int and result["passes"] == 5
    fixed, path, proof = result["fixed"], result["path"], result["verification"]
    assert six(fixed["joint_ranges_rad"]) and isinstance(fixed["joint_range_sum_rad"], float)
    assert isinstance(fixed["feasible"], bool) and isinstance(fixed["reason"], str)
    assert isinstance(path["method"], str) and isinstance(path["branch"], str)
    for key in ("nodes", "intermediate_nodes"):
        assert type(path[key]) is int
    for key in ("lower_bound_rad", "gap"):
        assert path[key] is None or isinstance(path[key], numbers)
    assert set(result["compared"]) == {"fixed", "paper_start", "recursive", "optimal"}
    for found in (path, *result["compared"].values()):
        assert six(found["joint_ranges_rad"])
        for key in ("joint_range_sum_rad", "joint_travel_rad", "contact_travel"):
            assert isinstance(found[key], float)
    assert isinstance(proof["engine"], str)
    for key in ("poses", "collisions", "limit_violations"):
        assert type(proof[key]) is int
    for key in ("min_clearance_mm", "max_contact_error_mm"):
        assert isinstance(proof[key], float)
    program = result["program"]
    assert set(FILES) == set(program["files"])
    assert type(program["moves"]) is int and isinstance(program["duration_s"], float)
    planned = ("cutter_points", "nodes", "clearance", "search", "motion")
    for stage in (*planned, "verification", "export", "total"):
        assert isinstance(result["seconds"][stage], numbers)


def test_the_path_is_as_quiet_as_the_papers_and_safe(result):
    assert result["path"]["joint_range_sum_rad"] <= 2.5287
    proof = result["verification"]
    assert (proof["collisions"], proof["limit_violations"]) == (0, 0)
    assert proof["max_contact_error_mm"] <= 0.1
    assert proof["min_clearance_mm"] >= 5.0
    assert proof["poses"] > 1000


def test_each_method_is_no_worse_than_the_one_before(result):
    names = ("optimal", "recursive", "paper_start", "fixed")
    sums = [result["compared"][name]["joint_range_sum_rad"] for name in names]
    assert sums == sorted(sums)
    assert result["compared"]["recursive"]["joint_range_sum_rad"] <= 2.5287


def test_the_optimal_path_is_certified_and_smoother_than_the_recursive_one(result):
    path, recursive = result["path"], result["compared"]["recursive"]
    assert path["joint_range_sum_rad"] <= 1.98
    found = path["joint_range_sum_rad"]
    assert path["lower_bound_rad"] <= found
    assert 0.0 <= path["gap"] <= 0.001
    assert path["gap"] == pytest.approx(1.0 - path["lower_bound_rad"] / found, abs=1e-6)
    assert path["joint_travel_rad"] <= recursive["joint_travel_rad"]
    assert path["contact_travel"] <= recursive["contact_travel"]


def test_the_middle_row_with_fixed_contact_is_the_papers(result):
    paper = [0.4711, 0.3512, 0.2951, 2.8134, 0.8810, 1.5024]
    middle = result["fixed"]["joint_ranges_by_pass_rad"][2]
    assert middle == pytest.approx(paper, abs=0.015)
    assert sum(middle) == pytest.approx(6.31, abs=0.03)


def test_the_times_of_search_and_clearance_are_told_and_add_up(result):
    seconds = result["seconds"]
    assert seconds["search"] > 0.0 and seconds["clearance"] > 0.0
    stages = sum(spent for stage, spent in seconds.items() if stage != "total")
    assert seconds["total"] == pytest.approx(stages, abs=1e-3)


def test_figures_of_the_path_follow_from_the_table(result, table):
    rows, q, passes = on_wheel(table)
    path = result["path"]
    rounding = np.deg2rad(2.5e-3)  # the table tells whole pulses, as the program does
    # the lines between the positions that are written cut corners of the path, within the contact
    # error, so they may turn joints a little less, never more
    less = np.array(path["joint_ranges_rad"]) - np.ptp(q, axis=0)
    assert (less > -rounding).all() and (less < 2e-3).all()
    assert path["joint_range_sum_rad"] == pytest.approx(sum(path["joint_ranges_rad"]), abs=1e-5)
    within = np.diff(passes) == 0
    travel = np.abs(np.diff(q, axis=0)[within]).sum()
    assert travel == pytest.approx(path["joint_travel_rad"], abs=6 * len(q) * rounding)
    t = np.array([float(row["t"]) for row in rows])
    contact_travel = np.abs(np.diff(t)[within]).sum()
    assert contact_travel == pytest.approx(path["contact_travel"], abs=1e-4 * len(t))
    kinds = [row["kind"] for row in rows]
    assert kinds.count("grind") == path["nodes"] == result["cutter_points"]
    assert kinds.count("between") == path["intermediate_nodes"]
    assert sorted(set(passes)) == [1, 2, 3, 4, 5]


def test_figures_of_the_program_follow_from_the_table(result, table):
    program = result["program"]
    assert sum(row["speed"] != "" for row in table) == program["moves"]
    duration = sum(float(row["time_s"]) for row in table)
    assert duration == pytest.approx(program["duration_s"], abs=1e-4 * len(table))


def test_the_smallest_clearance_of_the_table_is_that_of_the_result(result, table):
    clearances = [float(row["clearance_mm"]) for row in table if row["clearance_mm"]]
    assert min(clearances) == pytest.approx(result["verification"]["min_clearance_mm"], abs=1e-3)


def test_job_and_table_agree_to_the_pulse(v_run, result, table):
    text = (v_run[0] / "V_SHAPE.JBI").read_bytes().decode("ascii")
    assert text.count("\r\n") == text.count("\n") > 2 * result["program"]["moves"]
    positions = re.findall(r"^C(\d+)=(\S+)\r$", text, flags=re.MULTILINE)
    assert [int(number) for number, _ in positions] == list(range(result["program"]["moves"]))
    assert re.findall(r"^MOV[JL] C(\d+)", text, flags=re.MULTILINE) == [
        number for number, _ in positions
    ]
    pulses = [
        ",".join(row[f"{name}_pulses"] for name in JOINTS) for row in table if row["speed"] != ""
    ]
    assert [values for _, values in positions] == pulses


def test_home_and_limits_are_kept_in_the_table(table):
    home = document()["process"]["home_deg"]
    for row in (table[0], table[-1]):
        # to half a pulse, as the program tells it
        angles = [float(row[f"{name}_deg"]) for name in JOINTS]
        assert angles == pytest.approx(home, abs=1.5e-3)
    t = [float(row["t"]) for row in table if row["t"]]
    assert max(map(abs, t)) <= 25 + 45


def test_unverified_pulses_are_told_in_result_and_job(v_run, result):
    assert result["robot"] == {"name": "mh24", "unverified_pulse_ratios": ["R", "B", "T"]}
    job = (v_run[0] / "V_SHAPE.JBI").read_text(encoding="ascii")
    assert re.search("not (verified|confirmed)|unverified", job, flags=re.IGNORECASE)


def test_pictures_are_well_formed_svg(v_run):
    for name in FILES:
        if name.endswith(".svg"):
            root = ElementTree.parse(v_run[0] / name).getroot()
            assert root.tag == "{http://www.w3.org/2000/svg}svg"
            assert len(list(root.iter())) > 50


def test_a_second_run_gives_the_same_bytes(v_run, tmp_path, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", EPOCH)
    assert opl("run", V_JOB, "--out", tmp_path, "-q") == Ended(0, "", "")
    for name in [*FILES, "report.html"]:
        assert (tmp_path / name).read_bytes() == (v_run[0] / name).read_bytes(), name


# a quick job: what is printed


@pytest.fixture(scope="module")
def quick_run(tmp_path_factory):
    """Run a quick job as a user does, into ./out; return the folder and what was printed."""
    home = tmp_path_factory.mktemp("quick")
    job = write_job(home)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        return home, opl("run", job.name, "-v")


def test_a_run_prints_the_comparison_the_figures_and_the_files(quick_run):
    home, ended = quick_run
    assert (ended.status, ended.err) == (0, "")
    result = json.loads((home / "out" / "V_SHAPE" / "result.json").read_text())
    # with the long steps of a quick job the contact-fixed path may jump, and is not shown
    sums = [found["joint_range_sum_rad"] for found in result["compared"].values()]
    (line,) = (line for line in ended.out.splitlines() if line.startswith("│ sum"))
    assert [float(cell) for cell in line.strip("│").split("│")[1:]] == pytest.approx(sums, abs=1e-4)
    for told in (
        "joint ranges along the path, in rad",
        "contact fixed",
        "paper's start",
        f"path: {result['cutter_points']} cutter points in 1 passes",
        "search with its collision checks: ",
        f"verified in {result['verification']['engine']}: ",
        " 0 collisions",
        f"program: {result['program']['moves']} moves",
        "caution: the pulse ratios of R, B, T of Motoman MH24 are not verified",
        "verification in PyBullet: ",
    ):
        assert told in ended.out
    for name in [*FILES, "report.html", "result.json"]:
        assert f"wrote out/V_SHAPE/{name}\n" in ended.out


def test_the_tables_fit_a_terminal_of_80_columns(quick_run):
    table = [line for line in quick_run[1].out.splitlines() if line[:1] in "┏┃┡│├└"]
    assert table and max(map(len, table)) <= 80


def test_quiet_prints_nothing_but_errors(tmp_path):
    ended = opl("run", write_job(tmp_path, {"wheel.width_mm": -3}), "-q")
    told = f"error: {tmp_path / 'job.yaml'}: wheel.width_mm: must be more than 0, got -3\n"
    assert ended == Ended(2, "", told)


def test_check_tells_what_would_be_done_and_writes_nothing(tmp_path, monkeypatch):
    job = write_job(tmp_path / "part")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    ended = opl("check", job)
    assert (ended.status, ended.err) == (0, "")
    assert ended.out.startswith(f"{job} is a valid job\n")
    assert "program V_SHAPE for Motoman MH24" in ended.out
    assert "wheel 50 mm wide, radius 150 mm, roll up to 45 deg" in ended.out
    assert "obstacles: floor, belt run, machine column" in ended.out
    assert list((tmp_path / "elsewhere").iterdir()) == []
    told = json.loads(opl("check", job, "--json").out)
    assert told["passes"] == 1 and told["contact_positions"] == 40
    assert f"{told['cutter_points']} cutter points in 1 passes" in ended.out


def test_check_refuses_what_run_refuses(tmp_path):
    ended = opl("check", write_job(tmp_path, {"passes.rows": 50}))
    assert ended.status == 2
    assert ended.err.startswith(f"error: {tmp_path / 'job.yaml'}: passes.rows: 50 rows")


# the other commands


def test_the_schema_accepts_the_v_job_and_refuses_others():
    ended = opl("schema")
    assert (ended.status, ended.err) == (0, "")
    schema = json.loads(ended.out)
    definitions = schema["$defs"]
    job = yaml.safe_load(V_JOB.read_text(encoding="utf-8"))
    assert schema_faults(schema, job, definitions) == []
    assert re.fullmatch(schema["properties"]["name"]["pattern"], job["name"])
    for wrong in (
        {key: job[key] for key in job if key != "wheel"},
        {**job, "colour": "red"},
        {**job, "wheel": {**job["wheel"], "width_cm": 5}},
        {**job, "wheel": {**job["wheel"], "width_mm": "50 mm"}},
    ):
        assert schema_faults(schema, wrong, definitions) != []


def test_robots_are_listed_with_units_and_what_is_unverified():
    ended = opl("robots")
    assert (ended.status, ended.err) == (0, "")
    assert "reach" in ended.out and "mm" in ended.out and "kg" in ended.out
    (line,) = (line for line in ended.out.splitlines() if "mh24" in line)
    assert "Motoman MH24" in line and "1730" in line and "R B T" in line
    told = {robot["name"]: robot for robot in json.loads(opl("robots", "--json").out)}
    assert told["mh24"]["unverified_pulse_ratios"] == ["R", "B", "T"]


def test_init_starts_a_job_that_is_valid(tmp_path):
    target = tmp_path / "new" / "part"
    ended = opl("init", target)
    assert (ended.status, ended.err) == (0, "")
    assert ended.out == (
        f"wrote {target / 'job.yaml'} and the files it names; next: opl check "
        f"{target / 'job.yaml'}\n"
    )
    assert (target / "job.yaml").read_bytes() == V_JOB.read_bytes()
    assert not list(target.rglob("__pycache__"))
    assert opl("check", target / "job.yaml").status == 0


def test_init_leaves_what_is_there_alone(tmp_path):
    (tmp_path / "mine").write_text("mine")
    for place, told in (
        (tmp_path, "exists already; name a new folder"),
        (tmp_path / "mine", "exists already; name a new folder"),
        (tmp_path / "mine" / "below", "must be a folder for the files, is something else"),
    ):
        ended = opl("init", place)
        assert ended.status == 2
        assert ended.err.endswith(f"{told}\n") and ended.err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize("command", sorted(main.commands))
def test_help_of_every_command_has_an_example(command):
    ended = opl(command, "--help")
    assert ended.status == 0
    group = getattr(main.commands[command], "commands", None)
    if group is None:
        assert f"Example: opl {command}" in ended.out
    for name in group or ():
        assert f"Example: opl {command} {name}" in opl(command, name, "--help").out


def test_help_and_version():
    assert "Example: opl run workpieces/v_shape/job.yaml" in opl("-h").out
    for command in ("run", "check", "batch", "init", "schema", "robots"):
        assert re.search(rf"^  {command} ", opl("--help").out, flags=re.MULTILINE)
    assert re.fullmatch(r"opl, version \d+\.\d+\.\d+\n", opl("--version").out)


@pytest.mark.parametrize(
    "arguments",
    [["frobnicate"], ["run"], ["run", V_JOB, "--method", "magic"], ["run", V_JOB, "--colour"]],
)
def test_bad_usage_ends_with_status_2_and_a_hint(arguments):
    ended = opl(*arguments)
    assert ended.status == 2
    assert ended.out == ""
    assert "Usage: opl" in ended.err and "--help" in ended.err


def test_figures_in_the_result_are_never_nan(result):
    def numbers(value):
        if isinstance(value, dict):
            value = list(value.values())
        if isinstance(value, list):
            return [number for item in value for number in numbers(item)]
        return [value] if isinstance(value, float) else []

    assert all(math.isfinite(number) for number in numbers(result))


def test_a_weighted_objective_tells_its_sum_for_every_path_and_how_far_it_may_be_from_the_least(
    tmp_path,
):
    weights = {"range": 1.0, "travel": 0.3, "time": 0.02}
    changes = {"search.objective": "weighted", "search.objective_weights": weights}
    ended = opl("run", write_job(tmp_path, changes), "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "weighted sum" in ended.out
    told = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    for figures in told["compared"].values():
        wanted = (
            figures["joint_range_sum_rad"]
            + 0.3 * figures["joint_travel_rad"]
            + 0.02 * figures["seconds_on_wheel"]
        )
        assert figures["weighted_sum"] == pytest.approx(wanted, abs=1e-5)
    found = told["path"]["weighted"]
    assert found["value"] == told["compared"]["optimal"]["weighted_sum"]
    assert found["lower_bound"] <= found["value"]
    assert found["value"] <= told["compared"]["recursive"]["weighted_sum"]


def test_weights_that_charge_for_nothing_are_refused(tmp_path):
    changes = {"search.objective_weights": {"range": 0, "travel": 0, "time": 0}}
    ended = opl("check", write_job(tmp_path, changes))
    assert ended.status == 2
    assert "search.objective_weights" in ended.err
    assert "at least one of range, travel and time" in ended.err
