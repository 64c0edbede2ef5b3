"""The stiffness of a joint from logs in motion, with an interval that holds, or the reason why there is none.

    deflection = offset + c (torque - F_c sign(speed) - F_v speed - J acceleration) + delay speed

The motor's inertia, its friction and the encoders' delay are there in any motion, so they are always in the model; viscous
friction and the delay share one column and are not told apart. Where the data speak for a bend of the gear or friction inside
it, c is averaged over both readings by their evidence. What is left of the torque beside these tells c. The interval
has two parts: the noise, by generalised least squares, and the law: how far c moves when the band is changed, a deviation that
follows the joint's angle is allowed, or the gear is straight or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.model.robot import Prior
from identification.motion.axis import Axis, Solved, axis_of, solve
from identification.motion.band import BAND
from identification.motion.dictionary import Shape
from identification.motion.log_file import MotionLog

Array = NDArray[np.float64]
# Bands [Hz] between which the stiffness must hold.
BANDS = (4.0, BAND, 9.0)
NUISANCE = ("channel_delay (link)", "joint_friction", "motor_inertia")
ANGLE_DEGREE = 4
# Laws of the gear that change what is taken for its stiffness, where the data speak for them.
BENDING = ("hysteresis", "soft_zone", "backlash")
# Share of the torque's variance that must be left beside speed, its sign and acceleration.
LEAST_SHARE = 0.02
# c over its standard deviation: below the first no stiffness is stated, from the second on it is reliable.
STATED, RELIABLE = 3.0, 6.0
# Records disagree from this distance on, in standard deviations of their difference.
DISAGREE = 2.576


@dataclass(frozen=True, eq=False)
class AxisStiffness:
    """compliance c [rad/(N m)] with its standard deviations by the noise and by the law, NaN where refused; share: of the
    torque's variance that speed, its sign and acceleration do not explain; straight: c of a straight line through the torque;
    grade, reason: as in stiffness.json. records: (source, c, std) of each record alone. apart: the largest distance of two
    records in standard deviations."""

    joint: int
    compliance: float
    noise_std: float
    law_std: float
    share: float
    straight: float
    delay: tuple[float, float]
    grade: str
    reason: str
    samples: int
    worth: float
    records: tuple[tuple[str, float, float], ...] = ()
    apart: float = 0.0

    @property
    def std(self) -> float:
        """Both parts together."""
        return float(np.hypot(self.noise_std, self.law_std))

    @property
    def refused(self) -> bool:
        """Whether the record cannot identify it."""
        return self.grade == "not identifiable"

    @property
    def interval_95(self) -> tuple[float, float]:
        """Interval of k [N m/rad], by inverting that of c; the upper end is infinite where c may be zero."""
        low, high = self.compliance - 1.96 * self.std, self.compliance + 1.96 * self.std
        return (1 / high if high > 0 else np.inf, 1 / low if low > 0 else np.inf)


def axis_stiffness(joint: int, records: list[MotionLog]) -> AxisStiffness:
    """The joint's stiffness from all records that have it, and from each alone."""
    having = [record for record in records if joint in record.joints]
    together = _from(joint, having)
    if len(having) == 1:
        return together
    alone = [_from(joint, [record]) for record in having]
    listed = tuple((record.source, one.compliance, one.std) for record, one in zip(having, alone, strict=True))
    apart = max(abs(a[1] - b[1]) / np.hypot(a[2], b[2]) for k, a in enumerate(listed) for b in listed[k + 1:])
    spread = float(np.std([one[1] for one in listed], ddof=1) / np.sqrt(len(listed)))
    law = max(together.law_std, spread)
    return _judged(AxisStiffness(**{**vars(together), "law_std": law, "records": listed, "apart": float(apart)}))


def _from(joint: int, records: list[MotionLog]) -> AxisStiffness:
    central, delay, noise, values = 0.0, (0.0, 0.0), 0.0, []
    share = straight = worth = np.nan
    samples = 0
    for band in BANDS:
        axis = axis_of(joint, records, band)
        base = np.column_stack([axis.plain, *(shape.columns[:, :1] for shape in _always(axis))])
        place = len(axis.lengths)
        straightened = [solve(axis, np.column_stack([base, *extra])) for extra in _variants(axis, base)]
        followed = solve(axis, np.column_stack([base, _angle_columns(axis)]))
        values += [float(one.coefficients[place]) for one in (*straightened, followed)]
        if band == BAND:
            central, noise = _averaged(straightened, place)
            delay = _averaged(straightened, place + 1)
            share, samples = _left(base, place), sum(len(log.time) for log in axis.logs)
            straight = float(np.linalg.lstsq(axis.plain, axis.deflection, rcond=None)[0][-1])
            worth = axis.memory.worth(len(axis.torque))
    law = float(np.sqrt(np.mean((np.array(values) - central) ** 2)))
    return _judged(AxisStiffness(joint, central, noise, law, share, straight, delay, "", "", samples, worth))


def _always(axis: Axis) -> list[Shape]:
    return [group[0] for group in axis.dictionary if group[0].name in NUISANCE]


def _variants(axis: Axis, base: Array) -> list[list[Array]]:
    """Columns more than the base: none, and those of each bend that the data speak for."""
    found: list[list[Array]] = [[]]
    alone = solve(axis, base)
    for group in axis.dictionary:
        if group[0].name not in BENDING:
            continue
        tried = [(solve(axis, np.column_stack([base, shape.columns])), shape) for shape in group]
        best, shape = min(tried, key=lambda one: one[0].chi2)
        supported = best.count * np.log(alone.chi2 / best.chi2) > np.log(best.count)
        if supported and (not shape.positive[0] or best.coefficients[-1] > 0):
            found.append([shape.columns])
    return found


def _angle_columns(axis: Axis) -> Array:
    span = np.ptp(axis.angle)
    place = 2 * (axis.angle - axis.angle.min()) / (span if span > 0 else 1.0) - 1
    return np.asarray(np.polynomial.chebyshev.chebvander(place, ANGLE_DEGREE)[:, 1:], dtype=float)


def _averaged(answers: list[Solved], place: int) -> tuple[float, float]:
    """A coefficient and its standard deviation, averaged over answers by their evidence (BIC)."""
    logs = np.array([-0.5 * one.count * np.log(one.chi2) - 0.5 * len(one.coefficients) * np.log(one.count) for one in answers])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    value = np.array([one.coefficients[place] for one in answers])
    variance = np.array([one.covariance[place, place] for one in answers])
    mean = float(weight @ value)
    return mean, float(np.sqrt(weight @ (variance + (value - mean) ** 2)))


def _left(columns: Array, place: int) -> float:
    """Share of the variance of a column that the others do not explain."""
    others = np.delete(columns, place, axis=1)
    left = columns[:, place] - others @ np.linalg.lstsq(others, columns[:, place], rcond=None)[0]
    return float(np.var(left) / np.var(columns[:, place]))


def _judged(one: AxisStiffness) -> AxisStiffness:
    ratio = one.compliance / one.std
    spread = (f"c = {one.compliance:.2e} rad/(N m), {one.noise_std:.1e} by the noise and {one.law_std:.1e} by how the log is "
              f"read; {100 * one.share:.1f} % of the torque's variance is not that of speed and acceleration")
    if one.share < LEAST_SHARE:
        grade, reason = "not identifiable", ("torque follows speed and acceleration too closely: "
                                             f"{100 * one.share:.1f} % of its variance is its own, {100 * LEAST_SHARE:g} % "
                                             "are needed")
    elif ratio < STATED:
        grade, reason = "not identifiable", f"the log does not fix it: {spread}"
    else:
        grade, reason = ("reliable" if ratio >= RELIABLE and one.apart <= DISAGREE else "tentative"), spread
    return AxisStiffness(**{**vars(one), "grade": grade, "reason": reason})


def log_posterior(one: AxisStiffness | None, prior: Prior, joint: int) -> tuple[float, float]:
    """Mean and variance of ln c with the prior of ln c; the prior itself where there is no estimate or it is refused."""
    mean, std = -float(np.log(prior.stiffness[joint - 1])), float(prior.log_std[joint - 1])
    if one is None or one.refused:
        return mean, std**2
    grid = np.linspace(min(mean - 5 * std, np.log(one.compliance) - 3), max(mean + 5 * std, np.log(one.compliance) + 3), 20001)
    log = -0.5 * ((grid - mean) / std) ** 2 - 0.5 * ((np.exp(grid) - one.compliance) / one.std) ** 2
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    centre = float(weight @ grid)
    return centre, float(weight @ (grid - centre) ** 2)
