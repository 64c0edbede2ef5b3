"""What a usual run leaves out: what is marked `long` is told in small by a faster test (other cases of it, or what a comment
above names), and what slow.txt names is there."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import COLLECTED, LONG_ALONE, SLOW

ROOT = Path(__file__).parents[1]


def silent(function: Callable[..., None]) -> bool:
    """Whether no comment above it says what tells the same without `--long`."""
    return not re.search(r"# Long: .{10}", inspect.getcomments(function) or "")


def test_what_runs_with_long_alone_says_what_tells_it_without(pytestconfig: pytest.Config) -> None:
    """Of what is collected: where all files are, all."""
    assert [f"{one.__module__}.{one.__name__}" for one in pytestconfig.stash[LONG_ALONE] if silent(one)] == []


def test_what_is_slow_is_a_test(pytestconfig: pytest.Config) -> None:
    """Of the files that were collected, and of none that is gone: one that has another name now would run, and nobody would
    know why it takes so long."""
    collected = pytestconfig.stash[COLLECTED]
    files = {name.split("::")[0] for name in collected}
    gone = {name for name in SLOW - collected if (file := name.split("::")[0]) in files or not (ROOT / file).is_file()}
    assert sorted(gone) == []


# Long: neither runs: these are what the test above looks at.
def said() -> None:
    pass


def unsaid() -> None:
    pass


def test_one_that_says_nothing_is_found() -> None:
    assert not silent(said)
    assert silent(unsaid)
