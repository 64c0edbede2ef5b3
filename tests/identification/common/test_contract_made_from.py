"""Records and stiffness files that name what cannot be a file."""

from __future__ import annotations

import json
import os
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


def record_of(output: str) -> dict[str, object]:
    return {"format": "compstiff-correction", "input": {"file": "part.mod", "sha256": "1"},
            "output": {"file": output, "sha256": output}}


@pytest.mark.parametrize(("seconds", "told"), [(1.9, False), (2.1, True), (-100.0, False)])
def test_of_two_corrections_of_a_program_the_earlier_is_told(tmp_path: Path, seconds: float, told: bool) -> None:
    """By over two seconds: files that one copy wrote differ by less."""
    own, other = tmp_path / "a.json", tmp_path / "b.json"
    own.write_text(json.dumps(record_of("a.mod")))
    other.write_text(json.dumps(record_of("b.mod")))
    os.utime(own, (1e9, 1e9))
    os.utime(other, (1e9 + seconds, 1e9 + seconds))
    found = said_of_later(own, tmp_path / "a.mod")
    assert [(one.code, one.message) for one in found] == [
        ("CS4206", "is the earlier of two corrections of part.mod: b.mod was written later")][: int(told)]


@pytest.mark.parametrize(("more", "read"), [(0, True), (1, False)])
def test_what_is_too_large_for_a_record_or_a_stiffness_file_is_none(tmp_path: Path, more: int, read: bool) -> None:
    """64 and 16 mebibytes."""
    own, other = tmp_path / "a.json", tmp_path / "b.json"
    own.write_text(json.dumps(record_of("a.mod")))
    other.write_text(json.dumps(record_of("b.mod")).ljust(2**26 + more))
    os.utime(own, (1e9, 1e9))
    assert bool(said_of_later(own, tmp_path / "a.mod")) == read
    (tmp_path / "a.csv").write_text("changed")
    stiffness = tmp_path / "stiffness.json"
    stiffness.write_text(json.dumps({"made_from": [{"file": "a.csv", "sha256": "0"}]}).ljust(2**24 + more))
    named = {"file": "stiffness.json", "sha256": sha256(stiffness)}
    found = said_of_changes({"stiffness": named}, tmp_path, tmp_path / "out.mod")
    assert [one.code for one in found] == ["CS1205"][: int(read)]
