"""LogCause: an effect that a joint deflection log names, with its parameters and their spread."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.quantities import parameter_words, quantity, two_sigma
from identification.model.effects.transmission_error import TransmissionError
from identification.motion.axis import Axis
from identification.motion.dictionary import Shape
from identification.motion.leaps import KINDS, Leap
from identification.motion.lines import shared
from identification.motion.log_file import MotionLog
from identification.motion.search import Hypothesis
from identification.motion.stiffness import finite_or_none
from identification.motion.transmission import Transmission

Array = NDArray[np.float64]
TRANSMISSION = Shape(TransmissionError(), np.full(4, np.nan), (), np.empty((0, 0)), False, ())
# How sure a smooth part is whose ratio's 95 % interval stands above one.
SMOOTH_SURE = 0.975


@dataclass(frozen=True, eq=False)
class LogCause:
    """An effect at a joint with its probability. values, std (P,): its parameters, NaN where the log does not tell them. told:
    the parameters in words, where their list does not say it."""

    shape: Shape
    joint: int
    probability: float
    values: Array
    std: Array
    told: str = ""

    @property
    def label(self) -> str:
        """channel_delay (link) [1]."""
        return f"{self.shape.name} [{self.joint}]"

    @property
    def sentence(self) -> str:
        """The cause in plain words."""
        effect = self.shape.effect
        if effect.where.get("channel") == "link":
            late = "behind" if self.values[0] > 0 else "ahead of"
            return (f"the link encoders were recorded {late} the motor encoders: what looks like deflection is distance "
                    "travelled")
        return effect.told(self.joint)

    @property
    def estimates(self) -> str:
        """The parameters with their uncertainty, in words."""
        if self.told:
            return self.told
        estimates = []
        for parameter, value, std in zip(self.shape.effect.parameters, self.values, self.std, strict=True):
            if np.isfinite(std):
                estimates.append(f"{parameter_words(parameter.name)} {quantity(value, std, parameter.unit)}")
            elif parameter.shape:
                estimates.append(f"{parameter_words(parameter.name)} {quantity(value, 0.0, parameter.unit)}")
        return ", ".join(estimates)

    def as_dict(self) -> dict[str, Any]:
        """What names it, JSON values."""
        effect = self.shape.effect
        return {"effect": effect.name, "joint": self.joint if effect.joints else None, **effect.where,
                "probability": self.probability}


def cause_of(axis: Axis, hypothesis: Hypothesis, which: int, probability: float) -> LogCause:
    """A hypothesis' effect with its parameters; through the spring they are ratios, their spread to first order."""
    shape, kept = hypothesis.shapes[which], list(hypothesis.kept[which])
    spring = len(axis.lengths)
    place = axis.plain.shape[1] + sum(map(len, hypothesis.kept[:which]))
    index = list(range(place, place + len(kept)))
    coefficients, covariance = hypothesis.solved.coefficients, hypothesis.solved.covariance
    c = float(coefficients[spring])
    of_shape = np.zeros(shape.columns.shape[1])
    of_shape[kept] = coefficients[index]
    values = shape.values(of_shape, c)
    std = np.full(len(values), np.nan)
    for column, k in zip(kept, index, strict=True):
        slope = np.zeros(len(coefficients))
        slope[k] = 1 / c if shape.through_spring else 1.0
        if shape.through_spring:
            slope[spring] = -coefficients[k] / c**2
        std[shape.free[column]] = float(np.sqrt(max(float(slope @ covariance @ slope), 0.0)))
    return LogCause(shape, axis.joint, probability, values, std)


def transmission_cause(axis: Axis, hypothesis: Hypothesis, found: Transmission, records: list[MotionLog]) -> LogCause:
    """The transmission error as a cause: its parameters are those of the smooth part and of the strongest line."""
    values, std = np.full(4, np.nan), np.full(4, np.nan)
    values[:2] = 0.0
    told, p_value = [], 1 - SMOOTH_SURE
    if found.confirmed:
        sizes = [found.amplitudes([record]) for record in records if axis.joint in record.joints]
        size = shared(sizes)
        k = int(np.argmax(np.abs(size)))
        strongest = found.confirmed[k]
        values[1:] = abs(size[k]), strongest.cycles, np.angle(sizes[0][k])
        std[2] = strongest.std
        told.append(f"{len(size)} line{'s' if len(size) > 1 else ''}, the strongest {1e6 * values[1]:.1f} urad at "
                    f"{strongest.cycles:.1f} +- {two_sigma(strongest.std):.1f} cycles a turn")
        p_value = min(line.again for line in found.confirmed)
    if axis.smooth is not None:
        part = slice(axis.spring.shape[1], axis.plain.shape[1])
        values[0] = float(np.std(axis.plain[:, part] @ hypothesis.solved.coefficients[part]))
        told.append(f"a smooth part of {1e6 * values[0]:.0f} urad RMS over {np.degrees(np.ptp(axis.angle)):.0f} deg")
    return LogCause(TRANSMISSION, axis.joint, 1 - p_value, values, std,
                    f"{' and '.join(told)}, found again in {found.again_on}")


def leap_causes(leaps: tuple[Leap, ...]) -> tuple[LogCause, ...]:
    """One cause for all leaps of a kind: its parameters are those of the largest."""
    causes = []
    for kind in KINDS:
        of_kind = [leap for leap in leaps if leap.effect is kind]
        if of_kind:
            largest = max(of_kind, key=lambda leap: abs(leap.size))
            shape = Shape(kind, largest.values, (), np.empty((0, 0)), False, ())
            causes.append(LogCause(shape, largest.joint, 1 - max(leap.p_value for leap in of_kind), largest.values,
                                   np.array([largest.std, np.nan]), "; ".join(leap.words for leap in of_kind)))
    return tuple(causes)


def over_joints(causes: Iterable[LogCause]) -> list[list[LogCause]]:
    """Causes that belong to no joint are one, whatever joints show them."""
    groups: dict[str, list[LogCause]] = {}
    for cause in causes:
        groups.setdefault(cause.label if cause.shape.effect.joints else cause.shape.name, []).append(cause)
    return list(groups.values())


def group_as_dict(group: list[LogCause]) -> dict[str, Any]:
    """One cause as diagnosis.json has it, its parameters pooled over the joints that show it."""
    effect = group[0].shape.effect
    parameters: dict[str, Any] = {}
    for k, parameter in enumerate(effect.parameters):
        value, std = _pooled([(cause.values[k], cause.std[k]) for cause in group])
        parameters[parameter.name] = {"estimate": finite_or_none(np.clip(value, parameter.low, parameter.high)), "std": std,
                                      "unit": parameter.unit}
    content = group[0].as_dict() | {
        "probability": min(cause.probability for cause in group), "family": effect.family, "of_robot": effect.of_robot,
        "sentence": group[0].sentence, "parameters": parameters}
    if len(group) > 1:
        content["by_joint"] = {
            str(cause.joint): {parameter.name: {"estimate": float(cause.values[k]), "std": finite_or_none(cause.std[k])}
                               for k, parameter in enumerate(effect.parameters)} for cause in group}
    return content


def _pooled(values: list[tuple[float, float]]) -> tuple[float, float | None]:
    """Weighted mean with its standard deviation, widened where the values differ by more than theirs (Birge's ratio)."""
    if len(values) == 1 or any(not np.isfinite(std) or std <= 0 for _, std in values):
        return float(np.mean([value for value, _ in values])), finite_or_none(values[0][1])
    value, std = np.array(values).T
    weight = std**-2 / np.sum(std**-2)
    mean = float(weight @ value)
    birge = max(1.0, float(np.sqrt(np.sum(((value - mean) / std) ** 2) / (len(values) - 1))))
    return mean, birge / float(np.sqrt(np.sum(std**-2)))
