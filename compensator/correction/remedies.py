"""What would lower the error on the part, each worked out again with the code that states it (expected_left.py)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compensator.correction.correct import Corrected, correct, restrained
from compensator.correction.cutting_prior import SLOT_DEPTH, WIDTH
from compensator.correction.cutting_stiffness import CuttingStiffness
from compensator.correction.engagement import LoggedPass, following_the_cut
from compensator.correction.expected_left import expected_left, foreseen
from compensator.correction.known_slot import known_slot
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.logged_pass import known_by_force
from compensator.correction.other_stance import best_shift, shifted, turned
from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.posture import advise
from compensator.correction.predict import Predicted
from compensator.correction.prediction import predict_path
from compensator.correction.settings import DEPTH, EXACTLY_ONE, Estimate
from compensator.correction.unloaded_robot import by_unloaded_robot
from identification.common.findings import CompstiffError
from identification.model.cell import Cell

Array = NDArray[np.float64]
# 1 sigma of a scale that `verify` finds over some hundred places, of a gain by a known weight, and of how a sensor is turned
# [deg] by a weight in two postures. Engineering judgement.
SCALE_STD, GAIN_STD, MOUNTING_STD = 0.01, 0.003, 0.3
# A cause that makes up less than this share of the mean square is not looked at.
WORTH = 0.02


@dataclass(frozen=True, eq=False)
class Remedy:
    """name: what to do; effort: what it takes; left (M,) [m]: 1 sigma of what is then expected on the part, at the targets of
    the corrected program, which may be others for a remedy that adds some."""

    name: str
    effort: str
    left: Array


def remedies(corrected: Corrected) -> list[Remedy]:
    """Those that apply to this program, in no order. A remedy that cannot be worked out (the turned robot does not reach, the
    finer program is refused) is left out."""
    found = []
    for name, effort, tried in _tried(corrected):
        try:
            left = tried()
        except CompstiffError:
            continue
        if left is not None:
            found.append(Remedy(name, effort, left))
    return found


def _tried(corrected: Corrected) -> Iterator[tuple[str, str, Callable[[], Array | None]]]:
    left, settings = corrected.left, corrected.predicted.settings
    square = float(np.mean(left.std**2)) if len(left.model) else 0.0

    def matters(values: Array) -> bool:
        return bool(len(values)) and float(np.mean(values**2)) > WORTH * square

    if matters(left.cut):
        yield ("mill and log the corrected pass, then correct with --logged-with (and --first-forces)", "one more pass",
               lambda: _next_pass(corrected))
        if corrected.stiffness is None:
            yield ("state the cut in cell.yaml: material, tool_diameter_mm, contact_mm, and the spindle's speed",
                   "four lines in cell.yaml",
                   lambda: _known_cut(corrected))
            if settings.correction.depth_of_cut is None:
                yield (f"state the depth across the feed, --depth-of-cut (as if it were {1e3 * DEPTH:g} mm)", "an option",
                       lambda: _stated_depth(corrected))
        if corrected.logged.slot is None and left.at_slot_depths:
            yield (f"state the depth of the slots along the axis, --slot-depth (as if it were {1e3 * SLOT_DEPTH:g} mm)",
                   "an option", lambda: _stated_slots(corrected))
    if matters(left.motion) and settings.correction.scale == EXACTLY_ONE:
        yield ("measure a milled part and take --scale from verify", "measure some hundred places", lambda: _scaled(corrected))
    if matters(left.sensor) and corrected.predicted.cell.force_log.form.gain_std > GAIN_STD:
        yield (f"check the force sensor with a known weight, force_log.gain_std {GAIN_STD:g}", "a weight and a crane scale",
               lambda: _known_sensor(corrected, gain_std=GAIN_STD))
    if matters(left.mounting) and (corrected.predicted.cell.force_log.form.mounting_std_deg or 0.0) > MOUNTING_STD:
        yield (f"read a known weight in two postures, force_log.mounting_std_deg {MOUNTING_STD:g}", "a weight and two poses",
               lambda: _known_sensor(corrected, mounting_std_deg=MOUNTING_STD))
    if matters(left.accuracy):
        yield ("measure this part, compstiff learn, then --learned --repeats setup (at most)", "a part, some hundred points",
               lambda: _without_statement(corrected))
    if matters(left.model):
        yield ("as many load tests again", "some hours at the robot", lambda: _more_tests(corrected))
    log = corrected.predicted.forces.log
    if matters(left.scatter) and log.revolution is None and log.time is not None:
        yield ("state the spindle's speed, --spindle-rpm (at most)", "an option", lambda: _no_scatter(corrected))
    if matters(left.between):
        tolerance = 0.5 * settings.correction.tolerance
        yield (f"--tolerance {1e6 * tolerance:g} --tighten-zones", "two options, and more targets",
               lambda: _finer(corrected, tolerance))
    loaded = corrected.predicted.loaded
    advice = advise(loaded)
    if advice is not None and advice.best != advice.planned:
        turn = float(advice.turn[advice.best])
        yield (f"turn the robot by {np.degrees(turn):+.0f} deg about the tool's axis", "another posture",
               lambda: _elsewhere(corrected, turned(loaded, turn)))
    shift = best_shift(loaded)
    if shift is not None:
        axis = int(np.argmax(np.abs(shift)))
        yield (f"move the work object by {1e3 * shift[axis]:+.0f} mm along base {'xyz'[axis]}", "another set-up",
               lambda: _elsewhere(corrected, shifted(loaded, shift)))


def _again(corrected: Corrected, predicted: Predicted, logged: LoggedPass | None = None) -> Array:
    """1 sigma (M,) [m] of a program in which something is otherwise."""
    cut, prediction = following_the_cut(predicted, corrected.kept, logged or corrected.logged)
    known = foreseen(predicted, cut, prediction, by_unloaded_robot(predicted))
    return expected_left(predicted, corrected.kept, known, corrected.residual, corrected.between).std


def _with(predicted: Predicted, loaded: LoadedPath) -> Predicted:
    return replace(predicted, loaded=loaded, prediction=predict_path(loaded))


def _next_pass(corrected: Corrected) -> Array:
    """The tool of the next logged pass stands off the plan by what this one leaves, not by the whole deviation."""
    predicted = corrected.predicted
    position = predicted.prediction.position
    size = np.linalg.norm(position, axis=1)
    offsets = np.zeros((len(predicted.path.toolpath), 3))
    offsets[predicted.targets] = -position * np.maximum(1 - corrected.left.std / np.maximum(size, 1e-12), 0.0)[:, None]
    return _again(corrected, predicted, replace(
        corrected.logged, offsets=PassOffsets.of_written(offsets, predicted.path, corrected.kept)))


def _known_cut(corrected: Corrected) -> Array | None:
    known = known_by_force(corrected.predicted)
    if known is None:
        return None
    std = known.value * float(np.sqrt(np.expm1(WIDTH**2)))
    stated = CuttingStiffness(known.value, std, "material", mean_std=std, climb_only=True)
    return _again(corrected, corrected.predicted, replace(corrected.logged, stiffness=stated))


def _stated_depth(corrected: Corrected) -> Array | None:
    """Corrected anew: other moves ask for targets then, and less is held back behind sharp corners."""
    planned = corrected.planned
    chosen = replace(planned.settings.correction, depth_of_cut=DEPTH)
    stated = correct(replace(planned, settings=replace(planned.settings, correction=chosen)))
    return None if stated.stiffness is None else stated.left.std


def _stated_slots(corrected: Corrected) -> Array:
    planned = corrected.planned
    settings = replace(planned.settings, correction=replace(planned.settings.correction, slot_depth=SLOT_DEPTH))
    sent = corrected.logged.offsets
    slot, _ = known_slot(replace(planned, settings=settings), None if sent is None else sent.over(planned.path),
                         corrected.stiffness)
    return _again(corrected, corrected.predicted, replace(corrected.logged, slot=slot))


def _scaled(corrected: Corrected) -> Array:
    predicted = corrected.predicted
    settings = replace(predicted.settings, correction=replace(predicted.settings.correction, scale=Estimate(1.0, SCALE_STD)))
    loaded = replace(predicted.loaded, model=predicted.model.scaled(1.0, SCALE_STD))
    return _again(corrected, _with(replace(predicted, settings=settings), loaded))


def _known_sensor(corrected: Corrected, **known: float) -> Array:
    predicted, log = corrected.predicted, corrected.predicted.cell.force_log
    return _in_cell(corrected, replace(predicted.cell, force_log=replace(log, form=log.form.model_copy(update=known))))


def _without_statement(corrected: Corrected) -> Array:
    """Nothing is left of the unloaded robot's error: an upper bound of what learning it gains."""
    return _in_cell(corrected, replace(corrected.predicted.cell, accuracy=None))


def _in_cell(corrected: Corrected, cell: Cell) -> Array:
    predicted = corrected.predicted
    return _again(corrected, _with(predicted, replace(predicted.loaded, path=replace(predicted.path, cell=cell))))


def _more_tests(corrected: Corrected) -> Array:
    """Twice the measurements: half the posterior's variances, as far as it is theirs and not the prior's."""
    predicted = corrected.predicted
    model = replace(predicted.model, covariance=0.5 * predicted.model.covariance, interval=None)
    return _again(corrected, _with(predicted, replace(predicted.loaded, model=model)))


def _no_scatter(corrected: Corrected) -> Array:
    predicted = corrected.predicted
    forces = replace(predicted.forces, standard_error=np.zeros_like(predicted.forces.standard_error))
    return _again(corrected, _with(predicted, replace(predicted.loaded, forces=forces)))


def _finer(corrected: Corrected, tolerance: float) -> Array:
    planned = corrected.planned
    chosen = replace(planned.settings.correction, tolerance=tolerance, tighten_zones=True)
    return correct(replace(planned, settings=replace(planned.settings, correction=chosen))).left.std


def _elsewhere(corrected: Corrected, other: LoadedPath | None) -> Array | None:
    """What is left between targets grows as the deviation does there; what is held back is worked out there."""
    if other is None:
        return None
    predicted = _with(corrected.predicted, other)
    size, before = (np.linalg.norm(one.prediction.position, axis=1) for one in (predicted, corrected.predicted))
    grown = np.ones(len(predicted.path.toolpath))
    grown[predicted.targets] = size / np.maximum(before, 1e-12)
    between = corrected.between
    if between is not None:
        between = replace(between, square=between.square * grown[between.piece] ** 2)
    cut, prediction = following_the_cut(predicted, corrected.kept, corrected.logged)
    residual = restrained(predicted, corrected.logged, cut, prediction, corrected.air).residual
    return _again(replace(corrected, between=between, residual=residual), predicted)
