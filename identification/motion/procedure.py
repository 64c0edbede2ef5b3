"""What a plain spring gets wrong in joint deflection logs: detect, name, extend, test what is left, measure the gain.

The rules are those of measured TCP deflections (docs/effects.md), joint by joint; the noise is autocorrelated everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import error
from identification.model.effects.gear_damping import GearDamping
from identification.model.effects.transmission_error import TransmissionError
from identification.motion.axis import Axis, Solved, axis_of, solve, straight_line
from identification.motion.axis_diagnosis import AxisDiagnosis
from identification.motion.band import BAND
from identification.motion.causes import LogCause, cause_of, leap_causes, transmission_cause
from identification.motion.crosstalk import with_crosstalk
from identification.motion.dictionary import LINK_DELAY, TORQUE_DELAY
from identification.motion.inner_friction import without_torque_noise
from identification.motion.leaps import find_leaps, without
from identification.motion.log_file import MotionLog
from identification.motion.prediction import held_out, model_columns
from identification.motion.products import products
from identification.motion.proxies import stands_for_torque, without_proxies
from identification.motion.remainder import Remainder, remainder
from identification.motion.search import Hypothesis, fitted, survey
from identification.motion.stiffness import axis_stiffness
from identification.motion.transmission import ODDS, Transmission, evidence_beside, find_transmission
from identification.motion.zeros import zero_shifts

Array = NDArray[np.float64]
Hypotheses = tuple[Hypothesis, ...]
ALARM, REPLICATES = 0.05, 99
CERTAIN = 0.95
# A misfit explained to this share has its cause, though something is left.
NEARLY_ALL = 0.95
WORTH_NAMING, WORTH_KEEPING, WORTH_AVERAGING = 0.02, 0.5, 1e-3
# Effects that are looked for one at a time, for they are others' columns.
NOT_TOGETHER = (TransmissionError.name, GearDamping.name)
# Lag [s] of a twist behind its torque that is no fault: twice what is typical, a damping ratio of 2 % at 10 Hz.
OF_A_GEAR = 2 * GearDamping.parameters[0].typical
# A recorder's delay is no shorter than this share of a sample; a parameter is clear of nothing by so many of its sigmas.
LEAST_DELAY, CLEAR = 0.01, 2.0


@dataclass(frozen=True, eq=False)
class _Measured:
    """At full rate (n,) [rad]: the deflection as it was measured, and what the straight line leaves of it. cleared: whether
    something was taken out of the records before the causes were asked for."""

    deflection: Array
    beside_line: Array
    cleared: bool


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
    joint: int, measured_records: list[MotionLog], validate: MotionLog | None, alarm: float, replicates: int,
    rng: np.random.Generator,
) -> AxisDiagnosis:
    whole = axis_of(joint, measured_records, BAND)
    leaps = find_leaps(joint, [*measured_records, *([] if validate is None else [validate])])
    records = without(leaps, measured_records)
    validate = None if validate is None else without(leaps, [validate])[0]
    found = _needed(find_transmission(joint, records, validate), records)
    cleaned, smooth = found.cleaned(records), found.smooth_over(records)
    axis = without_torque_noise(axis_of(joint, cleaned, BAND, smooth) if found.named or leaps else whole)
    axis = with_crosstalk(without_proxies(axis))
    raw = axis_of(joint, cleaned, np.inf, smooth)
    line = np.concatenate([record.joints[joint].deflection for record in measured_records if joint in record.joints])
    measured = _Measured(line, line - raw.spring @ straight_line(whole), found.named or bool(leaps))
    p_value = detection(axis, replicates, rng)
    hypotheses = survey(axis)
    plain = _of_entries(hypotheses, set())
    assert plain is not None
    misfit = p_value <= max(alarm, 1 / (replicates + 1))
    named, withdrawn = _predictive(axis, hypotheses, plain, found, records, validate) if misfit else (plain, ())
    left = _remainder(axis, raw, named, measured)
    stiffness = axis_stiffness(joint, records, found)
    answer = AxisDiagnosis(
        axis=axis, verdict="unknown" if left.patterns else "adequate", p_value=min(p_value, found.p_value),
        hypotheses=hypotheses, named=named, left=left, stiffness=stiffness, deflection=measured.deflection,
        residuals=_residuals(raw, named, measured), withdrawn=withdrawn, transmission=found,
        leaps=leaps, records=tuple(records),
        zeros=zero_shifts(joint, named, found, [*records, *([] if validate is None else [validate])]))
    if not misfit and not found.named and not leaps:
        return answer
    causes, alternatives = _causes(axis, hypotheses, named) if misfit else ((), ())
    if found.named:
        alternatives = tuple(cause for cause in alternatives if cause.shape.name != TransmissionError.name)
        causes = (*causes, transmission_cause(axis, named, found, records))
    predicting, causes = bool(causes), (*causes, *leap_causes(leaps))
    # What a leap took is no misfit that the other causes explain.
    told = axis_of(joint, records, BAND) if leaps else whole
    before, after = told.deflection - told.plain @ solve(told, told.plain).coefficients, _left(axis, named)
    explained = 1 - float(np.var(after) / np.var(before))
    if enough(causes, explained, left.patterns):
        # What happened at one moment predicts no other.
        gain = held_out(joint, BAND, named, found, records, validate)[0] if predicting else None
        return replace(answer, verdict="named", causes=causes, alternatives=alternatives, explained=explained, gain=gain)
    if leaps:
        # What happened at one moment is sure, whatever else is there.
        events = leap_causes(leaps)
        others = tuple(cause for cause in causes if cause.shape.effect not in [event.shape.effect for event in events])
        return replace(answer, verdict="named", causes=events, alternatives=(*others, *alternatives), explained=explained)
    damped = None if causes else _damped(axis, hypotheses)
    if damped is not None and not _remainder(axis, raw, damped, measured).patterns:
        return replace(answer, verdict="adequate", damping=cause_of(axis, damped, 0, 1.0), explained=explained)
    # Nothing is certain: a set of names where the likeliest of them leaves no pattern, else unknown.
    best = hypotheses[0]
    open_set = best.entries and not _remainder(axis, raw, best, measured).patterns
    return replace(answer, verdict="ambiguous" if open_set else "unknown", alternatives=(*causes, *alternatives),
                   explained=explained)


def enough(causes: Sequence[object], explained: float, patterns: Sequence[object]) -> bool:
    """Whether there are causes that leave no pattern, or explain nearly all of the misfit."""
    return bool(causes) and (explained >= NEARLY_ALL or not patterns)


def _damped(axis: Axis, hypotheses: Hypotheses) -> Hypothesis | None:
    """A gear that is damped as gears are, where nothing else is as likely; a torque recorded early is the same column."""
    alone = {hypothesis.names: hypothesis for hypothesis in hypotheses if len(hypothesis.names) == 1}
    damped, early = alone.get((GearDamping.name,)), alone.get((TORQUE_DELAY,))
    if damped is None:
        return None
    same = [one for one in (damped, early) if one is not None]
    others = max(one.probability for one in hypotheses if one not in same)
    lag = float(cause_of(axis, damped, 0, 1.0).values[0])
    return damped if sum(one.probability for one in same) >= others and lag <= OF_A_GEAR else None


def _needed(found: Transmission, records: list[MotionLog]) -> Transmission:
    """The transmission error without a smooth part that other causes of the dictionary do as well, or that is the torque's."""
    smooth = found.smooth_over(records)
    if smooth is None:
        return found
    axis = axis_of(found.joint, found.cleaned(records), BAND)
    if stands_for_torque(axis, smooth):
        return replace(found, smooth_test=None)
    axis = with_crosstalk(axis)
    hypotheses = survey(axis)
    names = [group[0].name for group in axis.dictionary]
    if smooth.bend > 1:
        # No single wave of the dictionary stands for it.
        others = next(hypothesis for hypothesis in hypotheses if TransmissionError.name not in hypothesis.names)
        beside = replace(axis, smooth=smooth)
        needed = evidence_beside(beside, smooth, others.columns(axis), np.array([smooth.size]))[0] > np.log(ODDS)
    else:
        needed = (TransmissionError.name not in names
                  or _at_work(hypotheses, names.index(TransmissionError.name)) >= WORTH_KEEPING)
    return found if needed else replace(found, smooth_test=None)


def _of_entries(hypotheses: Hypotheses, entries: set[int]) -> Hypothesis | None:
    return next((hypothesis for hypothesis in hypotheses if set(hypothesis.entries) == entries), None)


def _predictive(
    axis: Axis, hypotheses: Hypotheses, plain: Hypothesis, found: Transmission, records: list[MotionLog],
    validate: MotionLog | None,
) -> tuple[Hypothesis, tuple[str, ...]]:
    """The hypothesis of all certain causes that also predict what was not fitted, and the names of the others. A transmission
    error is certain only where it was found again: here it keeps names from others."""
    certain = {entry for entry in range(len(axis.dictionary)) if _at_work(hypotheses, entry) >= CERTAIN
               and axis.dictionary[entry][0].name != TransmissionError.name and _told(axis, hypotheses, entry)}
    named = next((hypothesis for hypothesis in hypotheses if certain and set(hypothesis.entries) == certain),
                 next(hypothesis for hypothesis in hypotheses if set(hypothesis.entries) <= certain))
    if not named.entries:
        return named, ()
    helps = held_out(axis.joint, axis.band, named, found, records, validate)[1]
    withdrawn = tuple(name for name, good in zip(named.names, helps, strict=True) if not good)
    kept = {entry for entry, good in zip(named.entries, helps, strict=True) if good}
    return _of_entries(hypotheses, kept) or plain, withdrawn


def _told(axis: Axis, hypotheses: Hypotheses, entry: int) -> bool:
    """Whether any parameter is clear of nothing, whatever is beside it; and an encoder not late by less than clocks are told
    apart: friction inside a gear looks so."""
    cause = _averaged(axis, hypotheses, entry, _likeliest(axis, hypotheses, entry, 1.0))
    if axis.dictionary[entry][0].name == LINK_DELAY and abs(cause.values[0]) < LEAST_DELAY / max(axis.rates):
        return False
    return bool(np.any(np.abs(cause.values[np.isfinite(cause.std)]) > CLEAR * cause.std[np.isfinite(cause.std)]))


def _causes(
    axis: Axis, hypotheses: Hypotheses, named: Hypothesis
) -> tuple[tuple[LogCause, ...], tuple[LogCause, ...]]:
    """The named causes, and all others worth a name, the likeliest first."""
    chance = [_at_work(hypotheses, entry) for entry in range(len(axis.dictionary))]
    causes = tuple(_averaged(axis, hypotheses, entry, cause_of(axis, named, k, chance[entry]))
                   for k, entry in enumerate(named.entries))
    others = [int(k) for k in np.argsort(-np.array(chance)) if k not in named.entries and chance[k] >= WORTH_NAMING]
    return causes, tuple(_likeliest(axis, hypotheses, entry, chance[entry]) for entry in others)


def _averaged(axis: Axis, hypotheses: Hypotheses, entry: int, cause: LogCause) -> LogCause:
    """The cause with its parameters as the sets that have it in this shape have them, each as likely as it is: what else is at
    work beside it, and is not certain, is in their spread."""
    having = [one for one in hypotheses if entry in one.entries and one.probability > WORTH_AVERAGING]
    told = [(one.probability, cause_of(axis, one, one.entries.index(entry), cause.probability)) for one in having]
    told = [(weight, one) for weight, one in told if one.shape is cause.shape and np.array_equal(
        np.isfinite(one.std), np.isfinite(cause.std))]
    if not told:
        return cause
    weight = np.array([one for one, _ in told]) / sum(one for one, _ in told)
    values, std = np.array([one.values for _, one in told]), np.array([one.std for _, one in told])
    mean = weight @ values
    return replace(cause, values=mean, std=np.sqrt(weight @ (std**2 + (values - mean) ** 2)))


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
    """The largest score of one effect, or of all together, whose known signs are theirs: acceleration and angle can say what
    the torque is without its noise, but then the motor's inertia is negative. The angle is judged alone."""
    of_all = products(axis)
    plain = of_all.solve(of_all.places((), ()))
    scores = [0.0]
    for shape in (shape for group in axis.dictionary for shape in group):
        solved = of_all.solve(of_all.places((shape,), (range(shape.columns.shape[1]),)))
        if np.all(solved.coefficients[of_all.plain:] * shape.signs >= 0):
            scores.append(_score(plain, solved))
    together = tuple(k for k, group in enumerate(axis.dictionary) if group[0].name not in NOT_TOGETHER)
    widest = fitted(of_all, together, tuple(axis.dictionary[k][len(axis.dictionary[k]) // 2] for k in together), plain)
    return max(*scores, 0.0 if widest is None else _score(plain, widest.solved))


def _score(plain: Solved, solved: Solved) -> float:
    free = float(solved.coefficients.size - plain.coefficients.size)
    return float(0.5 * solved.count * np.log(plain.chi2 / solved.chi2) / np.sqrt(max(free, 1.0)))


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


def _residuals(raw: Axis, hypothesis: Hypothesis, measured: _Measured) -> Array:
    """Full-rate residuals (n, 2) of the plain straight line and of the extended model."""
    if not hypothesis.entries and not measured.cleared:
        return np.column_stack([measured.beside_line, measured.beside_line])
    return np.column_stack([measured.beside_line,
                            raw.deflection - model_columns(raw, hypothesis) @ hypothesis.solved.coefficients])


def _remainder(axis: Axis, raw: Axis, hypothesis: Hypothesis, measured: _Measured) -> Remainder:
    full = _residuals(raw, hypothesis, measured)[:, 1]
    return remainder(axis, _left(axis, hypothesis), raw.parts(full))
