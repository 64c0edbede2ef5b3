"""Columns of numbers as short text for a page: whole steps, differences, planes of bytes, deflate, base64."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

MISSING = -(2**31)


def packed(values: NDArray[np.float64], step: float = 1.0) -> str:
    """values (n,) or (n, k) in whole steps, 32 bits each; what is not finite, or does not fit, is MISSING. report.js unpacks.

    Each column holds differences from row to row, modulo 2^32, and first come the lowest bytes of all numbers: neighbours are
    alike, so that most bytes are zero.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        steps = np.rint(np.asarray(values, dtype=float) / step)
    fits = np.abs(np.nan_to_num(steps, nan=np.inf)) < -MISSING
    whole = np.where(fits, np.nan_to_num(steps, nan=0.0, posinf=0.0, neginf=0.0), MISSING).astype(np.int64)
    differences = np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1])).T
    words = (differences & 0xFFFFFFFF).astype("<u4")
    return _text(np.ascontiguousarray(words).view(np.uint8).reshape(-1, 4).T.tobytes())


def packed_words(words: Sequence[str]) -> str:
    """The same of texts."""
    return _text(json.dumps(list(words)).encode())


def _text(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode("ascii")
