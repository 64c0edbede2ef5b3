"""`verify`: what a measured pass before and one after the correction say, in numbers, findings and sentences."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from compensator.verification.comparison import SANE_SCALE, SMALL, WORSE_SIGMAS, Comparison, Scale, compare, estimate_scale
from compensator.verification.predicted_deviation import of_tool, predicted_at
from compensator.verification.readings import Indices, Readings, pair, read_readings
from identification.common.added_targets import read_added
from identification.common.arrays import Array, rms
from identification.common.findings import Finding, counted, error
from identification.common.other_axes import along_other_axes, turned_axes
from identification.model.cell import Cell

# What readings in another unit are of those in micrometres.
UNITS = ((1 / 25.4, "in mil"), (1e-3, "in millimetres"), (1e3, "in nanometres"), (2.0, "of the diameter"))

# So many places that are off by so many times their noise say that nothing changed where they changed by less than this share.
FEWEST_ALIKE, CLEAR, UNCHANGED = 10, 5.0, 0.15
# A robot in motion gives way more than in its load tests (Theissen et al. 2022); under this something else is the matter, as
# beyond three times the 20 % that `learn` assumes of that beforehand.
STIFFER, SOFTER = 0.85, 1.6


@dataclass(frozen=True, eq=False)
class Verification:
    """Everything of one `verify`. rows_before, rows_after: the pairs. predicted (N, C) [m] at the readings before, scale
    overall and by axis: None and empty without a prediction. over: readings after that exceed the tolerance."""

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
            "axes": {axis: scale.as_dict() for axis, scale in self.axis_scales.items()}}
        return {**self.comparison.as_dict(), "unpaired_before": len(self.before) - len(self.rows_before),
                "unpaired_after": len(self.after) - len(self.rows_after), "tolerance_um": self.tolerance_um,
                "within_tolerance": self.accepted, "over_tolerance": self.over, "predicted": scale}

    def lines(self) -> list[str]:
        """What was found and what to do, in sentences: the terminal shows them, and the report stands under them."""
        comparison, points = self.comparison, self.comparison.before.points
        share = comparison.worse / points
        text = [_comparison_text(comparison),
                f"{counted(comparison.worse, 'place')} ({100 * share:.1f} %) got worse by more than {WORSE_SIGMAS:g} sigma of "
                "the readings; by chance some 2 % of equal ones would. The readings' own noise is "
                f"{comparison.noise_um:.1f} um RMS of what is left."]
        if self.tolerance_um is not None:
            text.append(f"Tolerance {self.tolerance_um:g} um: " + (
                f"accepted, all {len(self.after.each)} readings after are within it." if self.accepted
                else f"not accepted, {self.over} of {len(self.after.each)} readings after exceed it."))
        if self.scale is not None:
            text.append(_scale_text(self.scale))
        return text


def verify(
    cell: Cell, before_file: str | Path, after_file: str | Path, predicted_file: str | Path | None = None, *,
    tolerance_um: float | None = None, within: float = 1e-3, frame: Literal["base", "workobject"] = "base", radius: float = 0.0,
) -> Verification:
    """Compares the deviation measured before and after a correction, place by place, and with what was predicted.

    predicted_file: deviation.csv or offsets.csv of the measured program. tolerance_um: largest deviation that is accepted.
    within [m]: how far apart places may be that belong together. frame: of the readings' components. radius [m]: of the
    tool, where places are of the surface. Raises CompstiffError:
    what `read_readings`, `pair` and `predicted_at` raise, CS6020 no component in both passes, CS6028 nothing predicted.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> verification = compstiff.verify(cell, "before.csv", "after.csv", tolerance_um=20.0)
    >>> verification.accepted, round(verification.comparison.ratio, 1)
    (False, 8.5)
    """
    before, after = read_readings(Path(before_file), cell), read_readings(Path(after_file), cell)
    added = read_added(Path(predicted_file)) if predicted_file and after.key == "target" else None
    if added is not None:
        after = after.as_given(added)
        if added.numbered(int(before.place.max())):
            before = before.as_given(added)
    rows_before, rows_after = pair(before, after, within)
    findings = [*before.findings, *after.findings, *_unpaired(before, rows_before), *_unpaired(after, rows_after)]
    first, second = before.select(rows_before), after.select(rows_after)
    if not (~np.isnan(first.deviation) & ~np.isnan(second.deviation)).any():
        raise error("CS6020", "no component was measured in both passes at the same place", file=after.source,
                    hint="measure both passes alike")
    same = np.array_equal(first.deviation, second.deviation, equal_nan=True) and np.nan_to_num(first.deviation).any()
    if same:
        findings.append(Finding(
            "CS6034", "warning", f"has the very same readings as {before.source} at all {len(first)} places", file=after.source,
            hint="two measurements never agree to the last digit: name the files of the two passes"))
    comparison = compare(first, second)
    findings += () if same else _as_before(first, second)
    predicted, scale = None, None
    axis_scales: dict[str, Scale] = {}
    if predicted_file is not None:
        file, in_object = Path(predicted_file), frame == "workobject"
        stood = of_tool(before, radius, file, cell, in_object=in_object) if radius else before
        predicted, more = predicted_at(stood, file, cell, within, in_object=in_object)
        scale, axis_scales = _scales(before, predicted, predicted_file)
        axes, said = _other_axes(before, predicted, cell, in_object=in_object)
        scale = replace(scale, other_axes=axes)
        findings += [*more, *said, *_scale_findings(scale, axis_scales, before.source)]
    findings += _comparison_findings(comparison, after.source)
    # A reading of exactly the tolerance is within it, whatever its last digits became in metres.
    size_um = 1e6 * after.each.size
    over = 0 if tolerance_um is None else int((~(size_um <= tolerance_um * (1 + 1e-9))).sum())     # of NaN all
    if over:
        findings.append(Finding("CS6026", "error", f"{over} of {counted(len(size_um), 'reading')} deviate by more than the "
                                f"tolerance of {tolerance_um:g} um, the largest by {size_um.max():.1f} um",
                                file=after.source, hint="the part is not accepted" + (
                                    "; --predicted says whether a scale would help" if scale is None else "")))
    return Verification(before, after, rows_before, rows_after, comparison, predicted, scale, axis_scales, tolerance_um, over,
                        tuple(findings))


def _unpaired(readings: Readings, rows: Indices) -> list[Finding]:
    if len(rows) == len(readings):
        return []
    return [Finding("CS6022", "warning", f"{counted(len(readings) - len(rows), 'reading')} of {len(readings)} "
                    "without a counterpart in the other pass; left out of the comparison", file=readings.source,
                    hint="measure the same places in both passes")]


def _scales(before: Readings, predicted: Array, predicted_file: str | Path) -> tuple[Scale, dict[str, Scale]]:
    """Overall and by axis where there are several. Raises CompstiffError (CS6028) where nothing is predicted."""
    overall = estimate_scale(before.deviation, predicted)
    if overall is None:
        raise error("CS6028", "predicts no deviation where it was measured", file=str(predicted_file),
                    hint="is it of the program that was measured?")
    axes = enumerate(before.axes) if len(before.axes) > 1 else ()
    by_axis = {name: estimate_scale(before.deviation[:, [axis]], predicted[:, [axis]]) for axis, name in axes}
    return overall, {name: scale for name, scale in by_axis.items() if scale is not None}


def _other_axes(before: Readings, predicted: Array, cell: Cell, *, in_object: bool) -> tuple[str, list[Finding]]:
    """The axes along which the deviation measured before follows the predicted far better, with a warning (CS6050); "": the
    stated ones."""
    if before.deviation.shape[1] < 3:
        return "", []
    known = ~np.isnan(before.deviation).any(axis=1) & ~np.isnan(predicted).any(axis=1)
    if not known.any():
        return "", []           # one or two components of each place
    turn = (cell.world_from_base.inverse() @ cell.world_from_object).rotation
    name, frame = ("the base frame (--frame base)", turn.T) if in_object else ("the work object (--frame workobject)", turn)
    told = predicted[known]
    measured, sigma = before.deviation[known], rms(before.sigma[known])
    found = along_other_axes(measured, told, {name: told @ frame}, sigma) or turned_axes(measured, told, sigma)
    if found is None:
        return "", []
    axes, left, as_is = found
    return axes, [Finding("CS6050", "warning", f"the readings are off as is predicted, but along other axes: {axes}, which "
                          f"would leave {1e6 * left:.1f} um in place of {1e6 * as_is:.1f}", file=before.source,
                          hint="are the columns along the axes that --frame says, measured minus planned? Or are the axes of "
                          "the force log wrong?")]


def _comparison_findings(comparison: Comparison, source: str) -> list[Finding]:
    findings = []
    if comparison.verdict == "worse":
        findings.append(Finding("CS6027", "warning", f"the deviation grew from {comparison.before.rms_um:.1f} to "
                                f"{comparison.after.rms_um:.1f} um RMS", file=source,
                                hint="do not use this correction; check sign and frame of the force log, and that the files "
                                "are not exchanged"))
    if comparison.log_ratio is not None and comparison.log_ratio.correlation.short:
        why = ("too few for an interval" if comparison.interval is None else "with deviations that are alike over "
               f"{comparison.log_ratio.correlation.values:.2g} of them: the interval is rather too narrow")
        findings.append(Finding("CS6024", "warning", f"{counted(comparison.before.points, 'place')} {why}", file=source,
                                hint="measure a longer stretch of the path"))
    return findings


def _as_before(before: Readings, after: Readings) -> list[Finding]:
    """A warning (CS6048) where each place is off as it was, by more than its noise: nothing was corrected."""
    change = after.deviation - before.deviation
    both = ~np.isnan(change)
    noise = float(np.sum(before.sigma[both] ** 2 + after.sigma[both] ** 2))
    size = float(np.sum(before.deviation[both] ** 2))
    changed = float(np.sum(change[both] ** 2))
    if len(before) < FEWEST_ALIKE or size < CLEAR**2 * noise or changed > noise + UNCHANGED**2 * size:
        return []
    return [Finding("CS6048", "warning", f"each place is off as it was in {before.source}, but for "
                    f"{100 * np.sqrt(changed / size):.2g} % of it: no correction was at work", file=after.source,
                    hint="did the corrected program run, or the planned one with its offsets active (push)? Is it a copy of "
                    "the first file?")]


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
                                hint=_unit(scale.scale) + "check sign and frame of the forces and of the measurement "
                                "(--frame)"))
    if scale.shown and scale.interval is not None and SANE_SCALE[0] <= scale.scale and scale.interval[1] < STIFFER:
        findings.append(Finding("CS6049", "warning", f"the measured deviation is {_times(scale)} the predicted: a robot in "
                                "motion gives way more than at rest, not less", file=source,
                                hint="is it the deviation a side where both are meant, were places without a reading given 0, "
                                "is the sensor's gain off, or the stiffness file another robot's? Scale only if none of that"))
    if scale.shown and scale.interval is not None and scale.interval[0] > SOFTER and scale.scale <= SANE_SCALE[1]:
        findings.append(Finding("CS6052", "warning", f"the measured deviation is {_times(scale)} the predicted: a robot in "
                                "motion gives way more than at rest, but not so much", file=source,
                                hint="is it the deviation of a diameter where a side is meant, is the sensor's gain off, or "
                                "the stiffness file another robot's? Scale only if none of that"))
    if scale.constant_shown and scale.with_constant is not None:
        constant = ", ".join(f"{x:.0f}" for x in scale.constant_um)
        findings.append(Finding("CS6029", "warning", f"a part of ({constant}) um does not follow the force; with it the "
                                f"scale would be {scale.with_constant:.3f} in place of {scale.scale:.3f}", file=source,
                                hint="a set-up error of the part or the probe? Take it out and verify again before you scale"))
    unmended = _unmended(scale, axis_scales)
    for a, b in combinations(sorted(axis_scales), 2) if unmended > SMALL * scale.measured_rms_um else ():
        if _apart(axis_scales[a], axis_scales[b]):
            findings.append(Finding("CS6030", "warning", f"along {a} the measured deviation is {_times(axis_scales[a])} the "
                                    f"predicted, along {b} {_times(axis_scales[b])}: one scale leaves "
                                    f"{unmended:.1f} um RMS that would not be left with each its own",
                                    file=source, hint="diagnose the load tests, and check the frame of the measurement"))
    return findings


def _unmended(scale: Scale, axis_scales: dict[str, Scale]) -> float:
    """What one scale leaves [um RMS] beyond what the axes' own would."""
    own = sum(axis.points * axis.residual_rms_um**2 for axis in axis_scales.values())
    return float(np.sqrt(max(scale.points * scale.residual_rms_um**2 - own, 0.0) / scale.points))


def _apart(a: Scale, b: Scale) -> bool:
    """Whether the intervals have nothing in common."""
    first, second = a.interval, b.interval
    return first is not None and second is not None and (first[0] > second[1] or second[0] > first[1])


def _times(scale: Scale) -> str:
    between = f" (95 %: {scale.interval[0]:.3f} to {scale.interval[1]:.3f})" if scale.interval else ""
    return f"{scale.scale:.3f} times{between}"


def _comparison_text(comparison: Comparison) -> str:
    before, after = comparison.before, comparison.after
    text = (f"At {counted(before.points, 'place')} measured before and after the correction the deviation went from "
            f"{before.rms_um:.1f} to {after.rms_um:.1f} um RMS, the largest from {before.max_um:.1f} to {after.max_um:.1f} um.")
    if comparison.interval is None or comparison.ratio is None:
        return text + " These are too few places to say how sure that is."
    low, high = comparison.interval
    return text + {
        "better": f" It is {comparison.ratio:.2f} times smaller (95 %: {low:.2f} to {high:.2f}).",
        "worse": f" It became larger: before over after is {comparison.ratio:.2f} (95 %: {low:.2f} to {high:.2f}). Do not "
                 "use this correction.",
        "no difference shown": f" Before over after is {comparison.ratio:.2f} (95 %: {low:.2f} to {high:.2f}): no "
                               "difference is shown.",
    }[comparison.verdict]


def _scale_text(scale: Scale) -> str:
    text = (f"The prediction as it stands explains {100 * scale.share:.1f} % of the mean square measured before at the "
            f"{counted(scale.points, 'place')} where it says something; there the measured deviation is {_times(scale)} the "
            "predicted.")
    if scale.advised is not None:
        why = " So it is where the load tests were taken at standstill." if scale.scale > 1 else ""
        return text + why + (f" Advice: correct {scale.option}, which would explain {100 * scale.share_scaled:.1f} "
                             f"% and leave {scale.residual_rms_um:.1f} um RMS.")
    if scale.interval is not None and scale.interval[0] <= 1 <= scale.interval[1]:
        return text + " 1 lies inside: no scale is needed" + (
            f"; correct {scale.option} tells that motion adds nothing beyond that." if scale.option else ".")
    return text + " No scale is advised; the findings say why."


def _unit(scale: float) -> str:
    """The unit that readings of such a share of what was predicted may be in; "" for none."""
    near = [words for factor, words in UNITS if 0.7 < scale / factor < 1.4]
    return f"are they in micrometres, or {near[0]}? Else " if near else ""
