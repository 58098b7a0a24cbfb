"""Offline programming for robotic belt grinding."""

__version__ = "0.1.0"
