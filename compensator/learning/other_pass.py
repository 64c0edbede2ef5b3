"""Points of the pass without offsets beside the log, and the offsets, of the pass with them: nothing is learned of them."""

from __future__ import annotations

from compensator.learning.rows import Rows
from identification.common.arrays import Array, rms
from identification.common.findings import Finding, Refused

# Told where the pass without offsets leaves under this share of what the named one does, which is over so many sigmas of the
# points (engineering judgement).
SHARE, SIGMAS = 0.5, 3.0


def refuse_other_pass(rows: Rows, told: Array, offsets: Array, source: str) -> None:
    """Refused (CS5335) where the rows, whose value is the measured less the offsets of the pass, follow the prediction told
    (n,) [m] far better with these left in: offsets (n,) [m], along the rows."""
    as_said, without = rms(rows.value - told), rms(rows.value + offsets - told)
    if without >= SHARE * as_said or as_said < SIGMAS * rms(rows.sigma):
        return
    raise Refused(Finding(
        "CS5335", "error", "the points are those of the pass without offsets: as they stand they are off as is predicted "
        f"but for {1e6 * without:.1f} um, of the pass with those of --logged-with but for {1e6 * as_said:.1f} um", file=source,
        hint="points, log and offsets are of one pass: give the points of the corrected part, or the log of the first pass "
        "without --logged-with"))
