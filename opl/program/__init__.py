"""What the controller reads.

A verified motion becomes a maker-neutral `moves.Program`. The post that the job names writes it in
the language of the controller, one room for each: `inform`, `rapid`, `krl`, `fanuc`, `urscript`. A
table gives it configuration by configuration (`table`). What was written is read back: a reader
turns the files of a language into moves that no longer belong to a maker (`played.ReadMove`), which
are played as a controller makes them and proven (`opl.proof`).

To add a Yaskawa controller: a `controller.ControllerProfile` with the source of every limit, a line
in ``pyproject.toml`` and golden programs.

To add a language, a room of three modules and a line in ``pyproject.toml``:

1. ``read.py``: a ``parse`` that knows the statements of ``write`` and no others; anything else is a
   finding (`statements`). The fastest start, the largest corners and the digits stand there too.
2. ``write.py``: the `dialect.Dialect`, and a ``write`` that gives it the texts of the moves.
3. ``__init__.py``: the ``POST``, its reader made by `listing.listing_reader`, how configurations
   are rounded to the digits of the language (`digits`), and in words what of a program is proven
   and what is not.

Then golden programs in ``tests/units/test_posts.py``, and the language's row in
``tests/jobs/test_languages.py``, where faults are put into its files. Without a reader a language
is written and not read back, and nothing claims more.

To add a post of your own without touching opl: see `posts`, and ``tests/example_post`` for a whole
package.
"""
