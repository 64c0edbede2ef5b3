"""The RAPID program that drives the robot through a plan and waits for the operator at every load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding, one_line
from identification.common.shipped import shipped
from identification.design.dead_weights import in_words
from identification.design.domain import Domain
from identification.design.sheet import Sheet
from identification.model.cell import Cell
from identification.model.inverse import inverse, nearest_solution
from identification.model.kinematics import forward
from identification.model.rotations import Frame, matrix_to_quaternion

Array = NDArray[np.float64]
TEMPLATE = "design_program.mod.j2"
# External axes that the controller does not have, or that are not active (RAPID manual, extjoint).
UNUSED = "[9E9,9E9,9E9,9E9,9E9,9E9]"
# Where the robot comes from and leaves to: the TCP this far outwards and up; the first that the arm reaches.
RETREATS_M = ((0.0, 0.15), (-0.1, 0.1), (-0.15, 0.0), (0.0, 0.05), (-0.05, 0.0))
# Characters that the pendant shows.
LONGEST_PROMPT = 80
# No joint turns farther than this on the last stretch: the retreat is in the same configuration.
LARGEST_TURN = np.radians(45.0)


@dataclass(frozen=True)
class RapidProgram:
    """content: the module's file."""

    content: bytes
    findings: tuple[Finding, ...]


def approaches(domain: Domain, theta: Array) -> Array:
    """Angles (V, 6) [rad] above or behind each visit's pose (V, 6), the tool not turned; NaN where none fits."""
    cell = domain.rig.cell
    flange = forward(cell.robot, theta, Frame.identity())
    tcp = forward(cell.robot, theta, cell.flange_from_tcp).position
    outwards = tcp * np.array([1.0, 1.0, 0.0]) / np.maximum(np.linalg.norm(tcp[:, :2], axis=1, keepdims=True), 1e-9)
    result = np.full_like(theta, np.nan)
    for out, up in RETREATS_M:
        missing = np.isnan(result[:, 0])
        moved = Frame(flange.rotation, flange.position + out * outwards + np.array([0.0, 0.0, up]))
        angles, branch = nearest_solution(cell.robot, inverse(cell.robot, moved), theta)
        fits = (branch >= 0) & (np.abs(angles - theta).max(axis=1) < LARGEST_TURN)
        fits[fits] &= (cell.robot.limit_excess(angles[fits]) <= 0).all(axis=1)
        result[missing & fits] = angles[missing & fits]
    return result


def rapid_program(domain: Domain, sheet: Sheet, name: str, comments: list[str]) -> RapidProgram:
    """The module that visits the sheet's poses; name: of the module, made an identifier; comments: at its head."""
    import jinja2

    cell = domain.rig.cell
    behind = approaches(domain, sheet.theta)
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(shipped("rapid_templates")), trim_blocks=True,
                                     lstrip_blocks=True,
                                     undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    findings = []
    tool = _tool(cell)
    if "data" not in tool:
        findings.append(Finding(
            "CS1603", "note", "the program moves with tool0: cell.yaml states no mass and centre of mass of the tool",
            file=str(cell.source), hint="give tool.mass_kg and tool.centre_of_mass_mm, or put your own tooldata in the "
            "program: the controller needs the load to move and stand well"))
    lost = [sheet.label[i] for i in np.flatnonzero(np.isnan(behind).any(axis=1))]
    if lost:
        findings.append(Finding(
            "CS1604", "warning", f"no retreat within the joint limits for {', '.join(lost)}: the robot drives there and away "
            "by a direct joint move", hint="check the way in manual mode"))
    holds = any(unit.carries != "nothing" for unit in cell.units or ())
    if holds:
        findings.append(Finding(
            "CS4600", "note", "the external axes stay where they stand when the program starts; poses and loads are in the "
            "robot's base, wherever its track stands", file=str(cell.source), hint="park them before the start"))
    text = environment.get_template(TEMPLATE).render(
        holds=holds, units="jStart.extax" if holds else UNUSED,
        module=_identifier(name), header=True, comments=[one_line(line) for line in comments], tool=tool,
        fast="v200", slow="v20",
        visits=[_visit(sheet, number, behind[number]) for number in range(len(sheet.label))])
    return RapidProgram(text.encode("ascii"), tuple(findings))


def _visit(sheet: Sheet, number: int, behind: Array) -> dict[str, Any]:
    label = sheet.label[number]
    prompts = []
    for row in np.flatnonzero(sheet.visit == number):
        force = sheet.force[row]
        dwell = f"{sheet.dwell[row]:g}"
        ask, applied = f"{label}: {_load(force, 1)}. Then hold {dwell} s", _load(force, 0)
        if sheet.hung:
            ask, applied = _weights(sheet, label, int(row)), in_words(sheet.hung[row]) if sheet.hung[row] else "no weights"
        prompts.append({"ask": ask, "wait_s": dwell,
                        "then": f"{label}, row {row + 1}, {applied}: write down dx dy dz and the time"[:LONGEST_PROMPT]})
    visit: dict[str, Any] = {"label": label, "number": number + 1, "of": len(sheet.label),
                             "joints": np.degrees(sheet.theta[number]).tolist(), "prompts": prompts}
    if np.isfinite(behind).all():
        visit["approach"] = np.degrees(behind).tolist()
    return visit


def _weights(sheet: Sheet, label: str, row: int) -> str:
    """What the operator does with the weights, as short as a prompt must be."""
    still = f". Still for {sheet.dwell[row]:g} s"
    text = f"{label}: {sheet.handling(row)}{still}"
    return text if len(text) <= LONGEST_PROMPT else f"{label}: change to {sum(sheet.hung[row]):g} kg in all{still}"


def _load(force: Array, digits: int) -> str:
    """A force [N] as the operator sets it; digits: of one along a line of its own, few where the prompt is long."""
    if not force.any():
        return "no load"
    if np.count_nonzero(force) == 1:
        axis = int(np.argmax(np.abs(force)))
        return f"F{'xyz'[axis]} = {force[axis]:+g} N"
    return f"F = ({' '.join(f'{part + 0.0:.{digits}f}' for part in force)}) N"


def _tool(cell: Cell) -> dict[str, Any]:
    if cell.tool_mass is None or cell.tool_centre is None:
        return {"name": "tool0"}
    return {"name": "tMeasure", "data": {
        "position": (1e3 * cell.flange_from_tcp.position).tolist(),
        "quaternion": matrix_to_quaternion(cell.flange_from_tcp.rotation).tolist(),
        "mass": f"{cell.tool_mass:g}", "cog": (1e3 * cell.tool_centre).tolist()}}


def _identifier(name: str) -> str:
    """A RAPID identifier: a letter, then letters, digits and _, at most 32."""
    kept = "".join(letter if letter.isascii() and (letter.isalnum() or letter == "_") else "_" for letter in name)
    return (kept if kept[:1].isalpha() else "M" + kept)[:32]
