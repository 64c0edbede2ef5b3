"""Predicted: one program under its logged forces, and how far they push the tool off it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.beside_stock import beside_stock
from compensator.correction.correctable import check_known, targets_to_correct
from compensator.correction.if_another import IfAnother, if_another
from compensator.correction.loaded_path import LoadedPath
from compensator.correction.log_numbers import by_given_targets
from compensator.correction.prediction import Prediction, predict_path
from compensator.correction.settings import DEFAULTS, EXACTLY_ONE, SLOPE, Settings
from compensator.correction.taken_as_given import TakenAsGiven, taken_as_given
from compensator.cutting.coefficients import read_coefficients
from compensator.cutting.predicted_log import in_base, predicted_log
from compensator.forces.marks import has_marks, placed_by_marks
from compensator.forces.placement import ForceLog, place_forces, read_force_log
from compensator.forces.target_forces import TargetForces
from compensator.forces.two_logs import compared
from compensator.learned.learned import Learned
from compensator.learned.learned_file import read_learned
from compensator.path.arc_length import borders
from compensator.path.robot_path import RobotPath, robot_path
from compensator.posting.read_toolpath import PlannedProgram
from compensator.rapid import marks_of, said_of_order
from identification.common.added_targets import read_added
from identification.common.arrays import rms
from identification.common.findings import CompstiffError, Finding, Refused, counted, error
from identification.common.made_from import said_of_tables
from identification.common.quantities import two_sigma
from identification.model.cell import Cell
from identification.model.cell_sizes import odd_sizes
from identification.model.quaternion_order import in_words, other_order
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# A program of fewer moves may well cut on all of them. In the air is what has this share of the largest force at most, or so
# little [N]; engineering judgement, as of --tare (forces/zero.py).
FEW, QUIET, LEAST = 5, 0.2, 5.0
# Tools that are no farther apart than this [m, rad] are one; one shorter than this [m] is given in metres.
SAME_TOOL, SAME_TURN, SHORT_TOOL = 1e-3, np.radians(0.5), 2e-3
# The cutters of one spindle stand beside its axis by no more than this [m], and tilted by no more (engineering judgement).
BESIDE_AXIS, TILTED = 5e-3, np.radians(2.0)


@dataclass(frozen=True, eq=False)
class Predicted:
    """One program with the deviation predicted for its targets with force. The model is scaled as the settings say."""

    settings: Settings
    program: PlannedProgram
    loaded: LoadedPath
    prediction: Prediction
    findings: tuple[Finding, ...]

    @property
    def path(self) -> RobotPath:
        """The program as the robot drives it."""
        return self.loaded.path

    @property
    def cell(self) -> Cell:
        """The cell it runs in."""
        return self.loaded.path.cell

    @property
    def model(self) -> IdentifiedModel:
        """The robot's stiffnesses, scaled."""
        return self.loaded.model

    @property
    def forces(self) -> TargetForces:
        """One wrench a target."""
        return self.loaded.forces

    @property
    def targets(self) -> Indices:
        """The targets (M,) that the prediction is of."""
        return self.loaded.targets

    @property
    def slope(self) -> float:
        """The steepest change of the offset along the path [m/m]; none where the log names its targets, as every step is the
        force's own then."""
        return self.settings.correction.slope or (np.inf if self.forces.named else SLOPE)

    def as_dict(self) -> dict[str, Any]:
        """The figures of the prediction, JSON values."""
        size = np.linalg.norm(self.prediction.at_rest, axis=1)
        std = np.sqrt(np.trace(self.prediction.at_rest_covariance, axis1=1, axis2=2))
        return {
            "targets": len(self.path.toolpath),
            "with_force": int(self.forces.forced.sum()),
            "without_sample": int((self.forces.samples == 0).sum()),
            "predicted": len(size),
            "deviation_um": largest_and_rms(1e6 * size),
            "deviation_std_um": largest_and_rms(1e6 * std),
            "learned_um": None if self.loaded.learned is None else largest_and_rms(
                1e6 * np.linalg.norm(self.prediction.learned, axis=1)),
        }

    @property
    def taken(self) -> TakenAsGiven:
        """What no file of the job can prove."""
        return taken_as_given(self.loaded, self.settings, self.another)

    @property
    def another(self) -> IfAnother | None:
        """Of predicted forces: what another stock, cutter or material would mean; None of a log."""
        return if_another(self.loaded, self.prediction.position)

    def lines(self) -> list[str]:
        """The prediction for the terminal."""
        return [*self.figure_lines(), *self.taken.lines()]

    def figure_lines(self) -> list[str]:
        """Its figures alone."""
        figures = self.as_dict()
        deviation, std, learned = figures["deviation_um"], figures["deviation_std_um"], figures["learned_um"]
        return [
            f"targets: {figures['targets']}, {figures['with_force']} with force, {figures['without_sample']} without a sample",
            f"predicted deviation: largest {deviation['largest']:.1f} um, RMS {deviation['rms']:.1f} um; uncertain "
            f"by up to {two_sigma(std['largest']):.1f} um (2 sigma)",
            *([] if learned is None else [
                f"of that learned from a measured part, beside the springs: largest {learned['largest']:.1f} um, RMS "
                f"{learned['rms']:.1f} um"]),
        ]


def largest_and_rms(values: Array) -> dict[str, float]:
    """JSON values; zero where there is none."""
    return {"largest": float(values.max()), "rms": rms(values)} if len(values) else {"largest": 0.0, "rms": 0.0}


def predict(
    cell: Cell, program: PlannedProgram, model: IdentifiedModel, forces: str | Path | ForceLog | None,
    settings: Settings = DEFAULTS,
) -> Predicted:
    """Deviation of every target with force, the log read from a file as cell and settings say, or already read; None: the
    forces are predicted from the stock, as `settings.cutting` says (docs/cutting.md).

    Raises CompstiffError (CS4723) for neither a log nor all that a prediction needs, Refused for a model (CS1022) or, without a
    log, coefficients (CS4752) that their own measurements reject, CompstiffError (CS4202) for a program without a move,
    (CS2011) for one that declares none of its targets, and what `read_force_log`, `place_forces`, `compared`,
    `targets_to_correct` and `predict_path` raise.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> predicted = compstiff.predict(cell, program, model, "insert.forces.parquet", compstiff.Settings.of(tare=((0, 2),)))
    >>> predicted.as_dict()["predicted"], (1e6 * predicted.prediction.position[0]).round(1).tolist()
    (2778, [-11.1, 13.0, 0.9])
    """
    _check_sources(forces, settings)
    cell = cell if forces is not None else in_base(cell)
    accepted = settings.correction.accept_rejected
    doubts = (*_of_rejected(model, accepted=accepted),
              *(_of_rejected_coefficients(settings.cutting.predict_force, accepted=accepted) if forces is None else ()),
              *said_of_tables(model.source, model.made_from))
    learned = _learned(cell, settings)
    if learned is not None:
        model = learned.model(model)
    if settings.correction.scale != EXACTLY_ONE:
        model = model.scaled(*settings.correction.scale)
    if not len(program.toolpath):
        raise error("CS4202", "the program has no move, so its force log belongs to no target",
                    file=str(program.source or program.toolpath.source), hint="name the module that holds the moves")
    check_known(program.toolpath)
    # Absurd numbers overflow on their way to a refusal; the refusal says so, NumPy need not.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        predicted = under_forces(robot_path(program.toolpath, cell), program, model, forces, settings, learned)
    return replace(predicted, findings=(*doubts, *predicted.findings, *_compared(predicted),
                                        *beside_stock(predicted.loaded, predicted.prediction, settings)))


def _check_sources(forces: str | Path | ForceLog | None, settings: Settings) -> None:
    """Raises CompstiffError (CS4723) where something is missing, or of no use, of what tells the forces."""
    coefficients, stock = settings.cutting.predict_force, settings.cutting.stock
    named = (("cutting coefficients (--predict-force)", coefficients), ("the stock (--stock)", stock))
    missing = [name for name, value in named if value is None]
    if missing and (forces is None or len(missing) == 1):
        raise error("CS4723", f"the forces cannot be predicted without {' and '.join(missing)}",
                    hint="name both, or a force log of this program (--forces)")
    if forces is None and (settings.log.tare or settings.log.other_forces or settings.correction.logged_with):
        raise error("CS4723", "--tare, --other-forces and --logged-with are about a force log, and none is named",
                    hint="leave them out, or name the log with --forces")


def _compared(predicted: Predicted) -> list[Finding]:
    """What another log of the program says of this one; none was named: nothing."""
    settings = predicted.settings
    if settings.log.other_forces is None:
        return []
    alone = replace(settings, log=replace(settings.log, other_forces=None), correction=replace(
        settings.correction, logged_with=None))
    other = under_forces(predicted.path, predicted.program, predicted.model, settings.log.other_forces, alone,
                         predicted.loaded.learned)
    return compared(other.forces, predicted.forces, predicted.path)


def _of_rejected(model: IdentifiedModel, *, accepted: bool) -> list[Finding]:
    """A model that its own measurements reject: Refused (CS1022), or a warning (CS1023) where it was asked for all the same; of
    one that leaves open which of several causes it is a warning (CS1027)."""
    source = str(model.source) if model.source else None
    if model.open_between:
        return [Finding("CS1027", "warning", "the measurements that this model was made from fit several causes alike "
                        f"({model.open_between}): the likeliest is carried, and what they differ by is in the sigmas",
                        file=source, hint="compstiff design --add 3 MEASUREMENTS --diagnosis DIAGNOSIS plans loads that tell "
                        "them apart")]
    if not model.rejected:
        return []
    message = f"the measurements that this model was made from reject it ({model.rejected})"
    if not accepted:
        raise Refused(Finding("CS1022", "error", f"{message}: its predictions are off by more than they say", file=source,
                              hint="compstiff diagnose CELL MEASUREMENTS -o diagnosis.json --extended FILE finds what it "
                              "lacks; --accept-rejected uses it all the same"))
    return [Finding("CS1023", "warning", f"{message}; it is used all the same (--accept-rejected)", file=source,
                    hint="the standard deviations do not say how far off it may be: measure after the first pass (verify)")]


def _of_rejected_coefficients(file: Path | None, *, accepted: bool) -> list[Finding]:
    """Coefficients that their own log rejects: Refused (CS4752), or a warning where they were asked for all the same."""
    message = "" if file is None else read_coefficients(file).rejection
    if not message:
        return []
    if not accepted:
        raise Refused(Finding("CS4752", "error", message, file=str(file),
                              hint="mend what is named there (the stock's file, the cutter, the log) and run compstiff cutting "
                              "again; without --forces it takes the table's; --accept-rejected uses these all the same"))
    return [Finding("CS4752", "warning", f"{message}; they are used all the same (--accept-rejected)", file=str(file),
                    hint="the sigmas do not say how far off they may be: measure after the first pass (verify)")]


def _learned(cell: Cell, settings: Settings) -> Learned | None:
    """What a measured part taught, as far as the program takes it. Raises what `read_learned` raises; CompstiffError (CS5324):
    --scale beside it, which is learned too."""
    chosen = settings.correction
    if chosen.learned is None:
        return None
    if chosen.scale != EXACTLY_ONE:
        raise error("CS5324", "--scale and --learned say both how far the robot gives way in motion", file=str(chosen.learned),
                    hint="leave --scale out: the learned file has it in its springs")
    return read_learned(chosen.learned, cell).carried(chosen.repeats)


def under_forces(
    path: RobotPath, program: PlannedProgram, model: IdentifiedModel, forces: str | Path | ForceLog | None, settings: Settings,
    learned: Learned | None = None,
) -> Predicted:
    """The program as the robot drives it, under the forces of one log, or, without one, under those its stock lets expect.
    Raises as `predict`."""
    of_program: tuple[Finding, ...] = (*program.toolpath.findings, *odd_sizes(path.cell))
    noticed = of_program
    try:
        log = _by_marks(read_log(path, forces, settings), path, program, settings)
        if settings.correction.logged_with is not None:
            added = read_added(settings.correction.logged_with)
            log = log if added is None else by_given_targets(log, path, added)
        followed = path.toolpath.driven is not None or bool(path.toolpath.ways)
        noticed = (*noticed, *log.findings, *said_of_order(program.text, ~program.air, log.key, followed=followed))
        placed = place_forces(log, path, path.cell, tare=settings.log.tare, trust_tare=settings.log.trust_tare)
        # Of a pass with offsets its positions are judged with these (as_driven.py).
        of_log = [finding for finding in placed.findings if finding.code != "CS3120" or settings.correction.logged_with is None]
        noticed = (*of_program, *(path.findings if placed.forced.any() else ()), *of_log,
                   *_without_zero(placed, path, settings), *other_tools(path, placed.forced))
        targets, left = targets_to_correct(path, placed)
        if learned is not None:
            learned.check_set_up(path, targets, settings.correction.repeats)
        loaded = LoadedPath(path, placed, model, targets, learned)
        prediction = predict_path(loaded)
    except CompstiffError as stopped:
        # What was noticed before may be the reason: a work object taken from cell.yaml, a guessed configuration.
        raise type(stopped)(*stopped.findings, *noticed) from stopped
    told = taken_as_given(loaded, settings).finding(path.cell.cutting, settings.correction.depth_of_cut, placed.log.source)
    order = said_of_order(program.text, np.isin(np.arange(len(path.toolpath)), targets), log.key,
                          followed=any(finding.code in ("CS3122", "CS3123") for finding in placed.findings)
                          or (log.predicted is not None and path.toolpath.driven is not None))
    return Predicted(settings, program, loaded, prediction, (*noticed, *left, *order, *prediction.findings, *told))


def read_log(path: RobotPath, forces: str | Path | ForceLog | None, settings: Settings) -> ForceLog:
    """The log, read from a file or as it is; None: predicted."""
    if isinstance(forces, ForceLog):
        return forces
    if forces is not None:
        return read_force_log(forces, path.cell.force_log.form, log_format=settings.log.log_format,
                              spindle_rpm=settings.log.spindle_rpm, borders=borders(path.length))
    assert settings.cutting.predict_force is not None
    assert settings.cutting.stock is not None
    return predicted_log(path, read_coefficients(settings.cutting.predict_force), settings.cutting.stock,
                         settings.log.spindle_rpm)[0]


def _by_marks(log: ForceLog, path: RobotPath, program: PlannedProgram, settings: Settings) -> ForceLog:
    """A log with time and the column `mark` placed by the output that the program switches; others as they are."""
    form = path.cell.force_log.form
    if log.key != "time" or settings.log.log_format or not has_marks(log, form):
        return log
    marks = marks_of(program.text, settings.posting.mark)
    if marks is None:
        raise error("CS3088", "the log has a column mark, and no move of the program switches an output", file=log.source,
                    hint="give the program that was driven, which post --mark or correct --mark wrote")
    toolpath, text = path.toolpath, np.arange(len(path.toolpath))
    ways = [(None if np.array_equal(way.order, text) else way.order, marks_of(program.text, settings.posting.mark, way.order))
            for way in toolpath.ways] or [(toolpath.driven, marks)]
    return placed_by_marks(log, form, path, [(order, found.at) for order, found in ways if found is not None])


def other_tools(path: RobotPath, which: NDArray[np.bool_], of_moves: str = "with force") -> list[Finding]:
    """The tools of these moves (N,) that are not cell.yaml's (CS2055)."""
    findings = []
    for flange_from_tcp, places in path.each_tool(np.flatnonzero(which & path.known)):
        apart = path.cell.flange_from_tcp.inverse() @ flange_from_tcp
        off, turn = float(np.linalg.norm(apart.position)), float(np.arccos(np.clip((np.trace(apart.rotation) - 1) / 2, -1, 1)))
        if off > SAME_TOOL or turn > SAME_TURN:
            hint = _no_other_cutter(path.cell.flange_from_tcp, flange_from_tcp, apart)
            findings.append(Finding(
                "CS2055", "warning" if hint else "note", f"the tool of {counted(len(places), 'move')} {of_moves} is "
                f"{1e3 * off:.1f} mm and {np.degrees(turn):.1f} deg from cell.yaml's; the program's is used",
                file=path.toolpath.source, hint=hint))
    return findings


def _no_other_cutter(of_cell: Frame, of_program: Frame, apart: Frame) -> str:
    """What a tool may be that is not the cell's, nor one that differs from it along its axis alone, as other cutters in the
    same spindle do; "" for one of those."""
    if not of_program.position.any():
        return "its TCP is the flange, as that of tool0: do the moves name the tool?"
    if np.linalg.norm(of_program.position) < SHORT_TOOL:
        return "is its tooldata in metres?"
    beside, tilt = float(np.linalg.norm(apart.position[:2])), float(np.arccos(np.clip(apart.rotation[2, 2], -1, 1)))
    if np.linalg.norm(apart.position) <= SAME_TOOL and (order := _order(of_cell, of_program)):
        return order
    return "" if beside <= BESIDE_AXIS and tilt <= TILTED else (
        f"another cutter in the same spindle differs along its axis alone, this tool stands {1e3 * beside:.0f} mm beside it, "
        f"tilted by {np.degrees(tilt):.0f} deg: is it the tool of this cell?")


def _order(of_cell: Frame, of_program: Frame) -> str:
    """Which of the two has its quaternion in the order x y z w, where that is all they differ by."""
    for name, written, other in (("cell.yaml's tool.quaternion", of_cell, of_program), ("its tooldata", of_program, of_cell)):
        if in_words(written.rotation) and np.allclose(other_order(written.rotation), other.rotation, atol=SAME_TURN):
            return f"{name} read as x y z w is the other one: quaternions are w x y z, w first, as q1 in RAPID"
    return ""


def _without_zero(placed: TargetForces, path: RobotPath, settings: Settings) -> list[Finding]:
    """A warning (CS3087) where force stands on every move of a program, approach and retract too, and no bias was taken off."""
    count, size = len(placed.forced), np.linalg.norm(placed.wrench[:, :3], axis=1)
    zeroed = placed.unknown is not None or settings.log.tare or path.cell.force_log.bias is not None
    if zeroed or count < FEW or size.min() <= max(QUIET * size.max(), LEAST):
        return []
    return [Finding("CS3087", "warning", f"all {count} moves have force, at least {size.min():.0f} N, the first and the last "
                    "too: nothing shows where the sensor's zero is", file=placed.log.source,
                    hint="name moves in the air with --tare FIRST:LAST, or state force_log.bias_n in cell.yaml; "
                    "a program that cuts on every move is no mistake")]
