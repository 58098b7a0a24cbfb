"""Layout templates that a cell engineer may copy, change and name in a job.

The one home of jinja2. A template lays out texts and never computes: numbers arrive formatted, and
a name it does not get is an error instead of an empty place.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from opl.errors import InputError
from opl.files.apart import apart
from opl.files.reading import MB, read_text
from opl.files.resources import folder

if TYPE_CHECKING:
    from jinja2.sandbox import ImmutableSandboxedEnvironment

MOST_TEMPLATE, MOST_TEXT = MB, 50 * MB


def fill(template: Path, values: Mapping[str, object]) -> str:
    """Return the text of a template file, lines ended by a bare line feed.

    Raises:
        InputError: If the file cannot be read or is no template, or uses a value there is not.
    """
    source = read_text(template, MOST_TEMPLATE)
    if template.resolve().is_relative_to(folder("templates").resolve()):
        return _rendered(source, str(template), values)
    # a template is a program: one that grows or never ends does so in a process of its own
    return apart(_rendered, source, str(template), dict(values), about=str(template))


@cache
def _environment() -> ImmutableSandboxedEnvironment:
    from jinja2 import StrictUndefined
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    return ImmutableSandboxedEnvironment(
        undefined=StrictUndefined,
        autoescape=False,  # jobs and tables, no HTML
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _rendered(source: str, template: str, values: Mapping[str, object]) -> str:
    from jinja2 import TemplateSyntaxError

    try:
        text = _environment().from_string(source).render(values)
        if len(text) > MOST_TEXT:
            raise ValueError(f"gives more than {MOST_TEXT / MB:g} MB of text")
        return text
    except TemplateSyntaxError as error:
        raise InputError(f"{template}: line {error.lineno}", str(error.message)) from error
    except MemoryError:
        raise
    except Exception as error:  # a template runs code of its own: any error in it is the template's
        raise InputError(template, str(error) or type(error).__name__) from error
