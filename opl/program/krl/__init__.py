"""KUKA KRL programs (KRC2 and later): written, read back.

Positions stand in the moves, so that no .dat file is needed. How far C_PTP and C_VEL cut off
corners is not known in millimetres. Moves on the wheel are straight by
default; a single joint move may be one percent of top speed faster than planned, and passes keep
their time.
"""

from opl.program.digits import rounded_degrees
from opl.program.krl.read import CORNERS, DECIMALS, START, parse
from opl.program.krl.write import DIALECT, VARIABLES, tool_name, write
from opl.program.listing import listing_reader
from opl.program.posts import Post
from opl.program.settings import MotionForm

POST = Post(
    "KUKA KRL",
    write,
    DIALECT.template,
    VARIABLES,
    motion=MotionForm.STRAIGHT,
    reader=listing_reader(
        DIALECT.suffix, parse, tool_name, rounded_degrees(DECIMALS), lambda robot: START, CORNERS
    ),
    # sensor interfaces of KRC2 and KRC4 run at 12 ms (public pages of RSI); assumed for moves
    period=0.012,
)
