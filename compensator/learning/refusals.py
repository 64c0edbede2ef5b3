"""What is not believed of a measured part, and what its user should know."""

from __future__ import annotations

import numpy as np

from compensator.learning.held_out import HeldOut
from compensator.learning.learning import Learning
from identification.common.arrays import Array, rms
from identification.common.findings import Finding, Refused
from identification.common.quantities import two_sigma

# Chance of springs that differ so much from their load test; a part tells of directions in which it took more than this share
# of the variance.
PULLED, TOLD = 1e-3, 1e-4
# A robot in motion gives way more than in its load tests (Theissen et al. 2022); surely under this, something else is wrong.
STIFFER, SURE = 0.85, 3.0
# What is assumed of that factor beforehand is 20 % (learn.py); surely beyond three times that something else is wrong too.
SOFTER = 1.6
# By less than this on stretches left out nothing is lost: where there is nothing to learn, learning costs a little everywhere.
WORSE = 1.1
# A set-up that moves the middle of the points, or by its turn a point at their radius, by more than this [m] is to be mended.
LARGE_SETUP = 0.2e-3


def refuse_worse(tried: HeldOut | None, source: str, findings: tuple[Finding, ...]) -> None:
    """Refused (CS5312) where what was learned is surely worse than what was known, on stretches that it was not learned
    from."""
    if tried is not None and tried.better < -2.0 and tried.learned > WORSE * tried.known:
        raise Refused(Finding(
            "CS5312", "error", f"on stretches that were left out {1e6 * tried.learned:.1f} um are left, "
            f"{1e6 * tried.known:.1f} um without learning: what one stretch teaches is wrong on the next", file=source,
            hint="are the points those of this pass, and the log? measure more of the part"), *findings)


def refuse_without_physics(learning: Learning, source: str, findings: tuple[Finding, ...]) -> None:
    """Refused (CS5311) where the smooth remainder is larger than what physics explains: then a calibration is missing."""
    parts = learning.parts
    physical = rms(parts["predicted"] + parts["springs"] + parts["setup"] + parts["drift"])
    remainder = rms(parts["remainder"])
    if remainder <= physical or not len(learning.learned.remainder.places):
        return
    raise Refused(Finding(
        "CS5311", "error", f"a remainder of {1e6 * remainder:.0f} um RMS that no term explains, while deflection, set-up and "
        f"warming together explain {1e6 * physical:.0f} um: {_missing(learning)}", file=source,
        hint="calibrate first, then mill, measure and learn again: a remainder that large is not carried to another program"),
        *findings)


def _missing(learning: Learning) -> str:
    """Which calibration is missing, by what the remainder looks like: a stretch of the work space is a scale, all else is
    not."""
    rows, remainder = learning.terms.rows, learning.parts["remainder"]
    centred = (rows.position - rows.position.mean(axis=0))[rows.place] / learning.learned.frame.radius
    linear = (rows.direction[:, :, None] * centred[:, None, :]).reshape(len(rows), 9)
    fitted = linear @ np.linalg.lstsq(linear, remainder, rcond=None)[0]
    share = float(np.sum(fitted**2) / max(np.sum(remainder**2), 1e-300))
    if share > 0.7:
        return (f"{100 * share:.0f} % of it grow with the distance, as link lengths, joint zeros or the part's temperature "
                "make it: the kinematic calibration (absolute accuracy) of the robot is missing or off, or part and gauge "
                "differ in temperature")
    return ("it is bent within the part: the kinematic calibration (absolute accuracy), the tool's TCP, or the straightness of "
            "the fixture is missing, or the points are of another part")


def _pull(change: Array, before: Array, after: Array) -> tuple[float, int]:
    """Chi-square of a change (S,) of the parameters and its degrees of freedom. By the prior the change scatters by what the
    part took of the covariance, before less after (S, S): in directions that it tells little of a little change is much."""
    std = np.sqrt(np.maximum(np.diag(before), 1e-18))
    variance, directions = np.linalg.eigh(before / np.outer(std, std))
    kept = variance > 1e-12
    white = directions[:, kept] / np.sqrt(variance[kept]) / std[:, None]
    share, axes = np.linalg.eigh(white.T @ (before - after) @ white)
    told = share > TOLD
    return float(np.sum((axes.T @ white.T @ change)[told] ** 2 / share[told])), int(told.sum())


def said_of(learning: Learning, before: Array, mean: Array) -> list[Finding]:
    """Notes and warnings on what was learned."""
    from scipy.special import chdtrc

    findings, source = [], learning.source
    size = len(mean)
    chi2, told = _pull(learning.learned.mean[:size] - mean, before, learning.learned.covariance[:size, :size])
    if chdtrc(told, chi2) < PULLED:
        findings.append(Finding(
            "CS5313", "warning", f"the measured part pulls the springs away from what their load tests say (chi-square "
            f"{chi2:.0f} of the {told} of {size} combinations that it tells of)", file=source, hint="is the stiffness file "
            "this robot's? Else the model lacks something that acts with the force: compstiff diagnose on the load tests, and "
            "learn again with its --extended file"))
    motion = learning.motion
    if motion.value + SURE * motion.std < STIFFER:
        findings.append(Finding(
            "CS5328", "warning", f"the part was off by {motion.value:.2f} +- {two_sigma(motion.std):.2g} (2 sigma) times what "
            "the load tests let expect: a robot in motion gives way more than at rest, not less", file=source,
            hint="are these points of the corrected part? Then its own log, and --logged-with OFFSETS.csv. Is it the deviation "
            "a side where both are meant, were places without a reading given 0, is the sensor's gain right, and the stiffness "
            "file this robot's? Do not carry it to another program else"))
    if motion.value - SURE * motion.std > SOFTER:
        findings.append(Finding(
            "CS5336", "warning", f"the part was off by {motion.value:.2f} +- {two_sigma(motion.std):.2g} (2 sigma) times what "
            "the load tests let expect: a robot in motion gives way more than at rest, but not so much", file=source,
            hint="are points and log of one and the same pass? Is the deviation of a diameter where a side is meant, is the "
            "sensor's gain right, and the stiffness file this robot's? Do not carry it to another program else"))
    size, frame = learning.learned.springs, learning.learned.frame
    job = learning.learned.mean[size:size + 9]
    if learning.setup_on:
        shift, turn = float(np.linalg.norm(job[:3])), float(np.linalg.norm(job[3:6]))
        large = max(shift, turn) > LARGE_SETUP
        findings.append(Finding(
            "CS5314", "warning" if large else "note", f"the part stood {1e6 * shift:.0f} um and "
            f"{1e3 * turn / frame.radius:.2f} mrad from its work object, as far as rigid: carried only "
            "with --repeats setup or job", file=source, hint="probe the work object again" if large else ""))
    if learning.drift_on:
        findings.append(Finding(
            "CS5315", "note", f"a drift of {1e6 * np.linalg.norm(job[6:]):.0f} um over the {frame.duration:.0f} s of the job, "
            "as warming makes it: carried only with --repeats job", file=source))
    if learning.held_out is None:
        findings.append(Finding("CS5316", "warning", "too few places to leave stretches out: nothing says how well this holds "
                                "elsewhere", file=source, hint="measure more of the part"))
    return findings
