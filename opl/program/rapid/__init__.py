"""ABB RAPID modules (IRC5 and later): written, read back.

Every move carries its time and leads to joint angles, straight ones to poses. What is proven goes
through the written points; the corners that zone z0 cuts off, up to 0.3 mm of the tool point, are
not.
"""

from opl.program.dialect import VARIABLES
from opl.program.listing import listing_reader
from opl.program.posts import Post
from opl.program.rapid.read import corners, parse, start_speed
from opl.program.rapid.rounding import rounded
from opl.program.rapid.write import TEMPLATE, tool_name, write

POST = Post(
    "ABB RAPID",
    write,
    TEMPLATE,
    VARIABLES,
    reader=listing_reader(".mod", parse, tool_name, rounded, start_speed, corners),
)
