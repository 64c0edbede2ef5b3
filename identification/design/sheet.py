"""design.csv: the plan as a measurement file whose deflection columns are still empty (docs/formats.md#measurementscsv).

The sensors are set to zero anew at each pose, so each visit has its own `reference`; `time_s` runs on from the first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.columns import DEFLECTIONS, FORCES, JOINTS
from identification.design.domain import Pool
from identification.design.loads import Slot
from identification.measurements import Measurements

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# The schedule a plan is written with: a pose change with its new zero of the sensors, a load change, how long loads are held.
POSE_CHANGE_S, LOAD_CHANGE_S = 120, 10
DWELL_S = (5, 20)


@dataclass(frozen=True, eq=False)
class Sheet:
    """The rows of a plan in the order they are taken. theta (V, 6) [rad] and label of each visit; visit (L,) of each row;
    force (L, 3) [N]; time (L,) [s] as planned, dwell (L,) [s]. axes: what each visit loads. validate (V,): kept back;
    run (V,): which run of the plan a visit is."""

    theta: Array
    label: tuple[str, ...]
    axes: tuple[str, ...]
    visit: Indices
    force: Array
    time: Array
    dwell: Array
    validate: NDArray[np.bool_]
    run: Indices

    def of_purpose(self, validate: bool) -> Sheet:
        """The visits that are fitted, or those that are kept back."""
        visits = np.flatnonzero(self.validate == validate)
        rows = np.isin(self.visit, visits)
        return Sheet(self.theta[visits], tuple(self.label[v] for v in visits), tuple(self.axes[v] for v in visits),
                     np.searchsorted(visits, self.visit[rows]), self.force[rows], self.time[rows], self.dwell[rows],
                     self.validate[visits], self.run[visits])


def sheet(
    runs: Pool, slots: tuple[Slot, ...], order: Indices, replicates: int = 1, kept_back: NDArray[np.bool_] | None = None,
    letter: str = "P",
) -> Sheet:
    """The plan's rows: visits in `order`, later passes backwards (without what is kept back), each axis' load cycles with
    alternating sign. kept_back (N,): runs that are not fitted, named V01 ...; letter: of the others' names."""
    held = np.zeros(len(runs), dtype=bool) if kept_back is None else kept_back
    passes = [order if k == 0 else order[~held[order]][:: -1 if k % 2 else 1] for k in range(replicates)]
    seen: dict[int, int] = {}
    visits, forces, times, dwells, labels = [], [], [], [], []
    clock, number = 0, 0
    name = {int(run): f"{first}{i + 1:02d}" for first, kind in ((letter, False), ("V", True))
            for i, run in enumerate(order[held[order] == kind])}
    for k, sequence in enumerate(passes):
        for run in sequence:
            kind = int(runs.slot[run])
            sign = -1.0 if seen.get(kind, 0) % 2 else 1.0
            seen[kind] = seen.get(kind, 0) + 1
            clock += POSE_CHANGE_S if number else 0
            for i, force in enumerate(np.round(slots[kind].along(runs.line[run]), 2)):
                pause = DWELL_S[i % len(DWELL_S)]
                clock += LOAD_CHANGE_S + pause
                visits.append(number)
                forces.append(sign * force + 0.0)
                times.append(clock)
                dwells.append(pause)
            labels.append(name[int(run)] + (f"/{k + 1}" if k else ""))
            number += 1
    runs_in_order = np.concatenate(passes)
    theta = np.radians(np.round(np.degrees(runs.theta[runs_in_order]), 6))
    axes = tuple(slots[int(s)].name for s in runs.slot[runs_in_order])
    return Sheet(theta, tuple(labels), axes, np.array(visits, dtype=np.intp), np.array(forces), np.array(times, dtype=float),
                 np.array(dwells, dtype=float), held[runs_in_order], runs_in_order)


def sheet_text(rows: Sheet, comments: list[str]) -> str:
    """The CSV file."""
    lines = [*(f"# {line}" for line in comments),
             ",".join([*JOINTS, *FORCES, *DEFLECTIONS, "time_s", "dwell_s", "reference", "pose", "purpose"])]
    angles = np.degrees(rows.theta)
    for visit, force, time, dwell in zip(rows.visit, rows.force, rows.time, rows.dwell, strict=True):
        numbers = [f"{angle + 0.0:.6f}" for angle in np.round(angles[visit], 6)] + [f"{component:g}" for component in force]
        label = rows.label[visit]
        purpose = "validate" if rows.validate[visit] else "identify"
        lines.append(",".join([*numbers, "", "", "", f"{time:g}", f"{dwell:g}", label, label, purpose]))
    return "\n".join(lines) + "\n"


def as_measurements(rows: Sheet) -> Measurements:
    """The rows as planned measurements, deflections not yet measured."""
    count = len(rows.visit)
    label = np.array(rows.label, dtype=object)[rows.visit]
    nothing = np.full((count, 3), np.nan)
    return Measurements(
        source="design", theta=rows.theta[rows.visit], wrench=np.column_stack([rows.force, np.zeros((count, 3))]),
        deflection=nothing, sigma=nothing.copy(), time=rows.time, dwell=rows.dwell, visit=rows.visit,
        reference=rows.visit, validate=rows.validate[rows.visit],
        machined_pass=np.full(count, "", dtype=object), pose=label, row=np.arange(1, count + 1), line=np.arange(2, count + 2),
        findings=())
