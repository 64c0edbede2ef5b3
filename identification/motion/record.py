"""diagnosis.json, stiffness.json, words and findings of joint deflection logs (docs/formats.md)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.model.cell import Cell
from identification.model.effects_in_force import EffectInForce
from identification.model.stiffness import IdentifiedModel
from identification.motion.band import BAND
from identification.motion.log_file import MotionLog
from identification.motion.procedure import LEFT, AxisDiagnosis, LogCause, LogDiagnosis
from identification.motion.stiffness import DISAGREE, AxisStiffness, log_posterior

Array = NDArray[np.float64]
# Effects that the robot shows at rest too: `correct` can use them.
AT_REST = ("backlash", "soft_zone", "hysteresis")
# Relative standard deviation of a value that was picked from a grid of doubled values.
BETWEEN = 0.2
MICRO = 1e6


def record(cell: Cell, found: LogDiagnosis) -> dict[str, Any]:
    """The content of diagnosis.json."""
    plain = np.concatenate([one.residuals[:, 0] for one in found.axes])
    extended = np.concatenate([one.residuals[:, 1] for one in found.axes])
    return {
        "format": "compstiff-diagnosis", "version": 1, "robot": cell.robot.name, "load_path": cell.robot.load_path,
        "measured": "joint deflection log", "verdict": found.verdict,
        "misfit": {"rms_urad": MICRO * _rms(plain), "left_rms_urad": MICRO * _rms(extended),
                   "p_value": min(one.p_value for one in found.axes), "p_resolution": found.p_resolution},
        "causes": [_cause(group) for group in _grouped([cause for one in found.axes for cause in one.causes])],
        "alternatives": [_named(group[0]) | {"probability": max(cause.probability for cause in group)} for group in _grouped(
            sorted((cause for one in found.axes for cause in one.alternatives), key=lambda cause: -cause.probability))],
        "gain": _gain(found), "next_measurements": _next(found),
        "joints": [_joint(one) for one in found.axes],
        "band_hz": BAND, "records": [log.source for log in found.records],
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _grouped(causes: list[LogCause]) -> list[list[LogCause]]:
    """Causes that belong to no joint are one, whatever joints show them."""
    groups: dict[str, list[LogCause]] = {}
    for cause in causes:
        groups.setdefault(cause.label if cause.shape.effect.joints else cause.shape.name, []).append(cause)
    return list(groups.values())


def _named(cause: LogCause) -> dict[str, Any]:
    effect = cause.shape.effect
    return {"effect": effect.name, "joint": cause.joint if effect.joints else None, **effect.where,
            "probability": cause.probability}


def _cause(group: list[LogCause]) -> dict[str, Any]:
    first = group[0]
    effect = first.shape.effect
    parameters: dict[str, Any] = {}
    for k, parameter in enumerate(effect.parameters):
        value, std = _pooled([(one.values[k], one.std[k]) for one in group])
        parameters[parameter.name] = {"estimate": float(np.clip(value, parameter.low, parameter.high)), "std": std,
                                      "unit": parameter.unit}
    content = _named(first) | {
        "probability": min(one.probability for one in group), "family": effect.family, "of_robot": effect.of_robot,
        "sentence": sentence(first), "parameters": parameters}
    if len(group) > 1:
        content["by_joint"] = {str(one.joint): {parameter.name: {"estimate": float(one.values[k]), "std": _number(one.std[k])}
                                                for k, parameter in enumerate(effect.parameters)} for one in group}
    return content


def sentence(cause: LogCause) -> str:
    """The cause in plain words."""
    effect = cause.shape.effect
    if effect.where.get("channel") == "link":
        late = "behind" if cause.values[0] > 0 else "ahead of"
        return f"the link encoders were recorded {late} the motor encoders: what looks like deflection is distance travelled"
    return effect.sentence.format(joint=cause.joint)


def _pooled(values: list[tuple[float, float]]) -> tuple[float, float | None]:
    """Weighted mean with its standard deviation, widened where the values differ by more than theirs."""
    if len(values) == 1 or any(not np.isfinite(std) or std <= 0 for _, std in values):
        return float(np.mean([value for value, _ in values])), _number(values[0][1])
    value, std = np.array(values).T
    weight = std**-2 / np.sum(std**-2)
    mean = float(weight @ value)
    birge = max(1.0, float(np.sqrt(np.sum(((value - mean) / std) ** 2) / (len(values) - 1))))
    return mean, birge / float(np.sqrt(np.sum(std**-2)))


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _gain(found: LogDiagnosis) -> dict[str, Any] | None:
    """Over all joints with a named cause: mean square of all their samples; by joint beside it."""
    gains = {one.joint: one.gain for one in found.axes if one.gain is not None}
    if not gains:
        return None
    before = np.array([gain.before for gain in gains.values()])
    after = np.array([gain.after for gain in gains.values()])
    low, high = (min(gain.interval[0] for gain in gains.values()), max(gain.interval[1] for gain in gains.values()))
    return {"rms_before_urad": MICRO * _rms(before), "rms_after_urad": MICRO * _rms(after), "ratio": _rms(before) / _rms(after),
            "interval": [low, high], "held_out": next(iter(gains.values())).held_out,
            "by_joint": {str(joint): gain.as_dict() for joint, gain in gains.items()}}


def _joint(one: AxisDiagnosis) -> dict[str, Any]:
    total = float(np.var(one.deflection))
    shares = [1 - float(np.var(one.residuals[:, k])) / total for k in range(2)]
    return {
        "joint": one.joint, "verdict": one.verdict, "p_value": one.p_value, "causes": [cause.label for cause in one.causes],
        "withdrawn": list(one.withdrawn), "fitted": {
            "rms_before_urad": MICRO * float(np.std(one.residuals[:, 0])),
            "rms_after_urad": MICRO * float(np.std(one.residuals[:, 1])),
            "variance_explained_before": shares[0], "variance_explained_after": shares[1]},
        "sets": [{"causes": list(each.names), "probability": each.probability,
                  "compliance_rad_per_nm": float(each.solved.coefficients[len(one.axis.lengths)])}
                 for each in one.hypotheses[:6]],
        "left": {"follows": [{"what": name, "share": share, "p_value": p} for name, share, p in one.left.follows],
                 "spectrum": [{"low_hz": low, "high_hz": high, "share": share} for low, high, share in one.left.spectrum],
                 "strongest_line": {"hz": one.left.line[0], "share": one.left.line[1]}},
        "stiffness": stiffness_dict(one.stiffness),
    }


def stiffness_dict(one: AxisStiffness) -> dict[str, Any]:
    """A joint's stiffness as JSON values, whatever its grade."""
    low, high = one.interval_95
    return {
        "joint": one.joint, "grade": one.grade, "reason": one.reason, "compliance_rad_per_nm": one.compliance,
        "noise_std": one.noise_std, "law_std": one.law_std, "stiffness_nm_per_rad": _number(1 / one.compliance),
        "interval_95": [_number(low), _number(high)], "straight_line_nm_per_rad": _number(1 / one.straight),
        "torque_share_of_its_own": one.share, "samples": one.samples, "worth_independent": one.worth,
        "link_delay_s": {"estimate": one.delay[0], "std": one.delay[1]},
        "records": [{"record": name, "compliance_rad_per_nm": c, "std": std} for name, c, std in one.records],
        "records_apart_sigmas": one.apart if one.records else None,
    }


def _next(found: LogDiagnosis) -> list[dict[str, Any]]:
    texts = {(cause.shape.effect.settles, cause.label): None for one in found.axes for cause in one.alternatives
             if cause.probability >= 0.05}
    listed = [{"kind": "check", "what": text, "about": label} for text, label in texts]
    listed += [{"kind": "check", "what": "hang known weights on the arm at standstill, up and down: torque without speed",
                "about": f"k{one.joint}"} for one in found.axes if one.stiffness.refused]
    return listed


def identified_model(
    cell: Cell, joints: list[AxisStiffness], causes: list[LogCause] | None = None, residual: float | None = None
) -> IdentifiedModel:
    """stiffness.json's model: joints without link encoder, or refused, at their prior; causes: effects in force."""
    known = {one.joint: one for one in joints}
    moments = [log_posterior(known.get(joint), cell.prior, joint) for joint in range(1, 7)]
    grades = tuple(known[joint].grade if joint in known else "not identifiable" for joint in range(1, 7))
    kept = [cause for cause in causes or [] if cause.shape.name in AT_REST]
    mean = [m for m, _ in moments]
    variance = [v for _, v in moments]
    for cause in kept:
        mean += cause.values.tolist()
        variance += [(std if np.isfinite(std) else BETWEEN * value) ** 2
                     for std, value in zip(cause.std, cause.values, strict=True)]
    fit = {"rows": max((one.samples for one in joints), default=0), "measured": "joint deflection log", "band_hz": BAND,
           "residual_rms_urad": residual, "joints": [stiffness_dict(one) for one in joints]}
    return IdentifiedModel(cell.robot, cell.flange_from_tcp, np.array(mean), np.diag(variance), grades, fit,
                           tuple(EffectInForce(cause.shape.effect, cause.joint) for cause in kept))


def stiffness_findings(records: list[MotionLog], joints: list[AxisStiffness]) -> list[Finding]:
    """What a user must know before trusting the stiffnesses."""
    source = records[0].source
    findings = [finding for log in records for finding in log.findings]
    missing = [f"k{joint}" for joint in range(1, 7) if joint not in {one.joint for one in joints}]
    if missing:
        findings.append(Finding("CS1504", "note", f"{', '.join(missing)}: no link encoder in the log; the value is the prior's",
                                file=source))
    for one in joints:
        if one.refused:
            findings.append(Finding("CS1502", "warning", f"k{one.joint} is not identifiable from this log, its value is the "
                                    f"prior's: {one.reason}", file=source,
                                    hint="load the joint while it stands still or moves slowly"))
        if one.records and one.apart > DISAGREE:
            values = ", ".join(f"{name}: {1 / c:.3g}" for name, c, _ in one.records)
            findings.append(Finding("CS1503", "warning", f"the records disagree on k{one.joint} by {one.apart:.1f} standard "
                                    f"deviations ({values} N m/rad)", file=source, hint="compstiff diagnose, on each record"))
    return findings


def diagnosis_findings(found: LogDiagnosis) -> tuple[Finding, ...]:
    """What a user must know beside the answer."""
    source = found.records[0].source
    findings = stiffness_findings(list(found.records), [one.stiffness for one in found.axes])
    for one in found.axes:
        left = [f"{name} ({100 * share:.0f} % of it, p = {p:.2g})" for name, share, p in one.left.follows
                if p <= LEFT / len(one.left.follows)]
        if left:
            findings.append(Finding("CS1505", "warning", f"joint {one.joint}: what is left follows {' and '.join(left)}; no "
                                    "cause in the dictionary has that law", file=source,
                                    hint="a transmission or encoder error repeats with the angle: measure it by moving slowly"))
    if found.verdict == "unknown":
        findings.append(Finding("CS1401", "warning", "something is wrong that no cause in the dictionary explains",
                                file=source))
    if found.verdict == "ambiguous":
        names = dict.fromkeys(cause.label for one in found.axes for cause in one.alternatives)
        findings.append(Finding("CS1402", "warning", f"the log cannot tell several causes apart: {', '.join(names)}",
                                file=source))
    return tuple(findings)
