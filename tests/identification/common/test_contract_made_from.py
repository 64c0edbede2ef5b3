"""Records and stiffness files that name what cannot be a file."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.common.files import sha256
from identification.common.made_from import said_of_changes, said_of_later, said_of_tables


@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "", "..", "/"])
def test_a_name_that_no_file_has_says_nothing(tmp_path: Path, name: str) -> None:
    """Found by the fuzzer: a name longer than the file system's ended the command."""
    named = {"file": name, "sha256": "0" * 64}
    assert said_of_changes({"input": named, "stiffness": named}, tmp_path, tmp_path / "out.mod") == ()
    assert said_of_tables(tmp_path / "stiffness.json", (named,)) == ()


def test_one_table_was_changed_and_two_were(tmp_path: Path) -> None:
    stiffness = tmp_path / "stiffness.json"
    for name in ("a.csv", "b.csv", "c.csv"):
        (tmp_path / name).write_text(name)
    tables = [{"file": name, "sha256": sha256(tmp_path / name)} for name in ("a.csv", "b.csv", "c.csv")]
    assert said_of_tables(stiffness, tables) == ()
    for changed, says in (("b.csv", "b.csv was"), ("c.csv", "b.csv and c.csv were")):
        (tmp_path / changed).write_text("other")
        (finding,) = said_of_tables(stiffness, tables)
        assert (finding.code, finding.level, finding.file) == ("CS1205", "warning", str(stiffness))
        assert finding.message == f"{says} changed since these stiffnesses were identified"


def test_a_stiffness_file_that_is_none_names_no_table_and_neither_does_a_record(tmp_path: Path) -> None:
    """A correction whose stiffness file is not read here is not the place to tell of its form."""
    stiffness = tmp_path / "stiffness.json"
    for content in ("no", "[1]", '{"made_from": 3}', '{"made_from": [3, {"file": 1}, {"file": "a.csv"}]}', "[" * 100000):
        stiffness.write_text(content)
        named = {"file": "stiffness.json", "sha256": sha256(stiffness)}
        assert said_of_changes({"stiffness": named}, tmp_path, tmp_path / "out.mod") == ()
        (tmp_path / "record.json").write_text(content)
        assert said_of_later(tmp_path / "record.json", tmp_path / "out.mod") == ()
