"""The numbers of a long program are those that Python reads from each word, to the last bit; no word that is none passes."""

from __future__ import annotations

import re

import numpy as np
import pytest

from compensator.rapid import read_rapid
from compensator.rapid.text import where_is
from identification.common.findings import CompstiffError

COUNT = 6000
TAILS = ("v1000,z5,tool0", "v50,fine,tool0", "v50\\V:=12,z1,tool0")


def words(rng: np.random.Generator) -> list[list[str]]:
    """x y z [mm] of COUNT targets, as programs may spell them."""
    values = rng.normal(0.0, 1000.0, (COUNT, 3)) * 10.0 ** rng.integers(-12, 3, (COUNT, 3))
    spellings = ("{!r}", "{:.8f}", "{:.0f}", "{:.25f}", "{:.17e}", "{:E}", "{:.1f}")
    return [[spellings[k].format(float(x)) for x, k in zip(row, rng.integers(0, len(spellings), 3), strict=True)]
            for row in values]


def program(rows: list[list[str]], tail: np.ndarray) -> bytes:
    lines = [f"MoveL [[{','.join(row)}],[0.5,0.5,0.5,0.5],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{TAILS[k]};"
             for row, k in zip(rows, tail, strict=True)]
    return ("MODULE M\nPROC main()\n" + "\n".join(lines) + "\nENDPROC\nENDMODULE\n").encode()


def test_numbers_and_tails_of_many_moves_are_those_of_each_alone() -> None:
    rng = np.random.default_rng(86)
    rows, tail = words(rng), rng.integers(0, len(TAILS), COUNT)
    toolpath = read_rapid(program(rows, tail)).toolpath
    expected = np.array([[float(word) for word in row] for row in rows]) / 1e3
    assert np.array_equal(toolpath.position.view(np.int64), expected.view(np.int64))
    assert np.array_equal(toolpath.feed, np.array([1.0, 0.05, 0.012])[tail])


@pytest.mark.parametrize("word", ["1E999", "-1E999"])
def test_a_number_that_no_target_has_is_refused_among_many(word: str) -> None:
    rng = np.random.default_rng(87)
    rows = words(rng)
    rows[4321][1] = word
    with pytest.raises(CompstiffError, match="out of range") as refused:
        read_rapid(program(rows, np.zeros(COUNT, dtype=int)))
    assert refused.value.findings[0].line == 2 + 4321 + 1


def test_a_letter_is_found_wherever_it_stands_in_a_long_text() -> None:
    text = np.random.default_rng(3).integers(0, 256, 9_000_001, dtype=np.uint8).tobytes()
    found = where_is(np.frombuffer(text, dtype=np.uint8), ord(";"))
    assert found.tolist() == [match.start() for match in re.finditer(b";", text)]
