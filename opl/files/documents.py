"""YAML and JSON files that people write, checked against a pydantic model.

The one home of yaml and of pydantic's errors: whatever is wrong with a file becomes an `InputError`
that names the file, the key path, the value seen and the values allowed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from opl.errors import InputError


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


class _Loader(yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader):  # type: ignore[misc]
    """Safe loader that refuses a key given twice, where YAML would silently keep the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: list[Any] = []
        for node_of_key, _ in node.value:
            if node_of_key.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(node_of_key, deep=deep)
            if key in seen:
                message = f"key {key!r} is given twice"
                raise yaml.constructor.ConstructorError(None, None, message, node_of_key.start_mark)
            seen.append(key)
        made: dict[Any, Any] = super().construct_mapping(node, deep)
        return made


# YAML 1.1 takes 1e-05 for text, which is how JSON writes 0.00001
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)


def read(path: Path, model: type[Model]) -> Model:
    """Read a YAML or JSON file (JSON is read as the YAML that it is).

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
            lines = [f"{len(lines)} faults", *lines]
        raise InputError(label, "\n".join(lines)) from error


def content_of(path: Path) -> Any:
    """Return what a YAML or JSON file holds, unchecked.

    Raises:
        InputError: If the file cannot be read or is not YAML.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(str(path), "is not text in UTF-8") from error
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        found = [getattr(error, name, None) for name in ("context", "problem")]
        problem = ", ".join(text for text in found if text) or "is not YAML"
        raise InputError(str(path), f"{place}{problem}") from error
    except (ValueError, RecursionError) as error:  # a date such as 2024-13-01, a list in itself
        raise InputError(str(path), f"is not YAML: {error}") from error


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
        text = str(yaml.safe_dump(value)).splitlines()[0]
    else:
        text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
