"""`verify` in words: what a measured pass before and one after the correction say, and the findings they give."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from compensator.verification.comparison import SANE_SCALE, WORSE_SIGMAS, Comparison, Scale, compare, estimate_scale
from compensator.verification.predicted_deviation import predicted_at
from compensator.verification.readings import Array, Indices, Readings, pair, read_readings
from identification.common.findings import Finding, counted, error
from identification.model.cell import Cell


@dataclass(frozen=True, eq=False)
class Acceptance:
    """Everything of one `verify`. rows_before, rows_after: the pairs. predicted (N, C) [m] at the readings before, scale
    overall and by axis: None and empty without --predicted. over: readings after that exceed the tolerance."""

    before: Readings
    after: Readings
    rows_before: Indices
    rows_after: Indices
    comparison: Comparison
    predicted: Array | None
    scale: Scale | None
    axis_scales: dict[str, Scale]
    tolerance_um: float | None
    over: int
    findings: tuple[Finding, ...]

    @property
    def accepted(self) -> bool | None:
        """Whether every reading after is within the tolerance; None without one."""
        return None if self.tolerance_um is None else self.over == 0

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        scale = None if self.scale is None else self.scale.as_dict() | {
            "axes": {name: one.as_dict() for name, one in self.axis_scales.items()}}
        return {**self.comparison.as_dict(), "unpaired_before": len(self.before) - len(self.rows_before),
                "unpaired_after": len(self.after) - len(self.rows_after), "tolerance_um": self.tolerance_um,
                "within_tolerance": self.accepted, "over_tolerance": self.over, "predicted": scale}


def accept(
    cell: Cell, before_file: Path, after_file: Path, predicted_file: Path | None, *, tolerance_um: float | None,
    within: float, frame: Literal["base", "workobject"],
) -> Acceptance:
    """Reads, pairs and compares. Raises what `read_readings`, `pair` and `predicted_at` raise."""
    before, after = read_readings(before_file, cell), read_readings(after_file, cell)
    mine, other = pair(before, after, within)
    findings = [*before.findings, *after.findings]
    for readings, rows in ((before, mine), (after, other)):
        if len(rows) < len(readings):
            findings.append(Finding("CS6022", "warning", f"{counted(len(readings) - len(rows), 'reading')} of {len(readings)} "
                                    "without a counterpart in the other pass; left out of the comparison", file=readings.source,
                                    hint="measure the same places in both passes"))
    first, second = before.select(mine), after.select(other)
    if not (~np.isnan(first.deviation) & ~np.isnan(second.deviation)).any():
        raise error("CS6020", "no component was measured in both passes at the same place", file=after.source,
                    hint="measure both passes alike")
    comparison = compare(first, second)
    predicted, scale, axis_scales = None, None, {}
    if predicted_file is not None:
        predicted, more = predicted_at(before, predicted_file, cell, within, in_object=frame == "workobject")
        findings += more
        scale = estimate_scale(before.deviation, predicted)
        if scale is None:
            raise error("CS6028", "predicts no deviation where it was measured", file=str(predicted_file),
                        hint="is it of the program that was measured?")
        per_axis = {name: estimate_scale(before.deviation[:, [axis]], predicted[:, [axis]])
                    for axis, name in enumerate(before.axes)} if len(before.axes) > 1 else {}
        axis_scales = {name: one for name, one in per_axis.items() if one is not None}
        findings += _scale_findings(scale, axis_scales, before.source)
    findings += _comparison_findings(comparison, after.source)
    over = 0
    if tolerance_um is not None:
        over = int((1e6 * after.size > tolerance_um).sum())
        if over:
            findings.append(Finding("CS6026", "error", f"{over} of {counted(len(after), 'reading')} deviate by more than the "
                                    f"tolerance of {tolerance_um:g} um, the largest by {1e6 * after.size.max():.1f} um",
                                    file=after.source, hint="the part is not accepted; --predicted says whether a scale would "
                                    "help"))
    return Acceptance(before, after, mine, other, comparison, predicted, scale, axis_scales, tolerance_um, over,
                      tuple(findings))


def _comparison_findings(comparison: Comparison, source: str) -> list[Finding]:
    findings = []
    if comparison.verdict == "worse":
        findings.append(Finding("CS6027", "warning", f"the deviation grew from {comparison.before.rms_um:.1f} to "
                                f"{comparison.after.rms_um:.1f} um RMS", file=source,
                                hint="do not use this correction; check sign and frame of the force log, and that the files "
                                "are not exchanged"))
    if comparison.log_ratio is not None and comparison.log_ratio.short:
        known = "no interval is given" if comparison.interval is None else "the interval is rather too narrow"
        findings.append(Finding("CS6024", "warning", f"{counted(comparison.before.points, 'place')} with deviations that are "
                                f"alike over {comparison.log_ratio.memory:.0f} neighbours: {known}", file=source,
                                hint="measure a longer stretch of the path"))
    return findings


def _scale_findings(scale: Scale, axis_scales: dict[str, Scale], source: str) -> list[Finding]:
    findings = []
    if scale.short:
        known = "its interval is rather too narrow" if scale.interval else "it has no interval"
        findings.append(Finding("CS6024", "warning", f"{counted(scale.points, 'place')}, too few for the memory of what the "
                                f"scale leaves: {known}", file=source, hint="measure a longer stretch of the path"))
    if scale.interval is not None and not (scale.shown and SANE_SCALE[0] <= scale.scale <= SANE_SCALE[1]):
        low, high = SANE_SCALE
        findings.append(Finding("CS6031", "warning", f"the measured deviation is {_times(scale)} the predicted: no scale is "
                                f"advised outside {low:g} to {high:g}, or where 0 is not ruled out", file=source,
                                hint="check sign and frame of the forces and of the measurement (--frame)"))
    if scale.constant_shown and scale.with_constant is not None:
        constant = ", ".join(f"{x:.0f}" for x in scale.constant_um)
        findings.append(Finding("CS6029", "warning", f"a part of ({constant}) um does not follow the force; with it the "
                                f"scale would be {scale.with_constant:.3f} in place of {scale.scale:.3f}", file=source,
                                hint="a set-up error of the part or the probe? Take it out and verify again before you scale"))
    apart = [(one, other) for one in axis_scales for other in axis_scales if one < other and _apart(axis_scales, one, other)]
    for one, other in apart:
        findings.append(Finding("CS6030", "warning", f"along {one} the measured deviation is {_times(axis_scales[one])} the "
                                f"predicted, along {other} {_times(axis_scales[other])}: one scale does not mend both",
                                file=source, hint="diagnose the load tests, and check the frame of the measurement"))
    return findings


def _apart(scales: dict[str, Scale], one: str, other: str) -> bool:
    first, second = scales[one].interval, scales[other].interval
    return first is not None and second is not None and (first[0] > second[1] or second[0] > first[1])


def _times(scale: Scale) -> str:
    between = f" (95 %: {scale.interval[0]:.3f} to {scale.interval[1]:.3f})" if scale.interval else ""
    return f"{scale.scale:.3f} times{between}"


def words(result: Acceptance) -> list[str]:
    """What was found and what to do, in sentences: the terminal shows them, and the report stands under them."""
    comparison = result.comparison
    before, after = comparison.before, comparison.after
    said = [f"At {counted(before.points, 'place')} measured before and after the correction the deviation went from "
            f"{before.rms_um:.1f} to {after.rms_um:.1f} um RMS, the largest from {before.max_um:.1f} to {after.max_um:.1f} um."]
    if comparison.interval is not None and comparison.ratio is not None:
        low, high = comparison.interval
        said[0] += {
            "better": f" It is {comparison.ratio:.2f} times smaller (95 %: {low:.2f} to {high:.2f}).",
            "worse": f" It became larger: before over after is {comparison.ratio:.2f} (95 %: {low:.2f} to {high:.2f}). Do not "
                     "use this correction.",
            "no difference shown": f" Before over after is {comparison.ratio:.2f} (95 %: {low:.2f} to {high:.2f}): no "
                                   "difference is shown.",
        }[comparison.verdict]
    else:
        said[0] += " These are too few places to say how sure that is."
    share = comparison.worse / before.points
    said.append(f"{counted(comparison.worse, 'place')} ({100 * share:.1f} %) got worse by more than {WORSE_SIGMAS:g} sigma of "
                "the readings; by chance some 2 % of equal ones would. The readings' own noise is "
                f"{comparison.noise_um:.1f} um RMS of what is left.")
    if result.tolerance_um is not None:
        said.append(f"Tolerance {result.tolerance_um:g} um: " + (
            f"accepted, all {len(result.after)} readings after are within it." if result.accepted
            else f"not accepted, {result.over} of {len(result.after)} readings after exceed it."))
    if result.scale is not None:
        said.append(_scale_words(result.scale))
    return said


def _scale_words(scale: Scale) -> str:
    text = (f"The prediction as it stands explains {100 * scale.share:.1f} % of the mean square measured before; the measured "
            f"deviation is {_times(scale)} the predicted.")
    if scale.advised is not None:
        why = " So it is where the load tests were taken at standstill." if scale.scale > 1 else ""
        return text + why + (f" Advice: correct --scale {scale.advised:g}, which would explain {100 * scale.share_scaled:.1f} "
                             f"% and leave {scale.residual_rms_um:.1f} um RMS.")
    if scale.interval is not None and scale.interval[0] <= 1 <= scale.interval[1]:
        return text + " 1 lies inside: no scale is needed."
    return text + " No scale is advised; the findings say why."
