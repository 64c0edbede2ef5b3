"""From what a user asks for to the task that is solved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.cell import Cell
from identification.design.criteria import Criterion, a_criterion, d_criterion, e_criterion, i_criterion
from identification.design.domain import Domain
from identification.design.exchange import Demand, free_demand
from identification.design.information import Instrument, instrument
from identification.design.loads import Slot, slot
from identification.design.milling import MillingPoses, prediction_weight
from identification.design.procedure import Task
from identification.findings import Finding, error
from identification.model.robot import RobotModel
from identification.priors import PriorModel

Array = NDArray[np.float64]
DEFAULT_RUNS = 8


@dataclass(frozen=True)
class Request:
    """What the command line says, lengths in millimetres and angles in degrees as it says them; None where it says nothing."""

    measurements: int | None = None
    criterion: str | None = None
    protocol: str = "cycle"
    axes: str = "xyz"
    every_axis: bool = False
    force_n: float = 300.0
    positions_mm: tuple[tuple[float, float, float], ...] = ()
    box_mm: tuple[float, ...] | None = None
    phi_deg: float = 80.0
    replicates: int = 1
    preset: str | None = None
    measured: Path | None = None


@dataclass(frozen=True, eq=False)
class Prepared:
    """task, and about what it is linearised; before: in words, what is known before the runs."""

    task: Task
    rig: Instrument
    before: str
    place: str
    weight: Array | None
    findings: tuple[Finding, ...]


def default_position(robot: RobotModel) -> Array:
    """In front of the robot at the height of axis 2, 65 % of the stretched arm out (3,) [m]."""
    reach = robot.a[2] + float(np.hypot(robot.a[3], robot.d[3]))
    return np.array([robot.a[1] + 0.65 * reach, 0.0, robot.d[0]])


def prepare(cell: Cell, wanted: Request, milling: MillingPoses | None) -> Prepared:
    """The task. Raises CompstiffError (CS1602) for the criterion I without a toolpath."""
    rig, precision, before, findings = _known(cell, wanted)
    weight = None if milling is None else prediction_weight(rig, milling)
    positions, box, place = _place(cell.robot, wanted, milling)
    slots, demand = _runs(wanted)
    domain = Domain(rig, slots, positions, box, phi=None if wanted.phi_deg >= 180 else float(np.radians(wanted.phi_deg)))
    task = Task(domain, _criterion(cell, wanted, weight, rig), precision, demand, wanted.replicates)
    return Prepared(task, rig, before, place, weight, findings)


def _known(cell: Cell, wanted: Request) -> tuple[Instrument, Array, str, tuple[Finding, ...]]:
    """Instrument, precision (6, 6) of ln c before the runs, and in words where it comes from."""
    if wanted.measured is not None:
        from identification.fit import fit_stiffness
        from identification.measurements import read_measurements

        fit = fit_stiffness(cell, read_measurements(wanted.measured, cell.robot))
        model = fit.model
        return (instrument(cell, model.compliance), np.asarray(np.linalg.inv(model.covariance[:6, :6]), dtype=float),
                f"what {wanted.measured} says already", fit.findings)
    rig = instrument(cell)
    prior = PriorModel(cell.prior, "gaussian" if wanted.preset == "paper" else "lognormal")
    std = cell.prior.relative_std
    words = f"{std[0]:g}" if np.all(std == std[0]) else ", ".join(f"{one:g}" for one in std)
    return rig, prior.precision(np.log(rig.compliance)), f"the prior (relative std {words})", ()


def _criterion(cell: Cell, wanted: Request, weight: Array | None, rig: Instrument) -> Criterion:
    kind = wanted.criterion or ("I" if weight is not None else "A" if wanted.preset else "D")
    if kind == "I":
        if weight is None:
            raise error("CS1602", "the criterion I is the mean variance over a milling program, and there is none",
                        file=str(cell.source), hint="name it with --toolpath")
        return i_criterion(weight)
    if kind == "A":
        return a_criterion(1 / rig.compliance if wanted.preset else None)
    return d_criterion() if kind == "D" else e_criterion()


def _place(robot: RobotModel, wanted: Request, milling: MillingPoses | None) -> tuple[Array | None, Array | None, str]:
    """Positions (K, 3) [m] or box (2, 3) [m], and in words."""
    if wanted.box_mm is not None:
        corners = 1e-3 * np.array(wanted.box_mm).reshape(2, 3)
        box = np.stack([corners.min(axis=0), corners.max(axis=0)])
        return None, box, "anywhere in the box " + " to ".join("({:g}, {:g}, {:g})".format(*1e3 * c) for c in box) + " mm"
    if wanted.positions_mm:
        positions, origin = 1e-3 * np.array(wanted.positions_mm), ""
    elif milling is not None:
        positions, origin = np.round(milling.tcp.mean(axis=0, keepdims=True), 3), ", the middle of the program"
    else:
        positions, origin = np.round(default_position(robot)[None], 2), ", in front of the robot (--position names another)"
    return positions, None, "TCP at " + ", ".join("({:g}, {:g}, {:g})".format(*np.round(1e3 * p, 3)) for p in positions) + (
        f" mm in the base frame{origin}")


def _runs(wanted: Request) -> tuple[tuple[Slot, ...], Demand]:
    """The slots, and how many runs of which. The paper's plan: four orientations, three loads along y and two along x, so that
    one orientation is loaded along both."""
    if wanted.preset == "paper":
        slots = tuple(slot(axes, "single", wanted.force_n) for axes in ("yx", "y", "x"))
        return slots, Demand(np.arange(3), np.array([0, 1, 1, 2]))
    count = wanted.measurements or (4 if wanted.preset else DEFAULT_RUNS)
    if wanted.preset == "outlook":
        return (slot("xyz", "single", wanted.force_n),), free_demand(1, count)
    slots = (slot(wanted.axes, wanted.protocol, wanted.force_n),) if wanted.every_axis else tuple(
        slot(axis, wanted.protocol, wanted.force_n) for axis in wanted.axes)
    return slots, free_demand(len(slots), count)
