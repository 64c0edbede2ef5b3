"""A force log as its logger writes it -> blocks of samples in SI units, in bounded memory."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common import number_blocks
from identification.common.columns import FORCES, JOINTS, MOMENTS
from identification.common.findings import CompstiffError, Finding, error
from identification.common.number_blocks import BLANKS, Layout
from identification.common.tables import unread
from identification.model.cell import ForceLogFile

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Key = Literal["target", "path_mm", "position", "joints", "time"]
POSITION = ("x_mm", "y_mm", "z_mm")
TIMES = ("time_s", "time_ms")
FORCE_COUNTS = ("fx_counts", "fy_counts", "fz_counts")
MOMENT_COUNTS = ("mx_counts", "my_counts", "mz_counts")
LOG_FORMATS = ("metallicadour", "lvm", "net-ft")
KEYS: dict[Key, tuple[tuple[str, ...], str]] = {
    "target": (("target",), "target number"), "path_mm": (("path_mm",), "path length"),
    "position": (POSITION, "TCP position"), "joints": (JOINTS, "joint angles")}
OPTIONAL = (*MOMENTS, *FORCE_COUNTS, *MOMENT_COUNTS, "target", "path_mm", *POSITION, *JOINTS, *TIMES, "sequence")
TOGETHER = (MOMENTS, FORCE_COUNTS, MOMENT_COUNTS, POSITION, JOINTS)
WORDS = {",": "comma", ";": "semicolon", "\t": "tab", BLANKS: "blanks"}


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
class ForceSource:
    """A log that is there to be read. rows: how many, about. key: what places its samples."""

    path: Path
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
        read = (number_blocks.parquet_blocks(self.path, self.columns, self.wanted) if self.layout is None
                else number_blocks.text_blocks(self.path, self.layout, self.wanted))
        for numbers, line in read:
            yield self._samples(numbers, line)

    def stretches(self, shares: Sequence[float], rows: int) -> Iterator[Array]:
        """The loads (n, 3 or 6) of about `rows` samples on end, from places `shares` (0 to 1) of the way through the log.

        One that cannot be read ends them: `blocks` complains of it with its line.
        """
        wanted = (*self.forces, *(self.moments or ()))
        if self.held is not None:
            places = [int(share * max(self.rows - rows, 0)) for share in shares]
            numbers = iter([{name: self.held[name][place:place + rows] for name in wanted} for place in places])
        elif self.layout is None:
            numbers = number_blocks.parquet_at(self.path, self.columns, wanted, shares, rows)
        else:
            layout = self.layout
            numbers = (number_blocks.text_at(self.path, layout, wanted, share, rows) for share in shares)
        with contextlib.suppress(CompstiffError):
            for part in numbers:
                if part:
                    yield self._load(part)

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
                        file=str(self.path), line=int(line[row]), column=self.columns.index("target") + 1,
                        hint="targets count from 0 in the order of the text; MoveC has two")


def open_force_log(path: Path, form: ForceLogFile, log_format: str | None = None) -> ForceSource:
    """Finds out what a force log holds. log_format: one of LOG_FORMATS, None for CSV and Parquet.

    Raises CompstiffError: CS0005, CS0201, CS0202 (a column missing or twice), CS3001 (nothing places the samples), CS3020 (no
    header), CS3022 (counts without a scale).
    """
    name = str(path)
    layout, held = None, None
    said: tuple[Finding, ...] = ()
    header_line: int | None = 1
    if log_format is not None:
        from identification.formats.force_logs import read_force_samples

        samples = read_force_samples(path, log_format, rate_hz=form.rate_hz, counts_per_n=form.counts_per_n,
                                     counts_per_nm=form.counts_per_nm)
        held, said = samples.columns(), samples.findings
        names, rows, header_line = tuple(held), len(next(iter(held.values()))), None
    elif path.suffix.lower() in (".parquet", ".pq"):
        names, rows = number_blocks.parquet_names(path)
    else:
        layout = number_blocks.read_layout(path, form.columns)
        names, rows, header_line = layout.names, layout.rows, layout.header_line or None
    counts = FORCE_COUNTS[0] in names and FORCES[0] not in names
    _check_names(names, FORCE_COUNTS if counts else FORCES, name, header_line)
    moments = next((some for some in (MOMENTS, MOMENT_COUNTS) if some[0] in names), ())
    for used, key, per in ((FORCE_COUNTS if counts else (), "counts_per_n", form.counts_per_n),
                           (moments if moments == MOMENT_COUNTS else (), "counts_per_nm", form.counts_per_nm)):
        if used and not per:
            raise error("CS3022", f"{' '.join(used)} are counts, and cell.yaml does not say what a count is", file=name,
                        line=header_line, hint=f"state force_log.{key}: the sensor's data sheet or configuration page has it")
    keys: list[Key] = [key for key, (columns, _) in KEYS.items() if columns[0] in names]
    if not keys and (set(TIMES) & set(names) or form.rate_hz):
        keys = ["time"]
    if not keys:
        found = ", ".join(one for one in names if one)
        raise error("CS3001", f"no column says where on the path a sample belongs: found {found}", file=name, line=header_line,
                    hint="log one of: target, path_mm, x_mm y_mm z_mm (TCP in the work object), q1_deg ... q6_deg, time_s")
    wanted = (*(FORCE_COUNTS if counts else FORCES), *moments, *(KEYS[keys[0]][0] if keys[0] in KEYS else ()),
              *[one for one in TIMES if one in names][:1], *(("sequence",) if "sequence" in names else ()))
    known = (*FORCES, *OPTIONAL)
    extra, absent = [one for one in names if one and one not in known], [one for one in known if one not in names]
    notes = [*said, *(Finding("CS0204", level, text, file=name, line=header_line) for level, text in unread(extra, absent))]
    if layout is not None and form.columns is not None:
        notes.append(Finding(
            "CS3021", "note", f"cells separated by {WORDS[layout.separator]}, columns as cell.yaml names them: "
            f"{', '.join(one for one in names if one)}" + (f"; {layout.skipped + 1} lines above the numbers passed over"
                                                           if layout.header_line else ""), file=name, line=layout.line))
    return ForceSource(path, form, names, wanted, layout, held, rows, keys[0], tuple(notes))


def placed_by(source: ForceSource) -> str:
    """What places the samples, and what else might have, in words."""
    others = [said for key, (columns, said) in KEYS.items() if key != source.key and columns[0] in source.columns]
    words = KEYS[source.key][1] if source.key in KEYS else "time alone"
    return words + (f"; not used: {', '.join(others)}" if others else "")


def _check_names(names: Sequence[str], required: Sequence[str], source: str, line: int | None) -> None:
    missing = [one for one in required if one not in names]
    if missing:
        raise error("CS0202", f"column{'s' if len(missing) > 1 else ''} missing: {', '.join(missing)}; "
                    f"found {', '.join(one for one in names if one) or 'none'}", file=source, line=line,
                    hint="the header line names the columns, unit included, as in docs/formats.md of the project; or name "
                    "them in cell.yaml, force_log.columns")
    for group in TOGETHER:
        there = [one for one in group if one in names]
        if there and len(there) < len(group):
            raise error("CS0202", f"found {', '.join(there)} without {', '.join(one for one in group if one not in names)}",
                        file=source, line=line, hint="give all of them or none")
