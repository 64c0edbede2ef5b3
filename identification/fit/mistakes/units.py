"""Units of whole quantities: a factor common to all joints against the prior, and times that no load test takes."""

from __future__ import annotations

from collections.abc import Callable

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
# By how much ln k of a robot scatters about the prior's medians, joint by joint, where cell.yaml states no `relative_std`
# (engineering judgement: data of several arms of one size lie within a factor 1.6 of each other).
SCATTER = 0.5
# A common factor is worth a word from here on, if it is so many standard deviations of a mean of the joints told.
COMMON, SIGMAS = 3.0, 3.5
# Half the width of a unit, in standard deviations of that mean, and at least so much (ln).
NEAR, NEAREST = 2.0, 0.25
# Factor on the forces (or 1 / factor on the deflections), and what was written instead; the first of equals is the likelier.
FORCE_UNITS = ((4.44822, "in lbf, not in N"), (9.80665, "in kgf, not in N (or deflections in 0.1 um)"),
               (1000.0, "in kN, not in N (or deflections in nm)"))
DEFLECTION_UNITS = ((10.0, "in 0.01 mm, not in um"), (25.4, "in mil, not in um"), (1000.0, "in mm, not in um"),
                    (25400.0, "in inches, not in um"))
# Rows of one visit follow each other in less [s], and a load is not on for longer than since the row before, but for so many
# times that.
LONGEST_STEP_S = 3600.0
TOO_LONG, IN_MINUTES = 3.0, 100.0


def common_factor(fitted: Posterior) -> tuple[float, float] | None:
    """How many times stiffer all joints are than the prior's medians, and the standard deviation of its ln; None where that is
    no more than robots of one kind differ by."""
    log_k = -fitted.mean[SPRINGS] - np.log(fitted.prior.prior.stiffness)
    told = np.sqrt(np.diag(fitted.covariance)[SPRINGS]) < TOLD
    if not told.any():
        return None
    mean, std = float(np.mean(log_k[told])), _scatter(fitted, told) / np.sqrt(told.sum())
    alike = bool(np.all(np.sign(log_k[told]) == np.sign(mean)))
    if not alike or abs(mean) < np.log(COMMON) or abs(mean) < SIGMAS * std:
        return None
    return float(np.exp(mean)), float(std)


def _scatter(fitted: Posterior, told: NDArray[np.bool_]) -> float:
    """By how much ln k of these joints (6,) may differ from the prior's medians: more than usual where cell.yaml says so."""
    prior, cell = fitted.prior.prior, fitted.data.cell
    if np.array_equal(prior.relative_std, cell.robot.prior.relative_std):
        return SCATTER
    return max(SCATTER, rms(prior.log_std[told]))


def unit_mistake(fitted: Posterior) -> Mistake | None:
    """The unit that a factor common to all joints looks like."""
    found = common_factor(fitted)
    if found is None:
        return None
    factor, std = found
    known = [(1 / by, "force", by, words) for by, words in FORCE_UNITS]
    known += [(by, "deflection", by, words) for by, words in DEFLECTION_UNITS]
    off = [abs(np.log(factor / stiffer)) for stiffer, *_ in known]
    nearest = int(np.argmin(off))
    if off[nearest] > max(NEAR * std, NEAREST):
        return None
    _, quantity, by, words = known[nearest]
    times = f"{factor:.3g} times stiffer" if factor > 1 else f"{1 / factor:.3g} times softer"
    return table_mistake(
        f"{quantity}_unit", f"{quantity}s seem to be {words}, in {{rows}}: all joints come out {times} than the prior's "
        "medians",
        "compare one reading with the instrument's display; if the robot really is so, state prior.stiffness_nm_per_rad in "
        "cell.yaml", _scaled(quantity, by))


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
            lambda other: {"time": 1e-3 * other.rows.time, "dwell": (1e-3 if also else 1.0) * other.rows.dwell})
    return None


def _times(name: str, sentence: str, settles: str, time: float, dwell: float, ratio: float) -> Mistake:
    why = f": loads were on {ratio:.0f} times as long as there was time between the rows"
    return table_mistake(f"time_unit[{name}]", sentence + why, settles,
                         lambda other: {"time": time * other.rows.time, "dwell": dwell * other.rows.dwell})


