"""offsets.csv and deviation.csv: one row a target, corrected or not (docs/formats.md)."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correct import Corrected
from compensator.correction.predict import Predicted
from compensator.forces.gaps import without_sample_in_cut
from identification.common.added_targets import ADDED, ADDED_LEFT, ADDED_MM, added_numbers, added_text
from identification.common.arrow import arrow_csv, number_column, text_column

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
CHUNK = 8192        # targets written at a time: bounds the memory their columns take


def offsets_csv(corrected: Corrected) -> bytes:
    """The offsets file: planned position, commanded minus planned, predicted deviation with its sigma, time, note, 1 sigma
    of what is expected to be left on the part, and of what of it the force that follows the cut leaves, and where targets were
    added before this one (added_targets.py).

    One row for each target of the program as it was given, and its prediction. The offsets are those of the written program, in
    which a target may have intermediate ones beside it and so a narrower share of the log.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> settings = compstiff.Settings.of(tare=((0, 2),))
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", settings)
    >>> compstiff.offsets_csv(compstiff.correct(predicted)).count(b"\\n")
    3587
    """
    return b"".join(offset_blocks(corrected))


def offset_blocks(corrected: Corrected) -> Iterator[bytes]:
    """The same, some thousand rows at a time."""
    correction, kept, left = corrected.correction, corrected.kept, corrected.left
    # Which of the targets as given each corrected one is, and which of these are such.
    given = np.searchsorted(kept, correction.targets)
    own = np.flatnonzero(kept[given] == correction.targets)
    at = given[own]
    # Beside targets that were added the share of the log that is a target's own may show no force, as where the tool leaves.
    silent = np.setdiff1d(corrected.planned.targets, at)
    unknown = _left(corrected.planned) | _held(corrected.planned)
    unknown[silent] = True
    every = np.zeros((len(corrected.predicted.path.toolpath), 4))
    every[correction.targets] = np.column_stack([1e3 * correction.offset, 1e6 * left.std])
    return _blocks(corrected.planned, [_Columns("ox_mm oy_mm oz_mm", correction.offset, 6, 1e3, at, own),
                                       _Columns("orx_deg ory_deg orz_deg", correction.turn, 8, np.degrees(1.0), at, own)],
                   [_Columns("left_um cut_um", np.column_stack([left.std, left.cut]), 4, 1e6, at, own, unknown)],
                   {ADDED: added_text(kept, corrected.predicted.path.length), ADDED_MM: added_numbers(kept, every[:, :3], 6),
                    ADDED_LEFT: added_numbers(kept, every[:, 3:], 4)}, silent)


def deviation_csv(predicted: Predicted) -> bytes:
    """The same rows without a correction: what `predict` writes.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> settings = compstiff.Settings.of(tare=((0, 2),))
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", settings)
    >>> compstiff.deviation_csv(predicted).split(b",")[:3]
    [b'target', b'line', b'x_mm']
    """
    return b"".join(_blocks(predicted, [], [], {}))


@dataclass(frozen=True, eq=False)
class _Columns:
    """The names of columns, and their numbers: factor times values (M, n), of which the rows `of` (K,) are those of the targets
    `at` (K,), ascending, and zero at all others; to so many decimals. unknown (N,): the targets that have none."""

    names: str
    values: Array
    decimals: int
    factor: float
    at: Indices
    of: Indices
    unknown: NDArray[np.bool_] | None = None

    def rounded(self, rows: slice) -> dict[str, Array]:
        here = slice(*np.searchsorted(self.at, [rows.start, rows.stop]))
        with np.errstate(over="ignore", invalid="ignore"):
            spread = np.zeros((rows.stop - rows.start, self.values.shape[1]))
            spread[self.at[here] - rows.start] = self.factor * self.values[self.of[here]]
            if self.unknown is not None:
                spread[self.unknown[rows]] = np.nan
            rounded = np.round(spread, self.decimals) + 0.0                 # + 0.0: no -0
        rounded[~np.isfinite(rounded)] = np.nan                             # JSON and CSV hold no infinity
        return dict(zip(self.names.split(), rounded.T, strict=True))


def _blocks(
    predicted: Predicted, more: list[_Columns], last: list[_Columns], texts: dict[str, NDArray[np.object_]],
    silent: Indices | None = None,
) -> Iterator[bytes]:
    import pyarrow as pa

    csv = arrow_csv()
    toolpath, targets = predicted.path.toolpath, predicted.targets
    with np.errstate(over="ignore", invalid="ignore"):      # absurd feeds
        time = np.cumsum(predicted.path.move_time)
    left = _left(predicted)
    unknown = left | _held(predicted)
    every, prediction = np.arange(len(toolpath)), predicted.prediction
    columns = [_Columns("x_mm y_mm z_mm", toolpath.position, 6, 1e3, every, every), *more,
               *(_Columns(names, values, 4, 1e6, targets, np.arange(len(targets)), unknown)
                 for names, values in (("dx_um dy_um dz_um", prediction.at_rest),
                                       ("sx_um sy_um sz_um", prediction.at_rest_std)))]
    notes = _notes(predicted, left)
    if silent is not None:
        notes[silent] = "no force right at it: not corrected"
    for start in range(0, max(len(toolpath), 1), CHUNK):
        rows = slice(start, min(start + CHUNK, len(toolpath)))
        table = pa.table({
            "target": number_column(np.arange(len(toolpath))[rows]),
            "line": number_column(toolpath.line[rows]),
            **{name: number_column(values) for some in columns for name, values in some.rounded(rows).items()},
            "time_s": number_column(np.round(time[rows], 6)),
            "samples": number_column(predicted.forces.samples[rows]),
            "note": text_column(notes[rows].tolist()),
            **{name: number_column(values) for some in last for name, values in some.rounded(rows).items()},
            **{name: text_column(words[rows].tolist()) for name, words in texts.items()},
        })
        stream = io.BytesIO()
        if not start:
            stream.write((",".join(table.column_names) + "\n").encode())
        csv.write_csv(table, stream, csv.WriteOptions(include_header=False, quoting_style="needed"))
        yield stream.getvalue()


def _left(predicted: Predicted) -> NDArray[np.bool_]:
    """The targets (N,) with force that cannot be corrected."""
    left = predicted.forces.forced.copy()
    left[predicted.targets] = False
    return left


def _held(predicted: Predicted) -> NDArray[np.bool_]:
    """The targets (N,) of which no force is known, since the log stood still there, or has no sample in the middle of a cut."""
    held = without_sample_in_cut(predicted.path, predicted.forces.samples, predicted.forces.forced)
    held[predicted.targets] = False
    held[predicted.forces.held] = True
    return held


def _notes(predicted: Predicted, left: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Why a target was not corrected; where it was, whose state changes before it, mostly empty."""
    forces, toolpath = predicted.forces, predicted.path.toolpath
    notes = np.full(len(toolpath), "", dtype=object)
    notes[~forces.forced] = "no force"
    notes[forces.samples == 0] = "no sample"
    notes[forces.held] = "the log stood still"
    notes[predicted.targets] = predicted.prediction.notes
    for target in np.flatnonzero(left):
        notes[target] = f"left: {toolpath.block[target] or 'MoveAbsJ'}"
    return notes
