"""A toolpath of any format as the planned RAPID program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.posting.beside import declared_beside, driving_beside
from compensator.posting.post import post, read_cam_path
from compensator.posting.settings import PostingSettings
from compensator.posting.suffixes import APT_SUFFIXES, RAPID_SUFFIXES, TABLE_SUFFIXES, toolpath_suffix
from compensator.rapid import RapidProgram, read_rapid, with_marks
from compensator.toolpath import Toolpath
from identification.common.findings import error
from identification.model.cell import Cell
from identification.model.controller import check_rapid

AS_POSTED = PostingSettings()


@dataclass(frozen=True, eq=False)
class PlannedProgram:
    """The program as the CAM system means it. text: its RAPID text as read, or as posted. air (N,): the targets that are known
    to be reached in the air. source: the file it was read from, None: none."""

    text: RapidProgram
    air: NDArray[np.bool_]
    source: Path | None = None

    @property
    def toolpath(self) -> Toolpath:
        """Its targets."""
        return self.text.toolpath


def read_toolpath(file: str | Path, cell: Cell, settings: PostingSettings = AS_POSTED) -> PlannedProgram:
    """Reads a toolpath by its suffix; APT and CSV are posted first (post.py).

    Raises CompstiffError: CS4201 for formats that are not read, CS0060 for RAPID and a robot of another maker, and what the
    readers and `post` raise.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program = compstiff.read_toolpath("insert.mod", cell)
    >>> len(program.toolpath), program.toolpath.position[0].round(4).tolist()
    (3586, [-0.0148, 0.002, 0.062])
    """
    file = Path(file)
    suffix = toolpath_suffix(file)
    if suffix in (*APT_SUFFIXES, *TABLE_SUFFIXES):
        posted = post(read_cam_path(file, settings), cell, settings, f"{file} (posted)")
        text = posted.program
        if settings.mark:
            content, findings = with_marks(text, settings.mark)
            text = read_rapid(content, text.source.name)
            text = replace(text, toolpath=replace(text.toolpath, findings=(*posted.findings, *findings),
                                                  cutters=posted.program.toolpath.cutters))
        return PlannedProgram(text, posted.rapid, file)
    if suffix not in RAPID_SUFFIXES:
        raise error("CS4201", f"toolpath format '{file.suffix}' is not read, expected one of "
                    f"{', '.join((*RAPID_SUFFIXES, *APT_SUFFIXES, *TABLE_SUFFIXES))}",
                    file=str(file), hint="a .pgf lists the modules of a job: compstiff post joins them" if suffix == ".pgf" else
                    "write the toolpath as RAPID, as an APT cutter location file, or as a table")
    check_rapid(cell.robot, "this is a RAPID program", str(file))
    try:
        text = read_rapid(file.read_bytes(), str(file), partial(driving_beside, file), partial(declared_beside, file))
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    return PlannedProgram(text, np.zeros(len(text.toolpath), dtype=bool), file)
