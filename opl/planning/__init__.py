"""From cutter points to a motion."""
