"""A URDF as text to be changed: its frame ``base``, shapes on fixed joints, names of meshes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from opl.errors import InputError
from opl.files.reading import MB, read_bytes
from opl.geometry.frames import Array, from_roll_pitch_yaw, roll_pitch_yaw
from opl.geometry.mesh import load_shell

BASE = "base"
_NOWHERE = "0 0 0"
_EXACT = 1e-6  # [m], [rad]; URDFs round right angles


MOST_BYTES = 10 * MB
MOST_DEPTH = 60


class _DeepError(Exception):
    """Elements in elements in elements."""


class _Builder(ET.TreeBuilder):
    """Builds the tree of a file, unless it is so deep that whoever walks through it would fall."""

    _depth = 0

    def start(self, tag: Any, attrs: Any) -> ET.Element:
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise _DeepError(f"elements are nested more than {MOST_DEPTH} deep")
        return super().start(tag, attrs)

    def end(self, tag: Any) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


class UrdfTree:
    """The elements of one URDF.

    Args:
        path: The file.
        source: What it was made from, for messages, and where its relative meshes start.
    """

    def __init__(self, path: Path, source: Path | None = None) -> None:
        self._path = source or path
        content = read_bytes(path, MOST_BYTES)
        try:
            parser = ET.XMLParser(target=_Builder(insert_comments=True))
            parser.feed(content)
            self._root = parser.close()
        except (ET.ParseError, _DeepError) as error:
            raise InputError(str(self._path), f"is not XML: {error}") from error
        self._joints = {_child(joint): joint for joint in self._root.findall("joint")}
        self._require_no_ring()
        free = [link for link in self._links() if link not in self._joints]
        if len(free) != 1:
            raise InputError(
                str(self._path), f"must have one root link, has {', '.join(free) or 'none'}"
            )
        self.root_link = free[0]

    def joints(self) -> list[ET.Element]:
        """Return the elements of all joints, in the order of the file."""
        return self._root.findall("joint")

    def _require_no_ring(self) -> None:
        for link in self._joints:
            seen = {link}
            while (joint := self._joints.get(link)) is not None:
                link = _parent(joint)
                if link in seen:
                    raise InputError(str(self._path), f"link {link} hangs on itself")
                seen.add(link)

    def base_frame(self) -> tuple[float, float] | None:
        """Return where the frame ``base`` lies on the z axis of the root link; None without one.

        Returns:
            Its height in [m], and how far it is turned about that axis in [rad].

        Raises:
            InputError: If it lies elsewhere, or is not upright.
        """
        if BASE not in self._links():
            return None
        carrier, T_root_base = self._carrier(BASE)
        aside = np.hypot(*T_root_base[:2, 3])
        if carrier != self.root_link or max(aside, 1.0 - T_root_base[2, 2]) > _EXACT:
            raise InputError(
                str(self._path),
                f"link {BASE} must be fixed to the root link, straight above it, or be left out",
            )
        turn = float(np.arctan2(T_root_base[1, 0], T_root_base[0, 0]))
        return float(T_root_base[2, 3]), 0.0 if abs(turn) < _EXACT else turn

    def set_base(self, height: float) -> None:
        """Put the frame ``base`` on the z axis of the root link, so high in [m], not turned."""
        if BASE in self._links():
            self._rename_base()
        ET.SubElement(self._root, "link", name=BASE)
        name = f"{self.root_link}-{BASE}"
        while name in {joint.get("name") for joint in self._root.findall("joint")}:
            name += "_frame"
        joint = ET.SubElement(self._root, "joint", name=name, type="fixed")
        ET.SubElement(joint, "parent", link=self.root_link)
        ET.SubElement(joint, "child", link=BASE)
        ET.SubElement(joint, "origin", xyz=f"0 0 {height!r}", rpy=_NOWHERE)
        self._joints[BASE] = joint

    def gather_shapes(self) -> None:
        """Move shapes on links that hang on a fixed joint to the link that carries them.

        The planner knows shapes by the joints that move them, and the replay would pass them over.
        """
        for link in self._hanging():
            carrier, T_carrier_link = self._carrier(str(link.get("name")))
            (parent,) = (one for one in self._root.findall("link") if one.get("name") == carrier)
            for shape in link.findall("collision"):
                link.remove(shape)
                origin = shape.find("origin")
                T_carrier_shape = T_carrier_link @ _pose(origin)
                if origin is None:
                    origin = ET.Element("origin")
                    shape.insert(0, origin)
                origin.set("xyz", _text(T_carrier_shape[:3, 3]))
                origin.set("rpy", _text(roll_pitch_yaw(T_carrier_shape)))
                parent.append(shape)

    def require_shapes_on_joints(self) -> None:
        """Refuse shapes on links that hang on a fixed joint: the replay would not see them.

        Raises:
            InputError: If there is one; names it.
        """
        for link in self._hanging():
            name = str(link.get("name"))
            raise InputError(
                str(self._path),
                f"link {name} has collision shapes but hangs on a fixed joint: move them to "
                f"link {self._carrier(name)[0]}, else they would not be checked",
            )

    def leave_out_pictures(self) -> None:
        """Leave out the meshes that are only looked at: opl shows and checks collision shapes."""
        for link in self._root.findall("link"):
            for visual in link.findall("visual"):
                if visual.find("geometry/mesh") is not None:
                    link.remove(visual)

    def collect_meshes(self) -> dict[str, Path]:
        """Name the meshes relative to the URDF; return where each is now, by its new name.

        Raises:
            InputError: If one is not there, or is no mesh that can be read.
        """
        found: dict[str, Path] = {}
        for mesh in self._root.iter("mesh"):
            name = str(mesh.get("filename"))
            source = self._locate(name)
            if source is None:
                raise InputError(str(self._path), f"mesh {name}: no such file")
            try:
                load_shell(source, "m")
            except InputError as error:
                raise InputError(str(self._path), f"mesh {name}: {error}") from error
            target, number = f"meshes/{source.name}", 1
            while found.get(target, source) != source:
                number += 1
                target = f"meshes/{source.stem}_{number}{source.suffix}"
            found[target] = source
            mesh.set("filename", target)
        return found

    def cautions(self) -> Iterator[str]:
        """Yield what is missing but not needed to go on."""
        for link in self._root.findall("link"):
            name = str(link.get("name"))
            joint = self._joints.get(name)
            moved = joint is None or joint.get("type") != "fixed"
            if moved and not link.findall("collision"):
                yield f"link {name} has no collision shape: nothing of it is checked"
            if link.find("collision/geometry/mesh") is not None:
                yield (
                    f"link {name}: each collision mesh counts as its convex hull; where that is "
                    "too much, as of a fork, give it in several convex meshes"
                )

    def write(self, path: Path) -> None:
        """Write the file."""
        ET.indent(self._root)
        ET.ElementTree(self._root).write(path, encoding="utf-8", xml_declaration=True)

    def _links(self) -> list[str]:
        return [str(link.get("name")) for link in self._root.findall("link")]

    def _rename_base(self) -> None:
        """Give the URDF's own base another name, for what hangs on it stays where it is."""
        name = "base_link" if self.root_link == BASE else "controller_base"
        while name in self._links():
            name += "_frame"
        if self.root_link == BASE:
            self.root_link = name
        for link in self._root.findall("link"):
            if link.get("name") == BASE:
                link.set("name", name)
        for end in (*self._root.iter("parent"), *self._root.iter("child")):
            if end.get("link") == BASE:
                end.set("link", name)
        if BASE in self._joints:
            self._joints[name] = self._joints.pop(BASE)

    def _hanging(self) -> list[ET.Element]:
        """Return the links that have collision shapes but hang on a fixed joint."""
        joints = self._joints
        return [
            link
            for link in self._root.findall("link")
            if link.findall("collision")
            and (joint := joints.get(str(link.get("name")))) is not None
            and joint.get("type") == "fixed"
        ]

    def _carrier(self, name: str) -> tuple[str, Array]:
        """Return the link that carries another over fixed joints, and T_carrier_link, (4, 4)."""
        T_carrier_link = np.eye(4)
        while (joint := self._joints.get(name)) is not None and joint.get("type") == "fixed":
            T_carrier_link = _pose(joint.find("origin")) @ T_carrier_link
            name = _parent(joint)
        return name, T_carrier_link

    def _locate(self, name: str) -> Path | None:
        """Return the file of a mesh: relative, absolute, file:// or package://."""
        here = self._path.resolve().parent
        if name.startswith("package://"):
            package, _, rest = name.removeprefix("package://").partition("/")
            for folder in (here, *here.parents):
                places = [folder / package / rest]
                if folder.name == package or (folder / "package.xml").is_file():
                    places.append(folder / rest)
                for place in places:
                    if place.is_file():
                        return place
            return None
        place = here / name.removeprefix("file://")
        return place if place.is_file() else None


def _child(joint: ET.Element) -> str:
    child = joint.find("child")
    return "" if child is None else str(child.get("link"))


def _parent(joint: ET.Element) -> str:
    parent = joint.find("parent")
    return "" if parent is None else str(parent.get("link"))


def _pose(origin: ET.Element | None) -> Array:
    """Return the pose of an element, shape (4, 4); the identity if there is none."""
    if origin is None:
        return np.eye(4)
    xyz, rpy = (np.array(origin.get(key, _NOWHERE).split(), dtype=float) for key in ("xyz", "rpy"))
    return from_roll_pitch_yaw(rpy, xyz)


def _text(numbers: Array) -> str:
    return " ".join(f"{round(float(number), 12) + 0.0!r}" for number in numbers)
