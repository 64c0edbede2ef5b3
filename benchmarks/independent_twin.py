"""What is the diagnosis worth on load tests that its own simulator did not make? tests/second_cell shares neither code nor laws
with the packages or with the virtual cell: finite motions of a chain by screws, rest as a minimum of energy.

    OMP_NUM_THREADS=1 python benchmarks/independent_twin.py --nulls N [--stratum S ...] [--design D ...] [--seed FIRST]

Nothing hidden: alarms (verdict not adequate), names given, and how often the 95 % ellipsoid of the six ln k (as large as the
posterior's own draws make it) and its single intervals hold the truth. Seeds FIRST ... FIRST + N - 1, none skipped; alarms and
names are listed one by one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.common.findings import CompstiffError
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.fit.posterior import Posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects_in_force import SPRINGS
from tests.runs.hidden_effects.judge import Answer, Outcome, answer, judge
from tests.second_cell.cell import Case, simulate
from tests.second_cell.noise import STRATA
from tests.second_cell.plans import PLANS


@dataclass(frozen=True)
class Null:
    """A load test with nothing hidden. rank: of the true ln k's distance among the posterior's draws; inside: single intervals
    that hold the truth; seconds: of `diagnose`."""

    seed: int
    robot: str
    answer: Answer
    outcome: Outcome
    p_value: float
    rank: float
    inside: int
    seconds: float


def diagnosed(case: Case) -> Diagnosis:
    """The diagnosis of the case's files."""
    with tempfile.TemporaryDirectory() as folder:
        cell_file, table = case.write(Path(folder))
        cell = read_cell(cell_file)
        return diagnose(cell, read_measurements(table, cell.robot))


def coverage(case: Case, model: Posterior) -> tuple[float, int]:
    """Rank of the true springs' distance among the draws, and how many of the six 95 % intervals hold the truth."""
    truth, draws, weight = -np.log(case.stiffness), model.draws.x[:, SPRINGS], model.draws.weight
    information = np.linalg.inv(model.covariance[SPRINGS, SPRINGS])

    def distance(x: np.ndarray) -> np.ndarray:
        off = x - model.mean[SPRINGS]
        return np.asarray(np.einsum("...i,ij,...j->...", off, information, off))

    below = (draws < truth).T @ weight
    return float((distance(draws) < distance(truth)) @ weight), int(np.sum(np.abs(below - 0.5) <= 0.475))


def null(arguments: tuple[str, str, int]) -> Null:
    design, stratum, seed = arguments
    case = simulate(seed, design, stratum)
    before = time.process_time()
    try:
        found = diagnosed(case)
    except CompstiffError as refused:
        return Null(seed, case.robot.name, Answer(f"refused: {refused}"), "unknown", np.nan, np.nan, 0, np.nan)
    given = answer(found.as_dict())
    return Null(seed, case.robot.name, given, judge(frozenset(), given), found.judgement.detection.p_value,
                *coverage(case, found.judgement.plain), time.process_time() - before)


def share(count: int, total: int) -> str:
    """Percent with the exact 95 % binomial band."""
    if total == 0:
        return "-"
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    return f"{count}/{total} = {100 * count / total:.1f} % ({100 * low:.0f}-{100 * high:.0f})"


def nulls_report(design: str, stratum: str, results: Iterable[Null]) -> None:
    results = list(results)
    alarms = [one for one in results if one.outcome != "quiet"]
    named = sum(one.outcome == "wrong" for one in alarms)
    print(f"{design}, {stratum}: alarms {share(len(alarms), len(results))}, named {share(named, len(results))}; "
          f"95 % ellipsoid {share(sum(one.rank <= 0.95 for one in results), len(results))}, single intervals "
          f"{share(sum(one.inside for one in results), 6 * len(results))}; {np.nanmean([one.seconds for one in results]):.2f} s")
    for one in alarms:
        print(f"    seed {one.seed} {one.robot}: {one.answer.verdict} p {one.p_value:.3f} {', '.join(sorted(one.answer.names))}"
              f"{' | ' + ', '.join(one.answer.alternatives[:5]) if one.answer.alternatives else ''}")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nulls", type=int, default=0, metavar="N", help="data sets with nothing hidden, a design and stratum")
    parser.add_argument("--stratum", choices=STRATA, nargs="+", default=list(STRATA))
    parser.add_argument("--design", choices=PLANS, nargs="+", default=list(PLANS))
    parser.add_argument("--seed", type=int, default=0, metavar="FIRST")
    parser.add_argument("--processes", type=int, default=1)
    wanted = parser.parse_args()
    with ProcessPoolExecutor(wanted.processes) as pool:
        for design in wanted.design:
            for stratum in wanted.stratum:
                jobs = [(design, stratum, seed) for seed in range(wanted.seed, wanted.seed + wanted.nulls)]
                nulls_report(design, stratum, pool.map(null, jobs))


if __name__ == "__main__":
    main()
