"""Numbers of cell.yaml that no cell has: masses in grams, a sigma in millimetres, a spindle in thousands of revolutions."""

from __future__ import annotations

import numpy as np

from identification.common.findings import Finding
from identification.common.yaml_source import read_yaml
from identification.model.cell import Cell
from identification.model.robot_file import RobotFile

# What tools, deflection sensors and spindles have [mm, um, rpm]; engineering judgement: three decades about the usual.
FARTHEST_TCP, SIGMA, SPINDLE = 3000.0, (0.02, 200.0), (60.0, 200e3)
# A sensor that is not at the flange itself lies at least so far from it [mm].
NEAREST_SENSOR = 2.0


def odd_sizes(cell: Cell) -> list[Finding]:
    """A warning (CS0119) each."""
    sigma, payload = 1e6 * cell.noise.deflection, read_yaml(cell.robot.source, RobotFile).data_sheet.payload_kg
    tcp, rpm = 1e3 * float(np.linalg.norm(cell.flange_from_tcp.position)), cell.force_log.form.spindle_rpm
    sensor = cell.force_log.flange_from_sensor
    away = 0.0 if sensor is None else 1e3 * float(np.linalg.norm(sensor.position))
    said = []
    for mass, name in {cell.force_log.mass: "force_log.payload", cell.tool_mass: "tool"}.items():
        if payload is not None and mass is not None and mass > payload:
            said.append((f"{name}.mass_kg is {mass:g}, and {cell.robot.name} carries {payload:g} kg",
                         "it is in kilograms: is it in grams or newtons?"))
    if tcp > FARTHEST_TCP:
        said.append((f"the TCP is {tcp:.4g} mm from the flange", "tool.position_mm is in millimetres: is it in micrometres?"))
    if not (SIGMA[0] <= sigma.min() and sigma.max() <= SIGMA[1]):
        said.append((f"measurement.deflection_std_um is {sigma.min():.3g} to {sigma.max():.3g} um",
                     "1 sigma of one reading in micrometres: 2 is usual; is it in millimetres?"))
    if rpm is not None and not SPINDLE[0] <= rpm <= SPINDLE[1]:
        said.append((f"force_log.spindle_rpm is {rpm:g}", "revolutions a minute: is it in thousands, or in hertz?"))
    if 0 < away < NEAREST_SENSOR:
        said.append((f"force_log.sensor_position_mm is {away:.3g} mm from the flange", "is it in metres?"))
    return [Finding("CS0119", "warning", what, file=str(cell.source), hint=hint) for what, hint in said]
