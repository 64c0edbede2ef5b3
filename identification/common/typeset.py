"""Words for a page as they are printed in books: µm, ±, arrows, and no line that ends between a number and its unit."""

from __future__ import annotations

import re

BLANK = "\u00a0"
UNITS = "µm|µrad|µs|mrad|arcsec|mm|m|kN|N|kg|Hz|rpm|deg|rad|min|ms|s|%"
RULES = tuple((re.compile(pattern), to) for pattern, to in (
    # um and urad behind a number or in brackets; never inside the name of a column or an option.
    (r"(?<=\d )u(?=(?:m|rad|s)\b)", "µ"), (r"^u(?=(?:m|rad|s)(?:/\S+)?$)", "µ"), (r"(?<=\[)u(?=(?:m|rad)[\]/^])", "µ"),
    (r"(?<=\w)\*(?=m\b)", "·"),
    (r"(?<=\d) \+- (?=[\d.])", f"{BLANK}±{BLANK}"), (r"(?<=\d) -> (?=[-\d])", f"{BLANK}→ "),
    (r"(?<=\d) \.\.\. (?=[-\d])", f"{BLANK}… "),
    (r"\bp <= (?=[\d.])", f"p{BLANK}≤{BLANK}"),
    (r"\bN m(?=/rad\b|\b)", f"N{BLANK}m"),
    (rf"(?<=\d) (?=(?:{UNITS})(?![\w=]))", BLANK)))


def typeset(text: str) -> str:
    """The text with the marks that the terminal has no letters for. Numbers stay as they are, digit by digit.

    >>> typeset("5.96 um RMS, 0.2 +- 0.1 urad")
    '5.96\\xa0µm RMS, 0.2\\xa0±\\xa00.1\\xa0µrad'
    """
    for pattern, to in RULES:
        text = pattern.sub(to, text)
    return text
