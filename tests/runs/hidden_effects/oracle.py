"""The model that is told what was hidden: what a perfect diagnosis could give."""

from __future__ import annotations

import numpy as np

from identification.fit.fitted_model import Term, predicted_deflection, situation_of
from identification.fit.posterior import Posterior, posterior
from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import effects
from identification.model.effects.sensor_step import SensorStep
from tests.virtual_cell.cell import Case

# Where the hidden law is another than the dictionary's, its parameters have no one true value.
OTHER_LAW = frozenset({"soft_zone", "hysteresis", "drift", "creep"})


def true_terms(cell: Cell, rows: Measurements, case: Case) -> tuple[Term, ...] | None:
    """The hidden effects by the dictionary's laws, started at the truth; None where it cannot be said in those terms."""
    where = situation_of(cell, rows, 1 / case.stiffness)
    terms = []
    for truth in case.truth:
        values, effect = truth["parameters"], effects().get(truth["effect"])
        if effect is None or "single_row" in values:
            return None
        if effect.name == "sensor_step":
            effect = SensorStep("pose", values["pose"]) if "pose" in values else SensorStep("row", values["row"])
        start = np.array([values[parameter.name] for parameter in effect.parameters])
        terms.append(Term(effect, truth["joint"], start, effect.typical(where, truth["joint"]), effect.neutral(where)))
    return tuple(terms)


def oracle(cell: Cell, measurements: Measurements, case: Case) -> Posterior | None:
    """The fit with the true effects in force."""
    rows = measurements.select(~measurements.validate)
    terms = true_terms(cell, rows, case)
    return None if terms is None else posterior(cell, rows, PriorModel(cell.prior), terms)


def squares_left(cell: Cell, measurements: Measurements, model: Posterior) -> float:
    """Sum of squares [um^2] of what the model leaves on the validation rows."""
    kept = measurements.select(measurements.validate)
    off = kept.deflection - predicted_deflection(cell, kept, model.map, model.terms)
    return float(np.nansum((1e6 * off) ** 2))
