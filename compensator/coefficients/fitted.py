"""FittedCoefficients: what a log, or a table, says of the force that a tool in a material needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from compensator.coefficients.next_cut import TestCut
from compensator.cutting.chips import COEFFICIENTS
from compensator.cutting.coefficients import IN_MM, Coefficients
from compensator.cutting.cut import Cut
from compensator.cutting.posterior import ForcePosterior
from identification.common.arrays import Array, rms
from identification.common.findings import Finding
from identification.common.quantities import two_sigma

# A coefficient is reliable with a standard deviation under this share (run-out's alone is about a tenth) of the largest
# of its kind, and not identifiable where the log left it this share of what was assumed before.
RELIABLE, WEAK, UNTOLD = 0.12, 0.3, 0.9


@dataclass(frozen=True, eq=False)
class FittedCoefficients:
    """coefficients: for cutting.json; before: standard deviations (6,) of the prior; posterior and cut: None where they come
    from the table. further: the cut that would tell most. of_table: Ktc as a share of what the table has for the stated
    material; None where no log tells it, or no material is stated. higher: the share by which Ktc is too large were the top of
    the stock 1 mm higher than in its file; None where no log was fitted, or the file says that it stands just there."""

    coefficients: Coefficients
    before: Array
    posterior: ForcePosterior | None
    cut: Cut | None
    further: TestCut | None
    findings: tuple[Finding, ...]
    of_table: float | None = None
    higher: float | None = None

    @property
    def grades(self) -> list[str]:
        """Of each coefficient."""
        mean, std = np.abs(self.coefficients.mean), self.coefficients.std
        largest = np.repeat([mean[:3].max(), mean[3:].max()], 3)
        return ["not identifiable" if now > UNTOLD * was else "reliable" if now < RELIABLE * size else
                "weak" if now > WEAK * size else "usable"
                for now, was, size in zip(std, self.before, largest, strict=True)]

    def content(self) -> dict[str, Any]:
        """What cutting.json holds."""
        return self.coefficients.as_dict()

    def as_dict(self) -> dict[str, Any]:
        """JSON values: cutting.json with grades, and what the log said."""
        told = None if self.posterior is None else {
            "rows": len(self.posterior.residual), "residual_n": rms(self.posterior.residual), "memory": self.posterior.memory,
            "zero_n": self.posterior.zero.tolist(), "stock_aside": self.posterior.aside.tolist(),
            "chip_force_of_table": self.of_table, "were_the_top_1_mm_higher": self.higher}
        further = None if self.further is None else {
            "width": self.further.width, "climb": self.further.climb, "feed_a_tooth_mm": 1e3 * self.further.chip,
            "force_std_before": self.further.before, "force_std_after": self.further.after}
        return self.content() | {"grades": self.grades, "std": (IN_MM * self.coefficients.std).tolist(), "log": told,
                                 "engagement": None if self.cut is None else self.cut.figures(), "next_cut": further}

    def lines(self) -> list[str]:
        """For the terminal."""
        rows = [f"{name}   {unit * value:8.1f} +- {unit * two_sigma(std):<7.2g} {'N/mm^2' if k < 3 else 'N/mm  '}  {grade}"
                for k, (name, unit, value, std, grade) in enumerate(zip(
                    COEFFICIENTS, IN_MM, self.coefficients.mean, self.coefficients.std, self.grades, strict=True))]
        lines = [*([self.cut.line()] if self.cut else []),
                 "coefficients (linear edge: force = chip x Kc + edge x Ke; +-: 2 sigma)", *rows]
        if self.posterior is not None:
            lines.append(f"fit: {len(self.posterior.residual)} targets, residual {rms(self.posterior.residual):.2f} N RMS; "
                         f"what the model leaves at a place: {100 * self.coefficients.model_error:.1f} % of the force; "
                         f"neighbours remember each other over {self.posterior.memory:.0f} targets")
        if self.coefficients.rejected:
            lines.append("predict and correct refuse these coefficients: their own log rejects them (above)")
        if self.higher is not None:
            lines.append("were the top of the stock 1 mm higher than in its file, Ktc would be "
                         f"{100 * abs(self.higher):.0f} % too {'large' if self.higher > 0 else 'small'}")
        if self.of_table is not None:
            lines.append(f"a chip needs {100 * self.of_table:.0f} % of the force that the table has for "
                         f"{str(self.coefficients.material).replace('_', ' ')}, which it knows to about 40 %")
        if self.further is not None and self.further.after < 0.8 * self.further.before:
            lines.append(f"what would tell most: log {self.further.words()}: the force of any slot or shoulder is then known "
                         f"to {100 * self.further.after:.0f} % in place of {100 * self.further.before:.0f} %")
        return lines
