"""`compstiff identify`: joint stiffnesses from load tests, or from joint deflection logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.outcome import Outcome, Session, call

if TYPE_CHECKING:
    from identification.fit.priors import PriorKind


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
    from identification.motion.log_file import is_motion_log

    if is_motion_log(measurements_file):
        if prior_kind != "lognormal" or gamma != 1.0 or profile:
            raise click.UsageError("--prior, --gamma and --profile are for measured TCP deflections, not for logs in motion")
        return _identify_logs(session, cell_file, [measurements_file, *also], output, report)
    if also:
        raise click.UsageError(f"--also is for joint deflection logs; {measurements_file} is none")

    from compstiff import fit_stiffness, read_cell, read_measurements
    from identification.common.files import check_writable, json_bytes, write_whole

    session.inputs += [cell_file, measurements_file]
    check_writable([output, *([report] if report else [])], overwrite=session.overwrite)
    cell = read_cell(cell_file)
    measurements = read_measurements(measurements_file, cell)
    fit = fit_stiffness(cell, measurements, prior_kind=prior_kind, gamma=gamma, with_profiles=profile)
    files = {output: json_bytes(fit.model.as_dict())}
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(fit).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    # The first step of the report: what is not known well is measured, before springs are asked whether they are all there is.
    weak = not fit.model.rejected and any(grade != "reliable" for grade in fit.model.grades)
    following = (
        call("design", cell_file, "--add", 3, measurements_file, *measurements.weights, "-o", "more.csv") if weak else
        call("diagnose", cell_file, measurements_file, "-o", "diagnosis.json", "--extended", "stiffness_extended.json"))
    return Outcome(fit.as_dict(), fit.findings, fit.lines(), next_step=following)


def _identify_logs(session: Session, cell_file: Path, log_files: list[Path], output: Path, report: Path | None) -> Outcome:
    """Stiffnesses of the joints with encoders on both sides, from one or more logs."""
    from compstiff import fit_joint_logs, read_cell, read_motion_log
    from identification.common.files import check_writable, json_bytes, write_whole

    session.inputs += [cell_file, *log_files]
    check_writable([output, *([report] if report else [])], overwrite=session.overwrite)
    fit = fit_joint_logs(read_cell(cell_file, geometry=False), [read_motion_log(file) for file in log_files])
    content = fit.as_dict()
    files = {output: json_bytes(content)}
    if report:
        from compstiff.writing import report as page_of

        files[report] = page_of(fit).encode()
    write_whole(files, overwrite=session.overwrite, read=session.read)
    return Outcome(content, fit.findings, fit.lines(),
                   next_step=call("diagnose", cell_file, log_files[0], "-o", "diagnosis.json"))
