"""Reading an INFORM job as controllers write it, in any encoding, without losing a byte.

Headers of the position list hold until they are changed (///TOOL, ///USER, ///POSTYPE, ///RECTAN,
///RCONF ...), so each position gets those in force. Headers nobody knows stay where they are.
"""

from __future__ import annotations

import re

from opl.errors import InputError
from opl.program.inform.job import Header, InformJob, Instruction, Position, read_label

BYTE_ORDER_MARK = "\ufeff"

# Controllers save ASCII and the code page of their language, copies in repositories are UTF-8. The
# last takes any byte.
_ENCODINGS = ("ascii", "utf-8", "cp932", "latin-1")
# Bytes of Latin-1 are mostly some of Shift-JIS too: it is Japanese if two letters of it stand
# together, kana or kanji or both; an umlaut among ASCII letters makes no such pair.
_JAPANESE = re.compile("[\u3000-\u30ff\u3400-\u9fff\uff01-\uff9f]{2}")
_LINE_END = re.compile(r"\r\n?|\n")
_HEADER = re.compile(r"(/{1,4}[A-Z]+[0-9]*)(?:[ \t]+(.*))?")
_POSITION = re.compile(r"([A-Z]+[0-9]+)=(.*)")
_NUMBER = re.compile(r"[+-]?[0-9]{1,12}(?:\.[0-9]*)?|[+-]?\.[0-9]{1,12}")
_INTEGER = re.compile(r"[+-]?[0-9]{1,12}")
# a comment opens at the first // outside a quoted text
_TRAILING_COMMENT = re.compile(r'((?:[^"/]|"[^"]*"|/(?!/))*)//(.*)')
# + opens a coupled move only before a move word: it may also be part of an expression
_COUPLED = re.compile(r"[ \t]+\+(?=S?MOV)")


def decode(data: bytes) -> tuple[str, str]:
    """Return the text of a job file and its encoding, found by trial.

    The encoding gives the same bytes again.
    """
    for encoding in _ENCODINGS:
        try:
            text = data.decode(encoding)
            if text.encode(encoding) == data and (encoding != "cp932" or _JAPANESE.search(text)):
                return text, encoding
        except UnicodeError:
            continue
    raise AssertionError("latin-1 takes any byte")


def parse(text: str, source: str = "job") -> InformJob:
    """Read one job.

    Args:
        text: The file, its lines ended by CR LF, LF or CR.
        source: What messages call it.

    Raises:
        InputError: If the text is no job; the message names the line.
    """
    lines = tuple(_LINE_END.split(text))
    if lines[0].lstrip(BYTE_ORDER_MARK).rstrip() != "/JOB":
        raise _error(source, 1, f"a job begins with /JOB, got {_shown(lines[0])}")
    for number, line in enumerate(lines[1:], start=2):
        if line.rstrip() == "/JOB":
            raise _error(source, number, "a second job begins; read_jobs reads several")
    first, last = _body(lines, source)
    headers, positions, aliases = _head(lines[: first - 1], source)
    names = [header for header in headers if header.key == "//NAME"]
    if len(names) != 1:
        raise _error(source, 2, f"a job has one //NAME, this one has {len(names)}")
    npos = [header for header in headers if header.key == "///NPOS"]
    return InformJob(
        lines=lines,
        name=names[0].value,
        npos=_integers(npos[0], source) if npos else (),
        headers=headers,
        positions=positions,
        instructions=tuple(
            _instruction(number, lines[number - 1]) for number in range(first + 1, last)
        ),
        aliases=aliases,
    )


def read_jobs(text: str, source: str = "job") -> tuple[InformJob, ...]:
    """Read a file that may hold several jobs, one after the other.

    Args:
        text: The file, its lines ended by CR LF, LF or CR.
        source: What messages call it.

    Raises:
        InputError: If one of them is no job; the message names the line in that job.
    """
    lines = _LINE_END.split(text)
    starts = [k for k, line in enumerate(lines) if k and line.rstrip() == "/JOB"]
    pieces = [lines[a:b] for a, b in zip([0, *starts], [*starts, len(lines)], strict=True)]
    sources = (
        [source] if len(pieces) == 1 else [f"{source} ({k})" for k in range(1, len(pieces) + 1)]
    )
    return tuple(parse("\n".join(piece), name) for piece, name in zip(pieces, sources, strict=True))


def unparse(job: InformJob) -> str:
    """Return the file of a job, the same as it was read but for line ends, which are CR LF."""
    return "\r\n".join(job.lines)


def _body(lines: tuple[str, ...], source: str) -> tuple[int, int]:
    """Return the line numbers of NOP and END."""
    # a comment may follow on the line of NOP or END
    words = [line.partition("//")[0].rstrip() or line.rstrip() for line in lines]
    places = [0]
    for word in ("//INST", "NOP", "END"):
        try:
            places.append(words.index(word, places[-1]) + 1)
        except ValueError:
            raise _error(source, len(lines), f"the job ends without {word}") from None
    return places[2], places[3]


def _head(
    lines: tuple[str, ...], source: str
) -> tuple[tuple[Header, ...], tuple[Position, ...], tuple[str, ...]]:
    """Read headers, positions and aliases, which stand before NOP."""
    aliases: list[str] = []
    headers: list[Header] = []
    positions: list[Position] = []
    section = ""
    in_force: dict[str, Header] = {}
    for number, line in enumerate(lines, start=1):
        if match := _HEADER.fullmatch(line.rstrip()):
            header = Header(number, match[1], match[2] or "")
            headers.append(header)
            in_force.update(_meaning(header))
            if header.key.startswith("//") and not header.key.startswith("///"):
                section = header.key
        elif section == "//POS" and not line.startswith("/"):
            # not kept as unknown: a position that cannot be read must not pass unnoticed
            positions.append(_position(number, line, in_force, source))
        elif section == "//ALIAS" and line.strip():
            aliases.append(" ".join(line.split()))
    return tuple(headers), tuple(positions), tuple(aliases)


def _meaning(header: Header) -> dict[str, Header]:
    """Return what a header sets for the positions after it."""
    key, value = header.key.removeprefix("///"), header.value
    if key in ("PULSE", "RECTAN", "ANGLE"):
        return {"coordinates": Header(header.line, header.key, key)}
    if key == "POSTYPE":
        # ///RECTAN is not repeated where only the frame changes
        coordinates = value if value in ("PULSE", "ANGLE") else "RECTAN"
        return {"frame": header, "coordinates": Header(header.line, header.key, coordinates)}
    return {key: header}


def _position(number: int, line: str, in_force: dict[str, Header], source: str) -> Position:
    match = _POSITION.fullmatch(line)
    label = read_label(match[1]) if match else None
    if match is None or label is None:
        raise _error(source, number, f"is neither a header nor a position: {_shown(line)}")
    values = [value.strip(" \t") for value in match[2].split(",")]
    if "coordinates" in in_force:
        coordinates = in_force["coordinates"].value
    else:  # jobs without ///POSTYPE and ///PULSE are found, and play
        coordinates = "PULSE" if all(map(_INTEGER.fullmatch, values)) else ""
    shape = _INTEGER if coordinates == "PULSE" else _NUMBER
    if not all(shape.fullmatch(value) for value in values):
        kind = "pulses are whole numbers" if coordinates == "PULSE" else "positions are numbers"
        raise _error(source, number, f"{kind} with commas between, got {_shown(match[2])}")
    tool, user, rconf = (
        _integers(in_force[key], source) if key in in_force else ()
        for key in ("TOOL", "USER", "RCONF")
    )
    return Position(
        line=number,
        label=match[1],
        kind=label[0],
        number=label[1],
        values=tuple(float(value) for value in values),
        coordinates=coordinates,
        frame=in_force["frame"].value if "frame" in in_force else "",
        tool=tool[0] if tool else None,
        user=user[0] if user else None,
        rconf=rconf,
    )


def _instruction(number: int, line: str) -> Instruction:
    body = line.strip(" \t")
    if body.startswith("'"):
        return Instruction(number, "'", comment=body[1:])
    locked = body.startswith("EDTLCK ")
    body = body.removeprefix("EDTLCK ").lstrip(" \t") if locked else body
    disabled = body.startswith("COMM ")
    body = body.removeprefix("COMM ")
    comment = None
    if match := _TRAILING_COMMENT.fullmatch(body):
        body, comment = match[1], match[2]
    own, *others = (_words(number, part, disabled) for part in _COUPLED.split(body))
    return Instruction(
        number, own.word, own.operands, own.tags, comment, disabled, tuple(others), own.rest
    )


def _words(number: int, part: str, disabled: bool) -> Instruction:
    word, *rest = part.split() or [""]
    return Instruction(
        number,
        word,
        operands=tuple(item for item in rest if "=" not in item),
        tags=tuple((key, value) for key, _, value in (i.partition("=") for i in rest if "=" in i)),
        disabled=disabled,
        rest=tuple(rest),
    )


def _integers(header: Header, source: str) -> tuple[int, ...]:
    items = [item.strip(" \t") for item in header.value.split(",")]
    if not all(_INTEGER.fullmatch(item) for item in items):
        raise _error(
            source, header.line, f"{header.key} takes whole numbers, got {_shown(header.value)}"
        )
    return tuple(int(item) for item in items)


def _error(source: str, number: int, message: str) -> InputError:
    return InputError(f"{source}: line {number}", message)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:37] + "...")
