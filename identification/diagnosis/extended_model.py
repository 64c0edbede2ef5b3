"""The model to correct with after a diagnosis: effects of the robot in force, those of the measurement integrated out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identification.common.arrays import rms
from identification.common.quantities import cause_words
from identification.diagnosis.attempt import attempt
from identification.diagnosis.judgement import Judgement
from identification.fit.discrepancy import discrepancies
from identification.fit.identifiability import grade_joints
from identification.fit.misfit import ModelCheck
from identification.fit.posterior import Posterior
from identification.model.effects_in_force import EffectInForce
from identification.model.gravity import fall_in_base
from identification.model.stiffness import IdentifiedModel

UNSETTLED = "the springs, or the gain of the force measurement, changed while they were measured: measure again, warmed up"


def extended_model(judgement: Judgement) -> IdentifiedModel:
    """The extended model as stiffness.json carries it, with the laws that its effects were seen to follow; the plain one where
    nothing is named."""
    plain = judgement.plain
    fitted = judgement.carried or plain
    kept, inside, place = list(range(6)), [], 6
    for term in fitted.terms:
        if term.effect.of_robot:
            kept += range(place, place + len(term.start))
            inside.append(EffectInForce(term.effect, term.joint))
        place += len(term.start)
    # Parameters that do not enter linearly can trade with the springs along a curve: then the posterior's mean lies off it, and
    # the model with it is none of those that are likely.
    centre = fitted.likeliest if inside else fitted.mean
    mean, covariance = centre[kept], fitted.covariance[np.ix_(kept, kept)]
    interval = fitted.draws.interval(0.95)[kept]
    check = _check(judgement)
    grades = grade_joints(fitted.of_joints(), check)
    differs = fitted.components.setup_relative
    figures: dict[str, Any] = {"rows": len(judgement.rows), "residual_rms_um": 1e6 * rms(fitted.residual), "chi2": fitted.chi2,
               "dof": fitted.readings - len(fitted.map), "noise_scale": fitted.components.sensor,
               "noise": {"setup_relative": differs}, "diagnosis": judgement.verdict, "model_check": check.as_dict(),
               "measurement_effects": [term.label for term in judgement.extended.terms if not term.effect.of_robot]}
    cell = plain.data.cell
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, mean, covariance,
                           tuple(grade.grade for grade in grades), figures, tuple(inside),
                           fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre, interval=interval,
                           differs=differs, made_from=judgement.rows.made_from)


def _check(judgement: Judgement) -> ModelCheck:
    """Whether the model that is written explains the rows: with the causes named it does, plain springs where they are
    adequate, unless they changed meanwhile; where a cause is unknown, or one of several, they are known to be wrong."""
    if judgement.verdict in ("adequate", "named"):
        detection = judgement.adequacy or judgement.detection
        return ModelCheck(detection.p_value, judgement.unsettled, UNSETTLED if judgement.unsettled else "")
    names = " or ".join(cause_words(cause.label) for cause in judgement.alternatives[:4])
    seen = {"ambiguous": f"{names}: the data cannot tell which"}.get(judgement.verdict, "; ".join(judgement.patterns[:2]))
    return ModelCheck(judgement.detection.p_value, True, seen or "a cause that the dictionary does not have")


def with_free_laws(extended: Posterior) -> Posterior:
    """The extended model fitted again with the laws of its effects free within what real ones differ by; the same where that
    does not converge."""
    terms = tuple(replace(term, start=values) for term, values in zip(extended.terms, extended.term_values, strict=True))
    free = discrepancies(extended.load_state, terms)
    return (attempt(extended.data, (*terms, *free), extended) if free else None) or extended
