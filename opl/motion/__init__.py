"""Whole motions: ways on the wheel and in the air, whether they are free, their times."""
