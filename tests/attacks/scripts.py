"""Written programs of every language as moves and lines, to be tampered with and put together.

This knows nothing of opl's own readers: a fault has to reach the file as somebody with an editor
would put it there.
"""

import re
from copy import deepcopy
from dataclasses import dataclass, field


@dataclass
class Move:
    """A move: its word, the six texts of its target, speed, corner, tool, and lines after it."""

    word: str
    target: list
    speed: str
    corner: str
    tool: str = ""
    more: str = ""
    lines: list = field(default_factory=list)


@dataclass
class Script:
    """A program: what stands before its moves, the moves, and what stands behind."""

    head: list
    moves: list
    foot: list

    def copy(self):
        return deepcopy(self)


@dataclass(frozen=True)
class Language:
    """How a language is tampered with.

    Attributes:
        parse: Text to `Script`.
        render: And back.
        degrees: Text of a target's number turned by degrees, given text, degrees and axis.
        seconds: Whether the number of a speed is a time.
        stop: A corner with a stop, a usual one, and one that is too large.
        words: Lines by what they do.
        straight: The word of a straight move to the same target, None where it needs a pose.
    """

    parse: object
    render: object
    degrees: object
    seconds: bool
    corners: tuple
    words: dict
    straight: str | None = None


def _decimal(text, degrees, axis, factor=1.0):
    decimals = len(text.partition(".")[2])
    return f"{float(text) + degrees * factor:.{decimals}f}"


# INFORM

_PULSES = (1341.383, 1907.677, 1592.894, 1022.865, 980.240, 454.756)  # near those of an MH24
_MOVJ = re.compile(r"(MOV[JL]) (C\d+) (?:VJ|V)=([0-9.]+) PL=(\d)(.*)")


def _parse_inform(text):
    lines = text.split("\r\n")[:-1]
    values = dict(line.split("=") for line in lines if re.match(r"C\d+=", line))
    nop = lines.index("NOP")
    script = Script([line for line in lines[: nop + 1] if not re.match(r"C\d+=", line)], [], [])
    for line in lines[nop + 1 : -1]:
        if found := _MOVJ.fullmatch(line):
            word, label, speed, level, more = found.groups()
            script.moves.append(Move(word, values[label].split(","), speed, level, more=more))
        else:
            (script.moves[-1].lines if script.moves else script.head).append(line)
    return script


def _render_inform(script):
    moves, nop = script.moves, script.head.index("NOP")
    head, first = script.head[: nop + 1], script.head[nop + 1 :]
    head = [f"///NPOS {len(moves)},0,0,0,0,0" if h.startswith("///NPOS") else h for h in head]
    at = head.index("//INST")
    positions = [f"C{k:05d}={','.join(move.target)}" for k, move in enumerate(moves)]
    body = []
    for k, move in enumerate(moves):
        tag = "V" if move.word == "MOVL" else "VJ"
        level = f" PL={move.corner}" if move.corner else ""
        speed = f" {tag}={move.speed}" if move.speed else ""
        body += [f"{move.word} C{k:05d}{speed}{level}{move.more}", *move.lines]
    whole = [*head[:at], *positions, *head[at:], *first, *body, *script.foot, "END", ""]
    return "\r\n".join(whole)


# the languages of one move a line


def _by_lines(pattern, end):
    """Return a parser of programs whose moves match a pattern of one line or more."""

    def parse(text):
        script, last = Script([], [], []), 0
        for found in pattern.finditer(text):
            between = text[last : found.start()]
            (script.moves[-1].lines if script.moves else script.head).append(between)
            groups = found.groupdict()
            target = re.split(r", ?", groups["target"])
            script.moves.append(
                Move(
                    groups["word"],
                    target,
                    groups["speed"],
                    groups["corner"],
                    groups.get("tool") or "",
                )
            )
            last = found.end()
        rest = text[last:]
        at = rest.rindex(end)
        script.moves[-1].lines.append(rest[:at])
        script.foot.append(rest[at:])
        return script

    return parse


def _joined(script, line, end):
    """Return a text; lines that were added stand alone, pieces of the file as they were."""
    text = "".join(script.head)
    for k, move in enumerate(script.moves):
        text += line(move, k)
        for piece in move.lines:
            text += piece if piece.endswith("\n") or not piece else piece + end
    return text + "".join(script.foot)


_RAPID = re.compile(
    r" *(?P<word>MoveAbsJ) \[\[(?P<target>[^]]*)\],\[[^]]*\]\]\\NoEOffs, "
    r"(?P<speed>v50|v1000\\T:=[0-9.]+), "
    r"(?P<corner>\w+), (?P<tool>\w+);\r\n"
)


def _render_rapid(script):
    axes = "[9E9,9E9,9E9,9E9,9E9,9E9]"

    def line(move, k):
        return (
            f"    {move.word} [[{','.join(move.target)}],{axes}]\\NoEOffs, {move.speed}, "
            f"{move.corner}, {move.tool};\r\n"
        )

    return _joined(script, line, "\r\n")


_KRL = re.compile(
    r"(?:BAS\(#VEL_PTP, |\$VEL\.CP = )(?P<speed>[0-9.]+)\)?\r\n"
    r"(?P<word>PTP|LIN) \{(?P<target>[^}]*)\}(?P<corner>[^\r]*)\r\n"
)
_AXES = {"PTP": [f"A{axis}" for axis in range(1, 7)], "LIN": list("XYZABC")}


def _parse_krl(text):
    script = _by_lines(_KRL, "END")(text)
    for move in script.moves:
        move.target = [item.split()[1] for item in move.target]
    return script


def _render_krl(script):
    def line(move, k):
        pairs = zip(_AXES[move.word], move.target, strict=True)
        target = ",".join(f"{axis} {value}" for axis, value in pairs)
        speed = f"$VEL.CP = {move.speed}" if move.word == "LIN" else f"BAS(#VEL_PTP, {move.speed})"
        speed = f"{speed}\r\n" if move.speed else ""
        return f"{speed}{move.word} {{{target}}}{move.corner}\r\n"

    return _joined(script, line, "\r\n")


_LS_MOVE = re.compile(r"([JL]) P\[(\d+)\] (\d+(?:msec|%)) (\w+) ?")
_LS_AXES = re.compile(r"J[1-6]= *([-0-9.]+) deg")


def _parse_fanuc(text):
    head, rest = text.split("/MN\r\n")
    body, positions = rest.split("/POS\r\n")
    axes = [_LS_AXES.findall(one) for one in positions.split("};")[:-1]]
    script = Script([head], [], [positions])
    for line in body.split("\r\n")[:-1]:
        inner = line.partition(":")[2].rsplit(";")[0].rstrip()
        if found := _LS_MOVE.fullmatch(inner):
            word, number, speed, corner = found.groups()
            script.moves.append(Move(word, axes[int(number) - 1], speed, corner))
        else:
            (script.moves[-1].lines if script.moves else script.head).append(inner)
    return script


def _render_fanuc(script):
    lines, first = [*script.head[1:]], script.foot[0].split("};")[0]
    positions = ""
    for k, move in enumerate(script.moves, 1):
        lines += [f"{move.word} P[{k}] {move.speed} {move.corner}", *move.lines]
        values = iter(move.target)
        own = _LS_AXES.sub(lambda m, new=values: m[0].replace(m[1], next(new)), first)
        tool = f"UT : {move.tool}" if move.tool else None
        own = re.sub(r"UT : \d+", tool, own) if tool else own
        positions += re.sub(r"P\[\d+\]", f"P[{k}]", own.lstrip()) + "};\r\n"
    numbered = "".join(f"{k:4d}:{line} ;\r\n" for k, line in enumerate(lines, 1))
    head = re.sub(r"LINE_COUNT( *)= \d+", rf"LINE_COUNT\1= {len(lines)}", script.head[0])
    return f"{head}/MN\r\n{numbered}/POS\r\n{positions}/END\r\n"


_UR = re.compile(
    r" *(?P<word>movej)\(\[(?P<target>[^]]*)\], (?P<speed>t=[0-9.]+|a=0.3, v=[0-9.]+), "
    r"r=(?P<corner>[0-9.]+)\)\n"
)


def _render_ur(script):
    def line(move, k):
        speed = f"{move.speed}, " if move.speed else ""
        return f"  {move.word}([{', '.join(move.target)}], {speed}r={move.corner})\n"

    return _joined(script, line, "\n")


LANGUAGES = {
    "DX200": Language(
        _parse_inform,
        _render_inform,
        lambda text, degrees, axis: str(round(int(text) + degrees * _PULSES[axis])),
        False,
        ("0", "1", "8"),
        {
            "output on": "DOUT OT#(12) ON",
            "output off": "DOUT OT#(12) OFF",
            "another output": "DOUT OT#(77) ON",
            "dwell": "TIMER T=60.00",
            "short dwell": "TIMER T=0.10",
            "wait": "WAIT IN#(9)=ON",
            "pause": "PAUSE",
            "foreign call": "CALL JOB:OTHER",
            "known call": "CALL JOB:PARK",
            "jump to itself": "*HERE\r\nJUMP *HERE",
            "pulse": "PULSE OT#(5) T=1.00",
            "analog": "AOUT AO#(1) 5.00",
            "group of outputs": "DOUT OG#(3) B000",
            "message": 'MSG "HELLO"',
            "variable": "SET B000 1",
            "shift": "SFTON P001 UF#(1)",
            "speed for all": "SPEED VJ=50.00",
            "conditional stop": "PAUSE IF IN#(9)=ON",
            "conditional jump": "*OVER\r\nJUMP *OVER IF IN#(9)=ON",
            "other tool": "SETTOOL TL#(9) P00095",
            "input read": "DIN B016 IN#(12)",
            "remark": "'A REMARK",
            "unknown": "GRINDFAST 3",
        },
        "MOVL",
    ),
    "RAPID": Language(
        _by_lines(_RAPID, "    ConfL\\On;"),
        _render_rapid,
        _decimal,
        True,
        ("fine", "z0", "z50"),
        {
            "output on": "SetDO do12, 1;",
            "output off": "SetDO do12, 0;",
            "another output": "SetDO do77, 1;",
            "dwell": "WaitTime 60.00;",
            "short dwell": "WaitTime 0.10;",
            "wait": "WaitDI di9, 1;",
            "pause": "Stop;",
            "foreign call": "OTHER;",
            "known call": "PARK;",
            "jump to itself": "here:\r\nGOTO here;",
            "pulse": "PulseDO \\PLength:=1.0, do5;",
            "analog": "SetAO ao1, 5;",
            "group of outputs": "SetGO go3, 7;",
            "message": 'TPWrite "HELLO";',
            "variable": "reg1 := 1;",
            "shift": "PDispSet frame1;",
            "speed for all": "VelSet 200, 5000;",
            "conditional stop": "IF di9 = 1 Stop;",
            "conditional jump": "WHILE late DO\r\nENDWHILE",
            "other tool": "GripLoad load3;",
            "input read": "reg2 := di12;",
            "remark": "! A REMARK",
            "unknown": "GrindFast 3;",
        },
    ),
    "KRL": Language(
        _parse_krl,
        _render_krl,
        _decimal,
        False,
        ("", " C_PTP", " C_VEL"),
        {
            "output on": "$OUT[12] = TRUE",
            "output off": "$OUT[12] = FALSE",
            "another output": "$OUT[77] = TRUE",
            "dwell": "WAIT SEC 60.00",
            "short dwell": "WAIT SEC 0.10",
            "wait": "WAIT FOR $IN[9] == TRUE",
            "pause": "HALT",
            "foreign call": "OTHER()",
            "known call": "PARK()",
            "jump to itself": "HERE:\r\nGOTO HERE",
            "pulse": "PULSE($OUT[5], TRUE, 1.0)",
            "analog": "$ANOUT[1] = 0.5",
            "group of outputs": "SIGNAL MINE $OUT[1] TO $OUT[8]",
            "message": 'MsgNotify("HELLO")',
            "variable": "$TIMER[1] = -5000",
            "shift": "$BASE = BASE_DATA[1]",
            "speed for all": "$OV_PRO = 100",
            "conditional stop": "IF $IN[9] == TRUE THEN\r\nHALT\r\nENDIF",
            "conditional jump": "REPEAT\r\nUNTIL $IN[9] == TRUE",
            "other tool": "$TOOL = TOOL_DATA[2]",
            "input read": "MYVAR = $IN[12]",
            "remark": "; A REMARK",
            "unknown": "GRINDFAST 3",
        },
    ),
    "FANUC": Language(
        _parse_fanuc,
        _render_fanuc,
        _decimal,
        True,
        ("FINE", "CNT100", "CNT200"),
        {
            "output on": "  DO[12]=ON",
            "output off": "  DO[12]=OFF",
            "another output": "  DO[77]=ON",
            "dwell": "  WAIT 60.00(sec)",
            "short dwell": "  WAIT 0.10(sec)",
            "wait": "  WAIT DI[9]=ON",
            "pause": "  PAUSE",
            "foreign call": "  CALL OTHER",
            "known call": "  CALL PARK",
            "jump to itself": "  JMP LBL[1]",
            "pulse": "  DO[5]=PULSE,1.0sec",
            "analog": "  AO[1]=5",
            "group of outputs": "  GO[3]=7",
            "message": "  MESSAGE[HELLO]",
            "variable": "  $WAITTMOUT=9000",
            "shift": "  OFFSET CONDITION PR[1]",
            "speed for all": "  OVERRIDE=100%",
            "conditional stop": "  IF DI[9]=ON,CALL OTHER",
            "conditional jump": "  IF DI[9]=ON,JMP LBL[1]",
            "other tool": "  UTOOL_NUM=2",
            "input read": "  R[1]=DI[12]",
            "remark": "  !A REMARK",
            "unknown": "  GRINDFAST 3",
        },
        "L",
    ),
    "URSCRIPT": Language(
        _by_lines(_UR, "end"),
        _render_ur,
        lambda text, degrees, axis: _decimal(text, degrees, axis, 0.017453292519943295),
        True,
        ("0.00000", "0.00030", "0.05000"),
        {
            "output on": "set_standard_digital_out(12, True)",
            "output off": "set_standard_digital_out(12, False)",
            "another output": "set_standard_digital_out(77, True)",
            "dwell": "sleep(60.00)",
            "short dwell": "sleep(0.10)",
            "wait": "while get_standard_digital_in(9) != True:\nsync()\nend",
            "pause": 'popup("stop", blocking=True)',
            "foreign call": "OTHER()",
            "known call": "PARK()",
            "jump to itself": "while True:\nsync()\nend",
            "pulse": "set_standard_digital_out(5, True)\nsleep(1.0)",
            "analog": "set_standard_analog_out(1, 0.5)",
            "group of outputs": "write_port_register(3, 7)",
            "message": 'textmsg("HELLO")',
            "variable": "waited = 0.0",
            "shift": "set_tcp(p[0.1, 0, 0, 0, 0, 0])",
            "speed for all": "set_speed(1.0)",
            "conditional stop": "if get_standard_digital_in(9):\nhalt\nend",
            "conditional jump": "while get_standard_digital_in(9) != True:\nend",
            "other tool": "set_payload(3.0)",
            "input read": "x = get_standard_digital_in(12)",
            "remark": "# A REMARK",
            "unknown": "grindfast(3)",
        },
        "movel",
    ),
}
