"""Posts of other makers than Yaskawa: one module and one template each.

All write joint angles; where a straight move was asked for, they write it as the maker does. To
add one: a module like these with a `POST`, a template, a line in ``pyproject.toml`` and a golden
program.
"""
