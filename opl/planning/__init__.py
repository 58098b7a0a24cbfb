"""From cutter points to a problem, and to motions that are free."""
