"""The tool of cell.yaml in another unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake
from identification.model.rotations import Frame

# A tool's length [m].
LENGTHS = (0.02, 1.5)
UNITS = ((25.4, "inches"), (10.0, "centimetres"), (0.001, "micrometres"))


def cell_mistakes(data: LoadTest) -> list[Mistake]:
    """Those that leave a tool of a tool's length."""
    length = float(np.linalg.norm(data.cell.flange_from_tcp.position))
    return [Mistake(f"tcp_unit[{words}]", f"tool.position_mm of {{rows}} seems to be in {words}, not in mm",
                    "measure the tool's length", "cell", _longer(factor))
            for factor, words in UNITS if LENGTHS[0] <= factor * length <= LENGTHS[1]]


def _longer(factor: float) -> Callable[[LoadTest], LoadTest]:
    def change(data: LoadTest) -> LoadTest:
        frame = data.cell.flange_from_tcp
        return replace(data, cell=replace(data.cell, flange_from_tcp=Frame(frame.rotation, factor * frame.position)))

    return change
