"""A post for a controller of one's own: a line for each move."""

from pathlib import Path

import numpy as np

from opl.program.layout import fill
from opl.program.posts import Post, Written

TEMPLATE = Path(__file__).with_name("moves.txt.j2")


def write(program, robot, settings, date):
    """Return the program: joint angles in degrees and the time of each move in seconds."""
    moves = [
        {
            "angles": " ".join(f"{angle:.3f}" for angle in np.rad2deg(move.q)),
            "time": "slowly" if move.duration is None else f"{move.duration:.3f}",
        }
        for move in program.moves
    ]
    values = {"name": program.name, "date": f"{date:%Y-%m-%d}", "moves": moves}
    return Written({f"{program.name}.txt": fill(settings.template or TEMPLATE, values)})


POST = Post(
    title="our own cell",
    write=write,
    template=TEMPLATE,
    variables={
        "name": "program name",
        "date": "of the program",
        "moves": "each move: move.angles and move.time",
    },
)
