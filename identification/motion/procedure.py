"""What a plain spring gets wrong in joint deflection logs: detect, name, extend, test what is left, measure the gain.

The rules are those of measured TCP deflections (docs/effects.md), joint by joint; the noise is autocorrelated everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.motion.axis import Axis, axis_of, solve
from identification.motion.band import BAND
from identification.motion.dictionary import Shape
from identification.motion.log_file import MotionLog
from identification.motion.prediction import Gain, held_out, model_columns, straight_line
from identification.motion.remainder import Remainder, remainder
from identification.motion.search import Hypothesis, survey
from identification.motion.stiffness import AxisStiffness, axis_stiffness

Array = NDArray[np.float64]
Verdict = Literal["adequate", "named", "ambiguous", "unknown"]
ALARM, REPLICATES = 0.05, 99
CERTAIN = 0.95
# A pattern in what is left, over both quantities looked at.
LEFT = 0.01
# A misfit explained to this share has its cause, though something is left.
NEARLY_ALL = 0.95
WORTH_NAMING = 0.02
# Residual variance, plain over extended, from which a misfit is gross.
GROSS = 4.0


@dataclass(frozen=True, eq=False)
class LogCause:
    """An effect at a joint with its probability. values, std (P,): its parameters, NaN where the log does not tell them."""

    shape: Shape
    joint: int
    probability: float
    values: Array
    std: Array

    @property
    def label(self) -> str:
        """channel_delay (link) [1]."""
        return f"{self.shape.name} [{self.joint}]"


@dataclass(frozen=True, eq=False)
class AxisDiagnosis:
    """One joint. named: the hypothesis of the certain causes only, which the gain is about. causes: certain; alternatives:
    others, the likeliest first. explained: share of the misfit's variance that `named` takes away, under the band. deflection
    (n,), residuals (n, 2) [rad]: of plain and extended model, fitted, at full rate. withdrawn: names that do not predict."""

    joint: int
    axis: Axis
    verdict: Verdict
    p_value: float
    hypotheses: tuple[Hypothesis, ...]
    named: Hypothesis
    causes: tuple[LogCause, ...]
    alternatives: tuple[LogCause, ...]
    withdrawn: tuple[str, ...]
    explained: float
    left: Remainder
    gain: Gain | None
    stiffness: AxisStiffness
    deflection: Array
    residuals: Array


@dataclass(frozen=True, eq=False)
class LogDiagnosis:
    """All joints of the records; verdict over all."""

    verdict: Verdict
    records: tuple[MotionLog, ...]
    validate: MotionLog | None
    axes: tuple[AxisDiagnosis, ...]
    p_resolution: float


def diagnose_logs(
    records: list[MotionLog], validate: MotionLog | None = None, *, alarm: float = ALARM, replicates: int = REPLICATES,
    seed: int = 0,
) -> LogDiagnosis:
    """Finds out what the plain springs get wrong in the records; the gain is measured on `validate`, else on blocks of time.

    Raises CompstiffError (CS1501) where the validation record lacks a joint.
    """
    joints = sorted({joint for record in records for joint in record.joints})
    if validate is not None and (missing := [joint for joint in joints if joint not in validate.joints]):
        raise error("CS1501", f"has no motor and link angle of joint {', '.join(map(str, missing))}", file=validate.source,
                    hint="validate with a record of the same joints")
    rng = np.random.default_rng(seed)
    axes = tuple(_axis(joint, records, validate, alarm / len(joints), replicates, rng) for joint in joints)
    verdicts = [one.verdict for one in axes]
    # What is certain at one joint stays so whatever another shows; each joint's own verdict stands beside the overall one.
    order: tuple[Verdict, ...] = ("named", "unknown", "ambiguous", "adequate")
    overall: Verdict = next(verdict for verdict in order if verdict in verdicts)
    return LogDiagnosis(overall, tuple(records), validate, axes, 1 / (replicates + 1))


def _axis(
    joint: int, records: list[MotionLog], validate: MotionLog | None, alarm: float, replicates: int, rng: np.random.Generator
) -> AxisDiagnosis:
    axis = axis_of(joint, records, BAND)
    raw = axis_of(joint, records, np.inf)
    p_value = detection(axis, replicates, rng)
    hypotheses = survey(axis)
    plain = next(one for one in hypotheses if not one.entries)
    stiffness = axis_stiffness(joint, records)
    if p_value > max(alarm, 1 / (replicates + 1)):
        left = _residuals(axis, raw, plain)
        seen = _seen(axis, raw, plain)
        verdict: Verdict = "unknown" if _patterns(seen) else "adequate"
        return AxisDiagnosis(joint, axis, verdict, p_value, hypotheses, plain, (), (), (), 0.0, seen, None, stiffness,
                             raw.deflection, left)
    sure = {entry for entry in range(len(axis.dictionary)) if _at_work(hypotheses, entry) >= CERTAIN}
    named = next((one for one in hypotheses if set(one.entries) == sure), plain)
    gain: Gain | None = None
    withdrawn: tuple[str, ...] = ()
    if named.entries:
        gain, helps = held_out(axis, named, records, validate)
        withdrawn = tuple(name for name, good in zip(named.names, helps, strict=True) if not good)
        if withdrawn:
            kept = {entry for entry, good in zip(named.entries, helps, strict=True) if good}
            named = next((one for one in hypotheses if set(one.entries) == kept), plain)
            gain = held_out(axis, named, records, validate)[0] if named.entries else None
    chance = [_at_work(hypotheses, entry) for entry in range(len(axis.dictionary))]
    causes = tuple(_cause(axis, named, k, chance[entry]) for k, entry in enumerate(named.entries))
    others = [int(k) for k in np.argsort(-np.array(chance)) if k not in named.entries and chance[k] >= WORTH_NAMING]
    alternatives = tuple(_first(axis, hypotheses, entry) for entry in others)
    seen, before, after = _seen(axis, raw, named), _left(axis, plain), _left(axis, named)
    explained = 1 - float(np.var(after) / np.var(before))
    nearly = explained >= NEARLY_ALL and np.var(before) >= GROSS * np.var(after)
    verdict = "named"
    if not named.entries or not (nearly or not _patterns(seen)):
        # Nothing is certain: a set of names where the likeliest of them leaves no pattern, else unknown.
        best = _seen(axis, raw, hypotheses[0])
        verdict = "ambiguous" if hypotheses[0].entries and not _patterns(best) else "unknown"
        alternatives, causes, gain = (*causes, *alternatives), (), None
    return AxisDiagnosis(joint, axis, verdict, p_value, hypotheses, named, causes, alternatives, withdrawn, explained, seen,
                         gain, stiffness, raw.deflection, _residuals(axis, raw, named))


def detection(axis: Axis, replicates: int, rng: np.random.Generator) -> float:
    """p-value of the plain spring against any single effect and all together: simulated from the plain fit with the noise's own
    memory, which is estimated again each time."""
    seen = _largest(axis)
    plain = solve(axis, axis.plain)
    wide = solve(axis, np.column_stack([axis.plain, *(group[len(group) // 2].columns for group in axis.dictionary)]))
    size = float(np.sqrt(wide.chi2 / max(1, wide.count - wide.coefficients.size)))
    as_large = 0
    for _ in range(replicates):
        noise = np.concatenate([axis.memory.simulate(size, length, rng) for length in axis.lengths])
        as_large += _largest(replace(axis, deflection=axis.plain @ plain.coefficients + noise)) >= seen
    return (as_large + 1) / (replicates + 1)


def _largest(axis: Axis) -> float:
    plain = solve(axis, axis.plain)
    tried = [shape.columns for group in axis.dictionary for shape in group]
    tried.append(np.column_stack([group[len(group) // 2].columns for group in axis.dictionary]))
    found: list[float] = []
    for columns in tried:
        one = solve(axis, np.column_stack([axis.plain, columns]))
        found.append(float(0.5 * one.count * np.log(plain.chi2 / one.chi2)) / float(columns.shape[1]) ** 0.5)
    return max(found)


def _at_work(hypotheses: tuple[Hypothesis, ...], entry: int) -> float:
    return float(min(1.0, sum(one.probability for one in hypotheses if entry in one.entries)))


def _first(axis: Axis, hypotheses: tuple[Hypothesis, ...], entry: int) -> LogCause:
    one = next(each for each in hypotheses if entry in each.entries)
    return _cause(axis, one, one.entries.index(entry), _at_work(hypotheses, entry))


def _cause(axis: Axis, one: Hypothesis, which: int, probability: float) -> LogCause:
    """A cause with its parameters; through the spring they are ratios, their spread to first order."""
    shape, kept = one.shapes[which], list(one.kept[which])
    spring = len(axis.lengths)
    place = spring + 1 + sum(len(each) for each in one.kept[:which])
    index = list(range(place, place + len(kept)))
    coefficients, covariance = one.solved.coefficients, one.solved.covariance
    c = float(coefficients[spring])
    wide = np.zeros(shape.columns.shape[1])
    wide[kept] = coefficients[index]
    values = shape.values(wide, c)
    std = np.full(len(values), np.nan)
    for column, k in zip(kept, index, strict=True):
        slope = np.zeros(len(coefficients))
        slope[k] = 1 / c if shape.through_spring else 1.0
        if shape.through_spring:
            slope[spring] = -coefficients[k] / c**2
        std[shape.free[column]] = float(np.sqrt(max(float(slope @ covariance @ slope), 0.0)))
    return LogCause(shape, axis.joint, probability, values, std)


def _left(axis: Axis, one: Hypothesis) -> Array:
    """Residual under the band (n,)."""
    return np.asarray(axis.deflection - one.columns(axis) @ one.solved.coefficients)


def _residuals(axis: Axis, raw: Axis, one: Hypothesis) -> Array:
    """Full-rate residuals (n, 2) of the plain straight line and of the hypothesis."""
    line = raw.plain @ straight_line(axis)
    extended = model_columns(raw, one) @ one.solved.coefficients if one.entries else line
    return np.column_stack([raw.deflection - line, raw.deflection - extended])


def _seen(axis: Axis, raw: Axis, one: Hypothesis) -> Remainder:
    return remainder(axis, _left(axis, one), raw.parts(_residuals(axis, raw, one)[:, 1]))


def _patterns(seen: Remainder) -> list[str]:
    return [name for name, _, p_value in seen.follows if p_value <= LEFT / len(seen.follows)]
