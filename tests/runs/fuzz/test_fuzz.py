"""A short fuzz of every door with fresh files, and every file that was ever found to be let in wrongly, or to hang or crash.

The long form is benchmarks/fuzz.py; what it finds is mended, and the file put into `found/`, named by its door.
"""

from __future__ import annotations

import io
import json
import warnings
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from benchmarks import fuzz
from benchmarks.fuzz_doors import Door, Unsound, doors, rapid
from benchmarks.fuzz_load_tests import doors_of_load_tests
from identification.common.findings import CompstiffError
from identification.measurements import read_measurements
from identification.model.cell import read_cell

FOUND = sorted((Path(__file__).parent / "found").iterdir())
# Doors whose file is small and read at once; whole commands are fuzzed by the benchmark, and by tests/runs/command_line.
FAST = ("rapid", "apt", "table", "cell", "robot", "measurements", "stiffness", "forces", "offsets", "learned", "diagnosis",
        "readings", "points", "joint_log", "lvm", "metallicadour", "net_ft", "journal", "parquet", "workbook")


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Door]]:
    folder = tmp_path_factory.mktemp("fuzz")
    return folder, doors(folder) | {door.name: door for door in doors_of_load_tests()}


def entered(door: Door, data: bytes, folder: Path) -> str:
    """What is wrong with how the door takes the data."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wrong, where = fuzz.enter(door, data, folder)
    return f"{wrong} in {where}" if wrong else ""


@pytest.mark.parametrize("file", FOUND, ids=lambda file: file.name)
def test_what_was_found_stays_mended(every: tuple[Path, dict[str, Door]], file: Path) -> None:
    folder, all_doors = every
    words = file.stem.split("-")
    command = f"{words[0]}:{words[1]}"
    door = next(door for name, door in all_doors.items() if name == words[0] or name.startswith(command))
    assert entered(door, file.read_bytes(), folder) == ""


@pytest.mark.parametrize("name", FAST)
def test_spoilt_and_grown_files(every: tuple[Path, dict[str, Door]], name: str) -> None:
    folder, all_doors = every
    door, rng = all_doors[name], np.random.default_rng(20)
    for number in range(60):
        data = fuzz.grown(door.grammar, rng) if door.grammar and number % 3 == 0 else door.seeds[number % len(door.seeds)]
        data = data if number % 6 == 0 and door.grammar else fuzz.spoilt(data, door, list(door.seeds), rng)
        assert entered(door, data, folder) == "", data[:2000]


def test_the_fuzzer_sees_what_is_wrong(
    every: tuple[Path, dict[str, Door]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A writer that moves one target more, a reader that lets NaN through, one that raises, one that warns, one that hangs."""
    from compensator.rapid import writer

    folder, all_doors = every
    file = tmp_path / "a.mod"
    file.write_bytes(all_doors["rapid"].seeds[0])
    rapid(file)
    real = writer.apply
    monkeypatch.setattr(writer, "apply", lambda data, edits: real(data, edits).replace(b"[[4,5,6]", b"[[4,5,7]"))
    with pytest.raises(Unsound):
        rapid(file)

    def slow(_: Path) -> None:
        while True:
            pass

    def warns(_: Path) -> None:
        np.float64(1e308) * np.float64(10)

    for act, says in ((slow, "over 0.2 s"), (warns, "RuntimeWarning"), (lambda _: [][0], "IndexError")):
        assert says in entered(Door("x", ".x", (b"",), (), act, {}, patience=0.2), b"", folder)


def refused(file: Path) -> str:
    with pytest.raises(CompstiffError) as stopped:
        read_cell(file) if file.suffix == ".yaml" else read_measurements(file, read_cell(file.parent / "cell.yaml").robot)
    return stopped.value.findings[0].message


def test_giants_are_refused_at_once(tmp_path: Path) -> None:
    """A cell of 2 MB; a workbook that unpacks to a gigabyte; one with a single cell at its very end."""
    (tmp_path / "big.yaml").write_text("robot: x\n# " + "y" * (2 << 20))
    assert "at most 1048576" in refused(tmp_path / "big.yaml")
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 200]}\n")
    bomb = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        with archive.open("xl/worksheets/sheet1.xml", "w", force_zip64=True) as stream:
            for _ in range(300):
                stream.write(b" " * (1 << 20))
    assert bomb.stat().st_size < 1 << 20
    assert "once unpacked" in refused(bomb)
    book = openpyxl.Workbook()
    book.active["A1"], book.active["XFD1048576"] = "q1_deg", 1
    stream = io.BytesIO()
    book.save(stream)
    (tmp_path / "far.xlsx").write_bytes(stream.getvalue())
    assert "row 1048576" in refused(tmp_path / "far.xlsx")


def test_a_line_of_many_megabytes_and_a_table_of_many_columns(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 200]}\n")
    (tmp_path / "line.csv").write_bytes(b"q1_deg," + b"9" * (20 << 20))
    assert refused(tmp_path / "line.csv")
    (tmp_path / "wide.csv").write_text(",".join(["a"] * 200_000) + "\n")
    assert "column twice: a" in refused(tmp_path / "wide.csv")


def test_rows_that_are_claimed_cost_nothing(tmp_path: Path, every: tuple[Path, dict[str, Door]]) -> None:
    """A LabVIEW header and a diagnosis that speak of a thousand million rows."""
    folder, all_doors = every
    lvm = all_doors["lvm"].seeds[0].replace(b"Samples\t4\t4\t4", b"Samples\t1000000000\t1000000000\t1000000000")
    assert entered(all_doors["lvm"], lvm, folder) == ""
    content = json.loads(all_doors["diagnosis"].seeds[0])
    content["visits"]["bad"][0]["rows"] = [10**30]
    assert entered(all_doors["diagnosis"], json.dumps(content).encode(), folder) == ""
