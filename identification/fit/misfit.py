"""Does the model that was fitted explain its own rows? A cheap check of the six springs, which no stiffness passes by.

Score tests against kinds of columns that need no cause: a deflection that goes with the load in a way no joint can, gears whose
twist is not in proportion to their torque or changes with their angle, a robot that changes with time. For columns E, with the
stiffnesses free (projection as in subsets.py),

    b = E^T W (r - D step) ,   G = E^T W E - E^T W D (D^T W D + P)^-1 D^T W E ,   T = b^T G^+ b ,

and T / r over the residual's own variance is F-distributed with r, the rank of G, and the readings left, or as many degrees of
freedom as the noise's size in these directions is known with (noise_degrees.py): what the readings of a pose share is known
from the poses alone. D holds what the arm's unknown weight may do, too (sag.py). With the subset conflicts, family-wise by
Bonferroni; and noise far over the stated. What is off, and why, `compstiff diagnose` finds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.tails import f_tail
from identification.fit.noise import USUAL_FORCE_RELATIVE, USUAL_OFFSET_M, residual_std
from identification.fit.noise_degrees import NoiseDegrees, beside_the_springs
from identification.fit.noise_parts import ABSOLUTE, FORCE, MEMORY, OFFSET, SENSOR, SETUP, USUAL_SETUP, memory_of
from identification.fit.posterior import Posterior
from identification.fit.subsets import WORTH_DEGREES, Conflict
from identification.model.load_state import LoadState

Array = NDArray[np.float64]
# Rejected on purpose rarely: noise is a little other than its model on every cell, and a file that is rejected is refused.
REJECTED = 1e-3
# Columns whose information is under this share of the largest tell nothing by themselves.
RANK = 1e-6
# Readings a column must leave to the noise.
READINGS_A_COLUMN = 4
# Data sheets are nominal: a named cause may leave this many times the stated noise, a plain model that much more, with 95 %
# confidence.
GRANTED_AFTER_NAMING, GRANTED, ONE_SIDED_95 = 3.0, 4.0, 1.645
# A level and a square leave about a degree, so that a loading device may be set up by 2.5 % anew each time; readings that are
# alike by more than 0.86 follow something that happens while a pose is measured; and re-seating of 30 um, or a force that is
# 5 % off from row to row, is something that whoever measures knows of.
UNSTATED_GRANTED = {SETUP: 25.0, MEMORY: 60.0, OFFSET: 10.0, FORCE: 10.0}
# Set-ups of forces whose relative error is stated are held to that too, but for half a degree, which no data sheet knows.
HALF_A_DEGREE = 10.0
# What a sensor remembers matters to nobody where it scatters by less than this share of what is stated.
WORTH_REMEMBERING = 0.1
PARTS = {SENSOR: "sensor noise", FORCE: "force error", ABSOLUTE: "absolute force error", OFFSET: "re-seating",
         SETUP: f"force error between set-ups ({100 * USUAL_SETUP:g} % is usual)",
         MEMORY: "memory of the readings (odds of 0.1 are usual)"}
# Of a rig whose forces are stated.
STATED_SETUP = "force error between set-ups ({:g} % is stated of each force)"
# The same parts where no file states them.
UNSTATED = PARTS | {OFFSET: f"re-seating ({1e6 * USUAL_OFFSET_M:g} um is usual)",
                    FORCE: f"force error ({100 * USUAL_FORCE_RELATIVE:g} % is usual)"}


@dataclass(frozen=True)
class ModelCheck:
    """p_value: family-wise probability of a misfit as clear as this by chance. rejected: the model does not explain its rows.
    seen: the clearest misfit in words."""

    p_value: float
    rejected: bool
    seen: str

    def as_dict(self) -> dict[str, Any]:
        """JSON values, for stiffness.json."""
        return {"p_value": self.p_value, "rejected": self.rejected, "seen": self.seen}


def model_check(fitted: Posterior, conflicts: tuple[Conflict, ...]) -> ModelCheck:
    """The check of a plain model; conflicts: its subset conflicts."""
    degrees = NoiseDegrees(fitted, *beside_the_springs(fitted))
    found = [(_p_value(degrees, columns), words) for words, columns in _kinds(fitted.load_state)]
    tests = len(found) + 1
    found = [(min(tests * p, 1.0), words) for p, words in found]
    found += [(min(tests * conflict.corrected, 1.0), f"{conflict.part} and {conflict.rest} want different stiffnesses")
              for conflict in conflicts[:1]]
    beyond = "; ".join(needed(name, multiple) for name, multiple in beyond_stated(fitted, GRANTED).items())
    p_value, seen = min(found, default=(1.0, ""))
    if p_value >= REJECTED and beyond:
        return ModelCheck(p_value, True, beyond)
    return ModelCheck(p_value, p_value < REJECTED, seen)


def _kinds(state: LoadState) -> Iterator[tuple[str, Array]]:
    """The kinds of columns (n, 3, m) [m], each of a size that its own typical load makes, with what they stand for."""
    force, jacobian, torque = state.wrench[:, :3], state.jacobian[:, :3], state.torque
    axes = np.eye(3)
    yield ("the tool yields to a load in a direction that no joint explains",
           np.stack([force[:, j, None] * axes[i] for i in range(3) for j in range(3)], axis=2))
    in_tool = np.einsum("nij,ni->nj", state.tool, force)
    yield ("the tool yields in its own frame in a way that no joint explains",
           np.stack([state.tool[:, :, i] * in_tool[:, j, None] for i in range(3) for j in range(3)], axis=2))
    largest = np.maximum(np.abs(torque).max(axis=0), 1e-9)
    yield ("a joint's deflection is not in proportion to its torque",
           np.concatenate([jacobian * bent[:, None] for bent in (np.abs(torque), torque * np.abs(torque) / largest)], axis=2))
    own = jacobian * (state.compliance * torque)[:, None]
    yield ("a joint's stiffness changes with its angle",
           np.concatenate([own * np.cos(state.theta)[:, None], own * np.sin(state.theta)[:, None]], axis=2))
    order = np.linspace(-1.0, 1.0, len(state))
    yield ("the robot, or the sensors, change with time",
           np.concatenate([own * order[:, None, None], order[:, None, None] * axes[None]], axis=2))


def _p_value(degrees: NoiseDegrees, columns: Array) -> float:
    """Of one kind of columns (n, 3, m) [m] beside the design; 1 where too few readings are left to tell."""
    fitted, design, precision = degrees.fitted, degrees.design, degrees.precision
    at, weights = fitted.at_map, fitted.weights
    scale = np.sqrt(np.mean(columns**2, axis=(0, 1)))
    columns = at.noise.whitening @ (columns[:, :, scale > 0] / scale[scale > 0])
    inverse = np.linalg.inv(weights.inner(design, design) + precision)
    residual = at.residual[:, :, None]
    cross, of_residual = weights.inner(design, columns), weights.inner(design, residual)[:, 0]
    step = inverse @ of_residual
    score = weights.inner(columns, residual)[:, 0] - cross.T @ step
    gram = weights.inner(columns, columns) - cross.T @ inverse @ cross
    eigenvalues, vectors = np.linalg.eigh(gram)
    kept = eigenvalues > RANK * max(float(eigenvalues.max(initial=0.0)), 1e-30)
    rank = int(kept.sum())
    left = fitted.readings - 6 - rank
    if not rank or left < READINGS_A_COLUMN * rank:
        return 1.0
    explained = float(np.sum((vectors[:, kept].T @ score) ** 2 / eigenvalues[kept]))
    total = float(weights.inner(residual, residual)[0, 0] - of_residual @ step)
    variance = max(total - explained, 1e-12) / left
    p_value = float(f_tail(explained / rank / variance, rank, left))
    if p_value >= WORTH_DEGREES:
        return p_value
    known = degrees.along(columns, eigenvalues[kept], vectors[:, kept])
    return float(f_tail(explained / rank / variance, rank, min(left, known)))


def needed(part: str, multiple: float) -> str:
    """What the rows need of a part of the noise (`beyond_stated`), in words."""
    between, allowed = part.partition(" (")[::2]
    if between == PARTS[SETUP].partition(" (")[0]:
        return (f"the forces would have to differ by {100 * USUAL_SETUP * multiple:.2g} % from one set-up to the next "
                f"({allowed}")
    if part == PARTS[MEMORY]:
        alike, usual = memory_of(np.array([multiple, 1.0]))
        return f"the readings of a pose would have to be alike by {100 * alike:.0f} % ({100 * usual:.0f} % is usual)"
    of_what = "the stated" if part in PARTS.values() else "that"
    return f"the {part} would have to be {multiple:.1f} times {of_what}"


def far_off(fitted: Posterior) -> float:
    """RMS of the residual over what the noise allows, its heavy tails with it: 1 where it is noise (up to 1.1 of 72 load tests
    with nothing hidden, two thirds of them with Student-3 noise), more where rows that count for little hold a cause. Rows in
    which a term may rest anywhere hold none."""
    if np.any(fitted.data.rows.machined_pass != ""):
        return 1.0
    allowed = residual_std(fitted.data, fitted.components, fitted.compliance, fitted.at_map.noise.further)
    loose = np.zeros(len(allowed), dtype=bool)
    for term, values in zip(fitted.terms, fitted.term_values, strict=True):
        loose |= term.effect.loose(fitted.load_state, term.joint, values)
    told = ~loose if not loose.all() else loose
    return float(np.sqrt(np.nanmean((fitted.residual / allowed)[told] ** 2)))


def beyond_stated(fitted: Posterior, granted: float) -> dict[str, float]:
    """The parts of the noise that cell.yaml (or the rows) state and that the data put above `granted` times that, with 95 %
    confidence: how many times the stated size each is; and parts that no file states, beyond what any could be."""
    if np.any(fitted.data.rows.machined_pass != ""):
        # What is stated holds for a reading at rest, not for the mean of a stretch of a pass.
        return {}
    noise, multiples, log_std = fitted.at_map.noise, fitted.components.values, fitted.components_log_std
    allowed = {part: granted for part in PARTS if noise.stated[part]}
    allowed |= {part: most for part, most in UNSTATED_GRANTED.items() if noise.active[part] and not noise.stated[part]}
    of_forces = fitted.data.cell.noise
    if SETUP in allowed and of_forces.force_relative_stated:
        allowed[SETUP] = min(allowed[SETUP], max(granted * of_forces.force_relative / USUAL_SETUP, HALF_A_DEGREE))
    if multiples[0] < WORTH_REMEMBERING:
        allowed.pop(MEMORY, None)
    names = [(PARTS if stated else UNSTATED)[part] for part, stated in enumerate(noise.stated)]
    if SETUP in allowed and of_forces.force_relative_stated:
        names[SETUP] = STATED_SETUP.format(100 * of_forces.force_relative)
    return {names[part]: float(multiples[part]) for part, most in allowed.items()
            if np.log(multiples[part] / most) > ONE_SIDED_95 * log_std[part]}
