"""A tare where the program has next to no air moves: in a cut refused, in air taken.

The jobs are those of benchmarks/tares.py; which targets cut is known from how they are made, not from what the package finds.
"""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.tares import Job, job, tares
from compensator.forces.placement import place_forces
from identification.common.findings import CompstiffError

SEEDS = range(60)


def answer(what: Job, tare: tuple[int, int], **options: bool) -> str:
    try:
        forces = place_forces(what.log, what.path, what.path.cell, tare=tare, **options)
    except CompstiffError as refused:
        return refused.findings[0].code
    return "warned" if any(finding.level == "warning" for finding in forces.findings
                           if finding.code in ("CS3039", "CS3041", "CS3066")) else "taken"


def test_no_tare_inside_a_cut_is_taken_without_a_word_and_hardly_one_in_air_is_refused() -> None:
    """Right ones may be refused where a log ends in the cut; one in ten of so few seeds at most."""
    right: Counter[str] = Counter()
    for seed in SEEDS:
        rng = np.random.default_rng((900, seed))
        what = job(rng)
        for kind, tare in tares(what, rng).items():
            said = answer(what, tare)
            if kind.startswith("wrong"):
                assert said != "taken", (seed, kind, tare, what.where)
            else:
                right[said] += 1
    assert sum(right.values()) > 50
    assert right["CS3039"] == 0
    assert right["CS3066"] <= 0.1 * sum(right.values())


def one_wrong() -> tuple[Job, tuple[int, int]]:
    for seed in SEEDS:
        rng = np.random.default_rng((901, seed))
        what = job(rng)
        tare = tares(what, rng).get("wrong: inside a cut")
        if tare and answer(what, tare) == "CS3039":
            return what, tare
    raise AssertionError("no such job")


def test_a_tare_that_is_trusted_is_used_and_the_doubt_stays() -> None:
    what, tare = one_wrong()
    forces = place_forces(what.log, what.path, what.path.cell, tare=tare, trust_tare=True)
    [doubt] = [finding for finding in forces.findings if finding.code == "CS3039"]
    assert doubt.level == "warning"
    assert "used all the same" in doubt.message
    assert forces.tare is not None


def test_the_bias_that_the_cell_states_is_a_witness() -> None:
    """A slot of one steady force from its first target to its last: the bias in the cell alone tells that no target is in air,
    or, with a force of zero, that all are. The truth: 120 N of cut, or none, and a bias of 3 N."""
    rng = np.random.default_rng(5)
    what = next(what for what in (job(np.random.default_rng((902, k))) for k in range(200)) if what.where.startswith("slot"))
    count = len(what.path.toolpath)
    target = np.repeat(np.arange(count, dtype=float), 6)
    cell = what.path.cell
    cell = replace(cell, force_log=replace(cell.force_log, bias=np.array([3.0, 0, 0, 0, 0, 0])))
    path = replace(what.path, cell=cell)
    for cut, answer_is in ((0.0, ""), (120.0, "CS3039|CS3066")):
        force = np.array([cut + 3.0, -cut / 3, 0.0]) + rng.normal(0, 1, (len(target), 3))
        load = np.column_stack([force, np.zeros_like(force)])
        log = replace(what.log, key="target", place=target, force=load[:, :3], moment=load[:, 3:], plain=load,
                      line=np.arange(len(target)), weight=np.ones(len(target)), saturated=np.zeros(len(target), dtype=bool))
        inner = log.place.astype(int) % (count - 1) > 0          # no sample at the program's ends
        log = replace(log, **{name: value[inner] for name, value in vars(log).items()
                              if isinstance(value, np.ndarray) and len(value) == len(inner)})
        with pytest.raises(CompstiffError, match=answer_is) if answer_is else nullcontext():
            place_forces(log, path, cell, tare=(count // 2, count // 2 + 2))
