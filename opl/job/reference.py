"""What every key of job and cell files means: as a JSON schema for editors, as a page for people.

Both are made from the models that files are checked against, so they cannot say anything else.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Literal

from opl.files.documents import Document
from opl.job.cell_file import CellFile
from opl.job.file import JobFile

Schema = dict[str, Any]

# unit by the end of a key; the longer end counts
_UNITS = {
    "_deg_s2": "deg/s2",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_deg": "deg",
    "_percent": "%",
    "_s": "s",
}
_TYPES = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "`true` or `false`",
    "object": "numbers by name",
}
_REF = "#/$defs/"


def json_schema(kind: Literal["job", "cell"] = "job") -> Schema:
    """Return the JSON schema of job files or of cell files, for editors.

    Each description ends with unit, default and range.

    Args:
        kind: Which of them.
    """
    made = (CellFile if kind == "cell" else JobFile).model_json_schema()
    definitions = made["$defs"]
    for one in (made, *definitions.values()):
        for key, value in one["properties"].items():
            unit, allowed = unit_of(key, value), _allowed_of(value)
            default = _default(value, key in one.get("required", []))
            facts = [f"[{unit}]"] if unit else []
            facts += [f"Default: {default}."] if default not in ("required", "-") else []
            facts += [f"Allowed: {allowed}."] if allowed else []
            value["description"] = " ".join([_meaning(value, definitions), *facts]).replace("`", "")
    return made


def keys_page() -> str:
    """Return the page of all keys, in Markdown."""
    lines = [
        "# Keys of job and cell files",
        "",
        "Made by `opl schema --markdown` from the models that files are checked against.",
        "Every key that has a unit carries it in its name; `mm or deg` is mm across the flat of "
        "the wheel and degrees of roll about its edges. Unknown keys are refused.",
    ]
    for model in (JobFile, CellFile):
        lines += _sections(model)
    return "\n".join(lines) + "\n"


def unit_of(key: str, value: Schema) -> str:
    """Return the unit of a key, empty if it has none."""
    given = value.get("unit", _inner(value).get("unit"))
    return str(given or next((unit for end, unit in _UNITS.items() if key.endswith(end)), ""))


def _sections(model: type[Document]) -> Iterator[str]:
    """Yield the lines of a file: its own keys, then each section where it is first used."""
    made = model.model_json_schema()
    definitions: dict[str, Schema] = made["$defs"]
    places: dict[str, list[str]] = {}

    def visit(one: Schema, path: str) -> None:
        for key, value in one["properties"].items():
            name, here = _reference(value), f"{path}{key}"
            if name is not None:
                places.setdefault(name, []).append(here)
                visit(definitions[name], f"{here}.")

    visit(made, "")
    yield from ("", f"## {made['title']}", "", made["description"], "")
    yield from _table(made, definitions)
    for name, used in places.items():
        one = definitions[name]
        keys = ", ".join(f"`{place}`" for place in used)
        yield from ("", f"### {one['title']}: {keys}", "", one["description"], "")
        yield from _table(one, definitions)


def _table(one: Schema, definitions: dict[str, Schema]) -> Iterator[str]:
    yield "| key | type | unit | default | allowed | meaning |"
    yield "|---|---|---|---|---|---|"
    for key, value in one["properties"].items():
        cells = [
            f"`{key}`",
            " or ".join(_type(option, definitions) for option in _options(value)),
            unit_of(key, value) or "-",
            _default(value, key in one.get("required", [])),
            _allowed_of(value) or "-",
            _meaning(value, definitions),
        ]
        yield f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _options(value: Schema) -> list[Schema]:
    """Return the schemas that a value may have if it is not left out."""
    options = [option for option in value.get("anyOf", []) if option.get("type") != "null"]
    return options or [value]


def _inner(value: Schema) -> Schema:
    """Return the schema of a value that may also be left out, the first of several."""
    return _options(value)[0]


def _reference(value: Schema) -> str | None:
    """Return the name of the section that a key holds, or a list of such sections."""
    inner = _inner(value)
    inner = inner.get("items", inner)
    return inner["$ref"].removeprefix(_REF) if "$ref" in inner else None


def _meaning(value: Schema, definitions: dict[str, Schema]) -> str:
    """Return the description of a key, which pydantic leaves out where its section has the same."""
    name = _reference(value)
    return str(value.get("description") or definitions[name or ""]["description"])


def _type(inner: Schema, definitions: dict[str, Schema]) -> str:
    if "$ref" in inner:
        return f"keys of {definitions[inner['$ref'].removeprefix(_REF)]['title']}"
    if inner.get("type") != "array":
        return _TYPES[inner["type"]]
    least, most = inner.get("minItems"), inner.get("maxItems")
    count = f"{least} " if least is not None and least == most else ""
    item = inner["items"]
    if item.get("type") == "array":
        rows = _type(item, definitions).removeprefix("list of ")
        return f"list of {count}times {rows}" if count else f"list of lists of {rows}"
    word = _type(item, definitions)
    word += "s" if word in ("number", "whole number", "text") else ""
    return f"list of {count}{word}"


def _default(value: Schema, required: bool) -> str:
    if required:
        return "required"
    default = value.get("default")
    if default is None or _reference(value) is not None:
        return "-"
    return f"`{json.dumps(default)}`".replace('"', "")


def _allowed_of(value: Schema) -> str:
    """Return what is allowed of any of the types that a value may have."""
    return " or ".join(filter(None, map(_allowed, _options(value))))


def _allowed(inner: Schema) -> str:
    """Return the range or the values that are allowed, empty if all of the type are."""
    if "items" in inner:
        count = f"{inner['minItems']} or more" if "minItems" in inner else ""
        each = _allowed(inner["items"])
        return (f"each {each}" if each else "") or ("" if "maxItems" in inner else count)
    if "enum" in inner:
        return ", ".join(f"`{one}`" for one in inner["enum"])
    low, high = inner.get("minimum"), inner.get("maximum")
    above, below = inner.get("exclusiveMinimum"), inner.get("exclusiveMaximum")
    bounds = [f">= {low:g}"] if low is not None else []
    bounds += [f"> {above:g}"] if above is not None else []
    bounds += [f"<= {high:g}"] if high is not None else []
    bounds += [f"< {below:g}"] if below is not None else []
    return ", ".join(bounds)
