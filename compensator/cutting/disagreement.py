"""A log held against the forces that its stock and known coefficients let expect: do they agree, and if not, why?

Causes are further columns beside what is not known anyway (coefficients, the sensor's zero, where the stock stands): a change
of the edge's forces (wear), of the chip's (another spindle speed or feed), of all (another material, tool or gain), or a stock
that stands aside by far more than its file says; and, as the rival of all, anything else: all six coefficients free, the force
turned. The marginal likelihood of each says which is likelier, by how much; a
cause is named where it beats the others and none by 20 to 1 and what it leaves is what the model leaves. What no cause explains
is called unknown, and causes that explain it equally well are all told.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from compensator.cutting.coefficients import Coefficients
from compensator.cutting.posterior import LEAST, PLACE, ZERO, ForceRows
from identification.common.arrays import Array
from identification.common.autocorrelation import autocorrelation_time

Verdict = Literal["adequate", "named", "ambiguous", "unknown"]
# Odds of 20 to 1. A misfit of so many times what is stated, or under so large a share of the force, is none.
SURE, MISFIT, SMALL = np.log(20.0), 1.5, 0.06
# 1 sigma of a cause before it was looked at: shares of the force, and how far a stock may stand aside [m].
SHARE, FAR = 0.7, 1e-3
CAUSES = ("wear", "chip", "strength", "stock")
# A log that is off by a larger share of its force agrees with nothing: what is expected is not known (engineering judgement).
AGREES = 0.25
# Anything else: 1 sigma of each coefficient, as a share of the largest of its kind, and of a turn of the force [rad].
OTHER, TURNED = 0.5, 0.3
# No share of a cause is beyond these.
LEAST_SHARE, MOST_SHARE = -0.6, 3.0


@dataclass(frozen=True)
class Disagreement:
    """verdict; causes: the likeliest first, those within 20 to 1; odds: ln of the likeliest against none; size: of the
    likeliest, a share, or (3,) [m] in the work object; expected, left: RMS [N] of the log less what is expected, before and
    with the likeliest cause; force: RMS [N] of the log; known: 1 sigma, RMS [N], of what is expected."""

    verdict: Verdict
    causes: tuple[str, ...]
    odds: float
    size: tuple[float, ...]
    expected: float
    left: float
    force: float
    known: float

    def words(self) -> str:
        """For people: one sentence."""
        off = f"the log is off what the stock lets expect by {self.expected:.1f} N RMS, of {self.force:.0f} N"
        if self.verdict == "adequate":
            if self.expected <= AGREES * self.force:
                return f"{off}: they agree"
            return (f"{off}: they do not contradict each other, and more cannot be told: what is expected is known to "
                    f"{self.known:.0f} N (1 sigma)")
        if self.verdict == "unknown":
            return f"{off}: no cause that is known explains that by itself (wear, speed, material, place of the stock)"
        told = [self._told(cause) for cause in self.causes]
        if self.verdict == "named":
            return f"{off}: {told[0]}; that leaves {self.left:.1f} N"
        return f"{off}: either {', or '.join(told)}; this log does not tell which"

    def _told(self, cause: str) -> str:
        if cause != self.causes[0]:
            return {"wear": "the edges are worn, or sharper, or the teeth run out",
                    "chip": "the spindle or the feed had another speed",
                    "strength": "material, tool or the sensor's gain is another", "stock": "the stock stands aside",
                    "other": "something that is not among the causes known"}[cause]
        share = self.size[0]
        if cause == "wear":
            return (f"the edge's forces are {100 * share:+.0f} %, as of "
                    f"{'worn edges' if share > 0 else 'sharper edges, or of teeth that run out so that some miss the chip'}")
        if cause == "chip":
            return (f"the chips are {100 * share:+.0f} % thick, as with a spindle at {100 / max(1 + share, 0.05):.0f} % of its "
                    f"speed, or a feed of {100 * (1 + share):.0f} %")
        if cause == "strength":
            return f"all forces are {100 * share:+.0f} %, as of another material, tool or gain of the sensor"
        return ("the stock stands aside of where its file says by " + ", ".join(f"{1e3 * value:+.2f} mm in {name}"
                                                                  for value, name in zip(self.size, "xyz", strict=True)))


def disagreement(rows: ForceRows, coefficients: Coefficients, position_std: float, step: float) -> Disagreement:
    """rows.aside (n, 3, 3): what the forces change by where the tool stands aside by `step` [m] along each axis of the work
    object; position_std [m]: how far it may, by the stock file."""
    mean, weight = coefficients.mean, rows.weight
    of_chip, of_edge = weight[:, :, :3] @ mean[:3], weight[:, :, 3:] @ mean[3:]
    expected = of_chip + of_edge
    size = np.linalg.norm(expected, axis=1)
    known = root_of(coefficients.covariance)
    largest = np.repeat([np.abs(mean[:3]).max(), np.abs(mean[3:]).max()], 3)
    turned = np.cross(np.eye(3)[None], expected[:, None, :]).swapaxes(1, 2)
    always = [weight @ known, np.broadcast_to(ZERO * np.eye(3), (len(weight), 3, 3)), rows.aside * (position_std / step)]
    further = {"wear": SHARE * of_edge[:, :, None], "chip": SHARE * of_chip[:, :, None],
               "strength": SHARE * expected[:, :, None], "stock": rows.aside * (FAR / step),
               "other": np.concatenate([weight * (OTHER * largest), TURNED * turned], axis=2)}
    variance = rows.error**2 + LEAST**2 + (coefficients.model_error * size)[:, None] ** 2 / 3 + (
        PLACE * rows.slope(mean)) ** 2
    off = rows.force - expected
    scale = np.sqrt(variance)
    known_to = _rms(np.linalg.norm(np.concatenate(always, axis=2), axis=2))
    # Gross ones are cut off; the memory of what no cause explains.
    _, _, left_by_all = _solved(off, scale, [*always, *further.values()], 1.0)
    kept = np.abs(left_by_all / scale) < 6
    scale = np.where(kept, scale, np.abs(left_by_all))
    memory = max(autocorrelation_time(left_by_all / scale, floor=0.05).values, 1.0)
    none, _, left_by_none = _solved(off, scale, always, memory)
    solved = {cause: _solved(off, scale, [*always, columns], memory) for cause, columns in further.items()}
    order = sorted(solved, key=lambda cause: -solved[cause][0])
    best, x, left = solved[order[0]]
    own = x[-further[order[0]].shape[2]:]
    # The tool to one side is the stock to the other.
    share = tuple(float(value) for value in own * (-FAR if order[0] == "stock" else SHARE))
    force = _rms(rows.force)
    if best - none < SURE:
        verdict: Verdict = "adequate" if _fits(left_by_none, scale, force) else "unknown"
        return Disagreement(verdict, (), float(best - none), (), _rms(off), _rms(left_by_none), force, known_to)
    near = tuple(cause for cause in order if best - solved[cause][0] < SURE)
    possible = near[0] != "other" and (near[0] == "stock" or LEAST_SHARE < share[0] < MOST_SHARE)
    verdict = ("unknown" if not possible or not _fits(left, scale, force) else "named" if len(near) == 1 else "ambiguous")
    return Disagreement(verdict, near, float(best - none), share, _rms(off), _rms(left), force, known_to)


def _solved(off: Array, scale: Array, columns: list[Array], memory: float) -> tuple[float, Array, Array]:
    """Of off (n, 3) = D x + e, x ~ N(0, 1), e ~ N(0, scale^2 memory): the logarithm of the marginal likelihood but for what all
    have in common, x, and what is left (n, 3)."""
    design = np.concatenate(columns, axis=2).reshape(off.size, -1) / scale.reshape(-1, 1) / np.sqrt(memory)
    y = off.reshape(-1) / scale.reshape(-1) / np.sqrt(memory)
    information = design.T @ design + np.eye(design.shape[1])
    right = design.T @ y
    x = np.linalg.solve(information, right)
    likelihood = 0.5 * float(right @ x) - 0.5 * float(np.linalg.slogdet(information)[1])
    return likelihood, x, off - np.concatenate(columns, axis=2) @ x


def _fits(left: Array, scale: Array, force: float) -> bool:
    """Whether what is left is what may be left."""
    return bool(np.sqrt(np.median((left / scale) ** 2)) < MISFIT * 0.6745
                or np.sqrt(np.median(left**2)) < SMALL * force * 0.6745)


def root_of(covariance: Array) -> Array:
    """S with S S^T = covariance (6, 6)."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _rms(force: Array) -> float:
    """Of the sizes (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(force**2, axis=1))))
