"""Payload and bias of a force sensor from readings taken still, in several orientations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.forces.log import ForceLog
from compensator.forces.payload import TURN, Payload, estimate_payload, interval_factor, turns
from compensator.forces.still_doubts import said_of_centre, said_of_pull
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding, counted, error, one_line, verb
from identification.common.quantities import two_sigma
from identification.model.cell import FARTHEST_CENTRE, Cell, ForceLogFrame
from identification.model.gravity import FREE_FALL, fall_in_base
from identification.model.kinematics import forward
from identification.model.rotations import Frame

# Readings whose joints differ by less than this [rad] from the first of their group are one orientation; a group of less than
# this share of the largest one was logged on the way between two, unless it stood so long [s].
SAME, FEW, STOOD = 3e-4, 0.1, 1.0
# So many rows are looked at for the end of a group, then twice as many each time.
LOOKED_AT = 64
# Noise of one sample of a sensor without contact [N], at most.
RESTLESS = 30.0
# A payload that is uncertain by more than this [N] (1 sigma) is worth a warning.
UNCERTAIN = 10.0
# Where the force changes by so much from one orientation to the next [N], RMS, at most this share of it is no weight; and the
# mass is within these shares of the one that cell.yaml states (engineering judgement: a tool has parts before its sensor).
CHANGES, NO_WEIGHT, OF_STATED = 5.0, 0.25, (0.2, 1.25)
BETWEEN = f"not used: between the orientations, or of one that has less than {100 * FEW:g} % of the samples of the longest"
# What is said of a spindle that turns, and of a log without a break; here it stands still, and each orientation may be a log of
# its own.
OF_A_PASS = ("CS3025", "CS3027", "CS3028", "CS3035")


@dataclass(frozen=True, eq=False)
class Stills:
    """payload in the log's frame; centre, centre_std (3,) [m] in the flange frame, None where it is not separated. bias,
    bias_std (6,) [N, N m] as logged. orientations: how many."""

    payload: Payload
    centre: Array | None
    centre_std: Array | None
    bias: Array
    bias_std: Array
    orientations: int
    findings: tuple[Finding, ...]

    def __post_init__(self) -> None:
        read_only(self.bias, self.bias_std)
        if self.centre is not None and self.centre_std is not None:
            read_only(self.centre, self.centre_std)

    @property
    def of_a_weight(self) -> bool:
        """Whether a weight is what the sensor mostly felt."""
        return all(finding.code != "CS3048" for finding in self.findings)

    def as_dict(self) -> dict[str, Any]:
        """Each estimate with standard deviation and 95 % interval (Student)."""
        payload, bias = self.payload, list(zip(self.bias.tolist(), self.bias_std.tolist(), strict=True))
        values: dict[str, Any] = {
            "orientations": self.orientations, "mass_kg": _estimate(payload.mass, payload.mass_std, payload.force_dof),
            "bias_n": [_estimate(*axis, payload.force_dof) for axis in bias[:3]],
            "bias_nm": None, "centre_of_mass_mm": None, "force_scatter_n": payload.force_scatter, "moment_scatter_nm": None}
        if self.centre is not None and self.centre_std is not None:
            values |= {
                "bias_nm": [_estimate(*axis, payload.moment_dof) for axis in bias[3:]],
                "centre_of_mass_mm": [_estimate(1e3 * x, 1e3 * std, payload.moment_dof) for x, std in zip(
                    self.centre.tolist(), self.centre_std.tolist(), strict=True)],
                "moment_scatter_nm": payload.moment_scatter}
        return values

    def lines(self) -> list[str]:
        """The estimates, +- two sigma."""
        shown = [f"{self.orientations} still orientations (+-: 2 sigma)",
                 f"mass    {self.payload.mass:9.3f} +- {two_sigma(self.payload.mass_std):.3f} kg"]
        named = [("f", axis, "N") for axis in "xyz"]
        if self.centre is not None and self.centre_std is not None:
            shown += [f"centre {axis} {1e3 * x:8.2f} +- {1e3 * two_sigma(std):.2f} mm (flange frame)"
                      for axis, x, std in zip("xyz", self.centre, self.centre_std, strict=True)]
            named += [("m", axis, "N m") for axis in "xyz"]
        return shown + [f"bias {kind}{axis} {self.bias[k]:8.3f} +- {two_sigma(self.bias_std[k]):.3f} {unit}"
                        for k, (kind, axis, unit) in enumerate(named)]

    def yaml(self, source: Path) -> str:
        """The keys for force_log in cell.yaml. source: the log that they come from."""
        text = [f"# Payload and bias from {one_line(source.name)}, {self.orientations} still orientations (compstiff tare).",
                "# Copy these keys to force_log in cell.yaml.", "force_log:",
                f"  bias_n: [{', '.join(f'{x:.4f}' for x in self.bias[:3])}]"]
        payload = f"mass_kg: {self.payload.mass:.4f}"
        if self.centre is not None:
            text.append(f"  bias_nm: [{', '.join(f'{x:.5f}' for x in self.bias[3:])}]")
            payload += f", centre_of_mass_mm: [{', '.join(f'{1e3 * x:.2f}' for x in self.centre)}]"
        if self.payload.told_from_none:
            text += ["  weight: in_log", f"  payload: {{{payload}}}"]
        return "\n".join(text) + "\n"


def _estimate(value: float, std: float, dof: int) -> dict[str, Any]:
    half = interval_factor(dof) * std
    return {"estimate": value, "std": std, "interval_95": [value - half, value + half]}


def still_payload(log: ForceLog, cell: Cell) -> Stills:
    """Payload and bias from a log taken still at several joint angles.

    Raises CompstiffError: CS3037 (a log in the base frame, without joint angles, or with forces that vary as under load),
    CS3034 (the orientations do not tell the mass from the bias), CS3042 (the mass is negative), CS3047 (the centre is too far).

    >>> cell = compstiff.read_cell("tare.yaml")
    >>> stills = compstiff.still_payload(compstiff.read_force_log("still.csv", cell.force_log.form), cell)
    >>> stills.orientations
    6
    """
    form = cell.force_log
    _check_log(log, form)
    readings = _still_readings(log, form.sign)
    if readings.restlessness > RESTLESS:
        raise error("CS3037", f"the force varies by {readings.restlessness:.0f} N (1 sigma) while the joints stand still, at "
                    f"most {RESTLESS:g} N are those of a sensor without contact", file=log.source,
                    hint="log with the spindle off and the tool free; load tests are for compstiff identify")
    flange_from_log = cell.flange_from_tcp
    if form.kind == "sensor" and form.flange_from_sensor is not None:
        flange_from_log = form.flange_from_sensor
    base_from_log = forward(cell.robot, readings.theta, Frame.identity()) @ flange_from_log
    fall = base_from_log.inverse().turn(fall_in_base(cell.world_from_base))
    payload = _payload(fall, readings, log)
    findings = [finding for finding in log.findings if finding.code not in OF_A_PASS]
    if readings.between:
        findings.append(Finding("CS3038", "note", f"{counted(readings.between, 'sample')} {BETWEEN}", file=log.source))
    doubts = _doubts(payload, readings, log)
    if all(doubt.code == "CS3044" for doubt in doubts):     # of the centre alone, which says nothing of the forces
        doubts += said_of_pull(payload, fall, readings.theta, readings.load, log.source)
    findings += [*doubts, *_against_stated(payload, cell, log)]
    centre = centre_std = None
    if payload.centre is not None and payload.centre_std is not None:
        centre = flange_from_log.apply(payload.centre)
        centre_std = np.sqrt(flange_from_log.rotation**2 @ payload.centre_std**2)
        away = 1e3 * float(np.linalg.norm(centre))
        if away > FARTHEST_CENTRE:
            raise error("CS3047", f"the centre of mass would be {1e-3 * away:.3g} m from the flange, with a mass of "
                        f"{payload.mass:.3g} kg", file=log.source,
                        hint="moments are in newton metres, forces in newtons: is one of them in another unit?")
        findings += said_of_centre(centre, centre_std, payload, cell, flange_from_log, log.source)
    return Stills(payload, centre, centre_std, form.sign * payload.bias, payload.bias_std, len(readings.load),
                  tuple(findings))


def _check_log(log: ForceLog, form: ForceLogFrame) -> None:
    """Raises CompstiffError (CS3037) for a log in the base frame or without joint angles."""
    if form.kind == "base":
        raise error("CS3037", "force_log.frame is 'base': what a sensor shows without contact turns with it", file=log.source,
                    hint="state the sensor's frame in cell.yaml, and log its own readings")
    if log.key != "joints":
        raise error("CS3037", f"still readings need the joint angles they were taken at, this log has {log.key}",
                    file=log.source, hint="log q1_deg ... q6_deg beside the forces")


@dataclass(frozen=True, eq=False)
class _StillReadings:
    """The means over each of k still orientations: theta (k, 6) [rad] and load (k, 6) [N, N m] on the tool, log frame.
    restlessness [N]: the largest scatter of the force about its mean. between: samples on the way from one to the next."""

    theta: Array
    load: Array
    restlessness: float
    between: int


def _still_readings(log: ForceLog, sign: float) -> _StillReadings:
    group = _groups(log.place)
    samples = np.bincount(group, log.weight)
    edges = np.searchsorted(group, np.arange(len(samples) + 1))
    still = samples >= FEW * samples.max()
    if log.time is not None:
        still |= log.time[edges[1:] - 1] - log.time[edges[:-1]] >= STOOD
    kept = np.flatnonzero(still)
    loads = np.zeros((len(log.plain), 6))       # not averaged over a spindle's turns, which would reach into the next one
    loads[:, :log.plain.shape[1]] = sign * log.plain
    theta, means, scatter = [], [], []
    for number in kept:
        rows = slice(*edges[number:number + 2])
        means.append(np.average(loads[rows], axis=0, weights=log.weight[rows]))
        theta.append(log.place[rows].mean(axis=0))
        square = np.average((loads[rows, :3] - means[-1][:3]) ** 2, axis=0, weights=log.weight[rows])
        scatter.append(float(np.sqrt(square.sum())))
    return _StillReadings(np.array(theta), np.array(means), max(scatter), int(samples.sum() - samples[kept].sum()))


def _groups(theta: Array) -> NDArray[np.intp]:
    """Number (n,) of the group of consecutive rows with equal joint angles each row belongs to."""
    starts = [0]
    first, width = 0, LOOKED_AT
    while first < len(theta):
        # Against the group's first row: a slow creep of small steps ends a group too.
        far = np.abs(theta[first:first + width] - theta[starts[-1]]).max(axis=1) > SAME
        if far.any():
            starts.append(first + int(np.argmax(far)))
            first, width = starts[-1], LOOKED_AT
        else:
            first, width = first + width, 2 * width
    label = np.zeros(len(theta), dtype=np.intp)
    label[starts[1:]] = 1
    return np.cumsum(label)


def _payload(fall: Array, readings: _StillReadings, log: ForceLog) -> Payload:
    """The estimate; fall (k, 3) [m/s^2] in the log's frame. Raises CompstiffError (CS3034, CS3042)."""
    load = readings.load
    payload = estimate_payload(fall, load, has_moment=_has_moment(load, log))
    if payload is None:
        raise error("CS3034", f"{counted(len(load), 'orientation')} that {verb(len(load), 'turn')} the sensor "
                    f"against gravity by {np.degrees(turns(fall)[0]):.1f} deg (RMS) {verb(len(load), 'do')} not tell its "
                    f"payload from its bias; {np.degrees(TURN):.1f} deg are needed", file=log.source,
                    hint="add still readings with the spindle tilted, best by 90 deg and to both sides" + (
                        f"; {counted(readings.between, 'sample')} {BETWEEN}" if readings.between else ""))
    if payload.negative:
        raise error("CS3042", f"the payload would be {payload.mass:.2f} kg: forces point up where they should point down",
                    file=log.source, hint="check force_log.sign and the sensor's frame in cell.yaml")
    return payload


def _has_moment(load: Array, log: ForceLog) -> bool:
    """Columns of one value alone are of a sensor without moments."""
    return log.has_moment and bool(np.any(np.ptp(load[:, 3:], axis=0) > 0))


def _doubts(payload: Payload, readings: _StillReadings, log: ForceLog) -> list[Finding]:
    """What the orientations do not tell well."""
    findings, orientations = [], len(readings.load)
    force = readings.load[:, :3]
    change = float(np.sqrt(np.mean(np.sum((force - force.mean(axis=0)) ** 2, axis=1))))
    share = np.sqrt(payload.force_dof / orientations) * payload.force_scatter / max(change, 1e-9)
    if change > CHANGES and share > NO_WEIGHT:
        findings.append(Finding(
            "CS3048", "warning", f"from orientation to orientation the force changes by {change:.0f} N (RMS), and "
            f"{100 * min(share, 1.0):.0f} % of that is not what any weight does", file=log.source,
            hint="are the force columns in the order of the sensor's axes, the angles and their signs those of the controller, "
            "force_log.frame right, and did the tool touch nothing? Nothing is written of these numbers"))
    elif log.has_moment and not _has_moment(readings.load, log):
        findings.append(Finding("CS3044", "note", "the centre of mass is not estimated: the moments in the log never change",
                                file=log.source))
    elif not payload.told_from_none:
        findings.append(Finding("CS3043", "warning", f"a payload of {payload.mass:.3f} +- {two_sigma(payload.mass_std):.3f} "
                                "kg (2 sigma) is not told from none: none is written", file=log.source,
                                hint="does the log have its weight removed already?"))
    if payload.centre is None and _has_moment(readings.load, log) and share <= NO_WEIGHT:
        findings.append(Finding("CS3044", "warning", "the centre of mass is not estimated: "
                                f"{counted(orientations, 'orientation')}, the least turn {np.degrees(payload.turn[1]):.1f} deg "
                                f"over two directions, {np.degrees(TURN):.1f} deg are needed", file=log.source,
                                hint="tilt the spindle about a second axis too, three orientations or more"))
    force_std = payload.mass_std * FREE_FALL
    if force_std > UNCERTAIN:
        findings.append(Finding("CS3045", "warning", f"the payload is uncertain by {two_sigma(force_std):.0f} N (2 sigma): as "
                                "much false cutting force", file=log.source, hint="more orientations, farther apart"))
    return findings


def _against_stated(payload: Payload, cell: Cell, log: ForceLog) -> list[Finding]:
    """A warning (CS3049) where the mass is far from the one that cell.yaml states."""
    stated = cell.force_log.mass
    if not stated or not payload.told_from_none or OF_STATED[0] < payload.mass / stated < OF_STATED[1]:
        return []
    return [Finding("CS3049", "warning", f"a mass of {payload.mass:.3g} kg hangs on the sensor; cell.yaml states {stated:g} kg",
                    file=log.source,
                    hint="are the forces in newtons (a force in kilograms is a tenth), the sensor's gain too?")]
