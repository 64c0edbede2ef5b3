"""`learn`: what a measured part and the log of its pass say of the next program, or why they are not believed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compensator.correction.logged_pass import driven_as_said
from compensator.correction.pass_offsets import offsets_of_pass
from compensator.correction.predict import predict
from compensator.correction.settings import DEFAULTS, EXACTLY_ONE, Estimate, Settings
from compensator.forces.placement import ForceLog
from compensator.learned.learned import DRIFT, SETUP, Learned
from compensator.learning.causes import ask, said_of_causes, tested, with_free_laws
from compensator.learning.cutter_size import said_of_cutter
from compensator.learning.fitted_part import Believed, fitted_part
from compensator.learning.learning import Learning
from compensator.learning.long_moves import said_of_long_moves
from compensator.learning.measured_points import read_points
from compensator.learning.normals_alone import said_of_normals
from compensator.learning.other_pass import refuse_other_pass
from compensator.learning.path_places import place_points
from compensator.learning.posterior import Posterior, expected
from compensator.learning.refusals import refuse_without_physics, refuse_worse, said_of
from compensator.learning.rows import rows_of
from compensator.learning.shifted import said_of_shift
from compensator.learning.terms import Terms
from compensator.learning.unseen import said_of_unseen
from compensator.learning.unshown import unshown
from compensator.learning.wrong_axes import refuse_wrong_axes
from compensator.posting.read_toolpath import PlannedProgram
from identification.common.arrays import Array
from identification.model.cell import Cell
from identification.model.effects_in_force import SPRINGS, EffectInForce
from identification.model.stiffness import IdentifiedModel

# How far the moving robot may give way otherwise than at rest, 1 sigma, where --scale says nothing and cell.yaml no more: wide,
# for the part was measured to tell it. Engineering judgement.
MOTION = 0.2


def learn(
    cell: Cell, program: PlannedProgram, model: IdentifiedModel, forces: str | Path | ForceLog, points_file: str | Path,
    settings: Settings = DEFAULTS, *, radius: float = 0.0, within: float = 1e-3,
) -> Learning:
    """From the deviation measured on the part (`read_points`) and the log of its pass.

    settings as for `predict`; scale: what was known of the factor in motion; logged_with: the offsets.csv that the program had
    in this pass. radius [m]: of the tool, where points are of the surface; within [m]: how far they may be from the path.

    Raises what `predict`, `read_points`, `place_points` and `offsets_of_pass` raise; Refused: CS5310 the measured deviation
    does not follow the predicted, CS5311 the remainder is larger than what physics explains, CS5312 it is worse where it was
    not learned, CS5330 along other axes, CS5335 of the pass without the offsets.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> try:
    ...     compstiff.learn(cell, program, model, "insert.forces.parquet", "no_such_points.csv")
    ... except compstiff.CompstiffError as stopped:
    ...     print(stopped.findings[0].code)
    CS0005
    """
    chosen = settings.correction
    plain = replace(settings, correction=replace(chosen, scale=EXACTLY_ONE, learned=None, repeats="nothing"))
    points = read_points(points_file, cell)
    predicted = predict(cell, program, model, forces, plain)
    driven = driven_as_said(replace(predicted, settings=settings))
    placed = place_points(points, predicted, radius, within)
    offsets = offsets_of_pass(chosen.logged_with, predicted) if chosen.logged_with else None
    rows = rows_of(points, placed, predicted, offsets)
    told = rows.seen(predicted.prediction.position)[:, 0]
    if offsets is not None:
        refuse_other_pass(rows, told, rows.seen(offsets.over(predicted.path)[predicted.targets])[:, 0], points.source)
    normals = [*said_of_long_moves(placed, predicted, points.source),
               *said_of_normals(rows, rows.value, told, predicted, points.source)]
    refuse_wrong_axes(rows, rows.value, told, points.source)
    wide = Estimate(1.0, max(MOTION, cell.motion.compliance_std))
    motion = wide if chosen.scale == EXACTLY_ONE else chosen.scale
    mean, before = _before(model, motion, cell)
    without = fitted_part(rows, predicted, Believed(model, mean, before, mean), motion, points.source)
    asked = ask(without, predicted)
    fitted = without
    if asked.terms:
        extended = without.believed.extended(asked.terms, without.x)
        fitted = fitted_part(asked.rows, predicted, extended, motion, points.source, without.beside)
        asked = tested(asked, without, fitted)
        free = with_free_laws(asked, without, fitted, predicted) if asked.terms else None
        if free is not None:
            fitted = fitted_part(asked.rows, predicted, free, motion, points.source, without.beside)
        fitted = fitted if asked.terms else without
    terms, found = fitted.terms, fitted.posterior
    parts = _parts(terms, found, terms.rows.value, rows.seen(predicted.prediction.position)[:, 0])
    shown = fitted.believed.model.effects[len(model.effects):]
    in_force = tuple(EffectInForce(term.effect, term.joint) for term in shown)
    learned = Learned(model.mean.copy(), fitted.absolute, found.covariance, terms.frame, found.remainder, in_force,
                      unshown=unshown(fitted.all_terms, fitted.sizes))
    result = Learning(predicted, terms, fitted.sizes, learned, terms.rows.value, parts,
                      _motion(fitted.believed.covariance, found, motion, cell), fitted.chance, fitted.tried, asked,
                      (len(placed.rows), len(points)), points.source, chosen.logged_with, (), without.beside)
    findings = (*points.findings, *predicted.findings, *driven, *placed.findings, *rows.findings, *normals,
                *said_of_shift(rows, rows.value, predicted, points.source),
                *said_of_unseen(rows, predicted, points.source), *said_of_cutter(without.beside, points.source),
                *said_of(result, before, mean),
                *said_of_causes(asked, points.source))
    refuse_worse(fitted.tried, points.source, findings)
    refuse_without_physics(result, points.source, findings)
    return replace(result, findings=findings)


def _before(model: IdentifiedModel, motion: Estimate, cell: Cell) -> tuple[Array, Array]:
    """Mean (S,) and covariance (S, S) of the parameters in motion: the stiffness file's, times the factor, which the gain of
    the force sensor acts like."""
    mean, covariance = model.mean.copy(), model.covariance.copy()
    mean[SPRINGS] += np.log(motion.value)
    covariance[SPRINGS, SPRINGS] += _of_factor(motion, cell)
    return mean, covariance


def _of_factor(motion: Estimate, cell: Cell) -> float:
    return (motion.std / motion.value) ** 2 + cell.force_log.form.gain_std**2


def _motion(before: Array, found: Posterior, motion: Estimate, cell: Cell) -> Estimate:
    """The factor in motion itself (times the sensor's gain): what all springs changed by together, by their prior."""
    variance, size = _of_factor(motion, cell), len(before)
    with_x = np.zeros(size)
    with_x[SPRINGS] = variance
    share = np.linalg.solve(before + 1e-18 * np.eye(size), with_x)
    log = float(share @ found.mean[:size])
    left = variance - float(share @ with_x) + float(share @ found.covariance[:size, :size] @ share)
    value = float(motion.value * np.exp(log))
    return Estimate(value, value * float(np.sqrt(max(left, 0.0))))


def _parts(terms: Terms, found: Posterior, measured: Array, predicted: Array) -> dict[str, Array]:
    """What each part took of the rows (n,) [m]."""
    job, rest = replace(found, mean=_only(found.mean, terms, SETUP, 0)), replace(found, mean=_only(found.mean, terms, 0, DRIFT))
    setup = expected(terms, job, of_x=False, of_remainder=False)
    drift = expected(terms, rest, of_x=False, of_remainder=False)
    remainder = expected(terms, found, of_x=False, of_job=False)
    left = terms.residual - expected(terms, found)
    return {"predicted": predicted, "springs": measured - predicted - setup - drift - remainder - left, "setup": setup,
            "drift": drift, "remainder": remainder, "left": left}


def _only(mean: Array, terms: Terms, setup: int, drift: int) -> Array:
    """The posterior's mean with set-up or drift alone among the parameters of the job."""
    size, kept = terms.by_x.shape[1], mean.copy()
    if not setup:
        kept[size:size + SETUP] = 0.0
    if not drift:
        kept[size + SETUP:size + SETUP + DRIFT] = 0.0
    return kept
