"""What `design` has to say: as JSON values, for the terminal, and at the head of the files it writes."""

from __future__ import annotations

from typing import Any

import numpy as np

from identification.design.forecast import Forecast
from identification.design.procedure import Design
from identification.design.request import Prepared
from identification.design.sheet import Sheet

CRITERIA = {"D": "the volume of the confidence ellipsoid of ln k", "A": "the mean variance of ln k",
            "A in raw k": "the mean variance of k, as published", "E": "the longest axis of the confidence ellipsoid of ln k",
            "I": "the mean variance of the deflection predicted along the program"}


def spread(log_std: float) -> str:
    """1 sigma of ln k in words: a percentage while that is one."""
    return f"to {100 * log_std:.2g} %" if log_std < 0.3 else f"within a factor {np.exp(log_std):.2g}"


def prediction_std_um(prepared: Prepared, found: Design) -> tuple[float, float] | None:
    """RMS uncertainty [um] of the deflection predicted along the program before and after the plan, None without a program."""
    if prepared.weight is None:
        return None
    before = np.linalg.inv(prepared.task.prior)
    first, last = (float(1e6 * np.sqrt(np.sum(prepared.weight * c))) for c in (before, found.covariance))
    return first, last


def record(prepared: Prepared, found: Design, rows: Sheet, expected: Forecast, seed: int) -> dict[str, Any]:
    """The result as JSON values."""
    certificate = found.certificate
    prediction = prediction_std_um(prepared, found)
    return {
        "format": "compstiff-design", "version": 1, "criterion": found.task.criterion.name, "seed": seed,
        "measurements": len(found.task.demand), "replicates": found.task.replicates, "rows": len(rows.visit),
        "place": prepared.place, "before": prepared.before,
        "certificate": {
            "efficiency": certificate.efficiency, "words": certificate.words, "value": certificate.value,
            "bound": certificate.bound, "gap": certificate.gap, "starts": certificate.starts, "rounds": certificate.rounds,
            "pool_only_claim": certificate.pool_efficiency},
        "search": {"tried": found.tried, "ended_infeasible": found.failed, "pool": len(found.pool),
                   "sampled_pool_exchange_efficiency": found.single / certificate.bound},
        "prediction_std_um": None if prediction is None else {"before": prediction[0], "after": prediction[1]},
        "forecast": expected.as_dict(),
        "visits": [{"pose": rows.label[i], "loads_along": rows.axes[i], "q_deg": np.degrees(rows.theta[i]).tolist()}
                   for i in range(len(rows.label))],
    }


def comments(prepared: Prepared, found: Design) -> list[str]:
    """The head of the written files."""
    return [
        f"Measurement plan by compstiff design, {len(found.task.demand)} runs, criterion {found.task.criterion.name}; "
        f"{prepared.place}",
        found.certificate.words,
        "Deflection: loaded minus unloaded TCP, base frame. Fill in dx_um dy_um dz_um of every row, the zero readings too,",
        "with the sensors set to zero anew at each pose, and put the true times in time_s; planned ones stand there.",
    ]


def summary(prepared: Prepared, found: Design, rows: Sheet, expected: Forecast) -> list[str]:
    """The plan for the terminal."""
    task, certificate = found.task, found.certificate
    lines = [f"{'pose':<7}{'loads':<7}{'joints [deg]'}"]
    for label, axes, theta in zip(rows.label, rows.axes, np.degrees(rows.theta), strict=True):
        lines.append(f"{label:<7}{axes:<7}" + " ".join(f"{angle:8.2f}" for angle in theta))
    minutes = rows.time[-1] / 60
    lines += [
        f"{len(rows.label)} poses, {len(rows.visit)} rows, about {minutes:.0f} min; {prepared.place}",
        f"criterion {task.criterion.name}: {CRITERIA[task.criterion.name]}",
        certificate.words,
        f"expected, starting from {prepared.before}:",
    ]
    for one in expected.joints:
        trade = f", trades off with k{one.partner} ({one.correlation:+.2f})" if one.partner else ""
        lines.append(f"k{one.joint}  known {spread(one.after)} (1 sigma; before {spread(one.before)}), {one.grade}{trade}")
    prediction = prediction_std_um(prepared, found)
    if prediction is not None:
        lines.append(f"deflection along the program (per 100 N where no force log was given): uncertain by "
                     f"{prediction[1]:.2g} um RMS, before {prediction[0]:.3g} um")
    counts = expected.counts
    lines.append(f"of {len(expected.causes)} possible causes at their typical size this plan names {counts['identifiable']}, "
                 f"only notices {counts['detectable']} and misses {counts['invisible']} (compstiff diagnose --plan lists them)")
    if expected.runs:
        lines.append("largest uncertainty of a stiffness by runs: " + ", ".join(
            f"{n} {spread(std)}" for n, std in zip(expected.runs, expected.stds, strict=True)))
    return lines
