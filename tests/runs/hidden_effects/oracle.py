"""The model that is told what was hidden: what a perfect diagnosis could give."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import Effect, effects
from identification.model.effects.encoder_zero import EncoderZero
from identification.model.effects.sensor_step import SensorStep
from identification.model.effects.transmission_error import BetweenPoses
from tests.virtual_cell.cell import Case

# Where the hidden law is another than the dictionary's, its parameters have no one true value.
OTHER_LAW = frozenset({"soft_zone", "hysteresis", "lost_motion", "drift", "creep"})


def at_its_place(effect: Effect, values: Mapping[str, Any]) -> Effect:
    """An effect that is bound to a row or a pose, where the truth has it; others as they are."""
    if effect.name == "sensor_step":
        return SensorStep("pose", values["pose"]) if "pose" in values else SensorStep("row", values["row"])
    if effect.name == "encoder_zero":
        return EncoderZero(values["row"])
    return BetweenPoses() if effect.name == "transmission_error" else effect


def true_terms(data: LoadTest, case: Case) -> tuple[Term, ...] | None:
    """The hidden effects by the dictionary's laws, started at the truth; None where it cannot be said in those terms."""
    state = data.load_state(1 / case.stiffness)
    terms = []
    for truth in case.truth:
        values, effect = truth["parameters"], effects().get(truth["effect"])
        if effect is None or "single_row" in values:
            return None
        effect = at_its_place(effect, values)
        start = np.array([values[parameter.name] for parameter in effect.parameters])
        terms.append(Term(effect, truth["joint"], start, effect.typical(state, truth["joint"]), effect.neutral(state)))
    return tuple(terms)


def oracle(cell: Cell, measurements: Measurements, case: Case) -> Posterior | None:
    """The fit with the true effects in force."""
    data = LoadTest.of(cell, measurements.select(~measurements.validate))
    terms = true_terms(data, case)
    return None if terms is None else posterior(data, terms)


def squares_left(measurements: Measurements, model: Posterior) -> float:
    """Sum of squares [um^2] of what the model leaves on the validation rows."""
    off = model.residual_of(model.data.with_rows(measurements.select(measurements.validate)))
    return float(np.nansum((1e6 * off) ** 2))
