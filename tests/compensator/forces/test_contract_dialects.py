"""One pass in every way loggers write it: the same forces come out, and what cannot be understood is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from compensator.forces.log import ForceLog, read_force_log
from identification.common import number_blocks
from identification.common.findings import CompstiffError
from identification.model.cell_file import ForceLogFile

COUNT, RATE = 300, 2000.0
RNG = np.random.default_rng(5)
FORCE = np.round(RNG.normal(0, 80, (COUNT, 3)), 3)
TARGET = np.arange(COUNT) // 100
TIME = np.arange(COUNT) / RATE
NAMES = ["time_s", "target", "fx_n", "fy_n", "fz_n"]


def read(path: Path, text: str | bytes, **form) -> ForceLog:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_force_log(path, ForceLogFile(**form))


def lines(columns: list[np.ndarray], separator: str, decimal: str) -> list[str]:
    return [separator.join(f"{x:.6f}".rstrip("0").rstrip(".").replace(".", decimal) for x in row)
            for row in np.column_stack(columns)]


def check(log: ForceLog) -> None:
    assert_allclose(log.force, FORCE, rtol=0, atol=1e-9)
    assert log.place.tolist() == TARGET.tolist()
    assert log.time is not None
    assert_allclose(log.time, TIME, rtol=0, atol=1e-9)
    assert log.rate == pytest.approx(RATE)


@pytest.mark.parametrize("block", [1 << 22, 700])
@pytest.mark.parametrize("header", ["names", "none", "foreign"])
@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."),
                                                    ("  ", ",")])
def test_separators_decimals_headers(tmp_path, monkeypatch, separator: str, decimal: str, header: str, block: int) -> None:
    """Blocks of a few lines give what one block gives, lines of the file included."""
    monkeypatch.setattr(number_blocks, "BLOCK_BYTES", block)
    body = lines([TIME, TARGET, *FORCE.T], separator, decimal)
    foreign = [separator.join(row) for row in (["Zeit", "Nr", "X", "Y", "Z"], ["[s]", "[-]", "[N]", "[N]", "[N]"])]
    above = {"names": [separator.join(NAMES)], "none": [], "foreign": foreign}[header]
    log = read(tmp_path / "a.csv", "\n".join([*above, *body]) + "\n", **({} if header == "names" else {"columns": NAMES}))
    check(log)
    assert log.line.tolist() == list(range(len(above) + 1, len(above) + COUNT + 1))


@pytest.mark.parametrize(("separator", "called"), [(",", "comma"), (";", "semicolon"), ("\t", "tab"), (" ", "blanks")])
@pytest.mark.parametrize(("above", "columns", "words"), [
    ([], NAMES, "time_s, target, fx_n, fy_n, fz_n"),
    (["Zeit Nr X Y Z"], ["-", *NAMES[1:]], "target, fx_n, fy_n, fz_n; 1 line above the numbers passed over"),
    (["Zeit Nr X Y Z", "[s] - N N N"], NAMES, "time_s, target, fx_n, fy_n, fz_n; 2 lines above the numbers passed over"),
    ([" ".join(NAMES)], None, "")])
def test_how_a_log_was_read_that_the_cell_names_the_columns_of(
    tmp_path, separator: str, called: str, above: list[str], columns: list[str] | None, words: str
) -> None:
    """A note with what separates the cells, the columns that are read, and the lines that are not; nothing of a log that names
    its own."""
    body = lines([TIME, TARGET, *FORCE.T], separator, ".")
    text = "\n".join([*(line.replace(" ", separator) for line in above), *body]) + "\n"
    form = {"rate_hz": RATE} | ({} if columns is None else {"columns": columns})
    found = [one for one in read(tmp_path / "a.csv", text, **form).findings if one.code == "CS3021"]
    assert [(one.level, one.message, one.file, one.line) for one in found] == (
        [("note", f"cells separated by {called}, columns as cell.yaml names them: {words}", str(tmp_path / "a.csv"),
          len(above) + 1)] if columns else [])


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_marks_comments_quotes_and_trailing_separators(tmp_path, end: str) -> None:
    body = lines([TIME, TARGET, *FORCE.T], ";", ",")
    text = ["# logger 4711", ";".join(f'"{name}"' for name in NAMES), *body[:40], "", "# tool change", *body[40:], ""]
    log = read(tmp_path / "a.csv", "\ufeff" + end.join(text))
    check(log)
    assert log.line[40] == 45
    plain = [";".join(NAMES), *(line + ";" for line in body)]
    check(read(tmp_path / "b.csv", end.join(plain) + end))


def test_counts_milliseconds_and_a_rate_alone(tmp_path) -> None:
    counts = np.round(FORCE * 1e4)
    names = ["time_ms", "target", "fx_counts", "fy_counts", "fz_counts"]
    text = ",".join(names) + "\n" + "\n".join(lines([1e3 * TIME, TARGET, *counts.T], ",", ".")) + "\n"
    check(read(tmp_path / "a.csv", text, counts_per_n=1e4))
    with pytest.raises(CompstiffError, match="CS3022: fx_counts fy_counts fz_counts are counts"):
        read(tmp_path / "a.csv", text)
    # Of a newton metre, too.
    moments = np.round(FORCE * 50)
    text = ",".join([*names, "mx_counts", "my_counts", "mz_counts"]) + "\n" + "\n".join(
        lines([1e3 * TIME, TARGET, *counts.T, *moments.T], ",", ".")) + "\n"
    with pytest.raises(CompstiffError, match="CS3022: mx_counts my_counts mz_counts are counts") as stopped:
        read(tmp_path / "a.csv", text, counts_per_n=1e4)
    [said] = stopped.value.findings
    assert (said.line, said.hint.partition(":")[0]) == (1, "state force_log.counts_per_nm")
    both = read(tmp_path / "a.csv", text, counts_per_n=1e4, counts_per_nm=200)
    check(both)
    assert_allclose(both.moment, moments / 200, rtol=0, atol=1e-9)
    vibration = RNG.normal(0, 1, COUNT)
    text = "\n".join(lines([vibration, TARGET, *FORCE.T], "\t", ".")) + "\n"
    check(read(tmp_path / "b.csv", text, columns=["-", *NAMES[1:]], rate_hz=RATE))


def test_parquet(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(number_blocks, "BATCH_ROWS", 64)
    pd.DataFrame(np.column_stack([TIME, TARGET, FORCE]), columns=NAMES).astype({"target": int, "fx_n": "float64"}).to_parquet(
        tmp_path / "a.parquet")
    check(read_force_log(tmp_path / "a.parquet"))


@pytest.mark.parametrize(("text", "form", "words"), [
    ("0,1,2\n3,4,5\n", {}, "a.csv:1: error CS3020: has no header line: it begins with 3 numbers"),
    ("0,1,2\n3,4,5\n", {"columns": ["target", "fx_n"]}, "CS3020: has 3 columns, force_log.columns in cell.yaml names 2"),
    ("0,1,2\n", {"columns": ["target", "fx_n", "fy_n"]}, "CS0202: column missing: fz_n"),
    ("target,Fx [kN],fy_kn,Fz [N]\n0,1,2,3\n", {}, "call 'Fz [N]' fz_n; 'Fx [kN]', 'fy_kn' must be fx_n, fy_n, in newtons: "
     "convert their numbers; or name them in cell.yaml, force_log.columns (in another unit as fx_counts, with counts_per_n)"),
    ("target;fx_n;fy_n;fz_n\n0;1;2;3\n0;1;2,3\n", {}, "a.csv:3: error CS0201: 3 cells where the header names 4"),
    ("target;fx_n;fy_n;fz_n\n0;1;2;3\n0;1;;3\n", {}, "a.csv:3:3: error CS0203: column 'fy_n': found an empty cell"),
    ("target fx_n fy_n fz_n\n0 1 2 3\n0 1 nan 3\n", {}, "a.csv:3:3: error CS0203: column 'fy_n': found 'nan'"),
    ("target,fx_n,fy_n,fz_n\n0,1,2,3\n0,1,2,3,9\n", {}, "a.csv:3: error CS0201: 5 cells"),
])
def test_complaints_name_the_place(tmp_path, text: str, form: dict, words: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read(tmp_path / "a.csv", text, **form)
    assert words in str(stopped.value)


def test_a_complaint_far_into_a_log_names_its_line(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(number_blocks, "BLOCK_BYTES", 500)
    body = lines([TIME, TARGET, *FORCE.T], ",", ".")
    body = body * 10        # long enough for its spectrum to be looked at first
    body[2222] = body[2222].replace(",", ",x", 1)
    with pytest.raises(CompstiffError, match=r"a.csv:2224:2: error CS0203"):
        read(tmp_path / "a.csv", ",".join(NAMES) + "\n" + "\n".join(body))


def test_an_unknown_column_in_the_cell_is_an_error() -> None:
    with pytest.raises(ValueError, match="unknown: Fx"):
        ForceLogFile(columns=("Fx", "target"))


def test_time_is_there_for_whoever_places_by_it(tmp_path) -> None:
    """A log of times and forces alone, and one of forces alone at a known rate: placed later, by time."""
    text = "time_ms,fx_n,fy_n,fz_n\n" + "\n".join(lines([1e3 * TIME, *FORCE.T], ",", "."))
    alone = "\n".join(lines([*FORCE.T], ";", ","))
    for log in (read(tmp_path / "a.csv", text), read(tmp_path / "b.csv", alone, columns=NAMES[2:], rate_hz=RATE)):
        assert log.key == "time"
        assert_allclose(log.place, TIME, rtol=0, atol=1e-9)
        assert_allclose(log.time, TIME, rtol=0, atol=1e-9)
        assert_allclose(log.force, FORCE, rtol=0, atol=1e-9)


def test_public_forms_are_read_as_they_are(tmp_path) -> None:
    channels = RNG.normal(0, 50, (COUNT, 12)).round(4)
    (tmp_path / "a.csv").write_text("\n".join(";".join(f"{x:.4f}".replace(".", ",") for x in row) for row in channels))
    log = read_force_log(tmp_path / "a.csv", log_format="metallicadour")
    assert_allclose(log.force, channels[:, 3:6])
    assert_allclose(log.moment, channels[:, 6:9])
    assert log.rate == pytest.approx(25600)
    # The same through cell.yaml, in blocks.
    names = ("-", "-", "-", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm", "-", "-", "-")
    same = read_force_log(tmp_path / "a.csv", ForceLogFile(columns=names, rate_hz=25600))
    assert np.array_equal(same.force, log.force)
    assert_allclose(same.time, log.time, atol=1e-12)


def test_a_labview_file_is_told_its_option(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match="--log-format lvm"):
        read(tmp_path / "a.lvm", "LabVIEW Measurement\t\n")
