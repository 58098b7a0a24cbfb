"""What the controller reads.

A verified motion becomes a maker-neutral `moves.Program`, is cut into parts a controller can hold
(`split`), and is written in the controller's own language (`inform`) and as a table (`table`).

To add a controller of a known maker: a `controller.ControllerProfile` with the source of every
limit, and a golden program. To add a maker: one module beside `inform` that turns a `Program` into
text and reads that text back before it returns it, one template under ``templates/``, and a golden
program.
"""
