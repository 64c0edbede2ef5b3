"""The log of a program beside what its stock lets expect of forces: what is to be said of both (CS4740 to CS4743)."""

from __future__ import annotations

import numpy as np

from compensator.correction.loaded_path import LoadedPath
from compensator.correction.prediction import Prediction
from compensator.correction.settings import Settings
from compensator.cutting.coefficients import check_same, read_coefficients
from compensator.cutting.cut import cut_of
from compensator.cutting.disagreement import disagreement
from compensator.cutting.misread import misread
from compensator.cutting.predicted_log import STEP
from compensator.cutting.rows import ENOUGH, logged_rows
from compensator.cutting.stock_file import read_stock
from compensator.forces.placement import axes_of_log
from identification.common.findings import Finding, counted


def beside_stock(loaded: LoadedPath, prediction: Prediction, settings: Settings) -> list[Finding]:
    """Nothing where no coefficients are named. The tool stood off its plan by the predicted deviation while it was logged; with
    --logged-with it stood on it, next to."""
    chosen, path, forces = settings.cutting, loaded.path, loaded.forces
    if chosen.predict_force is None or chosen.stock is None or forces.unknown is not None:
        return []
    coefficients = read_coefficients(chosen.predict_force)
    if coefficients.rejected:
        return [Finding("CS4752", "warning", coefficients.rejection, file=str(chosen.predict_force),
                        hint="the correction goes by the log of this program, which is not held against them; fit them again")]
    aside = np.zeros((len(path.toolpath), 3))
    if settings.correction.logged_with is None:
        aside[loaded.targets] = prediction.position
    rpm, source = settings.log.spindle_rpm, forces.log.source
    blank = read_stock(chosen.stock)
    step = max(STEP, blank.position_std)
    cut = cut_of(path, blank, rpm, aside, step)
    check_same(coefficients, cut.cutter, path.cell.cutting.material, str(path.cell.source))
    rows, used = logged_rows(cut, forces, coefficients.mean)
    if len(rows.force) < ENOUGH:
        return [Finding("CS4743", "warning", f"only {counted(len(rows.force), 'target')} with a force and engaged as the stock "
                        "says: the log cannot be held against it", file=source,
                        hint="is it the stock that this program started from?")]
    found = disagreement(rows, coefficients, cut.left.position_std, step)
    codes = {"adequate": "CS4740", "named": "CS4741", "ambiguous": "CS4742", "unknown": "CS4743"}
    said = [Finding(
        codes[found.verdict], "note" if found.verdict == "adequate" else "warning", found.words(), file=source,
        hint="" if found.verdict == "adequate" else "the correction goes by the log; forces predicted for other programs with "
        "these coefficients are as far off, unless it is this part's stock")]
    if found.verdict != "adequate":
        stated = path.cell.force_log.kind
        axes = {kind: turn[used] for kind, turn in axes_of_log(path, path.cell).items()}
        reading = misread(rows, axes, stated, coefficients, cut.left.position_std, step)
        if reading is not None:
            said.append(Finding(
                "CS4750", "warning", f"{reading.words(stated)}: it seems to be read wrongly, and the correction is wrong "
                "with it", source, hint="are frame, sign and sensor_quaternion of force_log in cell.yaml right, and the order "
                "of the columns? Push the tool by hand along each axis, once, and look at the log"))
    return [*cut.findings(), *said]
