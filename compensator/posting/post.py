"""APT and CSV toolpaths become the planned RAPID program; from there on they go the way of every RAPID program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.posting.campath import CamPath
from compensator.posting.module_text import module_text
from compensator.posting.odd_moves import said_of_moves
from compensator.posting.odd_places import said_of_places, to_spindle
from compensator.posting.orientation import Orientations, orientations
from compensator.posting.parked import as_parked, parked_values, said_of_parked
from compensator.posting.settings import PostingSettings
from compensator.posting.suffixes import APT_SUFFIXES, toolpath_suffix
from compensator.rapid import RapidProgram, read_rapid
from identification.common.arrays import Array
from identification.common.findings import Finding, error
from identification.model.cell import Cell
from identification.model.quaternion_order import said_of_order

MOST_SPEEDS_SHOWN = 8
# A cutting feed beyond these [mm/s] is likely in another unit; engineering judgement.
LEAST_FEED, MOST_FEED = 0.5, 500.0
# And a feed a turn beyond these shares of the cutter's diameter: a tooth cuts 0.3 to 1 % of it, and there are 1 to 10 of them.
LEAST_TURN, MOST_TURN = 0.002, 0.25
# Cutters whose diameters differ by no more [mm] are one, ground again.
SAME_CUTTER_MM = 0.2
# Speeds of the spindle that differ by less than this share are one, as an override sets it.
SAME_SPEED = 0.1


@dataclass(frozen=True, eq=False)
class Posted:
    """program: the planned program, its findings those of reading, posting and reading back. content: its bytes.
    rapid (N,): targets reached in the air. assumed: what was chosen, JSON values."""

    program: RapidProgram
    content: bytes
    rapid: NDArray[np.bool_]
    assumed: dict[str, Any]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Of reading, posting and reading back."""
        return self.program.toolpath.findings

    def as_dict(self) -> dict[str, Any]:
        """How many targets, how large the cut is, and what was assumed."""
        return {"targets": len(self.program.toolpath), "in_the_air": int(self.rapid.sum()),
                "size_mm": np.round(self.size, 6).tolist(), "assumed": self.assumed}

    @property
    def size(self) -> Array:
        """Extent (3,) [mm] of the targets that are cut, in the work object: a wrong unit shows here."""
        cut = self.program.toolpath.position[~self.rapid]
        return 1e3 * np.ptp(cut, axis=0) if len(cut) else np.zeros(3)

    @property
    def minutes(self) -> float:
        """How long the cuts take at their feeds, arcs by their chords: a wrong unit of the feed shows here."""
        toolpath = self.program.toolpath
        length = np.linalg.norm(np.diff(toolpath.position, axis=0), axis=1)
        return float(np.nansum((length / toolpath.feed[1:])[~self.rapid[1:]])) / 60

    def lines(self) -> list[str]:
        """Targets, where and how large the cut is, speeds and time."""
        cut = 1e3 * self.program.toolpath.position[~self.rapid]
        place = ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in zip(
            "xyz", cut.min(axis=0), cut.max(axis=0), strict=True)) if len(cut) else "none"
        speeds = 1e3 * np.unique(self.program.toolpath.feed)
        shown = [f"{speed:.6g}" for speed in speeds[:MOST_SPEEDS_SHOWN]]
        if len(speeds) > MOST_SPEEDS_SHOWN:
            shown.append(f"and {len(speeds) - MOST_SPEEDS_SHOWN} more")
        return [f"targets: {len(self.program.toolpath)}, {int(self.rapid.sum())} in the air",
                f"size of the cut: {' x '.join(f'{side:.6g}' for side in self.size)} mm",
                f"its place in the work object: {place} mm",
                f"speeds: {', '.join(shown)} mm/s; the cuts take about {self.minutes:.3g} minutes"]


def read_cam_path(file: Path, settings: PostingSettings) -> CamPath:
    """Reads APT or a table by its suffix. Raises what the readers raise."""
    if toolpath_suffix(file) in APT_SUFFIXES:
        from compensator.posting.apt import read_apt

        return read_apt(file, settings.tool)
    from compensator.posting.tables import read_cam_table

    return read_cam_table(file, 1e-3 * settings.feed_mm_s)


def post(cam_path: CamPath, cell: Cell, settings: PostingSettings, name: str) -> Posted:
    """The planned program. name: what findings call it, for a file that is not written.

    Raises Refused (CS4303: no configuration goes all along the path), CompstiffError: CS2153 (joints and poses of a table do
    not fit), CS4304 (tool axis along the direction of its x axis), CS4306 (the text does not read back), CS4510 (an axis under
    the robot is not parked).
    """
    external = parked_values(cell)
    orientation = orientations(cam_path, as_parked(cell, external), settings)
    assumed = {"form": cam_path.form, "zone_mm": settings.zone_mm, "rapid_mm_s": settings.rapid_mm_s,
               "work_object": "cell.yaml", "tool": "cell.yaml", **orientation.chosen}
    findings = [*cam_path.findings, Finding(
        "CS4300", "note", f"assumed: coordinates in the work object of cell.yaml, its tool, zone {settings.zone_mm:g} mm with "
        f"stop points at both ends{' and the bottom of holes' if cam_path.stop.any() else ''} only, "
        f"{settings.rapid_mm_s:g} mm/s in the air", cam_path.source,
        hint="--zone-mm and --rapid-mm-s change it, cell.yaml has workobject and tool"), *orientation.findings,
        *said_of_parked(cell, external, cam_path.source)]
    if cell.tool_mass is None or cell.tool_centre is None:
        findings.append(Finding(
            "CS4301", "warning", "cell.yaml states no mass and centre of mass of the tool: the tooldata declares almost none",
            str(cell.source), hint="give tool.mass_kg and tool.centre_of_mass_mm, or enter the load on the controller first"))
    for frame in ("tool.", "workobject."):
        findings += said_of_order(f"{frame}quaternion", cell.frames[frame].rotation, str(cell.source))
    up = to_spindle(cam_path, cell.flange_from_tcp)
    findings += [*_odd_feeds(cam_path, cell), *_odd_spindle(cam_path, cell), *_odd_cutters(cam_path, cell),
                 *said_of_places(cam_path, cell.flange_from_tcp), *said_of_moves(cam_path, up, settings)]
    content = module_text(cam_path, cell, settings, orientation, external).encode("ascii")
    program = read_rapid(content, name)
    _check(program, cam_path, orientation, external, settings)
    toolpath = replace(program.toolpath, findings=(*findings, *program.toolpath.findings), cutters=cam_path.cutters)
    return Posted(replace(program, toolpath=toolpath), content, cam_path.rapid, assumed)


def _odd_feeds(cam_path: CamPath, cell: Cell) -> list[Finding]:
    """Cutting feeds that no robot mills at, or no cutter of the cell: mm/min under mm/s, m/min, or the other way round."""
    feed = 1e3 * cam_path.feed[~cam_path.rapid]
    feed = feed[feed > 0]
    if not len(feed):
        return []
    hint = "a feed in mm/min is sixty times that in mm/s, m/min a seventeenth: check feed_mm_s, FEDRAT and its unit"
    if feed.max() > MOST_FEED or feed.min() < LEAST_FEED:
        return [Finding("CS4307", "warning", f"cutting feeds from {feed.min():.3g} to {feed.max():.4g} mm/s: robots mill at "
                        f"{LEAST_FEED:g} to {MOST_FEED:g}", file=cam_path.source, hint=hint)]
    rpm, diameter, middle = cell.force_log.form.spindle_rpm, cell.cutting.tool_diameter_mm, float(np.median(feed))
    if not rpm or not diameter or LEAST_TURN < middle * 60 / rpm / diameter < MOST_TURN:
        return []
    return [Finding("CS4307", "warning", f"at {middle:.3g} mm/s and {rpm:g} rpm the feed is {middle * 60 / rpm:.2g} mm a turn, "
                    f"of a cutter of {diameter:g} mm", file=cam_path.source, hint=f"{hint}; spindle, cutter: cell.yaml")]


def _odd_spindle(cam_path: CamPath, cell: Cell) -> list[Finding]:
    """Speeds of the spindle in the file that are not all cell.yaml's (CS4325), by which forces and chips are worked out."""
    stated, there = cell.force_log.form.spindle_rpm, cam_path.spindle_rpm
    if not stated or all(abs(speed / stated - 1) < SAME_SPEED for speed in there):
        return []
    return [Finding("CS4325", "warning", f"the spindle turns at {' and '.join(f'{speed:g}' for speed in there)} rpm in the "
                    f"file; force_log.spindle_rpm in cell.yaml is {stated:g}", file=cam_path.source,
                    hint="mean forces and chips are worked out with cell.yaml's: state the one that runs" + (
                        ", and post what runs at another as a program of its own" if len(there) > 1 else ""))]


def _odd_cutters(cam_path: CamPath, cell: Cell) -> list[Finding]:
    """Cutters of the file that are not the one of cell.yaml, or several of one tool (CS4316)."""
    known = {round(1e3 * cutter.diameter, 3): cutter for cutter in cam_path.cutters if cutter.diameter > 0}
    stated = cell.cutting.tool_diameter_mm
    if len(known) > 1:
        what = f"is cut with cutters of {' and '.join(f'{size:g}' for size in known)} mm, as one tool"
    elif known and stated and abs(next(iter(known)) - stated) > SAME_CUTTER_MM:
        what = f"is cut with a cutter of {next(iter(known)):g} mm; cutting.tool_diameter_mm in cell.yaml is {stated:g}"
    else:
        return []
    return [Finding("CS4316", "warning", what, file=cam_path.source, line=list(known.values())[-1].line,
                    hint="a program is posted for the one tool of cell.yaml: its TCP, its length and its cutter; a change of "
                    "tools is read from LOADTL, LOAD/TOOL, TOOLNO and TURRET with a number")]


def _check(
    program: RapidProgram, cam_path: CamPath, orientation: Orientations, external: Array, settings: PostingSettings
) -> None:
    """Raises CompstiffError (CS4306) where the posted text does not say what was meant."""
    read = program.toolpath
    feed = np.where(cam_path.rapid, 1e-3 * settings.rapid_mm_s, cam_path.feed)
    good = (len(read) == len(cam_path) and bool((read.block == "").all())
            and np.array_equal(read.confdata, orientation.confdata)
            and np.array_equal(read.external, np.tile(external, (len(read), 1)), equal_nan=True)
            and np.abs(read.position - cam_path.position).max() <= 0.5001e-7
            and np.abs(read.quaternion - orientation.quaternion).max() <= 2e-8
            and np.allclose(read.feed, feed, rtol=1e-11, atol=0))
    if not good:
        raise error("CS4306", "the posted program does not read back as it was meant; nothing was written",
                    file=cam_path.source, hint="a defect in compstiff: please report it with this toolpath")
