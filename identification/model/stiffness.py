"""IdentifiedModel: joint stiffnesses and effects in force, with their covariance; writes stiffness.json (docs/formats.md)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.model.compliance import displacement, equilibrium, loaded_angles, loaded_pose, symmetric
from identification.model.effects_in_force import (
    EFFECTS,
    SPRINGS,
    EffectInForce,
    OfEffects,
    added,
    displaced,
    slopes,
    squares,
)
from identification.model.gravity import DOWN
from identification.model.kinematics import chunks, forward, spring_columns
from identification.model.load_state import LoadState, load_state
from identification.model.robot import RobotModel
from identification.model.rotations import Frame

__all__ = ["FORMAT", "JOINT_NAMES", "EffectInForce", "IdentifiedModel"]
Array = NDArray[np.float64]
FORMAT = "compstiff-stiffness"
ALL = slice(None)
JOINT_NAMES = tuple(f"k{i}" for i in range(1, 7))
NORMAL_97_5 = 1.959963984540054
# A misfit at least so likely by chance is not what rejects a model.
UNLIKELY = 1e-3
# What the robot's own weight adds, sagging and moved by the load, in shares of the deviation: 1 sigma where the robot file has
# no `links`. Engineering judgement: 0.1 to 0.4 % on the IRB 6660 of the tests, part of which the springs take up.
UNKNOWN_WEIGHT = 2e-3
# How far a named effect's real law is off the dictionary's where nothing was measured, in shares of what the effect adds: 1
# sigma. Engineering judgement: 3 to 10 % for beams, bearings, couplings and gears of other laws (docs/benchmarks/diagnosis.md).
UNKNOWN_LAW = 0.05


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """The posterior N(mean, covariance) of x = (ln c (6,), parameters of the effects in force (P,)), c in rad/(N m).

    mean (6 + P,), covariance (6 + P, 6 + P); each parameter in its own unit. grades (6,): reliable, tentative or not
    identifiable, "" where not judged. fit: figures of the fit as stiffness.json carries them.
    interval (6 + P, 2): 95 % intervals of x where the posterior's own are known (its tails are heavier than a normal
    distribution's where few readings must tell the noise too), None: those of N(mean, covariance).
    fall (3,) acceleration of free fall in the base frame [m/s^2], tool_mass [kg] and tool_centre (3,) [m] in the flange frame:
    for effects that gravity torques enter. unknown_weight: 1 sigma, as a share of the deviation, of what the robot's own weight
    adds where its file has no `links`; unknown_law: of how far a named effect's real law is off, as a share of what the effect
    adds; differs: of how the compliance differed from one pose to the next beyond all that was found: forces set up anew, or a
    cause without a name, which the load tests cannot tell apart. source: the file it was read from, None: none. made_from: the
    tables it was identified from, each by `file`, its name, and `sha256`; none where they were no files.
    """

    robot: RobotModel
    flange_from_tcp: Frame
    mean: Array
    covariance: Array
    grades: tuple[str, ...] = ("",) * 6
    fit: dict[str, Any] = field(default_factory=dict)
    effects: tuple[EffectInForce, ...] = ()
    fall: Array = field(default_factory=DOWN.copy)
    tool_mass: float | None = None
    tool_centre: Array | None = None
    interval: Array | None = None
    unknown_weight: float = UNKNOWN_WEIGHT
    unknown_law: float = UNKNOWN_LAW
    differs: float = 0.0
    source: Path | None = None
    made_from: tuple[dict[str, str], ...] = ()

    @property
    def compliance(self) -> Array:
        """Posterior median of c (6,) [rad/(N m)]."""
        return np.exp(self.mean[SPRINGS])

    @property
    def stiffness(self) -> Array:
        """Posterior median of k (6,) [N m/rad]."""
        return np.exp(-self.mean[SPRINGS])

    @property
    def values(self) -> Array:
        """Posterior median of the effects' parameters (P,), inside their physical bounds."""
        return np.clip(self.mean[EFFECTS], self.bounds[:, 0], self.bounds[:, 1])

    @property
    def bounds(self) -> Array:
        """Physical bounds of the effects' parameters (P, 2)."""
        parameters = [parameter for term in self.effects for parameter in term.effect.parameters]
        return np.array([(parameter.low, parameter.high) for parameter in parameters]).reshape(-1, 2)

    @property
    def rejected(self) -> str:
        """Why the measurements it was made from reject the model, in words; "" where they do not, or nothing is known of it."""
        check = self.fit.get("model_check")
        if not isinstance(check, dict) or check.get("rejected") is not True:
            return ""
        p_value = check.get("p_value")
        probability = f"p = {p_value:.2g}: " if isinstance(p_value, int | float) and p_value < UNLIKELY else ""
        return f"{probability}{check.get('seen') or 'it does not explain them'}"

    @property
    def open_between(self) -> str:
        """The causes that the measurements it was made from cannot tell apart, in words: the likeliest of them is in the model,
        the others in its covariance; "" where there are none."""
        check = self.fit.get("model_check")
        seen = check.get("seen") if isinstance(check, dict) and self.fit.get("diagnosis") == "ambiguous" else None
        return seen if isinstance(seen, str) and not self.rejected else ""

    @property
    def log_std(self) -> Array:
        """Standard deviation of ln k (6,)."""
        return np.sqrt(np.diag(self.covariance)[SPRINGS])

    @property
    def interval_95(self) -> Array:
        """95 % intervals of k (6, 2) [N m/rad], by transformation from ln k."""
        return np.exp(-self._interval[SPRINGS, ::-1])

    @property
    def _interval(self) -> Array:
        """95 % intervals of x (6 + P, 2)."""
        half = NORMAL_97_5 * np.sqrt(np.diag(self.covariance))
        return np.column_stack([self.mean - half, self.mean + half]) if self.interval is None else self.interval

    @property
    def stiffness_covariance(self) -> Array:
        """Covariance of k (6, 6) [(N m/rad)^2], the exact moments of the log-normal posterior."""
        average = self._average_stiffness
        return np.asarray(np.outer(average, average) * np.expm1(self.covariance[SPRINGS, SPRINGS]))

    @property
    def parameter_covariance(self) -> Array:
        """Covariance (6 + P, 6 + P) of k and the effects' parameters a: `cov(k_i, a) = -E[k_i] cov(ln c_i, a)`, exact too."""
        result = self.covariance.copy()
        result[SPRINGS, SPRINGS] = self.stiffness_covariance
        result[SPRINGS, EFFECTS] = -self._average_stiffness[:, None] * self.covariance[SPRINGS, EFFECTS]
        result[EFFECTS, SPRINGS] = result[SPRINGS, EFFECTS].T
        return result

    @property
    def _average_stiffness(self) -> Array:
        """E[k] (6,) [N m/rad]."""
        return np.exp(-self.mean[SPRINGS] + 0.5 * np.diag(self.covariance)[SPRINGS])

    def scaled(self, factor: float, std: float = 0.0) -> IdentifiedModel:
        """The model with all joint compliances times a factor, whose standard error they share; effects stay as they are.

        The intervals are then those of N(mean, covariance): the factor's error is not in the posterior's own.
        """
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[SPRINGS] += np.log(factor)
        covariance[SPRINGS, SPRINGS] += (std / factor) ** 2
        return replace(self, mean=mean, covariance=covariance, interval=None)

    def load_state(self, theta: Array, wrench: Array, flange_from_tcp: Frame, dwell: Array | None = None) -> LoadState:
        """What the effects may look at: rows in the order of their loads, one visit, at rest at theta (N, 6) [rad] under wrench
        (N, 6); flange_from_tcp one tool or one a row; dwell (N,) [s] time each row's load is on."""
        return load_state(self.robot, flange_from_tcp, theta, wrench, self.compliance, fall=self.fall, tool_mass=self.tool_mass,
                         tool_centre=self.tool_centre, at_load=True, dwell=dwell)

    @property
    def of_springs_alone(self) -> bool:
        """True where nothing is added to what six springs do: no effect in force, and no weights of links known."""
        return not self.effects and self.robot.link_mass is None

    def added(self, rows: LoadState) -> Array:
        """What the sag and the effects in force add to the plain model's deviation (N, 6) [m, rad].

        The weight that the load moves is left out: a loaded robot that is corrected stands where the unloaded one would, and
        its weight with it.
        """
        return np.asarray(rows.of_sag + added(rows, self.effects, self.values))

    def of_effects(self, rows: LoadState) -> OfEffects:
        """What the uncertainty of the deviation needs of the effects in force in these rows. The slope of the sag is a few
        thousandths of the springs' own and left out."""
        return OfEffects(slopes(rows, self.effects, self.values), squares(rows, self.effects, self.values))

    def loaded_pose(self, theta: Array, wrench: Array, flange_from_tcp: Frame, dwell: Array | None = None) -> Frame:
        """base_from_tcp (N) of the robot that is commanded to theta (N, 6) [rad] and yields under wrench (N, 6), its own weight
        (where the robot file has `links`) and effects in force included. The rows are one visit, in the order of their
        loads, from zero load; dwell (N,) [s] time each is on: without it nothing creeps."""
        if self.of_springs_alone:
            return loaded_pose(self.robot, theta, flange_from_tcp, wrench, self.compliance)
        state = equilibrium(self.robot, theta, flange_from_tcp, wrench, self.compliance)
        rest = loaded_angles(self.robot, theta, state.deflection)
        plain = forward(self.robot, rest, flange_from_tcp)
        rows = self.load_state(rest, wrench, flange_from_tcp, dwell)
        return displaced(plain, self.added(rows) + rows.of_weight)

    def predict(
        self, theta: Array, wrench: Array, flange_from_tcp: Frame | None = None, dwell: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Predicted TCP deviation and its posterior covariance.

        theta (N, 6) [rad], wrench (N, 6) [N, N m] base frame; rows and dwell as in `loaded_pose`. Returns position (N, 3)
        [m], rotation vector (N, 3) [rad], covariance (N, 6, 6) of both, first order in x: for the springs
        `sum over i, j of (J_i tau_i c_i) Sigma_ij (J_j tau_j c_j)`.
        """
        tool = self.flange_from_tcp if flange_from_tcp is None else flange_from_tcp
        loaded = self.loaded_pose(theta, wrench, tool, dwell)
        position, rotation = displacement(loaded, forward(self.robot, theta, tool))
        of_effects = self.of_effects(self.load_state(theta, wrench, tool, dwell)) if self.effects else None
        return position, rotation, self.deviation_covariance(theta, wrench, tool, of_effects)

    def deviation_covariance(
        self, theta: Array, wrench: Array, flange_from_tcp: Frame, of_effects: OfEffects | None = None, *, rows: slice = ALL
    ) -> Array:
        """Posterior covariance (N, 6, 6) [m, rad] of the deviation; see `predict`. With what the robot's own weight may add
        where it is not known, and what the effects' real laws may add, alike in every direction.

        of_effects: of these rows, where they are rows of a longer history; else they are one visit. rows: of these of the six
        components alone.
        """
        if self.effects and of_effects is None:
            of_effects = self.of_effects(self.load_state(theta, wrench, flange_from_tcp))
        size = len(range(6)[rows])
        result = np.empty((len(theta), size, size))
        for part in chunks(len(theta)):
            few = None if of_effects is None else of_effects.of(np.arange(part.start, part.stop))
            columns = spring_columns(self.robot, theta[part], flange_from_tcp)
            result[part] = self.covariance_by(columns, wrench[part], few, rows=rows).T
        return result

    def covariance_by(self, columns: Array, wrench: Array, of_effects: OfEffects | None = None, *, rows: slice = ALL) -> Array:
        """The same (6, 6, n), components first, of a few thousand poses by the Jacobian's columns (6, 6, n) there."""
        by_x = self._by_x(columns, wrench, of_effects)
        elastic, unknown = by_x[SPRINGS].sum(axis=0), np.zeros((2, by_x.shape[2]))
        if of_effects is not None:
            elastic = elastic - of_effects.slopes[:, :, SPRINGS].sum(axis=2).T
            unknown += self.unknown_law**2 * of_effects.squares.T
        if self.robot.link_mass is None:
            unknown += self.unknown_weight**2 * (elastic**2).reshape(2, 3, -1).sum(axis=1)
        of_rows = by_x[:, rows]
        spread = (self.covariance @ of_rows.reshape(len(of_rows), -1)).reshape(of_rows.shape)
        covariance = symmetric(of_rows, spread)
        axes = np.arange(len(covariance))
        covariance[axes, axes] += np.repeat(unknown / 3, 3, axis=0)[rows]
        if self.differs:
            # G of a force: what a change of it by a share of its size, in any direction, does.
            moved = np.einsum("i,irn,isn->srn", self.compliance, columns[:, rows], columns[:, :3])
            covariance += self.differs**2 * np.sum(wrench[:, :3] ** 2, axis=1) * symmetric(moved, moved)
        return covariance

    def deviation_slopes(
        self, theta: Array, wrench: Array, flange_from_tcp: Frame, of_effects: OfEffects | None = None
    ) -> Array:
        """Derivative (N, 6, 6 + P) [m, rad] of the deviation by x; as in `deviation_covariance`."""
        if self.effects and of_effects is None:
            of_effects = self.of_effects(self.load_state(theta, wrench, flange_from_tcp))
        result = np.empty((len(theta), 6, len(self.mean)))
        for part in chunks(len(theta)):
            few = None if of_effects is None else of_effects.of(np.arange(part.start, part.stop))
            columns = spring_columns(self.robot, theta[part], flange_from_tcp)
            result[part] = self._by_x(columns, wrench[part], few).transpose(2, 1, 0)
        return result

    def _by_x(self, columns: Array, wrench: Array, of_effects: OfEffects | None) -> Array:
        """The same of a few thousand poses, components first (6 + P, 6, n): for the springs `J_i tau_i c_i`."""
        columns = columns * (self.compliance[:, None] * np.einsum("irn,rn->in", columns, wrench.T))[:, None]
        if of_effects is None:
            return columns
        slope = of_effects.slopes.transpose(2, 1, 0)
        return np.concatenate([columns + slope[SPRINGS], slope[EFFECTS]])

    def as_dict(self) -> dict[str, Any]:
        """The content of stiffness.json."""
        covariance = self.parameter_covariance
        deviations = np.sqrt(np.diag(covariance))
        names = [*JOINT_NAMES, *(name for term in self.effects for name in term.names)]
        units = ["N*m/rad"] * 6 + [parameter.unit for term in self.effects for parameter in term.effect.parameters]
        intervals = np.concatenate([self.interval_95, np.clip(self._interval[EFFECTS], self.bounds[:, :1], self.bounds[:, 1:])])
        parameters = [
            {"name": name, "unit": unit, "estimate": float(estimate), "std": float(std),
             "interval_95": [float(low), float(high)], "grade": grade}
            for name, unit, estimate, std, (low, high), grade in zip(
                names, units, np.concatenate([self.stiffness, self.values]), deviations, intervals,
                (*self.grades, *([""] * (len(names) - 6))), strict=True)
        ]
        tool = self.flange_from_tcp
        return {
            "format": FORMAT, "version": 1, "robot": self.robot.name, "load_path": self.robot.load_path,
            "robot_sha256": self.robot.sha256, "geometry_sha256": self.robot.geometry_sha256,
            **({"serial_number": self.robot.serial_number} if self.robot.serial_number else {}),
            **({"made_from": list(self.made_from)} if self.made_from else {}),
            "tool": {"position_mm": (1e3 * tool.position).tolist(), "quaternion": tool.quaternion.tolist()},
            "parameters": parameters,
            "covariance": covariance.tolist(),
            "log_compliance": {"mean": [*self.mean[SPRINGS].tolist(), *self.values.tolist()],
                               "covariance": self.covariance.tolist()},
            "effects": [{"effect": term.effect.stored, "joint": term.joint} for term in self.effects],
            "fit": self.fit,
        }
