"""`compstiff post`: the planned RAPID program of an APT or CSV toolpath, for the first pass."""

from __future__ import annotations

from pathlib import Path

import click

from compensator.correction.settings import Settings
from compstiff.cli.console import READABLE, WRITABLE, command
from compstiff.cli.options import POSTING_OPTIONS, SPLITTING_OPTIONS, with_settings
from compstiff.outcome import Outcome, Session

RECORD = "compstiff-post"


@command("post", writes=True)
@click.argument("cell_file", metavar="CELL", type=READABLE)
@click.argument("toolpath_file", metavar="TOOLPATH", type=READABLE)
@click.option("-o", "--output", required=True, type=WRITABLE, help="The planned program to write.")
@with_settings(*POSTING_OPTIONS, *SPLITTING_OPTIONS)
def post(session: Session, cell_file: Path, toolpath_file: Path, output: Path, settings: Settings) -> Outcome:
    """Post an APT or CSV toolpath as the planned RAPID program.

    Mill it once, log the forces, and give it to correct. Beside OUTPUT stands OUTPUT.json, the record of what was assumed. With
    --split OUTPUT calls parts OUTPUT_001 ...; correct then takes TOOLPATH again, with the same options.
    """
    import hashlib
    from importlib.metadata import version

    from compensator.posting import post as posting
    from compensator.posting.split_files import check_outputs, split_files
    from identification.common.files import check_writable, json_bytes, sha256, write_whole
    from identification.common.findings import error, fold
    from identification.model.cell import read_cell

    session.inputs += [cell_file, toolpath_file]
    record_file = output.with_name(output.name + ".json")
    check_outputs([cell_file, toolpath_file], [output, record_file])
    check_writable([output, record_file], overwrite=session.overwrite)
    if toolpath_file.suffix.lower() not in (*posting.APT_SUFFIXES, *posting.TABLE_SUFFIXES):
        raise error("CS4201", f"toolpath format '{toolpath_file.suffix}' is not posted, expected one of "
                    f"{', '.join((*posting.APT_SUFFIXES, *posting.TABLE_SUFFIXES))}", file=str(toolpath_file),
                    hint="a RAPID program is planned already: give it to predict and correct as it is")
    cell = read_cell(cell_file)
    posted = posting.post(posting.read_cam_path(toolpath_file, settings.posting), cell, settings.posting, str(output))
    files, sizes, more = split_files(posted.content, posted.rapid, settings.posting, output, overwrite=session.overwrite)
    check_outputs([cell_file, toolpath_file], files)
    toolpath = posted.program.toolpath
    findings = (*toolpath.findings, *more)
    result = {"targets": len(toolpath), "in_the_air": int(posted.rapid.sum()), "assumed": posted.assumed, "parts": sizes}
    record = {
        "format": RECORD, "version": 1, "compstiff": version("compstiff"),
        "input": {"file": toolpath_file.name, "sha256": sha256(toolpath_file)},
        "cell": {"file": cell_file.name, "sha256": sha256(cell_file)},
        "outputs": [{"file": path.name, "sha256": hashlib.sha256(data).hexdigest()} for path, data in files.items()],
        "summary": result,
        "findings": [finding.as_dict() | {"file": Path(finding.file).name if finding.file else None}
                     for finding in fold(findings)],
    }
    write_whole({**files, record_file: json_bytes(record)})
    lines = [f"targets: {len(toolpath)}, {result['in_the_air']} in the air",
             f"speeds: {', '.join(_speeds(posted))} mm/s"]
    if sizes:
        lines.append(f"parts: {len(sizes)}, of {min(sizes)} to {max(sizes)} targets")
    # The parts are not read again: the same toolpath with the same options gives the same targets.
    again = toolpath_file if sizes else output
    return Outcome(result, findings, lines, next_step=f"mill it once with the forces logged, then compstiff correct "
                   f"{cell_file} {again} --stiffness stiffness.json --forces {output.stem}.forces.csv "
                   f"-o {output.stem}_corrected{output.suffix}" + (", with the options given here" if sizes else ""))


def _speeds(posted: object) -> list[str]:
    import numpy as np

    from compensator.posting.post import Posted

    assert isinstance(posted, Posted)
    speeds = 1e3 * np.unique(posted.program.toolpath.feed)
    shown = [f"{speed:.6g}" for speed in speeds[:8]]
    return shown if len(speeds) <= 8 else [*shown, f"and {len(speeds) - 8} more"]
