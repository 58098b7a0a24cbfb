"""The Yaskawa controllers opl writes for. Every limit of a program file is here, with its source.

Sources, in short: DT, the Data Transmission manuals of NX100 (HW0481924) and DX100 (HW0482494); OP,
the NX100 operator's manual; saved, some 130 jobs saved by DX100, DX200 and YRC1000 controllers;
field, what other post-processors keep to; unseen, a figure of the manuals known by hearsay only.
"""

from __future__ import annotations

from dataclasses import replace

from opl.program.controller import ControllerProfile
from opl.program.speeds import SpeedRange


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Words of INFORM II, and those of the usual applications: saved jobs, the rest unseen.
_INFORM_II = _words(
    "NOP END ' MOVJ MOVL MOVC MOVS IMOV SMOVL SMOVC SMOVS SPEED REFP "
    "DOUT DIN WAIT PULSE AOUT ANTOUT TIMER CWAIT ADVINIT ADVSTOP DIST "
    "JUMP CALL RET PAUSE ABORT PSTART PWAIT TSYNC MSG GETARG MACRO1 "
    "SET SETE GETE GETS GETP CLEAR INC DEC ADD SUB MUL DIV AND OR NOT XOR SIN COS ATAN SQRT "
    "CNVRT MFRAME MULMAT INVMAT SFTON SFTOF MSHIFT SETREG GETREG "
    "ARCON ARCOF ARCSET ARATION ARATIOF WVON WVOF WVADJ "
    "HAND HSEN TOOLON TOOLOF SVSPOT GUNCHG"
)
# Words that came with INFORM III
_INFORM_III = _INFORM_II | _words(
    "IFTHENEXP IFTHEN ELSEIFEXP ELSEIF ELSE ENDIF WHILEEXP WHILE ENDWHILE FOR NEXT "
    "SWITCH CASE DEFAULT ENDSWITCH SETTOOL GETPOS VAL ASC CHR$ MID$ LEN CAT$ "
    "FORMCUT SETUALM DIALOG CLS TCPON TCPOF"
)

DX200 = ControllerProfile(
    name="DX200",
    # DT of DX100: 32 for names and comments; longest saved: 27 and 32
    name_length=32,
    comment_length=32,
    # 8 characters after the * (the language extension; longest saved: 8)
    label_length=8,
    # field: other post-processors split at 2000; no saved job has half of that
    step_limit=2000,
    # the remote commands of the controllers count lines with four digits (manuals of NX100, DX)
    line_limit=9999,
    # C00000 in every saved job
    label_digits=5,
    # DT of DX100: six settings and r1 to r18; 24 in every saved job
    rconf_fields=24,
    least_rconf_fields=24,
    # every one of 745 saved positions
    length_decimals=3,
    angle_decimals=4,
    # all of some 480 saved VJ have two decimals; the pendant offers 0.01 to 100.00
    joint_speed=SpeedRange(0.01, 100.0, 2),
    # all of some 2200 saved V have one decimal; 1500 mm/s: unseen. Programs are in mm/s whatever
    # unit the pendant shows (saved jobs hold round figures of cm/min and in/min)
    linear_speed=SpeedRange(0.1, 1500.0, 1),
    # one decimal in the summaries of the INFORM manual; 180 deg/s: unseen
    angular_speed=SpeedRange(0.1, 180.0, 1),
    # all of 448 saved TIMER have two decimals; 655.35 s: summaries of the INFORM manual
    timer=SpeedRange(0.01, 655.35, 2),
    # summaries of the INFORM manual; 20 is saved
    ramp_percent=(20, 100),
    # PL=0 (stop in position) to PL=8
    position_levels=8,
    # summaries of the INFORM manual of YRC1000; other generations, and the decimals: unseen
    corner_radius=SpeedRange(0.1, 6553.5, 1),
    # 64 tools and 63 user frames in DX200 and YRC1000; 24 and 24 before (DT of NX100)
    highest_tool=63,
    highest_user_frame=63,
    # summaries of the INFORM manual
    highest_signal=4096,
    instructions=_INFORM_III,
)

YRC1000 = replace(DX200, name="YRC1000")

# SKILLSND is saved on DX100 only; a DX200 raises alarm 4430 for it
DX100 = replace(DX200, name="DX100", instructions=_INFORM_III | {"SKILLSND"})

NX100 = replace(
    DX200,
    name="NX100",
    # DT of NX100; some later software takes 32, which a program for all cannot rely on
    name_length=8,
    # the remote commands count steps with three digits
    step_limit=999,
    # DT of NX100 names 6 to 8 fields, jobs of that generation have 8; the first six are the ones
    # with a meaning
    rconf_fields=8,
    least_rconf_fields=6,
    # jobs of that generation have two decimals of angles
    angle_decimals=2,
    # DT of NX100: 0 to 23; user frames 1 to 24
    highest_tool=23,
    highest_user_frame=24,
    # 1024 signals: unseen
    highest_signal=1024,
    instructions=_INFORM_II,
)

PROFILES = {profile.name: profile for profile in (NX100, DX100, DX200, YRC1000)}
