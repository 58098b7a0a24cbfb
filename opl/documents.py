"""YAML and JSON files that people write, checked against a pydantic model.

The one home of yaml and of pydantic's errors: whatever is wrong with a file becomes an `InputError`
that names the file, the key path, the value seen and the values allowed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from opl.errors import InputError


class Document(BaseModel):
    """A mapping in a file: unknown keys, numbers as text, infinities and NaN are refused."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, ser_json_inf_nan="constants"
    )


Model = TypeVar("Model", bound=BaseModel)


class _Loader(yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader):  # type: ignore[misc]
    """Safe loader that refuses a key given twice, where YAML would silently keep the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=deep) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"key {key!r} is given twice", node.start_mark
                )
        return super().construct_mapping(node, deep)


def read(path: Path, model: type[Model]) -> Model:
    """Read a YAML or JSON file (JSON is read as the YAML that it is).

    Args:
        path: The file.
        model: What it must hold.

    Raises:
        InputError: If the file cannot be read, is not YAML, or does not fit the model. All the
            faults of a file are told at once, one a line.
    """
    return check(_content(path), model, path)


def keys(path: Path) -> dict[Any, Any]:
    """Return what a YAML file holds, unchecked; empty if it holds no keys and values.

    Raises:
        InputError: If the file cannot be read or is not YAML.
    """
    content = _content(path)
    return content if isinstance(content, dict) else {}


def check(content: object, model: type[Model], path: Path) -> Model:
    """Return ``content``, as read from ``path``, as a model.

    Raises:
        InputError: If it does not fit the model.
    """
    if not isinstance(content, dict):
        raise InputError(str(path), f"must hold keys and values, holds {_seen(content)}")
    try:
        return model.model_validate(content)
    except ValidationError as error:
        lines = [_fault(fault, model) for fault in error.errors(include_url=False)]
        raise InputError(str(path), "\n".join(lines)) from error


def _content(path: Path) -> Any:
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
        problem = getattr(error, "problem", None) or "is not YAML"
        raise InputError(str(path), f"{place}{problem}") from error


def _fault(fault: Any, model: type[BaseModel]) -> str:
    """Describe one fault as ``key.path: what is wrong, got the value seen``."""
    place = ".".join(str(part) for part in fault["loc"])
    kind = fault["type"]
    if kind == "missing":
        return f"{place}: is missing"
    if kind == "extra_forbidden":
        known = _keys_beside(fault["loc"], model)
        return f"{place}: unknown key" + (f"; known here: {', '.join(known)}" if known else "")
    message = fault["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    message = message[:1].lower() + message[1:]
    return f"{place}: {message}, got {_seen(fault['input'])}" if place else message


def _keys_beside(loc: tuple[Any, ...], model: Any) -> list[str]:
    """Return the keys allowed where an unknown one stood, [] where that cannot be told."""
    for part in loc[:-1]:
        field = getattr(model, "model_fields", {}).get(part)
        model = getattr(field, "annotation", None)
    return sorted(getattr(model, "model_fields", {}))


def _seen(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
