"""Files kept inside the document: a property holds them as one ZIP archive."""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from collections.abc import Mapping
from typing import Any

_DATE = (1980, 1, 1, 0, 0, 0)  # of all members: the same files are the same archive


def keep(obj: Any, name: str, files: Mapping[str, bytes]) -> None:
    """Keep files in a property of type ``App::PropertyFileIncluded``; none empties it."""
    if not files:
        setattr(obj, name, "")
        return
    block = io.BytesIO()
    with zipfile.ZipFile(block, "w", zipfile.ZIP_DEFLATED) as archive:
        for key in sorted(files):
            archive.writestr(zipfile.ZipInfo(key, _DATE), files[key], zipfile.ZIP_DEFLATED)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, f"{obj.Name}_{name}.zip")
        with open(path, "wb") as out:
            out.write(block.getvalue())
        setattr(obj, name, path)  # FreeCAD copies it into the document


def kept(obj: Any, name: str) -> dict[str, bytes]:
    """Return the files that a property keeps, by name."""
    path = getattr(obj, name)
    if not path:
        return {}
    with zipfile.ZipFile(path) as archive:
        return {key: archive.read(key) for key in archive.namelist()}


def kept_text(obj: Any, name: str, end: str) -> str | None:
    """Return the text of the kept file whose name ends so, None if there is none."""
    for key, content in kept(obj, name).items():
        if key.endswith(end):
            return content.decode("utf-8")
    return None
