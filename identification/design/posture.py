"""Ordinary postures: what a robot's operator would choose among poses that tell as much, or nearly.

The wrist turned over (axes 4 and 6 by half a turn, axis 5 to the other side) puts the tool in the same pose, and every spring
sees the same loads: that choice is free. A pose that reaches over the robot's own back is put elsewhere where that costs
little.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.design.domain import TOLERANCE, Domain, Pool
from identification.design.search import Design, elsewhere, refined

Array = NDArray[np.float64]
# What a plan without poses that reach backwards may lose of the criterion; engineering judgement: a joint's interval is then
# wider by a hundredth.
COST = 0.02


def reaching_back(domain: Domain, theta: Array) -> NDArray[np.bool_]:
    """Poses (n,) whose wrist is behind axis 1, as it is turned."""
    turned = domain.rig.cell.robot.serial_angles(theta)[:, 0]
    wrist = domain.look(theta).wrist
    return np.asarray(wrist[:, 0] * np.cos(turned) + wrist[:, 1] * np.sin(turned) < 0)


def least_turned(domain: Domain, theta: Array) -> Array:
    """The same tool poses (n, 6) [rad] with axes 4 and 6 turned least, inside the limits."""
    half = np.pi
    choices = [theta]
    for over, fourth, sixth in product((False, True), (-2, -1, 0, 1, 2), (-2, -1, 0, 1, 2)):
        if (fourth % 2 == over) and (sixth % 2 == over):
            other = theta + np.array([0, 0, 0, fourth * half, 0, sixth * half])
            other[:, 4] *= -1 if over else 1
            choices.append(other)
    stacked = np.stack(choices)
    outside = ((stacked < domain.limits[:, 0]) | (stacked > domain.limits[:, 1])).any(axis=2)
    turn = np.where(outside, np.inf, np.abs(stacked[:, :, 3]) + np.abs(stacked[:, :, 5]))
    return np.asarray(stacked[turn.argmin(axis=0), np.arange(len(theta))])


def turned_least(domain: Domain, runs: Pool) -> Pool:
    """The same runs with axes 4 and 6 turned least."""
    turned = replace(runs, theta=least_turned(domain, runs.theta))
    # The wrist turned over meets no other limit than the joints'; where it does all the same, it stays.
    kept = domain.excess(turned) > np.maximum(domain.excess(runs), TOLERANCE)
    theta = np.where(kept[:, None], runs.theta, turned.theta)
    return domain.runs(theta, runs.slot, runs.place, runs.line)


def ordinary(design: Design) -> tuple[Design, tuple[Finding, ...]]:
    """The design with ordinary postures, never worse than by COST, and a note where poses are left that reach backwards."""
    task, domain = design.task, design.task.domain
    design, left = _forwards(design)
    runs = turned_least(domain, design.runs)
    back = np.flatnonzero(reaching_back(domain, runs.theta))
    cost = "no pose in front was found in their place" if left is None else (
        f"poses in front in their place would cost {100 * (1 - left):.0f} % of the criterion or more")
    findings = () if not len(back) else (Finding(
        "CS0013", "note", f"{len(back)} of {len(runs)} poses reach over the robot's back (axis 1 at "
        f"{', '.join(f'{angle:.0f}' for angle in np.degrees(runs.theta[back, 0]))} deg): {cost}",
        file=str(domain.rig.cell.source),
        hint="where the cell does not allow them, state design.joint_window_deg in cell.yaml, such as {q1: [-90, 90]}"),)
    return replace(design, runs=runs, information=task.information(runs)), findings


def _forwards(design: Design) -> tuple[Design, float | None]:
    """The design with runs that reach backwards put elsewhere, one by one while that costs COST at most in all, and the
    largest share of the criterion that one of those which stay would have left, None where none has a place in front."""
    task, domain = design.task, design.task.domain
    before, share = design.certificate.value, None
    pool = design.pool.take(~reaching_back(domain, design.pool.theta))
    plan, tried = design.runs, np.zeros(len(design.runs), dtype=bool)
    while len(waiting := np.flatnonzero(reaching_back(domain, plan.theta) & ~tried)):
        i = int(waiting[0])
        tried[i] = True
        start = elsewhere(task, plan, i, pool) if (task.group(pool) == task.demand.wanted[i]).any() else None
        if start is None:
            continue
        after, _ = refined(task, start)
        if reaching_back(domain, after.runs.theta)[i]:
            continue
        if after.value >= (1 - COST) * before:
            plan = after.runs
        else:
            share = max(share or 0.0, after.value / before)
    if plan is design.runs:
        return design, share
    return replace(design, runs=plan, information=task.information(plan),
                   certificate=design.certificate.of_plan(task.value(plan))), share
