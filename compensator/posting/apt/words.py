"""The vocabulary: what each APT word means for a toolpath.

Sources: the documented cutter location output of Siemens NX (CLSF manager), CATIA V5 (APT import), PTC Creo (CL output),
Autodesk (the public APT post-processor), and ISO 4343; for CAMWorks and Creo also files that their users published
(docs/cam-systems.md).
"""

from __future__ import annotations

import re

INCH = 25.4
UNITS = {"MM": 1.0, "MMS": 1.0, "CM": 10.0, "INCH": INCH, "INCHES": INCH, "IN": INCH}
"""Millimetres in one unit of the file."""

FEED_UNITS = {"MMPM": (1.0, "minute"), "IPM": (INCH, "minute"), "PERMIN": (None, "minute"),
              "MMPR": (1.0, "turn"), "IPR": (INCH, "turn"), "PERREV": (None, "turn")}
"""Millimetres (None: the file's unit) per minute or per turn of the spindle."""

# Of SPINDL: behind these stands the speed; behind RANGE, MAXRPM, ORIENT and other words a number of theirs.
OF_SPEED = frozenset(("RPM", "SFM", "SMM", "CLW", "CCLW", "ON"))

# Said to the person at the machine, or to a machine this program does not know: kept as comments.
KEPT = frozenset((
    "PARTNO", "PPRINT", "REMARK", "INSERT", "SPINDL", "COOLNT", "STOP", "OPSTOP", "DELAY", "DWELL", "LOADTL", "LOAD", "TOOLNO",
    "TURRET", "SELECT", "SELCTL", "AUXFUN", "PREFUN", "CLAMP", "LEADER", "TOOL PATH", "DISPLY", "OPERATION",
))
SAID = frozenset(("PARTNO", "PPRINT", "REMARK", "TOOL PATH", "DISPLY", "OPERATION"))
"""Of these, the ones that only say something; the others would have done something on the machine."""

# Nothing of the path depends on them: display, tolerances that the points keep already, file bookkeeping.
_IGNORED = frozenset((
    "PAINT", "END-OF-PATH", "MACHIN", "INTOL", "OUTTOL", "TOLER", "AUTOPS", "PSIS", "HEADER", "CLPRNT",
    "PLABEL", "SEQNO", "OPSKIP", "ISN", "VERIFY", "PROGRM", "PRINT", "NOPOST", "END", "SAFETY", "CUT", "THICK", "AIR", "REWIND",
    "LINTOL", "MCHTOL", "MAXDP", "MAXDPM", "NUMPTS", "CLDIST", "CONTCT", "SET", "LEADTL", "ARCSLP", "ARCDAT",
    "CHANNL", "MODE", "SMOOTH", "SLOWDN",
))
_TOOL_SHAPE = "CSI_SET_"                # CAMWorks: lengths of the tool

# They move the tool, or change where other words move it to, or what they mean.
_MOTION = frozenset((
    "ARC", "MOVETO", "COPY", "TRANS", "ROTATE", "ROTABL", "ROTHED", "INDEX", "MIRROR", "SCALE", "POCKET", "SCURV",
    "PROFIL", "THREAD", "RETRCT", "ORIGIN", "CALL", "CALSUB", "CALLSUB", "MACRO", "TERMAC", "LOOPST", "LOOPND", "JUMPTO", "IF",
    "NURBS", "SPLINE", "DNTCUT", "INCLUD", "CONT", "HEAD", "TURN", "ROUGH", "REFSYS", "LOCAL", "TMARK", "DEFCOPY", "SYN",
    "TLLFT", "TLRGT", "TLON", "TLONPS", "TLOFPS", "CONTRL", "PIVOTZ", "SRFVCT", "INDIRP", "FIXOFF", "OFFSET", "TLCOMP",
))
_MOTION_SHAPE = re.compile(r"GO\b.*|GO[A-Z]+|MOV[A-Z]*|ROT[A-Z]*|CYC[A-Z]*\d*|.*=.*|[-+.\d].*|.*[,\s]GO[A-Z]+")
_HARMLESS = {"DNTCUT": ("NOMORE",), "COPY": ("NOMORE",), "TLCOMP": ("OFF",), "ROTABL": (), "ORIGIN": (), "TRANS": ()}
_UNIT_SHAPE = re.compile(r".*UNIT.*|DIMEN.*|METRIC|INCH(ES)?|MMS?|IMPERIAL|MILLIM.*")


def ignored(word: str) -> bool:
    """Whether nothing of the path depends on a word."""
    return word in _IGNORED or word.startswith(_TOOL_SHAPE)


def moves_the_tool(word: str) -> bool:
    """Whether a word that the reader has no rule for may move the tool; such a word is refused, never skipped."""
    return word in _MOTION or _MOTION_SHAPE.fullmatch(word) is not None


def without_effect(word: str, arguments: list[str]) -> bool:
    """Whether a word that moves the tool stands here with an argument that changes nothing: switched off, or all zeros."""
    if word not in _HARMLESS:
        return False
    if arguments and all(argument in _HARMLESS[word] for argument in arguments):
        return True
    zeros = bool(arguments) and all(argument.strip("+-0.") == "" and "0" in argument for argument in arguments)
    return zeros and word in ("ORIGIN", "TRANS")


def looks_like_a_unit(word: str, arguments: list[str]) -> bool:
    """Whether a word without a rule may say the unit of length; then it is refused, for a wrong unit is a factor 25.4."""
    return _UNIT_SHAPE.fullmatch(word) is not None or (bool(arguments) and all(argument in UNITS for argument in arguments))
