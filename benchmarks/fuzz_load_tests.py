"""Doors of load tests and of what later files say of earlier ones: a table with every column, the table that `--mend` writes of
it, a cell with every key of docs/formats.md, records and stiffness files that name what they were made from."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from benchmarks.fuzz_doors import Door, cell, codes, finite, measurements, sound, stiffness, whole_lines
from benchmarks.fuzz_languages import CSV_WORDS, JSON_WORDS, YAML_WORDS
from benchmarks.unbreakable import sound_files

ROOT = Path(__file__).parents[1]
# Of the table's mistakes those that move what stands in other rows or columns.
MOVED = re.compile(r"slipped|swapped|sign")
# What a table holds of a number: ten digits.
DIGITS = 1e-8


def mended(file: Path) -> object:
    """Every mistake of rows that may have slipped, or of columns, mended in all rows and behind the fifth: what is written is
    the table that was meant, for its reader."""
    from identification.diagnosis.mended import mended_file
    from identification.fit.load_test import LoadTest
    from identification.fit.mistakes.axes import axes_mistakes
    from identification.fit.mistakes.judge import NamedMistake
    from identification.fit.mistakes.slipped import slipped_mistakes
    from identification.measurements import read_measurements

    read = read_measurements(file, cell(file.parent))
    data = LoadTest.of(cell(file.parent), read)
    behind = np.arange(len(read)) >= 5
    wanted = [each for each in (*slipped_mistakes(data), *axes_mistakes(data)[::9]) if MOVED.search(each.key)]
    for k, each in enumerate(wanted):
        where = behind if k % 2 and behind.any() else None
        candidate = SimpleNamespace(mistake=each, rows=where, data=data, models=(None,))
        named = cast(NamedMistake, SimpleNamespace(candidate=candidate, sentence=each.sentence.format(rows="all rows")))
        meant = each.mended(data, where).rows
        kept = ~np.isnan(meant.deflection).all(axis=1)
        if not kept.any():
            continue
        again = file.with_name("mended.csv")
        again.write_bytes(mended_file(cell(file.parent), read, named).content)
        other = read_measurements(again, cell(file.parent))
        for name in ("theta", "wrench", "deflection", "sigma", "time", "dwell"):
            expected = getattr(meant, name)[kept]
            scale = np.nanmax(np.abs(expected), initial=1e-12)
            sound(np.allclose(getattr(other, name), expected, rtol=DIGITS, atol=DIGITS * scale, equal_nan=True),
                  f"another {name} of {each.key} in the mended table")
        for name in ("validate", "machined_pass", "pose"):
            sound(np.array_equal(getattr(other, name), getattr(meant, name)[kept]), f"another {name} in the mended table")
    return len(wanted), codes(read.findings)


def record(file: Path) -> object:
    """What a record beside others says of the files it was made from, and of a later correction."""
    from identification.common.made_from import said_of_changes, said_of_later

    folder = file.parent / "records"
    folder.mkdir(exist_ok=True)
    own = folder / "own.json"
    own.write_text(RECORD)
    (folder / "part.mod").write_text("MODULE A\nENDMODULE\n")
    (folder / "stiffness.json").write_text(_made_from())
    beside = folder / "beside.json"
    beside.write_bytes(file.read_bytes())
    said = [*said_of_later(own, folder / "own.mod"), *said_of_later(beside, folder / "other.mod")]
    try:
        content = json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        content = None
    if isinstance(content, dict):
        said += said_of_changes(content, folder, folder / "own.mod")
    return codes(said)


def spun(file: Path) -> object:
    """A force log by the cell's speed of the spindle, and what its ripple says of the teeth."""
    from compensator.forces.log import read_force_log
    from compensator.forces.ripple import said_of_teeth

    read = read_force_log(file, cell(file.parent).force_log.form)
    sound(finite({"force": read.force}), "a force is no number")
    return read.key, read.ripple is not None, codes((*read.findings, *said_of_teeth(read.ripple, 2, read.source)))


def stiffness_and_tables(file: Path) -> object:
    """A stiffness file, and what is said of the tables it was identified from."""
    from identification.common.made_from import said_of_tables
    from identification.model.stiffness_file import read_stiffness

    model = read_stiffness(file, cell(file.parent))
    return stiffness(file), codes(said_of_tables(model.source, model.made_from))


@cache
def _every_key() -> bytes:
    """The cell of docs/formats.md, which states every key."""
    text = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    found = re.search(r"## cell.yaml\n\n```yaml\n(.*?)```", text, re.DOTALL)
    return found[1].encode() if found else b""


def _whole_cell(file: Path) -> object:
    from identification.model.cell import read_cell

    read = read_cell(file)
    sound(finite(vars(read)), "the cell holds what is no number")
    return read.robot.name, codes(getattr(read, "findings", ()))


def _every_column(mass: bool) -> bytes:
    """A table with all its columns: forces and moments, or masses."""
    head = ["pose", "purpose", "reference", "time_s", "dwell_s", "pass", *(f"q{k}_deg" for k in range(1, 7)),
            *(("mass_kg",) if mass else ("fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm")),
            *(f"d{axis}_um" for axis in "xyz"), *(f"s{axis}_um" for axis in "xyz")]
    lines = [",".join(head)]
    for k in range(24):
        pose, load = k // 4, (50.0 * (k % 4 - 1) + 1 if mass else 200.0)
        loads = [load] if mass else [load * (k % 3 == axis) for axis in range(3)] + [3.0, -2.0, 0.5 * k]
        angles = [10.0 * pose - 25, 8.0 * pose, 5.0 * pose - 10, 20.0, 40.0 + pose, -15.0 * pose]
        gap = "" if k % 5 == 0 else "12.5"
        words = [f"P{pose}", "validate" if k == 23 else "identify", f"R{pose // 3}", 10 * (k % 12), 2, "cut" * (pose > 3)]
        lines.append(",".join(map(str, [*words, *angles, *loads, gap, -0.4 * load, 7 + k, 2, 2.5, 3])))
    return ("\n".join(lines) + "\n").encode()


def _spun() -> bytes:
    """A fast log at the stated speed of the cell's spindle, with the ripple of three teeth."""
    t = np.arange(1500) / 100.0
    wave = 40 * np.cos(2 * np.pi * 45.0 * t) + 9 * np.cos(2 * np.pi * 15.0 * t)
    return ("time_s,target,fx_n,fy_n,fz_n\n" + "".join(
        f"{a:.2f},{int(a)},{100 + b:.2f},{-60 - b:.2f},-20\n" for a, b in zip(t, wave, strict=True))).encode()


RECORD = json.dumps({
    "format": "compstiff-correction", "version": 1, "input": {"file": "part.mod", "sha256": "ab"},
    "output": {"file": "own.mod", "sha256": "cd"}, "offsets": {"file": "offsets.csv", "sha256": "ef"},
    "stiffness": {"file": "stiffness.json", "sha256": "12"}}, indent=1)


def _made_from() -> str:
    files: dict[str, Any] = json.loads(sound_files()["stiffness.json"])
    return json.dumps({**files, "made_from": [{"file": "measurements.csv", "sha256": "ab"}]}, indent=1)


def doors_of_load_tests() -> list[Door]:
    """All of them."""
    tables = (_every_column(mass=False), _every_column(mass=True))
    later = RECORD.replace("own.mod", "other.mod").replace('"cd"', '"dd"').replace('"offsets"', '"logged_with"')
    return [
        Door("load_test", ".csv", tables, CSV_WORDS, measurements, {}),
        Door("mended", ".csv", (*tables, whole_lines(sound_files()["measurements.csv"])), CSV_WORDS, mended, {}),
        Door("every_key", ".yaml", (_every_key(),), (*YAML_WORDS, "axes: ", "eax: ", "carries: ", "pendant_poses: "),
             _whole_cell, {}),
        Door("record", ".json", (RECORD.encode(), later.encode()), JSON_WORDS, record, {}),
        Door("made_from", ".json", (_made_from().encode(),), JSON_WORDS, stiffness_and_tables, {}),
        Door("spun", ".csv", (_spun(),), CSV_WORDS, spun, {}, patience=10.0),
    ]
