"""The model that is fitted: six springs, and the effects beyond them that are in force.

x = (ln c (6,), parameters of each term). With no terms it is the plain model of compliance.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.compliance import equilibrium, loaded_angles, sensitivity
from identification.model.effects_in_force import STEP, EffectInForce
from identification.model.gravity import fall_in_base, gravity_torque
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# The prior of a parameter is this many typical sizes wide: what is met in practice, and generous.
WIDE = 5.0
# Rounds of the sag under the robot's own weight; each shrinks the error by a few thousandths.
SAG_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Term(EffectInForce):
    """An effect that is fitted. start (P,): where the search begins; scale (P,): typical sizes of the parameters here; neutral
    (P,): where the effect is absent."""

    start: Array
    scale: Array
    neutral: Array


def situation_of(cell: Cell, rows: Measurements, compliance: Array) -> LoadState:
    """What the effects may look at, on a robot with these springs (6,) [rad/(N m)], that sags under its own weight."""
    return LoadState(
        robot=cell.robot, flange_from_tcp=cell.flange_from_tcp, theta=sagged(cell, rows.theta, compliance),
        wrench=rows.wrench, compliance=compliance,
        visit=rows.visit, reference=rows.reference, time=rows.time, dwell=rows.dwell, row=rows.row, labels=rows.pose,
        fall=fall_in_base(cell.world_from_base), tool_mass=cell.tool_mass, tool_centre=cell.tool_centre)


def _gravity(cell: Cell, theta: Array) -> Array:
    return gravity_torque(cell.robot, theta, fall_in_base(cell.world_from_base), cell.tool_mass, cell.tool_centre)


def sagged(cell: Cell, theta: Array, compliance: Array) -> Array:
    """Controller angles (n, 6) [rad] at which a rigid robot stands where this one does under its own weight: the unloaded
    pose of a robot that is commanded to theta. The same as theta where the robot file has no `links`."""
    if cell.robot.link_mass is None:
        return theta
    found = theta
    for _ in range(SAG_ROUNDS):
        found = loaded_angles(cell.robot, theta, compliance * _gravity(cell, found))
    return found


def yields_to_gravity(cell: Cell, here: LoadState) -> Array:
    """How much further (n, 3) [m] the loaded robot yields because its weight has moved with it, first order: the change of
    the gravity torques turns the springs once more. 0.1 to 0.4 % of the deflection on the IRB 6660."""
    moved = _gravity(cell, here.loaded) - _gravity(cell, here.theta)
    return np.asarray(np.einsum("nri,ni->nr", here.jacobian[:, :3], here.compliance * moved))


def split(x: Array, terms: tuple[Term, ...]) -> list[Array]:
    """The parameter values of each term, from x (6 + P,)."""
    ends = np.cumsum([len(term.start) for term in terms])
    return np.split(x[6:], ends[:-1]) if terms else []


def added(where: LoadState, terms: tuple[Term, ...], x: Array) -> Array:
    """What the terms add to the readings (n, 3) [m]; those of the robot feel the force that really acted."""
    total = np.zeros((len(where), 3))
    felt = where
    for term, values in zip(terms, split(x, terms), strict=True):
        wrench = term.effect.true_wrench(where, term.joint, values)
        if wrench is not None:
            felt = replace(felt, wrench=felt.wrench + wrench - where.wrench)
    for term, values in zip(terms, split(x, terms), strict=True):
        total += term.effect.contribution(felt if term.effect.of_robot else where, term.joint, values)[:, :3]
    return total


def predicted_deflection(cell: Cell, rows: Measurements, x: Array, terms: tuple[Term, ...] = ()) -> Array:
    """Readings (n, 3) [m] the model gives for these rows; x (6 + P,)."""
    compliance = np.exp(x[:6])
    if not terms and cell.robot.link_mass is None:
        return equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, compliance).position
    here = situation_of(cell, rows, compliance)
    plain = here.elastic[:, :3]
    if cell.robot.link_mass is not None:
        plain = plain + yields_to_gravity(cell, here)
    return np.asarray(plain + added(here, terms, x))


def response(cell: Cell, rows: Measurements, x: Array, terms: tuple[Term, ...] = ()) -> tuple[Array, Array]:
    """Readings (n, 3) [m] and their derivative (n, 3, 6 + P) by x: exact for the springs (eq. 14), differences for terms."""
    compliance = np.exp(x[:6])
    here = situation_of(cell, rows, compliance)
    position, slope = sensitivity(cell.robot, here.theta, cell.flange_from_tcp, rows.wrench, compliance)
    slope = slope * compliance
    if cell.robot.link_mass is not None:
        position = position + yields_to_gravity(cell, here)
    if not terms:
        return position, slope
    base = added(here, terms, x)
    by_joint = np.empty((len(rows), 3, 6))
    for joint in range(6):
        moved = compliance.copy()
        moved[joint] *= np.exp(STEP)
        by_joint[:, :, joint] = (added(here.with_compliance(moved), terms, x) - base) / STEP
    by_parameter = np.empty((len(rows), 3, len(x) - 6))
    for k, size in enumerate(np.concatenate([term.scale for term in terms])):
        step = np.zeros_like(x)
        step[6 + k] = STEP * size
        by_parameter[:, :, k] = (added(here, terms, x + step) - added(here, terms, x - step)) / (2 * STEP * size)
    return position + base, np.concatenate([slope + by_joint, by_parameter], axis=2)


def with_terms(prior: PriorModel, terms: tuple[Term, ...]) -> PriorModel:
    """The prior with the effects' parameters: about the values where an effect is absent (about the start for those that do
    not enter linearly), several typical sizes wide, inside their bounds."""
    if not terms:
        return prior
    parameters = [parameter for term in terms for parameter in term.effect.parameters]
    start, scale, neutral = (np.concatenate([getattr(term, name) for term in terms]) for name in ("start", "scale", "neutral"))
    shape = np.array([parameter.shape for parameter in parameters])
    return replace(
        prior, term_mean=np.where(shape, start, neutral),
        term_std=np.where(shape, np.maximum(scale, np.abs(start)), WIDE * scale),
        term_low=np.array([parameter.low for parameter in parameters]),
        term_high=np.array([parameter.high for parameter in parameters]))
