"""The stiffness of a joint from logs in motion, with an interval that holds, or the reason why there is none.

    deflection = offset + c (torque - F_c sign(speed) - F_v speed - J acceleration) + delay speed

The motor's inertia, its friction and the encoders' delay are there in any motion, so they are always in the model; viscous
friction and the delay share one column and are not told apart. Where the log speaks for it, the torque of another joint is in
it, too. Where the data speak for a gear that is not linear, or for friction inside it, c is averaged over both readings by
their evidence. What is left of the torque beside these tells c. The interval has two parts: the noise, by generalised least
squares, and the law: how far c moves when the band is changed, a deviation that follows the joint's angle is allowed, or the
gear is linear or not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import counted
from identification.common.quantities import two_sigma
from identification.model.robot import Prior
from identification.motion.axis import Axis, Solved, axis_of, solve, straight_line
from identification.motion.band import BAND
from identification.motion.crosstalk import crosstalk
from identification.motion.dictionary import ALWAYS, Shape
from identification.motion.log_file import MotionLog
from identification.motion.proxies import without_proxies
from identification.motion.remainder import angle_columns
from identification.motion.transmission import Transmission

Array = NDArray[np.float64]
# Bands [Hz] between which the stiffness must hold.
BANDS = (4.0, BAND, 9.0)
ANGLE_DEGREE = 4
# Laws of the gear that change what is taken for its stiffness, where the data speak for them.
GEAR_LAWS = ("hysteresis", "soft_zone", "backlash")
# Share of the torque's variance that must be left beside speed, its sign and acceleration.
LEAST_SHARE = 0.02
# c over its standard deviation: below the first no stiffness is stated, from the second on it is reliable.
STATED, RELIABLE = 3.0, 6.0
# Samples that must be left beside what is fitted: with fewer their scatter does not tell how sure it is.
FEWEST_LEFT = 10
# Records disagree from this distance on, in standard deviations of their difference.
DISAGREE = 2.576


@dataclass(frozen=True, eq=False)
class AxisStiffness:
    """compliance c [rad/(N m)] with its standard deviations by the noise and by the law, NaN where refused; share: of the
    torque's variance that speed, its sign and acceleration do not explain; straight: c of a straight line through the torque;
    grade, reason: as in stiffness.json. records: (source, c, std) of each record alone. apart: the largest distance of two
    records in standard deviations. beside: the transmission error that was taken out, in words. left: samples under the band
    beyond the coefficients that are fitted to them."""

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
    beside: str = ""
    apart: float = 0.0
    left: int = FEWEST_LEFT

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

    @property
    def sentence(self) -> str:
        """In plain words."""
        if self.refused:
            return f"k{self.joint} refused: {self.reason}"
        low, high = self.interval_95
        return f"k{self.joint} = {1 / self.compliance:.3g} N m/rad ({low:.3g} ... {high:.3g}), {self.grade}"

    def as_dict(self) -> dict[str, Any]:
        """JSON values, whatever its grade."""
        low, high = self.interval_95
        return {
            "joint": self.joint, "grade": self.grade, "reason": self.reason, "compliance_rad_per_nm": self.compliance,
            "noise_std": self.noise_std, "law_std": self.law_std, "stiffness_nm_per_rad": finite_or_none(1 / self.compliance),
            "interval_95": [finite_or_none(low), finite_or_none(high)],
            "straight_line_nm_per_rad": finite_or_none(1 / self.straight),
            "torque_share_of_its_own": self.share, "samples": self.samples, "worth_independent": self.worth,
            "link_delay_s": {"estimate": self.delay[0], "std": self.delay[1]},
            "records": [{"record": name, "compliance_rad_per_nm": c, "std": std} for name, c, std in self.records],
            "beside": self.beside, "records_apart_sigmas": self.apart if self.records else None,
        }

    def lines(self) -> list[str]:
        """How it was found, and what each record says by itself."""
        beside = f"; beside {self.beside}" if self.beside else ""
        return [f"k{self.joint}: {self.reason}; {self.samples} samples, worth {self.worth:.0f} independent ones{beside}",
                *(f"  {name}: k = {1 / c:.3g} N m/rad (c = {c:.2e} +- {two_sigma(std):.1e})" for name, c, std in self.records)]


def finite_or_none(value: float) -> float | None:
    """As JSON has it."""
    return float(value) if np.isfinite(value) else None


def axis_stiffness(joint: int, records: list[MotionLog], transmission: Transmission | None = None) -> AxisStiffness:
    """The joint's stiffness from all records that have it, and from each alone, beside a transmission error found before."""
    transmission = transmission or Transmission(joint)
    having = transmission.cleaned([record for record in records if joint in record.joints])
    line = straight_line(axis_of(joint, records, BAND, only=ALWAYS))
    together = replace(_from(joint, having, transmission), beside=transmission.words, straight=float(line[-1]))
    if len(having) == 1:
        return together
    alone = [_from(joint, [record], transmission) for record in having]
    listed = tuple((record.source, own.compliance, own.std) for record, own in zip(having, alone, strict=True))
    apart = max(abs(a[1] - b[1]) / np.hypot(a[2], b[2]) for k, a in enumerate(listed) for b in listed[k + 1:])
    spread = float(np.std([compliance for _, compliance, _ in listed], ddof=1) / np.sqrt(len(listed)))
    return _judged(replace(together, law_std=max(together.law_std, spread), records=listed, apart=float(apart)))


def _from(joint: int, records: list[MotionLog], transmission: Transmission) -> AxisStiffness:
    smooth = transmission.smooth_over(records)
    central, delay, noise, values = 0.0, (0.0, 0.0), 0.0, []
    share = worth = np.nan
    samples = left = 0
    others = crosstalk(without_proxies(axis_of(joint, records, BAND, smooth)))
    for band in BANDS:
        axis = axis_of(joint, records, band, smooth)
        base = np.column_stack([axis.plain, *(shape.columns[:, :1] for shape in _always(axis)),
                                *(shape.on(axis.logs, axis.rates, band) for shape in others)])
        place = len(axis.lengths)
        by_law = [solve(axis, np.column_stack([base, *extra])) for extra in _laws(axis, base)]
        readings = list(by_law)
        if smooth is None:
            readings.append(solve(axis, np.column_stack([base, angle_columns(axis.angle, degree=ANGLE_DEGREE)])))
        values += [float(solved.coefficients[place]) for solved in readings]
        if band == BAND:
            central, noise = _averaged(by_law, place)
            delay = _averaged(by_law, axis.plain.shape[1])
            rigid = [k for k in range(base.shape[1]) if not axis.spring.shape[1] <= k < axis.plain.shape[1]]
            share, samples = _own_share(base[:, rigid], place), sum(len(log.time) for log in axis.logs)
            worth, left = axis.noise.worth(len(axis.torque)), max(0, by_law[0].count - base.shape[1])
    law = float(np.sqrt(np.mean((np.array(values) - central) ** 2)))
    return _judged(AxisStiffness(joint, central, noise, law, share, np.nan, delay, "", "", samples, worth, left=left))


def _always(axis: Axis) -> list[Shape]:
    return [group[0] for group in axis.dictionary if group[0].name in ALWAYS]


def _laws(axis: Axis, base: Array) -> list[list[Array]]:
    """Columns more than the base: none, and those of each law of the gear that the data speak for."""
    laws: list[list[Array]] = [[]]
    alone = solve(axis, base)
    for group in axis.dictionary:
        if group[0].name not in GEAR_LAWS:
            continue
        tried = [(solve(axis, np.column_stack([base, shape.columns])), shape) for shape in group]
        best, shape = min(tried, key=lambda fit: fit[0].chi2)
        supported = best.count * np.log(alone.chi2 / best.chi2) > np.log(best.count)
        if supported and shape.signs[0] * best.coefficients[-1] >= 0:
            laws.append([shape.columns])
    return laws


def _averaged(answers: list[Solved], place: int) -> tuple[float, float]:
    """A coefficient and its standard deviation, averaged over answers by their evidence (BIC)."""
    logs = np.array([-0.5 * answer.count * np.log(answer.chi2) - 0.5 * len(answer.coefficients) * np.log(answer.count)
                     for answer in answers])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    value = np.array([answer.coefficients[place] for answer in answers])
    variance = np.array([answer.covariance[place, place] for answer in answers])
    mean = float(weight @ value)
    return mean, float(np.sqrt(weight @ (variance + (value - mean) ** 2)))


def _own_share(columns: Array, place: int) -> float:
    """Share of the variance of a column that the others do not explain."""
    others = np.delete(columns, place, axis=1)
    left = columns[:, place] - others @ np.linalg.lstsq(others, columns[:, place], rcond=None)[0]
    return float(np.var(left) / np.var(columns[:, place]))


def _judged(estimate: AxisStiffness) -> AxisStiffness:
    ratio = estimate.compliance / estimate.std
    share = f"{100 * estimate.share:.1f} %"
    spread = (f"c = {estimate.compliance:.2e} rad/(N m), {estimate.noise_std:.1e} by the noise and {estimate.law_std:.1e} by "
              f"how the log is read; {share} of the torque's variance is not that of speed and acceleration")
    if estimate.share < LEAST_SHARE:
        grade, reason = "not identifiable", ("torque follows speed and acceleration too closely: "
                                             f"{share} of its variance is its own, {100 * LEAST_SHARE:g} % are needed")
    elif ratio < STATED:
        grade, reason = "not identifiable", f"the log does not fix it: {spread}"
    else:
        few = estimate.left < FEWEST_LEFT
        grade = "reliable" if ratio >= RELIABLE and estimate.apart <= DISAGREE and not few else "tentative"
        left = f"; {counted(estimate.left, 'sample')} beyond the coefficients that are fitted, reliable from {FEWEST_LEFT} on"
        reason = spread + left * few
    return replace(estimate, grade=grade, reason=reason)


def log_posterior(stiffness: AxisStiffness | None, prior: Prior, joint: int) -> tuple[float, float]:
    """Mean and variance of ln c with the prior of ln c; the prior itself where there is no estimate or it is refused."""
    mean, std = -float(np.log(prior.stiffness[joint - 1])), float(prior.log_std[joint - 1])
    if stiffness is None or stiffness.refused:
        return mean, std**2
    likeliest = np.log(stiffness.compliance)
    grid = np.linspace(min(mean - 5 * std, likeliest - 3), max(mean + 5 * std, likeliest + 3), 20001)
    log = -0.5 * ((grid - mean) / std) ** 2 - 0.5 * ((np.exp(grid) - stiffness.compliance) / stiffness.std) ** 2
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    centre = float(weight @ grid)
    return centre, float(weight @ (grid - centre) ** 2)
