"""What `identify` and `diagnose` do with joint deflection logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compstiff.outcome import Outcome, Session
from identification.common.files import check_writable, json_bytes, write_whole
from identification.model.cell import read_cell
from identification.motion.log_file import read_motion_log
from identification.motion.procedure import REPLICATES, diagnose_logs
from identification.motion.record import diagnosis_findings, identified_model, record, stiffness_findings
from identification.motion.stiffness import axis_stiffness
from identification.motion.words import stiffness_table, summary


def identify_logs(session: Session, cell_file: Path, logs: list[Path], output: Path, report: Path | None) -> Outcome:
    """Stiffnesses of the joints with encoders on both sides, from one or more logs."""
    session.inputs += [cell_file, *logs]
    check_writable([output, *([report] if report else [])], overwrite=session.overwrite)
    cell = read_cell(cell_file, geometry=False)
    records = [read_motion_log(path) for path in logs]
    joints = [axis_stiffness(joint, records) for joint in sorted({joint for one in records for joint in one.joints})]
    model = identified_model(cell, joints)
    content = model.as_dict()
    findings = tuple(stiffness_findings(records, joints))
    lines = stiffness_table(model, joints)
    files = {output: json_bytes(content)}
    if report:
        from identification.motion.pages import stiffness_report

        files[report] = stiffness_report(lines, findings, content, joints).encode()
    write_whole(files)
    return Outcome(content, findings, lines, next_step=f"compstiff diagnose {cell_file} {logs[0]} -o diagnosis.json")


def diagnose_log(
    session: Session, cell_file: Path, log: Path, validate: Path | None, output: Path, *, extended: Path | None, alarm: float,
    replicates: int | None, report: Path | None,
) -> Outcome:
    """What the plain springs get wrong in a log, its cause, and the gain on a log that was not fitted."""
    session.inputs += [cell_file, log, *([validate] if validate else [])]
    check_writable([output, *(path for path in (extended, report) if path)], overwrite=session.overwrite)
    cell = read_cell(cell_file, geometry=False)
    found = diagnose_logs([read_motion_log(log)], read_motion_log(validate) if validate else None, alarm=alarm,
                          replicates=replicates or REPLICATES)
    content, findings, lines = record(cell, found), diagnosis_findings(found), summary(found)
    files = {output: json_bytes(content)}
    if extended:
        residual = float(np.sqrt(np.mean(np.concatenate([one.residuals[:, 1] for one in found.axes]) ** 2)))
        model = identified_model(cell, [one.stiffness for one in found.axes],
                                 [cause for one in found.axes for cause in one.causes], 1e6 * residual)
        files[extended] = json_bytes(model.as_dict())
    if report:
        from identification.motion.pages import diagnosis_report

        files[report] = diagnosis_report(found, lines, findings, content).encode()
    write_whole(files)
    return Outcome(content, findings, lines, next_step=f"compstiff identify {cell_file} {log} -o stiffness.json")
