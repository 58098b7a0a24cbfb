"""Files of triangles: what they hold, corners at the same place as one.

Binary STL files, by far the most common, are read here. All others are read by trimesh, which takes
longer to load than most commands take.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from opl.errors import InputError
from opl.files.reading import MB, read_bytes
from opl.geometry.frames import Array

# more of them take gigabytes and minutes to be looked through
MOST_TRIANGLES = 400_000
MOST_BYTES = 100 * MB

_SUFFIXES = (".stl", ".ply", ".obj")

# corners are one that are the same in whole numbers of so many parts of the unit of the file
_PARTS = 1e8

_HEADER = 80
_COUNT = np.dtype("<u4")
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_triangles(path: Path) -> tuple[Array, NDArray[np.int64]]:
    """Return the corners that a file holds, in its own unit, and those of each triangle.

    Corners at the same place are one, in the order in which they first occur; those of no triangle
    are left out.

    Args:
        path: An STL, PLY or OBJ file.

    Returns:
        Corners, shape (n, 3), and the indices of the three of each triangle, shape (m, 3).

    Raises:
        InputError: If the file cannot be read, or has no triangles or too many.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise InputError(str(path), f"must be one of {', '.join(_SUFFIXES)}")
    content = read_bytes(path, MOST_BYTES)
    try:
        if suffix == ".stl" and _is_binary_stl(content):
            corners, triangles = _binary_stl(content)
        else:
            corners, triangles = _by_trimesh(content, suffix[1:])
        _require_triangles(corners, triangles)
    # trimesh lets whatever its parsers stumble over through: ValueError, KeyError, struct.error ...
    except Exception as error:
        raise InputError(str(path), f"is not a mesh: {error}") from error
    if not len(triangles):
        raise InputError(str(path), "holds no triangles")
    if len(triangles) > MOST_TRIANGLES:
        count = f"{len(triangles)} triangles, at most {MOST_TRIANGLES} are taken"
        raise InputError(str(path), f"has {count}; export a coarser mesh")
    used, triangles = np.unique(triangles, return_inverse=True)
    corners, triangles = corners[used], triangles.reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise InputError(str(path), "has corners that are not finite")
    first, one = _places(corners)
    return corners[first], one[triangles]


def _is_binary_stl(content: bytes) -> bool:
    """Return whether an STL file is as long as its header says, which no text is."""
    if len(content) < _HEADER + _COUNT.itemsize:
        return False
    count = int(np.frombuffer(content, _COUNT, 1, _HEADER)[0])
    return len(content) == _HEADER + _COUNT.itemsize + count * _FACET.itemsize


def _binary_stl(content: bytes) -> tuple[Array, NDArray[np.int64]]:
    facets = np.frombuffer(content, _FACET, offset=_HEADER + _COUNT.itemsize)
    corners = facets["corners"].reshape(-1, 3).astype(float)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _by_trimesh(content: bytes, kind: str) -> tuple[Array, NDArray[np.int64]]:
    import trimesh

    mesh = trimesh.load_mesh(BytesIO(content), file_type=kind)
    return np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)


def _require_triangles(corners: Array, triangles: NDArray[np.int64]) -> None:
    """Refuse what is no list of triangles.

    Raises:
        ValueError: If it is none.
    """
    if triangles.shape[1:] != (3,) or corners.shape[1:] != (3,):
        raise ValueError("its triangles are none")
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(corners):
        raise ValueError(f"its triangles name corners beyond its {len(corners)}")


def _places(corners: Array) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the first corner at each place, in order, and the place of each corner."""
    with np.errstate(over="ignore"):
        rounded = np.round(_PARTS * corners)
    order = np.lexsort(rounded.T)  # stable: of equal ones the first stays the first
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = (rounded[order[1:]] != rounded[order[:-1]]).any(axis=1)
    first = order[begins]
    rank = np.empty(len(first), dtype=np.int64)
    rank[first.argsort()] = np.arange(len(first))
    one = np.empty(len(corners), dtype=np.int64)
    one[order] = rank[np.cumsum(begins) - 1]
    return np.sort(first), one
