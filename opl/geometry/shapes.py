"""Solids that stand in a cell or are fixed to the flange: primitives and meshes."""

from __future__ import annotations

from dataclasses import dataclass

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh


@dataclass(frozen=True)
class Box:
    """A box centred in its own frame.

    Attributes:
        size: Edge lengths along x, y, z in [m].
    """

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder centred in its own frame, its axis along z.

    Attributes:
        radius: In [m].
        length: In [m].
    """

    radius: float
    length: float


@dataclass(frozen=True)
class Body:
    """A named solid.

    Attributes:
        name: What messages call it.
        shape: The solid.
        T_parent_body: Its pose in the frame it is given in (base for an obstacle, flange for a
            piece of the fixture), shape (4, 4).
    """

    name: str
    shape: Box | Cylinder | TriangleMesh
    T_parent_body: Array
