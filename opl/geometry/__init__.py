"""Shapes and poses; knows no robot."""
