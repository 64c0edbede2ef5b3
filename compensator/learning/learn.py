"""`learn`: what a measured part and the log of its pass say of the next program, or why they are not believed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compensator.correction.logged_pass import read_offsets
from compensator.correction.predict import predict
from compensator.correction.settings import DEFAULTS, EXACTLY_ONE, Estimate, Settings
from compensator.forces.placement import ForceLog
from compensator.learned.learned import DRIFT, SETUP, Learned
from compensator.learning.chance import FALSE_RATE, chance_of_remainder
from compensator.learning.held_out import held_out
from compensator.learning.learning import Learning
from compensator.learning.measured_points import read_points
from compensator.learning.path_places import place_points
from compensator.learning.posterior import Posterior, expected, posterior
from compensator.learning.refusals import refuse_without_physics, refuse_worse, refuse_wrong_factor, said_of
from compensator.learning.rows import rows_of
from compensator.learning.sizes import Sizes, with_remainder, without_remainder
from compensator.learning.terms import Terms, frame_of, terms_of
from compensator.posting.read_toolpath import PlannedProgram
from identification.common.arrays import Array
from identification.model.cell import Cell
from identification.model.effects_in_force import SPRINGS
from identification.model.stiffness import IdentifiedModel

# How far the moving robot may give way otherwise than at rest, 1 sigma, where --scale says nothing and cell.yaml no more: wide,
# for the part was measured to tell it. Engineering judgement.
MOTION = 0.2
ROUNDS = 3
# A displacement of the job that is not known to this share of what was assumed before is not shown by the points.
UNSHOWN = 0.05


def learn(
    cell: Cell, program: PlannedProgram, model: IdentifiedModel, forces: str | Path | ForceLog, points_file: str | Path,
    settings: Settings = DEFAULTS, *, radius: float = 0.0, within: float = 1e-3,
) -> Learning:
    """From the deviation measured on the part (`read_points`) and the log of its pass.

    settings as for `predict`; scale: what was known of the factor in motion; logged_with: the offsets.csv that the program had
    in this pass. radius [m]: of the tool, where points are of the surface; within [m]: how far they may be from the path.

    Raises what `predict`, `read_points`, `place_points` and `read_offsets` raise; Refused: CS5310 the measured deviation does
    not follow the predicted, CS5311 the remainder is larger than what physics explains, CS5312 it is worse where it was not
    learned.

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
    placed = place_points(points, predicted, radius, within)
    rows = rows_of(points, placed, predicted)
    offsets = np.zeros((len(predicted.path.toolpath), 3))
    if chosen.logged_with:
        offsets = read_offsets(chosen.logged_with, predicted.path)
    offsets = offsets[predicted.targets]
    wide = Estimate(1.0, max(MOTION, cell.motion.compliance_std))
    motion = wide if chosen.scale == EXACTLY_ONE else chosen.scale
    mean, before = _before(model, motion, cell)
    frame = frame_of(rows, predicted)

    def linearised(x: Array, job: Array) -> Terms:
        return terms_of(rows, predicted, offsets, replace(model, mean=x), mean, before, frame, job)

    terms = linearised(mean, np.eye(SETUP + DRIFT))
    noise = without_remainder(terms)
    refuse_wrong_factor(terms, noise, rows.seen(predicted.prediction.position)[:, 0] * motion.value, points.source)
    for _ in range(ROUNDS - 1):
        terms = linearised(mean + posterior(terms, noise).mean[:len(mean)], terms.job)
        noise = without_remainder(terms, noise)
    chance, length = chance_of_remainder(terms, noise)
    sizes = noise
    if chance <= FALSE_RATE:
        # The length that stood out before the noise was sized anew, and those beside it.
        sizes = max((with_remainder(terms, noise, factor * length) for factor in (1.0, 0.5, 2.0)), key=lambda one: one.evidence)
    terms = _seen_of_the_job(terms, sizes)
    found = posterior(terms, sizes)
    terms = linearised(mean + found.mean[:len(mean)], terms.job)
    found = posterior(terms, sizes)
    tried = held_out(terms, sizes)
    measured = rows.value - rows.seen(offsets)[:, 0]
    parts = _parts(terms, found, measured, rows.seen(predicted.prediction.position)[:, 0])
    absolute = found.mean.copy()
    absolute[:len(mean)] += mean
    learned = Learned(model.mean.copy(), absolute, found.covariance, frame, found.remainder)
    result = Learning(predicted, terms, sizes, learned, measured, parts, _motion(before, found, motion, cell), chance, tried,
                      (len(placed.rows), len(points)), points.source, chosen.logged_with, ())
    findings = (*points.findings, *predicted.findings, *placed.findings, *rows.findings, *said_of(result, before, mean))
    refuse_worse(tried, points.source, findings)
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


def _seen_of_the_job(terms: Terms, sizes: Sizes) -> Terms:
    """Without the displacements of set-up and drift that the points do not show (a plane of walls alone says nothing of their
    height), and without all of drift or set-up where chance would show as much (Wald, at the false rate)."""
    from scipy.special import chdtrc

    size = terms.by_x.shape[1]
    for part in (slice(SETUP, SETUP + DRIFT), slice(0, SETUP)):
        found = posterior(terms, sizes)
        where, std = size + np.arange(SETUP + DRIFT)[part], terms.of_job_std[part]
        value, covariance = found.mean[where] / std, found.covariance[np.ix_(where, where)] / np.outer(std, std)
        known, directions = np.linalg.eigh(covariance)
        shown, variance = directions[:, known < UNSHOWN**2], known[known < UNSHOWN**2]
        chi2 = float(np.sum((shown.T @ value) ** 2 / variance))
        job = terms.job.copy()
        job[part, part] = shown @ shown.T if shown.shape[1] and chdtrc(shown.shape[1], chi2) <= FALSE_RATE else 0.0
        terms = replace(terms, job=job)
    return terms


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
