"""What a plain spring gets wrong in joint deflection logs: detect, name, extend, test what is left, measure the gain.

The rules are those of measured TCP deflections (docs/effects.md), joint by joint; the noise is autocorrelated everywhere.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.motion.axis import Axis, axis_of, solve
from identification.motion.axis_diagnosis import AxisDiagnosis, Verdict
from identification.motion.band import BAND
from identification.motion.causes import LogCause, cause_of
from identification.motion.log_file import MotionLog
from identification.motion.prediction import Gain, held_out, model_columns, straight_line
from identification.motion.remainder import Remainder, remainder
from identification.motion.search import Hypothesis, survey
from identification.motion.stiffness import axis_stiffness

Array = NDArray[np.float64]
Hypotheses = tuple[Hypothesis, ...]
ALARM, REPLICATES = 0.05, 99
CERTAIN = 0.95
# A misfit explained to this share has its cause, though something is left.
NEARLY_ALL = 0.95
WORTH_NAMING = 0.02
# Residual variance, plain over extended, from which a misfit is gross.
GROSS = 4.0


def diagnose_axes(
    records: list[MotionLog], validate: MotionLog | None = None, *, alarm: float = ALARM, replicates: int = REPLICATES,
    seed: int = 0,
) -> tuple[AxisDiagnosis, ...]:
    """What the plain springs get wrong in the records, joint by joint; the gain is measured on `validate`, else on blocks of
    time. alarm: rate of false alarms over all joints. Raises CompstiffError (CS1501) where the validation record lacks a joint.
    """
    joints = sorted({joint for record in records for joint in record.joints})
    if validate is not None and (missing := [joint for joint in joints if joint not in validate.joints]):
        raise error("CS1501", f"has no motor and link angle of joint {', '.join(map(str, missing))}", file=validate.source,
                    hint="validate with a record of the same joints")
    rng = np.random.default_rng(seed)
    return tuple(_axis(joint, records, validate, alarm / len(joints), replicates, rng) for joint in joints)


def _axis(
    joint: int, records: list[MotionLog], validate: MotionLog | None, alarm: float, replicates: int, rng: np.random.Generator
) -> AxisDiagnosis:
    axis, raw = axis_of(joint, records, BAND), axis_of(joint, records, np.inf)
    p_value = detection(axis, replicates, rng)
    hypotheses = survey(axis)
    plain = _of_entries(hypotheses, set())
    assert plain is not None
    stiffness = axis_stiffness(joint, records)
    left = _remainder(axis, raw, plain)
    adequate = AxisDiagnosis(
        axis=axis, verdict="unknown" if left.patterns else "adequate", p_value=p_value, hypotheses=hypotheses, named=plain,
        left=left, stiffness=stiffness, deflection=raw.deflection, residuals=_residuals(axis, raw, plain))
    if p_value > max(alarm, 1 / (replicates + 1)):
        return adequate
    named, gain, withdrawn = _predictive(axis, hypotheses, plain, records, validate)
    causes, alternatives = _causes(axis, hypotheses, named)
    left, before, after = _remainder(axis, raw, named), _left(axis, plain), _left(axis, named)
    explained = 1 - float(np.var(after) / np.var(before))
    nearly = explained >= NEARLY_ALL and np.var(before) >= GROSS * np.var(after)
    verdict: Verdict = "named"
    if not named.entries or not (nearly or not left.patterns):
        # Nothing is certain: a set of names where the likeliest of them leaves no pattern, else unknown.
        best = hypotheses[0]
        verdict = "ambiguous" if best.entries and not _remainder(axis, raw, best).patterns else "unknown"
        alternatives, causes, gain = (*causes, *alternatives), (), None
    return replace(adequate, verdict=verdict, named=named, causes=causes, alternatives=alternatives, withdrawn=withdrawn,
                   explained=explained, left=left, gain=gain, residuals=_residuals(axis, raw, named))


def _of_entries(hypotheses: Hypotheses, entries: set[int]) -> Hypothesis | None:
    return next((hypothesis for hypothesis in hypotheses if set(hypothesis.entries) == entries), None)


def _predictive(
    axis: Axis, hypotheses: Hypotheses, plain: Hypothesis, records: list[MotionLog], validate: MotionLog | None
) -> tuple[Hypothesis, Gain | None, tuple[str, ...]]:
    """The hypothesis of all certain causes that also predict what was not fitted, its gain, and the names of the others."""
    certain = {entry for entry in range(len(axis.dictionary)) if _at_work(hypotheses, entry) >= CERTAIN}
    named = _of_entries(hypotheses, certain) or plain
    if not named.entries:
        return named, None, ()
    gain, helps = held_out(axis, named, records, validate)
    if all(helps):
        return named, gain, ()
    withdrawn = tuple(name for name, good in zip(named.names, helps, strict=True) if not good)
    kept = {entry for entry, good in zip(named.entries, helps, strict=True) if good}
    named = _of_entries(hypotheses, kept) or plain
    return named, held_out(axis, named, records, validate)[0] if named.entries else None, withdrawn


def _causes(
    axis: Axis, hypotheses: Hypotheses, named: Hypothesis
) -> tuple[tuple[LogCause, ...], tuple[LogCause, ...]]:
    """The named causes, and all others worth a name, the likeliest first."""
    chance = [_at_work(hypotheses, entry) for entry in range(len(axis.dictionary))]
    causes = tuple(cause_of(axis, named, k, chance[entry]) for k, entry in enumerate(named.entries))
    others = [int(k) for k in np.argsort(-np.array(chance)) if k not in named.entries and chance[k] >= WORTH_NAMING]
    return causes, tuple(_likeliest(axis, hypotheses, entry, chance[entry]) for entry in others)


def detection(axis: Axis, replicates: int, rng: np.random.Generator) -> float:
    """p-value of the plain spring against any single effect and all together: simulated from the plain fit with noise of the
    same autoregression, which is estimated again each time."""
    actual = _largest(axis)
    plain, widest = solve(axis, axis.plain), solve(axis, axis.widest)
    size = float(np.sqrt(widest.chi2 / max(1, widest.count - widest.coefficients.size)))
    as_large = 0
    for _ in range(replicates):
        noise = np.concatenate([axis.noise.simulate(size, length, rng) for length in axis.lengths])
        as_large += _largest(replace(axis, deflection=axis.plain @ plain.coefficients + noise)) >= actual
    return (as_large + 1) / (replicates + 1)


def _largest(axis: Axis) -> float:
    """The largest score of one effect, or of all together."""
    plain = solve(axis, axis.plain)
    tried = [np.column_stack([axis.plain, shape.columns]) for group in axis.dictionary for shape in group]
    scores: list[float] = []
    for columns in (*tried, axis.widest):
        solved = solve(axis, columns)
        free = float(columns.shape[1] - axis.plain.shape[1])
        scores.append(float(0.5 * solved.count * np.log(plain.chi2 / solved.chi2)) / free**0.5)
    return max(scores)


def _at_work(hypotheses: Hypotheses, entry: int) -> float:
    """Probability that an effect is at work."""
    return float(min(1.0, sum(hypothesis.probability for hypothesis in hypotheses if entry in hypothesis.entries)))


def _likeliest(axis: Axis, hypotheses: Hypotheses, entry: int, probability: float) -> LogCause:
    """An effect as the likeliest hypothesis with it has it."""
    hypothesis = next(hypothesis for hypothesis in hypotheses if entry in hypothesis.entries)
    return cause_of(axis, hypothesis, hypothesis.entries.index(entry), probability)


def _left(axis: Axis, hypothesis: Hypothesis) -> Array:
    """Residual under the band (n,)."""
    return np.asarray(axis.deflection - hypothesis.columns(axis) @ hypothesis.solved.coefficients)


def _residuals(axis: Axis, raw: Axis, hypothesis: Hypothesis) -> Array:
    """Full-rate residuals (n, 2) of the plain straight line and of the hypothesis."""
    line = raw.plain @ straight_line(axis)
    extended = model_columns(raw, hypothesis) @ hypothesis.solved.coefficients if hypothesis.entries else line
    return np.column_stack([raw.deflection - line, raw.deflection - extended])


def _remainder(axis: Axis, raw: Axis, hypothesis: Hypothesis) -> Remainder:
    return remainder(axis, _left(axis, hypothesis), raw.parts(_residuals(axis, raw, hypothesis)[:, 1]))
