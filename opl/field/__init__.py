"""The node matrix over cutter points and contact positions, and paths through it."""
