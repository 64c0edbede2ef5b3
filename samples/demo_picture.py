"""docs/pictures/demo.svg: the deviation that `compstiff demo` predicts along its program, and what it expects to be left.

    python -m samples.demo_picture compstiff-demo/offsets.csv
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from samples.pictures import Panel, Series, svg

PICTURE = Path(__file__).parents[1] / "docs/pictures/demo.svg"
# Of so many consecutive targets the largest is drawn.
TOGETHER = 8
SHADES = ((0.0, "#d7dde3"), (40.0, "#f6c667"), (160.0, "#e07b39"), (260.0, "#b3202c"))


def picture(offsets: Path) -> str:
    """Left: the program from above, each place in the colour of its deviation. Right: deviation before, expected after."""
    with offsets.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    column = {name: np.array([float(row[name] or 0) for row in rows])
              for name in ("x_mm", "y_mm", "dx_um", "dy_um", "dz_um", "left_um")}
    before = np.sqrt(column["dx_um"] ** 2 + column["dy_um"] ** 2 + column["dz_um"] ** 2)
    starts = np.arange(0, len(rows), TOGETHER)
    before, left = np.maximum.reduceat(before, starts), np.maximum.reduceat(column["left_um"], starts)
    x, y, number = column["x_mm"][starts], column["y_mm"][starts], starts.astype(float)
    above = []
    for place, (low, colour) in enumerate(SHADES):
        high = SHADES[place + 1][0] if place + 1 < len(SHADES) else np.inf
        chosen = (before >= low) & (before < high)
        name = f"from {low:g} um" if low else "under 40 um"
        above.append(Series(x[chosen], y[chosen], colour, name))
    along = [Series(number, before, SHADES[-1][1], "predicted, as planned", line=True),
             Series(number, left, "#1b6ca8", "expected to be left, 1 sigma", line=True)]
    return svg([Panel("the sample from above, by predicted deviation", "x [mm]", "y [mm]", above),
                Panel("red: as planned; blue: left after correction", "target", "deviation [um]", along)])


def main() -> None:
    """Writes the picture."""
    PICTURE.write_text(picture(Path(sys.argv[1])), encoding="utf-8")


if __name__ == "__main__":
    main()
