"""Condition files of Yaskawa controllers: UFRAME.CND has user frames, TOOL.CND tools.

They lie beside a job as what it was proven with: to be loaded, or to be compared with at the
pendant. Their lines are those of files saved by controllers and of another post-processor; of a
tool these are its pose, the centre of gravity, the mass and the moments of inertia.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np

from opl.errors import InputError
from opl.findings import Finding, Level
from opl.geometry.frames import Array
from opl.program.controller import ControllerProfile
from opl.program.digits import fixed
from opl.program.inform.cartesian import rectan
from opl.program.loads import carried
from opl.program.settings import PositionForm, ProgramSettings

USER_FRAMES, TOOLS = "UFRAME.CND", "TOOL.CND"
_ENTRY = re.compile(r"//(?:UFRAME|TOOL) ([0-9]{1,3})")
_POSE = re.compile(r"(?:////BUSER )?((?:-?[0-9]{1,7}\.[0-9]{1,6},){5}-?[0-9]{1,7}\.[0-9]{1,6})")
_GROUPS = 32  # of axes that a user frame can be of
# A pose may differ by so much in [mm] and [deg]: half of the last digit of the coarsest controller.
_SAME = np.array([5.1e-4] * 3 + [5.1e-3] * 3)


def condition_files(settings: ProgramSettings, profile: ControllerProfile) -> dict[str, str]:
    """Return the condition files that a program needs, by their names."""
    files = {}
    frame = settings.user_frame
    if settings.positions is PositionForm.USER and frame is not None:
        lines = [
            f"//UFRAME {frame.number}",
            "///NAME",
            "///TOOL 0",
            f"///GROUP {','.join(['1', *['0'] * (_GROUPS - 1)])}",
            "///PULSE",
            # not taught: three points that stand for none
            *(f"////{key} C{k:03d}=0,0,0,0,0,0" for k, key in enumerate(("RORG", "RXX", "RXY"))),
            f"////BUSER {_shown(frame.T_base_user, profile)}",
        ]
        files[USER_FRAMES] = "\r\n".join([*lines, ""])
    load = carried(settings) or settings.load
    if settings.tool or load is not None:
        mass = 0.0 if load is None else load.mass
        centre = np.zeros(3) if load is None else load.p_flange * 1e3
        lines = [
            f"//TOOL {settings.tool}",
            "///NAME",
            _shown(settings.T_flange_tool, profile),
            ",".join(fixed(float(value), 3) for value in centre),
            fixed(mass, 3),
            *("0.000,0.000,0.000", "0.000,0,1"),
        ]
        files[TOOLS] = "\r\n".join([*lines, ""])
    return files


def frame_comments(settings: ProgramSettings, profile: ControllerProfile) -> tuple[str, ...]:
    """Return the comment lines that tell a person where the user frame of a job is."""
    frame = settings.user_frame
    if settings.positions is not PositionForm.USER or frame is None:
        return ()
    values = _shown(frame.T_base_user, profile).split(",")
    named = [f"{name} {value}" for name, value in zip(("X", "Y", "Z", "RX", "RY", "RZ"), values,
                                                      strict=True)]  # fmt: skip
    return tuple(f"UF{frame.number} {' '.join(named[k : k + 2])}" for k in (0, 2, 4))


def condition_findings(
    files: Mapping[str, bytes], settings: ProgramSettings, profile: ControllerProfile
) -> Iterator[Finding]:
    """Give what condition files say of the frame and the tool of a job that the job does not.

    Args:
        files: Content of condition files by what messages call them.
        settings: Of the job.
        profile: The controller.

    Raises:
        InputError: If one of them is no such file.
    """
    frame = settings.user_frame
    for source, data in files.items():
        tools = source.upper().endswith(TOOLS)
        poses = _poses(data.decode("latin-1"), source)
        number = settings.tool if tools else None if frame is None else frame.number
        if number not in poses:
            continue  # of others: the job says nothing of them
        pose = settings.T_flange_tool if tools else None if frame is None else frame.T_base_user
        assert pose is not None
        wanted = _shown(pose, profile)
        apart = np.array(poses[number]) - [float(value) for value in wanted.split(",")]
        apart[3:] = np.remainder(apart[3:] + 180.0, 360.0) - 180.0
        if (np.abs(apart) > _SAME).any():
            what = "tool" if tools else "user frame"
            seen = ",".join(f"{value:g}" for value in poses[number])
            message = f"{what} {number} is at {seen}, that of the job at {wanted}"
            yield Finding(Level.ERROR, "frame", source, message)


def _poses(text: str, source: str) -> dict[int | None, tuple[float, ...]]:
    """Return the pose of each entry in [mm] and [deg] by its number."""
    found: dict[int | None, tuple[float, ...]] = {}
    number: int | None = None
    for line in re.split(r"\r\n?|\n", text):
        if entry := _ENTRY.fullmatch(line.strip()):
            number = int(entry[1])
        elif number is not None and number not in found and (row := _POSE.fullmatch(line.strip())):
            found[number] = tuple(float(value) for value in row[1].split(","))
    if not found:
        raise InputError(source, "holds no user frame and no tool")
    return found


def _shown(T: Array, profile: ControllerProfile) -> str:
    return rectan(T[None], profile)[0]
