"""What is the diagnosis worth on load tests that its own simulator did not make?

    OMP_NUM_THREADS=1 python benchmarks/independent_twin.py --nulls N [--stratum S ...] [--design D ...] [--seed FIRST]
    OMP_NUM_THREADS=1 python benchmarks/independent_twin.py --cases N [--kind K ...] [--stratum S ...] [--design D ...] ...
    OMP_NUM_THREADS=1 python benchmarks/independent_twin.py --showing N [--stratum S ...] [--design D ...] [--seed FIRST]

tests/second_cell shares neither code nor laws with the packages or with the virtual cell: finite motions of a chain by screws,
rest as a minimum of energy, and for every effect mechanics of its own (Bouc-Wen and stick friction, smooth zones, lumped beams,
struts, feet, Kelvin-Voigt chains, balls). Seeds FIRST ... FIRST + N - 1, none skipped. Four robots, the arm's weight acts; half
of the cells know it (robot.yaml). --robot foreign: robots of nobody's, 0.4 to 1.3 times as long, that stand, lean or hang;
loads beside the TCP, gauges up to 12 times coarser (not with --showing).

--nulls, nothing hidden: alarms (verdict not adequate), names given, and how often the 95 % ellipsoid of the six ln k (as large
as the posterior's own draws make it) and its single intervals hold the truth. Alarms and names are listed one by one.

--cases, one effect of the dictionary (`single`), two (`pair`), one of no dictionary (`outside`), a gear that is softer near
zero in an arm whose weight nobody states (`play`), 0.5 to 2 times typical (--times LOW HIGH):
outcomes as in hidden_effects.py, over all, and over those whose signal, by the generator alone and with the springs free, is 5
(10) sigmas of the true noise at least. Then, for a named cause, 30 fresh poses with loads in any direction: the error of the
extended model against the robot's true motion, relative to the plain model's and to that of the dictionary's law told the
name; how often the stated 95 % hold single components and points. Listed: names that gain less than a tenth, wrong names, sets
without the truth, refusals.

--showing: what an `adequate` is worth. Where nothing is hidden the diagnosis says from which size on each cause would have been
noticed, in four of five cases; one of these (up to three typical sizes) is drawn and hidden at that size, a half and twice of
it, in the same load test: how often is it noticed?
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import beta, chi2

sys.path.insert(0, str(Path(__file__).parents[1]))

from identification.common.findings import CompstiffError
from identification.diagnosis.detect import REPLICATES
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.extended_model import extended_model
from identification.diagnosis.judgement import Judgement
from identification.fit.fitted_model import Term
from identification.fit.posterior import Posterior, posterior
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.effects import effects
from identification.model.effects_in_force import SPRINGS
from identification.model.stiffness import IdentifiedModel
from tests.runs.hidden_effects.judge import OUTCOMES, Answer, Names, Outcome, answer, judge, truth_names
from tests.second_cell.cell import FOREIGN, Case, Hidden, drawn, simulate
from tests.second_cell.detectable import CLEAR, DETECTABLE, signal
from tests.second_cell.effects import DICTIONARY, EFFECTS, OUTSIDE
from tests.second_cell.noise import STRATA
from tests.second_cell.plans import PLANS

# Bound to a row, a pose or a number of cycles that was found: nothing that a model could be told beforehand.
AT_A_PLACE = ("sensor_step", "encoder_zero", "transmission_error")
KINDS = {"single": (DICTIONARY, 1), "pair": (DICTIONARY, 2), "outside": (OUTSIDE, 1),
         "play": (("backlash", "soft_zone", "cubic_gear"), 1)}


@dataclass(frozen=True)
class Null:
    """Nothing hidden. rank: of the true ln k's distance among the posterior's draws; inside: single intervals that hold the
    truth; seconds: of `diagnose`."""

    seed: int
    robot: str
    answer: Answer
    outcome: Outcome
    p_value: float
    rank: float
    inside: int
    seconds: float


def diagnosed(case: Case, replicates: int = REPLICATES) -> Diagnosis:
    """The diagnosis of the case's files."""
    with tempfile.TemporaryDirectory() as folder:
        cell_file, table = case.write(Path(folder))
        cell = read_cell(cell_file)
        return diagnose(cell, read_measurements(table, cell.robot), replicates=replicates)


def coverage(case: Case, model: Posterior) -> tuple[float, int]:
    """Rank of the true springs' distance among the draws, and how many of the six 95 % intervals hold the truth."""
    truth, draws, weight = -np.log(case.stiffness), model.draws.x[:, SPRINGS], model.draws.weight
    information = np.linalg.inv(model.covariance[SPRINGS, SPRINGS])

    def distance(x: np.ndarray) -> np.ndarray:
        off = x - model.mean[SPRINGS]
        return np.asarray(np.einsum("...i,ij,...j->...", off, information, off))

    below = (draws < truth).T @ weight
    return float((distance(draws) < distance(truth)) @ weight), int(np.sum(np.abs(below - 0.5) <= 0.475))


def null(arguments: tuple[str, str, str | None, int]) -> Null:
    design, stratum, robot, seed = arguments
    case = simulate(seed, design, stratum, name=robot, weight=drawn(seed, design, DICTIONARY)[1])
    before = time.process_time()
    try:
        found = diagnosed(case)
    except CompstiffError as refused:
        return Null(seed, case.robot.name, Answer(f"refused: {refused.findings[0].code}"), "unknown", np.nan, np.nan, 0, np.nan)
    given = answer(found.as_dict())
    return Null(seed, case.robot.name, given, judge(frozenset(), given), found.judgement.detection.p_value,
                *coverage(case, found.judgement.plain), time.process_time() - before)


@dataclass(frozen=True)
class Fresh:
    """At fresh poses: RMS error [um] of the plain, the named and the told model (NaN: none can be told); of plain and named the
    share of components and of points inside the stated 95 %."""

    plain: float
    named: float
    told: float
    components: tuple[float, float]
    points: tuple[float, float]


@dataclass(frozen=True)
class Result:
    """Something hidden. signal: sigmas, see tests/second_cell/detectable.py; fresh: where something is named."""

    seed: int
    case: str
    truth: Names
    signal: float
    answer: Answer
    outcome: Outcome
    p_values: tuple[float, float | None]
    fresh: Fresh | None
    seconds: float


def one(arguments: tuple[str, str, str, tuple[float, float], str | None, int]) -> Result:
    design, stratum, kind, times, robot, seed = arguments
    names, count = KINDS[kind]
    hidden, weight = drawn(seed, design, names, count, times, robot)
    weight = "unknown" if kind == "play" else weight
    case = simulate(seed, design, stratum, hidden, robot, weight)
    truth = truth_names([part.truth for part in hidden])
    words = " + ".join(f"{part.effect}{[part.joint] if part.joint else ''} x{part.factor:.2f}" for part in hidden)
    words += f", {case.robot.name}, weight {weight}{', ' + str(case.setting) if robot else ''}"
    before = time.process_time()
    try:
        found = diagnosed(case)
    except CompstiffError as refused:
        said = Answer(f"refused: {refused.findings[0].code}")
        return Result(seed, words, truth, signal(case), said, "unknown", (np.nan, None), None, np.nan)
    seconds = time.process_time() - before
    given, judgement = answer(found.as_dict()), found.judgement
    adequacy = judgement.adequacy.p_value if judgement.adequacy else None
    return Result(seed, words, truth, signal(case), given, judge(truth, given), (judgement.detection.p_value, adequacy),
                  at_fresh_poses(case, found) if given.verdict == "named" else None, seconds)


def alone(fitted: Posterior, judgement: Judgement) -> IdentifiedModel:
    """A fitted model as if nothing else had been said of the rows."""
    return extended_model(Judgement("adequate", fitted, fitted, judgement.detection))


def at_fresh_poses(case: Case, found: Diagnosis) -> Fresh:
    """How the models do where nothing was measured; each pose is a visit of its own."""
    plan, moved = case.fresh()
    theta, wrench = plan.q, np.concatenate([plan.load, np.zeros_like(plan.load)], axis=1)
    judgement = found.judgement
    data, plain = judgement.plain.data, alone(judgement.plain, judgement)
    state = data.load_state(judgement.plain.compliance)
    entries = [(effects().get(hidden.truth["effect"]), hidden.truth["joint"]) for hidden in case.hidden]
    told = None
    if all(entry is not None and entry.parameters and entry.name not in AT_A_PLACE for entry, _ in entries):
        terms = tuple(Term(entry, joint, typical, typical, entry.neutral(state)) for entry, joint in entries if entry
                      for typical in [entry.typical(state, joint)])
        told = alone(posterior(data, terms), judgement)

    def tried(model: IdentifiedModel) -> tuple[float, float, float]:
        each = [model.predict(theta[k:k + 1], wrench[k:k + 1], dwell=plan.dwell[k:k + 1]) for k in range(len(theta))]
        off = np.array([position[0] for position, _, _ in each]) - moved
        covariance = np.array([spread[0, :3, :3] for _, _, spread in each])
        distance = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariance), off)
        inside = np.abs(off) <= 1.96 * np.sqrt(np.einsum("nii->ni", covariance))
        return 1e6 * float(np.sqrt(np.mean(off**2))), float(np.mean(inside)), float(np.mean(distance <= chi2.ppf(0.95, 3)))

    (before, *was), (after, *now) = tried(plain), tried(extended_model(judgement))
    return Fresh(before, after, tried(told)[0] if told else np.nan, (was[0], now[0]), (was[1], now[1]))


@dataclass(frozen=True)
class Shown:
    """A cause hidden at what it is said to be noticed from (typical sizes), times TIMES: whether it was."""

    seed: int
    case: str
    size: float
    noticed: tuple[bool, ...]


TIMES, LARGEST = (0.5, 1.0, 2.0), 3.0


def shown(arguments: tuple[str, str, int]) -> Shown | None:
    """None where nothing hidden alarms, or where no cause is in reach."""
    design, stratum, seed = arguments
    weight = drawn(seed, design, DICTIONARY)[1]
    quiet = diagnosed(simulate(seed, design, stratum, weight=weight))
    said = {(each.entry.effect.name, each.entry.joint): each.size for each in quiet.judgement.showing}
    places = [(name, joint) for name in DICTIONARY for joint in EFFECTS[name].joints or (0,)
              if said.get((EFFECTS[name].known_as, joint or None), LARGEST + 1) <= LARGEST]
    if quiet.verdict != "adequate" or not places:
        return None
    name, joint = places[int(np.random.default_rng([seed, 8]).integers(len(places)))]
    size = said[EFFECTS[name].known_as, joint or None]
    noticed = []
    for times in TIMES:
        try:
            noticed.append(diagnosed(simulate(seed, design, stratum, (Hidden(name, joint, times * size),), weight=weight)
                                     ).verdict != "adequate")
        except CompstiffError:
            noticed.append(True)
    return Shown(seed, f"{name}{[joint] if joint else ''}, weight {weight}", size, tuple(noticed))


def shown_report(title: str, results: Iterable[Shown | None]) -> None:
    tried = [r for r in results if r is not None]
    print(f"{title}: noticed at the size that is said, of {len(tried)}")
    for k, times in enumerate(TIMES):
        print(f"    {times:g} times that size: {share(sum(r.noticed[k] for r in tried), len(tried))}")
    for r in tried:
        if r.noticed != (False, True, True):
            print(f"    seed {r.seed}: {r.case}, from {r.size:.2g} typical: {r.noticed}")
    sys.stdout.flush()


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
    print(f"{design}, {stratum}: alarms {share(len(alarms), len(results))}, named {share(named, len(results))}; 95 "
          f"% ellipsoid {share(sum(one.rank <= 0.95 for one in results), len(results))}, single intervals "
          f"{share(sum(one.inside for one in results), 6 * len(results))}; {np.nanmean([r.seconds for r in results]):.2f} s")
    for one in alarms:
        print(f"    seed {one.seed} {one.robot}: {one.answer.verdict} p {one.p_value:.3f} {', '.join(sorted(one.answer.names))}"
              f"{' | ' + ', '.join(one.answer.alternatives[:5]) if one.answer.alternatives else ''}")
    sys.stdout.flush()


def outcomes_report(title: str, results: Sequence[Result]) -> None:
    counts = Counter(result.outcome for result in results)
    print(f"  {title}: {len(results)}")
    for outcome in OUTCOMES:
        if counts[outcome]:
            print(f"    {outcome:<16}{share(counts[outcome], len(results))}")


def cases_report(title: str, results: Iterable[Result]) -> None:
    results = list(results)
    print(title)
    outcomes_report("all", results)
    for least in (DETECTABLE, CLEAR):
        outcomes_report(f"signal of {least:g} sigma at least", [r for r in results if r.signal >= least])
    print("  by effect: right, truth in the set, other of those with a signal of 5 sigma")
    groups: dict[str, list[Result]] = defaultdict(list)
    for r in results:
        if r.signal >= DETECTABLE:
            groups["+".join(sorted({name.partition("[")[0] for name in r.truth}))].append(r)
    for name, mine in sorted(groups.items()):
        right, inside = (sum(r.outcome == kind for r in mine) for kind in ("right", "ambiguous in"))
        other = Counter(r.outcome for r in mine if r.outcome not in ("right", "ambiguous in"))
        print(f"    {name:<44}{right:>3}{inside:>3}   {', '.join(f'{key} {count}' for key, count in other.items())}")
    fresh_report([r for r in results if r.fresh is not None])
    print(f"  {np.nanmean([r.seconds for r in results]):.2f} s a case; what went wrong")
    for r in results:
        if r.outcome in ("wrong", "part", "ambiguous out") or r.answer.verdict.startswith("refused"):
            print(f"    seed {r.seed}: {r.case} [{r.signal:.0f} sigma]: {r.outcome}, {r.answer.verdict} "
                  f"{', '.join(sorted(r.answer.names))} | {', '.join(r.answer.alternatives[:5])}; p {r.p_values}")
    sys.stdout.flush()


def fresh_report(named: Sequence[Result]) -> None:
    """Of the cases with a name, right or wrong."""
    tried = [r.fresh for r in named if r.fresh]
    if not tried:
        return
    of_plain, of_named = (100 * np.mean([[one.components[k], one.points[k]] for one in tried], axis=0) for k in (0, 1))
    gain = np.array([one.named / one.plain for one in tried])
    told = [one.named / one.told for one in tried if one.told > 0] or [np.nan]
    print(f"  fresh poses, {len(tried)} named: error relative to the plain model's {np.median(gain):.2f} in the median, worst "
          f"{gain.max():.2f}, worse than plain {np.sum(gain > 1)}; relative to the told law's {np.median(told):.2f}")
    print(f"  inside the stated 95 %: components {of_named[0]:.0f} % (plain {of_plain[0]:.0f} %), points {of_named[1]:.0f} % "
          f"(plain {of_plain[1]:.0f} %)")
    for r in named:
        if r.fresh and r.fresh.named > 0.9 * r.fresh.plain:
            print(f"    seed {r.seed}: {r.case}: {r.outcome}; plain {r.fresh.plain:.1f}, named {r.fresh.named:.1f}, told "
                  f"{r.fresh.told:.1f} um; components inside {r.fresh.components[0]:.0%}, {r.fresh.components[1]:.0%}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nulls", type=int, default=0, metavar="N", help="data sets with nothing hidden, a design and stratum")
    parser.add_argument("--cases", type=int, default=0, metavar="N", help="data sets with something hidden, a design and kind")
    parser.add_argument("--showing", type=int, default=0, metavar="N", help="causes hidden at the size said to be noticed")
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=list(KINDS))
    parser.add_argument("--times", type=float, nargs=2, default=(0.5, 2.0), metavar=("LOW", "HIGH"), help="typical sizes")
    parser.add_argument("--stratum", choices=STRATA, nargs="+", help="default: all for nulls, near for cases")
    parser.add_argument("--design", choices=PLANS, nargs="+", default=list(PLANS))
    parser.add_argument("--seed", type=int, default=0, metavar="FIRST")
    parser.add_argument("--robot", choices=[FOREIGN], help="robots of nobody's, in any setting (tests/second_cell/setting.py)")
    parser.add_argument("--processes", type=int, default=1)
    wanted = parser.parse_args()
    with ProcessPoolExecutor(wanted.processes) as pool:
        for design in wanted.design:
            seeds = range(wanted.seed, wanted.seed + max(wanted.nulls, wanted.cases, wanted.showing))
            for stratum in (wanted.stratum or STRATA) if wanted.nulls else ():
                nulls_report(design, stratum, pool.map(
                    null, [(design, stratum, wanted.robot, seed) for seed in seeds[:wanted.nulls]]))
            for stratum in (wanted.stratum or ("near",)) if wanted.showing else ():
                shown_report(f"{design}, {stratum}", pool.map(
                    shown, [(design, stratum, seed) for seed in seeds[:wanted.showing]]))
            for kind in wanted.kind if wanted.cases else ():
                for stratum in wanted.stratum or ("near",):
                    jobs = [(design, stratum, kind, tuple(wanted.times), wanted.robot, seed) for seed in seeds[:wanted.cases]]
                    cases_report(f"{design}, {kind}, {stratum}", pool.map(one, jobs))


if __name__ == "__main__":
    main()
