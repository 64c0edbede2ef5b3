"""The model that is fitted: six springs, and the effects beyond them that are in force.

x = (ln c (6,), parameters of each term). With no terms it is the plain model of compliance.py.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.measurements import Measurements
from identification.model.compliance import equilibrium, sensitivity
from identification.model.effects import Effect
from identification.model.gravity import fall_in_base
from identification.model.situation import Situation
from identification.priors import PriorModel

Array = NDArray[np.float64]
# Relative step of the differences by ln c and by the parameters: truncation and rounding both far under the noise.
STEP = 1e-3
# The prior of a parameter is this many typical sizes wide: what is met in practice, and generous.
WIDE = 5.0


@dataclass(frozen=True, eq=False)
class Term:
    """An effect in force at a joint (1-based, None where it belongs to none). start (P,): where the search begins; scale
    (P,): typical sizes of the parameters here; neutral (P,): where the effect is absent."""

    effect: Effect
    joint: int | None
    start: Array
    scale: Array
    neutral: Array

    @property
    def label(self) -> str:
        """backlash[1], or the effect's name where it belongs to no joint."""
        return self.effect.name if self.joint is None else f"{self.effect.name}[{self.joint}]"

    @property
    def names(self) -> list[str]:
        """The parameters' names as in stiffness.json."""
        return [f"{self.label}.{parameter.name}" for parameter in self.effect.parameters]


def situation_of(cell: Cell, rows: Measurements, compliance: Array) -> Situation:
    """What the effects may look at, on a robot with these springs (6,) [rad/(N m)]."""
    return Situation(
        robot=cell.robot, flange_from_tcp=cell.flange_from_tcp, theta=rows.theta, wrench=rows.wrench, compliance=compliance,
        visit=rows.visit, reference=rows.reference, time=rows.time, dwell=rows.dwell, row=rows.row, labels=rows.pose,
        fall=fall_in_base(cell.world_from_base), tool_mass=cell.tool_mass, tool_centre=cell.tool_centre)


def split(x: Array, terms: tuple[Term, ...]) -> list[Array]:
    """The parameter values of each term, from x (6 + P,)."""
    ends = np.cumsum([len(term.start) for term in terms])
    return np.split(x[6:], ends[:-1]) if terms else []


def added(where: Situation, terms: tuple[Term, ...], x: Array) -> Array:
    """What the terms add to the readings (n, 3) [m]."""
    total = np.zeros((len(where), 3))
    for term, values in zip(terms, split(x, terms), strict=True):
        total += term.effect.contribution(where, term.joint, values)[:, :3]
    return total


def predicted_deflection(cell: Cell, rows: Measurements, x: Array, terms: tuple[Term, ...] = ()) -> Array:
    """Readings (n, 3) [m] the model gives for these rows; x (6 + P,)."""
    compliance = np.exp(x[:6])
    plain = equilibrium(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, compliance).position
    return plain + added(situation_of(cell, rows, compliance), terms, x) if terms else plain


def response(cell: Cell, rows: Measurements, x: Array, terms: tuple[Term, ...] = ()) -> tuple[Array, Array]:
    """Readings (n, 3) [m] and their derivative (n, 3, 6 + P) by x: exact for the springs, differences for the terms."""
    compliance = np.exp(x[:6])
    position, slope = sensitivity(cell.robot, rows.theta, cell.flange_from_tcp, rows.wrench, compliance)
    slope = slope * compliance
    if not terms:
        return position, slope
    here = situation_of(cell, rows, compliance)
    base = added(here, terms, x)
    by_joint = np.empty((len(rows), 3, 6))
    for joint in range(6):
        moved = compliance.copy()
        moved[joint] *= np.exp(STEP)
        by_joint[:, :, joint] = (added(here.with_compliance(moved), terms, x) - base) / STEP
    columns, place = [slope + by_joint], 6
    for term in terms:
        for k, size in enumerate(term.scale):
            ahead = x.copy()
            ahead[place + k] += STEP * size
            behind = x.copy()
            behind[place + k] -= STEP * size
            one = (term,)
            mine = slice(place, place + len(term.scale))
            columns.append(((added(here, one, _with(ahead, mine)) - added(here, one, _with(behind, mine)))
                            / (2 * STEP * size))[:, :, None])
        place += len(term.scale)
    return position + base, np.concatenate(columns, axis=2)


def _with(x: Array, mine: slice) -> Array:
    """x of one term alone."""
    return np.concatenate([x[:6], x[mine]])


def with_terms(prior: PriorModel, terms: tuple[Term, ...]) -> PriorModel:
    """The prior with the effects' parameters: about the values where an effect is absent (about the start for those that do
    not enter linearly), several typical sizes wide, inside their bounds."""
    if not terms:
        return prior
    parameters = [parameter for term in terms for parameter in term.effect.parameters]
    start, scale, neutral = (np.concatenate([getattr(term, name) for term in terms]) for name in ("start", "scale", "neutral"))
    shape = np.array([parameter.shape for parameter in parameters])
    return replace(
        prior, term_mean=np.where(shape, start, neutral), term_std=np.where(shape, scale, WIDE * scale),
        term_low=np.array([parameter.low for parameter in parameters]),
        term_high=np.array([parameter.high for parameter in parameters]))
