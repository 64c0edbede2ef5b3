"""What is parsed once is still the file that is there now, and complaints name the file that was asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

from identification.common.findings import CompstiffError
from identification.common.yaml_source import Positive, Strict, read_yaml


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
