"""Force follows the cut: a corrected path cuts deeper than the pass in which the force was logged, and the force grows with it.

While the log was taken the tool stood at e = o + d off the plan: o the offsets the program had then (none in the planned
program), d the deviation under the logged force F. Corrected, it stands on the plan, moved by -e. The material pushes the
tool along n, the unit vector of the force's part across the feed, F_n = F . n; moving the tool by -e takes it e . n deeper.
With the cutting stiffness K [N/m], the change of F_n per metre of depth, and all parts of the force growing alike,

    F' = F (1 + K (e . n) / F_n) .

The corrected tool is on the plan, so this is the solution of the coupled problem, not a step towards it: deeper by t the force
is K t more, and the arm, which gives way by c_nn along n under 1 N along n, yields K c_nn t. Where that loop's gain is 1 or
more the cut is stiffer than the arm, pass after pass would overshoot, and the correction is refused.

K is stated, found from logged pairs of passes (cutting_stiffness.py), or known by its prior (cutting_prior.py). Where it is not
followed its size leaves |d| g / (1 + g) off the plan, g = K (e . n) / F_n, and its error the same where it is. Where nothing
is known but the force, K = GROWS F_n / (a - e . n) of a depth a: the mean square over the depths that there may be. In a slot
the same holds of a step along the tool's axis, with a K of its own (slot_cut.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.cut_kind import cut_shares
from compensator.correction.cutting_prior import GROWS, depths, slot_depths
from compensator.correction.cutting_stiffness import CuttingStiffness
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.predict import Predicted
from compensator.correction.prediction import Prediction, predict_path
from compensator.correction.slot_cut import Slots, slots
from compensator.forces.target_forces import TargetForces
from compensator.path.robot_path import RobotPath
from identification.common.arrays import directions, rms
from identification.common.findings import CompstiffError, Finding, Refused, counted
from identification.model.kinematics import chunks, spring_columns

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Told = tuple[tuple[float, float], ...]
# No cut is taken for less deep than this share of its depth, however far the tool stood aside.
SHALLOWEST = 0.25
# Where less than this share of the force stands across the feed it says nothing of a depth.
LEAST_ACROSS = 0.05
# No force is followed farther than this share of itself; where places that carry more than FITS of the push across would
# change by more than all of theirs the stiffness does not fit the log.
MOST_GROWTH, FITS = 0.95, 0.05
# What is left for this cutting stiffness [N/m] is told where none is known, and for these depths [m], across the feed and of a
# slot, where none is stated.
ASSUMED, DEPTHS_TOLD, SLOTS_TOLD = 1e4, (0.3e-3, 1e-3, 3e-3), (1e-3, 2e-3, 5e-3)


def across_feed(path: RobotPath, force: Array) -> tuple[Array, Array]:
    """n (N, 3) unit vectors of the force's part across the feed, and that part F_n (N,) [N]; zeros where it is too small.

    force (N, 3) [N], base frame. The feed's direction at a target is that from the target before to the one after.
    """
    position = path.rest_from_tcp.position
    known = np.flatnonzero(path.known)
    along = np.zeros_like(position)
    if len(known) > 1:
        along[known] = path.axes.turned_to_base(np.gradient(position[known], axis=0), known)
    along = directions(along)
    across = force - np.einsum("ni,ni->n", force, along)[:, None] * along
    size = np.linalg.norm(across, axis=1)
    enough = size > LEAST_ACROSS * np.linalg.norm(force, axis=1)
    return np.where(enough[:, None], across / np.maximum(size, 1e-300)[:, None], 0.0), np.where(enough, size, 0.0)


@dataclass(frozen=True, eq=False)
class LoggedPass:
    """What is known of the pass that the log was taken in. on_plan: the forces are those of a tool on the plan, as predicted
    ones are, and a corrected tool meets them. offsets: that the program had then, None: it was the planned one; stiffness: of
    the cut [N/m], None: not known; slot: the same of a slot, along the tool's axis."""

    offsets: PassOffsets | None
    stiffness: CuttingStiffness | None
    findings: tuple[Finding, ...] = ()
    on_plan: bool = False
    slot: CuttingStiffness | None = None


@dataclass(frozen=True, eq=False)
class CorrectedPass:
    """The path under the forces that the corrected pass meets. stood (M, 3) [m], base frame: where the tool of the logged pass
    stood off the plan. left (M,) [m]: 1 sigma of how far off the plan the force that follows the cut leaves the tool;
    in_covariance (M,) [m]: what of that is in the prediction's. left_as_logged (M,) [m]: what a cutting stiffness of ASSUMED
    would leave, None where the force follows the cut. uncorrected (M,): how many times that of the logged pass the deviation of
    the planned program is. gain: the largest K c_nn, 0 where the force is as logged. at_depths,
    at_slot_depths: depths [m], and what `left` would be there [m], root mean square; none where more is known of the cut."""

    loaded: LoadedPath
    stood: Array
    left: Array
    in_covariance: Array
    left_as_logged: Array | None
    uncorrected: Array
    gain: float
    findings: tuple[Finding, ...] = ()
    at_depths: Told = ()
    at_slot_depths: Told = ()


def following_the_cut(predicted: Predicted, kept: Indices, logged: LoggedPass) -> tuple[CorrectedPass, Prediction]:
    """The corrected pass of a program whose targets as given stand at the places `kept`, and the deviation that its forces
    cause, the error of the cutting stiffness in its covariance."""
    if logged.on_plan:
        nothing = np.zeros(len(predicted.targets))
        return (CorrectedPass(predicted.loaded, np.zeros((len(nothing), 3)), nothing, nothing, None, np.ones(len(nothing)),
                              0.0), predicted.prediction)
    offsets = None if logged.offsets is None else logged.offsets.over(predicted.path, kept)
    stood = standing(predicted, offsets)[predicted.targets]
    with np.errstate(over="ignore", invalid="ignore"):          # absurd numbers in targets without force
        direction, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
        per_newton, chosen = _deeper(predicted, offsets, direction, across)
        slot = slots(predicted.path, predicted.forces.wrench[:, :3], across, np.where(
            chosen[:, None], standing(predicted, offsets), 0.0))
        wall = _wall(predicted, logged, across, per_newton)
        in_slots = _slot(predicted, logged, slot)
        followed = wall.stiffness * per_newton + in_slots.growth
        left = np.hypot(wall.left(followed), in_slots.left(followed))
        if not wall.exact:
            left = np.hypot(left, _left(predicted, _where_it_changes(predicted, np.abs(per_newton) * across)))
        uncorrected = _uncorrected(predicted, logged, across, direction, wall, followed)
        if not followed.any():
            as_logged = _left(predicted, np.abs(ASSUMED * per_newton))
            return CorrectedPass(predicted.loaded, stood, left, np.zeros(len(left)), as_logged, uncorrected, 0.0,
                                 at_depths=wall.at_depths, at_slot_depths=in_slots.at_depths), predicted.prediction
    alone = followed
    if predicted.loaded.learned is not None:
        deflected = replace(predicted.prediction, position=predicted.prediction.position - predicted.prediction.learned)
        alone = _growth(replace(predicted, prediction=deflected), offsets, logged, across, direction, wall)
    _refuse_what_does_not_fit(predicted, alone, wall.stiffness, across)
    asked, followed = followed, np.clip(followed, -MOST_GROWTH, MOST_GROWTH)
    if (asked != followed).any():
        left = np.hypot(left, _left(predicted, np.abs(asked - followed), followed))
    forces, findings = _engaged(predicted, followed, wall.stiffness, chosen)
    findings = (*_limited(predicted, np.flatnonzero(asked != followed), across), *findings)
    gain = _check_gain(predicted, wall.stiffness, direction)
    loaded = replace(predicted.loaded, forces=forces)
    prediction = predict_path(loaded)
    left = left * (1 + followed[predicted.targets])       # of the deviation that the corrected pass has
    # The force as a whole is uncertain by this, and so is the deviation: in its own direction.
    along = prediction.position / np.maximum(np.linalg.norm(prediction.position, axis=1), 1e-300)[:, None]
    covariance = prediction.covariance + np.einsum("n,ni,nj->nij", left**2, along, along)
    covariance.flags.writeable = False
    return (CorrectedPass(loaded, stood, left, left, None, uncorrected, gain, findings, wall.at_depths, in_slots.at_depths),
            replace(prediction, covariance=covariance))


def _uncorrected(
    predicted: Predicted, logged: LoggedPass, across: Array, direction: Array, wall: _Wall, followed: Array
) -> Array:
    """How many times that of the logged pass the deviation of the planned program is (M,). By the growth g of the force from
    where the tool stood to the plan, and h from where it stands uncorrected: (1 + g) / (1 + h), of logs of that program 1."""
    if logged.offsets is None:
        return np.ones(len(predicted.targets))
    alone = _growth(predicted, None, logged, across, direction, wall)
    grown, alone = (np.clip(growth, -MOST_GROWTH, MOST_GROWTH)[predicted.targets] for growth in (followed, alone))
    return np.asarray((1 + grown) / (1 + alone))


def _growth(
    predicted: Predicted, offsets: Array | None, logged: LoggedPass, across: Array, direction: Array, wall: _Wall
) -> Array:
    """By what share of itself the force grows (N,) from where the tool stood with these offsets (N, 3) [m] to the plan."""
    per_newton, chosen = _deeper(predicted, offsets, direction, across)
    slot = slots(predicted.path, predicted.forces.wrench[:, :3], across, np.where(
        chosen[:, None], standing(predicted, offsets), 0.0))
    return np.asarray(wall.stiffness * per_newton + _slot(predicted, logged, slot).growth)


@dataclass(frozen=True, eq=False)
class _Wall:
    """What a step across the feed does to the force. stiffness (N,) [N/m]: the K that is followed; left: of all growth followed
    (N,), how far off the plan (M,) [m] what is not followed leaves the tool; exact: K is, everywhere."""

    stiffness: Array
    left: Callable[[Array], Array]
    exact: bool = False
    at_depths: Told = ()


@dataclass(frozen=True, eq=False)
class _InSlots:
    """What a step along the axis does in slots. growth (N,): by what share of itself the force grows where the tool goes to its
    plan, as it is followed; left and at_depths as of a wall."""

    growth: Array
    left: Callable[[Array], Array]
    at_depths: Told = ()


def _wall(predicted: Predicted, logged: LoggedPass, across: Array, per_newton: Array) -> _Wall:
    """Of the force across the feed (N,) [N]; per_newton (N,) [m/N]. K of a wall is not looked for in a slot, but where it was
    stated for all places."""
    known = logged.stiffness
    climbing, slotting = cut_shares(predicted.path, predicted.forces.wrench[:, :3])
    beside = 1 - slotting
    if known is None:
        settings, aside = predicted.settings.correction, across * per_newton
        told = DEPTHS_TOLD if settings.depth_of_cut is None else ()
        left, at_depths = _of_any_depth(predicted, GROWS * beside * aside, aside, depths(settings), told)
        return _Wall(np.zeros(len(across)), lambda followed: left, at_depths=at_depths)
    if not known.climb_only:
        climbing = beside = np.ones(len(across)) if logged.slot is None else beside
    share = climbing if known.followed else np.zeros(len(across))
    size = np.hypot(share * known.std, (beside - share) * known.size) * np.abs(per_newton)
    return _Wall(share * known.value, lambda followed: _left(predicted, size, followed),
                 exact=not known.climb_only and not known.std)


def _slot(predicted: Predicted, logged: LoggedPass, slot: Slots) -> _InSlots:
    """Of slots."""
    if logged.slot is None:
        everywhere = logged.stiffness is not None and not logged.stiffness.climb_only
        grows = np.zeros(len(slot.share)) if everywhere else slot.share * slot.rise
        left, told = _of_any_depth(predicted, grows, slot.rise, slot_depths(), SLOTS_TOLD if grows.any() else ())
        return _InSlots(np.zeros(len(grows)), lambda followed: left, told)
    growth = logged.slot.value * slot.per_stiffness
    share = slot.share * (logged.slot.followed & (np.abs(growth) < MOST_GROWTH))
    error = np.hypot(share * logged.slot.std, (slot.share - share) * logged.slot.size) * np.abs(slot.per_stiffness)
    return _InSlots(share * growth, lambda followed: _left(predicted, error, followed))


def _of_any_depth(
    predicted: Predicted, grows: Array, aside: Array, drawn: tuple[Array, Array], told: tuple[float, ...]
) -> tuple[Array, Told]:
    """The root mean square (M,) [m] of what the growing force leaves over the depths `drawn`, with their weights: it grows by
    `grows` (N,) [m] by the depth that the tool had, aside by (N,) [m]. And what it leaves at the depths `told`, over all
    targets."""

    def at(depth: float) -> Array:
        return _left(predicted, np.abs(grows) / depth_logged(depth, aside))

    square = np.sum([weight * at(depth) ** 2 for depth, weight in zip(*drawn, strict=True)], axis=0)
    return np.sqrt(square), tuple((depth, rms(at(depth))) for depth in told if len(square))


def _where_it_changes(predicted: Predicted, aside: Array) -> Array:
    """By what share of itself the force may grow (N,) besides where it changes along the path, with the tool aside by (N,) [m].

    The edge of the stock stands aslant under the tool there, and a step across it finds another force as a step along it does:
    how much of either is the edge's direction, which no log tells. The slope along the path is the lesser of both sides: a step
    is none."""
    path, force = predicted.path, predicted.forces.wrench[:, :3]
    step = np.maximum(np.nan_to_num(np.diff(path.length)), 1e-9)
    slope = np.linalg.norm(np.diff(force, axis=0), axis=1) / step
    slope[~(predicted.forces.forced[1:] & predicted.forces.forced[:-1])] = np.inf
    lesser = np.minimum(np.append(slope, np.inf), np.insert(slope, 0, np.inf))
    size = np.linalg.norm(force, axis=1)
    return np.where(np.isfinite(lesser), aside * lesser / np.maximum(size, 1e-300), 0.0)


def depth_logged(depth: float, aside: Array) -> Array:
    """How deep (n,) [m] the tool cut while the force was logged that stood aside (n,) [m] of the plan."""
    return np.clip(depth - aside, SHALLOWEST * depth, None)


def _check_gain(predicted: Predicted, stiffness: Array, direction: Array) -> float:
    """The largest K c_nn of stiffness K (N,) [N/m], across the feed along `direction` (N, 3). Raises Refused (CS3200) from 1
    on."""
    targets, model, toolpath = predicted.targets, predicted.model, predicted.path.toolpath
    along, theta = np.zeros(len(targets)), predicted.loaded.theta
    for tool, places in predicted.loaded.each_tool():
        for part in chunks(len(places)):
            few = places[part]
            n = direction[targets[few]]
            columns = spring_columns(model.robot, theta[few], tool)
            # By how much each spring yields under 1 N along n, and how far along n that moves the tool.
            along[few] = model.compliance @ np.einsum("irn,nr->in", columns[:, :3], n) ** 2
    gains = stiffness[targets] * along
    worst = int(np.argmax(gains))
    gain, where = float(gains[worst]), int(targets[worst])
    if gain >= 1:
        raise Refused(Finding(
            "CS3200", "error", f"the cut is stiffer than the arm: {1e-3 * stiffness[where]:.3g} N/mm of depth against "
            f"{1e-3 / along[worst]:.3g} N/mm of the tool across the feed (gain {gain:.2g}, expected under 1)",
            file=toolpath.source, line=int(toolpath.line[where]), target=int(toolpath.number[where]),
            hint="is the unit of --cutting-stiffness N/mm? Else take less contact along the tool's axis, or a stiffer posture"))
    return gain


def standing(predicted: Predicted, offsets: Array | None) -> Array:
    """Where the tool stood off the plan in the logged pass (N, 3) [m], base frame: offsets plus deviation."""
    stood = np.zeros((len(predicted.path.toolpath), 3)) if offsets is None else offsets.copy()
    stood[predicted.targets] += predicted.prediction.position
    return stood


def _refuse_what_does_not_fit(predicted: Predicted, growth: Array, stiffness: Array, across: Array) -> None:
    """Raises CompstiffError (CS4123) where the force would vanish or more than double, by growth (N,) with stiffness (N,)
    [N/m] for what the tool yields (a set-up that was learned may be any depth of cut off), at places that carry more than FITS
    of the push across (N,) [N]. Where next to nothing was logged, as at a touch or where the push turns round, any step is more
    than all of it."""
    toolpath, over = predicted.path.toolpath, np.abs(growth) >= 1
    if not across[over].sum() > FITS * across[predicted.targets].sum():
        return
    worst = int(np.argmax(np.where(over, across, 0.0)))
    no_zero = any(finding.code == "CS3041" for finding in predicted.findings)
    raise CompstiffError(Finding(
        "CS4123", "error", f"with a cutting stiffness of {1e-3 * stiffness[worst]:g} N/mm the force here would change by "
        f"{100 * growth[worst]:.0f} %, expected less than 100 %", file=toolpath.source, line=int(toolpath.line[worst]),
        target=int(toolpath.number[worst]),
        hint=("name an air move with --tare: the air moves show a force, too. And " if no_zero else "")
        + "are the forces of the log in newtons? The stiffness is in newton per millimetre of depth, about force divided by "
        "depth of cut"))


def _engaged(
    predicted: Predicted, growth: Array, stiffness: Array, chosen: NDArray[np.bool_]
) -> tuple[TargetForces, tuple[Finding, ...]]:
    """The forces of the corrected pass, out of those of the logged pass, which grow by a share of themselves (N,); stiffness
    (N,) [N/m]: of the wall, which is in it; chosen (N,) from `_deeper`."""
    forces, source = predicted.forces, predicted.path.toolpath.source
    cut = replace(forces, wrench=forces.wrench * (1 + growth)[:, None])
    size = growth[chosen & (growth != 0)]
    left = len(predicted.targets) - len(size)
    note = f"; {left} with next to no force across the feed, or in another cut, keep theirs" if left else ""
    known = f"with a cutting stiffness of {1e-3 * stiffness.max():.3g} N/mm" if stiffness.any() else "in slots"
    off = f"{100 * np.median(size):+.1f} % (median), {100 * np.abs(size).max():.1f} % at most, off the logged{note}"
    return cut, (Finding("CS4120", "note", f"force follows the cut: {known} the corrected pass meets forces that are {off}",
                         file=source),)


def _limited(predicted: Predicted, beyond: Indices, across: Array) -> tuple[Finding, ...]:
    """What is said of the places (n,) whose force is followed as far as MOST_GROWTH and no farther: what is learned of set-up
    and calibration may be more than the depth of a light cut, at an entry (CS5325). A warning where they carry more than FITS
    of the push across (N,) [N]: then it is no entry."""
    if not len(beyond):
        return ()
    more, share = f"at {counted(len(beyond), 'target')}", f"the force is taken to change by {100 * MOST_GROWTH:.0f} % there"
    if predicted.loaded.learned is None:
        return (predicted.path.finding(int(beyond[0]), "CS4120", "note", f"{more} next to no force was logged for the step "
                                       f"that the corrected tool makes across: {share}, no more"),)
    many = across[beyond].sum() > FITS * across[predicted.targets].sum()
    return (predicted.path.finding(int(beyond[0]), "CS5325", "warning" if many else "note",
                                   f"{more} of {len(predicted.targets)} the learned displacement is deeper than the cut: "
                                   f"{share}, no more",
                                   "is the set-up the same (--repeats), and the cutting stiffness right?" if many else ""),)


def _left(predicted: Predicted, growth: Array, followed: Array | float = 0.0) -> Array:
    """How far off the plan (M,) [m] the tool stays where the force grows by g (N,) more than is corrected for: by g more force
    it yields by g |d| more, which takes it out of the cut again: |d| g / (1 + g) is left. followed (N,): growth that is."""
    all_of_it = np.broadcast_to(np.maximum(1 + growth + followed, 0.1), growth.shape)[predicted.targets]
    return np.asarray(np.linalg.norm(predicted.prediction.position, axis=1) * growth[predicted.targets] / all_of_it)


def _deeper(
    predicted: Predicted, offsets: Array | None, direction: Array, across: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """(e . n) / F_n (N,) [m/N], n and F_n as `across_feed` gives them, and where there is such a force (N,)."""
    deeper = np.einsum("ni,ni->n", standing(predicted, offsets), direction)
    chosen = np.zeros(len(across), dtype=bool)
    chosen[predicted.targets] = True
    chosen &= across > 0
    return np.where(chosen, deeper / np.maximum(across, 1e-300), 0.0), chosen
