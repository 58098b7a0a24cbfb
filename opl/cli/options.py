"""Types of arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path

import click

# a file that cannot be read is refused in one way, by those who read it
FILE = click.Path(path_type=Path, readable=False)
