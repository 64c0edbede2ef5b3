"""Does `compstiff diagnose` find what is hidden in the data? The virtual cell hides an effect, the diagnosis is judged.

    OMP_NUM_THREADS=1 python benchmarks/hidden_effects.py [CASES] [FIRST_SEED] [--design DESIGN] [--noise STRATUM]

Seeds FIRST_SEED … FIRST_SEED + CASES - 1, none skipped, for every design (paper5, poses20, ladder12: tests/virtual_cell) and
four kinds of data: one effect of the dictionary, drawn with joint and size (0.5 to 2 times typical); nothing hidden; an effect
that the dictionary does not know; two effects at once. Poses, stiffnesses and noise are the same for all kinds of one seed; the
noise is realistic and the cell file states it only nominally; --noise takes another stratum of tests/virtual_cell/noise.py. Six
further poses, three loads each, are kept for validation.

Before anything is diagnosed, the noise-free truth says what the data could tell (tests/runs/hidden_effects/visible.py). Tables
come first over everything that was drawn, then over what the design can identify at all. Brackets: 95 % binomial band.
Baselines, on the same data, for single effects, under the stated sigma alone: `t-tests` 5 % each, the strongest is the name;
`max-GLR` the same with Bonferroni's threshold; `BIC` one effect or none, sigma estimated. How many further loads a set of
names takes until one is certain: benchmarks/next_loads.py. --scheduler: on a cluster (pool.py).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta, chi2

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.pool import pool, pool_options
from identification.diagnosis.diagnose import Diagnosis, diagnose
from identification.diagnosis.dictionary import dictionary_of
from identification.diagnosis.projection import Base, scores
from identification.fit.fitted_model import response
from identification.fit.load_test import LoadTest
from identification.fit.noise import noise_model
from identification.fit.noise_parts import VarianceComponents
from identification.fit.posterior import Posterior
from identification.measurements import Measurements, read_measurements
from identification.model.cell import Cell, read_cell
from identification.model.effects import effects
from identification.model.effects_in_force import SPRINGS
from tests.runs.hidden_effects.cases import KINDS, hidden_in
from tests.runs.hidden_effects.judge import OUTCOMES, Answer, Names, Outcome, answer, judge, label, truth_names
from tests.runs.hidden_effects.oracle import OTHER_LAW, oracle, squares_left
from tests.runs.hidden_effects.visible import Visible, visible
from tests.virtual_cell.cell import Case, simulate
from tests.virtual_cell.noise import STRATA

DESIGNS = ("ladder12", "poses20", "paper5")
BASELINES = ("t-tests", "max-GLR", "BIC")
VALIDATION_POSES = 6
OUTSIDE_FAMILY = "(none)"
INSIDE = float(chi2.ppf(0.95, 6))


@dataclass(frozen=True)
class Held:
    """Sums of squares [um^2] over the validation rows: plain model, named model (plain where none is named), oracle."""

    plain: float
    named: float
    oracle: float


@dataclass(frozen=True)
class Result:
    """One case. distance: squared, of the true ln k in the stated covariance, plain and extended; singles: share of the six
    95 % intervals that hold the truth, likewise; parameters: standardised errors; baselines: what each answers; seconds: of
    `diagnose`."""

    seed: int
    kind: str
    truth: Names
    factors: tuple[float, ...]
    seen: tuple[Visible, ...]
    answer: Answer
    outcome: Outcome
    p_values: tuple[float, float | None]
    held: Held | None
    distance: tuple[float, float]
    singles: tuple[float, float]
    parameters: tuple[float, ...]
    baselines: tuple[Answer, ...]
    seconds: float

    def covered(self, which: int) -> bool:
        """Whether the 95 % ellipsoid holds the true stiffnesses: of the plain model (0), of the extended one (1)."""
        return self.distance[which] <= INSIDE

    @property
    def detectable(self) -> bool:
        return any(one.detectable for one in self.seen)

    @property
    def identifiable(self) -> bool:
        return bool(self.seen) and all(one.identifiable for one in self.seen)


def one(arguments: tuple[str, str, str, int]) -> Result:
    design, noise, kind, seed = arguments
    case = simulate(seed, design, hidden_in(seed, kind), noise, validation=VALIDATION_POSES)
    seen = tuple(visible(case)) if case.hidden else ()
    with tempfile.TemporaryDirectory() as folder:
        cell_file, file = case.write(folder)
        cell = read_cell(cell_file)
        measurements = read_measurements(file, cell.robot)
    before = time.perf_counter()
    found = diagnose(cell, measurements)
    seconds = time.perf_counter() - before
    given = answer(found.as_dict())
    truth = truth_names(case.truth)
    outcome = judge(truth, given)
    judgement = found.judgement
    models = (judgement.plain, judgement.carried or judgement.plain)
    adequacy = judgement.adequacy.p_value if judgement.adequacy else None
    return Result(
        seed, kind, truth, tuple(hidden.factor for hidden in case.hidden), seen, given, outcome,
        (judgement.detection.p_value, adequacy),
        held_out(cell, measurements, case, found) if kind in ("single", "pair") else None,
        *coverage(case, models), standardised(case, found) if outcome == "right" else (), baselines(cell, measurements, found),
        seconds)


def held_out(cell: Cell, measurements: Measurements, case: Case, found: Diagnosis) -> Held | None:
    """Squares left on the validation rows, beside those of the model that is told the true effects."""
    informed, judgement = oracle(cell, measurements, case), found.judgement
    if informed is None:
        return None
    return Held(*(squares_left(measurements, model) for model in (
        judgement.plain, judgement.carried or judgement.plain, informed)))


def coverage(case: Case, models: Sequence[Posterior]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Of each model: squared distance of the true ln k, and the share of single 95 % intervals that hold it."""
    distance, singles = [], []
    for model in models:
        off, covariance = model.mean[SPRINGS] + np.log(case.stiffness), model.covariance[SPRINGS, SPRINGS]
        distance.append(float(off @ np.linalg.solve(covariance, off)))
        singles.append(float(np.mean(np.abs(off) <= 1.96 * np.sqrt(np.diag(covariance)))))
    return (distance[0], distance[1]), (singles[0], singles[1])


def standardised(case: Case, found: Diagnosis) -> tuple[float, ...]:
    """Errors of the named effects' parameters in stated standard deviations, where the hidden law is the dictionary's."""
    errors, place = [], 6
    true = {label(truth["effect"], truth["joint"]): truth["parameters"] for truth in case.truth}
    model = found.judgement.extended
    for term in model.terms:
        for k, parameter in enumerate(term.effect.parameters, start=place):
            values = true.get(label(term.effect.name, term.joint), {})
            if term.effect.name not in OTHER_LAW and parameter.name in values:
                off = model.mean[k] - values[parameter.name]
                if parameter.unit == "rad" and parameter.shape:
                    off = (off + np.pi) % (2 * np.pi) - np.pi
                errors.append(float(off / np.sqrt(model.covariance[k, k])))
        place += len(term.effect.parameters)
    return tuple(errors)


def baselines(cell: Cell, measurements: Measurements, found: Diagnosis) -> tuple[Answer, ...]:
    """The answers of BASELINES: no force error, no re-seating, no weights; linear about the plain fit."""
    rows = measurements.select(~measurements.validate)
    nothing = np.zeros(3)
    white = replace(cell, noise=replace(cell.noise, force=nothing, force_relative=0.0, pose_offset=nothing, force_stated=True,
                                        offset_stated=True))
    x, data = found.judgement.plain.map, LoadTest.of(white, rows)
    noise = noise_model(data, np.exp(x))
    position, slope = response(data, x)
    residual = np.einsum("nij,nj->ni", noise.whitening, np.nan_to_num(rows.deflection) - position)
    base = Base(noise.whitening @ slope, residual, noise.weights(VarianceComponents()), 1e-6 * np.eye(6), np.zeros(6))
    dictionary = dictionary_of(data.load_state(np.exp(x)), noise, effects())
    ratio = np.where(scores(base, dictionary).visible, scores(base, dictionary).ratio, 0.0)
    free = residual.reshape(-1) - base.design.reshape(-1, 6) @ base.step(residual)
    names = [label(dictionary.entries[k].effect.name, dictionary.entries[k].joint) for k in dictionary.entry_of]
    p_value = chi2.sf(ratio, dictionary.widths)
    strongest, count, squares = int(np.argmin(p_value)), free.size, float(free @ free)
    worth = (count * np.log(squares / np.maximum(squares - ratio, 1e-9 * squares))
             - dictionary.widths * np.log(count))

    def said(significant: bool, which: int) -> Answer:
        return Answer("named", frozenset([names[which]])) if significant else Answer("adequate")

    best = int(np.argmax(worth))
    return (said(p_value[strongest] < 0.05, strongest), said(p_value[strongest] < 0.05 / len(p_value), strongest),
            said(worth[best] > 0, best))


def share(count: int, total: int) -> str:
    """Percent with the exact 95 % binomial band."""
    if total == 0:
        return "-"
    low = beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    return f"{count}/{total} = {100 * count / total:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def rate(results: Sequence[Result], true: Callable[[Result], bool]) -> str:
    return share(sum(map(true, results)), len(results))


def outcomes_table(title: str, results: Sequence[Result]) -> None:
    print(f"  {title}: {len(results)} cases")
    counts = Counter(result.outcome for result in results)
    for outcome in OUTCOMES:
        if counts[outcome]:
            print(f"    {outcome:<16}{share(counts[outcome], len(results))}")


def singles_report(results: Sequence[Result]) -> None:
    outcomes_table("one effect of the dictionary, all that were drawn", results)
    can = [result for result in results if result.identifiable]
    outcomes_table("of these, what the design can identify at all", can)
    print(f"    target, at least 80 % named right: {rate(can, lambda r: r.outcome == 'right')}")
    detected = [result for result in results if result.outcome != "missed"]
    print(f"  truth in the set, of detected: {rate(detected, lambda r: r.outcome in ('right', 'ambiguous in'))}")
    shown: dict[str, list[Result]] = defaultdict(list)
    for result in results:
        shown[next(iter(result.truth))].append(result)
    print("  drawn: identifiable, detectable only, too small or taken for a stiffness (named right of the identifiable)")
    for name in sorted(shown):
        mine = shown[name]
        good = [r for r in mine if r.identifiable]
        only = sum(r.detectable for r in mine) - len(good)
        near = Counter(other for r in mine if r.detectable for other in r.seen[0].others).most_common(3)
        right = f"({sum(r.outcome == 'right' for r in good)}/{len(good)})" if good else ""
        print(f"    {name:<28}{len(good):>3}{only:>3}{len(mine) - len(good) - only:>3}  {right:<8}"
              f"{'like ' + ', '.join(f'{other} {count}' for other, count in near) if near else ''}")


def confusion(results: Iterable[Result]) -> None:
    """By family: rows what was hidden, columns the likeliest name of the answer, whether alone or first of a set."""
    def family(name: str | None) -> str:
        return OUTSIDE_FAMILY if name is None else effects()[name.partition("[")[0]].family

    table: dict[str, Counter[str]] = defaultdict(Counter)
    for result in results:
        row = family(next(iter(result.truth)))
        silent = result.answer.verdict if result.answer.verdict in ("adequate", "unknown") else ""
        table[row][silent or family(result.answer.likeliest)] += 1
    columns = [*sorted({entry.family for entry in effects().values()}), "adequate", "unknown"]
    print("  likeliest name by family (rows: hidden)\n" + " " * 26 + "".join(f"{name[:10]:>12}" for name in columns))
    for row in sorted(table):
        print(f"    {row:<22}" + "".join(f"{table[row][column] or '.':>12}" for column in columns))


def gains(results: Sequence[Result]) -> None:
    """Held out: how much of what the oracle takes away the named model takes away, summed over cases."""
    known = [r for r in results if r.held is not None]
    for title, chosen in (("named right", [r for r in known if r.outcome == "right"]),
                          ("all identifiable", [r for r in known if r.identifiable])):
        if not chosen:
            continue
        plain, named, oracle = np.array([(r.held.plain, r.held.named, r.held.oracle) for r in chosen]).T
        clear = plain > 1.1 * oracle
        enough = int(np.sum((plain - named)[clear] >= 0.8 * (plain - oracle)[clear]))
        print(f"  held out, {title}: RMS plain : named : oracle = 1 : {np.sqrt(named.sum() / plain.sum()):.3f} : "
              f"{np.sqrt(oracle.sum() / plain.sum()):.3f}; at least 80 % of the oracle's gain where that is over 10 % of the "
              f"squares: {share(enough, int(clear.sum()))}")


def coverages(results: Sequence[Result]) -> None:
    named = [r for r in results if r.outcome == "right"]
    for title, chosen in (("detectable", [r for r in results if r.detectable]), ("named right", named)):
        print(f"  95 % of the stiffnesses, {title}: ellipsoid {rate(chosen, lambda r: r.covered(0))} before, "
              f"{rate(chosen, lambda r: r.covered(1))} after; single intervals "
              + " and ".join(f"{100 * np.mean([r.singles[k] for r in chosen]):.0f} %" for k in (0, 1) if chosen))
    errors = np.abs(np.array([error for r in named for error in r.parameters]))
    print(f"  parameters of right names within 1.96 std: {share(int(np.sum(errors < 1.96)), len(errors))}, "
          f"within 3: {share(int(np.sum(errors < 3)), len(errors))}")


def rest_report(of: dict[str, list[Result]]) -> None:
    null, outside, pair = of["null"], of["outside"], of["pair"]
    print(f"  false alarms on null data: {rate(null, lambda r: r.outcome != 'quiet')}, a name given: "
          f"{rate(null, lambda r: r.outcome == 'wrong')}; ellipsoid there {rate(null, lambda r: r.covered(0))}")
    detected = [r for r in outside if r.answer.verdict != "adequate"]
    print(f"  outside the dictionary: detected {share(len(detected), len(outside))}; of these unknown "
          f"{rate(detected, lambda r: r.outcome == 'unknown')}, a name {rate(detected, lambda r: r.outcome == 'wrong')}, a set "
          f"{rate(detected, lambda r: r.answer.verdict == 'ambiguous')}")
    can = [r for r in outside if r.identifiable]
    print(f"    of {len(can)} that the design can tell from every single entry: unknown "
          f"{rate(can, lambda r: r.outcome == 'unknown')}, a name {rate(can, lambda r: r.outcome == 'wrong')}, missed "
          f"{rate(can, lambda r: r.outcome == 'missed')}")
    outcomes_table("pairs, all that were drawn (right: both named, part: one)", pair)
    outcomes_table("pairs of which both can be identified", [r for r in pair if r.identifiable])


def baselines_report(of: dict[str, list[Result]]) -> None:
    print("  baselines (compare: false alarms, right and wrong names above)")
    for k, name in enumerate(BASELINES):
        verdicts = [judge(r.truth, r.baselines[k]) for r in of["single"]]
        right, wrong = (share(verdicts.count(kind), len(verdicts)) for kind in ("right", "wrong"))
        alarms = rate(of["null"], lambda r, k=k: r.baselines[k].verdict != "adequate")
        print(f"    {name:<10}false alarms {alarms}, single effects right {right}, wrong {wrong}")


def mistakes(results: Iterable[Result]) -> None:
    """Every wrong name and every set without the truth (outside the dictionary and on null data: every name and every set),
    what was not named though it could be, and right names whose stiffnesses are off."""
    for r in results:
        lost = r.kind != "outside" and r.identifiable and r.outcome not in ("right", "part")
        off = r.outcome == "right" and not r.covered(1)
        alarm = not r.truth and r.outcome != "quiet"
        if not (r.outcome in ("wrong", "ambiguous out") or lost or off or alarm):
            continue
        seen = "; ".join(f"{one.label} signal {one.signal:.1f} own {one.own:.1f} left {one.left:.1f}" for one in r.seen)
        factors = ", ".join(f"{factor:.2f}" for factor in r.factors)
        print(f"    seed {r.seed} {r.kind}: {', '.join(sorted(r.truth)) or 'nothing'} x {factors} [{seen}] answered "
              f"{r.outcome}{f', ln k off by {r.distance[1]:.1f} of {INSIDE:.1f}' if off else ''}: "
              f"{', '.join(sorted(r.answer.names)) or '-'}; alternatives {', '.join(r.answer.alternatives[:4])}; "
              f"p {r.p_values}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="?", type=int, default=60, metavar="CASES")
    parser.add_argument("first", nargs="?", type=int, default=0, metavar="FIRST_SEED")
    parser.add_argument("--design", choices=DESIGNS, action="append")
    parser.add_argument("--noise", choices=("realistic", *STRATA), default="realistic")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only these kinds of data")
    pool_options(parser)
    options = parser.parse_args()
    with pool(options) as workers:
        for design in options.design or DESIGNS:
            jobs = [(design, options.noise, kind, seed) for kind in options.kind or KINDS
                    for seed in range(options.first, options.first + options.cases)]
            of: dict[str, list[Result]] = {kind: [] for kind in KINDS}
            for result in workers.map(one, jobs):
                of[result.kind].append(result)
            everything = [result for kind in KINDS for result in of[kind]]
            print(f"{design}, {options.noise}: {options.cases} cases of each kind, seeds from {options.first}", flush=True)
            if of["single"]:
                singles_report(of["single"])
                confusion(of["single"])
                gains(of["single"])
                coverages(of["single"])
            rest_report(of)
            baselines_report(of)
            seconds = [result.seconds for result in everything]
            print(f"  seconds a case: {np.mean(seconds):.1f} mean, {np.max(seconds):.1f} most")
            print("  what went wrong")
            mistakes(everything)
            print(flush=True)


if __name__ == "__main__":
    main()
