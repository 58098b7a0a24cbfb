"""Nodes of the 3D view (Coin)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from pivy import coin

Colour = Sequence[float]


def coloured(colour: Colour, transparency: float = 0.0) -> Any:
    """Return a group whose shapes have a colour."""
    group = coin.SoSeparator()
    material = coin.SoMaterial()
    material.diffuseColor.setValue(*colour)
    material.transparency.setValue(transparency)
    group.addChild(material)
    return group


def moved() -> Any:
    """Return a node that moves what comes after it."""
    return coin.SoMatrixTransform()


def move(node: Any, placement: Any) -> None:
    """Set where a node moves what comes after it; Coin multiplies rows from the left."""
    a = placement.toMatrix().A
    node.matrix.setValue(
        coin.SbMatrix(*(a[4 * column + row] for row in range(4) for column in range(4)))
    )


def solid(found: dict[str, Any]) -> Any:
    """Return the shape of a solid of a cell, in its own frame."""
    group = coin.SoSeparator()
    if "box_mm" in found:
        box = coin.SoCube()
        box.width, box.height, box.depth = found["box_mm"]
        group.addChild(box)
    elif "cylinder_mm" in found:
        turn = coin.SoRotationXYZ()  # that of Coin stands along y
        turn.axis, turn.angle = coin.SoRotationXYZ.X, 1.5707963267948966
        cylinder = coin.SoCylinder()
        cylinder.radius, cylinder.height = found["cylinder_mm"]
        group.addChild(turn)
        group.addChild(cylinder)
    else:
        hints = coin.SoShapeHints()
        hints.vertexOrdering = coin.SoShapeHints.COUNTERCLOCKWISE
        hints.creaseAngle = 0.5
        places = coin.SoCoordinate3()
        places.point.setValues(0, len(found["vertices_mm"]), found["vertices_mm"])
        faces = coin.SoIndexedFaceSet()
        numbers = [number for corners in found["triangles"] for number in (*corners, -1)]
        faces.coordIndex.setValues(0, len(numbers), numbers)
        for node in (hints, places, faces):
            group.addChild(node)
    return group


def lines(rows: Iterable[Sequence[Any]], colour: Colour, width: float = 2.0) -> Any:
    """Return lines through places, one for each row."""
    group, places, counts = coloured(colour), [], []
    for row in rows:
        places += [tuple(place) for place in row]
        counts.append(len(row))
    style = coin.SoDrawStyle()
    style.lineWidth = width
    _light(group)
    drawn = coin.SoLineSet()
    if counts:
        drawn.numVertices.setValues(0, len(counts), counts)
    for node in (style, _coordinates(places), drawn):
        group.addChild(node)
    return group


def dots(places: Sequence[Any], colour: Colour, size: float = 5.0) -> Any:
    """Return places as dots."""
    group = coloured(colour)
    style = coin.SoDrawStyle()
    style.pointSize = size
    _light(group)
    for node in (style, _coordinates([tuple(place) for place in places]), coin.SoPointSet()):
        group.addChild(node)
    return group


def balls(places: Sequence[Any], colour: Colour, radius: float) -> Any:
    """Return a ball at each place."""
    group = coloured(colour)
    ball = coin.SoSphere()
    ball.radius = radius
    for place in places:
        one, at = coin.SoSeparator(), coin.SoTranslation()
        at.translation.setValue(*place)
        one.addChild(at)
        one.addChild(ball)
        group.addChild(one)
    return group


def axes(placement: Any, length: float) -> Any:
    """Return a frame's axes, x red, y green, z blue."""
    group, at = coin.SoSeparator(), moved()
    move(at, placement)
    group.addChild(at)
    for k in range(3):
        end = [length if j == k else 0.0 for j in range(3)]
        colour = [0.9 if j == k else 0.1 for j in range(3)]
        group.addChild(lines([[(0.0, 0.0, 0.0), tuple(end)]], colour, 3.0))
    return group


def _coordinates(places: Sequence[Sequence[float]]) -> Any:
    node = coin.SoCoordinate3()
    node.point.setValues(0, len(places), [tuple(map(float, place)) for place in places])
    return node


def _light(group: Any) -> None:
    """Let lines and dots have their colour from every side."""
    light = coin.SoLightModel()
    light.model = coin.SoLightModel.BASE_COLOR
    group.addChild(light)
