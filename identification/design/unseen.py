"""What no admissible run can show, told from the information of a random pool, and the one load that would show it.

In units of the prior, K = P^-1/2 m P^-1/2 is what a run tells. A direction that no plan of the wanted length narrows by more
than a twentieth of a per cent is unseen: its share of ln c stays the prior's whatever is measured. Dead weights make no moment
about a vertical axis, so that an upright joint 1 is one; a tilted base, or a load that a pulley turns sideways, ends that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.common.arrays import Array
from identification.common.findings import Finding
from identification.design.domain import Domain, Pool, random_pool
from identification.design.forecast import spread
from identification.design.information import run_information
from identification.design.loads import Slot, loads_of
from identification.model.gravity import fall_in_base

POSES = 400
# Information of a whole plan, in units of the prior's, under which it narrows the prior by less than a twentieth of a per cent.
UNSEEN = 1e-3
# Directions that a sideways load is tried in, evenly around gravity.
SIDES = 16
# A load that leaves more of the spread than this shows nothing.
SHOWN = 0.9


def seen_by(domain: Domain, prior: Array, runs: int, rng: np.random.Generator) -> Array | None:
    """Orthonormal basis (6, r) of what runs in this domain can show of ln c, None where that is all or nothing of it.

    prior (6, 6): precision of ln c before the runs; runs: how many there are, with their replicates. Raises CompstiffError
    (CS1601) where no run is admissible.
    """
    pool = random_pool(domain, POSES, rng)
    values, vectors = np.linalg.eigh(prior)
    root = (vectors * np.sqrt(values)) @ vectors.T
    unit = np.linalg.inv(root)
    told = unit @ pool.information @ unit
    _, directions = np.linalg.eigh(told.sum(axis=0))
    most = np.einsum("ni,knm,mi->ki", directions, told, directions).max(axis=0)
    seen = runs * most > UNSEEN
    if seen.all() or not seen.any():
        return None
    return np.asarray(np.linalg.qr(root @ directions[:, seen])[0])


@dataclass(frozen=True, eq=False)
class Sideways:
    """One more load that would show an unseen joint. visit: its number among the plan's poses; force (3,) [N], base frame;
    before, after: std of ln k of the joint."""

    joint: int
    run: int
    force: Array
    before: float
    after: float

    def as_dict(self, label: str) -> dict[str, object]:
        """JSON values; label: of the pose."""
        return {"joint": self.joint, "pose": label, "force_n": self.force.tolist(), "log_std_before": self.before,
                "log_std_after": self.after}


def sideways(domain: Domain, runs: Pool, information: Array, joint: int) -> Sideways:
    """The load across gravity, as large as the plan's largest, at one of the plan's poses, that tells most of a joint;
    information (6, 6): precision of ln c after the plan."""
    fall = fall_in_base(domain.rig.cell.world_from_base)
    largest = max(float(np.linalg.norm(slot.forces, axis=1).max()) for slot in domain.slots)
    directions = across(fall, SIDES)
    columns = domain.look(runs.theta).columns
    before = float(np.sqrt(np.linalg.inv(information)[joint - 1, joint - 1]))
    best = Sideways(joint, 0, largest * directions[0], before, np.inf)
    for direction in directions:
        once = Slot("sideways", np.stack([np.zeros(3), largest * direction]))
        after = np.linalg.inv(information + run_information(domain.rig, columns, loads_of(once)))[:, joint - 1, joint - 1]
        run = int(np.argmin(after))
        if np.sqrt(after[run]) < best.after * (1 - 1e-6):
            best = Sideways(joint, run, largest * direction, before, float(np.sqrt(after[run])))
    return best


def across(fall: Array, count: int) -> Array:
    """Unit vectors (count, 3) evenly around gravity, all across it, the first along base x where that is level."""
    down = fall / np.linalg.norm(fall)
    first = np.eye(3)[int(np.argmin(np.abs(down)))]
    first = first - (first @ down) * down
    first /= np.linalg.norm(first)
    angle = 2 * np.pi * np.arange(count) / count
    return np.asarray(np.outer(np.cos(angle), first) + np.outer(np.sin(angle), np.cross(first, down)))


def unseen_finding(domain: Domain, helps: tuple[Sideways, ...], labels: tuple[str, ...]) -> Finding:
    """What the user must know before measuring; labels: of the pose of each of `helps`."""
    names = " and ".join(f"k{one.joint}" for one in helps)
    weights = all(slot.one_way for slot in domain.slots)
    why = ("the weights' line makes no moment about the axis at any admissible pose" if weights else
           "the loads turn it at no admissible pose")
    hints = []
    for one, label in zip(helps, labels, strict=True):
        towards = "({:.2f} {:.2f} {:.2f})".format(*(one.force / np.linalg.norm(one.force) + 0.0))
        if one.after < SHOWN * one.before:
            hints.append(f"one load of {np.linalg.norm(one.force):.0f} N turned sideways by a rope over a pulley, towards base "
                         f"{towards} at the joints of {label}, would bring k{one.joint} from {spread(one.before)} "
                         f"{spread(one.after)}")
        else:
            hints.append(f"no force at this tool point shows k{one.joint} at these poses: load the tool beside the axis")
    if weights and any(one.joint == 1 for one in helps):
        hints.append("turning axis 1 or the whole robot about the vertical shows nothing")
    return Finding("CS1507", "warning", f"these loads cannot show {names}: {why}. The prior alone carries it, and the plan is "
                   "judged by what the loads do show", file=str(domain.rig.cell.source), hint="; ".join(hints))
