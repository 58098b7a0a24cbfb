"""Whole motions: on the wheel and off it, whether they are free, their times."""
