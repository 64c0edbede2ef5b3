"""The table that `--mend` writes, read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.common.shipped import shipped
from identification.diagnosis.mended import mended_file
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.judge import NamedMistake
from identification.measurements import Measurements, read_measurements
from identification.model.cell import read_cell
from tests.support import robot

SAMPLES = shipped("samples")


def mended_and_read(
    tmp_path: Path, change: dict[str, np.ndarray], lost: np.ndarray
) -> tuple[Measurements, Measurements, bytes]:
    """The sample's table with other columns, the readings of the rows `lost` (N,) taken away by its mistake: what was meant,
    what is read again, and what was written."""
    cell = read_cell(SAMPLES / "cell.yaml")
    rows = replace(read_measurements(SAMPLES / "measurements.csv", cell.robot), **change)
    meant = replace(rows, deflection=np.where(lost, np.nan, rows.deflection))
    mistake = SimpleNamespace(of="table", mended=lambda data, where: SimpleNamespace(rows=meant))
    candidate = SimpleNamespace(mistake=mistake, rows=None, data=LoadTest.of(cell, rows), models=(None,))
    written = mended_file(cell, rows, cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="made up"))).content
    (tmp_path / "mended.csv").write_bytes(written)
    return meant, read_measurements(tmp_path / "mended.csv", cell.robot), written


@pytest.mark.parametrize("mark", ["\r", "\n", ",", ";", "\t", '"', "#"])
def test_a_label_breaks_no_row(tmp_path: Path, mark: str) -> None:
    """Whatever stands in a label, the table has as many rows, their numbers are as they were. A line end becomes a blank."""
    pose = np.array([f"P{number}{mark}a" for number in _sample().visit], dtype=object)
    meant, again, _ = mended_and_read(tmp_path, {"pose": pose}, np.zeros((len(pose), 3), dtype=bool))
    np.testing.assert_allclose(again.theta, meant.theta, atol=1e-9)
    np.testing.assert_allclose(again.deflection, meant.deflection, atol=1e-12)
    np.testing.assert_array_equal(again.pose, [text.replace("\r", " ").replace("\n", " ") for text in meant.pose])


@pytest.mark.parametrize("end", ["\r", "\n", "\r\n"])
def test_a_cell_over_two_lines_is_refused(tmp_path: Path, end: str) -> None:
    """Its line is named; rows and their lines would not belong together."""
    head, *rows = [line for line in (SAMPLES / "measurements.csv").read_text().splitlines() if not line.startswith("#")]
    rows = [f'{row},"a{end}b"' if k == 2 else f"{row},a" for k, row in enumerate(rows)]
    (tmp_path / "table.csv").write_text("\n".join([f"{head},remark", *rows]) + "\n", newline="")
    with pytest.raises(CompstiffError, match="table.csv:4: error CS0201: a cell in quotes"):
        read_measurements(tmp_path / "table.csv", read_cell(SAMPLES / "cell.yaml").robot)


@pytest.mark.parametrize(("first", "from_the_start", "kept"), [
    (65, True, "first"), (34, True, "last"), (65, False, "first"), (34, False, "last")])
def test_of_rows_of_two_robots_those_of_the_robot_with_more_are_kept(
    tmp_path: Path, first: int, from_the_start: bool, kept: str,
) -> None:
    """Whichever of them the search called the other one's; validate rows go with those about them."""
    cell = read_cell(SAMPLES / "cell.yaml")
    rows = read_measurements(SAMPLES / "measurements.csv", cell.robot)
    fitted = rows.select(~rows.validate)
    border = fitted.row[first]
    others = fitted.row < border if from_the_start else fitted.row >= border
    candidate = SimpleNamespace(mistake=SimpleNamespace(of="table"), rows=others, data=LoadTest.of(cell, fitted),
                                models=(None, None))
    written = mended_file(cell, rows, cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="made up"))).content
    (tmp_path / "mended.csv").write_bytes(written)
    # Validate rows between the last of the one and the first of the other are the latter's side of the border.
    ends = fitted.row[first - 1] if from_the_start else border - 1
    mine = rows.row <= ends if kept == "first" else rows.row > ends
    assert mine.mean() > 0.5
    again = read_measurements(tmp_path / "mended.csv", cell.robot)
    np.testing.assert_allclose(again.theta, rows.theta[mine], atol=1e-9)
    np.testing.assert_array_equal(again.validate, rows.validate[mine])
    assert f"# {(~mine).sum()} rows are left out" in written.decode()


def test_a_cell_of_another_robot_has_its_name_and_nothing_else_changed(tmp_path: Path) -> None:
    cell = read_cell(SAMPLES / "cell.yaml")
    rows = read_measurements(SAMPLES / "measurements.csv", cell.robot)
    other = replace(cell, robot=robot("irb4600-60-2.05"))
    candidate = SimpleNamespace(mistake=SimpleNamespace(of="cell", mended=lambda data: SimpleNamespace(cell=other)),
                                data=LoadTest.of(cell, rows))
    made = mended_file(cell, rows, cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="another robot")))
    head, _, text = made.content.decode().partition("\n")
    before = (SAMPLES / "cell.yaml").read_text()
    assert before.count("irb6660-205-1.90") == 1
    assert text == before.replace("irb6660-205-1.90", "irb4600-60-2.05")
    assert head.endswith(": another robot")
    (tmp_path / "mended.yaml").write_bytes(made.content)
    assert read_cell(tmp_path / "mended.yaml").robot.name == "irb4600-60-2.05"


def test_rows_that_lost_their_whole_reading_are_left_out_and_counted(tmp_path: Path) -> None:
    """One that lost a single component keeps its others."""
    lost = np.zeros((len(_sample()), 3), dtype=bool)
    lost[[4, 9]], lost[6, 0] = True, True
    meant, again, written = mended_and_read(tmp_path, {}, lost)
    assert b"# 2 rows are left out" in written
    np.testing.assert_allclose(again.deflection, np.delete(meant.deflection, [4, 9], axis=0), atol=1e-12)


def _sample() -> Measurements:
    return read_measurements(SAMPLES / "measurements.csv", read_cell(SAMPLES / "cell.yaml").robot)


def test_the_name_of_a_table_breaks_no_comment(tmp_path: Path) -> None:
    """Whatever a file system allows as a name."""
    cell, table = read_cell(SAMPLES / "cell.yaml"), tmp_path / "a\nq1_deg,b\udcff.csv"
    table.write_bytes((SAMPLES / "measurements.csv").read_bytes())
    rows = read_measurements(table, cell.robot)
    mistake = SimpleNamespace(of="table", mended=lambda data, where: SimpleNamespace(rows=rows))
    candidate = SimpleNamespace(mistake=mistake, rows=None, data=LoadTest.of(cell, rows), models=(None,))
    named = cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="made up"))
    (tmp_path / "mended.csv").write_bytes(mended_file(cell, rows, named).content)
    np.testing.assert_allclose(read_measurements(tmp_path / "mended.csv", cell.robot).theta, rows.theta, atol=1e-9)


@pytest.mark.parametrize("pulled", [False, True])
def test_a_table_of_masses_stays_one(tmp_path: Path, pulled: bool) -> None:
    """A weight is as heavy at every pose, which a force is not: what hung hangs again, and a rope pulls again; in grams for
    kilograms before. A row whose force the mistake turned is no weight."""
    cell = read_cell(SAMPLES / "cell.yaml")
    head, *lines = [line for line in (SAMPLES / "measurements.csv").read_text().splitlines() if not line.startswith("#")]
    names = head.split(",")
    table = [dict(zip(names, line.split(","), strict=True)) for line in lines]
    for number, row in enumerate(table):
        row["mass_kg"] = f"{number % 4 * 7.5}"
        for name, force in zip(("fx_n", "fy_n", "fz_n"), ("100", "0", "-3.5"), strict=True):
            row[name] = force if pulled and number % 5 == 1 else ""
        row["mass_kg"] = "" if row["fx_n"] else row["mass_kg"]
    written = [name for name in table[0] if pulled or name not in ("fx_n", "fy_n", "fz_n")]
    text = "\n".join([",".join(written), *(",".join(row[name] for name in written) for row in table)])
    (tmp_path / "masses.csv").write_text(text + "\n")
    rows = read_measurements(tmp_path / "masses.csv", cell)
    assert rows.hung is not None
    meant = replace(rows, wrench=1e-3 * rows.wrench)
    meant.wrench[6, 1] += 0.5 * pulled
    mistake = SimpleNamespace(of="table", mended=lambda data, where: SimpleNamespace(rows=meant))
    candidate = SimpleNamespace(mistake=mistake, rows=None, data=LoadTest.of(cell, rows), models=(None,))
    content = mended_file(cell, rows, cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence="made up"))).content
    (tmp_path / "mended.csv").write_bytes(content)
    header = content.decode().splitlines()[1].split(",")
    assert ("mass_kg" in header, "fx_n" in header) == (True, pulled)
    again = read_measurements(tmp_path / "mended.csv", cell)
    np.testing.assert_allclose(again.wrench, meant.wrench, rtol=1e-9, atol=1e-12)
    assert again.hung is not None
    np.testing.assert_array_equal(again.hung, rows.hung & ~(pulled & (rows.row == 7)))


def test_times_by_the_clock_of_a_computer_keep_their_milliseconds(tmp_path: Path) -> None:
    """Seconds since 1970, ten digits before the point."""
    time = 1.7e9 + 0.02 * np.arange(len(_sample()))
    meant, _, written = mended_and_read(tmp_path, {"time": time}, np.zeros((len(time), 3), dtype=bool))
    lines = [line.split(",") for line in written.decode().splitlines()[1:]]
    place = lines[0].index("time_s")
    np.testing.assert_allclose([float(cells[place]) for cells in lines[1:]], meant.time, rtol=0, atol=1e-6)
