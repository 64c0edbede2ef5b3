"""What the measurements can tell of each joint, in grades, with the reason and the load that would help."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.fit.misfit import ModelCheck
from identification.fit.posterior import Posterior
from identification.model.compliance import regressor
from identification.model.effects.kinds import nothing_hangs

Array = NDArray[np.float64]

# Reliable: a stiffness known to a fifth (standard deviation of ln k). Not identifiable: its prior shrank by less than a third.
RELIABLE_LOG_STD = 0.2
UNSEEN_SHRINKAGE = 2.0 / 3.0
# A joint whose largest contribution to any reading stays under this many of that reading's sigmas was never loaded.
UNLOADED_SIGMAS = 1.0
# A load turns a joint where its lever is longer than this [m].
UNTURNED = 1e-3
# Correlation from which two stiffnesses are said to trade off.
TRADE_OFF = 0.7
# A visit is loaded where its readings move by more than this share of the square that those of the largest do. One of at least
# so many that has more than this share of a joint's tells it alone.
LOADED, SEVERAL, ALONE = 1e-3, 3, 0.97
CANDIDATES = 1500
CANDIDATE_FORCE_N = 300.0
AXIS_NAMES = "xyz"
LOOK_FOR_IT = "compstiff diagnose looks for what the model lacks"


@dataclass(frozen=True)
class JointGrade:
    """One joint. grade: reliable, tentative or not identifiable. shrinkage: posterior over prior std of ln k.

    signal: largest contribution to a reading, in its sigmas. partner: the joint (1-based) it trades off with most, and their
    correlation, 0 where none. reason: in words. helpful: the load that would tell most, in words, "" where it is not needed.
    """

    joint: int
    grade: str
    shrinkage: float
    signal: float
    partner: int
    correlation: float
    reason: str
    helpful: str


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """95 % ellipsoid of the six ln k (paper eq. 15), as large as the posterior's own tails ask: volume, semi-axes (6,) longest
    first, directions (6, 6) in rows, sentence: in plain words."""

    volume: float
    semi_axes: Array
    directions: Array
    sentence: str

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"volume": self.volume, "semi_axes_log": self.semi_axes.tolist(), "directions": self.directions.tolist(),
                "words": self.sentence}


def grade_joints(posterior: Posterior, check: ModelCheck) -> tuple[JointGrade, ...]:
    """Grades of the six joints from the contraction prior -> posterior, their signal in the data and their correlations; none
    is reliable while the model that made them is rejected."""
    std = np.sqrt(np.diag(posterior.covariance))
    correlation = posterior.covariance / np.outer(std, std)
    signal = np.max(np.abs(posterior.at_map.design), axis=(0, 1)) / posterior.components.sensor
    state, grades = posterior.load_state, []
    plumb = not nothing_hangs(state)
    turned = np.abs(state.torque).max(axis=0) / max(float(np.linalg.norm(state.wrench[:, :3], axis=1).max()), 1e-9)
    for i in range(6):
        shrinkage = float(std[i] / posterior.prior.log_std[i])
        grade = "reliable" if std[i] <= RELIABLE_LOG_STD else "tentative"
        if shrinkage > UNSEEN_SHRINKAGE:
            grade = "not identifiable"
        fallen = check.rejected and grade == "reliable"
        others = np.abs(correlation[i]) * (np.arange(6) != i)
        partner = int(np.argmax(others))
        trades = others[partner] >= TRADE_OFF
        if signal[i] < UNLOADED_SIGMAS:
            reason = (f"joint {i + 1} was never loaded: it moves no reading by more than {signal[i]:.2g} of the sensor's sigma"
                      + (", and no load turns it: all point straight down" if plumb and turned[i] < UNTURNED else ""))
        elif trades:
            reason = f"k{i + 1} and k{partner + 1} trade off (correlation {correlation[i, partner]:+.2f})"
        else:
            reason = f"it moves a reading by up to {signal[i]:.3g} times the sensor's sigma"
        helpful = "" if grade == "reliable" else _helpful(posterior, i)
        if fallen:
            grade, helpful = "tentative", LOOK_FOR_IT
            reason = f"the model of all joints is rejected; by itself {reason}"
        grades.append(JointGrade(i + 1, grade, shrinkage, float(signal[i]), partner + 1 if trades else 0,
                                 float(correlation[i, partner]) if trades else 0.0, reason, helpful))
    return tuple(grades)


def told_by_one_visit(posterior: Posterior) -> dict[int, int]:
    """The joints (from 1) of whose motion one visit has next to all, each with a row of that visit (from 0), where other visits
    were loaded too: what its load is wrong by goes into them unseen."""
    visit = posterior.data.rows.visit
    moved = np.sum(posterior.at_map.design**2, axis=1)
    by_visit = np.array([moved[visit == one].sum(axis=0) for one in np.unique(visit)])
    loaded = np.count_nonzero(by_visit.sum(axis=1) > LOADED * by_visit.sum(axis=1).max())
    if loaded < SEVERAL:
        return {}
    share = by_visit.max(axis=0) / np.maximum(by_visit.sum(axis=0), 1e-300)
    return {int(joint) + 1: int(np.flatnonzero(visit == np.unique(visit)[np.argmax(by_visit[:, joint])])[0])
            for joint in np.flatnonzero(share > ALONE)}


def _helpful(posterior: Posterior, joint: int) -> str:
    """The single load, of many random poses along one base axis each, that shrinks this joint's uncertainty most."""
    cell, robot = posterior.data.cell, posterior.data.cell.robot
    rng = np.random.default_rng(joint)
    middle = np.clip(0.0, *robot.limits.T)
    theta = middle + 0.7 * rng.uniform(robot.limits[:, 0] - middle, robot.limits[:, 1] - middle, (4 * CANDIDATES, 6))
    theta = theta[(robot.limit_excess(theta) == 0).all(axis=1)][:CANDIDATES]
    axis = rng.integers(0, 3, len(theta))
    wrench = np.zeros((len(theta), 6))
    wrench[np.arange(len(theta)), axis] = CANDIDATE_FORCE_N
    design = regressor(robot, theta, cell.flange_from_tcp, wrench)[:, :3] * np.exp(posterior.mean)
    sigma = posterior.components.sensor * cell.noise.deflection
    spread = design @ posterior.covariance                                                     # (n, 3, 6)
    total = spread @ np.swapaxes(design, 1, 2) + np.diag(sigma**2)
    gained = np.einsum("ni,nij,nj->n", spread[:, :, joint], np.linalg.inv(total), spread[:, :, joint])
    best = int(np.argmax(gained))
    left = np.sqrt(max(1 - gained[best] / posterior.covariance[joint, joint], 0.0))
    angles = ", ".join(f"{angle:.0f}" for angle in np.degrees(theta[best]))
    return (f"one load of {CANDIDATE_FORCE_N:g} N along base {AXIS_NAMES[axis[best]]} at joints ({angles}) deg would bring the "
            f"uncertainty of k{joint + 1} to {f'{100 * left:.0f} %' if left >= 0.015 else 'under 2 %'} of what it is")


def ellipsoid(posterior: Posterior) -> Ellipsoid:
    """The 95 % ellipsoid of ln k (paper eq. 15), its axes in plain words."""
    eigenvalues, vectors = np.linalg.eigh(posterior.covariance)
    order = np.argsort(eigenvalues)[::-1]
    semi_axes = np.sqrt(posterior.draws.radius(0.95, 6) * eigenvalues[order])
    directions = vectors[:, order].T
    directions = directions * np.sign(directions[np.arange(6), np.argmax(np.abs(directions), axis=1)])[:, None]
    leading = [i for i in np.argsort(-np.abs(directions[0])) if abs(directions[0, i]) > 0.4]
    same, opposite = (" and ".join(f"k{i + 1}" for i in leading if directions[0, i] * directions[0, leading[0]] * sign > 0)
                      for sign in (1, -1))
    sentence = f"least certain: {same}"
    if opposite:
        sentence += f" against {opposite}"
    elif len(leading) > 1:
        sentence += " together, in the same sense"
    sentence += f", a factor {np.exp(semi_axes[0]):.3g} either way at the end of the longest axis"
    return Ellipsoid(float(np.pi**3 / 6 * np.prod(semi_axes)), semi_axes, directions, sentence)


def information_spectrum(posterior: Posterior) -> Array:
    """Eigenvalues (6,), largest first, of the data's information on ln k in units of the prior's: above 1 the data say more
    than the prior, below 1 less."""
    log_std = posterior.prior.log_std
    return np.asarray(np.linalg.eigvalsh(posterior.information * np.outer(log_std, log_std))[::-1])
