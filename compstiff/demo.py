"""`compstiff demo`: the main job on the shipped samples, with the commands a user would type."""

from __future__ import annotations

import shutil
from pathlib import Path

from compensator.correction.files import correction_lines, run_correction
from compensator.correction.job import Inputs, summary
from compensator.correction.settings import Settings
from compstiff.outcome import Outcome, Session
from identification.common.files import check_writable, json_bytes, write_whole
from identification.common.shipped import shipped
from identification.fit.fit import fit_stiffness
from identification.fit.report import identification_report
from identification.measurements import read_measurements
from identification.model.cell import Cell, read_cell

SAMPLES = ("README.md", "cell.yaml", "measurements.csv", "insert.mod", "insert.forces.parquet")
WRITTEN = ("stiffness.json", "identify.html", "insert_corrected.mod", "insert_corrected.mod.json", "offsets.csv",
           "correct.html")
# The first targets of the sample program are its approach in air.
TARE = (0, 2)


def run_demo(session: Session, folder: Path) -> Outcome:
    """Copies the samples into the folder, identifies, corrects, and leaves everything there."""
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
        at["identify.html"]: identification_report(cell, measurements, fit).encode(),
    })
    inputs = Inputs(at["cell.yaml"], at["insert.mod"], at["stiffness.json"], at["insert.forces.parquet"])
    corrected = run_correction(inputs, at["insert_corrected.mod"], at["offsets.csv"], at["correct.html"],
                               Settings.of(tare=(TARE,)), overwrite=True)
    pushed = _pushed(cell, at["offsets.csv"])
    session.inputs += [at[name] for name in SAMPLES]
    lines = [
        f"$ compstiff identify cell.yaml measurements.csv -o stiffness.json --report identify.html   (in {folder})",
        *fit.lines(),
        "",
        "$ compstiff correct cell.yaml insert.mod --stiffness stiffness.json --forces insert.forces.parquet "
        f"--tare {TARE[0]}:{TARE[1]} -o insert_corrected.mod --offsets offsets.csv --report correct.html",
        *correction_lines(corrected),
        "",
        "$ compstiff cell cell.yaml & compstiff push cell.yaml offsets.csv --apply   (instead of the corrected program)",
        *pushed,
        "",
        f"Everything is in {folder}: the corrected program insert_corrected.mod beside insert.mod, reports identify.html "
        "and correct.html.",
        "The samples are simulated: samples' README.md says how.",
    ]
    result = {"folder": str(folder), "stiffness": fit.model.as_dict(), "correction": summary(corrected.predicted, corrected)}
    return Outcome(result, (*fit.findings, *corrected.findings), lines,
                   next_step=f"open {at['correct.html']}, then write your own cell.yaml (README.md, Your own cell)")


def _pushed(cell: Cell, offsets_file: Path) -> list[str]:
    """Sends the offsets over Modbus to an embedded cell in this process, on loopback."""
    from compensator.modbus.job import limit_um, lines, plan_push
    from compensator.modbus.link import Address, Link
    from compensator.modbus.machine import CellMachine
    from compensator.modbus.offset_file import check_offsets, read_offsets
    from compensator.modbus.push import PATIENCE_S, push_table
    from compensator.modbus.server import Loopback
    from compensator.modbus.state import TableStore

    offsets = read_offsets(offsets_file, reach_mm=10.0)
    check_offsets(offsets, cell.max_offset)
    with Loopback(CellMachine(TableStore(), limit_um(cell), cell.robot.name)) as server:
        address = Address("127.0.0.1", server.port, unit=1)
        plan = plan_push(cell, offsets, address, needed=True)
        with Link(address) as link:
            how = push_table(link, plan.tables[0], PATIENCE_S, lambda page, pages: None)
    return [*lines(plan, address, cell.max_offset)[1:], f"new table active (read back): {plan.tables[0].header.name}, {how}"]
