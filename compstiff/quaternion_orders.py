"""A quaternion in the order x y z w, told by what it does: it lets the robot reach the program, and as the program means."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from compensator.path.robot_path import RobotPath, robot_path
from compensator.posting.read_toolpath import PlannedProgram, read_toolpath
from compensator.posting.settings import PostingSettings
from compensator.posting.suffixes import RAPID_SUFFIXES, toolpath_suffix
from identification.common.arrays import Array
from identification.common.findings import CompstiffError
from identification.model.cell import Cell
from identification.model.quaternion_order import as_written, in_words, other_order
from identification.model.rotations import Frame, quaternion_to_matrix

FRAMES: dict[str, Callable[[Cell, Frame], Cell]] = {
    "tool.": lambda cell, frame: replace(cell, flange_from_tcp=frame),
    "workobject.": lambda cell, frame: replace(cell, world_from_object=frame),
    "base_frame.": lambda cell, frame: replace(cell, world_from_base=frame)}


# The program's confdata are not those of its targets.
OTHER_CONFIGURATION = {"CS4001", "CS4002"}
W_FIRST = "quaternions are w x y z, w first, as q1 in RAPID"


def in_another_order(
    file: Path, cell: Cell, settings: PostingSettings, path: RobotPath | None = None, program: PlannedProgram | None = None
) -> str:
    """Which quaternion, read as x y z w, lets the robot reach every target of a program in the configuration that the program
    names, where as written it does not; "" for none. path, program: as written, None where it could not be posted. Asked only
    of programs with which something is wrong: there are cells in which both orders will do."""
    unreached = path is None or not _reached(path)
    # What is posted here has configurations of its own.
    posted = toolpath_suffix(file) not in RAPID_SUFFIXES
    if path is not None and not unreached and (posted or not _elsewhere(path)):
        return ""
    for told, other in _others(file, cell, settings, program):
        try:
            # Absurd numbers overflow on their way to a finding.
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                turned = other()
        except CompstiffError:
            continue
        if _reached(turned) and (unreached or not _elsewhere(turned)):
            return f"{told}, every target is reached" + ("" if unreached else " in the configuration that the program names")
    return ""


def _others(
    file: Path, cell: Cell, settings: PostingSettings, program: PlannedProgram | None
) -> Iterator[tuple[str, Callable[[], RobotPath]]]:
    """Each quaternion that may be in the other order: the words for it, and the program then."""
    for name, with_frame in FRAMES.items():
        frame = cell.frames[name]
        if not in_words(frame.rotation):
            continue            # [1, 0, 0, 0] is what nobody writes as x y z w
        turned = other_order(frame.rotation)
        other = with_frame(cell, Frame(turned, frame.position))
        yield (f"with {name}quaternion {as_written(turned)}, which is cell.yaml's read as x y z w",
               partial(_driven, file, other, settings))
    if program is None:
        return
    toolpath = program.toolpath
    yield ("with the targets' quaternions read as x y z w",
           lambda: robot_path(replace(toolpath, quaternion=toolpath.quaternion[:, [3, 0, 1, 2]]), cell))
    yield ("with the quaternions of its tooldata read as x y z w",
           lambda: robot_path(replace(toolpath, tools=tuple(
               replace(tool, quaternion=_other(tool.quaternion)) for tool in toolpath.tools)), cell))
    yield ("with the quaternions of its wobjdata read as x y z w",
           lambda: robot_path(replace(toolpath, workobjects=tuple(
               replace(one, quaternion=_other(one.quaternion)) for one in toolpath.workobjects)), cell))


def _other(quaternion: Array | None) -> Array | None:
    if quaternion is None or not in_words(quaternion_to_matrix(quaternion)):
        return quaternion
    return quaternion[[3, 0, 1, 2]]


def _driven(file: Path, cell: Cell, settings: PostingSettings) -> RobotPath:
    return robot_path(read_toolpath(file, cell, settings).toolpath, cell)


def _reached(path: RobotPath) -> bool:
    return bool(path.known.any() and path.reached[path.known].all())


def _elsewhere(path: RobotPath) -> bool:
    """Whether the configurations that the program names are not those of its targets; zeros name none."""
    stated = path.toolpath.confdata[path.toolpath.has_confdata]
    return bool(stated.any()) and any(finding.code in OTHER_CONFIGURATION for finding in path.findings)
