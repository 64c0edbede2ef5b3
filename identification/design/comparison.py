"""What a plan with richer loads gains over a plainer one: loads along any line over base axes, the outlook over the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.design.domain import random_pool
from identification.design.exchange import many_exchanges
from identification.design.forecast import spread
from identification.design.search import Design, Effort, best_refined
from identification.design.stated_covariance import largest_log_std
from identification.design.task import Task

EFFORT = Effort(poses=2000, exchanges=30, refinements=6)


@dataclass(frozen=True)
class Comparison:
    """against: the plainer plan in words. ratio: Phi of this plan over that of the best of those that was found. largest,
    other_largest: largest std of the ln k that the loads can show, after this plan and after that one."""

    against: str
    ratio: float
    largest: float
    other_largest: float

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"against": self.against, "criterion_ratio": self.ratio, "largest_log_std": self.largest,
                "largest_log_std_there": self.other_largest}

    def lines(self) -> list[str]:
        """In plain words."""
        return [f"against {self.against}: criterion {self.ratio:.2f} times as good, the least known stiffness "
                f"known {spread(self.largest)} instead of {spread(self.other_largest)}"]


def compared(design: Design, plainer: Task, against: str, rng: np.random.Generator) -> Comparison:
    """The plan against the best that a short search finds for a plainer task with the same criterion and prior."""
    pool = random_pool(plainer.domain, EFFORT.poses, rng)
    plans = many_exchanges(plainer, pool, rng, EFFORT.exchanges)
    best = best_refined(plainer, pool, plans[: EFFORT.refinements])
    return Comparison(against, design.certificate.value / best.value, largest_log_std(design.task, design.runs),
                      largest_log_std(plainer, best.runs))
