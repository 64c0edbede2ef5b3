"""Corrected: one program whose loaded tool stands on the plan, from the prediction to the text read back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.before_touch import air_beside
from compensator.correction.between_targets import BetweenTargets, left_between
from compensator.correction.corners import with_zones
from compensator.correction.correction import Correction, Restraint, correct_path
from compensator.correction.cutting_stiffness import CuttingStiffness
from compensator.correction.engagement import CorrectedPass, LoggedPass, following_the_cut
from compensator.correction.expected_left import ExpectedLeft, expected_left, foreseen
from compensator.correction.intermediate_targets import with_intermediate_targets
from compensator.correction.least_depth import least_depth
from compensator.correction.logged_pass import logged_pass
from compensator.correction.nothing_corrected import nothing_corrected
from compensator.correction.posture import Advice, advise
from compensator.correction.predict import Predicted, largest_and_rms
from compensator.correction.prediction import Prediction
from compensator.correction.read_back import read_back
from compensator.correction.turned_already import said_of_own_turns
from compensator.correction.unloaded_robot import by_unloaded_robot
from compensator.correction.waiting import Waiting, told, waiting
from compensator.correction.worse import risk_of
from compensator.path.feasibility import FeedCheck, check_feed, judge
from compensator.rapid import read_rapid, rewrite, with_marks
from identification.common.findings import CompstiffError, Finding, Refused, counted
from identification.model.controller import check_rapid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Corrected:
    """One program, corrected. planned: the program as it was given; predicted: with the intermediate targets that were added to
    it, kept (N,) the places of the given targets among them. content: the bytes to write. residual (M,) [m]: distance of the
    loaded tool from the plan with the numbers as written; between: the same between targets, None where no move asks for half
    the tolerance; left: 1 sigma of what is expected on the part, by cause; worse (M,): probability that a target is farther off
    than uncorrected. left_as_logged (M,) [m]: how far off a cutting stiffness of 10 N/mm leaves the tool, None where the force
    was made to follow the cut. logged: what is known of the logged pass; gain: of the cut against the arm. feed: the feed
    check, and advice: on the posture, where they were asked for.
    waiting: where the next log tells more. air (M,): the share that is air of the line to a target from one in the air.
    """

    planned: Predicted
    predicted: Predicted
    kept: Indices
    correction: Correction
    content: bytes
    residual: Array
    between: BetweenTargets | None
    left: ExpectedLeft
    worse: Array
    left_as_logged: Array | None
    logged: LoggedPass
    gain: float
    feed: FeedCheck | None
    advice: Advice | None
    waiting: Waiting
    air: Array
    findings: tuple[Finding, ...]

    @property
    def stiffness(self) -> CuttingStiffness | None:
        """Of the cut; None where nothing is known but the force."""
        return self.logged.stiffness

    @property
    def first_added(self) -> int | None:
        """The first number that names another target in the corrected program than in the planned one."""
        moved = self.kept != np.arange(len(self.kept))
        return int(np.argmax(moved)) if moved.any() else None

    def as_dict(self) -> dict[str, Any]:
        """The figures of the job, JSON values: those of the prediction are of the program as given, those of the correction
        count its intermediate targets too."""
        offset, turn = (np.linalg.norm(values, axis=1) for values in (self.correction.offset, self.correction.turn))
        figures = self.planned.as_dict() | {
            "added_targets": len(self.predicted.path.toolpath) - len(self.kept),
            "corrected": len(offset),
            "corrected_added": int(np.isin(self.correction.targets, self.kept, invert=True).sum()),
            "offset_mm": largest_and_rms(1e3 * offset),
            "turn_deg": largest_and_rms(np.degrees(turn)),
            "residual_um": largest_and_rms(1e6 * self.residual),
            "between_um": self.between.as_dict() if self.between else None,
            "held_back": int((np.abs(self.correction.share - 1) > 0.01).sum()),
            "expected_left_um": self.left.as_dict(),
            "expected_worse": round(float(self.worse.sum()), 2),
            "left_at_10_n_per_mm_um": None if self.left_as_logged is None else largest_and_rms(1e6 * self.left_as_logged),
            "cutting_stiffness": None if self.stiffness is None else self.stiffness.as_dict() | {"gain": self.gain},
            "slot_stiffness": None if self.logged.slot is None else self.logged.slot.as_dict(),
            "waiting": self.waiting.as_dict(),
            "feed_check": self.feed.as_dict() if self.feed else None,
        }
        return figures | ({"posture": self.advice.as_dict()} if self.advice else {})

    def lines(self) -> list[str]:
        """The correction for the terminal."""
        figures = self.as_dict()
        offset, residual, held_back = figures["offset_mm"], figures["residual_um"], figures["held_back"]
        added = [f"intermediate targets added: {figures['added_targets']}; from target {self.first_added} on the corrected "
                 "program counts otherwise (offsets.csv: added)"] if figures["added_targets"] else []
        return [
            *self.planned.figure_lines(), *added,
            f"corrected: {self.corrected_words()}; largest correction {offset['largest']:.4f} mm and "
            f"{figures['turn_deg']['largest']:.4f} deg",
            f"left after correction, by the same model: largest {residual['largest']:.2f} um, RMS {residual['rms']:.2f} um ("
            + (f"{counted(held_back, 'correction')} held back, else the rounding of the written numbers)" if held_back
               else "the rounding of the written numbers)"),
            self.between_line(),
            self.left.line(),
            f"expected to end up farther off than uncorrected: {figures['expected_worse']:.1f} of {figures['corrected']} "
            "targets",
            *([] if self.stiffness is None else [f"cutting stiffness ({self.stiffness.origin}): {self.stiffness.words()}"]),
            *([] if self.logged.slot is None else [f"in slots, along the tool's axis ({self.logged.slot.origin}): "
                                                  f"{self.logged.slot.words()}"]),
            *([] if self.left_as_logged is None else [f"forces taken as logged: {self.as_logged()}"]),
            *([f"forces predicted from the stock: {self.as_logged()}"] if self.logged.on_plan else []),
            *(self.advice.lines() if self.advice else []),
            *(self.feed.lines() if self.feed else []),
            *self.planned.taken.lines(),
        ]

    def corrected_words(self) -> str:
        """How many targets were corrected, and how many of them the correction has added itself."""
        figures = self.as_dict()
        own = f", {figures['corrected_added']} of the {figures['added_targets']} added among them"
        return counted(figures["corrected"], "target") + (own if figures["added_targets"] else "")

    def between_line(self) -> str:
        """What is left between the targets, for people."""
        if self.between is not None:
            return self.between.line()
        return ("left between targets: the log shows no move that asks for more than "
                f"{0.5e6 * self.planned.settings.correction.tolerance:g} um")

    def as_logged(self) -> str:
        """What an unknown cutting stiffness leaves, for people."""
        left = self.as_dict()["left_at_10_n_per_mm_um"]
        if left is None:
            return "they are those of a tool on the plan, as the corrected one is"
        return (f"a cutting stiffness of 10 N/mm leaves {left['rms']:.1f} um RMS, {left['largest']:.1f} um at most "
                "(--cutting-stiffness, or correct the log of the corrected pass)")


def correct(planned: Predicted) -> Corrected:
    """The corrected program: zones, intermediate targets, the forces that the corrected pass meets, the correction under them,
    the text, and what it commands.

    Raises CompstiffError (CS0060) where the robot's controller does not run RAPID, and what `logged_pass`,
    `with_intermediate_targets`, `correct_path`, `read_back` and, if asked for, `check_feed` raise; Refused (CS3086) where
    nothing was corrected: nobody may take the planned text for a corrected one.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", compstiff.Settings.of(tare=((0, 2),)))
    >>> corrected = compstiff.correct(predicted)
    >>> corrected.as_dict()["corrected"], f"{1e3 * abs(corrected.correction.offset).max():.3f} mm"
    (3197, '0.326 mm')
    """
    check_rapid(planned.path.cell.robot, "correct writes RAPID", str(planned.program.source or planned.path.cell.source))
    try:
        return _corrected(planned)
    except CompstiffError as stopped:
        raise stopped.beside(planned.findings) from stopped


def _corrected(planned: Predicted) -> Corrected:
    logged, sent = logged_pass(planned)
    try:
        return _under(planned, logged, sent)
    except CompstiffError as stopped:
        # What the log says of its pass may be the reason for a limit that is passed.
        raise stopped.beside(logged.findings) from stopped


def _under(planned: Predicted, logged: LoggedPass, sent: Predicted) -> Corrected:
    """The same where it is known what the logged pass was; sent: the program with the log placed by it."""
    settings, feed_settings = planned.settings.correction, planned.settings.feed
    cornered, of_corners = with_zones(sent)
    del sent
    predicted, kept, looked_at = with_intermediate_targets(cornered)
    del cornered
    cut, prediction = following_the_cut(predicted, kept, logged)
    air = air_beside(looked_at if predicted.loaded.learned is None else None, predicted.targets)
    correction = restrained(predicted, logged, cut, prediction, air)
    unloaded = by_unloaded_robot(predicted)
    known = foreseen(predicted, cut, prediction, unloaded)
    at_risk = risk_of(predicted, cut, prediction, correction, unloaded)
    del prediction, unloaded
    posting = planned.settings.posting
    written = rewrite(predicted.program.text, correction.targets, correction.position, correction.quaternion,
                      correction.confdata, shared=posting.split is not None or posting.modules)
    content, of_marks = written.content, tuple[Finding, ...]()
    if planned.settings.posting.mark:
        content, of_marks = with_marks(read_rapid(content, predicted.program.text.source.name), planned.settings.posting.mark)
    of_feed = feed_settings.check_feed or feed_settings.strict_feed
    beside = looked_at.number if looked_at else np.empty(0, dtype=np.intp)
    wanted = np.arange(len(predicted.path.toolpath)) if of_feed else beside
    commanded, residual = read_back(cut.loaded, correction, content, wanted)
    between = (left_between(looked_at, commanded.base_from_tcp[np.searchsorted(wanted, beside)], logged) if looked_at else None)
    del looked_at
    feed = None
    if of_feed:
        feed = check_feed(judge(planned.path, planned.forces.forced),
                          judge(predicted.path, predicted.forces.forced, commanded), strict=feed_settings.strict_feed)
    findings = (*predicted.findings, *logged.findings, *of_corners, *cut.findings, *correction.findings, *written.findings,
                *of_marks, *(between.findings if between else ()), *(feed.findings if feed else ()),
                *said_of_own_turns(predicted, kept, correction))
    if written.content == planned.program.text.source.data:
        raise Refused(nothing_corrected(planned, predicted, correction),
                      *(finding for finding in findings if finding.level != "note"))
    advice = advise(planned.loaded) if settings.advise else None
    left = expected_left(predicted, kept, known, residual, between)
    waits = waiting(predicted, left)
    return Corrected(planned, predicted, kept, correction, content, residual, between, left,
                     at_risk.worse(left.between), cut.left_as_logged, logged, cut.gain, feed, advice, waits, air,
                     (*findings, *told(waits, predicted, len(planned.targets))))


def restrained(
    predicted: Predicted, logged: LoggedPass, cut: CorrectedPass, prediction: Prediction, air: Array
) -> Correction:
    """The correction of the pass that is corrected, held back where that is safer. Raises what `correct_path` raises."""
    settings = predicted.settings.correction
    return correct_path(cut.loaded, Restraint(prediction, cut.stood, settings.confidence, predicted.slope, settings.tolerance,
                                              least_depth(predicted, logged, cut.stood), air))
