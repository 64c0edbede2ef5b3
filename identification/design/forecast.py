"""What a plan will tell, before anything is measured: stiffnesses, causes, and what more or fewer runs would change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.quantities import two_sigma
from identification.design.domain import Pool
from identification.design.exchange import exchange
from identification.design.search import Design
from identification.design.sheet import Sheet, as_measurements
from identification.design.stated_covariance import largest_log_std, stated_covariance
from identification.design.task import Demand
from identification.diagnosis.plan import Outlook, judge_plan, not_told_apart
from identification.fit.identifiability import RELIABLE_LOG_STD, TRADE_OFF, UNSEEN_SHRINKAGE
from identification.measurements import Measurements

Array = NDArray[np.float64]
# So many causes that are not told apart are named.
MOST_ALIKE = 6
# docs/benchmarks/stiffness.md, "What a plan promises": 38 of 45.
BORNE_OUT = "An independent simulation kept 8 in 10 of such promises"


def spread(log_std: float) -> str:
    """Two sigma of ln k in words: a percentage while that is one."""
    wide = two_sigma(log_std)
    return f"to {100 * wide:.2g} %" if wide < 0.3 else f"within a factor {np.exp(wide):.2g}"


@dataclass(frozen=True)
class JointForecast:
    """std of ln k before and after, grade as `identify` will give it, the joint (1-based) it trades off with, 0 where none."""

    joint: int
    before: float
    after: float
    grade: str
    partner: int
    correlation: float

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"name": f"k{self.joint}", "log_std_before": self.before, "log_std_after": self.after, "grade": self.grade,
                "trades_off_with": f"k{self.partner}" if self.partner else None, "correlation": self.correlation}


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
        return {grade: sum(cause.grade == grade for cause in self.causes)
                for grade in ("identifiable", "detectable", "invisible")}

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {
            "joints": [joint.as_dict() for joint in self.joints],
            "causes": {"counts": self.counts, "effects": [cause.as_dict() for cause in self.causes],
                       "not_offered": self.left_out},
            "by_measurements": [{"measurements": n, "criterion": value, "largest_log_std": std}
                                for n, value, std in zip(self.runs, self.values, self.stds, strict=True)],
        }

    def joint_lines(self) -> list[str]:
        """How well each stiffness will be known."""
        lines = []
        for joint in self.joints:
            trade = f", trades off with k{joint.partner} ({joint.correlation:+.2f})" if joint.partner else ""
            lines.append(f"k{joint.joint}  known {spread(joint.after)} (2 sigma; before {spread(joint.before)}), "
                         f"{joint.grade}{trade}")
        return lines

    def cause_lines(self, before: str = "") -> list[str]:
        """Which causes will be named; before: what else is looked at with the plan, in words."""
        counts, alike = self.counts, not_told_apart(self.causes)
        lines = [f"of {len(self.causes)} possible causes at their typical size this plan{before} names "
                 f"{counts['identifiable']}, only notices {counts['detectable']} and misses {counts['invisible']} "
                 f"(sizes: compstiff diagnose --plan). {BORNE_OUT}"]
        if not alike:
            return lines
        more = [f"  and {len(alike) - MOST_ALIKE} more: compstiff diagnose --plan has them all"] * (len(alike) > MOST_ALIKE)
        return [*lines, "noticed at their typical size but not told apart:", *(f"  {one}" for one in alike[:MOST_ALIKE]), *more]

    def length_lines(self) -> list[str]:
        """What plans of other lengths would tell; empty where that is not known."""
        if not self.runs:
            return []
        return ["largest uncertainty of a stiffness (2 sigma) by number of runs, each planned for the criterion: " + ", ".join(
            f"{n}: {spread(std).removeprefix('to ').removeprefix('within ')}"
            for n, std in zip(self.runs, self.stds, strict=True))]


def forecast(design: Design, sheet: Sheet, measured: Measurements | None, rng: np.random.Generator) -> Forecast:
    """The forecast of a plan with these rows, taken after those that are measured already, if any."""
    planned = as_measurements(sheet)
    if measured is not None:
        planned = measured.followed_by(planned)
    outlook = judge_plan(design.task.domain.rig.cell, planned)
    count = len(design.task.demand)
    free = len(design.task.demand.counts) == 1
    runs = tuple(sorted({*range(1, min(count, 4) + 1), count, *(round(count * share) for share in (0.5, 1.5, 2.0))} - {0}))
    curve = [_of_length(design, n, rng) for n in runs] if free else []
    return Forecast(joint_forecasts(design), outlook.effects, outlook.left_out, runs if free else (),
                    tuple(value for value, _ in curve), tuple(std for _, std in curve))


def joint_forecasts(design: Design) -> tuple[JointForecast, ...]:
    """Grades as `identify` gives them, from the covariance before and after."""
    covariance = stated_covariance(design.task, design.runs)
    before = np.sqrt(np.diag(np.linalg.inv(design.task.prior)))
    after = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(after, after) - np.eye(6)
    prior_std = design.task.domain.rig.cell.prior.log_std
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


def _of_length(design: Design, count: int, rng: np.random.Generator) -> tuple[float, float]:
    """Criterion and largest std of the ln k that the loads can show, of the best of a few exchanges with `count` runs; for its
    own length the plan."""
    task, runs = design.task, design.runs
    if count != len(task.demand):
        task = replace(task, demand=Demand(task.demand.groups, np.zeros(count, dtype=np.intp)))
        pool = Pool.of([design.pool, design.runs, design.certificate.support])
        best, _ = max((exchange(task, pool, rng) for _ in range(4)), key=lambda plan: plan[1])
        runs = pool.take(best)
    return task.value(runs), largest_log_std(task, runs)
