"""What is expected to be left on the part: 1 sigma at each corrected target, by cause.

The covariance of a prediction is that of the robot under the force as logged. On the part there is more:

    model     the prediction's covariance: stiffnesses, effects, the arm's weight where it is not known; and what a correction
              that is held back leaves
    force     of a force that was predicted: its coefficients, the model's error, where the stock stands
    scatter   of the mean force at a target, as the log shows it: large where the tool enters or leaves the cut; and the
              sensor's zero after a tare, as moves in the air show it
    sensor    the gain of the force sensor: so large a share of the deviation
    mounting  the force sensor turned in its seat by force_log.mounting_std_deg, and all forces with it (turned_sensor.py)
    motion    the moving robot gives way otherwise than at rest: motion.compliance_std of the deviation, until --scale of a
              measured pass says how much (then its error is the model's)
    cut       the corrected tool stands deeper in the cut, and the force grows by g: |d| g / (1 + g) is left by as much of the
              cutting stiffness as is not known (engagement.py)
    learned   with --learned: how far what is learned beside the springs is known, and the width of the remainder where no part
              was measured. The springs learned have the motion and the sensor's gain in them: `sensor` and `motion` are nothing
    accuracy  where the unloaded robot stands, as a calibration states it: `accuracy` of cell.yaml (unloaded_robot.py)
    between   what is left between targets on the moves beside one (between_targets.py); on moves that asked for nothing by how
              much the deviation bends from target to target, at most evenly distributed up to half the tolerance, and with
              no such limit where a move is too short to ask; never less than the step by which it turns with the path

Each is a size, not a direction, and they are added as independent. Left out: chatter, zones, warming.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.between_targets import BetweenTargets
from compensator.correction.engagement import CorrectedPass, Told
from compensator.correction.fine_grid import FULL, spacing_of
from compensator.correction.predict import Predicted
from compensator.correction.prediction import Prediction
from compensator.correction.settings import EXACTLY_ONE
from identification.common.arrays import Array, held_once, read_only, rms
from identification.common.quantities import two_sigma

Indices = NDArray[np.intp]
CAUSES = {"model": "the model", "force": "the predicted force", "scatter": "scatter of the force",
          "sensor": "gain of the force sensor", "mounting": "the force sensor's seat", "motion": "the robot in motion",
          "cut": "force that follows the cut", "learned": "what was learned", "accuracy": "the robot without load",
          "between": "between targets"}


@dataclass(frozen=True, eq=False)
class ExpectedLeft:
    """1 sigma (M,) [m] of how far the tool is off the plan at the corrected targets, by cause. at_depths, at_slot_depths:
    where nobody stated how deep the cut is across the feed, and in slots, depths [m] and what `cut` would be there [m], RMS."""

    model: Array
    force: Array
    scatter: Array
    sensor: Array
    mounting: Array
    motion: Array
    cut: Array
    learned: Array
    accuracy: Array
    between: Array
    at_depths: Told = ()
    at_slot_depths: Told = ()

    def __post_init__(self) -> None:
        read_only(*(getattr(self, cause) for cause in CAUSES))

    @property
    def std(self) -> Array:
        """Of all causes (M,) [m]."""
        return np.asarray(np.sqrt(np.sum([getattr(self, cause) ** 2 for cause in CAUSES], axis=0)))

    def as_dict(self) -> dict[str, Any]:
        """JSON values, micrometres."""
        if not len(self.model):
            return {"largest": 0.0, "rms": 0.0, **dict.fromkeys(CAUSES, 0.0)}
        return {"largest": 1e6 * float(self.std.max()), "rms": 1e6 * rms(self.std),
                **{cause: 1e6 * rms(getattr(self, cause)) for cause in CAUSES}}

    def line(self) -> str:
        """The same for the terminal."""
        figures = {name: two_sigma(value) for name, value in self.as_dict().items()}
        parts = ", ".join(f"{words} {figures[cause]:.1f}" for cause, words in CAUSES.items() if figures[cause])
        return (f"expected to be left on the part, 2 sigma: {figures['rms']:.1f} um RMS, {figures['largest']:.1f} um at most "
                f"({parts}){self._depth_decides()}")

    def sentence(self) -> str:
        """The same for the report."""
        figures = self.as_dict()
        causes = ", ".join(words for cause, words in CAUSES.items() if figures[cause])
        return (f"On the part {2 * figures['rms']:.1f} um RMS are expected to be left, {2 * figures['largest']:.1f} um at most "
                f"(2 sigma), by these causes: {causes}{self._depth_decides()}.")

    @property
    def mostly_unknown_cut(self) -> bool:
        """Whether most of it comes from a cut whose depth nobody stated."""
        return self.wall_decides or self.slots_decide

    @property
    def wall_decides(self) -> bool:
        """Whether it is the depth across the feed that nobody stated."""
        return self._decides(self.at_depths)

    @property
    def slots_decide(self) -> bool:
        """Whether it is the depth of the slots."""
        return self._decides(self.at_slot_depths)

    def _decides(self, told: Told) -> bool:
        figures, most = self.as_dict(), max((1e6 * left for _, left in told), default=0.0)
        return bool(figures["cut"] > 0.5 * figures["rms"] and most > 0.5 * figures["cut"])

    def _depth_decides(self) -> str:
        """What to state where the unknown cut is most of it, and what that would change."""

        def of(told: Told) -> str:
            return ", ".join(f"{1e6 * left:.1f} um at {1e3 * depth:g} mm" for depth, left in told)

        wall = (f"; how deep the cut is decides, and nobody stated it: the cut leaves {of(self.at_depths)} (--depth-of-cut; or "
                "cutting in cell.yaml)")
        slots = f"; how deep the slots are decides, and nobody stated it: they leave {of(self.at_slot_depths)} (--slot-depth)"
        return wall * self.wall_decides + slots * self.slots_decide


@dataclass(frozen=True, eq=False)
class Foreseen:
    """What is known of it before anything is written, so that the prediction need not be held any longer: size (M,) [m] of the
    deviation, its variance (M,) [m^2] by cause, cut (M,) [m], at_depths and at_slot_depths (engagement.py), and how far the
    deviation bends and turns on the way to each target (N + added,) [m]."""

    size: Array
    of_model: Array
    of_force: Array
    of_scatter: Array
    of_learned: Array
    of_mounting: Array
    of_accuracy: Array
    cut: Array
    at_depths: Told
    at_slot_depths: Told
    bent: Array
    turned: Array


def foreseen(predicted: Predicted, cut: CorrectedPass, prediction: Prediction, unloaded: Array | None) -> Foreseen:
    """Of the pass that the corrected program will be, the prediction of its deviation, and the covariance (M, 3, 3) [m^2] of
    where the robot stands without load, if it is stated."""
    # What is learned of the rest may be known better together with the springs than the springs by themselves.
    of_model = np.trace(prediction.covariance, axis1=1, axis2=2) - cut.in_covariance**2
    of_scatter = np.clip(prediction.of_scatter, 0.0, np.maximum(of_model, 0.0))
    of_force = np.clip(prediction.of_force, 0.0, np.maximum(of_model - of_scatter, 0.0))
    of_learned = np.clip(prediction.of_learned, 0.0, np.maximum(of_model - of_scatter - of_force, 0.0))
    of_model = np.maximum(of_model - of_scatter - of_force - of_learned, 0.0)
    if prediction.wide is not None:
        of_model = of_model + prediction.wide.missing
    return Foreseen(np.linalg.norm(prediction.position, axis=1), of_model,
                    held_once(of_force), of_scatter, held_once(of_learned), _size_of(prediction.turned, len(of_model)),
                    _size_of(unloaded, len(of_model)), cut.left.copy(), cut.at_depths,
                    cut.at_slot_depths, *_bent_and_turned(predicted, prediction))


def _size_of(covariance: Array | None, count: int) -> Array:
    """Variance (M,) [m^2] of all components; nothing where there is no covariance."""
    return held_once(np.broadcast_to(0.0, count) if covariance is None else np.trace(covariance, axis1=1, axis2=2))


def expected_left(
    predicted: Predicted, kept: Indices, known: Foreseen, residual: Array, between: BetweenTargets | None
) -> ExpectedLeft:
    """Of a corrected program whose targets as given stand at `kept` (N,); residual (M,) [m]: what its correction leaves by the
    model."""
    gain, unknown = np.sqrt(in_proportion(predicted))
    return ExpectedLeft(
        np.sqrt(known.of_model + residual**2), held_once(np.sqrt(known.of_force)), np.sqrt(known.of_scatter), gain * known.size,
        held_once(np.sqrt(known.of_mounting)), unknown * known.size, known.cut, held_once(np.sqrt(known.of_learned)),
        held_once(np.sqrt(known.of_accuracy)), _between(predicted, kept, known, between)[predicted.targets], known.at_depths,
        known.at_slot_depths)


def in_proportion(predicted: Predicted) -> tuple[float, float]:
    """Variances of the shares by which every deviation may be another: the force sensor's gain, and the robot in motion."""
    cell = predicted.path.cell
    if predicted.loaded.learned is not None:
        return 0.0, 0.0
    unknown = cell.motion.compliance_std if predicted.settings.correction.scale == EXACTLY_ONE else 0.0
    return cell.force_log.form.gain_std**2, unknown**2


def _between(predicted: Predicted, kept: Indices, known: Foreseen, between: BetweenTargets | None) -> Array:
    """What is left beside each target (N + added,) [m]: root mean square along that of the moves to and from it which leaves
    more, for whoever stands beside a target may stand on either."""
    path, settings = predicted.path, predicted.settings.correction
    spacing = spacing_of(path.toolpath, settings.min_spacing.length, settings.min_spacing.time)
    # The move as given that each target of the program ends, or lies in, and how long that is.
    owner = np.searchsorted(kept, np.arange(len(path.toolpath)))
    step = np.diff(path.length[kept], prepend=np.nan)[owner]
    nothing = np.where(step >= 2 * FULL * spacing, 0.5 * settings.tolerance / np.sqrt(3.0), np.inf)
    square = np.minimum(known.bent, nothing) ** 2
    if between is not None and len(between.left):
        count = np.bincount(between.piece, minlength=len(square))
        seen = np.bincount(between.piece, between.square, minlength=len(square))
        square = np.where(count > 0, np.maximum(seen / np.maximum(count, 1), 0.0), square)
    square = np.maximum(square, known.turned**2)
    return np.asarray(np.sqrt(np.maximum(square, np.append(square[1:], 0.0))))


def _bent_and_turned(predicted: Predicted, prediction: Prediction) -> tuple[Array, Array]:
    """How far a straight line from the target before to each (N + added,) is off the deviation [m], root mean square along the
    move. Of one that bends by as much as its neighbours say c h^2 / sqrt(120), a parabola of second derivative c, the larger
    one of both ends, over the length h. Where a force begins or ends it does so anywhere on the move, and the deviation d steps
    there: |d| / sqrt(6). And where straight moves turn by an angle a at a target the force turns there, and d steps by a |d|,
    which means over a revolution of the spindle show as no step: a saw-tooth of a |d| / sqrt(12)."""
    path, count = predicted.path, len(predicted.path.toolpath)
    deviation = np.full((count, 3), np.nan)
    deviation[prediction.targets] = path.axes.turned_to_rest(prediction.position, prediction.targets)
    with np.errstate(invalid="ignore", over="ignore"):
        step = np.maximum(np.diff(path.length), 1e-9)
        way = np.diff(path.rest_from_tcp.position, axis=0)
        way /= np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
        # Squares at each target by component: of a long program what all three take at once would be much.
        bend, turn, size = np.zeros((3, count))
        for off, towards in zip(deviation.T, way.T, strict=True):
            bend[1:-1] += np.diff(np.diff(off) / step) ** 2
            turn[1:-1] += np.diff(towards) ** 2
            size += off**2
        bend[1:-1] = np.sqrt(bend[1:-1]) / (0.5 * (step[1:] + step[:-1]))
        turn = np.nan_to_num(np.sqrt(turn * size), posinf=0.0)
        bent = np.fmax(bend[:-1], bend[1:]) * step**2 / np.sqrt(120.0)
        one_end = np.sqrt(np.fmax(size[:-1], size[1:]) / 6.0)
    bent = np.where(np.isnan(size[:-1]) | np.isnan(size[1:]), one_end, bent)
    return (np.insert(np.nan_to_num(bent, posinf=0.0), 0, 0.0),
            np.insert(np.maximum(turn[:-1], turn[1:]) / np.sqrt(12.0), 0, 0.0))
