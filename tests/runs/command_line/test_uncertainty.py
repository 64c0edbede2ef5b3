"""One convention: words tell the uncertainty of a result as two sigma, files and JSON keep one under the names they have."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import workshop

PACKAGES = [Path(__file__).parents[3] / name for name in ("identification", "compensator", "compstiff")]
CORRECT = ("correct", "@cell.yaml", "@part.mod", "--stiffness", "@stiffness.json", "--forces", "@forces.csv", "--tare", "0:1",
           "-o", "@out.mod", "--force")


def test_the_terminal_tells_twice_what_json_holds(tmp_path: Path) -> None:
    held = workshop("irb6700-200-2.60").run(tmp_path, {}, *CORRECT).json["result"]
    said = kit.run(*(tmp_path / word[1:] if word.startswith("@") else word for word in CORRECT)).out
    largest = float(re.search(r"uncertain by up to ([\d.]+) um \(2 sigma\)", said)[1])
    assert largest == pytest.approx(2 * held["deviation_std_um"]["largest"], abs=0.06)
    rms, worst = map(float, re.search(r"left on the part, 2 sigma: ([\d.]+) um RMS, ([\d.]+) um at most", said).groups())
    assert rms == pytest.approx(2 * held["expected_left_um"]["rms"], abs=0.06)
    assert worst == pytest.approx(2 * held["expected_left_um"]["largest"], abs=0.06)
    assert rms > 0.5, "so that the digits tell one from two"


def test_what_stands_behind_a_plus_or_minus_is_two_sigma() -> None:
    """In every message and line of the packages."""
    behind = [(path.name, text[1]) for package in PACKAGES for path in sorted(package.rglob("*.py"))
              for text in re.finditer(r"\+- \(?\{([^}]*)", path.read_text(encoding="utf-8"))]
    assert len(behind) > 10
    assert [one for one in behind if "two_sigma(" not in one[1]] == []
