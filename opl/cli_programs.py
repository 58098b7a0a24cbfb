"""Commands around programs: show and compare them, templates, robots and their pulses."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from opl.cell.robot import known_robots, load_robot
from opl.console import show_robots
from opl.errors import InputError
from opl.program.inform import InformJob
from opl.program.inform.compare import differences_in_meaning
from opl.program.inform.files import load_jobs
from opl.program.inform.summary import describe
from opl.program.parameters import read_parameters
from opl.program.posts import find_post, known_posts
from opl.program.ratios import mismatches, ratio_file, with_ratios

FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("program", type=FILE)
@click.option("--diff", "other", type=FILE, help="Compare with this program by meaning.")
@click.option("--robot", default="mh24", show_default=True, help="Whose program it is.")
@click.option("--pulses", type=FILE, help="Pulse ratios of the robot's own controller.")
def show(program: Path, other: Path | None, robot: str, pulses: Path | None) -> None:
    """Show a Yaskawa job in words: positions as angles and poses, moves, speeds, signals.

    With --diff, ends with status 0 if both programs do the same, with 1 if not.

    Example: opl show programs/V_SHAPE.JBI --diff programs/V_SHAPE_OLD.JBI
    """
    jobs = load_jobs(program)
    if other is not None:
        lines = _differences(jobs, load_jobs(other))
        click.echo("\n".join(lines) or "both do the same")
        sys.exit(1 if lines else 0)
    owner = load_robot(robot)
    if pulses is not None:
        owner = with_ratios(owner, pulses)
    unsure = ", ".join(owner.unverified_pulses)
    click.echo(
        f"read as a program of {owner.title}"
        + (f", whose pulse ratios of {unsure} are not verified" if unsure else "")
    )
    for job in jobs:
        click.echo("\n".join(describe(job, owner)))


def _differences(first: tuple[InformJob, ...], second: tuple[InformJob, ...]) -> list[str]:
    lines = [
        line
        for one, two in zip(first, second, strict=False)
        for line in differences_in_meaning(one, two)
    ]
    if len(first) != len(second):
        lines.append(f"{len(first)} jobs against {len(second)}")
    return lines


@click.group()
def templates() -> None:
    """What a template of one's own has to know."""


@templates.command("vars")
@click.argument("controller", required=False)
def template_vars(controller: str | None) -> None:
    """Print what templates get: names and meanings, of one controller or of all.

    Example: opl templates vars DX200
    """
    for name in known_posts() if controller is None else [controller]:
        post = find_post(name, "controller")
        click.echo(f"{name}: {post.title}, layout {post.template}")
        width = max(len(variable) for variable in post.variables)
        for variable, meaning in post.variables.items():
            click.echo(f"  {variable:{width}}  {meaning}")


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@click.pass_context
def robots(context: click.Context, as_json: bool) -> None:
    """List the robots that come with opl.

    Example: opl robots
    """
    if context.invoked_subcommand is not None:
        return
    known = [load_robot(name) for name in known_robots()]
    if as_json:
        told = [
            {
                "name": robot.name,
                "title": robot.title,
                "unverified_pulse_ratios": list(robot.unverified_pulses),
            }
            for robot in known
        ]
        click.echo(json.dumps(told, indent=2))
    else:
        show_robots(known)


@robots.command("import-params")
@click.argument("file", type=FILE)
@click.option("--robot", required=True, help="Whose controller the file is from.")
@click.option("--out", type=FILE, help="File to write; default <robot>_pulses.yaml.")
def import_params(file: Path, robot: str, out: Path | None) -> None:
    """Read pulse ratios and soft limits from a controller's RC.PRM or ALL.PRM.

    Writes a small file that a job names as program.pulse_ratios.

    Example: opl robots import-params RC.PRM --robot mh24 --out pulses.yaml
    """
    owner = load_robot(robot)
    try:
        text = file.read_text(encoding="latin-1")
    except OSError as error:
        raise InputError(str(file), f"cannot be read: {error.strerror}") from error
    parameters = read_parameters(text, str(file))
    path = out or Path(f"{owner.name}_pulses.yaml")
    try:
        path.write_text(ratio_file(owner, parameters, file.name), encoding="utf-8")
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from error
    for name, ratio in zip(owner.joint_names, parameters.pulses_per_degree, strict=True):
        click.echo(f"{name} {ratio:.2f} pulses per degree")
    for line in mismatches(owner, parameters):
        click.echo(f"caution: {line}", err=True)
    click.echo(f"wrote {path}; name it in the job as program.pulse_ratios")
