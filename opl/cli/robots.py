"""Commands around robots: list and show them, their pulses, robots of the user's own."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import click

import opl

FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@click.pass_context
def robots(context: click.Context, as_json: bool) -> None:
    """List the robots that come with opl.

    Example: opl robots
    """
    if context.invoked_subcommand is not None:
        return
    known = [opl.load_robot(name) for name in opl.known_robots()]
    if as_json:
        click.echo(opl.to_json([_figures(robot) for robot in known]))
    else:
        from opl.cli.robot_text import show_robots  # with rich

        show_robots(known)


def _figures(robot: opl.Robot) -> dict[str, Any]:
    return {
        "name": robot.name,
        "title": robot.title,
        "maker": robot.maker,
        "reach_mm": round(robot.reach * 1e3, 1),
        "payload_kg": robot.payload,
        "joint_names": list(robot.joint_names),
        "unverified_pulse_ratios": list(robot.unverified_pulses),
        "missing_pulse_ratios": list(robot.missing_pulses),
    }


@robots.command("show")
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@click.option("--picture", type=FILE, help="SVG to write: the arm with its dimensions and limits.")
def show_data(name: str, as_json: bool, picture: Path | None) -> None:
    """Print what is known of a robot, every number with source and certainty.

    NAME is one of those listed by opl robots, or a folder with a robot.yaml.

    Example: opl robots show gp25 --picture gp25.svg
    """
    robot, file = opl.load_robot(name), opl.read_robot_file(opl.robot_path(name))
    if picture is not None:
        opl.write_file(picture, opl.arm_view(robot))
    if as_json:
        figures = {**_figures(robot), **file.model_dump(exclude={"name", "title", "maker"})}
        click.echo(opl.to_json(figures))
    else:
        from opl.cli.robot_text import show_robot  # with rich

        show_robot(robot, file)
        if picture is not None:
            click.echo(f"wrote {picture}")


@robots.command("import-urdf")
@click.argument("file", type=FILE)
@click.option("--name", required=True, help="Name of the robot.")
@click.option("--out", type=FOLDER, required=True, help="Folder to write; a job names it as robot.")
@click.option("--maker", default="unknown", show_default=True, help="Who builds it.")
@click.option(
    "--base",
    type=click.Choice(["axis-2", "floor"]),
    default="axis-2",
    show_default=True,
    help="Where on axis 1 the base frame lies: at the height of axis 2, or on the mounting face.",
)
def import_description(file: Path, name: str, out: Path, maker: str, base: str) -> None:
    """Make a robot of your own from a URDF, or a xacro (pip install 'opl[xacro]').

    The arm has a spherical wrist, or three parallel axes in the middle as those of Universal
    Robots. The closed form of its inverse kinematics is read off the joint axes and checked on
    random configurations. Meshes are copied. A frame base in the URDF is taken for the controller's
    own.

    Example: opl robots import-urdf my_arm.urdf --name my_arm --out robots/my_arm
    """
    made = opl.import_urdf(file, name, out, base_at_floor=base == "floor", maker=maker)
    click.echo(
        f"{made.robot.name}: arm with {opl.read_robot_file(made.files[0]).arm.family}, "
        f"reach {made.robot.reach * 1e3:.0f} mm"
    )
    click.echo(f"FK(IK) closes within {made.closure:.1g} on random configurations")
    for line in made.cautions:
        click.echo(f"caution: {line}", err=True)
    for path in made.files:
        click.echo(f"wrote {path}")


@robots.command("import-params")
@click.argument("file", type=FILE)
@click.option("--robot", required=True, help="Whose controller the file is from.")
@click.option("--group", type=click.IntRange(1, 8), help="Its group of axes: 2 for R2.")
@click.option("--out", type=FILE, help="File to write; default <robot>_pulses.yaml.")
def import_params(file: Path, robot: str, group: int | None, out: Path | None) -> None:
    """Read pulse ratios, soft limits and corner zones from a controller's parameter file.

    RC.PRM has ratios and limits, ALL.PRM the zones of the position levels PL=1 to PL=8 too. A file
    whose number of axes, soft limits, ratios or links contradict the robot is refused. Writes a
    small file that a job names as program.pulse_ratios.

    Example: opl robots import-params ALL.PRM --robot mh24 --out pulses.yaml
    """
    owner = opl.load_robot(robot)
    made = opl.import_pulse_ratios(file, owner, out or Path(f"{owner.name}_pulses.yaml"), group)
    click.echo(f"group {made.group} of {file.name}, compared with {owner.title}:")
    for line in made.compared:
        click.echo(textwrap.fill(line, 80, initial_indent="  ", subsequent_indent="    "))
    for name, ratio in made.pulses_per_degree.items():
        click.echo(f"{name} {ratio:.2f} pulses per degree")
    if made.zones is None:
        click.echo("zones of the position levels: not in the file, ALL.PRM has them")
    else:
        zones = " ".join(f"{zone * 1e3:g}" for zone in made.zones)
        click.echo(f"zones of PL=1 to PL=8: {zones} mm")
    click.echo(f"wrote {made.file}; name it in the job as {opl.keys.PROGRAM_PULSE_RATIOS}")
