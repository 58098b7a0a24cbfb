"""What the controller reads.

A verified motion becomes a maker-neutral `moves.Program`. The post that the job names writes it in
the language of the controller (`posts`, `inform`, `makers`), a table tells it posture by posture
(`table`). Every post reads back what it wrote before it returns it.

To add a controller of a known maker: a `controller.ControllerProfile` with the source of every
limit, a line in ``pyproject.toml`` and golden programs. To add a maker: see `makers`. To add a post
of your own without touching opl: see `posts`, and ``tests/example_post`` for a whole package.
"""
