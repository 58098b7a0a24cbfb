"""Layout templates that a cell engineer may copy, change and name in a job.

The one home of jinja2. A template lays out texts and never computes: numbers arrive formatted, and
a name it does not get is an error instead of an empty place.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from jinja2 import StrictUndefined, TemplateSyntaxError
from jinja2.sandbox import ImmutableSandboxedEnvironment

from opl.errors import InputError

_ENVIRONMENT = ImmutableSandboxedEnvironment(
    undefined=StrictUndefined,
    autoescape=False,  # jobs and tables, no HTML
    keep_trailing_newline=True,
    trim_blocks=True,
    lstrip_blocks=True,
)


def fill(template: Path, values: Mapping[str, object]) -> str:
    """Return the text of a template file, lines ended by a bare line feed.

    Raises:
        InputError: If the file cannot be read or is no template, or uses a value there is not.
    """
    try:
        source = template.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(str(template), f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(str(template), "is not text in UTF-8") from error
    try:
        return _ENVIRONMENT.from_string(source).render(values)
    except TemplateSyntaxError as error:
        raise InputError(f"{template}: line {error.lineno}", str(error.message)) from error
    except Exception as error:  # a template runs code of its own: any error in it is the template's
        raise InputError(str(template), str(error) or type(error).__name__) from error
