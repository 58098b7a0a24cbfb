"""Commands around programs: show and compare them, templates."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from opl.cell.robot import load_robot
from opl.errors import InputError
from opl.program.posts import find_post, known_posts, reader_for
from opl.program.ratios import with_ratios

FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("program", type=FILE)
@click.option("--diff", "other", type=FILE, help="Compare with this program by meaning.")
@click.option("--robot", default="mh24", show_default=True, help="Whose program it is.")
@click.option("--pulses", type=FILE, help="Pulse ratios of the robot's own controller.")
def show(program: Path, other: Path | None, robot: str, pulses: Path | None) -> None:
    """Show a program in words: positions as angles and poses, moves, speeds, signals.

    The suffix of the file names its language: .JBI, .mod, .src, .LS or .script.

    With --diff, ends with status 0 if both programs do the same, with 1 if not.

    Example: opl show programs/V_SHAPE.JBI --diff programs/V_SHAPE_OLD.JBI
    """
    reader, content = reader_for(program), _content(program)
    if other is not None:
        if reader_for(other) is not reader:
            raise InputError(str(other), f"is not of the language of {program}")
        lines = reader.differences((str(program), content), (str(other), _content(other)))
        click.echo("\n".join(lines) or "both do the same")
        sys.exit(1 if lines else 0)
    owner = load_robot(robot)
    if pulses is not None:
        owner = with_ratios(owner, pulses)
    click.echo("\n".join(reader.describe(str(program), content, owner)))


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error


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
