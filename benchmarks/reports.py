"""How large a report of `predict` is, how long it takes to write, and how soon a browser shows it.

    python -m benchmarks.reports [TARGETS ...]          # default 1e4 1e5 1e6

The part is a synthetic job (benchmarks/correct_time.py). Shown: the first text and picture, then the path in space with
its controls. A Chromium is looked for as tests/runs/reports/browser.py does; without one it ends. It draws by the
processor here; a computer with graphics is faster.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import compstiff
from benchmarks.correct_time import write_job
from tests.runs.reports.browser import chromium

READY = "[...document.querySelectorAll('figure[data-view]')].every(one => one.view)"
PAINT = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"


def shown(browser: Any, file: Path) -> tuple[float, float]:
    """Seconds from the call to the first paint, and to the path in space."""
    page = browser.new_page(viewport={"width": 1200, "height": 860})
    start = time.perf_counter()
    page.goto(file.as_uri(), wait_until="commit")
    while not page.evaluate(READY):
        time.sleep(0.02)
    ready = time.perf_counter() - start
    paint = 1e-3 * page.evaluate(PAINT)
    page.close()
    return paint, ready


def row(folder: Path, count: int, browser: Any) -> str:
    """One line of the table."""
    write_job(folder, count, "target")
    cell = compstiff.read_cell(folder / "cell.yaml")
    predicted = compstiff.predict(cell, compstiff.read_toolpath(folder / "long.mod", cell),
                                  compstiff.read_stiffness(folder / "stiffness.json", cell), folder / "long.forces.csv")
    start = time.perf_counter()
    text = compstiff.report(predicted)
    written = time.perf_counter() - start
    file = folder / "predict.html"
    file.write_text(text, encoding="utf-8")
    paint, ready = shown(browser, file)
    return f"| {count} | {written:.2f} | {file.stat().st_size / 1e6:.2f} | {paint:.2f} | {ready:.2f} |"


def main() -> None:
    counts = [int(float(word)) for word in sys.argv[1:]] or [10_000, 100_000, 1_000_000]
    print("| targets | report written [s] | size [MB] | first text and picture [s] | path in space [s] |")
    print("|---|---|---|---|---|")
    with chromium() as launch, tempfile.TemporaryDirectory() as folder:
        browser = launch()
        for count in counts:
            print(row(Path(folder), count, browser), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
