"""The package of a site with a post of its own, as a package manager would install it."""

import re
from pathlib import Path

from opl.program.posts import GROUP

PACKAGE = Path(__file__).parents[1] / "example_post"


def install(folder, entries):
    """Make what a package manager would: the entry points of an installed package."""
    info = folder / "our_cell_post-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: our-cell-post\nVersion: 1.0\n")
    rows = [f"{name} = {value}" for name, value in entries.items()]
    (info / "entry_points.txt").write_text("\n".join([f"[{GROUP}]", *rows, ""]))


def install_example_post(folder, monkeypatch):
    """Install the example package as long as a test runs."""
    declared = (PACKAGE / "pyproject.toml").read_text()
    ((name, value),) = re.findall(r'^(OUR_CELL) = "(.*)"$', declared, re.MULTILINE)
    assert f'[project.entry-points."{GROUP}"]' in declared
    install(folder, {name: value})
    monkeypatch.syspath_prepend(folder)
    monkeypatch.syspath_prepend(PACKAGE)
