"""Writes a case as the files of the contract (docs/formats.md): cell.yaml, robot.yaml, measurements.csv."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tests.virtual_cell.arm_model import robot_links
from tests.virtual_cell.inverse import LIMITS, WINDOW

if TYPE_CHECKING:
    from tests.virtual_cell.cell import Case

PRIOR = (2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6)    # [N m/rad] the paper's Table 1
# alpha [deg], a [mm], d [mm], offset [deg]: identification/model/robots/irb6660-205-1.90.yaml
GEOMETRY = ((0, 0, 814.5, 0), (-90, 300, 0, -90), (0, 700, 0, 0), (-90, 280, 893, 0), (90, 0, 0, 0), (-90, 0, 200, 180))


def _numbers(values: np.ndarray | tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{float(value) + 0.0:.9g}" for value in values) + "]"


def robot_yaml() -> str:
    """The IRB 6660 of this cell: the built-in file's, with the masses of arm_model.py."""
    lines = ["# The IRB 6660 of tests/virtual_cell. Geometry as the built-in robot; masses and centres made up for tests.",
             "name: irb6660-virtual", "manufacturer: ABB", "load_path: drive", "joints:"]
    for (alpha, a, d, offset), limits in zip(GEOMETRY, LIMITS, strict=True):
        lines.append(f"  - {{alpha_deg: {alpha}, a_mm: {a}, d_mm: {d}, offset_deg: {offset}, limits_deg: {_numbers(limits)}, "
                     "speed_deg_s: 120, acceleration_deg_s2: 400}")
    lines += [f"coupling: {{joint: 3, driven_by: 2, ratio: -1, window_deg: {_numbers(WINDOW)}}}", "prior:",
              f"  stiffness_nm_per_rad: {_numbers(PRIOR)}", "  relative_std: 2.0",
              "links:                             # made up for tests; the parallel rod is shared out between links 2 and 3"]
    lines += [f"  - {{mass_kg: {mass:g}, centre_of_mass_mm: {_numbers(1e3 * centre)}}}" for mass, centre in robot_links()]
    return "\n".join(lines) + "\n"


def cell_yaml(case: Case) -> str:
    """The cell with its nominal noise."""
    tool, noise = case.tool, case.noise
    three = "[{0:g}, {0:g}, {0:g}]"
    stated = [f"  {key}: {form.format(value)}" for key, form, value in (
        ("deflection_std_um", three, noise.stated_sensor_um), ("force_std_n", three, noise.stated_force_n),
        ("force_relative_std", "{0:g}", noise.stated_force_relative),
        ("pose_offset_std_um", three, noise.stated_pose_offset_um)) if value is not None]
    return "\n".join([
        "# A virtual cell (tests/virtual_cell): simulated, all values made up for tests.", "robot: robot.yaml", "tool:",
        f"  position_mm: {_numbers(1e3 * np.array(tool.tcp))}", "  quaternion: [1, 0, 0, 0]", f"  mass_kg: {tool.mass:g}",
        f"  centre_of_mass_mm: {_numbers(1e3 * np.array(tool.centre))}", *(["measurement:", *stated] if stated else [])]) + "\n"


def measurements_csv(case: Case) -> str:
    """The rows of the case, validate rows last."""
    names = [*(f"q{i}_deg" for i in range(1, 7)), "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um", "time_s", "dwell_s",
             "pose", "purpose"]
    lines = ["# Simulated by tests/virtual_cell", ",".join(names)]
    for row, angles in enumerate(np.degrees(case.theta)):
        lines.append(",".join([
            *(f"{x:.9g}" for x in angles), *(f"{x + 0.0:.9g}" for x in case.wrench[row, :3]),
            *(f"{x + 0.0:.9g}" for x in case.deflection_um[row]), f"{case.time[row]:g}", f"{case.dwell[row]:g}", case.pose[row],
            "validate" if case.validate[row] else "identify"]))
    return "\n".join(lines) + "\n"


def write(case: Case, folder: Path) -> tuple[Path, Path]:
    """Writes the three files into the folder; returns the paths of cell.yaml and measurements.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {"robot.yaml": robot_yaml(), "cell.yaml": cell_yaml(case), "measurements.csv": measurements_csv(case)}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "cell.yaml", folder / "measurements.csv"
