"""Why a correction left the program as it was planned: no force, no target that may change, or too little to write."""

from __future__ import annotations

from collections import Counter

import numpy as np

from compensator.correction.correction import Correction
from compensator.correction.predict import Predicted
from identification.common.findings import Finding, counted


def nothing_corrected(planned: Predicted, predicted: Predicted, correction: Correction) -> Finding:
    """CS3086, with the reason that holds for most targets. planned: the program as it was given."""
    path, forces, log = predicted.path, predicted.forces, predicted.forces.log.source
    forced = np.flatnonzero(forces.forced)
    if not len(forced) and len(planned.targets):
        own = "--keep-targets was given" if planned.settings.correction.keep_targets else "to these moves none can be added"
        return planned.path.finding(
            int(planned.targets[0]), "CS3086", "error", "nothing is corrected: the tool cuts between targets that stand in the "
            f"air, and {own}", "let the post write a target where the tool enters the stock and one where it leaves, or moves "
            "that stand one a line")
    if not len(forced) and predicted.forces.log.predicted is not None:
        return Finding("CS3086", "error", "nothing is corrected: by this stock no move has a force that is known",
                       file=str(planned.settings.cutting.stock), hint="the warnings say why; where does the stock stand in the "
                       "program's work object?")
    if not len(forced):
        return Finding("CS3086", "error", "nothing is corrected: by this log no move has force", file=log,
                       hint="is it the log of the pass that cut, with its forces in newtons? A program that does not cut is "
                            "loaded as it is")
    if not len(correction.targets):
        reason, _ = Counter(path.toolpath.block[forced].tolist()).most_common(1)[0]
        return path.finding(int(forced[0]), "CS3086", "error",
                            f"nothing is corrected: {counted(len(forced), 'move')} with force, and none can be corrected: "
                            f"{reason or 'they go to joint angles (MoveAbsJ)'}",
                            "the warnings name the moves and what to do")
    size = 1e6 * np.linalg.norm(predicted.prediction.position, axis=1).max()
    return Finding("CS3086", "error", f"nothing is corrected: the largest predicted deviation is {size:.2g} um, and every "
                   "correction is too small against its uncertainty, or for the digits of the program", file=log,
                   hint="are forces in newtons and stiffnesses right? Else load the planned program as it is; --confidence 0.5 "
                        "makes uncertain corrections too")
