"""A tiny APT interpreter of its own: where the tool is behind every GOTO of a file of straight moves, in millimetres."""

from __future__ import annotations

import re


def visited(text: str) -> list[tuple[list[float], list[float], float | None]]:
    """(position, tool axis, feed [mm/s] or None in the air) of every GOTO and GODLTA."""
    text = re.sub(r"\$\$.*", "", text)
    text = re.sub(r"\$[ \t]*\n", "", text)
    scale = 25.4 if re.search(r"UNITS\s*/\s*INCH", text) else 1.0
    axis, here, feed, rapid = [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], None, False
    found = []
    for line in text.splitlines():
        word, _, rest = line.partition("/")
        numbers = [float(part) for part in re.findall(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?", rest)]
        match word.strip():
            case "RAPID":
                rapid = True
            case "FEDRAT":
                feed = numbers[0] * (25.4 if "IPM" in rest else 1.0 if "MMPM" in rest else scale) / 60
            case "GOTO" | "GODLTA" as kind:
                step = [scale * x for x in numbers[:3]]
                here = step if kind == "GOTO" else [a + b for a, b in zip(here, step, strict=True)]
                axis = numbers[3:] or axis
                found.append((here, axis, None if rapid else feed))
                rapid = False
    return found
