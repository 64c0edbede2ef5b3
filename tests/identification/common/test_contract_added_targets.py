"""What the columns of added targets in a file of offsets may hold, and what is said of a file that was edited."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from identification.common.added_targets import ADDED, ADDED_MM, added_of, added_offsets
from identification.common.findings import CompstiffError
from identification.common.tables import Table, read_table


def table(folder: Path, text: str) -> Table:
    (folder / "offsets.csv").write_text(text)
    return read_table(folder / "offsets.csv", required=("target",), texts=(ADDED, ADDED_MM))


def test_shares_and_offsets_belong_together(tmp_path: Path) -> None:
    read = table(tmp_path, f"target,{ADDED},{ADDED_MM}\n0,,\n1,0.25 0.5,1 2 3 4 5 6\n2,,\n3,0.1,7 8 9\n")
    added = added_of(read)
    assert added is not None
    assert added.given.tolist() == [0, 1, 1, 1, 2, 3, 3]
    assert added.share.tolist() == [1, 0.25, 0.5, 1, 1, 0.1, 1]
    np.testing.assert_array_equal(added_offsets(read), [[1, 2, 3], [4, 5, 6], [7, 8, 9]])


@pytest.mark.parametrize("shares", ["0.5 x", "0 0.5", "0.5 1", "0.5 0.5", "0.6 0.5", "nan", "-0.1", "0.5,0.6"])
def test_shares_that_are_none_have_their_line(tmp_path: Path, shares: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        added_of(table(tmp_path, f'target,{ADDED}\n0,\n1,"{shares}"\n'))
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line, finding.file) == ("CS4121", 3, str(tmp_path / "offsets.csv"))
    assert finding.message == f"column 'added': found {shares!r}, expected shares of a move between 0 and 1, ascending"


@pytest.mark.parametrize("offsets", ["1 2 x", "1 2", "1 2 3 4", "1 2 inf", "1 2 3 4 5 6"])
def test_offsets_that_are_not_three_a_share_have_their_line(tmp_path: Path, offsets: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        added_offsets(table(tmp_path, f"target,{ADDED},{ADDED_MM}\n0,,\n1,0.5,{offsets}\n"))
    (finding,) = stopped.value.findings
    assert (finding.code, finding.line) == ("CS4121", 3)
    assert finding.message == f"column 'added_mm': found {offsets!r}, expected three finite numbers for each share in 'added'"


def test_offsets_without_the_column_of_their_shares_are_refused(tmp_path: Path) -> None:
    """Ended in a KeyError."""
    with pytest.raises(CompstiffError) as stopped:
        added_offsets(table(tmp_path, f"target,{ADDED_MM}\n0,\n1,1 2 3\n"))
    assert [(finding.code, finding.line) for finding in stopped.value.findings] == [("CS4121", 3)]
