"""The vocabulary: what each APT word means for a toolpath.

Sources: the documented cutter location output of Siemens NX (CLSF manager), CATIA V5 (APT import), PTC Creo (CL output),
Autodesk (the public APT post-processor), and ISO 4343.
"""

from __future__ import annotations

import re

INCH = 25.4
UNITS = {"MM": 1.0, "MMS": 1.0, "CM": 10.0, "INCH": INCH, "INCHES": INCH, "IN": INCH}
"""Millimetres in one unit of the file."""

FEED_UNITS = {"MMPM": (1.0, "minute"), "IPM": (INCH, "minute"), "PERMIN": (None, "minute"),
              "MMPR": (1.0, "turn"), "IPR": (INCH, "turn"), "PERREV": (None, "turn")}
"""Millimetres (None: the file's unit) per minute or per turn of the spindle."""

# Said to the person at the machine, or to a machine this program does not know: kept as comments.
KEPT = frozenset((
    "PARTNO", "PPRINT", "REMARK", "INSERT", "SPINDL", "COOLNT", "STOP", "OPSTOP", "DELAY", "DWELL", "LOADTL", "LOAD", "TOOLNO",
    "TURRET", "SELECT", "SELCTL", "AUXFUN", "PREFUN", "CLAMP", "LEADER", "TOOL PATH", "DISPLY", "OPERATION",
))
SAID = frozenset(("PARTNO", "PPRINT", "REMARK", "TOOL PATH", "DISPLY", "OPERATION"))
"""Of these, the ones that only say something; the others would have done something on the machine."""

# Nothing of the path depends on them: display, tolerances that the points keep already, tool shape, file bookkeeping.
IGNORED = frozenset((
    "PAINT", "END-OF-PATH", "TLDATA", "CUTTER", "MACHIN", "INTOL", "OUTTOL", "TOLER", "AUTOPS", "PSIS", "HEADER", "CLPRNT",
    "PLABEL", "SEQNO", "OPSKIP", "ISN", "VERIFY", "PROGRM", "PRINT", "NOPOST", "END", "SAFETY", "CUT", "THICK", "AIR", "REWIND",
    "LINTOL", "MCHTOL", "MAXDP", "MAXDPM", "NUMPTS", "CLDIST", "SYN", "CONTCT", "SET", "LEADTL", "CALSUB", "ARCSLP", "ARCDAT",
    "CHANNL", "MODE", "SMOOTH", "SLOWDN",
))

# They move the tool, or change where other words move it to.
MOTION = frozenset((
    "ARC", "MOVETO", "COPY", "TRANS", "TRACUT", "ROTATE", "ROTABL", "ROTHED", "INDEX", "MIRROR", "SCALE", "POCKET", "SCURV",
    "PROFIL", "THREAD", "RETRCT", "ORIGIN", "CALL", "MACRO", "TERMAC", "LOOPST", "LOOPND", "JUMPTO", "IF", "NURBS", "SPLINE",
    "DNTCUT", "INCLUD", "CONT", "HEAD", "TURN", "ROUGH", "REFSYS", "LOCAL", "CSYS", "TMARK", "DEFCOPY",
    "TLLFT", "TLRGT", "TLON", "TLONPS", "TLOFPS", "CONTRL", "PIVOTZ", "SRFVCT", "INDIRP", "FIXOFF", "OFFSET",
))
_MOTION_SHAPE = re.compile(r"GO\b.*|GO[A-Z]+|MOV[A-Z]*|ROT[A-Z]*|.*=.*|[-+.\d].*|.*[,\s]GO[A-Z]+")
_HARMLESS = {"TRACUT": ("NOMORE",), "DNTCUT": ("NOMORE",), "COPY": ("NOMORE",), "ROTABL": (), "ORIGIN": (), "TRANS": ()}


def moves_the_tool(word: str) -> bool:
    """Whether a word that the reader has no rule for may move the tool; such a word is refused, never skipped."""
    return word in MOTION or _MOTION_SHAPE.fullmatch(word) is not None


def without_effect(word: str, arguments: list[str]) -> bool:
    """Whether a word of `MOTION` stands here with an argument that changes nothing: switched off, or all zeros."""
    if word not in _HARMLESS:
        return False
    if arguments and all(argument in _HARMLESS[word] for argument in arguments):
        return True
    zeros = bool(arguments) and all(argument.strip("+-0.") == "" and "0" in argument for argument in arguments)
    return zeros and word in ("ORIGIN", "TRANS")
