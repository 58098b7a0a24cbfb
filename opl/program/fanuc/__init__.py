"""FANUC TP programs as text (.LS): written, read back.

Positions are joint angles, of straight moves too, which leaves the controller no choice between
configurations; moves carry their time in whole milliseconds. How far CNT100
cuts off corners is not known in millimetres.
"""

from opl.program.fanuc.read import CORNERS, START, parse
from opl.program.fanuc.rounding import rounded
from opl.program.fanuc.write import DIALECT, VARIABLES, tool_name, write
from opl.program.listing import listing_reader
from opl.program.posts import Post

POST = Post(
    "FANUC TP (.LS)",
    write,
    DIALECT.template,
    VARIABLES,
    reader=listing_reader(DIALECT.suffix, parse, tool_name, rounded, lambda robot: START, CORNERS),
    # R-30iA and R-30iB round every segment up to whole 8 ms, one ITP (public notes)
    period=0.008,
)
