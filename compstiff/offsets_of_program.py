"""Offsets held against the program that the robot runs, and against the deviation that their file predicts."""

from __future__ import annotations

from pathlib import Path

from compensator.modbus.against_deviation import check_deviation
from compensator.modbus.of_program import check_program
from compensator.modbus.offset_file import Offsets
from identification.common.findings import Finding
from identification.model.cell import Cell


def check_offsets_of(offsets: Offsets, program: Path | None, cell: Cell) -> tuple[Finding, ...]:
    """What is said of them; program: the planned one, None: not known. Raises what `check_program`, `check_deviation` and
    reading the program raise."""
    if program is None:
        check_deviation(offsets, None)
        return ()
    from compensator.path.robot_path import robot_path
    from compensator.posting.read_toolpath import read_toolpath

    toolpath = read_toolpath(program, cell).toolpath
    told = check_program(offsets, toolpath.position, str(program))
    check_deviation(offsets, robot_path(toolpath, cell).base_from_object.rotation)
    return told
