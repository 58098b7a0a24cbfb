"""Commands around programs: show, compare and prove them, templates."""

from __future__ import annotations

import sys
from pathlib import Path

import click

import opl
from opl.cli.inputs import FILE

EXISTING = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("program", type=EXISTING)
@click.option("--diff", "other", type=EXISTING, help="Compare with this program by meaning.")
@click.option("--robot", default="mh24", show_default=True, help="Whose program it is.")
@click.option("--pulses", type=EXISTING, help="Pulse ratios of the robot's own controller.")
def show(program: Path, other: Path | None, robot: str, pulses: Path | None) -> None:
    """Show a program in words: positions as angles and poses, moves, speeds, signals.

    The suffix of the file names its language: .JBI, .mod, .src, .LS or .script.

    What a controller would not take as it stands is said before the instructions, with the code
    page of the text where it is not ASCII.

    With --diff, what changed everywhere comes first, then what differs move by move, in degrees
    and mm; comments, dates, labels and layout do not count. Ends with status 0 if both programs do
    the same, with 1 if not.

    Example: opl show programs/V_SHAPE.JBI --diff programs/V_SHAPE_OLD.JBI
    """
    owner = opl.load_robot(robot)
    if pulses is not None:
        owner = opl.with_ratios(owner, pulses)
    if other is not None:
        lines = opl.compare_programs(program, other, owner)
        click.echo("\n".join(lines) or "both do the same")
        sys.exit(1 if lines else 0)
    click.echo("\n".join(opl.describe_program(program, owner)))


@click.command()
@click.argument("job", type=FILE)
@click.argument("programs", type=FILE, nargs=-1, required=True, metavar="PROGRAM...")
@click.option("--json", "as_json", is_flag=True, help="Print what was proven as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def verify(job: Path, programs: tuple[Path, ...], as_json: bool, quiet: bool) -> None:
    """Read a program back and prove it against the cell of a job.

    It may be of any controller that opl reads: INFORM, RAPID, KRL, FANUC TP or UR script. Nothing
    is known of how it was planned: its positions are turned back into joint angles, the moves made
    as the controller makes them, and what is ground is recognised from where the part is. Give the
    master and all parts of a program that is split. Beside the result.json of its run, a program
    must be what was written then to the last byte.

    Ends with status 0 if the program is proven, with 4 and the reasons if not.

    Example: opl verify workpieces/v_shape/job.yaml out/V_SHAPE/V_SHAPE.JBI
    """
    loaded = opl.load_job(job)
    proof = opl.prove_program(loaded, programs)
    if as_json:
        click.echo(opl.to_json(proof.report))
    elif not quiet:
        from opl.cli.run_text import show_proof  # with rich

        robot = loaded.cell.robot
        show_proof(proof.report, robot.title, robot.joint_names)
    if not proof.proven:
        raise opl.UnsafeError("\n".join(["not proven", *map(str, proof.findings)]))


@click.group()
def templates() -> None:
    """What a template of one's own has to know."""


@templates.command("vars")
@click.argument("controller", required=False)
def template_vars(controller: str | None) -> None:
    """Print what templates get: names and meanings, of one controller or of all.

    Example: opl templates vars DX200
    """
    for name in opl.known_posts() if controller is None else [controller]:
        post = opl.find_post(name)
        click.echo(f"{name}: {post.title}, layout {post.template}")
        width = max(len(variable) for variable in post.variables)
        for variable, meaning in post.variables.items():
            click.echo(f"  {variable:{width}}  {meaning}")
