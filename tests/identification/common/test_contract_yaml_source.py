"""What is parsed once is still the file that is there now, and complaints name the file that was asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.common.findings import CompstiffError
from identification.common.yaml_source import NotNegative, Positive, Strict, read_yaml


class Sized(Strict):
    size: Positive


def test_a_file_that_changes_is_read_anew(tmp_path: Path) -> None:
    file = tmp_path / "one.yaml"
    for size in (1.0, 2.0, 1.0):
        file.write_text(f"size: {size}\n")
        assert read_yaml(file, Sized).size == size


def test_of_two_files_alike_each_has_its_complaint(tmp_path: Path) -> None:
    for name in ("one.yaml", "other.yaml", "one.yaml"):
        (tmp_path / name).write_text("size: -1\n")
        with pytest.raises(CompstiffError) as stopped:
            read_yaml(tmp_path / name, Sized)
        assert stopped.value.findings[0].file == str(tmp_path / name)


class Named(Strict):
    name: str
    share: NotNegative = 0.0


@pytest.mark.parametrize(("text", "says"), [
    ("name: a\nshare: -0.1\n", "'share': must not be negative; found -0.1"),
    ("name: a\nshare: 1e-300\n", "'share': must be zero, or at least"),
    ("share: 0\nname: 6660\n", "'name': must be text (a number in quotes); found 6660"),
])
def test_a_value_of_the_wrong_kind_has_its_line_and_what_is_wanted(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "one.yaml").write_text(text)
    with pytest.raises(CompstiffError) as stopped:
        read_yaml(tmp_path / "one.yaml", Named)
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line) == ("CS0102", 2)
    assert says in finding.message
    (tmp_path / "one.yaml").write_text("name: '6660'\nshare: 0\n")
    assert read_yaml(tmp_path / "one.yaml", Named).name == "6660"
