"""What is known of the force in slots: by their depth, by the material, or by two logged passes (slot_cut.py)."""

from __future__ import annotations

import numpy as np

from compensator.correction.cut_kind import towards_spindle
from compensator.correction.cutting_prior import ANY_SLOT, SLOT_DEPTH, of_slot, of_slot_depth
from compensator.correction.cutting_stiffness import ZERO, CuttingStiffness, Origin
from compensator.correction.engagement import across_feed, depth_logged, standing
from compensator.correction.predict import Predicted
from compensator.correction.settings import Estimate
from compensator.correction.slot_cut import full_slot
from identification.common.arrays import Array, rms
from identification.common.autocorrelation import autocorrelation_time
from identification.common.findings import Finding

# Fewer targets in full slots tell nothing of them.
FEWEST_TARGETS = 40


def known_slot(
    predicted: Predicted, offsets: Array | None, wall: CuttingStiffness | None
) -> tuple[CuttingStiffness | None, tuple[Finding, ...]]:
    """K [N/m] of the program's slots by --slot-depth, else by the material. None where neither is stated, where the program has
    no slot, or where a K (`wall`) is stated for all places and no depth. offsets (N, 3) [m], base frame, of the logged pass."""
    depth, inside = predicted.settings.correction.slot_depth, _in_full_slots(predicted)
    if depth is not None:
        if not inside.any():
            return None, (_told(predicted, "--slot-depth is stated, and by the direction of its force nothing is a slot"),)
        return _found(predicted, of_slot_depth(_push(predicted, offsets, depth)), "depth", f"a depth of {1e3 * depth:g} mm")
    if not inside.any() or (wall is not None and not wall.climb_only):
        return None, ()
    feed = predicted.path.toolpath.feed[inside]
    feed = feed[np.isfinite(feed)]
    rpm = predicted.settings.log.spindle_rpm or predicted.cell.force_log.form.spindle_rpm
    of_table = of_slot(predicted.cell.cutting, float(np.median(feed)) if len(feed) else None, 60 / rpm if rpm else None)
    return (None, ()) if of_table is None else _found(predicted, of_table, "material", str(predicted.cell.cutting.material))


def slot_of_passes(
    first: Predicted, second: Predicted, offsets: Array, wall: CuttingStiffness | None
) -> tuple[CuttingStiffness | None, tuple[Finding, ...]]:
    """The same from a pass without offsets and one with offsets (N, 3) [m], base frame: how the force in full slots grew with
    the step along the tool's axis. What `known_slot` says of the first pass where there are too few such targets."""
    before, findings = known_slot(first, None, wall)
    both = _in_full_slots(first)
    both &= np.isin(np.arange(len(both)), second.targets)
    if both.sum() < FEWEST_TARGETS or (wall is not None and not wall.std):
        return before, findings
    direction, _ = across_feed(first.path, first.forces.wrench[:, :3])
    n, up = direction[both], towards_spindle(first.path)[both]
    change = np.einsum("ni,ni->n", (second.forces.wrench - first.forces.wrench)[both, :3], n)
    deeper = np.einsum("ni,ni->n", (standing(first, None) - standing(second, offsets))[both], up)
    prior = Estimate(before.value, before.std) if before else of_slot_depth(_push(first, None, SLOT_DEPTH), ANY_SLOT)
    known = through_zero(prior, deeper, change)
    found = CuttingStiffness(known.value, known.std, "passes", mean_std=known.std, pairs=1)
    return found, (_told(second, f"in slots, from two passes: {found.words()} along the tool's axis"),)


def through_zero(prior: Estimate, deeper: Array, change: Array) -> Estimate:
    """K [N/m] by how much deeper (n,) [m] the tool stood and by how much the force changed (n,) [N]: in proportion. Along a
    slot both hardly vary, by no more than the model of the arm is off: what counts is the change as a whole, with the sensor's
    zero in it."""
    size = float(deeper @ deeper)
    if not size > 0:
        return prior
    value = float(deeper @ change) / size
    rest = change - value * deeper
    scatter = rms(rest) ** 2 * min(autocorrelation_time(rest).values, len(rest)) / size
    variance = (ZERO * float(np.abs(deeper).sum()) / size) ** 2 + scatter
    known = 1 / variance + 1 / prior.std**2
    return Estimate(max(value / variance + prior.value / prior.std**2, 0.0) / known, known**-0.5)


def _in_full_slots(predicted: Predicted) -> np.ndarray:
    """The targets (N,) with force that stand in a full slot."""
    force = predicted.forces.wrench[:, :3]
    _, across = across_feed(predicted.path, force)
    inside = np.zeros(len(across), dtype=bool)
    inside[predicted.targets] = True
    return inside & full_slot(predicted.path, force, across)


def _push(predicted: Predicted, offsets: Array | None, depth: float) -> float:
    """The push across [N/m] for each metre of a slot, whose planned depth is stated [m]: the middle of the full slots."""
    inside = _in_full_slots(predicted)
    _, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
    rise = np.einsum("ni,ni->n", standing(predicted, offsets), towards_spindle(predicted.path))
    return float(np.median(across[inside] / depth_logged(depth, rise[inside])))


def _found(predicted: Predicted, known: Estimate, origin: Origin, by: str) -> tuple[CuttingStiffness, tuple[Finding, ...]]:
    found = CuttingStiffness(known.value, known.std, origin, mean_std=known.std)
    return found, (_told(predicted, f"in slots, by {by}: {found.words()} along the tool's axis"),)


def _told(predicted: Predicted, message: str) -> Finding:
    return Finding("CS3243", "note", message, file=predicted.path.toolpath.source)
