"""Learned: what a measured part taught of the robot, the set-up, the warming and the rest, and what of it another program
takes.

    deviation = model(x_eff) + set-up + drift + remainder,      z = (x_eff (S,), set-up (6,), drift (3,), w (3 m,))

all of z jointly normal. x_eff are the model's parameters (identification/model/stiffness.py), ln c with the factor in motion in
it. The set-up is the small rigid displacement of the work object that was measured, drift what grows with the time of the job:
both belong to that job, and a program takes them only where its user says that it repeats (`carried`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from compensator.learned.remainder import INSIDE, Remainder
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding, Refused, error
from identification.model.effects_in_force import EffectInForce
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel

Indices = NDArray[np.intp]
Repeats = Literal["nothing", "setup", "job"]
SETUP, DRIFT = 6, 3
# Work objects that are no farther apart than this [m, rad] are the same set-up; models that differ by less the same file.
SAME_OBJECT, SAME_MODEL = 1e-5, 1e-6
CHUNK = 4096
# A weight of the remainder whose variance is more than this share of what it was before was not measured.
UNTOLD = 0.25
NO_REMAINDER = Remainder(np.zeros((0, 3)), np.zeros((0, 6)), 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class JobFrame:
    """What set-up and drift are counted by: the work object measured, the middle (3,) [m] and radius [m] of the measured
    places, all in the robot's base as they stand where the program's external axes begin (the resting frame of
    external_axes.py), and the job's duration [s] at the programmed feed."""

    base_from_object: Frame
    centre: Array
    radius: float
    duration: float

    def columns(self, position: Array, time: Array, to_base: Array | None = None) -> Array:
        """Displacements (n, 3, 9), base frame, of unit parameters: 3 shifts, 3 turns that move a place at the radius by 1 m, 3
        drifts by the end of the job. position (n, 3) [m] in the resting frame, whose directions are those of the base turned by
        to_base (n, 3, 3), None: by nothing; time (n,) [s]; what is later than the job's end has drifted no further."""
        columns = np.zeros((len(position), 3, SETUP + DRIFT))
        lever = (position - self.centre) / self.radius
        share = np.clip(time / self.duration, 0.0, 1.0) if self.duration > 0 else np.zeros(len(time))
        for axis, unit in enumerate(np.eye(3)):
            columns[:, :, axis] = unit
            columns[:, :, 3 + axis] = np.cross(unit, lever)
            columns[:, :, SETUP + axis] = share[:, None] * unit
        if to_base is not None:
            columns[:, :, :SETUP] = to_base @ columns[:, :, :SETUP]
        return columns


@dataclass(frozen=True, eq=False)
class Rest:
    """What a program takes beside the springs at n places: mean (n, 3) [m], columns (n, 3, 9) and basis (n, m) of the
    parameters beyond x_eff, inside (n,): measured."""

    mean: Array
    columns: Array
    basis: Array
    inside: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Learned:
    """prior: the mean of the stiffness file that it was learned with. mean (Z,), covariance (Z, Z) of z; x_eff has the file's
    parameters, then those of `effects`, which the part showed beyond them. unshown (9, 9) [m^2]: covariance of the set-up and
    drift that no point showed, of which the mean is nothing. told: figures of the learning, as learned.json
    carries them."""

    prior: Array
    mean: Array
    covariance: Array
    frame: JobFrame
    remainder: Remainder = NO_REMAINDER
    effects: tuple[EffectInForce, ...] = ()
    told: dict[str, Any] = field(default_factory=dict)
    source: Path | None = None
    unshown: Array = field(default_factory=lambda: np.zeros((SETUP + DRIFT, SETUP + DRIFT)))

    @property
    def springs(self) -> int:
        """S, of x_eff."""
        return len(self.prior) + sum(len(term.effect.parameters) for term in self.effects)

    def model(self, model: IdentifiedModel) -> IdentifiedModel:
        """The model of the stiffness file with what was learned of its parameters, and with the effects that the part showed.
        Raises CompstiffError (CS5321): learned with another stiffness file."""
        size = self.springs
        same = len(model.mean) == len(self.prior)
        if not same or np.abs(model.mean - self.prior).max() > SAME_MODEL * max(1.0, np.abs(self.prior).max()):
            raise error("CS5321", f"was learned with another stiffness file than {model.source or 'this'}",
                        file=str(self.source) if self.source else None,
                        hint="name the stiffness file that learn was called with, or learn again")
        return replace(model, mean=self.mean[:size], covariance=self.covariance[:size, :size], interval=None,
                       effects=(*model.effects, *self.effects))

    def carried(self, repeats: Repeats) -> Learned:
        """What a program takes: without set-up and drift for another set-up, without drift for the same set-up, all of it for
        the same job again. Another job drifts too, nobody knows when: it is as wide as what was found."""
        off = slice({"nothing": 0, "setup": SETUP, "job": SETUP + DRIFT}[repeats], SETUP + DRIFT)
        mean, covariance = self.mean.copy(), self.covariance.copy()
        left_out = self.springs + np.arange(SETUP + DRIFT)[off]
        mean[left_out] = covariance[left_out] = covariance[:, left_out] = 0.0
        unshown, drift = self.unshown.copy(), self.springs + np.arange(SETUP, SETUP + DRIFT)
        unshown[off] = unshown[:, off] = 0.0
        if repeats != "job":
            unshown[SETUP:, SETUP:] = self.unshown[SETUP:, SETUP:] + self.covariance[np.ix_(drift, drift)] + np.outer(
                self.mean[drift], self.mean[drift])
        return replace(self, mean=mean, covariance=covariance, unshown=unshown)

    def exactly(self) -> Learned:
        """The same, taken for exact: no covariance, nothing unseen."""
        return replace(self, covariance=np.zeros_like(self.covariance), unshown=np.zeros_like(self.unshown),
                       remainder=replace(self.remainder, amplitude=0.0))

    def rest(self, path: RobotPath, targets: Indices) -> Rest:
        """At the targets (n,) of a path."""
        position, theta = path.base_from_tcp.position[targets], path.theta[targets]
        time = np.cumsum(np.nan_to_num(path.move_time, posinf=0.0))[targets]
        turned = path.axes.base_from_rest
        columns = self.frame.columns(path.rest_from_tcp.position[targets], time,
                                     None if turned is None else turned.rotation[targets])
        basis = self.remainder.basis(position, theta)
        beyond = self.mean[self.springs:]
        weights = beyond[SETUP + DRIFT:].reshape(-1, 3)
        mean = columns @ beyond[:SETUP + DRIFT] + basis @ weights
        inside = np.sum(basis**2, axis=1) >= INSIDE if len(weights) else np.ones(len(position), dtype=bool)
        return Rest(mean, columns, basis, inside)

    def covariance_beside(self, by_x: Array, rest: Rest) -> tuple[Array, Array]:
        """What the rest adds (n, 3, 3) [m^2] to the covariance that x_eff has by its slopes by_x (n, 3, S), its own and that
        with x_eff; and of the whole covariance the part (n, 3, 3) that knowing what nobody measured would take away: between
        the places, and along directions that no point told of."""
        size, weights = self.springs, slice(self.springs + SETUP + DRIFT, None)
        with_x, own = self.covariance[:size, size:], self.covariance[size:, size:]
        variance, directions = np.linalg.eigh(self.covariance[weights, weights])
        untold = variance > UNTOLD * self.remainder.amplitude**2
        carried = self.covariance[:, weights] @ (directions[:, untold] / np.sqrt(variance[untold]))
        between = self.remainder.unseen(rest.basis)[:, None, None] * np.eye(3)
        added, unseen = between.copy(), between
        for first in range(0, len(by_x), CHUNK):
            part = slice(first, first + CHUNK)
            slopes = np.concatenate([rest.columns[part], _spread(rest.basis[part])], axis=2)
            across = by_x[part] @ with_x @ np.swapaxes(slopes, 1, 2)
            added[part] += slopes @ own @ np.swapaxes(slopes, 1, 2) + across + np.swapaxes(across, 1, 2)
            of_untold = by_x[part] @ carried[:size] + slopes @ carried[size:]
            unseen[part] += of_untold @ np.swapaxes(of_untold, 1, 2)
            of_job = rest.columns[part] @ self.unshown @ np.swapaxes(rest.columns[part], 1, 2)
            added[part] += of_job
            unseen[part] += of_job
        return added, unseen

    def check_set_up(self, path: RobotPath, targets: Indices, repeats: Repeats) -> None:
        """Refused (CS5322) where the set-up is said to repeat and the program's work object stands elsewhere."""
        if repeats == "nothing" or not len(targets):
            return
        apart = self.frame.base_from_object.inverse() @ path.axes.to_rest(path.base_from_object[targets], targets)
        off = float(np.linalg.norm(apart.position, axis=1).max())
        # Of a turn by an angle a the matrix is off the unit by sqrt(8) sin(a / 2).
        chord = np.linalg.norm(apart.rotation - np.eye(3), axis=(1, 2)) / np.sqrt(8.0)
        turned = 2 * float(np.arcsin(np.minimum(chord, 1.0)).max())
        found = [f"stands {1e3 * off:.3g} mm from where it was measured"] * (off > SAME_OBJECT) + [
            f"is turned by {np.degrees(turned):.3g} deg against it"] * (turned > SAME_OBJECT)
        if found:
            raise Refused(Finding(
                "CS5322", "error", f"--repeats {repeats}, but the work object {' and '.join(found)}: this is another set-up",
                file=path.toolpath.source,
                hint="leave --repeats out: what the set-up took belongs to the set-up that was measured"))


def _spread(basis: Array) -> Array:
    """Slopes (n, 3, 3 m) by the weights, a weight (3,) a place, of a basis (n, m)."""
    return np.asarray((basis[:, None, :, None] * np.eye(3)[:, None, :]).reshape(len(basis), 3, -1))
