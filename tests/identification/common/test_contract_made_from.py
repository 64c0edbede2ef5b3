"""Records and stiffness files that name what cannot be a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.common.made_from import said_of_changes, said_of_tables


@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "", "..", "/"])
def test_a_name_that_no_file_has_says_nothing(tmp_path: Path, name: str) -> None:
    """Found by the fuzzer: a name longer than the file system's ended the command."""
    named = {"file": name, "sha256": "0" * 64}
    assert said_of_changes({"input": named, "stiffness": named}, tmp_path, tmp_path / "out.mod") == ()
    assert said_of_tables(tmp_path / "stiffness.json", (named,)) == ()
