"""Fit: everything `identify` has to say of one set of measurements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding, error
from identification.fit.fitted_model import predicted_deflection
from identification.fit.identifiability import Ellipsoid, JointGrade, ellipsoid, grade_joints, information_spectrum
from identification.fit.noise import residual_std
from identification.fit.posterior import Posterior, posterior
from identification.fit.priors import PriorKind, PriorModel
from identification.fit.profile import Profile, profiles
from identification.fit.subsets import Conflict, subset_conflicts
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]

# A row whose weight is under this is named; no row is ever cut.
SUSPICIOUS_WEIGHT = 0.3
# Probability of the prior under which its disagreement with the data is said.
PRIOR_CONFLICT = 1e-3
# Off by more than this factor in every joint that the data tell is no robot, but a unit.
UNIT = 100.0
# Residual over stated noise from which it is said that the stated noise does not explain the data.
LARGER_THAN_STATED = 2.0


@dataclass(frozen=True, eq=False)
class Fit:
    """What the data say.

    model: the posterior as stiffness.json carries it. residual (N, 3) [m]: measured minus predicted, all rows, NaN where not
    measured. std (N, 3) [m]: what the estimated noise allows there. row_weight (N,): 1 for ordinary rows, small for gross
    errors, NaN for validate rows. held_out: RMS [m] of the validate rows with the prior's and the posterior's stiffnesses,
    None without such rows. profiles: empty unless asked for.
    """

    model: IdentifiedModel
    posterior: Posterior
    residual: Array
    std: Array
    row_weight: Array
    grades: tuple[JointGrade, ...]
    ellipsoid: Ellipsoid
    spectrum: Array
    conflicts: tuple[Conflict, ...]
    profiles: tuple[Profile, ...]
    held_out: tuple[float, float] | None
    findings: tuple[Finding, ...]

    def details(self) -> dict[str, Any]:
        """What `--json` gives beyond stiffness.json, JSON values."""
        return {
            "grades": [{"name": f"k{g.joint}", "grade": g.grade, "shrinkage": g.shrinkage, "signal_sigmas": g.signal,
                        "reason": g.reason, "helpful": g.helpful} for g in self.grades],
            "ellipsoid": self.ellipsoid.as_dict(),
            "information_spectrum": self.spectrum.tolist(),
            "conflicts": [conflict.as_dict() for conflict in self.conflicts],
            "profiles": [profile.as_dict() for profile in self.profiles],
            "held_out_rms_um": None if self.held_out is None else [1e6 * value for value in self.held_out],
        }


def fit_stiffness(
    cell: Cell, measurements: Measurements, *, prior_kind: PriorKind = "lognormal", gamma: float = 1.0,
    with_profiles: bool = False,
) -> Fit:
    """Identifies the stiffnesses from the rows with purpose `identify`.

    prior_kind "gaussian" is the paper's prior in k with weight gamma (eq. 11). Raises what `posterior` raises.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> fit = compstiff.fit_stiffness(cell, compstiff.read_measurements("measurements.csv", cell.robot))
    >>> print(fit.lines()[1])
    k1      1.549e+06               1.543e+06 ... 1.556e+06      reliable
    >>> compstiff.write({"fitted.json": fit.model.as_dict(), "identify.html": compstiff.report(fit)})
    """
    rows = measurements.select(~measurements.validate)
    prior = PriorModel(cell.prior, prior_kind, gamma)
    found = posterior(cell, rows, prior)
    grades = grade_joints(cell, rows, found, prior)
    conflicts = subset_conflicts(rows, found, prior)
    residual = measurements.deflection - predicted_deflection(cell, measurements, found.mean)
    fitted = ~measurements.validate
    held_out = None
    if measurements.validate.any():
        literature = predicted_deflection(cell, measurements, -np.log(cell.prior.stiffness))
        held_out = (_rms((measurements.deflection - literature)[measurements.validate]), _rms(residual[measurements.validate]))
    row_weight = np.full(len(measurements), np.nan)
    row_weight[fitted] = found.row_weight
    size = found.size
    noise = found.at_map.noise
    figures = {
        "rows": len(rows), "residual_rms_um": 1e6 * _rms(residual[fitted]), "chi2": found.chi2, "dof": found.readings - 6,
        "noise_scale": size.sensor,
        "noise": {
            "sensor_scale": size.sensor, "sensor_log_std": float(found.size_log_std[0]),
            "force_relative_scale": size.force, "force_stated": noise.stated[1], "force_told_apart": noise.separable[1],
            "pose_offset_um": (1e6 * size.offset * noise.offset).tolist(), "pose_offset_stated": noise.stated[2],
            "pose_offset_told_apart": noise.separable[2],
            "student_degrees_of_freedom": None if np.isinf(size.degrees) else size.degrees,
        },
        "prior": {"kind": prior_kind, "gamma": gamma} if prior_kind == "gaussian" else {"kind": prior_kind},
    }
    model = IdentifiedModel(cell.robot, cell.flange_from_tcp, found.mean, found.covariance,
                            tuple(grade.grade for grade in grades), figures, interval=found.draws.interval(0.95))
    findings = [*measurements.findings, *_findings(measurements, rows, found, grades, conflicts, prior)]
    if held_out is not None and held_out[1] > held_out[0]:
        findings.append(Finding(
            "CS1019", "warning", f"on the validation rows the identified stiffnesses are off by {1e6 * held_out[1]:.1f} um "
            f"RMS, the prior's by {1e6 * held_out[0]:.1f} um", file=measurements.source,
            hint="do not correct with them: check units, signs and joint columns, then compstiff diagnose"))
    std = residual_std(cell, measurements, found.size, np.exp(found.mean))
    return Fit(model, found, residual, std, row_weight, grades, ellipsoid(found),
               information_spectrum(found, prior), conflicts, profiles(found) if with_profiles else (), held_out,
               tuple(findings))


def _findings(
    measurements: Measurements, rows: Measurements, found: Posterior, grades: tuple[JointGrade, ...],
    conflicts: tuple[Conflict, ...], prior: PriorModel,
) -> list[Finding]:
    """What a user must know before trusting the numbers."""
    source, findings = measurements.source, []
    for grade in grades:
        if grade.grade == "not identifiable":
            findings.append(Finding("CS1012", "warning", f"k{grade.joint} is not identifiable from these loads, its value is "
                                    f"the prior's: {grade.reason}", file=source, hint=grade.helpful))
        elif grade.grade == "tentative":
            findings.append(Finding("CS1014", "note", f"k{grade.joint} is tentative: {grade.reason}", file=source,
                                    hint=grade.helpful))
    findings += _against_prior(source, found, grades, prior)
    ratio = float(np.sqrt(found.chi2 / max(found.readings - 6, 1)))
    if ratio > LARGER_THAN_STATED:
        size, noise = found.size, found.at_map.noise
        where = (f"estimated: sensor {size.sensor:.2g} times the stated, re-seating "
                 f"{1e6 * size.offset * float(np.mean(noise.offset)):.2g} um a pose")
        findings.append(Finding("CS1013", "warning", f"the residual is {ratio:.1f} times what the stated noise allows; "
                                f"{where}; the intervals use the estimated noise", file=source,
                                hint="state the noise in cell.yaml if it is known; otherwise see which pose or axis stands out "
                                "in the report"))
    light = np.flatnonzero(found.row_weight < SUSPICIOUS_WEIGHT)
    for row in light[np.argsort(found.row_weight[light])]:
        findings.append(Finding("CS1015", "warning", "this row does not fit the others and counts "
                                f"{100 * found.row_weight[row]:.0f} % of an ordinary one", file=source,
                                line=int(rows.line[row]), hint="measure it again, or see what was different"))
    for conflict in conflicts:
        if conflict.is_conflict:
            worst = int(np.argmax(np.abs(conflict.difference)))
            findings.append(Finding(
                "CS1016", "warning", f"{conflict.part} and {conflict.rest} want different stiffnesses: Mahalanobis distance "
                f"{conflict.distance:.1f} over {conflict.directions} directions (p = {conflict.corrected:.2g}), most in "
                f"k{worst + 1}, by a factor {np.exp(conflict.difference[worst]):.2f}", file=source,
                hint="one set of linear springs does not explain both: compstiff diagnose looks for the cause"))
    return findings


def _against_prior(source: str, found: Posterior, grades: tuple[JointGrade, ...], prior: PriorModel) -> list[Finding]:
    """A conflict (CS1017) of data and prior: the stiffnesses that the data tell, against what was expected of them."""
    from scipy.stats import chi2

    seen = np.array([grade.grade == "reliable" for grade in grades])
    if not seen.any():
        return []
    expected = -np.log(prior.prior.stiffness)
    off = ((found.mean - expected) / prior.log_std)[seen]
    p_value = float(chi2.sf(np.sum(off**2), int(seen.sum())))
    if p_value > PRIOR_CONFLICT:
        return []
    factor = np.exp(-(found.mean - expected)[seen])
    said = (f"the stiffnesses lie a factor {factor.min():.3g} to {factor.max():.3g} off the prior's medians, which it gives a "
            f"probability of {p_value:.1g}")
    if factor.min() > UNIT or factor.max() < 1 / UNIT:
        raise error("CS1018", said, file=source, hint="deflections are in micrometres, forces in newton: the factor looks "
                    "like a unit. If the robot really is so, state its prior in cell.yaml")
    return [Finding("CS1017", "warning", said, file=source, hint="is it the right robot, tool and prior? The data outweigh the "
                    "prior where joints are graded reliable")]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
