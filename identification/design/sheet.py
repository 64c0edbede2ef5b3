"""design.csv: the plan as a measurement file whose deflection columns are still empty (docs/formats.md#measurementscsv).

The sensors are set to zero anew at each pose, so each visit has its own `reference`; `time_s` runs on from the first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import read_only
from identification.common.columns import DEFLECTIONS, FORCES, JOINTS, MASS
from identification.design.dead_weights import EMPTY, DeadWeights, Level, in_words
from identification.design.domain import Pool
from identification.design.loads import DOWN, FREE, Slot
from identification.measurements import Measurements

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# The schedule a plan is written with: a pose change with its new zero of the sensors, a load change, how long loads are held.
POSE_CHANGE_S, LOAD_CHANGE_S = 120, 10
DWELL_S = (5, 20)
# Weights take longer: to be carried and hooked on, and until they hang still.
WEIGHT_CHANGE_S = 40
WEIGHT_DWELL_S = (20, 60)


@dataclass(frozen=True, eq=False)
class Sheet:
    """The rows of a plan in the order they are taken. theta (V, 6) [rad] and label of each visit; visit (L,) of each row;
    force (L, 3) [N]; time (L,) [s] as planned, dwell (L,) [s]. axes: what each visit loads. validate (V,): kept back;
    run (V,): which run of the plan a visit is. hung: the dead weights that hang at each row, empty without such."""

    theta: Array
    label: tuple[str, ...]
    axes: tuple[str, ...]
    visit: Indices
    force: Array
    time: Array
    dwell: Array
    validate: NDArray[np.bool_]
    run: Indices
    hung: tuple[Level, ...] = ()

    def __post_init__(self) -> None:
        read_only(self.theta, self.visit, self.force, self.time, self.dwell, self.validate, self.run)

    def along(self, visit: int) -> str:
        """What a visit is loaded along: its base axes, or the direction of its own."""
        if self.axes[visit] == DOWN:
            return "hung " + " ".join(f"{mass:g}" for mass in self.masses(visit) if mass) + " kg"
        if self.axes[visit] != FREE:
            return self.axes[visit]
        forces = self.force[self.visit == visit]
        largest = forces[np.argmax(np.linalg.norm(forces, axis=1))]
        return "({:+.2f} {:+.2f} {:+.2f})".format(*(largest / np.linalg.norm(largest)))

    def masses(self, visit: int) -> list[float]:
        """Mass [kg] that hangs at each row of a visit."""
        return [sum(self.hung[row]) for row in np.flatnonzero(self.visit == visit)]

    def handling(self, row: int) -> str:
        """What the operator does with the weights before a row, in words."""
        # Every visit begins and ends without weights.
        off, on = DeadWeights.handled(self.hung[row - 1] if row else EMPTY, self.hung[row])
        done = [f"take off {in_words(off)}"] if off else []
        done += [f"hang on {in_words(on)}"] if on else []
        return ", then ".join(done) or "no weights"

    @property
    def lifted_kg(self) -> float:
        """Mass [kg] that is hung on and taken off in all."""
        steps = [tuple(self.hung[row] for row in np.flatnonzero(self.visit == visit)) for visit in range(len(self.label))]
        return sum(DeadWeights.lifted(each) for each in steps)

    def purpose(self, visit: int) -> str:
        """As measurements.csv names it."""
        return "validate" if self.validate[visit] else "identify"

    def visits_as_dicts(self) -> list[dict[str, Any]]:
        """The visits as JSON values."""
        return [{"pose": label, "loads_along": self.axes[i], "q_deg": np.degrees(self.theta[i]).tolist(),
                 "purpose": self.purpose(i)} | ({"mass_kg": self.masses(i)} if self.hung else {})
                for i, label in enumerate(self.label)]

    def lines(self) -> list[str]:
        """The visits as a table for the terminal."""
        lines = [f"{'pose':<7}{'loads':<22}{'joints [deg]'}"]
        for number, (label, theta) in enumerate(zip(self.label, np.degrees(self.theta), strict=True)):
            lines.append(f"{label:<7}{self.along(number):<22}" + " ".join(f"{angle:8.2f}" for angle in theta))
        return lines

    def of_purpose(self, validate: bool) -> Sheet:
        """The visits that are fitted, or those that are kept back."""
        visits = np.flatnonzero(self.validate == validate)
        rows = np.isin(self.visit, visits)
        return Sheet(self.theta[visits], tuple(self.label[v] for v in visits), tuple(self.axes[v] for v in visits),
                     np.searchsorted(visits, self.visit[rows]), self.force[rows], self.time[rows], self.dwell[rows],
                     self.validate[visits], self.run[visits],
                     tuple(self.hung[row] for row in np.flatnonzero(rows)) if self.hung else ())


def sheet_of(
    runs: Pool, slots: tuple[Slot, ...], order: Indices, replicates: int, held: NDArray[np.bool_], letter: str
) -> Sheet:
    """The plan's rows: visits in `order`, later passes backwards (without what is kept back), each axis' load cycles with
    alternating sign. held (N,): runs that are kept back, named V01 ...; letter: of the others' names."""
    passes = [order if k == 0 else order[~held[order]][:: -1 if k % 2 else 1] for k in range(replicates)]
    visited: dict[int, int] = {}
    visits, forces, times, dwells, labels = [], [], [], [], []
    hung: list[Level] = []
    clock, number = 0, 0
    name = {int(run): f"{first}{i + 1:02d}" for first, which in ((letter, False), ("V", True))
            for i, run in enumerate(order[held[order] == which])}
    for k, sequence in enumerate(passes):
        for run in sequence:
            slot = int(runs.slot[run])
            sign = -1.0 if visited.get(slot, 0) % 2 and not slots[slot].one_way else 1.0
            change, hold = (WEIGHT_CHANGE_S, WEIGHT_DWELL_S) if slots[slot].hung else (LOAD_CHANGE_S, DWELL_S)
            hung += slots[slot].hung
            visited[slot] = visited.get(slot, 0) + 1
            clock += POSE_CHANGE_S if number else 0
            for i, force in enumerate(np.round(slots[slot].along(runs.line[run]), 2)):
                dwell = hold[i % len(hold)]
                clock += change + dwell
                visits.append(number)
                forces.append(sign * force + 0.0)
                times.append(clock)
                dwells.append(dwell)
            labels.append(name[int(run)] + (f"/{k + 1}" if k else ""))
            number += 1
    run = np.concatenate(passes)
    theta = np.radians(np.round(np.degrees(runs.theta[run]), 6))
    axes = tuple(slots[int(s)].name for s in runs.slot[run])
    return Sheet(theta, tuple(labels), axes, np.array(visits, dtype=np.intp), np.array(forces), np.array(times, dtype=float),
                 np.array(dwells, dtype=float), held[run], run, tuple(hung))


def sheet_text(sheet: Sheet, comments: list[str]) -> str:
    """The CSV file."""
    loads = [f"{sum(level):g}" for level in sheet.hung] or [
        ",".join(f"{component:g}" for component in force) for force in sheet.force]
    lines = [*(f"# {' '.join(line.split())}" for line in comments),
             ",".join([*JOINTS, *([MASS] if sheet.hung else FORCES), *DEFLECTIONS, "time_s", "dwell_s", "reference", "pose",
                       "purpose"])]
    angles = np.degrees(sheet.theta)
    for visit, load, time, dwell in zip(sheet.visit, loads, sheet.time, sheet.dwell, strict=True):
        numbers = [*(f"{angle + 0.0:.6f}" for angle in np.round(angles[visit], 6)), load]
        label = sheet.label[visit]
        lines.append(",".join([*numbers, "", "", "", f"{time:g}", f"{dwell:g}", label, label, sheet.purpose(visit)]))
    return "\n".join(lines) + "\n"


def as_measurements(sheet: Sheet) -> Measurements:
    """The rows as planned measurements, deflections not yet measured."""
    count = len(sheet.visit)
    label = np.array(sheet.label, dtype=object)[sheet.visit]
    nothing = np.full((count, 3), np.nan)
    return Measurements(
        source="design", theta=sheet.theta[sheet.visit], wrench=np.column_stack([sheet.force, np.zeros((count, 3))]),
        deflection=nothing, sigma=nothing.copy(), time=sheet.time, dwell=sheet.dwell, visit=sheet.visit,
        reference=sheet.visit, validate=sheet.validate[sheet.visit],
        machined_pass=np.full(count, "", dtype=object), pose=label, row=np.arange(1, count + 1), line=np.arange(2, count + 2),
        findings=())
