"""Universal Robots scripts (URScript): written, read back.

Positions are joint positions in radians, of straight moves too; every move carries its time.
Corners are cut off within their blends, 1 mm at the most.
"""

from opl.program.digits import rounded_radians
from opl.program.listing import listing_reader
from opl.program.posts import Post
from opl.program.urscript.read import CORNERS, DECIMALS, parse, start_speed
from opl.program.urscript.write import DIALECT, VARIABLES, tool_name, write

POST = Post(
    "Universal Robots URScript",
    write,
    DIALECT.template,
    VARIABLES,
    reader=listing_reader(
        DIALECT.suffix, parse, tool_name, rounded_radians(DECIMALS), start_speed, CORNERS
    ),
    # CB3 takes set points at 125 Hz, e-Series at 500 Hz (public manuals); the slower one assumed
    period=0.008,
)
