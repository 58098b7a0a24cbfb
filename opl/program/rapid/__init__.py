"""ABB RAPID modules (IRC5 and later): written, read back.

Every move carries its time and leads to joint angles, straight ones to poses. What is proven goes
through the written points; the corners that zone z0 cuts off, up to 0.3 mm of the tool point, are
not.
"""

from opl.program.dialect import VARIABLES
from opl.program.digits import rounded_degrees
from opl.program.listing import listing_reader
from opl.program.posts import Post
from opl.program.rapid.read import CORNERS, DECIMALS, START, parse
from opl.program.rapid.write import DIALECT, tool_name, write

POST = Post(
    "ABB RAPID",
    write,
    DIALECT.template,
    VARIABLES,
    reader=listing_reader(
        DIALECT.suffix, parse, tool_name, rounded_degrees(DECIMALS), lambda robot: START, CORNERS
    ),
    # externally guided motion of IRC5 takes positions every 4 ms (its manual); assumed for moves
    period=0.004,
)
