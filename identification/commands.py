"""The commands of commissioning: `robots`, `identify`, `diagnose`, `explain`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from identification.console import READABLE, WRITABLE, Outcome, Session, command

if TYPE_CHECKING:
    from identification.fit import Fit
    from identification.priors import PriorKind


@command("robots")
def robots(session: Session) -> Outcome:
    """List the built-in robots."""
    import numpy as np

    from identification.model.robot import built_in_robots, read_robot

    listed, lines = [], [f"{'name':<22}{'reach':>9}  {'springs':<8}{'prior k1 ... k6 [1e6 N m/rad]'}"]
    for name, path in built_in_robots().items():
        robot = read_robot(path)
        reach = robot.a[1] + robot.a[2] + float(np.hypot(robot.a[3], robot.d[3]))
        prior = robot.prior.stiffness
        listed.append({"name": name, "manufacturer": robot.manufacturer, "load_path": robot.load_path,
                       "reach_mm": 1e3 * reach, "stiffness_nm_per_rad": prior.tolist(), "file": str(path)})
        lines.append(f"{name:<22}{1e3 * reach:>6.0f} mm  {robot.load_path:<8}" + "  ".join(f"{k / 1e6:.2f}" for k in prior))
    return Outcome({"robots": listed}, lines=lines,
                   next_step="write cell.yaml (robot, tool), then compstiff identify cell.yaml measurements.csv")


@command("identify", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("measurements_file", metavar="MEASUREMENTS", type=READABLE)
@click.option("-o", "--output", required=True, type=WRITABLE, help="The stiffness file to write.")
@click.option("--prior", "prior_kind", type=click.Choice(["lognormal", "gaussian"]), default="lognormal", show_default=True,
              help="Shape of the prior; gaussian in k is the paper's.")
@click.option("--gamma", type=click.FloatRange(min=0, min_open=True), default=1.0, show_default=True,
              help="Weight of the Gaussian prior (paper, eq. 11).")
@click.option("--profile", is_flag=True, help="Also compute each stiffness's profile likelihood (in --json and the report).")
@click.option("--also", multiple=True, type=READABLE, help="A further joint deflection log; may be given several times.")
@click.option("--report", type=WRITABLE, help="Also write an HTML report.")
def identify(
    session: Session, cell_file: Path, measurements_file: Path, output: Path, prior_kind: PriorKind, gamma: float,
    profile: bool, also: tuple[Path, ...], report: Path | None,
) -> Outcome:
    """Learn the joint stiffnesses from measured loads and deflections.

    CELL is cell.yaml, MEASUREMENTS a CSV or Parquet file with joint angles, forces and deflections, or a joint deflection
    log.
    """
    import json

    from identification.motion.log_file import is_motion_log

    if is_motion_log(measurements_file):
        from identification.motion.jobs import identify_logs

        if prior_kind != "lognormal" or gamma != 1.0 or profile:
            raise click.UsageError("--prior, --gamma and --profile are for measured TCP deflections, not for logs in motion")
        return identify_logs(session, cell_file, [measurements_file, *also], output, report)
    if also:
        raise click.UsageError(f"--also is for joint deflection logs; {measurements_file} is none")

    from identification.cell import read_cell
    from identification.files import check_writable, write_whole
    from identification.fit import fit_stiffness
    from identification.measurements import read_measurements

    session.inputs += [cell_file, measurements_file]
    check_writable([output, *([report] if report else [])], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    measurements = read_measurements(measurements_file, cell.robot)
    fit = fit_stiffness(cell, measurements, prior_kind=prior_kind, gamma=gamma, with_profiles=profile)
    content = fit.model.as_dict()
    files = {output: (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()}
    if report:
        from identification.fit_report import identification_report

        files[report] = identification_report(cell, measurements, fit).encode()
    write_whole(files)
    return Outcome(content | {"details": fit.details()}, fit.findings, stiffness_lines(fit),
                   next_step=f"compstiff correct {cell_file} PART.mod --stiffness {output} --forces PART.forces.csv "
                   "-o PART_corrected.mod")


def stiffness_lines(fit: Fit) -> list[str]:
    """The fit as a table for the terminal."""
    model = fit.model
    lines = ["joint   stiffness k [N m/rad]   95 % interval                grade"]
    for joint, (k, (low, high), grade) in enumerate(
            zip(model.stiffness, model.interval_95, model.grades, strict=True), start=1):
        digits = 3 if high / low > 1.02 else 4
        interval = f"{low:.{digits}g} ... {high:.{digits}g}"
        lines.append(f"k{joint}      {k:<22.{digits}g}  {interval:<27}  {grade}")
    noise = model.fit["noise"]
    offset = sum(noise["pose_offset_um"]) / 3
    lines.append(f"fit: {model.fit['rows']} rows, residual {model.fit['residual_rms_um']:.2f} um RMS; estimated noise: sensor "
                 f"{noise['sensor_scale']:.2f} x the stated, re-seating {offset:.1f} um a pose")
    lines.append(fit.ellipsoid.words)
    if fit.held_out is not None:
        before, after = fit.held_out
        lines.append(f"validation rows: {1e6 * before:.1f} um RMS with the prior's stiffnesses, {1e6 * after:.1f} um with "
                     "the identified")
    return lines


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
@click.option("--validate", type=READABLE, help="A joint deflection log that is not fitted: the gain is measured on it.")
@click.option("--report", type=WRITABLE, help="Also write an HTML report.")
def diagnose(
    session: Session, cell_file: Path, measurements_file: Path | None, output: Path | None, plan: Path | None,
    extended: Path | None, alarm: float, replicates: int, validate: Path | None, report: Path | None,
) -> Outcome:
    """Show what the model gets wrong, name the cause, measure the gain.

    CELL is cell.yaml, MEASUREMENTS a CSV or Parquet file with joint angles, forces and deflections, or a joint deflection
    log.
    """
    if plan is not None:
        if measurements_file is not None or extended is not None or report is not None:
            raise click.UsageError("--plan stands in place of MEASUREMENTS, and writes neither --extended nor --report")
        return _judge_plan(session, cell_file, plan, output)
    if measurements_file is None or output is None:
        raise click.UsageError("give MEASUREMENTS and -o DIAGNOSIS, or --plan FILE")
    import json

    from identification.motion.log_file import is_motion_log

    if is_motion_log(measurements_file):
        from identification.motion.jobs import diagnose_log

        return diagnose_log(session, cell_file, measurements_file, validate, output, extended=extended, alarm=alarm,
                            replicates=replicates, report=report)
    if validate is not None:
        raise click.UsageError("--validate is for joint deflection logs; elsewhere rows with purpose validate are held out")

    from identification.cell import read_cell
    from identification.diagnosis.procedure import diagnose
    from identification.diagnosis.record import diagnosis_findings, record, summary
    from identification.files import check_writable, write_whole
    from identification.measurements import read_measurements

    session.inputs += [cell_file, measurements_file]
    optional = [path for path in (extended, report) if path]
    check_writable([output, *optional], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    measurements = read_measurements(measurements_file, cell.robot)
    found = diagnose(cell, measurements, alarm=alarm, replicates=replicates)
    content = record(cell, measurements, found)
    findings = diagnosis_findings(cell, measurements, found)
    files = {output: (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()}
    if extended:
        from identification.diagnosis.extended import extended_model

        model = extended_model(cell, found).as_dict()
        files[extended] = (json.dumps(model, indent=1, allow_nan=False) + "\n").encode()
        if not model["effects"]:
            session.say(f"{extended} is the model of six springs: no effect of the robot is named")
    if report:
        from identification.diagnosis.pages import diagnosis_report

        files[report] = diagnosis_report(cell, measurements, found, findings).encode()
    write_whole(files)
    following = (f"compstiff correct {cell_file} PART.mod --stiffness {extended} --forces PART.forces.csv "
                 "-o PART_corrected.mod") if extended else ""
    return Outcome(content, findings, summary(cell, found), next_step=following or _next_after(found.verdict, cell_file,
                                                                                          measurements_file, output))


def _judge_plan(session: Session, cell_file: Path, plan: Path, output: Path | None) -> Outcome:
    """What a plan could and could not tell apart."""
    import json

    from identification.cell import read_cell
    from identification.diagnosis.plan import outlook, plan_lines
    from identification.files import check_writable, write_whole
    from identification.measurements import read_measurements

    session.inputs += [cell_file, plan]
    check_writable([output] if output else [], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    rows = read_measurements(plan, cell.robot, planned=True)
    found, left_out = outlook(cell, rows.select(~rows.validate))
    content = {"format": "compstiff-diagnosis-plan", "version": 1, "effects": [one.as_dict() for one in found],
               "not_offered": left_out}
    if output:
        write_whole({output: (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()})
    return Outcome(content, rows.findings, plan_lines(found, left_out),
                   next_step=f"measure it, then compstiff diagnose {cell_file} {plan} -o diagnosis.json")


def _next_after(verdict: str, cell_file: Path, measurements_file: Path, output: Path) -> str:
    """What a user would do after this verdict."""
    if verdict == "named":
        return f"compstiff diagnose {cell_file} {measurements_file} -o {output} --extended stiffness.json --force"
    if verdict == "adequate":
        return f"compstiff identify {cell_file} {measurements_file} -o stiffness.json"
    if verdict == "ambiguous":
        return (f"compstiff design {cell_file} --add 3 {measurements_file} --diagnosis {output} -o more.csv, which plans "
                "loads that tell them apart; measure them, add the rows, then diagnose again")
    return f"do what the lines with next: say (next_measurements in {output}), add the rows, then diagnose again"


@command("explain")
@click.argument("code", metavar="[CODE]", required=False)
def explain(session: Session, code: str | None) -> Outcome:
    """Explain a finding: its cause, its effect, what to do; without CODE, list them."""
    from identification.catalogue import catalogue, explain_code

    if code is None:
        titles = {name: page["title"] for name, page in catalogue().items()}
        return Outcome({"codes": titles}, lines=[f"{name}  {title}" for name, title in titles.items()])
    page = explain_code(code)
    lines = [f"{page['code']}: {page['title']}", "", f"cause:  {page['cause']}", f"effect: {page['effect']}",
             f"remedy: {page['remedy']}"]
    return Outcome(dict(page), lines=lines)


@command("convert", writes=True)
@click.argument("log", metavar="LOG", type=READABLE)
@click.option("--form", required=True, type=click.Choice(["kuka-kr300", "metallicadour", "lvm", "net-ft"]),
              help="What LOG is.")
@click.option("-o", "--output", required=True, type=WRITABLE, help="The CSV or Parquet file to write.")
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), help="Samples a second (metallicadour, net-ft).")
@click.option("--channels", default="Fx,Fy,Fz,Mx,My,Mz", show_default=True, help="Force, then moment channels (lvm).")
@click.option("--counts-per-force", type=click.FloatRange(min=0, min_open=True), default=1e6, show_default=True,
              help="Of the sensor (net-ft).")
@click.option("--counts-per-torque", type=click.FloatRange(min=0, min_open=True), default=1e6, show_default=True,
              help="Of the sensor (net-ft).")
def convert(
    session: Session, log: Path, form: str, output: Path, rate: float | None, channels: str, counts_per_force: float,
    counts_per_torque: float,
) -> Outcome:
    """Turn a public or a sensor's own log into columns that the other commands read."""
    from identification.public.convert import convert_log

    session.inputs.append(log)
    return convert_log(log, form, output, rate, tuple(name.strip() for name in channels.split(",")),
                       (counts_per_force, counts_per_torque), overwrite=session.overwrite)


COMMANDS = (robots, identify, diagnose, convert, explain)
