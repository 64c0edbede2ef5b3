"""What `compstiff check` says of a program: read as `correct` reads it, with all that can be said before any force."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from compensator.correction.settings import Settings
from compstiff.quaternion_orders import W_FIRST, in_another_order
from identification.common.findings import Finding, Refused, error, verb
from identification.model.cell import Cell

if TYPE_CHECKING:
    from compensator.posting.read_toolpath import PlannedProgram


def program_check(file: Path, cell: Cell, settings: Settings) -> tuple[str, tuple[Finding, ...]]:
    """What is in a program in a few words, and what is to be said of it before any force. Raises what `read_toolpath`,
    `check_known` and `robot_path` raise; CompstiffError: CS4202 no move."""
    from compensator.correction.correctable import check_known, said_before_forces
    from compensator.correction.predict import other_tools
    from compensator.correction.recorded import check_not_corrected
    from compensator.forces.program_time import moves_in_air
    from compensator.path.robot_path import robot_path
    from compensator.posting.read_toolpath import read_toolpath

    try:
        program = read_toolpath(file, cell, settings.posting)
    except Refused as refused:
        if refused.findings[0].code != "CS4303":
            raise
        order = in_another_order(file, cell, settings.posting)
        hint = f"{order}: {W_FIRST}; " if order else ""
        raise Refused(*(replace(finding, hint=hint + finding.hint) for finding in refused.findings)) from refused
    if not len(program.toolpath):
        return _without_moves(file, program)
    if not program.toolpath.others.targets:     # else it is sound, with the modules that it names
        check_known(program.toolpath)
    # Absurd numbers overflow on their way to a finding; NumPy need not say so too.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        path = robot_path(program.toolpath, cell)
        length = float(np.nanmax(path.length, initial=0.0))
    words = f"{len(program.toolpath)} targets, {int(path.reached.sum())} reached, {length:.3g} m"
    # What is asked about cell.yaml itself is said of it.
    own = (finding for finding in program.toolpath.findings if finding.code != "CS0117")
    # Where joint angles say where the robot goes no tool does.
    posed = path.known & np.isnan(program.toolpath.joints[:, 0])
    findings = (*own, *path.findings, *other_tools(path, posed, "of the program"))
    beyond = np.flatnonzero(path.known & ~path.reached)
    if len(beyond):
        first = int(beyond[0])
        findings += (Finding("CS0114", "warning", f"the robot does not reach {len(beyond)} of {len(program.toolpath)} targets",
                             file=str(file), line=int(program.toolpath.line[first]), target=int(program.toolpath.number[first]),
                             hint="are tool, work object and base_frame those of the controller?"),)
    cuts = np.flatnonzero(posed & ~moves_in_air(program.toolpath) & (program.toolpath.block == ""))
    findings += tuple(said_before_forces(path, cuts))
    order = in_another_order(file, cell, settings.posting, path, program)
    if order:
        findings += (Finding(
            "CS0117", "warning" if len(beyond) else "note", order, file=str(file), hint=f"{W_FIRST}; is this one?"),)
    try:
        check_not_corrected(file)
    except Refused as corrected:        # a good file all the same: it goes to the robot, not through `correct` again
        findings += tuple(replace(finding, level="note") for finding in corrected.findings)
    return words, findings


def _without_moves(file: Path, program: PlannedProgram) -> tuple[str, tuple[Finding, ...]]:
    """A module of a job: the data and routines that its other modules name, or the one that calls them. Raises CompstiffError
    (CS4202) where it is neither."""
    from compensator.posting.beside import users_beside

    users = users_beside(file)
    if users:
        shown = ", ".join(users[:3]) + (f" and {len(users) - 3} more" if len(users) > 3 else "")
        return f"no move; {shown} beside it {verb(len(users), 'name')} what it declares", program.toolpath.findings
    if any(finding.code == "CS2016" for finding in program.toolpath.findings):
        return "no move of its own", program.toolpath.findings
    raise error("CS4202", "the program has no move", file=str(file), hint="name the module that holds the moves")
