"""ForceSamples: forces over time, as public logs and sensors give them, and their form as forces.csv (docs/formats.md)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from identification.common.columns import FORCES, MOMENTS
from identification.common.findings import Finding

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ForceSamples:
    """time (n,) [s] from the first sample on, force (n, 3) [N], moment (n, 3) [N m] or None; in the sensor's own frame.

    conditions: what the file or its folder says of the cut, by name with the unit. others: further channels (n,) as they are.
    """

    source: str
    time: Array
    force: Array
    moment: Array | None = None
    conditions: dict[str, float] = field(default_factory=dict)
    others: dict[str, Array] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def columns(self) -> dict[str, Array]:
        """time_s, fx_n fy_n fz_n and, where there are moments, mx_nm my_nm mz_nm."""
        columns = {"time_s": self.time} | dict(zip(FORCES, self.force.T, strict=True))
        return columns if self.moment is None else columns | dict(zip(MOMENTS, self.moment.T, strict=True))
