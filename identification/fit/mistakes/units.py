"""Units of whole quantities: a factor common to all joints against the prior, and times that no load test takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.fit.load_test import LoadTest
from identification.fit.mistakes.mistake import Mistake, table_mistake
from identification.fit.posterior import Posterior
from identification.model.effects_in_force import SPRINGS

Array = NDArray[np.float64]
# A joint is told by the data where its ln k is known to this.
TOLD = 0.3
# By how much ln k scatters about the prior's medians joint by joint (engineering judgement: data of several arms of one size
# lie within a factor 1.6 of each other), and which part of the prior's own spread is common to all joints: most built-in
# medians are those of another robot.
SCATTER, SHARED = 0.5, 0.5
# A common factor is worth a word from here on, if it is so many standard deviations of what joints scatter.
COMMON, SIGMAS = 3.0, 3.5
# A unit is named near enough to be one (ln), in words; the mistake is one from as likely as not.
NEAREST = 0.5
# Factor on the forces (or 1 / factor on the deflections), what was written instead, and in which share of load tests it is
# (engineering judgement); the first of equals is the likelier.
FORCE_UNITS = ((4.44822, "in lbf, not in N", 0.02), (9.80665, "in kgf, not in N (or deflections in 0.1 um)", 0.05),
               (1000.0, "in kN, not in N (or deflections in nm)", 0.02))
DEFLECTION_UNITS = ((10.0, "in 0.01 mm, not in um", 0.05), (25.4, "in mil, not in um", 0.02),
                    (1000.0, "in mm, not in um", 0.05), (25400.0, "in inches, not in um", 0.01))
# Rows of one visit follow each other in less [s], and a load is not on for longer than since the row before, but for so many
# times that.
LONGEST_STEP_S = 3600.0
TOO_LONG, IN_MINUTES = 3.0, 100.0


@dataclass(frozen=True)
class CommonFactor:
    """How many times stiffer all joints are than the prior's medians, and the standard deviation of its ln by which robots
    differ from their prior."""

    times: float
    log_std: float

    @property
    def words(self) -> str:
        """"4.2 times softer"."""
        return f"{self.times:.3g} times stiffer" if self.times > 1 else f"{1 / self.times:.3g} times softer"


@dataclass(frozen=True)
class Unit:
    """A unit that a common factor looks like: quantity is force or deflection, by what its numbers are to be multiplied, in
    words; probability: that it is that, and not the robot."""

    quantity: str
    by: float
    words: str
    probability: float

    @property
    def sentence(self) -> str:
        """Without the rows it holds for."""
        return f"{self.quantity}s seem to be {self.words}"


def common_factor(fitted: Posterior) -> CommonFactor | None:
    """The factor common to all joints against the prior's medians; None where that is no more than joints scatter by."""
    log_k = -fitted.mean[SPRINGS] - np.log(fitted.prior.prior.stiffness)
    told = np.sqrt(np.diag(fitted.covariance)[SPRINGS]) < TOLD
    if not told.any():
        return None
    mean, std = float(np.mean(log_k[told])), SCATTER / np.sqrt(told.sum())
    alike = bool(np.all(np.sign(log_k[told]) == np.sign(mean)))
    if not alike or abs(mean) < np.log(COMMON) or abs(mean) < SIGMAS * std:
        return None
    shared = SHARED * rms(fitted.prior.prior.log_std[told])
    return CommonFactor(float(np.exp(mean)), float(np.hypot(std, shared)))


def unit_of(factor: CommonFactor) -> Unit | None:
    """The unit that is likeliest, of those near. Its odds are how often it is written, times how much better the factor fits a
    robot that is as its prior says and that unit than a robot that is not."""
    log_k, variance = np.log(factor.times), factor.log_std**2
    known = [("force", -np.log(by), by, words, share) for by, words, share in FORCE_UNITS]
    known += [("deflection", np.log(by), by, words, share) for by, words, share in DEFLECTION_UNITS]
    near = [(share * np.exp((log_k * at - at**2 / 2) / variance), quantity, by, words)
            for quantity, at, by, words, share in known if abs(log_k - at) < NEAREST]
    if not near:
        return None
    odds, quantity, by, words = max(near)
    return Unit(quantity, by, words, float(odds / (1 + odds)))


def unit_mistake(fitted: Posterior) -> tuple[Mistake, float] | None:
    """The unit that a factor common to all joints is likelier to be than a robot that differs so much, and its probability."""
    factor = common_factor(fitted)
    unit = factor and unit_of(factor)
    if not factor or not unit or unit.probability < 0.5:
        return None
    return table_mistake(
        f"{unit.quantity}_unit", f"{unit.sentence}, in {{rows}}: all joints come out {factor.words} than the prior's medians",
        "compare one reading with the instrument's display; if the robot really is so, state prior.stiffness_nm_per_rad in "
        "cell.yaml", _scaled(unit.quantity, unit.by)), unit.probability


def _scaled(quantity: str, by: float) -> Callable[[LoadTest], dict[str, Array]]:
    def change(data: LoadTest) -> dict[str, Array]:
        if quantity == "force":
            return {"wrench": data.rows.wrench * by}
        return {"deflection": data.rows.deflection * by, "sigma": data.rows.sigma * by}

    return change


def time_mistake(data: LoadTest) -> Mistake | None:
    """Times in another unit: rows of a visit that lie hours apart, or loads that were on for longer than there was time."""
    rows = data.rows
    step = np.where((np.diff(rows.visit) == 0) & (np.diff(rows.reference) == 0), np.diff(rows.time), np.nan)
    known = step > 0
    if known.sum() < 3:
        return None
    settles = "compare two rows with the clock: time_s and dwell_s are in seconds"
    typical, dwell = float(np.median(step[known])), rows.dwell[1:]
    both = known & (dwell > 0)
    ratio = float(np.median(dwell[both] / step[both])) if both.sum() >= 3 else 0.0
    if ratio > TOO_LONG:
        if ratio <= IN_MINUTES:
            return _times("minutes", "time_s seems to be in minutes in {rows}", settles, 60.0, 1.0, ratio)
        return _times("dwell ms", "dwell_s seems to be in ms in {rows}", settles, 1.0, 1e-3, ratio)
    if typical > LONGEST_STEP_S:
        also = " and dwell_s" if both.any() and float(np.median(dwell[both])) > LONGEST_STEP_S / 10 else ""
        return table_mistake(
            "time_unit[ms]", f"time_s{also} seem{'' if also else 's'} to be in ms in {{rows}}: rows of one visit follow each "
            f"other after {typical / 3600:.1f} hours", settles,
            lambda other: in_other_units(other, 1e-3, 1e-3 if also else 1.0))
    return None


def _times(name: str, sentence: str, settles: str, time: float, dwell: float, ratio: float) -> Mistake:
    why = f": loads were on {ratio:.0f} times as long as there was time between the rows"
    return table_mistake(f"time_unit[{name}]", sentence + why, settles,
                         lambda other: in_other_units(other, time, dwell))


def in_other_units(data: LoadTest, time: float, dwell: float) -> dict[str, Any]:
    """Times and dwells of the rows times these."""
    rows = data.rows
    return {"time": time * rows.time, "began": time * rows.began, "dwell": dwell * rows.dwell}


