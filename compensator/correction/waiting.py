"""Where a correction waits for the log of its own pass: the force that was logged is not that of a tool on the plan there.

What the force that follows the cut leaves goes with how far the tool stood off the plan while its force was logged
(engagement.py): the whole deviation d in the first pass, what that correction leaves, s, in the next. So of its part c in s
about

    c s / |d|

stays when the corrected pass is logged and corrected from; the rest as it is. Such places
are entries, corners where the force grows tenfold within half a millimetre, thin cuts that a soft arm shuns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.correction.expected_left import ExpectedLeft
from compensator.correction.logged_pass import FEWEST_TARGETS
from compensator.correction.predict import Predicted
from identification.common.arrays import Array
from identification.common.findings import Finding, counted

# A target waits where two sigma fall by more than so many tolerances, and to less than this share.
GAINS, TO = 4.0, 0.5


@dataclass(frozen=True, eq=False)
class Waiting:
    """targets (k,) of the program, now and then (k,) [m]: 1 sigma of what is left there, by this correction and by one from the
    log of its pass."""

    targets: NDArray[np.intp]
    now: Array
    then: Array

    def as_dict(self) -> dict[str, float]:
        """JSON values, two sigma in micrometres."""
        now, then = (2e6 * float(one.max(initial=0.0)) for one in (self.now, self.then))
        return {"targets": len(self.targets), "two_sigma_um": now, "two_sigma_then_um": then}


def waiting(predicted: Predicted, left: ExpectedLeft) -> Waiting:
    """Of a correction from the log of the planned program; none where the log is of a corrected pass already."""
    chosen, std = predicted.settings.correction, left.std
    size = np.linalg.norm(predicted.prediction.position, axis=1)
    then = np.sqrt(np.maximum(std**2 - left.cut**2, 0.0) + (left.cut * np.minimum(std / np.maximum(size, 1e-12), 1.0)) ** 2)
    waits = (2 * (std - then) > GAINS * chosen.tolerance) & (then < TO * std) & (chosen.logged_with is None)
    return Waiting(predicted.targets[waits], std[waits], then[waits])


def told(found: Waiting, predicted: Predicted, given: int) -> tuple[Finding, ...]:
    """CS4115: where, what is expected there, and what the next pass gains. given: targets of the planned program with force; of
    one with fewer than a pair of passes asks for the second log is taken alone."""
    if not len(found.targets):
        return ()
    figures, worst = found.as_dict(), int(np.argmax(found.now))
    pair = f" and --first-forces {predicted.forces.log.source}" if given >= FEWEST_TARGETS else ""
    return (predicted.path.finding(
        int(found.targets[worst]), "CS4115", "note", f"at {counted(len(found.targets), 'target')}, here most, the force that "
        f"was logged is not that of a tool on the plan: up to {figures['two_sigma_um']:.0f} um are left there (2 sigma), about "
        f"{2e6 * found.then[worst]:.0f} once the corrected pass was logged",
        "log the corrected pass, then correct the planned program by that log with --logged-with OFFSETS.csv (write it now: "
        f"--offsets){pair}"),)
