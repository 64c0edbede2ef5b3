"""The same APT file written otherwise is the same path: letters, blanks, lines, remarks, numbers, coordinates and tool axes."""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from compensator.posting.apt import read_apt
from compensator.posting.campath import CamPath

MANNERS = Path(__file__).parent / "manners"
FILES = [("autodesk.apt", None), ("camworks.apt", "4"), ("camworks.apt", "9"), ("catia.aptsource", None), ("creo.ncl.3", None),
         ("mastercam.cl", None), ("nx.cls", None), ("solidcam.apt", None)]
UPRIGHT = "CS2184"      # that no tool axis is stated
# Statements whose arguments are numbers and words, not text for people.
PLAIN = re.compile(r"\s*(GOTO|CIRCLE|FEDRAT|CYCLE|TRACUT|INDIRV|TLON|TLAXIS|MOVARC|CSYS|CUTTER|SPINDL|MSYS|\$\$-> CSYS)\s*[/,]")
# A turn about (1, 2, 2) by 120 degrees and a shift [of the file's unit].
AXIS = np.array([1, 2, 2]) / 3
TURN = 1.5 * np.outer(AXIS, AXIS) - 0.5 * np.eye(3) + np.sqrt(0.75) * np.cross(np.eye(3), -AXIS).T
SHIFT = np.array([3.0, -40, 7])


def statements(text: str) -> list[str]:
    """The lines of a file, continued ones joined."""
    return re.sub(r"\$[ \t]*\n\s*", "", text).splitlines()


def plain(change: Callable[[str], str]) -> Callable[[str], str]:
    """The change made in the plain statements alone."""
    return lambda text: "\n".join(change(line) if PLAIN.match(line) else line for line in statements(text)) + "\n"


def in_other_axes(text: str) -> str:
    """Places, directions and circles in axes from which TRACUT leads to the file's; each GOTO says its tool axis."""
    found = []
    for line in statements(text):
        word, *row = (cell.strip() for cell in re.split("[/,]", line))
        if word in ("GOTO", "CIRCLE", "MOVARC", "GOHOME"):
            row += ["0", "0", "1"] if word == "GOTO" and len(row) == 3 else []
            place = TURN.T @ (np.array(row[:3], float) - SHIFT)
            row[:6] = [f"{x:.13f}" for x in (*place, *(TURN.T @ np.array(row[3:6], float) if len(row) >= 6 else ()))]
            line = f"{word}/{','.join(row)}"
        found.append(line)
        if word == "UNITS":
            found.append("TRACUT/" + ",".join(f"{x:.16f}" for x in np.column_stack([TURN, SHIFT]).ravel()))
    return "\n".join(found) + "\n"


WAYS: dict[str, Callable[[str], str]] = {
    "small letters": str.lower,
    "blanks": plain(lambda line: re.sub(r"\s*([/,])\s*", r"  \1 ", line, count=0)),
    "no blanks": plain(lambda line: re.sub(r"\s+(?=[/,])|(?<=[/,])\s+", "", line).rstrip()),
    "lines": plain(lambda line: re.sub(r",(?=[^,]*$)", ",$\n  ", line)),
    "remarks": lambda text: "$$ GOTO/1,2,3\n" + "\n$$ FEDRAT/1,MMPM\n".join(statements(text)) + "\n$$\n",
    "remarks behind": plain(lambda line: f"{line} $$ GOTO/1,2,3" if not line.startswith("$$") else line),
    "exponents": plain(lambda line: re.sub(r"(?<=[/,])\s*-?\d+\.\d*(?=\s*(?:[,)]|$))",
                                           lambda found: f"{float(found[0]):.14E}", line)),
    "short numbers": plain(lambda line: re.sub(r"(?<=[/,])\s*(-?)0\.(\d*?)0*(?=\s*(?:,|$))",
                                               lambda found: f"{found[1]}.{found[2]}" if found[2] else "0", line)),
    "line ends": lambda text: text.replace("\n", "\r\n"),
    "empty lines": lambda text: "\n\n   \n".join(statements(text)) + "\n\n",
}


def driven(path: CamPath) -> tuple[np.ndarray, ...]:
    assert path.axis is not None
    return path.position, path.axis, np.nan_to_num(path.feed, nan=-1.0), path.rapid, path.stop, path.move


def same(was: CamPath, now: CamPath) -> None:
    for before, after in zip(driven(was), driven(now), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-11, atol=1e-12)
    cutters = [[(one.diameter, one.corner, one.beyond) for one in path.cutters] for path in (was, now)]
    assert cutters[0] == cutters[1]
    assert was.spindle_rpm == now.spindle_rpm
    told = [Counter(one.code for one in path.findings if one.code != UPRIGHT) for path in (was, now)]
    assert told[0] == told[1]


@pytest.mark.parametrize(("name", "tool"), FILES, ids=[f"{name}-{tool}" if tool else name for name, tool in FILES])
@pytest.mark.parametrize("way", WAYS)
def test_a_file_written_otherwise_is_the_same_path(tmp_path: Path, name: str, tool: str | None, way: str) -> None:
    other = tmp_path / name
    other.write_bytes(WAYS[way]((MANNERS / name).read_text()).encode())
    same(read_apt(MANNERS / name, tool), read_apt(other, tool))


@pytest.mark.parametrize("name", ["autodesk.apt", "creo.ncl.3"])
def test_a_file_in_other_axes_is_the_same_path(tmp_path: Path, name: str) -> None:
    other = tmp_path / name
    other.write_text(in_other_axes((MANNERS / name).read_text()))
    same(read_apt(MANNERS / name), read_apt(other))
