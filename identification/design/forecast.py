"""What a plan will tell, before anything is measured: stiffnesses, causes, and what more or fewer runs would change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.design.exchange import Demand, exchange
from identification.design.procedure import Design
from identification.design.sheet import Sheet, as_measurements
from identification.diagnosis.plan import Outlook, judge_plan
from identification.fit.identifiability import RELIABLE_LOG_STD, TRADE_OFF, UNSEEN_SHRINKAGE
from identification.measurements import Measurements

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointForecast:
    """std of ln k before and after, grade as `identify` will give it, the joint (1-based) it trades off with, 0 where none."""

    joint: int
    before: float
    after: float
    grade: str
    partner: int
    correlation: float


@dataclass(frozen=True, eq=False)
class Forecast:
    """joints: the six. causes: what the plan can say of each effect; left_out: effects it cannot show, and why.
    runs, values, stds: criterion and largest std of ln k of plans of other lengths out of the same pool."""

    joints: tuple[JointForecast, ...]
    causes: tuple[Outlook, ...]
    left_out: dict[str, str]
    runs: tuple[int, ...]
    values: tuple[float, ...]
    stds: tuple[float, ...]

    @property
    def counts(self) -> dict[str, int]:
        """How many causes are identifiable, detectable, invisible at their typical size."""
        return {grade: sum(one.grade == grade for one in self.causes) for grade in ("identifiable", "detectable", "invisible")}

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "joints": [{"name": f"k{one.joint}", "log_std_before": one.before, "log_std_after": one.after, "grade": one.grade,
                        "trades_off_with": f"k{one.partner}" if one.partner else None, "correlation": one.correlation}
                       for one in self.joints],
            "causes": {"counts": self.counts, "effects": [one.as_dict() for one in self.causes], "not_offered": self.left_out},
            "by_measurements": [{"measurements": n, "criterion": value, "largest_log_std": std}
                                for n, value, std in zip(self.runs, self.values, self.stds, strict=True)],
        }


def forecast(found: Design, rows: Sheet, measured: Measurements | None, rng: np.random.Generator) -> Forecast:
    """The forecast of a plan whose rows are `rows`, taken after those that are measured already, if any."""
    planned = as_measurements(rows)
    if measured is not None:
        planned = measured.select(~measured.validate).followed_by(planned)
    outlook = judge_plan(found.task.domain.rig.cell, planned)
    count = len(found.task.demand)
    free = len(found.task.demand.counts) == 1
    runs = tuple(sorted({*range(1, min(count, 4) + 1), count, *(round(count * share) for share in (0.5, 1.5, 2.0))} - {0}))
    curve = [_length(found, n, rng) for n in runs] if free else []
    return Forecast(joint_forecasts(found), outlook.effects, outlook.left_out, runs if free else (),
                    tuple(value for value, _ in curve), tuple(std for _, std in curve))


def joint_forecasts(found: Design) -> tuple[JointForecast, ...]:
    """Grades as `identify` gives them, from the precision before and after."""
    covariance = found.covariance
    before = np.sqrt(np.diag(np.linalg.inv(found.task.prior)))
    after = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(after, after) - np.eye(6)
    prior_std = found.task.domain.rig.cell.prior.log_std
    result = []
    for i in range(6):
        grade = "reliable" if after[i] <= RELIABLE_LOG_STD else "tentative"
        if after[i] / prior_std[i] > UNSEEN_SHRINKAGE:
            grade = "not identifiable"
        partner = int(np.argmax(np.abs(correlation[i])))
        trades = bool(abs(correlation[i, partner]) >= TRADE_OFF)
        result.append(JointForecast(i + 1, float(before[i]), float(after[i]), grade, partner + 1 if trades else 0,
                                    float(correlation[i, partner]) if trades else 0.0))
    return tuple(result)


def _length(found: Design, count: int, rng: np.random.Generator) -> tuple[float, float]:
    """Criterion and largest std of ln k of the best of a few exchanges with `count` runs; for its own length the plan."""
    task = found.task
    if count == len(task.demand):
        information = found.information
    else:
        demand = Demand(task.demand.groups, np.zeros(count, dtype=np.intp))
        pool = found.pool.joined(found.runs).joined(found.certificate.support)
        best = max((exchange(pool, task.criterion, task.prior, demand, rng, replicates=task.replicates) for _ in range(4)),
                   key=lambda one: one[1])
        information = task.prior + task.replicates * pool.take(best[0]).information.sum(axis=0)
    return (float(task.criterion.value(information)), float(np.sqrt(np.diag(np.linalg.inv(information)).max())))
