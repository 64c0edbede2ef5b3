"""The model to correct with after a diagnosis: effects of the robot in force, those of the measurement integrated out."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import rms
from identification.diagnosis.judgement import Judgement
from identification.fit.identifiability import grade_joints
from identification.model.effects_in_force import EFFECTS, SPRINGS, EffectInForce
from identification.model.gravity import fall_in_base
from identification.model.stiffness import IdentifiedModel


def extended_model(judgement: Judgement) -> IdentifiedModel:
    """The extended model as stiffness.json carries it; the plain one where nothing is named."""
    plain, carried = judgement.plain, judgement.carried
    free, fitted = carried or plain, judgement.extended if carried else plain
    kept, inside, place = list(range(6)), [], 6
    for term in fitted.terms:
        if term.effect.of_robot:
            kept += range(place, place + len(term.start))
            inside.append(EffectInForce(term.effect, term.joint))
        place += len(term.start)
    mean, covariance = fitted.mean[kept], fitted.covariance[np.ix_(kept, kept)]
    interval = fitted.draws.interval(0.95)[kept]
    if free is not fitted:
        # The springs as they are with the effects' laws free; the effects by the dictionary's law, which is what is applied.
        mean[SPRINGS], covariance[SPRINGS, SPRINGS] = free.mean[SPRINGS], free.covariance[SPRINGS, SPRINGS]
        covariance[SPRINGS, EFFECTS] = covariance[EFFECTS, SPRINGS] = 0.0
        interval[SPRINGS] = free.draws.interval(0.95)[SPRINGS]
    figures = {"rows": len(judgement.rows), "residual_rms_um": 1e6 * rms(fitted.residual), "chi2": fitted.chi2,
               "dof": fitted.readings - len(fitted.map), "noise_scale": fitted.components.sensor,
               "diagnosis": judgement.verdict,
               "measurement_effects": [cause.label for cause in judgement.causes if not cause.effect.of_robot]}
    cell = plain.data.cell
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, mean, covariance,
                           tuple(grade.grade for grade in grade_joints(free.of_joints())), figures, tuple(inside),
                           fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre, interval=interval)
