"""ABB RAPID modules (IRC5 and later): written, read back.

Joint moves carry their time and lead to joint angles; straight ones lead the part past a stationary
tool at the wheel, to poses of it in the part, at the speed over the part. Corners are
cut off within z0, 0.3 mm of the tool point.
"""

from opl.program.digits import rounded_degrees
from opl.program.listing import listing_reader
from opl.program.posts import Post, StationaryTools
from opl.program.rapid.read import CORNERS, DECIMALS, START, parse
from opl.program.rapid.tool_data import declaration_faults
from opl.program.rapid.write import DIALECT, VARIABLES, tool_name, write

POST = Post(
    "ABB RAPID",
    write,
    DIALECT.template,
    VARIABLES,
    stationary_tools=StationaryTools.USUAL,
    reader=listing_reader(
        DIALECT.suffix,
        parse,
        tool_name,
        rounded_degrees(DECIMALS),
        lambda robot: START,
        CORNERS,
        declaration_faults,
    ),
    # externally guided motion of IRC5 takes positions every 4 ms (its manual); assumed for moves
    period=0.004,
)
