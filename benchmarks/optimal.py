"""How long the optimal method takes and how much it needs. By hand: python benchmarks/optimal.py.

Processor time is printed beside wall-clock time: on a machine that has other work the latter says
little.
"""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from opl.job.load import load_job
from opl.planning.scene import planning_scene
from opl.run.preparing import problem_in
from opl.run.searches import search_path
from opl.run.surfacing import cut_surface
from opl.run.watch import Stage, Watch
from opl.search.ladder import Ladder
from opl.search.smooth import TrackCost, smoothest

WORKPIECES = Path(__file__).resolve().parent.parent / "workpieces"
FINE_PITCH = 1.25e-3  # [m] 17 rows fit on the V part
CASES = ("v_shape:1", "v_shape:5", "v_shape:17", "s_shape:5")


class Clock:
    """Wall-clock and processor time of stages, by name."""

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.processor: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Measure a stage."""
        wall, processor = time.perf_counter(), time.process_time()
        yield
        self.wall[stage] = time.perf_counter() - wall
        self.processor[stage] = time.process_time() - processor

    def watch(self) -> Watch:
        """Return what measures the stages of a run, each by the ends it reports."""
        started: dict[str, tuple[float, float]] = {}

        def progress(stage: Stage, fraction: float) -> None:
            now = time.perf_counter(), time.process_time()
            if fraction == 0.0:
                started[stage.value] = now
            elif fraction == 1.0:
                wall, processor = started[stage.value]
                self.wall[stage.value] = now[0] - wall
                self.processor[stage.value] = now[1] - processor

        return Watch(progress)

    def text(self, *stages: str) -> str:
        """Return the times of some stages together."""
        wall = sum(self.wall[stage] for stage in stages)
        processor = sum(self.processor[stage] for stage in stages)
        return f"{wall:.2f} s ({processor:.2f} s of processor)"


def smooth_stage(n_columns: int = 1000, n_rows: int = 140, n_branches: int = 2) -> None:
    """Print what the smoothest track through a whole field costs, nothing of it blocked."""
    random = np.random.default_rng(0)
    t = np.linspace(-70.0, 70.0, n_rows)
    along = np.linspace(0.0, 1.0, n_columns)
    everywhere = np.ones((n_columns, n_rows), dtype=bool)
    feed = np.full(n_columns - 1, 0.1)
    clock = Clock()
    for branch in range(n_branches):
        slope, wave, twist = random.normal(0.0, 0.3, (3, 6))
        q = along[:, None, None] * slope + np.sin(t / 40.0)[:, None] * wave
        q = q + along[:, None, None] * (t / 70.0)[:, None] * twist
        q += random.normal(0.0, 1e-3, q.shape)
        ladder = Ladder(
            q=q,
            free=everywhere,
            contact_position=t,
            off_wheel=np.zeros(n_columns - 1, dtype=bool),
            max_contact_step=1.0,
            max_joint_step=np.deg2rad(15.0),
            max_contact_change=10_000.0,
        )
        costs = TrackCost(
            joint_weights=np.ones(6),
            contact_weight=0.01,
            time_weight=0.0,
            edge_seconds=feed,
            max_speed=np.full(6, 3.0),
            contact_speed=40.0,
            node_cost=np.zeros((n_columns, n_rows)),
        )
        with clock(f"branch {branch}"):
            track = smoothest(ladder, np.empty(0, dtype=np.int64), everywhere, costs)
        assert track is not None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6  # kilobytes on Linux
    print(
        f"smoothest track of {n_columns} x {n_rows} nodes on {n_branches} branches: "
        f"{clock.text(*clock.wall)}; the process held {most:.2f} GB at the most"
    )


def search(part: str, rows: int) -> None:
    """Print time, value and bound of one search with its collision checks."""
    job = load_job(WORKPIECES / part / "job.yaml")
    passes = replace(job.passes, rows=rows)
    job = replace(job, passes=replace(passes, pitch=FINE_PITCH) if rows > 5 else passes)
    points = cut_surface(job).points
    clock = Clock()
    problem = problem_in(planning_scene(job.cell), job, points, clock.watch())
    with clock("search"):
        found = search_path(job.search, problem)
    plan = found.plan
    assert plan.lower_bound is not None and found.recursive is not None
    path, other = plan.path, found.recursive.path
    assert plan.gap is not None
    print(
        f"{part}, {rows} rows, {len(points)} points: {clock.text('clearance', 'search')}; sum "
        f"{path.joint_range_sum:.5f} rad, bound {plan.lower_bound:.5f}, gap "
        f"{100 * plan.gap:.3f} %; "
        f"joint travel {path.joint_travel:.2f} (recursive {other.joint_travel:.2f}), "
        f"travel of t {path.contact_travel:.1f} (recursive {other.contact_travel:.1f})"
    )


def main() -> None:
    """Print the figures; parts and rows may be named as arguments, like ``v_shape:5``."""
    load_average = ", ".join(f"{load:.1f}" for load in os.getloadavg())
    print(f"{os.cpu_count()} processors, load {load_average}")
    smooth_stage()
    for case in sys.argv[1:] or CASES:
        part, _, rows = case.partition(":")
        search(part, int(rows))


if __name__ == "__main__":
    main()
