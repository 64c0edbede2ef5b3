"""What is known of the pass that the force was logged in: the offsets its program had, and how stiff the cut is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.as_driven import said_of_positions
from compensator.correction.as_sent import as_sent
from compensator.correction.cut_kind import climb_share, cut_shares
from compensator.correction.cutting_prior import DEPTH_WIDTH, of_force, of_material
from compensator.correction.cutting_stiffness import CuttingStiffness, PassPair, of_either_sign, posterior
from compensator.correction.engagement import LoggedPass, across_feed, depth_logged, standing
from compensator.correction.known_slot import known_slot, slot_of_passes
from compensator.correction.pass_offsets import offsets_of_pass
from compensator.correction.predict import Predicted, under_forces
from compensator.correction.recorded import said_of_offsets
from compensator.correction.settings import Estimate
from compensator.forces.two_logs import compared
from identification.common.findings import Finding, Refused, counted, error
from identification.common.quantities import two_sigma

Array = NDArray[np.float64]
FEWEST_TARGETS = 40
# A wrong sign makes the force fall by at least this share of itself a metre of depth: in climb milling up to 5 mm deep it grows
# by 0.7 of the push across over the depth, that is 0.1 of the force a millimetre. In conventional milling the push across may
# fall by less (cut_kind.py); engineering judgement.
FALLS = 50.0
# No cut is deeper across the feed [m].
DEEPEST = 0.2


def logged_pass(planned: Predicted) -> tuple[LoggedPass, Predicted]:
    """As settings and cell say: the cutting stiffness stated, or that of two passes, or that of the material; and the program
    with the log placed by its targets, whatever offsets it had. Raises what `offsets_of_pass` and `pass_pair` raise, and what
    the first pass's log raises; Refused (CS3117) where the force falls with the depth."""
    settings = planned.settings.correction
    if planned.forces.unknown is not None:
        return LoggedPass(None, None, on_plan=True), planned
    sent = offsets_of_pass(settings.logged_with, planned) if settings.logged_with else None
    predicted = as_sent(planned, sent)
    offsets = None if sent is None else sent.over(planned.path)
    prior, findings = known_before(predicted, offsets)
    findings = (*driven_as_said(planned), *findings)
    if settings.first_forces is None or offsets is None:
        slot, of_slot = known_slot(predicted, offsets, prior)
        return LoggedPass(sent, prior, (*findings, *of_slot), slot=slot), predicted
    alone = replace(planned.settings, correction=replace(settings, logged_with=None))
    first = under_forces(planned.path, planned.program, planned.model, settings.first_forces, alone, planned.loaded.learned)
    agreed = compared(first.forces, predicted.forces, planned.path)
    stiffness, told = of_passes(prior, [pass_pair(first, predicted, offsets)], predicted)
    slot, of_slot = slot_of_passes(first, predicted, offsets, prior)
    return LoggedPass(sent, stiffness, (*findings, *agreed, *told, *of_slot), slot=slot), predicted


def driven_as_said(predicted: Predicted) -> tuple[Finding, ...]:
    """What the positions in the log, and the record of the offsets, say of the offsets that the pass is said to have had,
    --logged-with or none: as `said_of_positions`. Raises what `offsets_of_pass` and `said_of_offsets` raise."""
    logged_with = predicted.settings.correction.logged_with
    if logged_with is None:
        return said_of_positions(predicted, None)
    sent = offsets_of_pass(logged_with, predicted)
    return (*said_of_offsets(logged_with, predicted.program.source, predicted.cell.robot.name), *sent.findings,
            *said_of_positions(predicted, sent.over(predicted.path)))


def known_before(
    predicted: Predicted, offsets: Array | None = None
) -> tuple[CuttingStiffness | None, tuple[Finding, ...]]:
    """The cutting stiffness by --cutting-stiffness, else by cell.yaml, else by its material, else by the depth; None: nothing
    is known but the force."""
    stated, cutting = predicted.settings.correction.cutting_stiffness, predicted.cell.cutting
    if stated is not None:
        return CuttingStiffness(stated.value, stated.std, "stated", mean_std=stated.std), _too_soft(
            stated.value, predicted, predicted.path.toolpath.source)
    if cutting.stiffness_n_per_mm is not None:
        value, std = 1e3 * cutting.stiffness_n_per_mm, 1e3 * (cutting.std_n_per_mm or 0.0)
        return CuttingStiffness(value, std, "cell.yaml", mean_std=std), _too_soft(value, predicted, str(predicted.cell.source))
    if cutting.material is None:
        return known_by_depth(predicted, offsets)
    feed = predicted.path.toolpath.feed[predicted.targets]
    feed = feed[np.isfinite(feed)]
    # Stated: of a speed that was found in a log's spectrum it may be the teeth that pass.
    rpm = predicted.settings.log.spindle_rpm or predicted.cell.force_log.form.spindle_rpm
    known = of_material(cutting, float(np.median(feed)) if len(feed) else None, 60 / rpm if rpm else None)
    if known is not None:
        prior = CuttingStiffness(known.value, known.std, "material", mean_std=known.std, climb_only=True)
        return prior, (Finding("CS3201", "note", f"cutting stiffness by its material, {cutting.material}: {prior.words()}",
                               file=str(predicted.cell.source)),)
    missing = [name for name, there in (("cutting.tool_diameter_mm", cutting.tool_diameter_mm),
                                        ("cutting.contact_mm", cutting.contact_mm), ("a programmed feed", len(feed)),
                                        ("the spindle's speed (--spindle-rpm)", rpm)) if not there]
    by_depth, findings = known_by_depth(predicted, offsets)
    depth = predicted.settings.correction.depth_of_cut
    return by_depth, (Finding("CS3202", "warning" if by_depth is None else "note", f"cutting.material {cutting.material} does "
                              f"not tell how stiff the cut is without {' and '.join(missing)}", file=str(predicted.cell.source),
                              hint="state it, or the depth across the feed (--depth-of-cut)" if depth is None else "state it"),
                      *findings)


def _too_soft(value: float, predicted: Predicted, source: str) -> tuple[Finding, ...]:
    """A warning (CS4126) for a cutting stiffness [N/m] by which the force would be that of a depth no cutter reaches; of
    0 the force follows no cut. source: what it is said of, the cell that states it or the program it is stated for."""
    _, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
    push = float(np.median(across[predicted.targets])) if len(predicted.targets) else 0.0
    if not 0 < DEEPEST * value < push:
        return ()
    return (Finding("CS4126", "warning", f"with a cutting stiffness of {1e-3 * value:g} N/mm the push across of {push:.0f} N "
                    f"would be that of a cut {1e3 * push / value:.0f} mm deep", file=source,
                    hint="the unit is newton per millimetre of depth; about force divided by depth of cut"),)


def known_by_depth(
    predicted: Predicted, offsets: Array | None = None
) -> tuple[CuttingStiffness | None, tuple[Finding, ...]]:
    """The cutting stiffness by --depth-of-cut and the push across the feed where the cut climbs; None: no depth is stated, or
    too few targets climb to tell the push at that depth. offsets (N, 3) [m], base frame, of the logged pass, means over the way
    of each target."""
    depth, force = predicted.settings.correction.depth_of_cut, predicted.forces.wrench[:, :3]
    if depth is None:
        return None, ()
    _, across = across_feed(predicted.path, force)
    climbs = predicted.targets[climb_share(predicted.path, force)[predicted.targets] > 0.5]
    if len(climbs) < FEWEST_TARGETS:
        return None, (Finding(
            "CS3241", "note", f"{len(climbs)} of {counted(len(predicted.targets), 'target')} climb, and "
            f"{FEWEST_TARGETS} are needed: the stated depth does not tell how stiff the cut is",
            file=predicted.path.toolpath.source, hint="state it with --cutting-stiffness"),)
    # While the log was taken the tool stood aside, and less deep by that.
    direction, _ = across_feed(predicted.path, force)
    aside = np.einsum("ni,ni->n", standing(predicted, offsets), direction)[climbs]
    push = across[climbs] / depth_logged(depth, aside)
    known = of_force(float(np.median(push)), 1.0, DEPTH_WIDTH)
    found = CuttingStiffness(known.value, known.std, "depth", mean_std=known.std, climb_only=True)
    return found, (Finding("CS3240", "note", f"cutting stiffness by a depth of {1e3 * depth:g} mm: {found.words()}",
                           file=predicted.path.toolpath.source),)


def known_by_force(predicted: Predicted) -> Estimate | None:
    """The cutting stiffness [N/m] that the push across the feed tells at a depth that is taken; None: nothing pushes across."""
    _, across = across_feed(predicted.path, predicted.forces.wrench[:, :3])
    push = across[predicted.targets]
    # Where most of a program pushes along its feed the middle of all is nothing.
    return of_force(float(np.median(push[push > 0])), predicted.settings.correction.taken_depth) if push.any() else None


def of_passes(
    prior: CuttingStiffness | None, pairs: Sequence[PassPair], predicted: Predicted
) -> tuple[CuttingStiffness | None, tuple[Finding, ...]]:
    """The posterior from logged pairs of passes of one cut, with the force's prior where none is known; predicted: the latest
    pass. The prior where next to all stands in slots. Raises Refused (CS3117) where the force falls with the depth."""
    source = predicted.forces.log.source
    if prior is not None and not prior.std:
        return prior, ()            # stated as exact
    # A step aside says nothing in a slot.
    pairs = [pair.where(pair.slot < 0.5) for pair in pairs]
    pairs = [pair for pair in pairs if len(pair.depth) >= FEWEST_TARGETS]
    if not pairs:
        return prior, ()
    if prior is None:
        before = known_by_force(predicted)
        if before is None:
            return None, ()
    else:
        before = Estimate(prior.value, prior.std)
    falls = of_either_sign(Estimate(0.0, 1e3 * before.value), pairs)
    size = float(np.median(np.linalg.norm(predicted.forces.wrench[predicted.targets, :3], axis=1)))
    if falls.value < -max(3 * falls.std, FALLS * size):
        deeper = np.concatenate([pair.depth for pair in pairs])
        change = np.concatenate([pair.change for pair in pairs])
        raise Refused(Finding(
            "CS3117", "error", f"the corrected pass, which by force_log.sign cut {1e6 * np.abs(deeper).mean():.0f} um "
            f"deeper, shows less force ({np.sign(np.median(change)) * np.abs(change).mean():+.1f} N): "
            f"{1e-3 * falls.value:.3g} +- {1e-3 * two_sigma(falls.std):.3g} N/mm of depth (2 sigma)", file=source,
            hint="force_log.sign in cell.yaml is wrong (then the first correction doubled the error), or the logs are "
            "swapped; in conventional milling alone it may be so: then leave --first-forces out"))
    climbing = [pair.where(pair.climb > 0.5) for pair in pairs]
    climbing = [pair for pair in climbing if len(pair.depth) >= FEWEST_TARGETS]
    found = replace(posterior(before, climbing), climb_only=True) if climbing else posterior(before, pairs)
    findings = [Finding("CS4124", "note", f"cutting stiffness from {counted(found.pairs, 'pair')} of passes: {found.words()}",
                        file=source)]
    if not found.followed:
        findings.append(Finding(
            "CS4122", "warning", f"the passes do not determine the cutting stiffness: {found.words()}; the forces are taken as "
            "logged, and what it may leave is in left_um", file=source,
            hint="is each log that of its pass? Another pair, or --cutting-stiffness, tells more"))
    return found, tuple(findings)


def pass_pair(first: Predicted, second: Predicted, offsets: Array) -> PassPair:
    """A pass of the planned program (first) and one with offsets (N, 3) [m] (second), each under its own log, where both have
    force. Raises CompstiffError (CS4122) for too few such targets."""
    direction, across = across_feed(first.path, first.forces.wrench[:, :3])
    both = np.zeros(len(across), dtype=bool)
    both[np.intersect1d(first.targets, second.targets)] = True
    both &= across > 0
    if both.sum() < FEWEST_TARGETS:
        raise error("CS4122", "the two passes do not determine the cutting stiffness: only "
                    f"{counted(int(both.sum()), 'target')} with force in both, expected at least {FEWEST_TARGETS}",
                    file=first.path.toolpath.source, hint="is each log that of its pass? Leave --first-forces out, and correct "
                    "from the second log with --logged-with alone, or state it with --cutting-stiffness")
    n = direction[both]
    change = np.einsum("ni,ni->n", (second.forces.wrench - first.forces.wrench)[both, :3], n)
    depth = np.einsum("ni,ni->n", (standing(first, None) - standing(second, offsets))[both], n)
    variance = sum(np.nan_to_num(one.forces.standard_error[both]) ** 2 for one in (first, second))
    climb, slot = (share[both] for share in cut_shares(first.path, first.forces.wrench[:, :3]))
    return PassPair(depth, change, n, np.sqrt(np.einsum("ni,ni->n", variance, n**2)), climb, slot)
