"""FANUC TP programs as text (.LS): written, read back.

Positions are joint angles, of straight moves too, which leaves the controller no choice between
configurations; moves carry their time in whole milliseconds. How far CNT100
cuts off corners is not known in millimetres.

On request straight moves carry the motion option RTCP (remote TCP): the origin of the user frame is
a tool that stands, and the speed is that between it and the part (FANUC, teach pendant programming,
remote TCP motion option; UFRAME_NUM selects the frame). It is a software option of the controller
and does not go with coordinated motion. The user frame itself lies on the controller: the program
tells where it must lie, in comments, and nothing in the file proves that it does.
"""

from opl.program.fanuc.read import CORNERS, START, parse
from opl.program.fanuc.rounding import rounded
from opl.program.fanuc.write import DIALECT, VARIABLES, tool_name, write
from opl.program.listing import listing_reader
from opl.program.posts import Post, StationaryTools

POST = Post(
    "FANUC TP (.LS)",
    write,
    DIALECT.template,
    VARIABLES,
    stationary_tools=StationaryTools.IN_FRAME,
    reader=listing_reader(DIALECT.suffix, parse, tool_name, rounded, lambda robot: START, CORNERS),
    # R-30iA and R-30iB round every segment up to whole 8 ms, one ITP (public notes)
    period=0.008,
)
