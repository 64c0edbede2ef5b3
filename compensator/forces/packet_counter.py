"""The packet counter of a log: what was lost before each of its samples, and so when that was taken where no time is logged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array

# A counter that runs back by less than so much shows packets that came out of their order, else it ran over or was set anew.
OUT_OF_ORDER = 100


@dataclass
class PacketCounter:
    """A counter that is read block by block. each: whether it counts each sample of the log, None before the first block;
    behind: so many were lost of the `count` so far, the latest of which is so many samples behind the first."""

    last: float | None = None
    each: bool | None = None
    behind: float = 0.0
    count: int = 0
    latest: float = 0.0

    def read(self, counts: Array) -> tuple[Array, Array]:
        """The steps (n,) to the counts (n,) of the next block, 1 to the first of all; and how many samples (n,) were lost
        before each, less those that stand twice: by them a packet that came late counts as taken with the one above it. A
        counter that counts what was never to be logged tells nothing of that."""
        step = np.diff(counts, prepend=counts[0] - 1 if self.last is None else self.last)
        self.last = float(counts[-1])
        self.each = bool(np.median(step) == 1) if self.each is None else self.each
        if not self.each:
            return step, np.zeros(len(step))
        behind = self.behind + np.cumsum(np.where(step > -OUT_OF_ORDER, step - 1, 0))
        number = self.count + np.arange(len(step))
        taken = np.maximum(np.maximum.accumulate(number + behind), self.latest)
        self.behind, self.count, self.latest = float(behind[-1]), self.count + len(step), float(taken[-1])
        return step, taken - number
