"""diagnosis.json: the record of a judgement (docs/formats.md#diagnose)."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np

from identification.common.arrays import rms
from identification.common.quantities import cause_words
from identification.diagnosis.discrimination import DOWN
from identification.diagnosis.judgement import Cause, Judgement, Verdict
from identification.fit.bad_visits import ALARM as VISIT_ALARM
from identification.fit.mending import BadVisit
from identification.fit.visit_findings import sentence
from identification.model.gravity import FREE_FALL

FORMAT = "compstiff-diagnosis"
VERDICTS: tuple[str, ...] = get_args(Verdict)


def record(judgement: Judgement) -> dict[str, Any]:
    """The content of diagnosis.json."""
    robot, thinning, difference = judgement.plain.data.cell.robot, judgement.thinning, judgement.robot_difference
    return {
        "format": FORMAT, "version": 1, "robot": robot.name, "load_path": robot.load_path,
        "verdict": judgement.verdict,
        "misfit": {"rms_um": 1e6 * rms(judgement.plain.residual), "expected_rms_um": 1e6 * rms(judgement.expected_std),
                   "p_value": judgement.detection.p_value, "p_resolution": judgement.detection.resolution},
        "causes": [*(cause_content(judgement, cause) for cause in judgement.causes), *map(_bad_visit, judgement.bad_visits),
                   *(bad.as_dict() for bad in judgement.bad_rows),
                   *(scatter.as_dict() for scatter in judgement.scatters if judgement.verdict == "named")],
        "companions": [cause_content(judgement, cause) for cause in judgement.companions],
        "alternatives": [_named(cause) for cause in judgement.alternatives],
        "mistakes": [mistake.as_dict() for mistake in judgement.mistakes],
        "gain": None if judgement.gain is None else judgement.gain.as_dict(),
        "next_measurements": next_measurements(judgement),
        "subset_conflicts": [conflict.as_dict() for conflict in judgement.conflicts],
        "adequacy_p_value": None if judgement.adequacy is None else judgement.adequacy.p_value,
        "patterns": list(judgement.patterns), "noise_beyond_stated": judgement.scatter, "withdrawn": list(judgement.withdrawn),
        "withdrawn_because": judgement.withdrawn, "not_converged": list(judgement.lost),
        "law_differs": judgement.law_differs, "log10_odds_against_nothing": decades_of(judgement),
        "effective_rows": None if thinning is None else thinning.rows / thinning.autocorrelation_time,
        "correction_difference_um": None if difference is None else 1e6 * difference,
        "not_offered": judgement.left_out, "showing": [each.as_dict() for each in judgement.showing],
        "rows_looked_at": len(judgement.rows), "visits": _visits(judgement), "validation": _validation(judgement),
    }


def decades_of(judgement: Judgement) -> float | None:
    """log10 of the odds of what is named against nothing; None where they are not known."""
    odds = judgement.log_odds
    return None if odds is None or not np.isfinite(odds) else odds / float(np.log(10))


def _visits(judgement: Judgement) -> dict[str, Any] | None:
    """The test of the visits, its verdict and the visit that stands out the most."""
    test = judgement.visits
    if test is None or not test.scores:
        return None
    worst = max(test.scores, key=lambda score: score.surprise)
    return {"p_value": test.p_value, "p_resolution": test.resolution, "too_many": test.too_many, "worst": worst.as_dict(),
            "bad": [bad.as_dict() for bad in judgement.bad_visits],
            "suspects": [bad.as_dict() for bad in judgement.suspects]}


def _validation(judgement: Judgement) -> dict[str, Any] | None:
    """The validate rows under the extended model: RMS with and without outliers, and which they are."""
    validation = judgement.validation
    if validation is None:
        return None
    return {"rms_um": 1e6 * validation.rms, "rms_without_outliers_um": 1e6 * validation.rms_without,
            "outlying_rows": [row.row for row in validation.rows],
            "outlying_visits": [bad.as_dict() for bad in validation.visits]}


def _bad_visit(bad: BadVisit) -> dict[str, Any]:
    """A cause of diagnosis.json."""
    return {"effect": "bad_visit", "joint": None, "probability": 1.0 - VISIT_ALARM, "family": "a pose", "of_robot": False,
            "sentence": sentence(bad), "parameters": {"pose": {"estimate": bad.score.name, "std": 0.0}},
            "p_value": bad.score.p_value, "wrong_angle": bad.score.as_dict()["wrong_angle"],
            "mends": [mend.as_dict() for mend in bad.mends]}


def next_measurements(judgement: Judgement) -> list[dict[str, Any]]:
    """Loads, then checks that are no loads, for the names that are left."""
    listed: list[dict[str, Any]] = [load.as_dict() for load in judgement.next_loads]
    listed += [{"kind": "check", "what": mistake.candidate.mistake.settles, "about": mistake.key}
               for mistake in judgement.mistakes]
    if judgement.verdict in ("ambiguous", "unknown"):
        texts = dict.fromkeys(
            (cause.effect.settles, cause.label) for cause in judgement.alternatives if cause.probability >= 0.02)
        listed += [{"kind": "check", "what": text, "about": label} for text, label in texts]
    return listed


def checks_of(items: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """The checks among next measurements: what to do, once, and all that it tells of."""
    about: dict[str, list[str]] = {}
    for item in items:
        if item["kind"] == "check":
            about.setdefault(item["what"], []).append(item["about"])
    return [(what, ", ".join(map(cause_words, names))) for what, names in about.items()]


def next_words(item: dict[str, Any]) -> tuple[str, str]:
    """A load of the next measurements: what to do, and what it tells."""
    angles = ", ".join(f"{angle:.1f}" for angle in item["q_deg"])
    forces = ", ".join(f"{force:.0f}" for force in item["forces_n"])
    load = f"load along base {item['axis']}, {forces} N"
    if item["axis"] == DOWN:
        load = f"hang {', '.join(f'{force / FREE_FALL:.3g}' for force in item['forces_n'])} kg"
    return (f"joints ({angles}) deg: {load}",
            f"{' from '.join(map(cause_words, item['separates']))}, by {item['expected_sigmas']:.1f} sigma")


def _named(cause: Cause) -> dict[str, Any]:
    return {"effect": cause.effect.name, "joint": cause.joint, "probability": cause.probability}


def cause_content(judgement: Judgement, cause: Cause) -> dict[str, Any]:
    """What is written of a cause. Of a law under a weight that nobody stated its values are those of the model that is carried
    on, its law free: one that is not quite the gear's weighs wrongly."""
    model, place = judgement.extended, 6
    if judgement.carried is not None and cause.effect.weighed:
        model = judgement.carried
    for term, fitted in zip(model.terms, model.term_values, strict=True):
        own = slice(place, place + len(term.start))
        if term.label == cause.label:
            spread = np.sqrt(np.diag(model.covariance))
            parameters: dict[str, Any] = {
                parameter.name: {"estimate": float(np.clip(estimate, parameter.low, parameter.high)), "std": float(std),
                                 "unit": parameter.unit}
                for parameter, estimate, std in zip(term.effect.parameters, model.mean[own], spread[own], strict=True)}
            parameters |= {name: {"estimate": value, "std": 0.0} for name, value in term.effect.where.items()}
            moved = term.contribution(model.load_state, fitted)[:, :3]
            return _named(cause) | {"family": cause.effect.family, "of_robot": term.effect.of_robot,
                                    "open_laws": cause.open_laws, "sentence": cause.sentence, "parameters": parameters,
                                    "largest_um": 1e6 * float(np.linalg.norm(moved, axis=1).max())}
        place = own.stop
    raise KeyError(cause.label)
