"""What the flange carries: the part from its mesh and density, and the gripper where a job says."""

from __future__ import annotations

from opl.program.digits import fixed
from opl.program.settings import Load, ProgramSettings


def carried(settings: ProgramSettings) -> Load | None:
    """Return the load of gripper and part together, None where one of them is unknown.

    A load that leaves the gripper out is too small for a controller's model of the arm.
    """
    part, gripper = settings.load, settings.gripper
    if part is None or gripper is None:
        return None
    mass = part.mass + gripper.mass
    return Load(mass, (part.mass * part.p_flange + gripper.mass * gripper.p_flange) / mass)


def load_comments(settings: ProgramSettings) -> tuple[str, ...]:
    """Return the lines that tell a person what the flange carries, and where, in its frame."""
    if settings.load is None:
        return ()
    both = carried(settings)
    return (
        *_lines("PART", settings.load),
        *(("GRIPPER NOT IN IT",) if both is None else _lines("WITH GRIPPER", both)),
    )


def _lines(what: str, load: Load) -> tuple[str, str]:
    centre = " ".join(fixed(float(value), 1) for value in load.p_flange * 1e3)
    return f"{what} {fixed(load.mass, 3)} KG", f"CENTRE {centre} MM"
