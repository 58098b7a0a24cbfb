"""The triangles of the held part in a tree, whose nodes can be skipped at once.

What a node holds lies in a sphere, in a box and, as surfaces are flat from near by, in a thin slab.
The sphere tells of what is far from the wheel, slab and box of what lies along it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh, box_corners

# what kernels take of a part: its type in the words of numba
TREE = (
    "Tuple((float64[:,:,::1],float64[:,::1],float64[:,::1],float64[:,::1],int64[::1],int64[::1]))"
)


@dataclass(frozen=True)
class PartTree:
    """The triangles of the held part in a tree, the root first.

    Attributes:
        triangles: Corners in the workpiece frame in [m], ordered so that each node holds a slice,
            shape (k, 3, 3).
        spheres: Centre and radius of a sphere about each node in [m], shape (c, 4).
        slabs: A slab about each node: its unit normal, and from where to where along that, seen
            from the centre of the sphere, in [m], shape (c, 5).
        boxes: Half the sides of a box about that centre, along the axes of the workpiece frame, in
            [m], shape (c, 3).
        first: Index of each node's first triangle, shape (c,).
        end: Index after each node's last triangle, shape (c,).
        child: Index of each node's first child, the second follows it; 0 for a leaf, shape (c,).
        looks: How many nodes were looked at so far, shape (1,).
    """

    triangles: Array
    spheres: Array
    slabs: Array
    boxes: Array
    first: np.ndarray
    end: np.ndarray
    child: np.ndarray
    looks: np.ndarray

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array, np.ndarray, np.ndarray]:
        """What kernels take of it, of the type `TREE`."""
        return self.triangles, self.spheres, self.slabs, self.boxes, self.first, self.child

    @property
    def corners(self) -> Array:
        """Corners of a box that holds the part in [m], shape (8, 3)."""
        return box_corners(self.spheres[0, :3] + np.outer([-1.0, 1.0], self.boxes[0]))


def part_tree(mesh: TriangleMesh) -> PartTree:
    """Sort the triangles of a mesh into a tree by halving them along the longest side."""
    triangles = mesh.triangles
    low, high, centres = triangles.min(axis=1), triangles.max(axis=1), triangles.mean(axis=1)
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    order = np.arange(len(triangles))
    first, end = np.array([0]), np.array([len(triangles)])
    spheres, slabs, boxes, firsts, ends, children, known = [], [], [], [], [], [], 0
    while len(first):  # a level of the tree
        sizes = end - first
        starts = np.cumsum(sizes) - sizes
        node = np.repeat(np.arange(len(first)), sizes)
        held = np.arange(len(node)) - starts[node] + first[node]
        own = order[held]
        centre = np.minimum.reduceat(low[own], starts) + np.maximum.reduceat(high[own], starts)
        centre /= 2.0
        corners = triangles[own] - centre[node][:, None]
        away = np.maximum.reduceat(np.linalg.norm(corners, axis=2).max(axis=1), starts)
        normal = np.add.reduceat(normals[own], starts)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(length > 0.0, normal / np.where(length > 0.0, length, 1.0), [0, 0, 1])
        along = np.einsum("kci,ki->kc", corners, normal[node])
        slab = [np.minimum.reduceat(along.min(axis=1), starts)]
        slab.append(np.maximum.reduceat(along.max(axis=1), starts))
        spheres.append(np.column_stack([centre, away]))
        slabs.append(np.column_stack([normal, *slab]))
        boxes.append(np.maximum.reduceat(high[own], starts) - centre)
        firsts.append(first)
        ends.append(end)
        known += len(first)
        parted = sizes > 1
        children.append(np.where(parted, known + 2 * (np.cumsum(parted) - 1), 0))
        inside = centres[own]
        sides = np.maximum.reduceat(inside, starts) - np.minimum.reduceat(inside, starts)
        longest = np.argmax(sides, axis=1)
        order[held] = own[np.lexsort((inside[np.arange(len(own)), longest[node]], node))]
        first, end = first[parted], end[parted]
        middle = (first + end) // 2
        first, end = np.stack([first, middle], 1).ravel(), np.stack([middle, end], 1).ravel()
    return PartTree(
        np.ascontiguousarray(triangles[order]),
        np.concatenate(spheres),
        np.concatenate(slabs),
        np.concatenate(boxes),
        np.concatenate(firsts),
        np.concatenate(ends),
        np.concatenate(children),
        np.zeros(1, dtype=np.int64),
    )
