"""What each way of placing a force log costs: the deviation predicted by that way against that by the true places.

    python benchmarks/placing.py

The sample's force log (a milling model's, samples/cutting.py) on a clock of a robot that slows down in corners
(benchmarks/time_placement.py), override 90 %. Its samples are placed by the number of the nearest target, by positions that
come late and are renewed every 4 ms as EGM sends them, by the edges of an output that scatter by 2 ms, and by time alone.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks.time_placement import SAMPLES, clock, sample
from compensator.correction.predict import Predicted, predict
from compensator.correction.settings import Settings
from compensator.path.arc_length import nearest_target
from compensator.posting.read_toolpath import read_toolpath
from compensator.rapid.marks import APART, LASTING
from compstiff import fit_stiffness, read_measurements
from identification.model.cell import read_cell

PERIOD = 4e-3


def late(time: np.ndarray, place: np.ndarray, delay: float) -> np.ndarray:
    """The place (M,) [m] that is sent at each time: as it was `delay` [s] before, renewed every PERIOD."""
    return np.asarray(np.interp(np.floor(time / PERIOD) * PERIOD - delay, time, place))


def by_marks(time: np.ndarray, place: np.ndarray, length: np.ndarray, scatter: float) -> np.ndarray:
    """The place (M,) [m] by edges at targets, APART and LASTING apart, that scatter by so many seconds (1 sigma)."""
    passed, marks = np.interp(length, place, time), [0]
    for k in range(1, len(length)):
        if length[k] - length[marks[-1]] >= APART and passed[k] - passed[marks[-1]] >= LASTING:
            marks.append(k)
    edges = passed[marks] + np.random.default_rng(1).normal(0, scatter, len(marks))
    return np.asarray(np.interp(time, edges, length[marks]))


def main() -> None:
    plan, _, place = sample()
    table = pq.read_table(SAMPLES / "insert.forces.parquet")
    time, length = clock(plan, place, 0.9, 5.0, 0.5), plan.length
    ways = {
        "the nearest target's number": ("target", nearest_target(length, place)),
        **{f"positions every {1e3 * PERIOD:g} ms, {1e3 * delay:g} ms late": ("path_mm", 1e3 * late(time, place, delay))
           for delay in (0.0, 0.01, 0.02, 0.05)},
        **{f"marks whose edges scatter by {1e3 * scatter:g} ms": ("path_mm", 1e3 * by_marks(time, place, length, scatter))
           for scatter in (0.0, 2e-3, 10e-3)},
        "time alone": ("time_s", time)}
    cell = read_cell(SAMPLES / "cell.yaml")
    program = read_toolpath(SAMPLES / "insert.mod", cell)
    with tempfile.TemporaryDirectory() as folder:
        fit = fit_stiffness(cell, read_measurements(SAMPLES / "measurements.csv", cell.robot))

        def predicted(column: str, values: np.ndarray) -> Predicted:
            file = Path(folder) / "forces.parquet"
            pq.write_table(pa.table({column: values} | {f"f{axis}_n": table[f"f{axis}_n"] for axis in "xyz"}), file)
            return predict(cell, program, fit.model, file, Settings.of(tare=((0, 2),)))

        truth = predicted("path_mm", 1e3 * place)
        size = 1e6 * np.linalg.norm(truth.prediction.position, axis=1)
        print(f"true places: {len(size)} targets with force, deviation RMS {np.sqrt(np.mean(size**2)):.1f} um")
        for name, (column, values) in ways.items():
            other = predicted(column, values)
            both, here, there = np.intersect1d(truth.targets, other.targets, return_indices=True)
            off = 1e6 * np.linalg.norm(other.prediction.position[there] - truth.prediction.position[here], axis=1)
            print(f"{name}: off by RMS {np.sqrt(np.mean(off**2)):.1f} um, 95 % under {np.quantile(off, 0.95):.1f} um, at most "
                  f"{off.max():.0f} um; {len(truth.targets) - len(both)} targets lost, {len(other.targets) - len(both)} added",
                  flush=True)


if __name__ == "__main__":
    main()
