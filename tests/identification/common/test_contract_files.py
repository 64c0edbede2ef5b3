"""Files that cannot be written are told before anything is worked out, and files that change meanwhile afterwards."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from identification.common.audit import append
from identification.common.files import AsRead, check_writable, file_stamp, json_bytes
from identification.common.findings import CompstiffError


def refused(path: Path, *, overwrite: bool = False) -> tuple[str, str]:
    with pytest.raises(CompstiffError) as stopped:
        check_writable([path], overwrite=overwrite)
    (finding,) = stopped.value.findings
    assert finding.file == str(path)
    return finding.code, finding.message


@pytest.mark.parametrize("letter", ["a", "\N{LATIN SMALL LETTER A WITH DIAERESIS}"])
def test_a_name_may_have_255_bytes(tmp_path: Path, letter: str) -> None:
    """Letters of other alphabets count two and more."""
    longest = tmp_path / (letter * (255 // len(letter.encode())))
    check_writable([longest], overwrite=False)
    longest.write_text("it really can")
    longer = tmp_path / (letter + longest.name)
    size = len(longer.name.encode())
    assert size in (256, 256 + len(letter.encode()) - 1)
    assert refused(longer) == ("CS0004", f"a name of {size} bytes, at most 255 are possible")


def test_what_stands_there_is_kept(tmp_path: Path) -> None:
    (tmp_path / "there").write_text("mine")
    os.symlink(tmp_path / "nowhere", tmp_path / "link")
    for name in ("there", "link"):
        assert refused(tmp_path / name) == ("CS0003", "exists already and is not overwritten")
        check_writable([tmp_path / name], overwrite=True)
    assert refused(tmp_path, overwrite=True) == ("CS0004", "is a folder, a file name was expected")
    assert refused(tmp_path / "no" / "a.csv") == ("CS0004", f"cannot be written: there is no folder {tmp_path / 'no'}")


def test_a_file_that_changed_or_came_or_went_is_told(tmp_path: Path) -> None:
    one, gone, new = (tmp_path / name for name in ("one", "gone", "new"))
    one.write_text("1")
    gone.write_text("1")
    AsRead.of([tmp_path, one, gone, new]).check()
    for file, change in ((one, lambda: one.write_text("12")), (gone, gone.unlink), (new, lambda: new.write_text("1"))):
        read = AsRead.of([tmp_path, one, gone, new])
        change()
        with pytest.raises(CompstiffError) as stopped:
            read.check()
        assert [(finding.code, finding.file) for finding in stopped.value.findings] == [("CS0080", str(file))]


def test_a_file_s_stamp_is_another_once_it_is_written_or_replaced(tmp_path: Path) -> None:
    file, other = tmp_path / "a.csv", tmp_path / "b.csv"
    assert file_stamp(file) is None
    file.write_text("1,2")
    stamp = file_stamp(file)
    assert stamp is not None
    assert file_stamp(file) == stamp
    other.write_text("3,4")
    os.utime(other, ns=(0, stamp[3]))
    os.replace(other, file)             # as long, and as old
    assert file_stamp(file) not in (stamp, None)
    stamp = file_stamp(file)
    file.write_text("1,2,3")
    assert file_stamp(file) != stamp
    file.unlink()
    assert file_stamp(file) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_json_has_no_number_that_is_none(value: float) -> None:
    """Others would not read the file."""
    assert json.loads(json_bytes({"a": [1.5, None], "b": {"c": "\N{GREEK SMALL LETTER MU}"}})) == {
        "a": [1.5, None], "b": {"c": "\N{GREEK SMALL LETTER MU}"}}
    with pytest.raises(ValueError, match="JSON compliant"):
        json_bytes({"a": [1.5, {"b": value}]})


@pytest.mark.parametrize("reason", [OSError(), KeyError("uid"), ImportError()])
def test_who_did_it_is_unknown_where_the_system_knows_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reason: Exception
) -> None:
    """A service, or a container: what it did is written down all the same."""
    def nobody() -> str:
        raise reason

    append(tmp_path / "log.jsonl", {"result": "sent"})
    monkeypatch.setattr("getpass.getuser", nobody)
    append(tmp_path / "log.jsonl", {"result": "sent"})
    first, second = map(json.loads, (tmp_path / "log.jsonl").read_text().splitlines())
    assert (second["user"], second["result"]) == ("unknown", "sent")
    assert first["user"] not in ("", "unknown", None)
