"""Fit: everything `identify` has to say of one set of measurements."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only, rms
from identification.common.findings import CompstiffError, Finding, counted, error
from identification.common.tails import chi2_tail
from identification.fit.bad_visits import bad_visits
from identification.fit.fitted_model import predicted_deflection
from identification.fit.force_gain import delivered
from identification.fit.identifiability import (
    LOOK_FOR_IT,
    RELIABLE_LOG_STD,
    Ellipsoid,
    JointGrade,
    ellipsoid,
    grade_joints,
    information_spectrum,
    told_by_one_visit,
)
from identification.fit.load_test import LoadTest
from identification.fit.mending import BadVisit, with_mends
from identification.fit.misfit import REJECTED, ModelCheck, model_check
from identification.fit.mistakes.judge import (
    NamedMistake,
    common_factor_findings,
    fitted_or_mistaken,
    mistake_finding,
    mistakes_in,
)
from identification.fit.mistakes.units import unit_mistake
from identification.fit.noise import residual_std
from identification.fit.noise_parts import ABSOLUTE, FORCE, OFFSET, SETUP
from identification.fit.posterior import Posterior
from identification.fit.priors import PriorKind, PriorModel
from identification.fit.profile import Profile, profiles
from identification.fit.seating import moving_zero
from identification.fit.subsets import Conflict, subset_conflicts
from identification.fit.validation import Validation, judge_validation
from identification.fit.visit_findings import (
    kinds_apart,
    mending,
    not_independent,
    sentence,
    validation_findings,
    visit_findings,
)
from identification.fit.visits import visit_name
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.gravity import fall_in_base
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]

# A row whose weight is under this is named; no single row is ever cut.
SUSPICIOUS_WEIGHT = 0.3
# More rows than these are told in one finding.
MOST_LIGHT_ROWS = 20
# Probability of the prior under which its disagreement with the data is said.
PRIOR_CONFLICT = 1e-3
# Off by more than this factor in every joint that the data tell is no robot, but a unit.
UNIT = 100.0
# Residual over stated noise from which it is said that the stated noise does not explain the data.
LARGER_THAN_STATED = 2.0
# A residual so many times smaller than the stated noise is worth a word where there are so many readings.
SMALLER_THAN_STATED, ENOUGH_READINGS = 0.25, 30
# Chi-squared a reading under the stated noise from which mistakes in the files are looked for.
WORTH_A_LOOK = 2.0
# Validation rows that the fit is off by so many times what the prior is off by reject it: the prior is in the fit, so that of a
# right model noise alone makes a part of that.
FAR_WORSE = 1.5


@dataclass(frozen=True, eq=False)
class Fit:
    """What the measurements of a cell say.

    model: the posterior as stiffness.json carries it. residual (N, 3) [m]: measured minus predicted, all rows, NaN where not
    measured. std (N, 3) [m]: what the estimated noise allows there. row_weight (N,): 1 for ordinary rows, small for gross
    errors, 0 for visits that were left out, NaN for validate rows. held_out: RMS [m] of the validate rows with the prior's and
    the posterior's stiffnesses, None without such rows. profiles: empty unless asked for. bad_visits: whose readings no
    stiffness explains that explains the others, left out of the posterior; validation: the outliers among the validate rows.
    """

    cell: Cell
    measurements: Measurements
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
    bad_visits: tuple[BadVisit, ...] = ()
    validation: Validation | None = None

    def __post_init__(self) -> None:
        read_only(self.residual, self.std, self.row_weight, self.spectrum)

    def as_dict(self) -> dict[str, Any]:
        """The content of stiffness.json, and under "details" what `--json` gives beyond it."""
        return self.model.as_dict() | {"details": {
            "grades": [{"name": f"k{g.joint}", "grade": g.grade, "shrinkage": g.shrinkage, "signal_sigmas": g.signal,
                        "reason": g.reason, "helpful": g.helpful} for g in self.grades],
            "ellipsoid": self.ellipsoid.as_dict(),
            "information_spectrum": self.spectrum.tolist(),
            "conflicts": [conflict.as_dict() for conflict in self.conflicts],
            "profiles": [profile.as_dict() for profile in self.profiles],
            "held_out_rms_um": None if self.held_out is None else [1e6 * value for value in self.held_out],
            "held_out_rms_without_outliers_um": None if self.validation is None else 1e6 * self.validation.rms_without,
            "bad_visits": [bad.as_dict() for bad in self.bad_visits],
        }}

    def lines(self) -> list[str]:
        """The stiffnesses as a table, and how well the model fits."""
        model = self.model
        lines = ["joint   stiffness k [N m/rad]   95 % interval                grade"]
        for joint, (k, (low, high), grade) in enumerate(
                zip(model.stiffness, model.interval_95, model.grades, strict=True), start=1):
            digits = 3 if high / low > 1.02 else 4
            interval = f"{low:.{digits}g} ... {high:.{digits}g}"
            lines.append(f"k{joint}      {k:<22.{digits}g}  {interval:<27}  {grade}")
        noise = model.fit["noise"]
        offset = sum(noise["pose_offset_um"]) / 3
        lines.append(f"fit: {model.fit['rows']} rows, residual {model.fit['residual_rms_um']:.2f} um RMS; estimated noise: "
                     f"sensor {noise['sensor_scale']:.2f} x the stated, re-seating {offset:.1f} um a pose")
        if model.rejected:
            lines.append(f"rejected by its own rows, so that nothing is graded reliable ({model.rejected})")
        lines.append(self.ellipsoid.sentence)
        lines += [f"left out: {sentence(bad)}; {mending(bad)}" for bad in self.bad_visits]
        if self.held_out is not None:
            before, after = self.held_out
            lines.append(f"validation rows: {1e6 * before:.1f} um RMS with the prior's stiffnesses, {1e6 * after:.1f} um with "
                         "the identified")
        if self.validation is not None and len(self.validation.numbers):
            lines.append(f"validation rows without {counted(len(self.validation.numbers), 'outlier')}: "
                         f"{1e6 * self.validation.rms_without:.1f} um with the identified stiffnesses")
        return lines


def fit_stiffness(
    cell: Cell, measurements: Measurements, *, prior_kind: PriorKind = "lognormal", gamma: float = 1.0,
    with_profiles: bool = False,
) -> Fit:
    """Identifies the stiffnesses from the rows with purpose `identify`.

    prior_kind "gaussian" is the paper's prior in k with weight gamma (eq. 11). Raises what `posterior` raises.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> fit = compstiff.fit_stiffness(cell, compstiff.read_measurements("measurements.csv", cell.robot))
    >>> print(fit.lines()[1])
    k1      1.55e+06                1.541e+06 ... 1.559e+06      reliable
    >>> compstiff.write({"fitted.json": fit.model.as_dict(), "identify.html": compstiff.report(fit)})
    """
    every = LoadTest(cell, measurements, PriorModel(cell.prior, prior_kind, gamma))
    whole = fitted_or_mistaken(every.with_rows(measurements.select(~measurements.validate)))
    test = bad_visits(whole)
    fitted = test.rest or whole
    bad = with_mends(test, fitted, whole.data.rows)
    identify = np.isin(measurements.row, fitted.data.rows.row)
    conflicts = subset_conflicts(fitted)
    mistaken = _mistakes(fitted, conflicts)
    check = model_check(fitted, conflicts)
    possible = [finding.message for finding in mistaken if finding.code == "CS1701"]
    if possible and not check.rejected:
        # The noise took the misfit up, and a mistake explains it better.
        check = replace(check, rejected=True, seen=possible[0])
    residual = measurements.deflection - predicted_deflection(every, fitted.mean)
    validation, held_out, judged_by = judge_validation(fitted, every), None, None
    if validation is not None:
        of_prior = measurements.deflection - predicted_deflection(every, -np.log(cell.prior.stiffness))
        # Which of the two is better no slip of the pen decides.
        fair = measurements.validate & ~np.isin(measurements.row, validation.numbers)
        held_out, judged_by = ((rms(of_prior[rows]), rms(residual[rows])) for rows in (measurements.validate, fair))
    not_better = _not_better(measurements.source, judged_by)
    if judged_by is not None and judged_by[1] > FAR_WORSE * judged_by[0] and not check.rejected:
        check = replace(check, rejected=True, seen=not_better[0].message)
    grades = grade_joints(fitted, check)
    row_weight = np.where(measurements.validate, np.nan, 0.0)
    row_weight[identify] = fitted.row_weight
    figures = _figures(fitted, rms(residual[identify])) | {"model_check": check.as_dict()}
    draws = delivered(fitted)
    model = IdentifiedModel(cell.robot, cell.flange_from_tcp, fitted.mean, draws.covariance,
                            tuple(grade.grade for grade in grades), figures, (), fall_in_base(cell.world_from_base),
                            cell.tool_mass, cell.tool_centre, interval=draws.interval(0.95),
                            differs=figures["noise"]["setup_relative"], made_from=measurements.made_from)
    findings = (*measurements.findings, *_rejected(measurements.source, check), *mistaken,
                *kinds_apart(bad, whole.data), *visit_findings(test, bad, measurements.source, _changed(whole, fitted)),
                *_findings(fitted, grades, conflicts), *moving_zero(fitted), *not_better,
                *validation_findings(validation, measurements.source))
    return Fit(cell, measurements, model, fitted, residual, residual_std(every, fitted.components, np.exp(fitted.mean)),
               row_weight, grades,
               ellipsoid(fitted), information_spectrum(fitted), conflicts, profiles(fitted) if with_profiles else (), held_out,
               findings, bad, validation)


def _changed(whole: Posterior, rest: Posterior) -> str:
    """What leaving visits out has done to the stiffnesses."""
    ratio = np.exp(whole.mean - rest.mean)
    most = int(np.argmax(np.abs(np.log(ratio))))
    return (f"the stiffnesses come from the other {len(rest.data.rows)} rows: k{most + 1} changed the most, by "
            f"{100 * (ratio[most] - 1):+.1f} %")


def _figures(fitted: Posterior, residual: float) -> dict[str, Any]:
    """The figures of the fit that stiffness.json carries; residual: RMS [m] of the fitted rows."""
    components, noise, prior = fitted.components, fitted.at_map.noise, fitted.prior
    return {
        "rows": len(fitted.data.rows), "residual_rms_um": 1e6 * residual, "chi2": fitted.chi2, "dof": fitted.readings - 6,
        "noise_scale": components.sensor,
        "noise": {
            "sensor_scale": components.sensor, "sensor_log_std": float(fitted.components_log_std[0]),
            "force_stated": any(noise.stated[FORCE:OFFSET]),
            "force_relative_scale": components.force, "force_relative_stated": noise.stated[FORCE],
            "force_absolute_scale": components.absolute, "force_absolute_stated": noise.stated[ABSOLUTE],
            "force_told_apart": noise.told_apart[0], "setup_relative": components.setup_relative, "memory": components.rho,
            "pose_offset_um": (1e6 * components.offset * noise.offset).tolist(), "pose_offset_stated": noise.stated[OFFSET],
            "pose_offset_told_apart": noise.told_apart[1],
            "student_degrees_of_freedom": None if np.isinf(components.degrees) else components.degrees,
            "force_gain_std": fitted.data.cell.noise.force_gain,
        },
        "prior": {"kind": prior.kind, "gamma": prior.gamma} if prior.kind == "gaussian" else {"kind": prior.kind},
    }


def _findings(fitted: Posterior, grades: tuple[JointGrade, ...], conflicts: tuple[Conflict, ...]) -> list[Finding]:
    """What a user must know before trusting the numbers."""
    source = fitted.data.rows.source
    findings = []
    for grade in grades:
        if grade.grade == "not identifiable":
            findings.append(Finding("CS1012", "warning", f"k{grade.joint} is not identifiable from these loads, its value is "
                                    f"the prior's: {grade.reason}", file=source, hint=grade.helpful))
        elif grade.grade == "tentative" and grade.helpful != LOOK_FOR_IT:
            findings.append(Finding("CS1014", "note", f"k{grade.joint} is tentative: {grade.reason}", file=source,
                                    hint=grade.helpful))
    fallen = [f"k{grade.joint}" for grade in grades if grade.helpful == LOOK_FOR_IT]
    if fallen:
        findings.append(Finding("CS1014", "note", f"{', '.join(fallen)} {'is' if len(fallen) == 1 else 'are'} tentative: the "
                                "model of all joints is rejected, whatever the loads tell of one", file=source,
                                hint=LOOK_FOR_IT))
    findings += [*_alone(fitted, grades), *_against_prior(fitted, grades), *_other_noise(fitted),
                 *not_independent(fitted), *_light_rows(fitted)]
    for conflict in conflicts:
        if conflict.is_conflict:
            worst = int(np.argmax(np.abs(conflict.difference)))
            findings.append(Finding(
                "CS1016", "warning", f"{conflict.part} and {conflict.rest} want different stiffnesses: Mahalanobis distance "
                f"{conflict.distance:.1f} over {conflict.directions} directions (p = {conflict.corrected:.2g}), most in "
                f"k{worst + 1}: by {conflict.part} {np.exp(conflict.difference[worst]):.2f} times as stiff as by "
                f"{conflict.rest}", file=source,
                hint="one set of linear springs does not explain both: compstiff diagnose looks for the cause"))
    return findings


def _alone(fitted: Posterior, grades: tuple[JointGrade, ...]) -> list[Finding]:
    """Joints that one visit tells alone (CS1043)."""
    rows, said = fitted.data.rows, []
    for joint, row in told_by_one_visit(fitted).items():
        if grades[joint - 1].grade != "not identifiable":
            said.append(Finding(
                "CS1043", "note", f"k{joint} is told by the loads of {visit_name(rows, np.array([row]))} alone: by how much "
                "they are wrong it is wrong, and no row shows it", file=rows.source, line=int(rows.line[row]),
                hint="of a rope over a pulley a scale at the tool's end says what it pulls: a sheave takes some per cent; or "
                "load the joint at another pose with another set-up. measurement.force_gain_std widens the interval"))
    return said


def _rejected(source: str, check: ModelCheck) -> list[Finding]:
    """A model (CS1021) that does not explain the rows it was made from."""
    if not check.rejected:
        return []
    chance = f" (p = {check.p_value:.2g})" if check.p_value < REJECTED else ""
    return [Finding("CS1021", "warning", f"six linear springs do not explain these rows{chance}: {check.seen}; "
                    "no stiffness is graded reliable, and predict and correct refuse the file", file=source,
                    hint="compstiff diagnose looks for the cause; --extended writes the model that has it")]


def _against_prior(fitted: Posterior, grades: tuple[JointGrade, ...]) -> list[Finding]:
    """A conflict (CS1017) of data and prior: the stiffnesses that the data tell, against what was expected of them."""
    seen = np.sqrt(np.diag(fitted.covariance)) <= RELIABLE_LOG_STD
    seen &= np.array([grade.grade != "not identifiable" for grade in grades])
    if not seen.any():
        return []
    source, prior = fitted.data.rows.source, fitted.prior
    expected = -np.log(prior.prior.stiffness)
    off = ((fitted.mean - expected) / prior.log_std)[seen]
    p_value = float(chi2_tail(np.sum(off**2), int(seen.sum())))
    if p_value > PRIOR_CONFLICT:
        return []
    factor = np.exp(-(fitted.mean - expected)[seen])
    message = (f"the stiffnesses lie a factor {factor.min():.3g} to {factor.max():.3g} off the prior's medians, which it gives "
               f"a probability of {p_value:.1g}")
    if factor.min() > UNIT or factor.max() < 1 / UNIT:
        raise error("CS1018", message, file=source, hint="deflections are in micrometres, forces in newton: the factor looks "
                    "like a unit. If the robot really is so, state its prior in cell.yaml")
    return [Finding("CS1017", "warning", message, file=source, hint="is it the right robot, tool and prior? The data outweigh "
                    "the prior where joints are graded reliable")]


def _mistakes(fitted: Posterior, conflicts: tuple[Conflict, ...]) -> list[Finding]:
    """Mistakes in the files that may explain a misfit (CS1701), and a factor common to all joints (CS1702).

    Raises CompstiffError for a unit (CS1018), and for a mistake that is clear without a look at physics (CS1700).
    """
    source = fitted.data.rows.source
    possible: tuple[NamedMistake, ...] = ()
    # Forces that differ from one visit to the next are what a mistake may look like.
    differ = fitted.at_map.noise.active[SETUP]
    if differ or any(conflict.is_conflict for conflict in conflicts) or fitted.chi2 >= WORTH_A_LOOK * fitted.readings:
        mistakes = mistakes_in(fitted)
        if mistakes.sure is not None:
            raise CompstiffError(mistake_finding(mistakes.sure, source, "error"))
        possible = mistakes.possible
    unit = unit_mistake(fitted)
    if unit is not None:
        raise error("CS1018", unit[0].sentence.format(rows=f"all {len(fitted.data.rows)} rows"), file=source,
                    hint=f"the factor looks like a unit; check: {unit[0].settles}")
    return [*common_factor_findings(fitted), *(
        Finding("CS1701", "warning", f"a mistake in the {named.candidate.mistake.of} would explain the misfit: "
                f"{named.sentence}", file=source, hint="compstiff diagnose weighs it against physical causes")
        for named in possible)]


def _other_noise(fitted: Posterior) -> list[Finding]:
    """A residual that the stated noise does not explain (CS1013), or that is far smaller (CS1042)."""
    ratio = float(np.sqrt(fitted.chi2 / max(fitted.readings - 6, 1)))
    if ratio < SMALLER_THAN_STATED and fitted.readings >= ENOUGH_READINGS:
        return [Finding("CS1042", "warning", f"the residual is {ratio:.2g} times what the stated noise allows; the intervals "
                        "use the estimated noise, which does not trust so small a one", file=fitted.data.rows.source,
                        hint="is the noise in cell.yaml in micrometres and newtons, of one reading?")]
    if ratio <= LARGER_THAN_STATED:
        return []
    components, noise = fitted.components, fitted.at_map.noise
    where = (f"estimated: sensor {components.sensor:.2g} times the stated, re-seating "
             f"{1e6 * components.offset * float(np.mean(noise.offset)):.2g} um a pose")
    return [Finding("CS1013", "warning", f"the residual is {ratio:.1f} times what the stated noise allows; {where}; the "
                    "intervals use the estimated noise", file=fitted.data.rows.source,
                    hint="state the noise in cell.yaml if it is known; otherwise see which pose or axis stands out in the "
                    "report")]


def _light_rows(fitted: Posterior) -> list[Finding]:
    """Rows (CS1015) that do not fit the others, the worst first; many are one finding."""
    rows, weight = fitted.data.rows, fitted.row_weight
    light = np.flatnonzero(weight < SUSPICIOUS_WEIGHT)
    light = light[np.argsort(weight[light])]
    if len(light) > MOST_LIGHT_ROWS:
        worst = ", ".join(str(rows.line[row]) for row in light[:MOST_LIGHT_ROWS])
        return [Finding("CS1015", "warning", f"{len(light)} of {len(rows)} rows do not fit the others and count less than "
                        f"{100 * SUSPICIOUS_WEIGHT:.0f} % of an ordinary one each; the worst in lines {worst}",
                        file=rows.source, line=int(rows.line[light[0]]),
                        hint="so many are no single mistakes: see in the report what they have in common")]
    return [Finding("CS1015", "warning", f"this row does not fit the others and counts {100 * weight[row]:.0f} % of an "
                    "ordinary one", file=rows.source, line=int(rows.line[row]),
                    hint="measure it again, or see what was different") for row in light]


def _not_better(source: str, judged_by: tuple[float, float] | None) -> list[Finding]:
    """Validation rows (CS1019) that the prior predicts better; judged_by: RMS [m] of the prior's and of the posterior's
    stiffnesses, of those that are no outliers."""
    if judged_by is None or judged_by[1] <= judged_by[0]:
        return []
    return [Finding("CS1019", "warning", "on the validation rows the identified stiffnesses are off by "
                    f"{1e6 * judged_by[1]:.1f} um RMS, the prior's by {1e6 * judged_by[0]:.1f} um", file=source,
                    hint="do not correct with them: check units, signs and joint columns, then compstiff diagnose")]
