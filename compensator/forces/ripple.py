"""How often the force repeats in a turn of the spindle, by the lines of its spectrum, and whether so many teeth make that.

Teeth alike make lines at Z times the speed and its multiples, run-out those between. In a slot an odd number of teeth enters
and leaves in turn, twice as often as there are teeth. So from Z teeth the force may repeat once a turn, Z times, a divisor of Z
times (teeth at uneven pitch), and for odd Z twice that. A speed that is stated at half of what runs doubles the count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.forces.revolutions import MOST_TEETH, lines_of
from identification.common.arrays import Array
from identification.common.findings import Finding

# Of the amplitude at multiples of the speed so much says how often the force repeats in the main, and all of it. That must be
# nearly all that stands in the spectrum: lines of the teeth that fold back at half the rate are the rest.
MAIN, ALL, OF_TURN = 0.7, 0.99, 0.8
# The lines of the teeth must be seen unfolded: below this share of the log's rate.
UNFOLDED = 0.45
# Of the spectrum's lines those count that stand so far over their neighbours, and so near to a multiple [steps].
OVER, NEAR = 100.0, 1.5


@dataclass(frozen=True)
class Ripple:
    """Of a log at `rate` [Hz] and a spindle of `turn` [Hz]: the force repeats `main` times a turn in the main, and all of it
    `each` times; 1: nothing more is known."""

    turn: float
    rate: float
    main: int
    each: int

    def fits(self, teeth: int) -> bool:
        """Whether so many teeth may make it."""
        twice = 2 * teeth if teeth % 2 else teeth
        return all(count == twice or teeth % count == 0 for count in (self.main, self.each))


def ripple_of(frequency: Array, power: Array, turn: float) -> Ripple | None:
    """From a spectrum, frequency (m,) [Hz] and power (m,), and the speed that its lines have [Hz]; None where they have not."""
    step, rate = float(frequency[1]), float(2 * frequency[-1])
    place, height, over = lines_of(power)
    clear = (over >= OVER) & (place * step > 0.5 * turn)
    lines, amplitude = place[clear] * step, np.sqrt(height[clear])
    number = np.round(lines / turn).astype(int)
    of_turn = np.abs(lines - number * turn) <= NEAR * step
    if not of_turn.any() or amplitude[of_turn].sum() < OF_TURN * amplitude.sum():
        return None
    number, amplitude = number[of_turn], amplitude[of_turn]
    held = np.array([amplitude[number % count == 0].sum() for count in range(1, 2 * MOST_TEETH + 1)]) / amplitude.sum()
    main, each = (int(np.flatnonzero(held >= share)[-1]) + 1 for share in (MAIN, ALL))
    return Ripple(turn, rate, main, each)


def said_of_teeth(ripple: Ripple | None, teeth: int | None, source: str) -> list[Finding]:
    """A warning (CS3094) where the force repeats as so many teeth cannot make it at the stated speed."""
    if ripple is None or not teeth or teeth * ripple.turn > UNFOLDED * ripple.rate or ripple.fits(teeth):
        return []
    often, rpm = max(ripple.main, ripple.each), 60 * ripple.turn
    return [Finding("CS3094", "warning", f"the force repeats {often} times in a turn of {rpm:.0f} rpm, which {teeth} "
                    f"{'tooth does' if teeth == 1 else 'teeth do'} not make", file=source,
                    hint=f"has the cutter {often} teeth (cutting.teeth), or does the spindle turn at {rpm * often / teeth:.0f} "
                    "rpm (force_log.spindle_rpm, --spindle-rpm)? Both say how thick a chip is")]
