"""Reads ABB RAPID programs and rewrites only the numbers of corrected robtargets; every other byte is kept."""

from compensator.rapid.program import RapidProgram
from compensator.rapid.reader import read_rapid
from compensator.rapid.writer import Rewritten, rewrite

__all__ = ["RapidProgram", "Rewritten", "read_rapid", "rewrite"]
