"""A URDF as text to be changed: where its frame ``base`` lies, and what its meshes are called."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from opl.errors import InputError

BASE = "base"
_NOWHERE = "0 0 0"


class UrdfTree:
    """The elements of one URDF."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            builder = ET.TreeBuilder(insert_comments=True)
            self._root = ET.parse(path, ET.XMLParser(target=builder)).getroot()
        except ET.ParseError as error:
            raise InputError(str(path), f"is not XML: {error}") from error
        self._joints = {_child(joint): joint for joint in self._root.findall("joint")}
        free = [link for link in self._links() if link not in self._joints]
        if len(free) != 1:
            raise InputError(str(path), f"must have one root link, has {', '.join(free) or 'none'}")
        self._root_link = free[0]

    def base_height(self) -> float | None:
        """Return how high the frame ``base`` lies above the root link in [m]; None without one.

        Raises:
            InputError: If it lies elsewhere than on the z axis of the root link, or is turned.
        """
        if BASE not in self._links():
            return None
        joint = self._joints.get(BASE)
        if joint is None:
            return 0.0  # it is the root itself
        origin = joint.find("origin")
        xyz = _numbers(origin, "xyz")
        upright = max(map(abs, (*xyz[:2], *_numbers(origin, "rpy")))) < 1e-6
        if joint.get("type") != "fixed" or _parent(joint) != self._root_link or not upright:
            raise InputError(
                str(self._path),
                f"link {BASE} must be fixed to the root link, straight above it, or be left out",
            )
        return xyz[2]

    def set_base(self, height: float) -> None:
        """Put the frame ``base`` on the z axis of the root link, so high in [m]."""
        if self._root_link == BASE:
            self._rename_root()
        joint = self._joints.get(BASE)
        if joint is None:
            ET.SubElement(self._root, "link", name=BASE)
            name = f"{self._root_link}-{BASE}"
            while name in {joint.get("name") for joint in self._root.findall("joint")}:
                name += "_frame"
            joint = ET.SubElement(self._root, "joint", name=name, type="fixed")
            ET.SubElement(joint, "parent", link=self._root_link)
            ET.SubElement(joint, "child", link=BASE)
            self._joints[BASE] = joint
        for origin in joint.findall("origin"):
            joint.remove(origin)
        ET.SubElement(joint, "origin", xyz=f"0 0 {height!r}", rpy=_NOWHERE)

    def require_shapes_on_joints(self) -> None:
        """Refuse shapes on links that hang on a fixed joint: the replay would not see them.

        Raises:
            InputError: If there is one; names it.
        """
        for link in self._root.findall("link"):
            name = str(link.get("name"))
            joint = self._joints.get(name)
            if joint is not None and joint.get("type") == "fixed" and link.findall("collision"):
                raise InputError(
                    str(self._path),
                    f"link {name} has collision shapes but hangs on a fixed joint: move them to "
                    f"link {_parent(joint)}, else they would not be checked",
                )

    def collect_meshes(self) -> dict[str, Path]:
        """Name the meshes relative to the URDF; return where each is now, by its new name.

        Raises:
            InputError: If one is not there.
        """
        found: dict[str, Path] = {}
        for mesh in self._root.iter("mesh"):
            name = str(mesh.get("filename"))
            source = self._locate(name)
            if source is None:
                raise InputError(str(self._path), f"mesh {name}: no such file")
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

    def write(self, path: Path) -> None:
        """Write the file."""
        ET.indent(self._root)
        ET.ElementTree(self._root).write(path, encoding="utf-8", xml_declaration=True)

    def _links(self) -> list[str]:
        return [str(link.get("name")) for link in self._root.findall("link")]

    def _rename_root(self) -> None:
        """Call a root link that is named base otherwise, that base may be a frame beside it."""
        self._root_link = "base_link"
        if "base_link" in self._links():
            raise InputError(
                str(self._path), "base_link hangs on base: remove the link base, or fix it to it"
            )
        for link in self._root.findall("link"):
            if link.get("name") == BASE:
                link.set("name", self._root_link)
        for parent in self._root.iter("parent"):
            if parent.get("link") == BASE:
                parent.set("link", self._root_link)

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


def _numbers(origin: ET.Element | None, key: str) -> tuple[float, float, float]:
    text = _NOWHERE if origin is None else origin.get(key, _NOWHERE)
    x, y, z = (float(number) for number in text.split())
    return x, y, z
