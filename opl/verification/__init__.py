"""A second opinion on a motion, which shares no code with what planned it."""
