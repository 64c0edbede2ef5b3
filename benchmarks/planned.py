"""Is it true what `design` says of a plan: which causes it names, notices and misses? And is criterion C worth its price?

    OMP_NUM_THREADS=1 python benchmarks/planned.py ROBOTS CASES --seed FIRST [--runs N] [--every-axis] [--free]

For each of ROBOTS robots and tools of tests/second_cell a plan by each criterion (D, C) with the same number of runs; then
CASES load tests of each plan, one effect hidden in each (0.5 to 2 times typical), the same for both, measured in the second
cell, which shares neither code nor laws with the package. The promise is the forecast's for that cause at that size, from the
package's prior and noise sheet: named, noticed or missed. Seeds FIRST on, none skipped.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.independent_twin import diagnosed, share
from identification.common.findings import CompstiffError
from identification.design.plan import DesignPlan
from identification.design.procedure import design_plan
from identification.design.request import Request
from identification.model.cell import read_cell
from tests.runs.hidden_effects.judge import OUTCOMES, Answer, Outcome, answer, judge, label, truth_names
from tests.second_cell.cell import Case, drawn, measured, simulate
from tests.second_cell.effects import DICTIONARY, EFFECTS
from tests.second_cell.plans import Plan

CRITERIA = ("D", "C")
# Not said: what hangs on the order of the visits.
PROMISES = ("named", "noticed", "missed", "not said")
SEEDS_A_ROBOT = 1000


@dataclass(frozen=True)
class Result:
    """One load test: what was promised of its cause, and what came."""

    criterion: str
    seed: int
    what: str
    promise: str
    outcome: Outcome
    answer: Answer


def planned(robot: Case, request: Request) -> tuple[DesignPlan, Plan]:
    """A plan for a robot, whose masses are known, and its rows as the second cell takes them."""
    with tempfile.TemporaryDirectory() as folder:
        plan = design_plan(read_cell(robot.write(Path(folder))[0]), request, quick=True)
    sheet = plan.sheet
    return plan, Plan(sheet.theta[sheet.visit], sheet.force, sheet.time, sheet.dwell, sheet.visit)


def promise(plan: DesignPlan, name: str, factor: float) -> str:
    """What the forecast says of a cause of `factor` typical sizes."""
    for cause in plan.forecast.causes:
        if label(cause.entry.effect.name, cause.entry.joint) == name:
            return "named" if cause.identifiable <= factor else "noticed" if cause.detectable <= factor else "missed"
    return "not said"


def one(robot: Case, criterion: str, plan: DesignPlan, rows: Plan, seed: int) -> Result:
    """The load test of a seed."""
    hidden, _ = drawn(seed, "cycles", [name for name in DICTIONARY if robot.robot.rod or not EFFECTS[name].rod])
    case = measured(seed, robot.robot, robot.tool, robot.stiffness, rows, hidden=hidden, weight="known")
    truth = truth_names([part.truth for part in hidden])
    words = f"{hidden[0].effect}{[hidden[0].joint] if hidden[0].joint else ''} x{hidden[0].factor:.2f}, {robot.robot.name}"
    said = promise(plan, next(iter(truth)), hidden[0].factor)
    try:
        given = answer(diagnosed(case).as_dict())
    except CompstiffError as refused:
        return Result(criterion, seed, words, said, "unknown", Answer(f"refused: {refused.findings[0].code}"))
    return Result(criterion, seed, words, said, judge(truth, given), given)


def report(plans: list[tuple[str, DesignPlan]], results: list[Result]) -> None:
    """The tables."""
    for criterion in CRITERIA:
        mine = [plan for name, plan in plans if name == criterion]
        named = [plan.forecast.counts["identifiable"] for plan in mine]
        least = [max(joint.after for joint in plan.forecast.joints) for plan in mine]
        print(f"criterion {criterion}: names by its forecast {np.mean(named):.1f} of {len(mine[0].forecast.causes)} causes on "
              f"average; least known stiffness to {100 * np.median(least):.1f} % (median)")
        for said in PROMISES:
            those = [r for r in results if r.criterion == criterion and r.promise == said]
            counts = Counter(r.outcome for r in those)
            print(f"  promised {said:<9} {len(those):>4}: right {share(counts['right'], len(those))}; "
                  + ", ".join(f"{name} {counts[name]}" for name in OUTCOMES if counts[name] and name != "right"))
        those = [r for r in results if r.criterion == criterion]
        print(f"  of all: right {share(sum(r.outcome == 'right' for r in those), len(those))}")
    for r in results:
        if r.outcome in ("wrong", "ambiguous out") or (r.promise == "named" and r.outcome != "right"):
            print(f"    {r.criterion} {r.seed}: {r.what}: promised {r.promise}, {r.outcome}, {r.answer.verdict} "
                  f"{', '.join(sorted(r.answer.names))} | {', '.join(r.answer.alternatives[:4])}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", type=int)
    parser.add_argument("cases", type=int)
    parser.add_argument("--seed", type=int, required=True, metavar="FIRST")
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--every-axis", action="store_true")
    parser.add_argument("--free", action="store_true")
    wanted = parser.parse_args()
    plans, results = [], []
    for number in range(wanted.robots):
        first = wanted.seed + number * SEEDS_A_ROBOT
        robot = simulate(first, weight="known")
        for criterion in CRITERIA:
            plan, rows = planned(robot, Request(
                measurements=wanted.runs, criterion=criterion, every_axis=wanted.every_axis, free=wanted.free))
            plans.append((criterion, plan))
            results += [one(robot, criterion, plan, rows, first + k) for k in range(wanted.cases)]
        print(number + 1, robot.robot.name, [plan.forecast.counts for _, plan in plans[-2:]], file=sys.stderr, flush=True)
    report(plans, results)


if __name__ == "__main__":
    main()
