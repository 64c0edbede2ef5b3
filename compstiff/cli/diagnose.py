"""`compstiff diagnose`: what the model gets wrong, and why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import DONE, REFUSED, Outcome, Session, call
from identification.common.findings import CompstiffError, Finding

# Verdicts whose extended model a program may be corrected with.
USABLE = ("adequate", "named")


@command("diagnose", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("measurements_file", metavar="[MEASUREMENTS]", required=False, type=READABLE)
@click.option("-o", "--output", type=WRITABLE, help="The diagnosis file to write; required with MEASUREMENTS.")
@click.option("--plan", type=READABLE, help="A plan in place of measurements: what it could and could not tell apart.")
@click.option("--extended", type=WRITABLE, help="Also write the extended model, a stiffness file that correct uses.")
@click.option("--alarm", type=click.FloatRange(0.001, 0.5), default=0.05, show_default=True,
              help="Rate of false alarms, over the whole dictionary.")
@click.option("--replicates", type=click.IntRange(19, 9999), default=199, show_default=True,
              help="Simulated data sets behind the p-value; its resolution is 1 / (replicates + 1).")
@click.option("--also", multiple=True, type=READABLE, help="A further joint deflection log of the same robot; may be given "
              "several times. All are fitted, and each is predicted from the others.")
@click.option("--validate", type=READABLE, help="A joint deflection log that is not fitted: the gain is measured on it.")
@click.option("--mend", type=WRITABLE, metavar="OUT", help="Where a mistake is found in MEASUREMENTS or in CELL, also "
              "write that file without it: OUT.csv or OUT.yaml.")
@click.option("--report", type=WRITABLE, help="Also write an HTML report.")
def diagnose(
    session: Session, cell_file: Path, measurements_file: Path | None, output: Path | None, plan: Path | None,
    extended: Path | None, alarm: float, replicates: int, also: tuple[Path, ...], validate: Path | None,
    mend: Path | None, report: Path | None,
) -> Outcome:
    """Show what the model gets wrong, name the cause, measure the gain.

    CELL is cell.yaml, MEASUREMENTS a CSV or Parquet file with joint angles, forces and deflections, or a joint deflection
    log.
    """
    if plan is not None:
        if measurements_file is not None or extended is not None or report is not None or mend is not None:
            raise click.UsageError("--plan stands in place of MEASUREMENTS, and writes neither --extended, --mend nor --report")
        return _judge_plan(session, cell_file, plan, output)
    if measurements_file is None or output is None:
        raise click.UsageError("give MEASUREMENTS and -o DIAGNOSIS, or --plan FILE")

    from identification.motion.log_file import is_motion_log

    if is_motion_log(measurements_file):
        if mend is not None:
            raise click.UsageError("--mend is for load tests, not for joint deflection logs")
        return _diagnose_logs(session, cell_file, [measurements_file, *also], validate, output, extended=extended,
                              alarm=alarm, replicates=replicates, report=report)
    if also:
        raise click.UsageError(f"--also is for joint deflection logs; {measurements_file} is none")
    if validate is not None:
        raise click.UsageError("--validate is for joint deflection logs; elsewhere rows with purpose validate are held out")

    from compstiff import Unfitted, diagnose, read_cell, read_measurements
    from identification.common.files import check_distinct, check_writable, json_bytes, write_whole
    from identification.common.quantities import cause_words
    from identification.model.controller import use_of_stiffnesses

    session.inputs += [cell_file, measurements_file]
    optional = [path for path in (extended, report) if path]
    mended_as = [mend.with_suffix(suffix) for suffix in (".csv", ".yaml")] if mend else []
    check_distinct(session.inputs, [output, *optional, *mended_as])
    check_writable([output, *optional, *mended_as], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    measurements = read_measurements(measurements_file, cell)
    try:
        diagnosis = diagnose(cell, measurements, alarm=alarm, replicates=replicates)
    except Unfitted as stopped:
        if mend is None:
            raise
        without = stopped.mended()
        write_whole({without.beside(mend): without.content}, overwrite=session.overwrite, read=session.read)
        raise CompstiffError(replace(stopped.findings[0], hint=f"check: {stopped.check}; {without.said(mend)}, to be diagnosed "
                                     "again; no other file was written")) from None
    content = diagnosis.as_dict()
    files = {output: json_bytes(content)}
    refused = []
    mended = diagnosis.mended() if mend else None
    if mend:
        if mended is None:
            refused.append(Finding(
                "CS1703", "warning", "no mistake is named, so that there is nothing to mend: "
                f"{mend} was not written{_earlier(mended_as)}", file=str(measurements_file)))
        else:
            files[mended.beside(mend)] = mended.content
            session.say(f"{mended.said(mend)}: {diagnosis.judgement.mistakes[0].sentence}")
    if extended and diagnosis.verdict == "mistake":
        way = (f"diagnose again with {mended.beside(mend)}, which is without it" if mended and mend
               else "--mend writes the file without the mistake")
        refused.append(Finding(
            "CS1704", "warning", f"a model of rows with a mistake is none: {extended} was not written{_earlier([extended])}",
            file=str(measurements_file), hint=way))
    elif extended:
        model = diagnosis.extended()
        files[extended] = json_bytes(model.as_dict())
        refuses = f"; correct refuses it ({model.rejected})" if model.rejected else ""
        if diagnosis.verdict == "ambiguous" and diagnosis.judgement.carried is not None:
            carried = cause_words(model.effects[0].label) if model.effects else "six springs alone"
            session.say(f"{extended} carries the likeliest of these causes, {carried}; what the others would change is in its "
                        f"covariance{refuses}")
        elif not model.effects:
            session.say(f"{extended} is the model of six springs: no effect of the robot is named{refuses}")
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(diagnosis, extended=extended if extended in files else None).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    as_good_as = "named" if diagnosis.judgement.choice_is_small else diagnosis.verdict
    following = _next_after(as_good_as, cell_file, measurements_file, output, diagnosis.measurements.weights)
    again = call("diagnose", cell_file, measurements_file, "-o", output, "--force")
    if diagnosis.verdict == "named" and diagnosis.judgement.unsettled:
        following = f"warm the robot up, measure again, then {again}"
    elif diagnosis.verdict == "ambiguous" and not diagnosis.judgement.loads_settle:
        following = f"do the checks above, mend the file if it is one, then {again}"
    elif extended in files and as_good_as in USABLE:
        following = use_of_stiffnesses(diagnosis.cell.robot, cell_file, extended)
    return Outcome(content, (*diagnosis.findings, *refused), diagnosis.lines(), next_step=following,
                   exit_code=REFUSED if refused else DONE)


def _earlier(files: list[Path]) -> str:
    """That one of these files is there all the same, of another call, in words."""
    there = [file for file in files if file.exists()]
    return f"; the {there[0].name} that stands there is of an earlier call" if there else ""


def _diagnose_logs(
    session: Session, cell_file: Path, log_files: list[Path], validate: Path | None, output: Path, *, extended: Path | None,
    alarm: float, replicates: int, report: Path | None,
) -> Outcome:
    """What the plain springs get wrong in logs, its cause, and the gain where it was not fitted."""
    from compstiff import diagnose_joint_logs, read_cell, read_motion_log
    from identification.common.files import check_writable, json_bytes, write_whole

    session.inputs += [cell_file, *log_files, *([validate] if validate else [])]
    check_writable([output, *(file for file in (extended, report) if file)], overwrite=session.overwrite)
    cell = read_cell(cell_file, geometry=False)
    diagnosis = diagnose_joint_logs(cell, [read_motion_log(file) for file in log_files],
                                    read_motion_log(validate) if validate else None, alarm=alarm, replicates=replicates)
    content = diagnosis.as_dict()
    files = {output: json_bytes(content)}
    if extended:
        files[extended] = json_bytes(diagnosis.extended().as_dict())
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(diagnosis).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    return Outcome(content, diagnosis.findings, diagnosis.lines(),
                   next_step=call("identify", cell_file, log_files[0], *(
                       word for file in log_files[1:] for word in ("--also", file)), "-o", "stiffness.json"))


def _judge_plan(session: Session, cell_file: Path, plan: Path, output: Path | None) -> Outcome:
    """What a plan could and could not tell apart."""

    from compstiff import judge_plan, read_cell, read_measurements
    from identification.common.files import check_writable, json_bytes, write_whole

    session.inputs += [cell_file, plan]
    check_writable([output] if output else [], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    outlook = judge_plan(cell, read_measurements(plan, cell, planned=True))
    content = outlook.as_dict()
    if output:
        write_whole({output: json_bytes(content)}, overwrite=session.overwrite, read=session.read)
    return Outcome(content, outlook.findings, outlook.lines(),
                   next_step=f"measure it, then {call('diagnose', cell_file, plan, '-o', 'diagnosis.json')}")


def _next_after(verdict: str, cell_file: Path, measurements_file: Path, output: Path, weights: tuple[str, ...]) -> str:
    """What a user would do after this verdict; weights: options of `design` that plan for the weights that were measured
    with."""
    if verdict == "named":
        return call("diagnose", cell_file, measurements_file, "-o", output, "--extended", "stiffness_extended.json",
                    "--force")
    if verdict == "mistake":
        mended = call("diagnose", cell_file, measurements_file, "-o", output, "--mend", "MENDED", "--force")
        return f"do the checks above; {mended} writes the file without the mistake, to be diagnosed again"
    if verdict == "adequate":
        return call("identify", cell_file, measurements_file, "-o", "stiffness.json")
    if verdict == "ambiguous":
        more = call("design", cell_file, "--add", 3, measurements_file, "--diagnosis", output, *weights, "-o", "more.csv")
        return f"{more}, which plans loads that tell them apart; measure them, add the rows, then diagnose again"
    more = call("design", cell_file, "--add", 3, measurements_file, "--criterion", "C", *weights, "-o", "more.csv")
    return f"do the checks above; if they find nothing, {more} plans loads that tell more causes apart"
