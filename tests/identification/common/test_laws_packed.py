"""Columns packed for a page come out as they went in, by an unpacking of its own."""

from __future__ import annotations

import base64
import json
import zlib

import numpy as np
import pytest

from identification.common.packed import MISSING, packed, packed_words


def unpacked(text: str, columns: int) -> np.ndarray:
    """(n, columns) whole steps: the lowest bytes of all numbers come first, then the next; rows add up."""
    content = zlib.decompress(base64.b64decode(text))
    count = len(content) // 4
    words = [sum(content[plane * count + k] << 8 * plane for plane in range(4)) for k in range(count)]
    total = np.cumsum(np.array(words, dtype=object).reshape(columns, -1), axis=1)
    return np.array([[(value + 2**31) % 2**32 - 2**31 for value in column] for column in total]).T


@pytest.mark.parametrize(("columns", "step"), [(1, 1.0), (3, 0.25)])
def test_what_is_packed_is_there(columns: int, step: float) -> None:
    """Of any size and sign that 32 bits have, in the nearest step."""
    values = np.random.default_rng(columns).normal(0, 1e6, (200, columns))
    values[3, 0], values[4, 0], values[5, 0] = 0.0, 2147483647 * step, -2147483647 * step
    np.testing.assert_array_equal(unpacked(packed(values, step), columns), np.rint(values / step))


@pytest.mark.parametrize("nowhere", [np.nan, np.inf, -np.inf, 2.0**31, -(2.0**31), 1e300])
def test_what_is_no_number_or_too_large_is_missing(nowhere: float) -> None:
    assert unpacked(packed(np.array([1.0, nowhere, -7.0])), 1)[:, 0].tolist() == [1, MISSING, -7]


def test_words_are_packed_in_order() -> None:
    words = ["a", "b\"<", "µ"]
    assert json.loads(zlib.decompress(base64.b64decode(packed_words(words)))) == words
