"""LogCause: an effect that a joint deflection log names, with its parameters and their spread."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.motion.axis import Axis
from identification.motion.dictionary import Shape
from identification.motion.search import Hypothesis
from identification.motion.stiffness import finite_or_none

Array = NDArray[np.float64]


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

    @property
    def sentence(self) -> str:
        """The cause in plain words."""
        effect = self.shape.effect
        if effect.where.get("channel") == "link":
            late = "behind" if self.values[0] > 0 else "ahead of"
            return (f"the link encoders were recorded {late} the motor encoders: what looks like deflection is distance "
                    "travelled")
        return effect.sentence.format(joint=self.joint)

    @property
    def estimates(self) -> str:
        """The parameters with their uncertainty, in words."""
        estimates = []
        for parameter, value, std in zip(self.shape.effect.parameters, self.values, self.std, strict=True):
            if np.isfinite(std):
                estimates.append(f"{parameter.name} = {value:.4g} +- {std:.2g} {parameter.unit}")
            elif parameter.shape:
                estimates.append(f"{parameter.name} = {value:.4g} {parameter.unit}")
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
    place = spring + 1 + sum(map(len, hypothesis.kept[:which]))
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
        parameters[parameter.name] = {"estimate": float(np.clip(value, parameter.low, parameter.high)), "std": std,
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
