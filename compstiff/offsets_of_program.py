"""Offsets held against the program that the robot runs, the deviation that their file predicts, and the record of `correct`."""

from __future__ import annotations

from pathlib import Path

from compensator.correction.recorded import check_as_written, said_of_offsets, written_by
from compensator.modbus.against_deviation import check_deviation
from compensator.modbus.of_program import check_program
from compensator.modbus.offset_file import Offsets
from identification.common.findings import Finding
from identification.model.cell import Cell


def check_offsets_of(offsets: Offsets, program: Path | None, cell: Cell) -> tuple[Finding, ...]:
    """What is said of them; program: the planned one, None: not known. Raises what `check_as_written`, `said_of_offsets`,
    `check_program`, `check_deviation` and reading the program raise."""
    check_as_written(Path(offsets.source), offsets.sha256, program)
    recorded = said_of_offsets(Path(offsets.source), program, cell.robot.name, sent=True)
    if program is None:
        return (*recorded, *check_deviation(offsets, None, cell.world_from_base.rotation.T[:, 2]))
    from compensator.path.robot_path import robot_path
    from compensator.posting.read_toolpath import read_toolpath

    toolpath = read_toolpath(program, cell).toolpath
    record, _ = written_by(program) or ("", "")
    told = check_program(offsets, toolpath.position, str(program), record)
    return (*recorded, *told, *check_deviation(offsets, robot_path(toolpath, cell).base_from_object.rotation))
