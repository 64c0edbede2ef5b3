"""What `design` has to say: as JSON values, for the terminal, and at the head of the files it writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from identification.design.comparison import Comparison
from identification.design.discrimination import Settled
from identification.design.forecast import Forecast
from identification.design.loads import FREE
from identification.design.procedure import Design
from identification.design.request import Prepared
from identification.design.sheet import Sheet
from identification.diagnosis.plan import not_told_apart

CRITERIA = {"D": "the volume of the confidence ellipsoid of ln k", "A": "the mean variance of ln k",
            "A in raw k": "the mean variance of k, as published", "E": "the longest axis of the confidence ellipsoid of ln k",
            "I": "the mean variance of the deflection predicted along the program"}


def spread(log_std: float) -> str:
    """1 sigma of ln k in words: a percentage while that is one."""
    return f"to {100 * log_std:.2g} %" if log_std < 0.3 else f"within a factor {np.exp(log_std):.2g}"


@dataclass(frozen=True, eq=False)
class Plan:
    """All that there is to say of a plan: the task, what was found, its rows and what they will tell; settled: which rival
    causes they are to tell apart, gain: over plainer loads, None where that was not asked for; further: rows were measured
    before, and what it will tell is said of them together."""

    prepared: Prepared
    found: Design
    rows: Sheet
    expected: Forecast
    settled: Settled | None = None
    gain: Comparison | None = None
    further: bool = False


def prediction_std_um(prepared: Prepared, found: Design) -> tuple[float, float] | None:
    """RMS uncertainty [um] of the deflection predicted along the program before and after the plan, None without a program."""
    if prepared.weight is None:
        return None
    before = np.linalg.inv(prepared.task.prior)
    first, last = (float(1e6 * np.sqrt(np.sum(prepared.weight * c))) for c in (before, found.covariance))
    return first, last


def record(plan: Plan, seed: int) -> dict[str, Any]:
    """The result as JSON values."""
    prepared, found, rows = plan.prepared, plan.found, plan.rows
    certificate = found.certificate
    prediction = prediction_std_um(prepared, found)
    return {
        "format": "compstiff-design", "version": 1, "criterion": found.task.criterion.name, "seed": seed,
        "measurements": len(found.task.demand), "replicates": found.task.replicates, "rows": len(rows.visit),
        "place": prepared.place, "before": prepared.before,
        "certificate": {
            "efficiency": certificate.efficiency, "words": certificate.words, "value": certificate.value,
            "bound": certificate.bound, "gap": certificate.gap, "starts": certificate.starts, "rounds": certificate.rounds,
            "relaxed_bound": certificate.relaxed, "splits": certificate.splits,
            "pool_only_claim": certificate.pool_efficiency},
        "search": {"tried": found.tried, "ended_infeasible": found.failed, "ended_as_good": found.same, "pool": len(found.pool),
                   "sampled_pool_exchange_efficiency": found.single / certificate.bound},
        "prediction_std_um": None if prediction is None else {"before": prediction[0], "after": prediction[1]},
        "settles": None if plan.settled is None else plan.settled.as_dict(),
        "gain": None if plan.gain is None else plan.gain.as_dict(),
        "forecast": plan.expected.as_dict(),
        "visits": [{"pose": rows.label[i], "loads_along": rows.axes[i], "q_deg": np.degrees(rows.theta[i]).tolist(),
                    "purpose": "validate" if rows.validate[i] else "identify"} for i in range(len(rows.label))],
    }


def certified(plan: Plan) -> str:
    """The certificate in words; of runs that settle a diagnosis it judges what they were not chosen for."""
    words = plan.found.certificate.words
    if plan.settled is None:
        return words
    return f"by criterion {plan.found.task.criterion.name} alone, for which they were not chosen, the runs are {words}"


def comments(plan: Plan) -> list[str]:
    """The head of the written files."""
    found = plan.found
    kept = int(plan.rows.validate.sum())
    lines = [
        f"Measurement plan by compstiff design, {len(found.task.demand)} runs"
        + (f" and {kept} that are never fitted (purpose validate)" if kept else "")
        + f", criterion {found.task.criterion.name}; {plan.prepared.place}",
        certified(plan),
        "Deflection: loaded minus unloaded TCP, base frame. Fill in dx_um dy_um dz_um of every row, the zero readings too,",
        "with the sensors set to zero anew at each pose, and put the true times in time_s; planned ones stand there.",
        "Collisions were not checked: drive the poses in manual mode first.",
    ]
    if plan.settled is not None:
        lines += ["Append the rows to what was measured before, then diagnose again.", *plan.settled.lines]
    return lines


def summary(plan: Plan) -> list[str]:
    """The plan for the terminal."""
    rows = plan.rows
    lines = [f"{'pose':<7}{'loads':<22}{'joints [deg]'}"]
    for number, (label, theta) in enumerate(zip(rows.label, np.degrees(rows.theta), strict=True)):
        lines.append(f"{label:<7}{along(rows, number):<22}" + " ".join(f"{angle:8.2f}" for angle in theta))
    return lines + worth(plan)


def along(rows: Sheet, visit: int) -> str:
    """What a visit is loaded along: its base axes, or the direction of its own."""
    if rows.axes[visit] != FREE:
        return rows.axes[visit]
    forces = rows.force[rows.visit == visit]
    largest = forces[np.argmax(np.linalg.norm(forces, axis=1))]
    return "({:+.2f} {:+.2f} {:+.2f})".format(*(largest / np.linalg.norm(largest)))


def worth(plan: Plan, joints: bool = True) -> list[str]:
    """What the plan is worth and what it will tell, in words; joints: a line for each, which a table may say as well."""
    found, rows, expected, place = plan.found, plan.rows, plan.expected, plan.prepared.place
    task = found.task
    kept = int(rows.validate.sum())
    lines = [
        f"{len(rows.label)} poses" + (f" ({kept} of them never fitted)" if kept else "")
        + f", {len(rows.visit)} rows, about {rows.time[-1] / 60:.0f} min; {place}"]
    if plan.settled is not None:
        lines += plan.settled.lines
    lines += [f"criterion {task.criterion.name}: {CRITERIA[task.criterion.name]}", certified(plan)]
    if plan.gain is not None:
        lines.append(f"against {plan.gain.against}: criterion {plan.gain.ratio:.2f} times as good, the least known stiffness "
                     f"known {spread(plan.gain.largest)} instead of {spread(plan.gain.other_largest)}")
    if joints:
        lines.append(f"expected, starting from {plan.prepared.before}:")
    for one in expected.joints if joints else ():
        trade = f", trades off with k{one.partner} ({one.correlation:+.2f})" if one.partner else ""
        lines.append(f"k{one.joint}  known {spread(one.after)} (1 sigma; before {spread(one.before)}), {one.grade}{trade}")
    prediction = prediction_std_um(plan.prepared, found)
    if prediction is not None:
        lines.append(f"deflection along the program (per 100 N where no force log was given): uncertain by "
                     f"{prediction[1]:.2g} um RMS, before {prediction[0]:.3g} um")
    counts = expected.counts
    before = ", with what was measured before," if plan.further else ""
    lines.append(f"of {len(expected.causes)} possible causes at their typical size this plan{before} names "
                 f"{counts['identifiable']}, only notices {counts['detectable']} and misses {counts['invisible']} "
                 "(sizes: compstiff diagnose --plan)")
    alike = not_told_apart(expected.causes)
    if alike:
        lines.append("noticed at their typical size but not told apart: " + "; ".join(alike))
    if expected.runs and plan.settled is None:
        lines.append("largest uncertainty of a stiffness by number of runs, each planned for the criterion: " + ", ".join(
            f"{n}: {spread(std).removeprefix('to ').removeprefix('within ')}"
            for n, std in zip(expected.runs, expected.stds, strict=True)))
    return lines
