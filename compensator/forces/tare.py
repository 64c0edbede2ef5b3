"""Payload and bias of a force sensor from readings taken still, in several orientations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.payload import TURN, Payload, estimate_payload, interval_factor, turns
from identification.common.findings import Finding, counted, error
from identification.model.cell import Cell
from identification.model.gravity import FREE_FALL, fall_in_base
from identification.model.kinematics import forward
from identification.model.rotations import Frame

Array = NDArray[np.float64]

# Readings whose joints differ by less than this [rad] from the first of their group are one orientation; a group of less than
# this share of the largest one was logged on the way between two.
SAME, FEW = 3e-4, 0.1
# Noise of one sample of a sensor without contact [N], at most.
RESTLESS = 30.0


@dataclass(frozen=True, eq=False)
class Stills:
    """payload in the log's frame; centre, centre_std (3,) [m] in the flange frame, None where it is not separated. bias,
    bias_std (6,) as logged. orientations: how many. findings."""

    payload: Payload
    centre: Array | None
    centre_std: Array | None
    bias: Array
    bias_std: Array
    orientations: int
    findings: tuple[Finding, ...]


def still_payload(log: ForceLog, cell: Cell) -> Stills:
    """Payload and bias from a log taken still at several joint angles.

    Raises CompstiffError: CS3037 (a log in the base frame, or without joint angles), CS3034 (the orientations do not tell the
    mass from the bias).
    """
    form = cell.force_log
    if form.kind == "base":
        raise error("CS3037", "force_log.frame is 'base': what a sensor shows without contact turns with it", file=log.source,
                    hint="state the sensor's frame in cell.yaml, and log its own readings")
    if log.key != "joints":
        raise error("CS3037", f"still readings need the joint angles they were taken at, this log has {log.key}",
                    file=log.source, hint="log q1_deg ... q6_deg beside the forces")
    group = _groups(log.place)
    size = np.bincount(group, log.weight)
    kept = np.flatnonzero(size >= FEW * size.max())
    # The spindle stands still.
    findings = [finding for finding in log.findings if finding.code not in ("CS3027", "CS3028", "CS3035")]
    between = int(size.sum() - size[kept].sum())
    if between:
        findings.append(Finding("CS3038", "note", f"{counted(between, 'sample')} between the orientations not used",
                                file=log.source))
    loads = form.sign * np.concatenate([log.force, log.moment], axis=1)
    mean = np.array([np.average(loads[group == k], axis=0, weights=log.weight[group == k]) for k in kept])
    restless = max(float(np.sqrt(np.average((loads[group == k, :3] - mean[index, :3]) ** 2, axis=0,
                                            weights=log.weight[group == k]).sum())) for index, k in enumerate(kept))
    if restless > RESTLESS:
        raise error("CS3037", f"the force varies by {restless:.0f} N (1 sigma) while the joints stand still, at most "
                    f"{RESTLESS:g} N are those of a sensor without contact", file=log.source,
                    hint="log with the spindle off and the tool free; load tests are for compstiff identify")
    theta = np.array([log.place[group == k].mean(axis=0) for k in kept])
    flange_from_log = cell.flange_from_tcp
    if form.kind == "sensor" and form.flange_from_sensor is not None:
        flange_from_log = form.flange_from_sensor
    base_from_log = forward(cell.robot, theta, Frame.identity()) @ flange_from_log
    fall = base_from_log.inverse().turn(fall_in_base(cell.world_from_base))
    found = estimate_payload(fall, mean, has_moment=log.has_moment)
    turn = np.degrees(turns(fall))
    if found is None:
        raise error("CS3034", f"{counted(len(mean), 'orientation')} that turn the sensor against gravity by {turn[0]:.1f} deg "
                    f"(RMS) do not tell its payload from its bias; {np.degrees(TURN):.1f} deg are needed", file=log.source,
                    hint="add still readings with the spindle tilted, best by 90 deg and to both sides")
    if found.mass < -3 * found.mass_std:
        raise error("CS3034", f"the payload would be {found.mass:.2f} kg: forces point up where they should point down",
                    file=log.source, hint="check force_log.sign and the sensor's frame in cell.yaml")
    if found.mass <= 3 * found.mass_std:
        findings.append(Finding("CS3034", "warning", f"a payload of {found.mass:.3f} +- {found.mass_std:.3f} kg is not told "
                                "from none: none is written", file=log.source,
                                hint="does the log have its weight removed already?"))
    if found.centre is None and log.has_moment:
        findings.append(Finding("CS3034", "warning", f"the centre of mass is not estimated: {len(mean)} orientations, the "
                                f"least turn {turn[1]:.1f} deg over two directions", file=log.source,
                                hint="tilt the spindle about a second axis too, three orientations or more"))
    force_std = found.mass_std * FREE_FALL
    if force_std > 10:
        findings.append(Finding("CS3034", "warning", f"the payload is uncertain by {force_std:.0f} N (1 sigma): as much false "
                                "cutting force", file=log.source, hint="more orientations, farther apart"))
    centre = centre_std = None
    if found.centre is not None and found.centre_std is not None:
        centre = flange_from_log.apply(found.centre)
        centre_std = np.sqrt(flange_from_log.rotation**2 @ found.centre_std**2)
    return Stills(found, centre, centre_std, form.sign * found.bias, found.bias_std, len(mean), tuple(findings))


def _groups(theta: Array) -> NDArray[np.intp]:
    """Number (n,) of the group of consecutive rows with equal joint angles each row belongs to."""
    moved = np.flatnonzero(np.abs(np.diff(theta, axis=0)).max(axis=1) > SAME / 10) + 1
    starts = [0]
    for row in (*moved, len(theta)):
        # A slow creep of small steps ends a group too.
        inside = np.flatnonzero(np.abs(theta[starts[-1]:row] - theta[starts[-1]]).max(axis=1) > SAME)
        while len(inside):
            starts.append(starts[-1] + int(inside[0]))
            inside = np.flatnonzero(np.abs(theta[starts[-1]:row] - theta[starts[-1]]).max(axis=1) > SAME)
    label = np.zeros(len(theta), dtype=np.intp)
    label[starts[1:]] = 1
    return np.cumsum(label)


def as_yaml(stills: Stills, source: str) -> str:
    """The lines for cell.yaml."""
    lines = [f"# Payload and bias from {Path(source).name}, {stills.orientations} still orientations (compstiff tare).",
             "# Copy these keys to force_log in cell.yaml.", "force_log:",
             f"  bias_n: [{', '.join(f'{x:.4f}' for x in stills.bias[:3])}]"]
    payload = f"mass_kg: {stills.payload.mass:.4f}"
    if stills.centre is not None:
        lines.append(f"  bias_nm: [{', '.join(f'{x:.5f}' for x in stills.bias[3:])}]")
        payload += f", centre_of_mass_mm: [{', '.join(f'{1e3 * x:.2f}' for x in stills.centre)}]"
    if stills.payload.mass > 3 * stills.payload.mass_std:
        lines += ["  weight: in_log", f"  payload: {{{payload}}}"]
    return "\n".join(lines) + "\n"


def summary(stills: Stills) -> dict[str, Any]:
    """The estimates, JSON values: each with standard deviation and 95 % interval (Student)."""
    found = stills.payload

    def one(value: float, std: float, dof: int) -> dict[str, Any]:
        half = interval_factor(dof) * std
        return {"estimate": value, "std": std, "interval_95": [value - half, value + half]}

    result: dict[str, Any] = {
        "orientations": stills.orientations, "mass_kg": one(found.mass, found.mass_std, found.force_dof),
        "bias_n": [one(float(stills.bias[k]), float(stills.bias_std[k]), found.force_dof) for k in range(3)],
        "bias_nm": None, "centre_of_mass_mm": None, "force_scatter_n": found.force_scatter, "moment_scatter_nm": None}
    if stills.centre is not None and stills.centre_std is not None:
        result |= {
            "bias_nm": [one(float(stills.bias[k]), float(stills.bias_std[k]), found.moment_dof) for k in range(3, 6)],
            "centre_of_mass_mm": [one(1e3 * float(x), 1e3 * float(s), found.moment_dof)
                                  for x, s in zip(stills.centre, stills.centre_std, strict=True)],
            "moment_scatter_nm": found.moment_scatter}
    return result
