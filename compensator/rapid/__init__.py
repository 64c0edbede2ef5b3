"""Reads ABB RAPID programs and rewrites only the numbers of corrected robtargets; every other byte is kept."""

from compensator.rapid.driven_order import said_of_order
from compensator.rapid.insertion import MoreMoves, follows_directly, move_text, with_more_moves, with_zones
from compensator.rapid.literals import POSITION_DECIMALS, QUATERNION_DECIMALS, Pose
from compensator.rapid.marks import Marks, marks_of, with_marks
from compensator.rapid.moves import ARGUMENTS
from compensator.rapid.program import RapidProgram
from compensator.rapid.reader import read_rapid
from compensator.rapid.reports import JOINED
from compensator.rapid.statements import INLINE, UNIT
from compensator.rapid.writer import Rewritten, rewrite

__all__ = [
    "ARGUMENTS", "INLINE", "JOINED", "POSITION_DECIMALS", "QUATERNION_DECIMALS", "UNIT", "Marks", "MoreMoves", "Pose",
    "RapidProgram", "Rewritten", "follows_directly", "marks_of", "move_text", "read_rapid", "rewrite", "said_of_order",
    "with_marks", "with_more_moves", "with_zones",
]
