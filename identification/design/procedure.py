"""`design` as a whole: from a request to the plan that is written, with its certificate and what it will tell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from identification.common.findings import Finding
from identification.design.causes import ByCauses, design_for_causes
from identification.design.comparison import compared
from identification.design.discrimination import Discrimination, discriminating_design, no_rivals, rival_models
from identification.design.domain import Pool
from identification.design.forecast import forecast
from identification.design.kept_back import kept_back
from identification.design.milling import MillingPoses
from identification.design.order import load_axes, run_order
from identification.design.plan import DesignPlan
from identification.design.posture import ordinary
from identification.design.request import Request, prepare
from identification.design.search import QUICK, Design, Effort, optimal_design
from identification.design.sheet import Sheet, sheet_of
from identification.design.unseen import Sideways, sideways, unseen_finding
from identification.diagnosis.discrimination import Rivals
from identification.model.cell import Cell


def _silent(text: str) -> None:
    """Nobody watches."""


def design_plan(
    cell: Cell, request: Request, *, milling: MillingPoses | None = None, seed: int = 0, quick: bool = False,
    say: Callable[[str], None] = _silent,
) -> DesignPlan:
    """Plans the poses and loads that tell most, and certifies how good the plan is.

    milling: the targets of a program, which the criterion I is about and in whose middle the TCP stands. seed: of the random
    starts. quick: a shorter search, a looser certificate. say: receives what is being done. Raises CompstiffError: CS1601 where
    no run is admissible, CS1602 for the criterion I without `milling`, and what `fit_stiffness` raises on measured rows.

    The matrices are six by six: with OPENBLAS_NUM_THREADS=1 set before numpy is imported it takes a fraction of the time.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> plan = compstiff.design_plan(cell, compstiff.Request(measurements=2), quick=True)
    >>> plan.as_dict()["format"], len(plan.csv()) > 0
    ('compstiff-design', True)
    """
    prepared = prepare(cell, request, milling)
    task, rng, effort = prepared.task, np.random.default_rng(seed), QUICK if quick else Effort()
    rivals, findings = _rivals(cell, request)
    say(f"searching {len(task.demand)} runs ...")
    aim: Discrimination | ByCauses | None = None
    if len(rivals) > 1:
        design, aim = discriminating_design(task, rivals, rng, effort)
    elif request.criterion == "C":
        design, aim = design_for_causes(task, request.measured, rng, effort)
    else:
        design = optimal_design(task, rng, effort)
    if aim is None and request.preset is None:
        design, posture = ordinary(design)
        findings = (*findings, *posture)
    gain = None if prepared.plainer is None else compared(design, *prepared.plainer, rng)
    runs = design.runs.joined(kept_back(task.domain, design.pool, design.runs, request.kept_back))
    sheet = _in_order(design, runs, request, rng)
    expected = forecast(design, sheet.of_purpose(validate=False), request.measured, rng)
    helps, labels, unseen = _unseen(design, sheet)
    return DesignPlan(prepared, design, sheet, expected, aim, gain, request.measured is not None, seed,
                      (*(milling.findings if milling is not None else ()), *prepared.findings, *findings, *unseen),
                      tuple(zip(helps, labels, strict=True)))


def _unseen(design: Design, sheet: Sheet) -> tuple[tuple[Sideways, ...], tuple[str, ...], tuple[Finding, ...]]:
    """The loads that would show what the plan's cannot, at which poses, and what to say of it."""
    domain = design.task.domain
    helps = tuple(sideways(domain, design.runs, design.information, joint) for joint in design.task.criterion.left_out)
    labels = tuple(sheet.label[int(np.flatnonzero(sheet.run == one.run)[0])] for one in helps)
    return helps, labels, (unseen_finding(domain, helps, labels),) if helps else ()


def _rivals(cell: Cell, request: Request) -> tuple[Rivals, tuple[Finding, ...]]:
    """The models that the runs shall discriminate between, and what to say where there are none though a diagnosis is given."""
    diagnosed = request.diagnosis
    if diagnosed is None or request.measured is None:
        return {}, ()
    rivals = rival_models(cell, request.measured, diagnosed) if diagnosed.verdict == "ambiguous" else {}
    return rivals, () if len(rivals) > 1 else (no_rivals(diagnosed),)


def _in_order(design: Design, runs: Pool, request: Request, rng: np.random.Generator) -> Sheet:
    """The rows of all runs in the order they are taken; those behind the design's are never fitted."""
    domain = design.task.domain
    order = run_order(runs.theta, load_axes(runs), domain.rig.cell.robot.speed, rng)
    return sheet_of(runs, domain.slots, order, request.replicates, np.arange(len(runs)) >= len(design.runs),
                    "P" if request.measured is None else "A")
