"""How long surface points and cutter points take. By hand: python benchmarks/geometry.py."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from opl.geometry.frames import from_axes
from opl.geometry.machined import load_faces
from opl.geometry.passes import Passes, lay_passes
from opl.geometry.patchwork import Patchwork

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"


def best(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest time of a few runs in [s] of one core, whatever else the machine does."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    """Print the times."""
    (blade,) = load_faces(WORKPIECES / "turbine_blade" / "surface.json")
    surface = blade.surface
    lower, upper = surface.domain
    uv = np.random.default_rng(0).uniform(lower, upper, (100_000, 2))

    def points() -> None:
        S = surface.derivatives(uv, 1)  # the points are S[:, 0, 0]
        z = surface.unit_normal(uv, S)
        T = from_axes(z, S[:, 1, 0], S[:, 0, 0])
        surface.curvature_tensor(uv, T[:, :3, 0], T[:, :3, 1])

    print(f"100 000 surface points, normals, curvatures: {best(points):.3f} s")

    plan = Passes(np.array([1.0, 0.0, 0.0]), 0.4e-3, 0.005e-3, 1e-3)
    laid = lay_passes(Patchwork((blade,)), plan)
    spent = best(lambda: lay_passes(Patchwork((blade,)), plan), 1)
    count = len(laid.points)
    print(
        f"{count} cutter points with frames in {laid.points.n_passes} passes: {spent:.2f} s, "
        f"{1e4 * spent / count:.2f} s for 10 000"
    )


if __name__ == "__main__":
    main()
