"""What is said of a file of offsets whose program has targets that the planned one does not have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.modbus.offset_file import read_offsets

# x of the offsets [mm] of ten targets: the moves to 1 ... 8 go from or to one that is corrected.
ALONG = (0, 0.1, 0.1, 0.3, 0.3, 0.1, 0.1, 0.1, 0, 0)


def written(folder: Path, added: dict[int, tuple[str, str]], *, told: bool = True) -> Path:
    """added: of the move to a target, the shares and offsets of those on the way."""
    lines = ["target,ox_mm,oy_mm,oz_mm,added" + ",added_mm" * told]
    for target, x in enumerate(ALONG):
        shares, offsets = added.get(target, ("", ""))
        lines.append(f"{target + 40},{x},0,0,{shares}" + f",{offsets}" * told)
    (folder / "offsets.csv").write_text("\n".join(lines) + "\n")
    return folder / "offsets.csv"


# 0.03 and 0.04 mm off the straight line from 0.1 to 0.3 mm; 0.01 off that from 0.3 to 0.1; 0.05 off one that stays at 0.1.
BENT = {3: ("0.25 0.5", "0.15 0.03 0 0.2 0 -0.04"), 5: ("0.75", "0.15 0.01 0"), 6: ("0.5", "0.1 0 0.05")}


@pytest.mark.parametrize(("moves", "level", "worst", "middle"), [
    ((3,), "note", 40, 40), ((5,), "note", 10, 10), ((3, 5), "note", 40, 25), ((3, 5, 6), "warning", 50, 40)])
def test_what_targets_that_are_not_sent_leave_is_told_and_warned_of_in_over_a_quarter_of_the_moves(
        tmp_path: Path, moves: tuple[int, ...], level: str, worst: int, middle: int) -> None:
    """Of eight moves from or to a corrected target, with the line of the worst."""
    file = written(tmp_path, {move: BENT[move] for move in moves})
    [found] = [one for one in read_offsets(file, reach_mm=10.0).findings if one.code == "CS5008"]
    at = {40: 3, 10: 5, 50: 6}[worst]
    assert (found.level, found.file, found.line) == (level, str(file), at + 2)
    assert found.message == (
        f"in {len(moves)} of 8 moves from or to a corrected target the correction changes on the way, and only those of the "
        f"planned program are sent: there the tool goes straight, off by up to about {worst} um at the worst, {middle} um in "
        "the middle")


def test_of_a_file_that_does_not_tell_their_offsets_half_of_the_step_counts(tmp_path: Path) -> None:
    """0.2 mm from target 2 to 3, 0.1 to target 8, which counts where it is not corrected itself, none to target 9, which
    neither is nor follows one that is: another move from or to a corrected target with it."""
    for targets, of, worst, middle in (((3,), 8, 100, 100), ((3, 8), 8, 100, 75), ((8,), 8, 50, 50), ((3, 8, 9), 9, 100, 50)):
        file = written(tmp_path, dict.fromkeys(targets, ("0.5", "")), told=False)
        [found] = [one for one in read_offsets(file, reach_mm=10.0).findings if one.code == "CS5008"]
        assert found.message.startswith(f"in {len(targets)} of {of} moves")
        assert f"up to about {worst} um at the worst, {middle} um in the middle" in found.message


def test_where_no_target_was_added_nothing_is_told(tmp_path: Path) -> None:
    read = read_offsets(written(tmp_path, {}), reach_mm=10.0)
    assert [one.code for one in read.findings] == ["CS5007"]
    np.testing.assert_array_equal(read.micrometres, [[round(1e3 * x), 0, 0] for x in ALONG])


def test_of_the_columns_that_are_not_read_those_are_told_that_may_be_misspelt(tmp_path: Path) -> None:
    """Others are of no interest to who pushes: `correct` writes some."""
    file = tmp_path / "offsets.csv"
    file.write_text("target,ox_mm,oy_mm,oz_mm,orx_degs,length_um\n0,0.1,0,0,1,100\n")
    told = [(one.code, one.level, one.message) for one in read_offsets(file, reach_mm=10.0).findings if one.code == "CS0204"]
    assert told == [("CS0204", "warning", "column 'orx_degs' is not read; is 'orx_deg' meant?")]
