"""What no file of a job can prove, put so that its user can compare: which robot, where the part stands, how heavy the cut is.

A gain of two, pounds for newtons or another work object are within what robots, tools and materials may be. So the force is
turned into the cut that it would take: by the power at the edges, T v_c = k_c A v_f, with T = ACROSS times the mean force
across the axis, the cutting speed v_c = pi D n, the feed v_f and k_c of the material (cutting_prior.py), the section of the cut
across the feed is

    A = ACROSS F pi D n / (k_c v_f) .

ACROSS: of end mills from little engagement to a slot the mean force across is 0.8 to 1.4 times T (the radial part of 0.3 to 1
of T beside it, cut_direction.py). With the width of k_c, and the lesser diameter at which a ball or a corner cuts, A is known
within a factor of WITHIN (engineering judgement; 199 of 200 end mills drawn in aluminium were).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.correction.cut_kind import towards_spindle
from compensator.correction.cutting_prior import ENGAGED, TEETH
from compensator.correction.if_another import IfAnother
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.settings import Settings
from compensator.cutting.materials import MATERIALS
from compensator.forces.cut_direction import cut_direction
from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.model.cell_file import CuttingFile

ACROSS, WITHIN = 0.9, 2.5
# Beyond this factor a stated cut, whose depth is known as badly, is another one.
SURE = 4.0
# Of these where cell.yaml states no material.
USUAL = ("aluminium", "steel")


@dataclass(frozen=True)
class TakenAsGiven:
    """robot, place: words; force [N]: across the tool's axis, in the middle of the targets; power [W] at the edges, None: the
    cutter, the feed or the spindle's speed is not known; sections [mm^2] by material."""

    robot: str
    place: str
    force: float
    power: float | None
    sections: dict[str, float]
    unstated: str = ""              # what nothing is said of, so that it is in no sigma
    direction: str = ""             # of the force against the feed, and what cut that is
    of_stock: str = ""              # of forces that were predicted: what is cut, and what another stock would mean

    @property
    def cut(self) -> str:
        """The cut that the forces are those of."""
        said = f"{self.force:.0f} N across the tool in the middle"
        if self.power is None:
            return f"{said} (cutting.material and tool_diameter_mm in cell.yaml, a spindle speed: then what cut that is)"
        cuts = " or ".join(f"{area:.2g} mm2 in {name.replace('_', ' ')}" for name, area in self.sections.items())
        return (f"{said}, as a cut of {cuts} takes (depth x width, within a factor of {WITHIN:g}), "
                f"{1e-3 * self.power:.2g} kW at the edges")

    @property
    def words(self) -> list[str]:
        """One sentence each: robot, part, cut, and what is taken for exact."""
        cut = self.of_stock or (self.cut if self.force else "")
        return [f"robot: {self.robot}", f"part: {self.place}", *([f"cut: {cut}"] if cut else []),
                *([f"force on the tool: {self.direction}"] if self.direction else []),
                *([f"taken as exact, as cell.yaml says nothing of it: {self.unstated}"] if self.unstated else [])]

    def lines(self) -> list[str]:
        """For the terminal."""
        return ["taken as given, compare:", *(f"  {word}" for word in self.words)] if self.place else []

    def finding(self, cutting: CuttingFile, depth: float | None, source: str) -> list[Finding]:
        """A warning (CS3079) where the cut is not the one that cell.yaml and --depth-of-cut, depth [m], state."""
        if not (self.sections and cutting.material and cutting.contact_mm and cutting.tool_diameter_mm):
            return []
        (area,), deepest = self.sections.values(), cutting.contact_mm * cutting.tool_diameter_mm
        stated = None if depth is None else cutting.contact_mm * 1e3 * depth
        if area <= WITHIN * deepest and (stated is None or 1 < SURE * area / stated < SURE**2):
            return []
        at_most = "at most " if stated is None else ""
        return [Finding(
            "CS3079", "warning", f"these forces take a cut of {area:.2g} mm2 in {cutting.material.replace('_', ' ')}, within a "
            f"factor of {WITHIN:g}; it is stated as {at_most}{deepest if stated is None else stated:.2g} mm2", file=source,
            hint="are the forces in newtons, the gain and the range of the sensor right, and cutting and --depth-of-cut those "
            "of this program?")]


def taken_as_given(loaded: LoadedPath, settings: Settings, another: IfAnother | None = None) -> TakenAsGiven:
    """Of a program under its forces; where they are predicted with the cut that they are of, `another`, without a place where
    no target has force."""
    path, targets, cell = loaded.path, loaded.targets, loaded.path.cell
    serial = cell.robot.serial_number
    source = f", stiffnesses from {loaded.model.source.name}" if loaded.model.source else ""
    robot = f"{cell.robot.name}, " + (f"serial number {serial}{source}" if serial else (
        f"no serial_number in cell.yaml{source}: those of another robot of this type would not be noticed"))
    at = 1e3 * path.base_from_tcp.position[targets]
    if not len(targets) or not np.isfinite(at).all():
        return TakenAsGiven(robot, "", 0.0, None, {})
    place = "cuts at " + ", ".join(f"{name} {low:.0f} to {high:.0f}" for name, low, high in zip(
        "xyz", np.floor(at.min(axis=0)), np.ceil(at.max(axis=0)), strict=True)) + " mm from the robot's base"
    if loaded.forces.unknown is not None:
        return TakenAsGiven(robot, place, 0.0, None, {}, _unstated(loaded), of_stock=another.words if another else "")
    force = loaded.forces.wrench[targets, :3]
    axis = towards_spindle(path)[targets]
    across = np.linalg.norm(force - axis * np.einsum("ni,ni->n", force, axis)[:, None], axis=1)
    rpm = settings.log.spindle_rpm or cell.force_log.form.spindle_rpm
    power, sections = _cut(across, path.toolpath.feed[targets], cell.cutting, rpm)
    return TakenAsGiven(robot, place, float(np.median(across)), power, sections, _unstated(loaded),
                        direction=_direction(loaded))


def _direction(loaded: LoadedPath) -> str:
    """The mean force against the feed, which whoever knows the cut can compare: a sensor that is turned shows another cut."""
    found = cut_direction(loaded.path, loaded.forces.wrench[:, :3], loaded.forces.forced)
    return "" if found is None else f"on average {found.words}" + (f", as in {found.looks}" if found.looks else "")


def _unstated(loaded: LoadedPath) -> str:
    """What is in no sigma since cell.yaml does not state it: of a measured part that was learned from the robot's part is."""
    cell, measured = loaded.path.cell, loaded.forces.unknown is None
    seat = measured and cell.force_log.form.mounting_std_deg is None
    robot = cell.accuracy is None and loaded.learned is None
    return ", ".join(["how the force sensor is turned (force_log.mounting_std_deg)"] * seat
                     + ["where the robot stands without load (accuracy)"] * robot)


def _cut(across: Array, feed: Array, cutting: CuttingFile, rpm: float | None) -> tuple[float | None, dict[str, float]]:
    """Power [W] and sections [mm^2] in the middle, of forces across the axis (n,) [N] at a feed (n,) [m/s]."""
    known = np.isfinite(feed) & (feed > 0)
    if not (rpm and cutting.tool_diameter_mm and known.any()):
        return None, {}
    watts = ACROSS * across[known] * np.pi * 1e-3 * cutting.tool_diameter_mm * rpm / 60
    chip = 1e3 * feed[known] * 60 / rpm / (cutting.teeth or TEETH) * np.sqrt(ENGAGED)
    return float(np.median(watts)), {
        name: float(np.median(watts / (MATERIALS[name].specific * chip**-MATERIALS[name].exponent * feed[known])))
        for name in ((cutting.material,) if cutting.material else USUAL)}
