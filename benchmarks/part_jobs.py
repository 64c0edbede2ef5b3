"""The jobs that are milled in the virtual cell: part, cutter, and how cell.yaml describes the cut."""

from __future__ import annotations

from dataclasses import dataclass, field

from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import Part, slot_and_pocket

# Linear-edge coefficients of a carbon steel and Ti6Al4V, rounded (Altintas, Manufacturing Automation, ch. 2).
STEEL = EndMill(shear_n_mm2=(1800.0, 700.0, 300.0), edge_n_mm=(25.0, 40.0, 2.0), spindle_rpm=4500.0, feed_mm_s=18.0)
TITANIUM = EndMill(shear_n_mm2=(1700.0, 600.0, 300.0), edge_n_mm=(24.0, 43.0, 3.0), spindle_rpm=2400.0, feed_mm_s=9.6)


@dataclass(frozen=True)
class PartJob:
    """Distance of targets, stock on the wall and contact along the tool's axis [mm]; material as cell.yaml names it."""

    spacing_mm: float = 1.5
    depth_mm: float = 1.5
    contact_mm: float = 4.0
    cutter: EndMill = field(default_factory=EndMill)
    material: str = "aluminium"

    @property
    def part(self) -> Part:
        return slot_and_pocket(self.spacing_mm, self.depth_mm, self.contact_mm)

    @property
    def cut_yaml(self) -> str:
        """What cell.yaml says of the cut, behind its force_log."""
        return (f"  spindle_rpm: {self.cutter.spindle_rpm:g}\ncutting: {{material: {self.material}, "
                f"tool_diameter_mm: {2 * self.cutter.radius_mm:g}, contact_mm: {self.contact_mm:g}}}\n")


JOBS = {
    "1.5 mm": PartJob(),
    "0.5 mm": PartJob(0.5),
    "1.5 mm, thin": PartJob(1.5, 0.4, 10.0),
    "0.5 mm, thin": PartJob(0.5, 0.4, 10.0),
    "steel": PartJob(0.5, 0.8, cutter=STEEL, material="steel"),
    "titanium": PartJob(0.5, 0.8, cutter=TITANIUM, material="titanium"),
}
