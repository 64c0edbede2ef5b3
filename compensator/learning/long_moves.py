"""Points on long moves: the force is known at their ends, as the mean over half of the way, and taken as straight between.
Where a move begins or ends in the air, or the cut changes on the way, another deviation is expected of the points."""

from __future__ import annotations

from compensator.correction.predict import Predicted
from compensator.learning.path_places import PathPlaces
from identification.common.findings import Finding

# So long a move [m], and so large a share of the points on such.
LONG, SHARE = 0.02, 0.25


def said_of_long_moves(placed: PathPlaces, predicted: Predicted, source: str) -> list[Finding]:
    """A warning (CS5333) where many points lie on long moves of a log that could tell more."""
    length = predicted.path.length[predicted.targets]
    long = length[placed.after] - length[placed.before] > LONG
    if not len(long) or long.mean() < SHARE:
        return []
    return [Finding("CS5333", "warning", f"{int(long.sum())} of {len(long)} points lie on moves of over {1e3 * LONG:g} mm, "
                    "between whose ends the force is taken as straight: the factor in motion is off where that is not so",
                    file=source, hint="a move that ends 5 mm behind a cut of 50 makes it 1.1: measure where the targets stand "
                    "close, or post the program with targets every 5 mm and log that")]
