"""The packet counter of a log: what was lost before each of its samples, and so when that was taken where no time is logged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array


@dataclass
class PacketCounter:
    """A counter that is read block by block. each: whether it counts each sample of the log, None before the first block;
    behind: so many were lost so far."""

    last: float | None = None
    each: bool | None = None
    behind: float = 0.0

    def read(self, counts: Array) -> tuple[Array, Array]:
        """The steps (n,) to the counts (n,) of the next block, 1 to the first of all; and how many samples (n,) were lost
        before each, less those that stand twice. A counter that counts what was never to be logged tells nothing of that; one
        that runs back ran over, or was set anew."""
        step = np.diff(counts, prepend=counts[0] - 1 if self.last is None else self.last)
        self.last = float(counts[-1])
        self.each = bool(np.median(step) == 1) if self.each is None else self.each
        lost = self.behind + np.cumsum(np.where(step >= 0, step - 1, 0)) if self.each else np.zeros(len(step))
        self.behind = float(lost[-1])
        return step, lost
