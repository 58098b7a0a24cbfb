"""Commands around programs: show and compare them, templates."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from opl.cell.robot import load_robot
from opl.program.inform import InformJob
from opl.program.inform.compare import differences_in_meaning
from opl.program.inform.files import load_jobs
from opl.program.inform.summary import describe
from opl.program.posts import find_post, known_posts
from opl.program.ratios import with_ratios

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
