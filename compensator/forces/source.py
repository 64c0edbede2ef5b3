"""A force log as its logger writes it -> blocks of samples in SI units, in bounded memory."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from compensator.forces.column_names import FORCE_COUNTS, named_columns
from identification.common import number_blocks
from identification.common.arrays import Array
from identification.common.columns import FORCES, JOINTS, MOMENTS
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.table_layout import BLANKS, Layout, read_layout
from identification.common.tables import check_columns, unread
from identification.common.workbook import sheet_finding
from identification.model.cell_file import ForceLogFile

Indices = NDArray[np.intp]
Key = Literal["target", "path_mm", "position", "joints", "time"]
POSITION = ("x_mm", "y_mm", "z_mm")
TIMES = ("time_s", "time_ms")
MOMENT_COUNTS = ("mx_counts", "my_counts", "mz_counts")
LOG_FORMATS = ("metallicadour", "lvm", "net-ft")
KEYS: dict[Key, tuple[tuple[str, ...], str]] = {
    "target": (("target",), "target number"), "path_mm": (("path_mm",), "path length"),
    "position": (POSITION, "TCP position"), "joints": (JOINTS, "joint angles")}
OPTIONAL = (*MOMENTS, *FORCE_COUNTS, *MOMENT_COUNTS, "target", "path_mm", *POSITION, *JOINTS, *TIMES, "sequence", "mark")
TOGETHER = (MOMENTS, FORCE_COUNTS, MOMENT_COUNTS, POSITION, JOINTS)
SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab", BLANKS: "blanks"}


@dataclass(frozen=True, eq=False)
class Samples:
    """n samples in the order of the log: load (n, 6) [N, N m], or (n, 3) without moments, as logged; place (n, k) [m, rad, or
    target number], (n, 0) where time alone is there; time (n,) [s] or None; sequence (n,) counter or None; line (n,)."""

    load: Array
    place: Array
    time: Array | None
    sequence: Array | None
    line: Indices

    def __len__(self) -> int:
        return len(self.line)

    def part(self, which: slice | Indices) -> Samples:
        """Some of the samples."""
        return replace(self, load=self.load[which], place=self.place[which], line=self.line[which],
                       time=None if self.time is None else self.time[which],
                       sequence=None if self.sequence is None else self.sequence[which])


@dataclass(frozen=True, eq=False)
class BothPlaces:
    """Where n samples of a log were taken that says it twice: position (n, 3) [m] of the TCP in the work object, joints (n, 6)
    [rad]."""

    position: Array
    joints: Array


@dataclass(frozen=True, eq=False)
class ForceSource:
    """A log that is there to be read. rows: how many, about. key: what places its samples."""

    file: Path
    form: ForceLogFile
    columns: tuple[str, ...]
    wanted: tuple[str, ...]
    layout: Layout | None
    held: dict[str, Array] | None
    rows: int
    key: Key
    findings: tuple[Finding, ...]

    @property
    def has_moment(self) -> bool:
        """Whether the log has moments."""
        return self.moments is not None

    @property
    def forces(self) -> tuple[str, ...]:
        """The columns of the forces."""
        return FORCES if FORCES[0] in self.wanted else FORCE_COUNTS

    @property
    def moments(self) -> tuple[str, ...] | None:
        """The columns of the moments."""
        return next((names for names in (MOMENTS, MOMENT_COUNTS) if names[0] in self.wanted), None)

    def blocks(self) -> Iterator[Samples]:
        """All samples, block by block."""
        if self.held is not None:
            count = len(next(iter(self.held.values())))
            for first in range(0, count, number_blocks.BATCH_ROWS):
                stop = min(first + number_blocks.BATCH_ROWS, count)
                yield self._samples({name: values[first:stop] for name, values in self.held.items()},
                                    np.arange(first + 1, stop + 1))
            return
        read = (number_blocks.parquet_blocks(self.file, self.columns, self.wanted) if self.layout is None
                else number_blocks.text_blocks(self.file, self.layout, self.wanted))
        for numbers, line in read:
            yield self._samples(numbers, line)

    def stretches(self, shares: Sequence[float], rows: int) -> Iterator[Array]:
        """The loads (n, 3 or 6) of about `rows` samples on end, from places `shares` (0 to 1) of the way through the log.

        One that cannot be read ends them: `blocks` complains of it with its line.
        """
        for part in self._parts((*self.forces, *(self.moments or ())), shares, rows):
            yield self._load(part)

    def both_places(self, shares: Sequence[float]) -> BothPlaces | None:
        """TCP positions and joint angles of a sample from each of about these places of the way through a log that has both;
        None where it has not, or not twice."""
        if not {*POSITION, *JOINTS} <= set(self.columns):
            return None
        rows = [[part[name][0] for name in (*POSITION, *JOINTS)] for part in self._parts((*POSITION, *JOINTS), shares, 3)
                if len(part[POSITION[0]])]
        found = np.array(rows, dtype=float).reshape(-1, 9)
        found = found[np.isfinite(found).all(axis=1)]
        return BothPlaces(1e-3 * found[:, :3], np.radians(found[:, 3:])) if len(found) > 1 else None

    def _parts(self, wanted: tuple[str, ...], shares: Sequence[float], rows: int) -> Iterator[dict[str, Array]]:
        """These columns of about `rows` rows on end, from places `shares` (0 to 1) of the way through the file; one that cannot
        be read ends them."""
        if self.held is not None:
            places = [int(share * max(self.rows - rows, 0)) for share in shares]
            numbers = iter([{name: self.held[name][place:place + rows] for name in wanted} for place in places])
        elif self.layout is None:
            numbers = number_blocks.parquet_at(self.file, self.columns, wanted, shares, rows)
        else:
            layout = self.layout
            numbers = (number_blocks.text_at(self.file, layout, wanted, share, rows) for share in shares)
        with contextlib.suppress(CompstiffError):
            for part in numbers:
                if part:
                    yield part

    def _load(self, numbers: dict[str, Array]) -> Array:
        count = len(next(iter(numbers.values())))
        names = (*self.forces, *(self.moments or ()))
        # Channel by channel in memory: everything that follows looks along a channel.
        load = np.empty((count, len(names)), order="F")
        for k, name in enumerate(names):
            per = self.form.counts_per_n if name in FORCE_COUNTS else self.form.counts_per_nm
            load[:, k] = numbers[name] / per if name.endswith("_counts") and per else numbers[name]
        return load

    def _samples(self, numbers: dict[str, Array], line: Indices) -> Samples:
        time = next((numbers[name] * (1e-3 if name == "time_ms" else 1.0) for name in TIMES if name in numbers), None)
        if self.key == "time":
            place = np.zeros((len(line), 0))
        else:
            place = np.column_stack([numbers[name] for name in KEYS[self.key][0]])
        if self.key == "target":
            self._check_targets(place[:, 0], line)
        elif self.key == "joints":
            place = np.radians(place)
        else:
            place = 1e-3 * place
        return Samples(self._load(numbers), place, time, numbers.get("sequence"), line)

    def _check_targets(self, target: Array, line: Indices) -> None:
        broken = np.flatnonzero((target != np.round(target)) | (target < 0))
        if len(broken):
            row = int(broken[0])
            raise error("CS3004", f"target {target[row]:g} is not a target number, expected 0, 1, 2 ...",
                        file=str(self.file), line=int(line[row]), column=self.columns.index("target") + 1,
                        hint="targets count from 0 in the order of the text; MoveC has two")


def open_force_log(file: Path, form: ForceLogFile, log_format: str | None = None) -> ForceSource:
    """Finds out what a force log holds. log_format: one of LOG_FORMATS, None for CSV and Parquet.

    Raises CompstiffError: CS0005, CS0201, CS0202 (a column missing or twice), CS3001 (nothing places the samples), CS3020 (no
    header), CS3022 (counts without a scale).
    """
    name = str(file)
    if log_format is None and file.suffix.lower() == ".lvm":
        raise error("CS0201", "is a LabVIEW measurement file, not a table", file=name, hint="read it with --log-format lvm")
    layout, held = None, None
    findings: list[Finding] = []
    header_line: int | None = 1
    if log_format is not None:
        from identification.formats.force_logs import read_force_samples

        samples = read_force_samples(file, log_format, rate_hz=form.rate_hz, counts_per_n=form.counts_per_n,
                                     counts_per_nm=form.counts_per_nm)
        held = samples.columns()
        findings += samples.findings
        names, rows, header_line = tuple(held), len(next(iter(held.values()))), None
    elif file.suffix.lower() in (".parquet", ".pq"):
        names, rows = number_blocks.parquet_names(file)
    else:
        layout = read_layout(file, form.columns)
        names, rows, header_line = layout.names, layout.rows, layout.header_line or None
        findings += sheet_finding(file)
    columns = [column for column in names if column]
    forces = FORCE_COUNTS if FORCE_COUNTS[0] in names and FORCES[0] not in names else FORCES
    check_columns(columns, forces, TOGETHER, name, header_line,
                  hint=named_columns(columns) or named_columns(layout.above if layout is not None else ())
                  or "; or name them in cell.yaml, force_log.columns (in another unit as fx_counts, with counts_per_n)")
    moments: tuple[str, ...] = next((group for group in (MOMENTS, MOMENT_COUNTS) if group[0] in names), ())
    _check_scales(forces, moments, form, name, header_line)
    key = _key(columns, form, name, header_line)
    wanted = (*forces, *moments, *(KEYS[key][0] if key in KEYS else ()), *[column for column in TIMES if column in names][:1],
              *(("sequence",) if "sequence" in names else ()))
    known = (*FORCES, *OPTIONAL)
    extra, absent = [column for column in columns if column not in known], [column for column in known if column not in names]
    findings += [Finding("CS0204", level, text, file=name, line=header_line) for level, text in unread(extra, absent)]
    if layout is not None and form.columns is not None:
        findings.append(Finding(
            "CS3021", "note", f"cells separated by {SEPARATORS[layout.separator]}, columns as cell.yaml names them: "
            f"{', '.join(columns)}" + (f"; {counted(layout.skipped + 1, 'line')} above the numbers passed over"
                                       if layout.header_line else ""), file=name, line=layout.line))
    return ForceSource(file, form, names, wanted, layout, held, rows, key, tuple(findings))


def _check_scales(forces: tuple[str, ...], moments: tuple[str, ...], form: ForceLogFile, name: str, line: int | None) -> None:
    """Raises CompstiffError (CS3022) for counts of which cell.yaml does not say how many a unit has."""
    for columns, counts, key, per in ((forces, FORCE_COUNTS, "counts_per_n", form.counts_per_n),
                                      (moments, MOMENT_COUNTS, "counts_per_nm", form.counts_per_nm)):
        if columns == counts and not per:
            raise error("CS3022", f"{' '.join(columns)} are counts, and cell.yaml does not say what a count is", file=name,
                        line=line, hint=f"state force_log.{key}: the sensor's data sheet or configuration page has it")


def _key(columns: list[str], form: ForceLogFile, name: str, line: int | None) -> Key:
    """What places the samples: the first of KEYS that is there, else time. Raises CompstiffError (CS3001)."""
    for key, (needed, _) in KEYS.items():
        if needed[0] in columns:
            return key
    if set(TIMES) & set(columns) or form.rate_hz:
        return "time"
    raise error("CS3001", f"no column says where on the path a sample belongs: found {', '.join(columns)}", file=name,
                line=line, hint="log one of: target, path_mm, x_mm y_mm z_mm (TCP in the work object), q1_deg ... q6_deg, "
                "time_s")


def placed_by(source: ForceSource) -> str:
    """What places the samples, and what else might have, for people."""
    others = [named for key, (columns, named) in KEYS.items() if key != source.key and columns[0] in source.columns]
    chosen = KEYS[source.key][1] if source.key in KEYS else "time alone"
    return chosen + (f"; not used: {', '.join(others)}" if others else "")


