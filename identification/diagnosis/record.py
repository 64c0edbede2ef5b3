"""diagnosis.json and the findings of a diagnosis (docs/formats.md#diagnose)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.diagnosis.procedure import Cause, Diagnosis
from identification.fit.fitted_model import predicted_deflection, situation_of, split
from identification.fit.noise import residual_std
from identification.fit.posterior import Posterior
from identification.fit.priors import PriorModel
from identification.fit.subsets import Conflict, subset_conflicts
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects import effects

# So many checks are told on the terminal.
MOST_CHECKS = 4
Array = NDArray[np.float64]
FORMAT = "compstiff-diagnosis"


def record(cell: Cell, measurements: Measurements, found: Diagnosis) -> dict[str, Any]:
    """The content of diagnosis.json."""
    left = plain_residual(cell, found)
    return {
        "format": FORMAT, "version": 1, "robot": cell.robot.name, "load_path": cell.robot.load_path,
        "verdict": found.verdict,
        "misfit": {"rms_um": 1e6 * rms(left), "expected_rms_um": 1e6 * rms(expected_std(cell, found)),
                   "p_value": found.detection.p_value, "p_resolution": found.detection.resolution},
        "causes": [_cause(cell, found, cause) for cause in found.causes] + [bad.as_dict() for bad in found.bad_rows],
        "alternatives": [_named(cause) for cause in found.alternatives],
        "gain": None if found.gain is None else found.gain.as_dict(),
        "next_measurements": next_measurements(found),
        "subset_conflicts": [conflict.as_dict() for conflict in conflicts(cell, found) if conflict.is_conflict],
        "adequacy_p_value": None if found.adequacy is None else found.adequacy.p_value,
        "patterns": list(found.patterns), "noise_beyond_stated": found.scatter or {}, "withdrawn": list(found.withdrawn),
        "law_differs": found.law_differs,
        "effective_rows": None if found.thinning is None else found.thinning.rows / found.thinning.memory,
        "correction_difference_um": None if found.matters is None else 1e6 * found.matters,
        "not_offered": found.left_out or {},
    }


def conflicts(cell: Cell, found: Diagnosis) -> tuple[Conflict, ...]:
    """Parts of the data against the rest, under the plain model: what its misfit looks like before it has a name."""
    return subset_conflicts(found.rows, found.plain, PriorModel(cell.prior))


def rms(values: Array) -> float:
    """Root mean square of what is not NaN."""
    return float(np.sqrt(np.nanmean(values**2)))


def plain_residual(cell: Cell, found: Diagnosis) -> Array:
    """Measured minus predicted by the plain model, fitted rows (n, 3) [m]."""
    return residual(cell, found, found.plain)


def extended_residual(cell: Cell, found: Diagnosis) -> Array:
    """Measured minus predicted by the extended model, fitted rows (n, 3) [m]."""
    return residual(cell, found, found.extended)


def residual(cell: Cell, found: Diagnosis, model: Posterior) -> Array:
    """Measured minus predicted by a model, fitted rows (n, 3) [m]."""
    return np.asarray(found.rows.deflection - predicted_deflection(cell, found.rows, model.map, model.terms))


def expected_std(cell: Cell, found: Diagnosis) -> Array:
    """What the noise allows (n, 3) [m]: as estimated with the causes named, else as stated (estimated where it is not)."""
    size = found.extended.size
    if found.verdict in ("ambiguous", "unknown"):
        size = size.within(found.plain.at_map.noise.stated)
    return residual_std(cell, found.rows, size, np.exp(found.extended.map[:6]))


def next_measurements(found: Diagnosis) -> list[dict[str, Any]]:
    """Loads, then checks that are no loads, for the names that are left."""
    listed: list[dict[str, Any]] = [load.as_dict() for load in found.next_loads]
    if found.verdict in ("ambiguous", "unknown"):
        texts = dict.fromkeys((cause.effect.settles, cause.label) for cause in found.alternatives if cause.probability >= 0.02)
        listed += [{"kind": "check", "what": text, "about": label} for text, label in texts]
    return listed


def next_words(item: dict[str, Any]) -> tuple[str, str]:
    """One of the next measurements: what to do, and what it tells."""
    if item["kind"] != "load":
        return item["what"], item["about"]
    angles = ", ".join(f"{angle:.1f}" for angle in item["q_deg"])
    forces = ", ".join(f"{force:.0f}" for force in item["forces_n"])
    return (f"joints ({angles}) deg: load along base {item['axis']}, {forces} N",
            f"{item['separates'][0]} from {item['separates'][1]}, by {item['expected_sigmas']:.1f} sigma")


def _named(cause: Cause) -> dict[str, Any]:
    return {"effect": cause.effect.name, "joint": cause.joint, "probability": cause.probability}


def _cause(cell: Cell, found: Diagnosis, cause: Cause) -> dict[str, Any]:
    model, place = found.extended, 6
    where = situation_of(cell, found.rows, np.exp(model.map[:6]))
    for term, fitted in zip(model.terms, split(model.map, model.terms), strict=True):
        count = len(term.start)
        if term.label == cause.label:
            spread = np.sqrt(np.diag(model.covariance))[place: place + count]
            mean = model.mean[place: place + count]
            values: dict[str, Any] = {
                parameter.name: {"estimate": float(np.clip(value, parameter.low, parameter.high)), "std": float(std),
                                 "unit": parameter.unit}
                for parameter, value, std in zip(term.effect.parameters, mean, spread, strict=True)}
            values |= {name: {"estimate": value, "std": 0.0} for name, value in term.effect.where.items()}
            moved = term.effect.contribution(where, term.joint, fitted)[:, :3]
            return _named(cause) | {"family": cause.effect.family, "of_robot": cause.effect.of_robot,
                                    "sentence": cause.sentence, "parameters": values,
                                    "largest_um": 1e6 * float(np.linalg.norm(moved, axis=1).max())}
        place += count
    raise KeyError(cause.label)


def summary(cell: Cell, found: Diagnosis) -> list[str]:
    """The answer in plain words."""
    before, allowed = 1e6 * rms(plain_residual(cell, found)), 1e6 * rms(expected_std(cell, found))
    lines = []
    if found.verdict == "adequate":
        lines.append("adequate: six springs explain the data to their noise")
    elif found.verdict == "named":
        for cause in found.causes:
            told = _cause(cell, found, cause)
            values = ", ".join(f"{name} = {value(item)}" for name, item in told["parameters"].items())
            lines.append(f"named: {cause.sentence}. In these measurements it makes up to {told['largest_um']:.0f} um "
                         f"({cause.label}: {values}; probability {cause.probability:.3f})")
        for bad in found.bad_rows:
            off = ", ".join(f"{1e6 * one:.1f}" for one in bad.off)
            lines.append(f"named: row {bad.row} (line {bad.line}) is a bad reading, off by ({off}) um; it was left out")
    elif found.verdict == "ambiguous":
        names = ", ".join(f"{cause.label} {cause.probability:.2f}" for cause in found.alternatives[:8])
        lines.append(f"ambiguous: these data cannot tell apart: {names}")
        if found.withdrawn:
            lines.append(f"withdrawn: {', '.join(found.withdrawn)} does not predict poses that were not fitted")
        if found.matters is not None:
            lines.append(f"for a correction the choice makes {1e6 * found.matters:.1f} um RMS under the measured loads")
    else:
        lines.append("unknown: something is wrong that no cause in the dictionary explains")
        lines += [f"  seen: {pattern}" for pattern in found.patterns[:4]]
    lines.append(f"the plain model leaves {before:.2f} um RMS, the noise allows {allowed:.2f} um "
                 f"(p = {found.detection.p_value:.3g}, resolution {found.detection.resolution:.2g})")
    if found.law_differs:
        lines.append("  it explains nearly all of the misfit, but not to the noise: the real law differs a little from the "
                     "dictionary's")
    for part, factor in (found.scatter or {}).items():
        lines.append(f"  the data need {factor:.1f} times the stated {part}")
    if found.gain is not None:
        gain = found.gain
        low, high = gain.interval
        lines.append(f"gain on rows that were not fitted ({gain.held_out}): {1e6 * gain.before:.2f} -> "
                     f"{1e6 * gain.after:.2f} um RMS, ratio {gain.ratio:.2f} ({low:.2f} ... {high:.2f})")
    for load in found.next_loads:
        angles = ", ".join(f"{angle:.1f}" for angle in np.degrees(load.theta))
        lines.append(f"next: load cycle along base {'xyz'[load.axis]} up to {np.abs(load.forces).max():.0f} N at joints "
                     f"({angles}) deg separates {load.separates[0]} from {load.separates[1]} by {load.distance:.1f} sigma")
    checks = [next_words(item) for item in next_measurements(found) if item["kind"] == "check"]
    lines += [f"next: check {what} ({about})" for what, about in checks[:MOST_CHECKS]]
    return lines


def value(item: dict[str, Any]) -> str:
    """A parameter with its uncertainty and unit."""
    estimate, std = item["estimate"], item["std"]
    if not std:
        return str(estimate)
    unit = item.get("unit", "1")
    return f"{estimate:.3g} +- {std:.2g}" + ("" if unit == "1" else f" {unit}")


def diagnosis_findings(cell: Cell, measurements: Measurements, found: Diagnosis) -> tuple[Finding, ...]:
    """What a user must know beside the answer."""
    source = measurements.source
    findings = list(measurements.findings)
    if found.verdict == "unknown":
        findings.append(Finding("CS1401", "warning", "something is wrong that no cause in the dictionary explains: "
                                + ("; ".join(found.patterns[:2]) or "the readings scatter more than the stated noise"),
                                file=source, hint="no effect is carried into the model; look at the residuals in the report"))
    if found.verdict == "ambiguous":
        findings.append(Finding("CS1402", "warning", "the data cannot tell several causes apart: "
                                + ", ".join(cause.label for cause in found.alternatives[:6]), file=source,
                                hint="measure the loads named under next_measurements, or do the checks named there"))
    for bad in found.bad_rows:
        largest = 1e6 * float(np.nanmax(np.abs(bad.off)))
        findings.append(Finding("CS1407", "warning", f"row {bad.row} is a bad reading, {largest:.1f} um off; it was left out",
                                file=source, line=bad.line, hint="measure it again"))
    if found.thinning is not None:
        thin = found.thinning
        findings.append(Finding("CS1408", "note", f"{thin.rows} rows of machined passes were averaged over {thin.blocks} "
                                f"blocks: neighbouring rows share their noise over {thin.memory:.1f} rows, so they are worth "
                                f"about {thin.rows / thin.memory:.0f} independent ones", file=source))
    for part, factor in (found.scatter or {}).items():
        findings.append(Finding("CS1403", "warning", f"the data need {factor:.1f} times the {part} that cell.yaml states",
                                file=source, hint="state the noise as it is, or look for what scatters"))
    if cell.robot.link_mass is None:
        findings.append(Finding("CS1404", "note", "the robot file has no links: gravity torques are taken as zero, so backlash "
                                "and soft zones of joints 2 and 3 are judged as if gravity did not load their gears",
                                file=str(cell.robot.source), hint="add links (mass and centre) to a robot file of your own"))
    for name, why in (found.left_out or {}).items():
        if name in effects() and why != "it shows only in logs taken in motion":
            findings.append(Finding("CS1405", "note", f"{name} was not looked for: {why}", file=source))
    if found.verdict == "adequate":
        findings.append(Finding("CS1406", "note", "a wrong scale of the force sensor (force_gain) can never be seen in "
                                "deflections alone: it is the same as all stiffnesses changed together", file=source,
                                hint=effects()["force_gain"].settles))
    return tuple(findings)
