"""offsets.csv and deviation.csv: one row a target, corrected or not (docs/formats.md)."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correct import Corrected
from compensator.correction.predict import Predicted
from identification.common.arrow import number_column, text_column
from identification.model.kinematics import chunks

Array = NDArray[np.float64]
CHUNK = 8192        # targets written at a time: bounds the memory their columns take


def offsets_csv(corrected: Corrected) -> bytes:
    """The offsets file: planned position, commanded minus planned, predicted deviation with its sigma, time, note, and 1 sigma
    of what is expected to be left on the part, and of what of it the force that follows the cut leaves.

    One row for each target of the program as it was given, and its prediction. The offsets are those of the written program, in
    which a target may have intermediate ones beside it and so a narrower share of the log.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> settings = compstiff.Settings.of(tare=((0, 2),))
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", settings)
    >>> compstiff.offsets_csv(compstiff.correct(predicted)).count(b"\\n")
    3587
    """
    targets = corrected.correction.targets
    count = len(corrected.predicted.path.toolpath)
    offset, turn = np.zeros((count, 3)), np.zeros((count, 3))
    offset[targets], turn[targets] = 1e3 * corrected.correction.offset, np.degrees(corrected.correction.turn)
    kept = corrected.kept
    left = np.zeros((count, 2))
    left[targets] = 1e6 * np.column_stack([corrected.left.std, corrected.left.cut])
    return _csv(corrected.planned, [_Columns("ox_mm oy_mm oz_mm", offset[kept], 6),
                                    _Columns("orx_deg ory_deg orz_deg", turn[kept], 8)],
                [_Columns("left_um cut_um", left[kept], 4)])


def deviation_csv(predicted: Predicted) -> bytes:
    """The same rows without a correction: what `predict` writes.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> settings = compstiff.Settings.of(tare=((0, 2),))
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", settings)
    >>> compstiff.deviation_csv(predicted).split(b",")[:3]
    [b'target', b'line', b'x_mm']
    """
    return _csv(predicted, [], [])


@dataclass(frozen=True, eq=False)
class _Columns:
    """Numbers (N, n) of the targets, by the names of their columns, and to how many decimals they are written."""

    names: str
    values: Array
    decimals: int

    def rounded(self, rows: slice) -> dict[str, Array]:
        with np.errstate(over="ignore", invalid="ignore"):
            rounded = np.round(self.values[rows], self.decimals) + 0.0      # + 0.0: no -0
        rounded[~np.isfinite(rounded)] = np.nan                             # JSON and CSV hold no infinity
        return dict(zip(self.names.split(), rounded.T, strict=True))


def _csv(predicted: Predicted, more: list[_Columns], last: list[_Columns]) -> bytes:
    import pyarrow as pa
    from pyarrow import csv

    toolpath, targets = predicted.path.toolpath, predicted.targets
    deviation, sigma = np.zeros((len(toolpath), 3)), np.zeros((len(toolpath), 3))
    deviation[targets], sigma[targets] = 1e6 * predicted.prediction.position, 1e6 * predicted.prediction.std
    with np.errstate(over="ignore", invalid="ignore"):      # absurd feeds
        time = np.cumsum(predicted.path.move_time)
    left = predicted.forces.forced.copy()
    left[targets] = False
    deviation[left] = sigma[left] = np.nan
    columns = [_Columns("x_mm y_mm z_mm", 1e3 * toolpath.position, 6), *more, _Columns("dx_um dy_um dz_um", deviation, 4),
               _Columns("sx_um sy_um sz_um", sigma, 4)]
    notes = _notes(predicted, left)
    stream = io.BytesIO()
    for rows in chunks(max(len(toolpath), 1), CHUNK):
        table = pa.table({
            "target": number_column(np.arange(len(toolpath))[rows]),
            "line": number_column(toolpath.line[rows]),
            **{name: number_column(values) for some in columns for name, values in some.rounded(rows).items()},
            "time_s": number_column(np.round(time[rows], 6)),
            "samples": number_column(predicted.forces.samples[rows]),
            "note": text_column(notes[rows].tolist()),
            **{name: number_column(values) for some in last for name, values in some.rounded(rows).items()},
        })
        if not rows.start:
            stream.write((",".join(table.column_names) + "\n").encode())
        csv.write_csv(table, stream, csv.WriteOptions(include_header=False, quoting_style="needed"))
    return stream.getvalue()


def _notes(predicted: Predicted, left: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Why a target was not corrected; where it was, whose state changes before it, mostly empty."""
    forces, toolpath = predicted.forces, predicted.path.toolpath
    notes = np.full(len(toolpath), "", dtype=object)
    notes[~forces.forced] = "no force"
    notes[forces.samples == 0] = "no sample"
    notes[predicted.targets] = predicted.prediction.notes
    for target in np.flatnonzero(left):
        notes[target] = f"left: {toolpath.block[target] or 'MoveAbsJ'}"
    return notes
