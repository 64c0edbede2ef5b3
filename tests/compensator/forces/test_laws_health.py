"""A channel that stands still is found where it does, however the samples come in blocks."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.health import Health
from compensator.forces.source import Samples

COUNT = 4000


@pytest.mark.parametrize("seed", range(6))
def test_a_run_over_the_borders_of_blocks_has_its_first_line_and_its_length(seed: int) -> None:
    """Readings in steps, which repeat by chance now and then, and one channel held: its first line, how long, by hand."""
    rng = np.random.default_rng(seed)
    load = np.round(rng.normal(0, 30.0, (COUNT, 3))) + np.array([400.0, -700.0, 200.0])
    first, length, axis = int(rng.integers(500, 3000)), int(rng.integers(150, 600)), int(rng.integers(3))
    load[first:first + length, axis] = load[first, axis]
    load[first - 1, axis], load[first + length, axis] = load[first, axis] + [1.0, -1.0]
    told = []
    for most in (COUNT + 1, 700, 60):
        health, start = Health("a.csv", (None, None), None), 0
        while start < COUNT:
            stop = start + int(rng.integers(most // 2, most)) if most < COUNT else COUNT
            lines = np.arange(COUNT)[start:stop] + 2
            health.look(Samples(load[start:stop], np.zeros((len(lines), 0)), None, None, lines))
            start = stop
        told.append([(finding.code, finding.line, finding.message) for finding in health.findings()])
        (code, line, message), = told[-1]
        assert (code, line) == ("CS3024", first + 2)
        assert f"{length} samples" in message
    assert told[1:] == told[:1] * 2
