"""`cutting`: the force coefficients of a tool in a material, from the log of any program that cut with it, or from the
table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.coefficients.fitted import FittedCoefficients
from compensator.coefficients.next_cut import next_cut
from compensator.coefficients.stock_top import by_top, said_of_the_top, too_large
from compensator.correction.logged_pass import driven_as_said
from compensator.correction.places_between import places_between
from compensator.correction.predict import Predicted, predict
from compensator.correction.settings import DEFAULTS, Settings
from compensator.cutting.coefficients import Coefficients
from compensator.cutting.cut import Cut, cut_of
from compensator.cutting.cutter import cutter_of, said_of_cutter
from compensator.cutting.materials import MATERIALS, coefficients_of
from compensator.cutting.posterior import ForcePosterior, ForceRows, fit_coefficients
from compensator.cutting.rows import FEWEST, logged_rows
from compensator.cutting.runout import missing_force
from compensator.cutting.settings import CuttingSettings
from compensator.cutting.stock_file import Blank, read_stock
from compensator.forces.placement import ForceLog
from compensator.forces.target_forces import TargetForces
from compensator.posting.read_toolpath import PlannedProgram
from identification.common.arrays import Array
from identification.common.files import sha256
from identification.common.findings import Finding, Refused, counted, error, verb
from identification.common.quantities import two_sigma
from identification.model.cell import Cell
from identification.model.cell_file import ForceLogFile
from identification.model.stiffness import IdentifiedModel

Flags = NDArray[np.bool_]
# Without a material in cell.yaml nothing is known before: a middle one, known to a factor of ten. Engineering judgement.
ANY_MATERIAL, ANY_WIDTH = "steel", 2.0
# What the table leaves of the force at a place, beside the coefficients.
TABLE_MODEL_ERROR = 0.05
# Of the targets with force at most such a share may lie beside the stock: roughing may have taken more than its file says.
MOST_BESIDE = 0.8
# A fit leaves no more than this share of the force in the middle of so many neighbours (right ones leave up to 3 %).
MOST_LEFT, NEIGHBOURS = 0.1, 8
# No mean force of a test cut is known better, in each component [N].
LEAST_NOISE = 0.5
# Chips of this share of the time say nothing of what a log tells.
SELDOM = 0.005
# No chip needs less or more than these shares of what the table has for its material, which is known to 40 %; one that does is
# as another material's within the second pair (engineering judgement).
OF_TABLE, AS_OF = (0.35, 2.5), (0.6, 1.6)
# A stock stands aside by no more than so many of its standard deviations: three directions do by chance in under one of a
# hundred programs.
MOST_ASIDE = 3.0
# What is said of coefficients that are none: `predict` refuses them.
REJECTED = ("CS4734", "CS4745", "CS4751")


def cutting_coefficients(
    cell: Cell, program: PlannedProgram, stock: str | Path, model: IdentifiedModel, forces: str | Path | ForceLog,
    settings: Settings = DEFAULTS,
) -> FittedCoefficients:
    """From the log of a program, what it started from, and the robot's model: while it was logged the tool stood off its plan
    by what the logged forces pushed it, and cut less.

    settings as for `predict`; logged_with: the offsets.csv that the program had. Raises what `predict`, `cut_of` and
    `offsets_of_pass` raise; CompstiffError (CS4730) for a log that shows too little of the cut; what
    `check_in_the_stock` raises.

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> program, model = compstiff.read_toolpath("insert.mod", cell), compstiff.read_stiffness("stiffness.json", cell)
    >>> try:
    ...     compstiff.cutting_coefficients(cell, program, "no_stock.yaml", model, "insert.forces.parquet")
    ... except compstiff.CompstiffError as stopped:
    ...     print(stopped.findings[0].code)
    CS4701
    """
    cutter_of(cell, program.toolpath.cutters)
    settings = replace(settings, cutting=CuttingSettings())
    predicted = predict(cell, program, model, forces, settings)
    blank, rpm = read_stock(stock), settings.log.spindle_rpm
    cut, placed, rows, used = _held_against(predicted, blank, rpm)
    if len(rows.force) < FEWEST:
        raise error("CS4730", f"only {counted(len(rows.force), 'place')} with a force and engaged as the stock says, expected "
                    f"at least {FEWEST}", file=predicted.forces.log.source,
                    hint="is it the log of this program, and the stock it started from, in its work object? Along long moves "
                    "a log by position, path length or time has more places than one that names targets; so has one that "
                    "names the nearest target where its rows have time (time_s, or force_log.rate_hz in cell.yaml)")
    chip = cut.track.chip[cut.engagement.cuts & ~cut.engagement.unknown]
    mean, covariance, material, assumed = before(cell, float(np.median(chip)))
    found = fit_coefficients(rows, mean, covariance)
    covered = _covered(found, rows.force, cell.force_log.form, missing_force(cut, found.mean)[used])
    top, source = by_top(cut, found.mean), predicted.forces.log.source
    said = [*said_of_the_fit(found.mean, found.aside, cut.left.position_std, placed, used),
            *said_of_the_forces(rows, found, source), *said_of_the_top(top, used, rows, found, (mean, covariance), source)]
    coefficients = Coefficients(
        found.mean.copy(), covered, found.model_error, cut.cutter, material, _chips(cut),
        {"from": "log", "spindle_rpm": 60 / cut.revolution, "made_from": _made_from(cell, program, blank.source, forces)},
        rejected="; ".join(finding.message for finding in said if finding.code in REJECTED))
    depth = float(np.median(cut.engagement.depth[cut.engagement.cuts]))
    noise = float(np.hypot(found.floor, LEAST_NOISE))
    further = next_cut(coefficients.mean, found.covariance, cut.cutter, depth, float(np.median(chip)), noise)
    findings = (*predicted.findings, *driven_as_said(predicted), *cut.findings(), *assumed, *said,
                *said_of_the_material(found, material, float(np.median(chip)), source))
    of_table = share_of_table(found, material, float(np.median(chip)))
    return FittedCoefficients(coefficients, np.sqrt(np.diag(covariance)), found, cut, further, findings, of_table,
                              too_large(top, used, found))


def _covered(found: ForcePosterior, force: Array, form: ForceLogFile, missing: Array) -> Array:
    """Covariance (6, 6) of the coefficients with what the rows of a log share: the sensor's gain, its seat, and the force that
    an axis off its place takes, missing (n, 3) [N]. force (n, 3) [N]."""
    gain, seat = form.gain_std, np.radians(form.mounting_std_deg or 0.0)
    turned = seat * np.einsum("kni,ani->ka", found.gain, np.cross(np.eye(3)[:, None], force))
    taken = np.einsum("kni,ni->k", found.gain, missing)
    return np.asarray(
        found.covariance + gain**2 * np.outer(found.mean, found.mean) + turned @ turned.T + np.outer(taken, taken))


def _held_against(predicted: Predicted, blank: Blank, rpm: float | None) -> tuple[Cut, TargetForces, ForceRows, Flags]:
    """A logged pass through its stock, with the tool where the forces pushed it: the cut at the places of the log, the forces
    there, and the rows of those (G,) that can be held against the cut."""
    path, placed, aside = places_between(predicted)
    cut = cut_of(path, blank, rpm, aside, blank.position_std)
    check_in_the_stock(placed, cut.cuts | cut.unknown, blank.source)
    return cut, placed, *logged_rows(cut, placed)


def _chips(cut: Cut) -> tuple[float, float]:
    """The thinnest and the thickest chip of a log [m], but for what took SELDOM of the time: a tool that is lifted out of a
    slot scrapes along its wall at the feed of the air."""
    steps = cut.engagement.cuts & ~cut.engagement.unknown
    order = np.argsort(cut.track.chip[steps])
    chip, done = cut.track.chip[steps][order], np.cumsum(cut.time[steps][order])
    low, high = np.searchsorted(done / done[-1], (SELDOM, 1 - SELDOM))
    return float(chip[low]), float(chip[high])


def table_coefficients(cell: Cell, program: PlannedProgram, settings: Settings = DEFAULTS) -> FittedCoefficients:
    """By the material of cell.yaml alone, for the program's feed. Raises CompstiffError: what `cutter_of` raises, CS4703,
    CS4731 (no material).

    >>> cell = compstiff.read_cell("cell.yaml")
    >>> try:
    ...     compstiff.table_coefficients(cell, compstiff.read_toolpath("insert.mod", cell))
    ... except compstiff.CompstiffError as stopped:
    ...     print(stopped.findings[0].code)
    CS4701
    """
    cutters = program.toolpath.cutters
    cutter, rpm = cutter_of(cell, cutters), settings.log.spindle_rpm or cell.force_log.form.spindle_rpm
    if not rpm:
        raise error("CS4703", "the chip's thickness needs the spindle's speed", file=str(cell.source),
                    hint="--spindle-rpm, or force_log.spindle_rpm in cell.yaml")
    if cell.cutting.material is None:
        raise error("CS4731", "without a log the coefficients come from the table, and cutting.material is not stated",
                    file=str(cell.source), hint="state cutting.material in cell.yaml, or name a log (--forces)")
    toolpath = program.toolpath
    may_cut = ~program.air & ~toolpath.by_joints
    feed, count = toolpath.feed[may_cut & np.isfinite(toolpath.feed)], int(may_cut.sum())
    if not len(feed):
        raise error("CS4731", "the program states no feed", file=toolpath.source, hint="the chip's thickness needs it")
    chip = float(np.median(feed)) * 60 / rpm / cutter.teeth
    mean, covariance, material, assumed = before(cell, chip)
    coefficients = Coefficients(mean, covariance, TABLE_MODEL_ERROR, cutter, material, None,
                                {"from": "table", "spindle_rpm": rpm})
    said = [] if len(feed) == count else [Finding(
        "CS4753", "warning", f"the feed of {count - len(feed)} of {counted(count, 'move')} that may cut is not known: the chip "
        f"is that of the others, {1e3 * float(np.median(feed)):.4g} mm/s or {1e3 * chip:.3g} mm a tooth",
        file=toolpath.source, hint="is that the feed of the cut, or of the air? Declare the speeds in this file")]
    depth = 1e-3 * (cell.cutting.contact_mm or 1.0)
    return FittedCoefficients(coefficients, np.sqrt(np.diag(covariance)), None, None,
                              next_cut(mean, covariance, cutter, depth, chip, LEAST_NOISE),
                              (*assumed, *said, *said_of_cutter(cell, cutters)))


def before(cell: Cell, chip: float) -> tuple[Array, Array, str | None, list[Finding]]:
    """Mean (6,) and covariance (6, 6) of the coefficients before any log, the material, and what was assumed."""
    material = cell.cutting.material
    if material is not None:
        mean, covariance = coefficients_of(material, chip)
        return mean, covariance, material, [Finding(
            "CS4732", "note", f"known before: the coefficients of {material} by its specific cutting force, to about 40 %",
            file=str(cell.source))]
    mean, covariance = coefficients_of(ANY_MATERIAL, chip)
    return mean, covariance * (ANY_WIDTH / 0.4) ** 2, None, [Finding(
        "CS4732", "note", "cutting.material is not stated: next to nothing is taken to be known of the coefficients before",
        file=str(cell.source))]


def check_in_the_stock(forces: TargetForces, touches: Flags, stock: Path) -> None:
    """Refused (CS4738) where over four fifths of the targets with force touch no stock; touches (N,): those that do."""
    with_force, beside = int(forces.forced.sum()), int((forces.forced & ~touches).sum())
    if beside > MOST_BESIDE * with_force:
        raise Refused(Finding(
            "CS4738", "error", f"{beside} of {with_force} targets with force {verb(beside, 'lie')} beside the stock: the "
                               "cut is elsewhere",
            file=str(stock), hint="in millimetres of the program's work object, where does the stock stand? Is it the log of "
            "this program?"))


def said_of_the_fit(
    mean: Array, aside: Array, position_std: float, forces: TargetForces, used: Flags,
) -> list[Finding]:
    """What a user must know of the fit. mean (6,): of the coefficients. aside (3,): the tool beside the stock in the work
    object, in multiples of position_std [m]. used: targets that were taken."""
    findings = []
    source = forces.log.source
    with_force = int(forces.forced.sum())
    if with_force and used.sum() < 0.8 * with_force:
        findings.append(Finding("CS4733", "warning", f"{with_force - int(used.sum())} of {with_force} targets with force cut "
                                "nothing of the stock, or are not known to, and were left out", file=source,
                                hint="is the stock what the program started from?"))
    if (mean[[0, 3]] <= 0).any():
        findings.append(Finding("CS4734", "warning", "a tangential coefficient came out negative: no tool cuts like that",
                                file=source, hint="check force_log.frame and sign, the spindle's sense of turning, the stock"))
    far = np.abs(aside) > MOST_ASIDE
    if far.any():
        where = ", ".join(f"{-1e3 * value * position_std:+.2f} mm in {name}" for value, name, one in zip(
            aside, "xyz", far, strict=True) if one)
        findings.append(Finding("CS4735", "warning", f"the log fits best where the stock stands aside by {where}, more than "
                                f"{MOST_ASIDE:g} times the {1e3 * position_std:g} mm that its file says (1 sigma)",
                                file=source, hint="measure where the stock stands"))
    return findings


def said_of_the_forces(rows: ForceRows, found: ForcePosterior, source: str) -> list[Finding]:
    """Warnings: a fit that leaves too much of the force (CS4745), a chip that would pull (CS4746)."""
    findings = []
    # Of neighbours together: what a slow logger scatters goes, what another cut makes of a pass stays.
    parts = np.array_split(found.residual, max(len(found.residual) // NEIGHBOURS, 1))
    left = float(np.median([np.linalg.norm(part.mean(axis=0)) for part in parts]))
    size = float(np.median(np.linalg.norm(rows.force, axis=1)))
    if left > MOST_LEFT * size:
        findings.append(Finding("CS4745", "warning", f"the fit leaves {left:.3g} N of the {size:.3g} N of a target, in the "
                                "middle: these are not the forces of this cutter in this stock", file=source,
                                hint="is it the stock the program started from, not what it left; the cutter's diameter and "
                                "corner radius; the log of this program? Do not use these coefficients"))
    if found.mean[1] < -two_sigma(float(np.sqrt(found.covariance[1, 1]))):
        findings.append(Finding("CS4746", "warning", "the chip would pull the cutter into the material (Krc "
                                f"{1e-6 * found.mean[1]:.0f} N/mm^2)", file=source,
                                hint="does the stock stand higher or wider in its file than it did, is the spindle's speed, "
                                "the number of teeth right?"))
    return findings


def share_of_table(found: ForcePosterior, material: str | None, chip: float) -> float | None:
    """Ktc as a share of what the table has for a chip of `chip` [m] a tooth of this material; None where none is stated."""
    return None if material is None else float(found.mean[0] / coefficients_of(material, chip)[0][0])


def said_of_the_material(found: ForcePosterior, material: str | None, chip: float, source: str) -> list[Finding]:
    """A warning (CS4747) where a chip of `chip` [m] a tooth needs another force than the table has for the material that is
    stated, None: none is. It names those of which it would be usual."""
    own = share_of_table(found, material, chip)
    if own is None or own <= 0 or OF_TABLE[0] <= own <= OF_TABLE[1]:
        return []
    shares = ((name.replace("_", " "), share_of_table(found, name, chip)) for name in MATERIALS)
    others = [f"{100 * share:.0f} % of {name}'s" for name, share in shares if share and AS_OF[0] <= share <= AS_OF[1]]
    usual = f"; it is {' or '.join(others[:3])}" if others else ""
    return [Finding("CS4747", "warning", f"the chip needs {100 * own:.0f} % of the force that the table has for "
                    f"{str(material).replace('_', ' ')}, which it knows to about 40 %{usual}", file=source,
                    hint="is the material right (cutting.material), the spindle's speed and the number of teeth, and does the "
                    "stock stand in its file as high and as wide as it did?")]


def _made_from(cell: Cell, program: PlannedProgram, stock: Path, forces: str | Path | ForceLog) -> dict[str, dict[str, str]]:
    log = forces.source if isinstance(forces, ForceLog) else forces
    named = {"cell": cell.source, "toolpath": program.source, "stock": stock, "forces": Path(log)}
    return {name: {"file": file.name, "sha256": sha256(file)} for name, file in named.items() if file and file.is_file()}


