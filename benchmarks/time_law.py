"""How long the time law takes for a thousand cutter points. By hand: python benchmarks/time_law.py.

One pass of a V-like motion: a feed of 20 mm/s, 1 mm steps, the contact swinging over the wheel in
intermediate nodes every hundred points; from easy to hard limits.
"""

from __future__ import annotations

import statistics
import sys
import time

import numpy as np

from opl.cell.robot_loading import load_robot
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, fastest_law

N_POINTS = 1000
STEP = 0.05  # [s] at the feed between two points
SWING_EVERY, SWING_NODES, NODE_STEP = 100, 40, 0.025


def motion() -> tuple[np.ndarray, np.ndarray]:
    """Return configurations and wanted times of a pass."""
    times, slide = [], []
    for point in range(1, N_POINTS):
        if point % SWING_EVERY == 0:
            times += [NODE_STEP] * SWING_NODES
            slide += [(-1.0) ** (point // SWING_EVERY)] * SWING_NODES
        times.append(STEP)
        slide.append(0.0)
    at = np.concatenate([[0.0], np.cumsum(times)])
    swung = np.concatenate([[0.0], np.cumsum(np.array(slide) * NODE_STEP)])
    ways = np.array([0.05, 0.04, 0.03, 0.2, 0.1, 0.15])
    phases = np.arange(6.0)
    smooth = ways * np.sin(0.4 * at[:, None] + phases)
    return smooth + swung[:, None] * np.array([0.15, 0.14, 0.1, 0.65, 0.37, 0.36]), np.array(times)


def main() -> None:
    """Print the median processor time of a law under each limit."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    robot = load_robot("mh24")
    q, times = motion()
    for share in (1.0, 1.0 / 20.0):
        limits = JointLimits(robot.max_speed, share * robot.max_acceleration)
        for at_rest in (False, True):
            spent = []
            for _ in range(repeats):
                start = time.process_time()
                law = fastest_law(rounded_line(q, times), limits, at_rest)
                spent.append(time.process_time() - start)
            print(
                f"{N_POINTS} cutter points, {len(times)} moves, {len(law.place)} places, "
                f"acceleration x {share:g}, {'at rest' if at_rest else 'in motion'}: median "
                f"{statistics.median(spent):.2f} s of processor; {times.sum():.1f} s wanted, "
                f"{law.time[-1]:.1f} s found"
            )


if __name__ == "__main__":
    main()
