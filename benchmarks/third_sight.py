"""How far what is hidden shows in a load test (third_world.py)."""

from __future__ import annotations

import numpy as np

from benchmarks.third_arm import DEGREE, Arm
from benchmarks.third_gears import Array
from benchmarks.third_trial import Row, Trial

# Smallest noise that is reckoned with: of a display's step, of a seat [um], of a visit's direction [deg].
OF_A_STEP, SEAT, TURN = 0.3, 1.0, 0.1


def by_springs(arm: Arm, rows: list[Row]) -> Array:
    """(n, 3, 6) [um (N m)/rad]: how the springs' compliances move the TCP under the rows' forces, at rest."""
    found = []
    for row in rows:
        levers = arm.jacobian(row.q)
        force = row.force if row.mass is None else row.mass * arm.down
        found.append(levers * (levers.T @ force)[None, :] * 1e6)
    return np.array(found)


def visible(trial: Trial, plain: Trial) -> tuple[float, float]:
    """What is hidden in a trial, against the same trial with nothing hidden: the length, in sigmas of the noise that there is,
    of what six springs and the seats cannot take off, and its RMS [um]."""
    rows = trial.written(trial.readings(quiet=True))
    named = trial.arm
    if trial.named != named.name or list(trial.named_tool_mm) != list(trial.tool_mm):
        named = Arm(trial.named, trial.named_tool_mm, trial.hung)
    slopes, compliance = by_springs(named, rows), 1 / trial.stiffness
    told = slopes @ compliance
    hidden = np.array([row.reading for row in rows]) - told
    if len(plain.rows) == len(rows):
        # The springs' second order is no secret.
        hidden = hidden - (plain.readings(quiet=True) - by_springs(plain.arm, plain.rows) @ compliance)
    visit, fitted = np.array([row.visit for row in rows]), np.array([not row.validate for row in rows])
    information, pull, square, left = np.eye(6), np.zeros(6), 0.0, []
    for each in np.unique(visit[fitted]):
        at = np.flatnonzero((visit == each) & fitted)
        weight = np.linalg.inv(covariance(trial, [rows[k] for k in at], told[at]))
        columns, signal = slopes[at].reshape(-1, 6) * compliance, hidden[at].reshape(-1)
        information += columns.T @ weight @ columns
        pull += columns.T @ weight @ signal
        square += float(signal @ weight @ signal)
        left.append(signal)
    unseen = float(pull @ np.linalg.solve(information, pull))
    return float(np.sqrt(max(0.0, square - unseen))), float(np.sqrt(np.mean(np.concatenate(left)**2)))


def covariance(trial: Trial, rows: list[Row], told: Array) -> Array:
    """Of the readings of a visit (3 m, 3 m) [um^2]: each reading's, what the seat shares, and what the force is off."""
    noise, count = trial.noise, len(rows)
    found = np.eye(3 * count) * max(noise.sensor, OF_A_STEP * noise.step)**2
    found += np.kron(np.ones((count, count)), np.eye(3)) * max(noise.seat, SEAT)**2
    for k, row in enumerate(rows):
        size = np.linalg.norm(row.force)
        off = np.zeros((count, 3))
        off[k] = told[k] * np.hypot(noise.relative, noise.absolute / size if size else 0)
        found += np.outer(off, off)
    turned = (told * max(noise.turn, TURN) * DEGREE).reshape(-1)
    return np.asarray(found + np.outer(turned, turned))
