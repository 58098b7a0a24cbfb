"""YAML and JSON files that people write, checked against a pydantic model.

The one home of pydantic's errors: whatever is wrong with a file becomes an `InputError`
that names the file, the key path, the value seen and the values allowed.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from opl.errors import InputError
from opl.files import yaml_text
from opl.files.reading import MB, read_text

MOST_YAML, MOST_JSON = 4 * MB, 40 * MB  # JSON is read ten times as fast
MOST_FAULTS = 20  # that are told of one file


class Document(BaseModel):
    """A mapping in a file: unknown keys, numbers as text, infinities and NaN are refused.

    Attributes:
        renamed: Keys of earlier versions, and what they are called now.
        retired: Keys of earlier versions without a successor, and why none is needed.
    """

    renamed: ClassVar[Mapping[str, str]] = {}
    retired: ClassVar[Mapping[str, str]] = {}

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, ser_json_inf_nan="constants"
    )


Model = TypeVar("Model", bound=BaseModel)


def read(path: Path, model: type[Model]) -> Model:
    """Read a YAML or JSON file.

    Args:
        path: The file.
        model: What it must hold.

    Raises:
        InputError: If the file cannot be read, is not YAML, or does not fit the model. All the
            faults of a file are reported at once, one a line.
    """
    return check(content_of(path), model, str(path))


def keys(path: Path) -> dict[Any, Any]:
    """Return what a YAML file holds, unchecked; empty if it holds no keys and values.

    Raises:
        InputError: If the file cannot be read or is not YAML.
    """
    found = content_of(path)
    return found if isinstance(found, dict) else {}


def check(
    content: object, model: type[Model], label: str, context: Mapping[str, object] | None = None
) -> Model:
    """Return keys and values as a model.

    Args:
        content: What a file holds, or a mapping that a program has made.
        model: What it must hold.
        label: How messages name it.
        context: What the validators of the model need to know beside it.

    Raises:
        InputError: If it does not fit the model.
    """
    if content is None:
        raise InputError(label, "is empty")
    if not isinstance(content, dict):
        raise InputError(label, f"must hold keys and values, holds {_seen(content)}")
    try:
        return model.model_validate(content, context=context)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        # a key under its old name is not missing as well
        there = {_new_place(fault["loc"], model) for fault in faults if _is_unknown(fault)}
        lines = [
            _fault(fault, model)
            for fault in faults
            if not (fault["type"] == "missing" and fault["loc"] in there)
        ]
        if len(lines) > 1:
            more = len(lines) - MOST_FAULTS
            told = [*lines[:MOST_FAULTS], *([f"and {more} more"] if more > 0 else [])]
            lines = [f"{len(lines)} faults", *told]
        raise InputError(label, "\n".join(lines)) from error


def content_of(path: Path) -> Any:
    """Return what a YAML or JSON file holds, unchecked.

    Raises:
        InputError: If the file cannot be read or is not YAML.
    """
    as_json = path.suffix.lower() == ".json"
    text = read_text(path, MOST_JSON if as_json else MOST_YAML)
    try:
        return _json(text) if as_json else yaml_text.load(text)
    except yaml_text.YamlError as error:
        raise InputError(str(path), str(error)) from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise InputError(str(path), f"{place}: is not JSON, {error.msg}") from error
    except RecursionError as error:
        raise InputError(str(path), "is nested too deep") from error
    except ValueError as error:
        raise InputError(str(path), f"is not JSON: {error}") from error


def _json(text: str) -> Any:
    if text.count(",") > yaml_text.MOST_VALUES:
        raise ValueError(f"holds more than {yaml_text.MOST_VALUES} values")
    return json.loads(text, object_pairs_hook=_once) if text.strip() else None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return keys and values, each key given once, where JSON would silently keep the last."""
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"key {twice!r} is given twice")
    return found


# pydantic's kinds of fault in the words of this program
_RULES = {
    "greater_than": "must be more than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "finite_number": "must be finite",
    "float_type": "must be a number, without its unit",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_too_short": "must not be empty",
    "list_type": "must be a list",
    "model_type": "must hold keys and values",
    "literal_error": "must be {expected}",
}


def _fault(fault: Any, model: type[BaseModel]) -> str:
    """Describe one fault as ``key.path: what is wrong, got the value seen``."""
    place = ".".join(str(part) for part in fault["loc"])
    kind, values = fault["type"], fault.get("ctx", {})
    if kind == "missing":
        return f"{place}: is missing"
    if _is_unknown(fault):
        if (new := _new_place(fault["loc"], model)) is not None:
            return f"{place}: was renamed, write {new[-1]}"
        retired = getattr(_model_at(fault["loc"], model), "retired", {})
        if (reason := retired.get(fault["loc"][-1])) is not None:
            return f"{place}: no longer exists, remove it: {reason}"
        known = _keys_beside(fault["loc"], model)
        return f"{place}: unknown key" + (f"; known here: {', '.join(known)}" if known else "")
    if kind in ("too_short", "too_long"):
        few = kind == "too_short"
        wanted = f"at least {values['min_length']}" if few else f"at most {values['max_length']}"
        return f"{place}: must have {wanted} values, got {values['actual_length']}"
    if kind in _RULES:
        return f"{place}: {_RULES[kind].format_map(values)}, got {_seen(fault['input'])}"
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    message = message[:1].lower() + message[1:]
    if isinstance(fault["input"], (dict, list)):  # the message tells what matters of it
        return f"{place}: {message}"
    return f"{place}: {message}, got {_seen(fault['input'])}"


def _is_unknown(fault: Any) -> bool:
    return bool(fault["type"] == "extra_forbidden")


def _new_place(loc: tuple[Any, ...], model: type[BaseModel]) -> tuple[Any, ...] | None:
    """Return where an unknown key belongs by its new name, None if it never was a key."""
    new = getattr(_model_at(loc, model), "renamed", {}).get(loc[-1])
    return None if new is None else (*loc[:-1], new)


def _keys_beside(loc: tuple[Any, ...], model: type[BaseModel]) -> list[str]:
    """Return the keys allowed where an unknown one stood, [] where that is not known."""
    return sorted(getattr(_model_at(loc, model), "model_fields", {}))


def _model_at(loc: tuple[Any, ...], model: Any) -> Any:
    """Return the model that a key stands in, None where that is not known."""
    for part in loc[:-1]:
        if isinstance(part, str):  # a number counts within a list of what its key holds
            field = getattr(model, "model_fields", {}).get(part)
            model = model_in(getattr(field, "annotation", None))
    return model


def model_in(annotation: Any) -> Any:
    """Return the model in ``list[Model]`` or ``Model | None``, None if there is none."""
    if hasattr(annotation, "model_fields"):
        return annotation
    inside = (model_in(argument) for argument in get_args(annotation))
    return next((model for model in inside if model is not None), None)


def _seen(value: object) -> str:
    """Return a value as it stands in the file, as far as one line can tell."""
    if value is None or isinstance(value, (bool, float)):
        text = yaml_text.written(value)
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
