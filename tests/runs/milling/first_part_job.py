"""What a program of the virtual cell starts from, as a file of the program's own form, written here from the part's
geometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.virtual_cell.milled_part import POCKET, SLOT, Part

# Below the last key of the cell file, which is the sensor's.
CUTTING = "  spindle_rpm: 9000\ncutting: {tool_diameter_mm: 16, teeth: 3, material: aluminium}\n"
# Between the pocket's wall and the slot [mm].
BETWEEN_Y = 40.0


def stock_file(part: Part, file: Path, aside_mm: float = 0.0, std_mm: float = 0.05, cell_mm: float = 0.2,
               higher_mm: float = 0.0) -> Path:
    """The blank with the roughed pocket (docs/cutting.md#the-file-of-a-stock); aside_mm: it stands so far along x and y;
    higher_mm: its top is so much higher."""
    x, y = np.arange(-62, 62 + cell_mm / 2, cell_mm), np.arange(-42, 64, cell_mm)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2) - aside_mm
    inside = np.where(points[:, 1] < BETWEEN_Y, part.inside_mm(POCKET, points), part.inside_mm(SLOT, points))
    np.savez(file, format="compstiff-stock", version=1, origin_mm=np.array([x[0], y[0]]), cell_mm=np.array(cell_mm),
             height_mm=np.array([-20.0, higher_mm]), inside_mm=inside.reshape(1, len(y), len(x)).astype(np.float32),
             unknown_mm=np.zeros((0, 2, 3)), position_std_mm=np.array(std_mm))
    return file
