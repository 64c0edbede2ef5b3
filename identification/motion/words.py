"""A diagnosis or a fit of joint deflection logs in plain words, for the terminal."""

from __future__ import annotations

import numpy as np

from identification.model.stiffness import IdentifiedModel
from identification.motion.procedure import AxisDiagnosis, LogCause, LogDiagnosis
from identification.motion.record import MICRO, sentence
from identification.motion.stiffness import AxisStiffness


def summary(found: LogDiagnosis) -> list[str]:
    """The answer, joint by joint."""
    lines = [f"verdict: {found.verdict}"]
    for one in found.axes:
        lines += _axis(one)
    return lines


def _axis(one: AxisDiagnosis) -> list[str]:
    total = float(np.var(one.deflection))
    before, after = (float(np.std(one.residuals[:, k])) for k in range(2))
    lines = [f"joint {one.joint}: a straight line through the gear-side torque leaves {MICRO * before:.0f} urad RMS and "
             f"explains {100 * (1 - before**2 / total):.0f} % of the variance (p = {one.p_value:.2g})"]
    if one.verdict == "adequate":
        lines.append("  adequate: the plain spring explains the log to its noise")
    for cause in one.causes:
        lines.append(f"  named: {sentence(cause)} ({cause.label}: {values(cause)}; probability {cause.probability:.3f})")
    if one.verdict == "ambiguous":
        lines.append("  ambiguous: " + ", ".join(f"{cause.label} {cause.probability:.2f}" for cause in one.alternatives))
    elif one.verdict == "unknown":
        lines.append("  unknown: no cause in the dictionary explains it")
    elif one.alternatives:
        lines.append("  beside it perhaps (this log does not settle it): "
                     + ", ".join(f"{cause.label} {cause.probability:.2f}" for cause in one.alternatives[:5]))
    if one.withdrawn:
        lines.append(f"  withdrawn: {', '.join(one.withdrawn)} fits here but does not predict what was not fitted")
    if one.causes:
        lines.append(f"  extended model: {MICRO * after:.0f} urad RMS, {100 * (1 - after**2 / total):.1f} % of the variance")
    gain = one.gain
    if gain is not None:
        lines.append(f"  gain where it was not fitted ({gain.held_out}): {MICRO * gain.before:.0f} -> {MICRO * gain.after:.0f} "
                     f"urad RMS, ratio {gain.ratio:.1f} ({gain.interval[0]:.1f} ... {gain.interval[1]:.1f})")
    lines.append("  " + stiffness_words(one.stiffness))
    return lines


def values(cause: LogCause) -> str:
    """The parameters with their uncertainty."""
    told = []
    for parameter, value, std in zip(cause.shape.effect.parameters, cause.values, cause.std, strict=True):
        if np.isfinite(std):
            told.append(f"{parameter.name} = {value:.4g} +- {std:.2g} {parameter.unit}")
        elif parameter.shape:
            told.append(f"{parameter.name} = {value:.4g} {parameter.unit}")
    return ", ".join(told)


def stiffness_words(one: AxisStiffness) -> str:
    """One line of a joint's stiffness."""
    low, high = one.interval_95
    if one.refused:
        return f"k{one.joint} refused: {one.reason}"
    return f"k{one.joint} = {1 / one.compliance:.3g} N m/rad ({low:.3g} ... {high:.3g}), {one.grade}"


def stiffness_table(model: IdentifiedModel, joints: list[AxisStiffness]) -> list[str]:
    """The fit as a table, then what each joint's log told."""
    lines = ["joint   stiffness k [N m/rad]   95 % interval                grade"]
    for joint, (k, (low, high), grade) in enumerate(
            zip(model.stiffness, model.interval_95, model.grades, strict=True), start=1):
        interval = f"{low:.3g} ... {high:.3g}"
        lines.append(f"k{joint}      {k:<22.3g}  {interval:<27}  {grade}")
    for one in joints:
        lines.append(f"k{one.joint}: {one.reason}; {one.samples} samples, worth {one.worth:.0f} independent ones")
        for name, c, std in one.records:
            lines.append(f"  {name}: k = {1 / c:.3g} N m/rad (c = {c:.2e} +- {std:.1e})")
    return lines
