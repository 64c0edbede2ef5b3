"""The top of the stock, higher or lower than its file says: what that does to the forces and to what a log tells of them, and
whether the log itself speaks for it. A slot alone does not; a program that cuts on two levels, or comes by a place twice, does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.cutting.cut import Cut
from compensator.cutting.posterior import ForcePosterior, ForceRows, fit_coefficients
from identification.common.arrays import Array
from identification.common.findings import Finding

# The top is tried within so much, 1 sigma, and told for so much [m].
TRIED, A_MILLIMETRE = 1e-3, 1e-3
# The log speaks for another top where a fit leaves so large a share of the force, and with it so much less: of 33 logs in
# stocks as their files said none came under 0.48 of it, of two in stocks 1 mm too thick both to 0.14
# (benchmarks/stock_jobs.py).
LEAVES, LESS = 0.04, 0.4


def by_top(cut: Cut, coefficients: Array) -> Array | None:
    """`Cut.by_top`; None where `cut_of` was not asked for a tool aside."""
    step = cut.blank.position_std
    return cut.by_top(coefficients, step) if step and cut.engagement.moved is not None else None


def too_large(top: Array | None, used: NDArray[np.bool_], found: ForcePosterior) -> float | None:
    """The share by which Ktc is too large were the top A_MILLIMETRE higher; top (N, 3) from `by_top`, used (N,): the targets of
    the fit."""
    return None if top is None else float(A_MILLIMETRE * np.einsum("ni,ni->", found.gain[0], top[used]) / abs(found.mean[0]))


def said_of_the_top(
    top: Array | None, used: NDArray[np.bool_], rows: ForceRows, found: ForcePosterior, before: tuple[Array, Array],
    source: str,
) -> list[Finding]:
    """A warning (CS4751) where the log fits far better with another top. before: prior mean (6,) and covariance (6, 6)."""
    force, left = _middle(rows.force), _middle(found.residual)
    if top is None or left < LEAVES * force:
        return []
    other = fit_coefficients(replace(rows, aside=np.concatenate([rows.aside, TRIED * top[used][:, :, None]], axis=2)), *before)
    if _middle(other.residual) > LESS * left:
        return []
    by = 1e3 * TRIED * float(other.aside[-1])
    where = f"{abs(by):.1f} mm {'higher' if by > 0 else 'lower'}"
    return [Finding(
        "CS4751", "warning", f"the log fits far better, {_middle(other.residual):.2g} N left in the middle in place of "
        f"{left:.3g}, where the top of the stock is about {where} than its file says", file=source,
        hint="measure how high the stock stood. Do not use these coefficients")]


def _middle(forces: Array) -> float:
    """The middle of the sizes [N] of forces (n, 3)."""
    return float(np.median(np.linalg.norm(forces, axis=1)))
