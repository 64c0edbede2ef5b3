"""`compstiff demo`: the main job on the shipped samples, with the commands a user would type."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from compstiff.cli.console import FOLDER, command
from compstiff.outcome import Outcome, Session

if TYPE_CHECKING:
    from identification.model.cell import Cell

SAMPLES = ("README.md", "cell.yaml", "measurements.csv", "insert.mod", "insert.forces.parquet")
WRITTEN = ("stiffness.json", "identify.html", "insert_corrected.mod", "insert_corrected.mod.json", "offsets.csv",
           "correct.html")
# The first targets of the sample program are its approach in air.
TARE = (0, 2)


@command("demo", writes=True)
@click.argument("folder", metavar="[DIR]", default="compstiff-demo", type=FOLDER)
def demo(session: Session, folder: Path) -> Outcome:
    """Run identify and correct on the shipped samples, into DIR.

    The samples are simulated (samples/README.md says how); DIR is compstiff-demo if it is not given.
    """
    import shutil

    from compstiff import Inputs, Outputs, Settings, correct_files, fit_stiffness, read_cell, read_measurements
    from identification.common.files import check_writable, json_bytes, write_whole
    from identification.common.shipped import shipped
    from identification.fit.report import identification_report

    folder.mkdir(parents=True, exist_ok=True)
    check_writable([folder / name for name in (*SAMPLES, *WRITTEN)], overwrite=session.overwrite)
    for name in SAMPLES:
        shutil.copyfile(shipped("samples") / name, folder / name)
    at = {name: folder / name for name in (*SAMPLES, *WRITTEN)}

    cell = read_cell(at["cell.yaml"])
    measurements = read_measurements(at["measurements.csv"], cell.robot)
    fit = fit_stiffness(cell, measurements)
    write_whole({
        at["stiffness.json"]: json_bytes(fit.model.as_dict()),
        at["identify.html"]: identification_report(fit).encode(),
    })
    inputs = Inputs(at["cell.yaml"], at["insert.mod"], at["stiffness.json"], at["insert.forces.parquet"])
    outputs = Outputs(at["insert_corrected.mod"], at["offsets.csv"], at["correct.html"])
    corrected = correct_files(inputs, outputs, Settings.of(tare=(TARE,)), overwrite=True)
    pushed = _pushed(cell, at["offsets.csv"])
    session.inputs += [at[name] for name in SAMPLES]
    lines = [
        f"$ compstiff identify cell.yaml measurements.csv -o stiffness.json --report identify.html   (in {folder})",
        *fit.lines(),
        "",
        "$ compstiff correct cell.yaml insert.mod --stiffness stiffness.json --forces insert.forces.parquet "
        f"--tare {TARE[0]}:{TARE[1]} -o insert_corrected.mod --offsets offsets.csv --report correct.html",
        *corrected.lines(),
        "",
        "$ compstiff cell cell.yaml & compstiff push cell.yaml offsets.csv --program insert.mod --apply   "
        "(instead of the corrected program)",
        *pushed,
        "",
        f"Everything is in {folder}: the corrected program insert_corrected.mod beside insert.mod, reports identify.html "
        "and correct.html.",
        "The samples are simulated: samples' README.md says how.",
    ]
    result = {"folder": str(folder), "stiffness": fit.model.as_dict(), "correction": corrected.as_dict()}
    return Outcome(result, (*fit.findings, *corrected.findings), lines,
                   next_step=f"open {at['correct.html']}, then begin your own cell: compstiff init my-cell")


def _pushed(cell: Cell, offsets_file: Path) -> list[str]:
    """Sends the offsets over Modbus to an offset device in this process, on loopback."""
    from compensator.modbus.embedded import device_of
    from compensator.modbus.server import Loopback
    from compstiff import Address, push, read_offsets

    offsets = read_offsets(offsets_file, reach_mm=10.0)
    with Loopback(device_of(cell)) as server:
        pushed = push(cell, offsets, Address("127.0.0.1", server.port, unit=1), apply=True)
    return pushed.lines()[1:]
