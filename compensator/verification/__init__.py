"""Measured deviation before a correction against after it."""
