"""Runs when a Python process starts that a test without POSIX has started: what the test lacks, it lacks."""

from tests.without_posix.removal import apply

apply()
