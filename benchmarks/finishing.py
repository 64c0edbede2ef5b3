"""A dome finished in rows by a ball: how much of it is predicted from the stock, in what time and memory.

    OMP_NUM_THREADS=1 python benchmarks/finishing.py [TARGETS]

A RAPID program as CAM writes it, tool upright: rows back and forth, 0.5 mm apart, over a dome of radius 100 mm, 120 mm wide and
as long as TARGETS (100 000) at 0.3 mm make it, to both sides of its top: slopes up to 36 degrees along the rows, and as much
across them. The stock is what a semi-finish with 0.4 mm of allowance leaves, in layers of 0.1 mm on a grid of 0.2 mm.
Coefficients are the table's. CPU seconds; memory is the largest of the process, and what of it was there before.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import compstiff
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from compensator.cutting.cut import cut_of
from compensator.path.robot_path import robot_path
from tests.runs.milling.first_part_job import CUTTING
from tests.runs.milling.milling_job import MillingJob
from tests.virtual_cell.milled_part import slot_and_pocket

DOME, BALL, HALF, ALLOWANCE, ROW, APART = 100.0, 8.0, 60.0, 0.4, 0.5, 0.3


def rows_over_the_dome(targets: int) -> np.ndarray:
    """Targets (N, 3) [mm] of the tip, work object; the dome's top is its origin."""
    x = np.arange(-HALF - 3, HALF + 3 + 1e-9, APART)
    count = max(round(targets / len(x)), 1)
    y = ROW * (np.arange(count) - 0.5 * (count - 1))
    if abs(y[0]) > HALF:
        raise SystemExit("so many targets do not fit on the dome")
    rows = []
    for number, side in enumerate(y):
        middle = np.sqrt((DOME + BALL) ** 2 - x**2 - side**2)
        rows.append(np.column_stack([x, np.full(len(x), side), middle - DOME - BALL])[::1 - 2 * (number % 2)])
    return np.concatenate(rows)


def write_stock(file: Path, tip: np.ndarray) -> None:
    """The dome with its allowance, over what the program goes over."""
    cell, wide = 0.2, float(np.abs(tip[:, 1]).max()) + 6.0
    low = float(tip[:, 2].min()) - 2.0
    height = np.arange(np.floor(low), ALLOWANCE + 0.1, 0.1)
    x, y = np.arange(-HALF - 2, HALF + 2 + cell, cell), np.arange(-wide - 2, wide + 2 + cell, cell)
    edge = np.minimum((HALF - np.abs(x))[None, :], (wide - np.abs(y))[:, None])
    away = np.hypot(*np.meshgrid(x, y))
    middle = 0.5 * (height[1:] + height[:-1]) + DOME
    radius = np.sqrt(np.maximum((DOME + ALLOWANCE) ** 2 - middle**2, 0.0))
    inside = np.empty((len(radius), *away.shape), dtype=np.float32)
    for layer, own in zip(inside, radius, strict=True):
        np.minimum(edge, own - away, out=layer, casting="same_kind")
    np.savez(file, format="compstiff-stock", version=1, origin_mm=np.array([x[0], y[0]]), cell_mm=np.array(cell),
             height_mm=height, inside_mm=inside, unknown_mm=np.zeros((0, 2, 3)), position_std_mm=np.array(0.1))


def most_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    tip = rows_over_the_dome(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        job = MillingJob(root, 1, part=slot_and_pocket())
        text = job.program.read_text().splitlines()
        first = next(k for k, line in enumerate(text) if "MoveL" in line)
        head, tail = text[first].split("]", 1)[0].rsplit("[", 1)[0], text[first].split("]", 1)[1].replace("vAir", "vCut")
        moves = [f"{head}[{x:.3f},{y:.3f},{z:.3f}]{tail}" for x, y, z in tip]
        (root / "dome.mod").write_text("\n".join([*text[:first], *moves, "  ENDPROC", "ENDMODULE"]) + "\n")
        write_stock(root / "stock.npz", tip)
        cell = compstiff.read_cell(job.cell_with("cut.yaml", CUTTING.replace("teeth: 3", "teeth: 3, corner_radius_mm: 8")))
        program = compstiff.read_toolpath(root / "dome.mod", cell)
        path = robot_path(program.toolpath, cell)
        before, started = most_mb(), time.process_time()
        cut = cut_of(path, root / "stock.npz", None)
        way = cut.track.end - cut.track.start
        slope = np.degrees(np.arctan2(way[:, 2], np.hypot(way[:, 0], way[:, 1])))
        print(f"{len(path.toolpath)} targets, {len(cut.track)} steps, slopes {slope.min():.0f} to {slope.max():.0f} degrees: "
              f"engagement {time.process_time() - started:.1f} s of CPU, {most_mb():.0f} MB in all, {before:.0f} before; stock "
              f"{cut.left.words()}", flush=True)
        print(f"{cut.cuts.sum()} targets cut, of {(cut.cuts & cut.unknown).sum()} the force is not known: "
              f"{100 * np.mean(~cut.unknown[cut.cuts]):.1f} % predicted")
        del cut
        (root / "table.json").write_text(json.dumps(compstiff.table_coefficients(cell, program).content()))
        model, started = job.springs("k.json", job.case.stiffness), time.process_time()
        found = predict_files(Inputs(root / "cut.yaml", root / "dome.mod", model, None), Settings.of(
            predict_force=root / "table.json", stock=root / "stock.npz"))
        print(f"predict: {len(found.targets)} targets with a force, {time.process_time() - started:.1f} s of CPU, "
              f"{most_mb():.0f} MB in all")


if __name__ == "__main__":
    main()
