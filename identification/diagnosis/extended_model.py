"""The model to correct with after a diagnosis: effects of the robot in force, those of the measurement integrated out."""

from __future__ import annotations

import numpy as np

from identification.diagnosis.procedure import Diagnosis
from identification.diagnosis.record import residual, rms
from identification.fit.identifiability import grade_joints
from identification.model.cell import Cell
from identification.model.stiffness import EffectInForce, IdentifiedModel


def extended_model(cell: Cell, found: Diagnosis) -> IdentifiedModel:
    """The extended model as stiffness.json carries it; the plain one where nothing is named."""
    free, fitted = found.carried or found.plain, found.extended if found.carried else found.plain
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
        mean[:6], covariance[:6, :6] = free.mean[:6], free.covariance[:6, :6]
        covariance[:6, 6:] = covariance[6:, :6] = 0.0
        interval[:6] = free.draws.interval(0.95)[:6]
    joints = free.of_joints()
    grades = grade_joints(cell, found.rows, joints, joints.prior)
    figures = {"rows": len(found.rows), "residual_rms_um": 1e6 * rms(residual(cell, found, fitted)), "chi2": fitted.chi2,
               "dof": fitted.readings - len(fitted.map), "noise_scale": fitted.size.sensor, "diagnosis": found.verdict,
               "measurement_effects": [cause.label for cause in found.causes if not cause.effect.of_robot]}
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, mean, covariance,
                           tuple(grade.grade for grade in grades), figures, effects=tuple(inside), interval=interval)
