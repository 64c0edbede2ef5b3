"""What is marked `long` is told in small by a faster test: other cases of it, or what a comment above names."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable

import pytest

from tests.conftest import LONG_ALONE


def silent(function: Callable[..., None]) -> bool:
    """Whether no comment above it says what tells the same without `--long`."""
    return not re.search(r"# Long: .{10}", inspect.getcomments(function) or "")


def test_what_runs_with_long_alone_says_what_tells_it_without(pytestconfig: pytest.Config) -> None:
    """Of what is collected: where all files are, all."""
    assert [f"{one.__module__}.{one.__name__}" for one in pytestconfig.stash[LONG_ALONE] if silent(one)] == []


# Long: neither runs: these are what the test above looks at.
def said() -> None:
    pass


def unsaid() -> None:
    pass


def test_one_that_says_nothing_is_found() -> None:
    assert not silent(said)
    assert silent(unsaid)
