"""What a user does after a diagnosis, as sentences with commands to copy."""

from __future__ import annotations

from pathlib import Path

from identification.common.command_line import call
from identification.common.report import Step
from identification.diagnosis.diagnose import Diagnosis
from identification.diagnosis.in_words import MOST_CHECKS
from identification.diagnosis.record import checks_of, next_measurements
from identification.model.controller import runs_rapid, use_of_stiffnesses

# The name of the stiffness file where none was written yet.
EXTENDED = "stiffness_extended.json"


def steps_of(diagnosis: Diagnosis, extended: Path | None = None) -> list[Step]:
    """By the verdict, the first thing first. extended: the stiffness file that was written of it; None: none was."""
    cell, source, verdict = diagnosis.cell.source, diagnosis.measurements.source, diagnosis.verdict
    again, weights = ("diagnose", cell, source, "-o", "diagnosis.json"), diagnosis.measurements.weights
    more = call("design", cell, "--add", 3, source, "--criterion", "C", *weights, "-o", "more.csv")
    listed = next_measurements(diagnosis.judgement)
    checks = [Step(f"Check: {what} ({about}).") for what, about in checks_of(listed)[:MOST_CHECKS]]
    robot = diagnosis.cell.robot
    corrected = use_of_stiffnesses(robot, cell, extended or EXTENDED, report=True)
    use_it = "correct a program" if runs_rapid(robot) else "predict a path"
    if verdict == "adequate":
        use = Step(f"{use_it[0].upper()}{use_it[1:]} with the six springs:", corrected) if extended else Step(
            "Use the six springs:", call("identify", cell, source, "-o", "stiffness.json", "--report", "identify.html"))
        further = Step("To look for what these rows would not have shown, plan further runs; measure them, add the rows, "
                       "diagnose again:", more)
        return [use, further] if diagnosis.judgement.overlooked else [use]
    if verdict == "mistake":
        return [*checks[:1], Step("Write the file without the mistake, then diagnose it again:",
                                  call(*again, "--mend", "MENDED", "--force"))]
    written = call(*again, "--extended", EXTENDED, "--force")
    if verdict == "ambiguous":
        doing = use_it.split()[0]
        use_now = f"{doing.capitalize()} now" if diagnosis.judgement.choice_is_small else f"Or {doing} now"
        likeliest = "has the likeliest of them, and what the others would change in its sigmas"
        now = [] if diagnosis.judgement.carried is None or diagnosis.judgement.unsettled else [
            Step(f"{use_now} with {extended.name}, which {likeliest}:", corrected)] if extended else [
            Step(f"{use_now}: write the file that {likeliest}:", written),
            Step(f"Then {use_it} with it:", corrected)]
        if not diagnosis.judgement.loads_settle:
            return [*checks, Step("Mend the file, if it is one, then diagnose again:", call(*again, "--force"))]
        # The loads are what the command plans.
        planned = call("design", cell, "--add", 3, source, "--diagnosis", "diagnosis.json", *weights, "-o", "more.csv")
        if diagnosis.judgement.choice_is_small:
            return [*now, Step("Only to know which it is: plan loads that tell them apart, measure them, add the rows, "
                               "diagnose again:", planned), *checks]
        return [Step("Plan loads that tell them apart; measure them, add the rows, diagnose again:", planned), *checks, *now]
    if verdict == "unknown":
        first = checks or [Step("Look at the residuals below: a pose, an axis or a time that stands out says where to look.")]
        return [*first, Step("If that does not settle it: plan loads that tell more causes apart, measure them, add the rows "
                             "and diagnose again. Correct nothing with these stiffnesses until then:",
                             more)]
    left_out, count = diagnosis.judgement.dropped
    repeat = [Step(f"Measure again: {left_out}. What comes back is no slip.")] if count else []
    if diagnosis.judgement.unsettled:
        return [*repeat, Step("The springs changed while they were measured: correct refuses them. Warm the robot up and "
                              "measure again, the first pose once more at the end; then:", call(*again, "--force")), *checks]
    of_robot = any(term.effect.of_robot for term in diagnosis.judgement.extended.terms)
    if extended:
        why = "it carries what the robot does" if of_robot else "the cause is in the measurement, and taken out of the data"
        return [*repeat, Step(f"{use_it[0].upper()}{use_it[1:]} with {extended.name}: {why}.", corrected), *checks]
    return [*repeat, Step("Write the stiffness file that carries what the robot does:" if of_robot else
                 "It is the measurement, not the robot: it is taken out of the data. Write the stiffness file without it:",
                 written), Step(f"Then {use_it} with it:", corrected), *checks]
