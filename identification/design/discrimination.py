"""Runs after a diagnosis that could not decide (discrimination between rival models): those under which the rivals, each fitted
to what was measured, differ most.

The rivals are fitted again from the measurements, among the names that diagnosis.json lists; the choice among the admissible
runs is diagnosis/discrimination.py's. Where fewer runs than asked for leave hardly any doubt, the others are the criterion's.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from identification.common.findings import Finding, error, verb
from identification.design.certificate import certify
from identification.design.domain import Pool, random_pool
from identification.design.exchange import many_exchanges
from identification.design.search import Design, Effort, best_refined
from identification.design.sheet import DWELL_S
from identification.design.task import Demand, Task
from identification.diagnosis.blocks import in_blocks
from identification.diagnosis.discrimination import Rivals, Separation, discriminating, planned_rows, rivals_of, separation
from identification.diagnosis.naming import converged
from identification.diagnosis.record import FORMAT, VERDICTS
from identification.diagnosis.share import share_of
from identification.fit.load_test import LoadTest
from identification.fit.posterior import posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects

Array = NDArray[np.float64]
# Poses that are compared, and the bound on the probability of a wrong name under which more runs decide nothing.
POSES = 150
DECIDED = 0.02
# Two rivals that no run separates by more sigmas than this are the same for the plan.
ALIKE_SIGMAS = 1.0
# Above this probability of a wrong name it is said what else may help.
DOUBTFUL = 0.1


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """What diagnosis.json says: verdict, and of an ambiguous one the names (effect, joint) with their probabilities; bad_rows:
    rows it left out."""

    verdict: str
    names: tuple[tuple[str, int | None], ...]
    bad_rows: tuple[int, ...]
    source: str


@dataclass(frozen=True, eq=False)
class Discrimination:
    """What the runs are expected to decide. names, probability (R): the rivals. before, after: bound on the probability of the
    wrong name among them without and with the runs. runs: how many of the plan's were chosen for it. pairs: of rivals, with the
    sigmas by which the whole plan separates them, the least separated first."""

    names: tuple[str, ...]
    probability: Array
    before: float
    after: float
    runs: int
    pairs: tuple[tuple[str, str, float], ...]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        rivals = zip(self.names, self.probability, strict=True)
        return {"rivals": [{"name": name, "probability": float(p)} for name, p in rivals],
                "wrong_name_at_most": {"before": self.before, "after": self.after}, "runs": self.runs,
                "pairs": [{"rivals": [first, second], "expected_sigmas": sigmas} for first, second, sigmas in self.pairs]}

    def lines(self) -> list[str]:
        """In plain words."""
        rivals = ", ".join(f"{name} {p:.2f}" for name, p in zip(self.names, self.probability, strict=True))
        lines = [f"{self.runs} of the runs {verb(self.runs, 'were')} chosen to tell apart: {rivals}",
                 f"the wrong one of these is named with a probability of {_share(self.after)} at most afterwards "
                 f"(without them {_share(self.before)}), if one of them is the truth"]
        lines += [f"  {first} and {second} stay alike: {sigmas:.1f} sigma apart" for first, second, sigmas in self.pairs
                  if sigmas < ALIKE_SIGMAS]
        if self.after > DOUBTFUL:
            lines.append("  more runs, more room (--box), --direction free or the checks that the diagnosis names may settle "
                         "more")
        return lines


def _share(value: float) -> str:
    return f"{100 * value:.0f} %" if value >= 0.01 else "under 1 %"


class _Rival(BaseModel):
    effect: str
    joint: int | None


class _Row(BaseModel):
    estimate: Annotated[int, Field(ge=0, le=10**9)]


class _Parameters(BaseModel):
    single_row: _Row | None = None


class _Cause(BaseModel):
    parameters: _Parameters = _Parameters()


class _Bad(BaseModel):
    rows: list[Annotated[int, Field(ge=0, le=10**9)]]


class _Visits(BaseModel):
    bad: list[_Bad] = []


class _DiagnosisFile(BaseModel):
    """What of diagnosis.json counts for the next loads."""

    verdict: str
    alternatives: list[_Rival] = []
    causes: list[_Cause] = []
    visits: _Visits | None = None


def read_diagnosis(file: Path, cell: Cell, *, for_loads: bool = True) -> Diagnosed:
    """diagnosis.json of this robot; for_loads: of load tests. Raises CompstiffError (CS1650) for another file or another
    robot's."""
    try:
        content = json.loads(file.read_bytes())
    except OSError as problem:
        raise error("CS0005", f"cannot be read: {problem.strerror}", file=str(file)) from problem
    except (ValueError, RecursionError) as problem:
        raise error("CS1650", f"not a diagnosis file: {problem}", file=str(file),
                    hint="give what compstiff diagnose -o wrote") from problem
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise error("CS1650", f"not a diagnosis file: its format is not {FORMAT}", file=str(file),
                    hint="give what compstiff diagnose -o wrote")
    if content.get("robot") != cell.robot.name:
        raise error("CS1650", f"the diagnosis is of robot {content.get('robot')}, the cell has {cell.robot.name}",
                    file=str(file), hint="diagnose the measurements of this cell")
    try:
        said = _DiagnosisFile.model_validate(content)
    except ValidationError as problem:
        first = problem.errors()[0]
        raise error("CS1650", f"{'.'.join(map(str, first['loc']))}: {first['msg']}", file=str(file),
                    hint="give what compstiff diagnose -o wrote, as it wrote it") from problem
    if said.verdict not in VERDICTS:
        raise error("CS1650", f"verdict: found '{said.verdict}', expected one of {', '.join(VERDICTS)}", file=str(file),
                    hint="give what compstiff diagnose -o wrote, as it wrote it")
    if for_loads and "measured" in content:
        raise error("CS1650", f"of a {content['measured']}: its rows are moments of a motion, and loads are planned from load "
                    "tests", file=str(file), hint="diagnose the measurements that are named with --add")
    known = effects()
    for rival in said.alternatives:
        if rival.effect not in known or rival.joint not in known[rival.effect].places:
            raise error("CS1650", f"the diagnosis names {rival.effect} at joint {rival.joint}, which no effect here is called",
                        file=str(file), hint="diagnose again with the same effects installed")
    rows = [cause.parameters.single_row.estimate for cause in said.causes if cause.parameters.single_row]
    rows += [row for bad in (said.visits.bad if said.visits else []) for row in bad.rows]
    return Diagnosed(said.verdict, tuple((rival.effect, rival.joint) for rival in said.alternatives), tuple(rows), str(file))


def rival_models(cell: Cell, measurements: Measurements, diagnosed: Diagnosed) -> Rivals:
    """The rivals, fitted to the rows that the diagnosis used, with their probabilities, the likeliest first."""
    rows = share_of(in_blocks(cell, measurements)[0])[0]
    rows = rows.select(~rows.validate & ~np.isin(rows.row, diagnosed.bad_rows))
    data = LoadTest.of(cell, rows)
    catalogue: dict[str, Effect] = {name: effects()[name] for name, _ in diagnosed.names}
    found = converged(posterior(data), catalogue, 2)
    survey = found.seen
    named, entries = set(diagnosed.names), survey.dictionary.entries
    listed = tuple(hypothesis for hypothesis in survey.hypotheses
                   if {(entries[k].effect.name, entries[k].joint) for k in hypothesis.entries} <= named)
    return rivals_of(data, replace(survey, hypotheses=listed), found.fitted)


def discriminating_design(
    task: Task, rivals: Rivals, rng: np.random.Generator, effort: Effort | None = None
) -> tuple[Design, Discrimination]:
    """A plan whose runs discriminate between the rivals first, and what it is worth by the task's criterion. Raises
    CompstiffError (CS1601) where no run is admissible."""
    effort = effort or Effort()
    pool = random_pool(task.domain, effort.poses, rng)
    runs, discrimination = discriminating_runs(task, rivals, pool, rng)
    if len(runs) < len(task.demand):
        runs = runs.joined(_by_criterion(task, runs, pool, rng, effort))
    certificate = certify(task, runs, pool, rng, starts=effort.climbs // 2)
    return Design(task, runs, task.information(runs), certificate, 0, 0, 0, task.value(runs), pool), discrimination


def discriminating_runs(task: Task, rivals: Rivals, pool: Pool, rng: np.random.Generator) -> tuple[Pool, Discrimination]:
    """The runs of a random pool that discriminate between the rivals, as many as the task asks for or as are needed. They are
    taken as they are: what they decide does not hang on a degree."""
    domain = task.domain
    tried = pool.take(_spread_of(pool, len(domain.slots), rng))
    forces = np.stack([domain.slots[s].along(line) for s, line in zip(tried.slot, tried.line, strict=True)])
    rows = planned_rows(tried.theta, forces, DWELL_S)
    separated = separation(rows, rivals)
    _, pose = np.unique(tried.theta, axis=0, return_inverse=True)
    chosen = np.array(discriminating(separated, len(task.demand), pose.ravel()), dtype=np.intp)
    # Nobody errs more than by always naming the likeliest: the bound may say more than that.
    most = 1.0 - float(separated.probability.max())
    doubt = [min(most, float(separated.mistaken(separated.of(chosen[:k])))) for k in range(len(chosen) + 1)]
    needed = next((k for k, value in enumerate(doubt) if k and value <= DECIDED), len(chosen))
    return tried.take(chosen[:needed]), Discrimination(
        separated.names, separated.probability, doubt[0], doubt[needed], needed, _pairs(separated, chosen[:needed]))


def _spread_of(pool: Pool, slots: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Some of the pool's poses, each with every slot that is admissible there."""
    poses, first = np.unique(pool.theta, axis=0, return_inverse=True)
    kept = rng.permutation(len(poses))[: POSES if slots > 1 else 3 * POSES]
    return np.flatnonzero(np.isin(first.ravel(), kept))


def _by_criterion(task: Task, chosen: Pool, pool: Pool, rng: np.random.Generator, effort: Effort) -> Pool:
    """The runs that are still missing, the best by the criterion, given those that are chosen."""
    missing = len(task.demand) - len(chosen)
    rest = replace(task, prior=task.information(chosen), demand=Demand(task.demand.groups, task.demand.wanted[:missing]))
    plans = many_exchanges(rest, pool, rng, effort.exchanges // 4)
    return best_refined(rest, pool, plans[: effort.refinements]).runs


def _pairs(separated: Separation, chosen: NDArray[np.intp]) -> tuple[tuple[str, str, float], ...]:
    sigmas = np.sqrt(separated.squared(separated.of(chosen)))
    names, pairs = separated.names, separated.pairs
    return tuple((names[pairs[k][0]], names[pairs[k][1]], float(sigmas[k])) for k in np.argsort(sigmas))


def no_rivals(diagnosed: Diagnosed) -> Finding:
    """What to say where the diagnosis leaves no choice between names."""
    why, hint = f"the diagnosis is '{diagnosed.verdict}'", "an ambiguous diagnosis is what further loads can settle"
    if diagnosed.verdict == "ambiguous":
        why = "fewer than two of the names that the diagnosis leaves open can be fitted to these rows"
        hint = "do the checks that the diagnosis names; a mistake in a file is none that loads settle"
    return Finding("CS1651", "note", f"{why}: there are no rival causes to tell apart, so the runs are those of the criterion",
                   file=diagnosed.source, hint=hint)
