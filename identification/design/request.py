"""From what a user asks for to the task that is solved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding, error
from identification.design.constraints import Margins
from identification.design.criteria import Criterion, a_criterion, d_criterion, e_criterion, i_criterion
from identification.design.dead_weights import DeadWeights, check_payload
from identification.design.discrimination import Diagnosed
from identification.design.domain import Domain
from identification.design.information import Instrument, instrument
from identification.design.loads import FREE, Slot, slot, weight_slot
from identification.design.milling import MillingPoses, prediction_weight
from identification.design.task import Demand, Task, free_demand
from identification.design.unseen import seen_by
from identification.fit.priors import PriorModel
from identification.measurements import Measurements
from identification.model.cell import Cell
from identification.model.effects_in_force import SPRINGS
from identification.model.gravity import fall_in_base
from identification.model.kinematics import forward
from identification.model.robot import RobotModel

Array = NDArray[np.float64]
DEFAULT_RUNS = 8
# Measurements whose TCPs differ by less were taken in one place [m].
ONE_PLACE_M = 0.02


@dataclass(frozen=True, eq=False)
class Request:
    """What a user asks for, named as the command's options are, lengths in millimetres, angles in degrees; None: not said.

    measurements: runs, poses with their loads (8). criterion: D, A, E, I or C (I with milling poses, else D;
    C is D over the causes too, causes.py). protocol: "cycle" or
    "single". axes: base axes the cylinder can push along, every_axis: all of them at each pose in turn; free: along a line of
    its own at each pose. force_n: largest force. dead_weight: in place of all these, levels of hung mass [kg] such as
    "20,40,20+40" (dead_weights.py). positions_mm: where the TCP may stand, or box_mm: two corners (6 numbers) it
    stays between. phi_deg: window of the tool's orientation, 180 for none. replicates: visits to each pose. preset: "paper" or
    "outlook". measured: rows after which the runs come; diagnosis: what a diagnosis of them says, whose rivals the runs shall
    tell apart. kept_back: further poses that are never fitted. Raises ValueError for what excludes each other.

    >>> compstiff.Request(measurements=8, axes="xz", force_n=200.0).protocol
    'cycle'
    """

    measurements: int | None = None
    criterion: str | None = None
    protocol: str = "cycle"
    axes: str = "xyz"
    every_axis: bool = False
    free: bool = False
    force_n: float = 300.0
    dead_weight: str | None = None
    positions_mm: tuple[tuple[float, float, float], ...] = ()
    box_mm: tuple[float, ...] | None = None
    phi_deg: float = 80.0
    replicates: int = 1
    preset: str | None = None
    measured: Measurements | None = None
    diagnosis: Diagnosed | None = None
    kept_back: int = 0

    def __post_init__(self) -> None:
        if self.dead_weight:
            DeadWeights.of(self.dead_weight)
        for wrong, reason in (
            (self.positions_mm and self.box_mm is not None, "positions_mm and box_mm exclude each other"),
            (self.measured is not None and self.preset, "preset is a whole plan: it takes nothing that was measured before"),
            (self.preset == "paper" and self.measurements, "preset paper has five measurements; leave measurements out"),
            (self.free and (self.preset or self.every_axis or self.axes != "xyz"),
             "free loads each pose along a line of its own; it takes no axes, every_axis or preset"),
            (self.dead_weight and (self.preset or self.every_axis or self.free or self.axes != "xyz"),
             "dead_weight only pulls down; it takes no axes, every_axis, free or preset"),
            (self.criterion == "C" and self.diagnosis is not None, "criterion C is for causes of any kind, diagnosis for "
             "its rival causes"),
            (self.diagnosis is not None and self.measured is None, "diagnosis belongs to measured: its rivals are fitted to "
             "that"),
        ):
            if wrong:
                raise ValueError(reason)


@dataclass(frozen=True, eq=False)
class Prepared:
    """task, and about what it is linearised; before: in words, what is known before the runs. plainer: a task without what
    makes this one's loads rich, and what that is in words, None where they are not."""

    task: Task
    rig: Instrument
    before: str
    place: str
    weight: Array | None
    findings: tuple[Finding, ...]
    plainer: tuple[Task, str] | None = None


def default_position(robot: RobotModel) -> Array:
    """In front of the robot at the height of axis 2, 65 % of the stretched arm out (3,) [m]."""
    reach = robot.a[2] + float(np.hypot(robot.a[3], robot.d[3]))
    return np.array([robot.a[1] + 0.65 * reach, 0.0, robot.d[0]])


def prepare(cell: Cell, request: Request, milling: MillingPoses | None) -> Prepared:
    """The task. Raises CompstiffError: CS1602 for the criterion I without a toolpath, CS1512 for weights over the payload."""
    if request.dead_weight:
        check_payload(DeadWeights.of(request.dead_weight), cell)
    rig, precision, before, findings = _known(cell, request)
    weight = None if milling is None else prediction_weight(rig, milling)
    positions, box, place = _place(cell, request, milling)
    slots, demand = _runs(cell, request)
    margins = Margins(phi=None if request.phi_deg >= 180 else float(np.radians(request.phi_deg)))
    domain = Domain(rig, slots, positions, box, margins)
    criterion = _criterion(cell, request, weight, rig)
    seen = seen_by(domain, precision, len(demand) * request.replicates, np.random.default_rng(0))
    if seen is not None:
        criterion = criterion.of_seen(seen)
    task = Task(domain, criterion, precision, demand, request.replicates)
    plainer = None
    if request.free or request.preset == "outlook":
        other = replace(request, preset="paper", measurements=None) if request.preset else replace(request, free=False)
        slots, demand = _runs(cell, other)
        words = "the paper's plan" if request.preset else "as many runs with loads along base axes"
        plainer = replace(task, domain=replace(domain, slots=slots), demand=demand), words
    return Prepared(task, rig, before, place, weight, (*_of_another_kind(request), *findings), plainer)


def _of_another_kind(request: Request) -> tuple[Finding, ...]:
    """CS1513: further runs are pushed, and what was measured hung."""
    if request.measured is None or request.dead_weight or not request.measured.weights:
        return ()
    return (Finding("CS1513", "warning", f"the loads of {request.measured.source} are weights that hung, those of these runs "
                    f"are pushed, by up to {request.force_n:g} N and sideways too", file=request.measured.source,
                    hint=f"{' '.join(request.measured.weights)} plans for the same weights"),)


def _known(cell: Cell, request: Request) -> tuple[Instrument, Array, str, tuple[Finding, ...]]:
    """Instrument, precision (6, 6) of ln c before the runs, and in words where it comes from."""
    if request.measured is not None:
        from identification.fit.fit import fit_stiffness

        fit = fit_stiffness(cell, request.measured)
        model = fit.model
        return (instrument(cell, model.compliance), np.asarray(np.linalg.inv(model.covariance[SPRINGS, SPRINGS]), dtype=float),
                f"what {request.measured.source} says already", fit.findings)
    rig = instrument(cell)
    prior = PriorModel(cell.prior, "gaussian" if request.preset == "paper" else "lognormal")
    std = cell.prior.relative_std
    words = f"{std[0]:g}" if np.all(std == std[0]) else ", ".join(f"{value:g}" for value in std)
    return rig, prior.precision(np.log(rig.compliance)), f"the prior (relative std {words})", ()


def _criterion(cell: Cell, request: Request, weight: Array | None, rig: Instrument) -> Criterion:
    kind = request.criterion or ("I" if weight is not None else "A" if request.preset else "D")
    if kind == "I":
        if weight is None:
            raise error("CS1602", "the criterion I is the mean variance over a milling program, and there is none",
                        file=str(cell.source), hint="name it with --toolpath")
        return i_criterion(weight)
    if kind == "A":
        return a_criterion(1 / rig.compliance if request.preset else None)
    return e_criterion() if kind == "E" else d_criterion()


def measured_place(tcp: Array) -> tuple[Array | None, Array | None]:
    """Where further runs stand when nothing is said: positions (1, 3) [m] where all TCPs (n, 3) were in one place, else the
    box (2, 3) [m] about them, which the cylinder and the sensors have evidently been able to reach."""
    box = np.stack([tcp.min(axis=0), tcp.max(axis=0)])
    if np.ptp(box, axis=0).max() < ONE_PLACE_M:
        return np.round(tcp.mean(axis=0, keepdims=True), 4), None
    return None, box


def _place(cell: Cell, request: Request, milling: MillingPoses | None) -> tuple[Array | None, Array | None, str]:
    """Positions (K, 3) [m] or box (2, 3) [m], and in words."""
    if request.measured is not None and not request.positions_mm and request.box_mm is None and milling is None:
        positions, box = measured_place(forward(cell.robot, request.measured.theta, cell.flange_from_tcp).position)
        if box is not None:
            return None, box, _box_words(box) + ", about the measured poses"
        assert positions is not None
        return positions, None, "TCP at ({:g}, {:g}, {:g}) mm in the base frame, as measured".format(*1e3 * positions[0])
    if request.box_mm is not None:
        corners = 1e-3 * np.array(request.box_mm).reshape(2, 3)
        box = np.stack([corners.min(axis=0), corners.max(axis=0)])
        return None, box, _box_words(box)
    if request.positions_mm:
        positions, origin = 1e-3 * np.array(request.positions_mm), ""
    elif milling is not None:
        positions, origin = np.round(milling.tcp.mean(axis=0, keepdims=True), 3), ", the middle of the program"
    else:
        positions = np.round(default_position(cell.robot)[None], 2)
        origin = ", in front of the robot (--position names another)"
    return positions, None, "TCP at " + ", ".join("({:g}, {:g}, {:g})".format(*np.round(1e3 * p, 3)) for p in positions) + (
        f" mm in the base frame{origin}")


def _box_words(box: Array) -> str:
    return "TCP anywhere in the box " + " to ".join("({:g}, {:g}, {:g})".format(*np.round(1e3 * c, 1)) for c in box) + " mm"


def _runs(cell: Cell, request: Request) -> tuple[tuple[Slot, ...], Demand]:
    """The slots, and how many runs of which. The paper's plan: four orientations, three loads along y and two along x, so that
    one orientation is loaded along both."""
    if request.preset == "paper":
        slots = tuple(slot(axes, "single", request.force_n) for axes in ("yx", "y", "x"))
        return slots, Demand(np.arange(3), np.array([0, 1, 1, 2]))
    count = request.measurements or (4 if request.preset else DEFAULT_RUNS)
    if request.preset == "outlook":
        return (slot("xyz", "single", request.force_n),), free_demand(1, count)
    if request.dead_weight:
        hung = weight_slot(DeadWeights.of(request.dead_weight), request.protocol, fall_in_base(cell.world_from_base))
        return (hung,), free_demand(1, count)
    if request.free:
        return (slot(FREE, request.protocol, request.force_n),), free_demand(1, count)
    slots = (slot(request.axes, request.protocol, request.force_n),) if request.every_axis else tuple(
        slot(axis, request.protocol, request.force_n) for axis in request.axes)
    return slots, free_demand(len(slots), count)
