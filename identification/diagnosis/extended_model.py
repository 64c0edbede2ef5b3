"""The model to correct with after a diagnosis: effects of the robot in force, those of the measurement integrated out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from identification.common.arrays import rms
from identification.common.quantities import cause_words
from identification.diagnosis.attempt import attempt
from identification.diagnosis.judgement import Judgement
from identification.diagnosis.left_open import RobotPart, left_open
from identification.fit.discrepancy import discrepancies
from identification.fit.identifiability import grade_joints
from identification.fit.misfit import ModelCheck
from identification.fit.posterior import Posterior
from identification.model.effects_in_force import EffectInForce
from identification.model.gravity import fall_in_base
from identification.model.stiffness import IdentifiedModel

# Of many causes that cannot be told apart so many are told by name.
MOST_TOLD = 4
UNSETTLED = "the springs, or the gain of the force measurement, changed while they were measured: measure again, warmed up"


def extended_model(judgement: Judgement) -> IdentifiedModel:
    """The model to correct with: extended by what is named, with the laws that its effects were seen to follow; of an ambiguous
    answer by its likeliest candidate, as uncertain as all of them are together; the plain one where there is neither."""
    plain = judgement.plain
    fitted = judgement.carried or plain
    robot = RobotPart.of(fitted)
    covariance, interval = left_open(robot, judgement.rivals)
    inside = tuple(EffectInForce(term.effect, term.joint) for term in robot.terms)
    check = _check(judgement)
    grades = grade_joints(fitted.of_joints(), replace(check, rejected=check.rejected or judgement.verdict == "ambiguous"))
    differs = fitted.components.setup_relative
    figures: dict[str, Any] = {"rows": len(judgement.rows), "residual_rms_um": 1e6 * rms(fitted.residual), "chi2": fitted.chi2,
               "dof": fitted.readings - len(fitted.map), "noise_scale": fitted.components.sensor,
               "noise": {"setup_relative": differs}, "diagnosis": judgement.verdict, "model_check": check.as_dict(),
               "measurement_effects": [term.label for term in judgement.extended.terms if not term.effect.of_robot]}
    cell = plain.data.cell
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, robot.centre, covariance,
                           tuple(grade.grade for grade in grades), figures, inside,
                           fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre, interval=interval,
                           differs=differs, made_from=judgement.rows.made_from)


def _check(judgement: Judgement) -> ModelCheck:
    """Whether the model that is written explains the rows: with the causes named it does, or with those that may be, plain
    springs where they are adequate, unless they changed meanwhile; where a cause is unknown, or the table may be wrong as well,
    they are known to be wrong."""
    if judgement.verdict in ("adequate", "named"):
        detection = judgement.adequacy or judgement.detection
        return ModelCheck(detection.p_value, judgement.unsettled, UNSETTLED if judgement.unsettled else "")
    told, more = judgement.alternatives[:MOST_TOLD], len(judgement.alternatives[MOST_TOLD:])
    labels = [*(cause.label for cause in told), *(mistake.key for mistake in judgement.mistakes)]
    names = " or ".join([*map(cause_words, labels), *([f"{more} more"] if more else [])])
    seen = {"ambiguous": f"{names}: the data cannot tell which"}.get(judgement.verdict, "; ".join(judgement.patterns[:2]))
    return ModelCheck(judgement.detection.p_value, judgement.carried is None or judgement.unsettled,
                      seen or "a cause that the dictionary does not have")


def with_free_laws(extended: Posterior) -> Posterior:
    """The extended model fitted again with the laws of its effects free within what real ones differ by; the same where that
    does not converge."""
    terms = tuple(replace(term, start=values) for term, values in zip(extended.terms, extended.term_values, strict=True))
    free = discrepancies(extended.load_state, terms)
    return (attempt(extended.data, (*terms, *free), extended) if free else None) or extended
