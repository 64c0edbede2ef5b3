"""The table or the cell file without the mistake that was found, with a comment that says what was changed."""

from __future__ import annotations

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from identification.common.columns import DEFLECTIONS, FORCES, JOINTS, MASS, MOMENTS, SIGMAS
from identification.common.files import sha256
from identification.common.findings import counted, error, one_line
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.judge import NamedMistake
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.gravity import fall_in_base
from identification.model.robot import built_in_robots

Array = NDArray[np.float64]
# A weight pulls straight down but for this part of it.
PLUMB = 1e-9


@dataclass(frozen=True)
class MendedFile:
    """suffix: .csv for a table, .yaml for a cell file. content: what is written. source: the file that has the mistake."""

    suffix: str
    content: bytes
    source: Path

    def beside(self, path: Path) -> Path:
        """Where it goes for the name that was asked for."""
        return path.with_suffix(self.suffix)

    def said(self, path: Path) -> str:
        """What stands there, in words."""
        return f"{self.beside(path)} is {self.source} without the mistake"


def mended_file(cell: Cell, measurements: Measurements, mistake: NamedMistake) -> MendedFile:
    """The file in which the mistake stands, without it. Raises CompstiffError (CS1705) for a cell file that cannot be changed
    in its text."""
    source = Path(measurements.source if mistake.candidate.mistake.of == "table" else cell.source)
    about = f"# compstiff diagnose --mend, from {one_line(source.name)} (SHA-256 {sha256(source)[:16]}): {mistake.sentence}"
    if mistake.candidate.mistake.of == "cell":
        return MendedFile(".yaml", f"{about}\n{_cell_text(cell, mistake)}".encode(), source)
    table, dropped = _mended_rows(cell, measurements, mistake)
    left_out = f"\n# {counted(dropped, 'row', 'are')} left out" if dropped else ""
    return MendedFile(".csv", f"{about}{left_out}\n{_table_text(table, fall_in_base(cell.world_from_base))}".encode(), source)


def _mended_rows(cell: Cell, measurements: Measurements, mistake: NamedMistake) -> tuple[Measurements, int]:
    """All rows of the file, validate rows too, mended where the mistake stands; and how many are left out, because they belong
    to another robot or have lost their reading."""
    candidate, data = mistake.candidate, LoadTest.of(cell, measurements)
    where = None
    if candidate.rows is not None:
        numbers = candidate.data.rows.row[candidate.rows]
        from_the_start = bool(candidate.rows[0])
        where = measurements.row <= numbers.max() if from_the_start else measurements.row >= numbers.min()
    if len(candidate.models) > 1 and where is not None:
        kept = where if where.mean() > 0.5 else ~where
        return measurements.select(kept), int((~kept).sum())
    rows = candidate.mistake.mended(data, where).rows
    lost = np.asarray(np.isnan(rows.deflection).all(axis=1))
    return rows.select(~lost), int(lost.sum())


def _loads(rows: Measurements, fall: Array) -> dict[str, Array]:
    """Columns of the loads: what hung as the mass that it is, every other force as it is; fall (3,) [m/s^2]."""
    force = rows.wrench[:, :3]
    if rows.hung is None:
        return dict(zip(FORCES, force.T, strict=True))
    mass = force @ fall / (fall @ fall)
    plumb = rows.hung & np.all(np.abs(force - mass[:, None] * fall) <= PLUMB * np.linalg.norm(force, axis=1)[:, None], axis=1)
    columns = {MASS: np.where(plumb, mass, np.nan)}
    return columns if plumb.all() else columns | dict(zip(FORCES, np.where(plumb[:, None], np.nan, force).T, strict=True))


def _table_text(rows: Measurements, fall: Array) -> str:
    """measurements.csv (docs/formats.md): the columns that the file had."""
    columns: dict[str, Array] = dict(zip(JOINTS, np.degrees(rows.theta).T, strict=True)) | _loads(rows, fall)
    if np.any(rows.wrench[:, 3:]):
        columns |= dict(zip(MOMENTS, rows.wrench[:, 3:].T, strict=True))
    columns |= dict(zip(DEFLECTIONS, 1e6 * rows.deflection.T, strict=True))
    if not np.isnan(rows.sigma).all():
        columns |= dict(zip(SIGMAS, 1e6 * rows.sigma.T, strict=True))
    columns |= {name: values for name, values in (("time_s", rows.time), ("dwell_s", rows.dwell)) if not np.isnan(values).all()}
    texts = {"pose": rows.pose, "pass": rows.machined_pass}
    texts = {name: values for name, values in texts.items() if np.any(values != "")}
    if rows.reference.max() > 0:
        texts["reference"] = np.array([f"R{number}" for number in rows.reference], dtype=object)
    if rows.validate.any():
        texts["purpose"] = np.where(rows.validate, "validate", "identify")
    text = io.StringIO()
    text.write(",".join([*columns, *texts]) + "\n")
    for k in range(len(rows)):
        # Seconds since 1970 have ten digits before the point.
        numbers = ["" if np.isnan(values[k]) else f"{values[k] + 0.0:.{15 if name == 'time_s' else 10}g}"
                   for name, values in columns.items()]
        text.write(",".join([*numbers, *(_cell(str(values[k])) for values in texts.values())]) + "\n")
    return text.getvalue()


def _cell(text: str) -> str:
    """A label as a cell of one line: tables have one line a row."""
    text = text.replace("\r", " ").replace("\n", " ")
    quoted = text.replace('"', '""')
    return f'"{quoted}"' if any(mark in text for mark in ',";#') else text


def _cell_text(cell: Cell, mistake: NamedMistake) -> str:
    """cell.yaml with the robot or the TCP changed, everything else as it stands."""
    text = cell.source.read_text(encoding="utf-8-sig")
    candidate = mistake.candidate
    mended = candidate.mistake.mended(candidate.data).cell
    if mended.robot is not cell.robot:
        names = [name for name, file in built_in_robots().items() if file == mended.robot.source]
        return _replaced(text, ("robot",), names[0], cell.source)
    position = ", ".join(f"{x + 0.0:.6g}" for x in 1e3 * mended.flange_from_tcp.position)
    return _replaced(text, ("tool", "position_mm"), f"[{position}]", cell.source)


def _replaced(text: str, keys: tuple[str, ...], value: str, file: Path) -> str:
    """The YAML text with another value at these keys. Raises CS1705 where that would change anything else."""
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    for key in keys:
        node = None if node is None else next((child for name, child in node.value if name.value == key), None)
    if node is not None:
        start, end = node.start_mark.index, node.end_mark.index
        line_end = "\n" if text[start:end].endswith("\n") else ""
        changed = text[:start] + value + line_end + text[end:]
        expected = _with_value(yaml.safe_load(text), keys, yaml.safe_load(value))
        with contextlib.suppress(yaml.YAMLError):       # another key has the value too, by an anchor that stood there
            if yaml.safe_load(changed) == expected:
                return changed
    raise error("CS1705", f"{'.'.join(keys)} could not be changed in this file", file=str(file),
                hint=f"write {value} there by hand")


def _with_value(content: dict[str, Any], keys: tuple[str, ...], value: Any) -> dict[str, Any]:
    """The mapping with another value at these keys, and there alone: what anchors share is copied."""
    first, *further = keys
    return content | {first: _with_value(content[first], tuple(further), value) if further else value}
