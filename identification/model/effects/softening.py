"""The robot gives way more, or less, from row to row."""

from __future__ import annotations

from abc import abstractmethod
from functools import partial

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, Signature
from identification.model.effects.drift import HOUR_S, SETTLES_S, clock, settling_times
from identification.model.load_state import LoadState

# What an arm's own weight bends it by [m], at most (engineering judgement: some millimetres of a large one).
SAG_M = 2e-3


class _Softening(Effect):
    """What the laws have in common."""

    name = "softening"
    family = "structure"
    of_robot = False
    unsettles = True
    sentence = "the robot gives way more, or less, from row to row: it warms up, or the gain of the force measurement wanders"
    settles = "warm the robot up, measure again, and repeat the first pose at the end"

    @abstractmethod
    def fastest(self, values: Array) -> float:
        """Share [1/s] by which it softens at most."""

    def brings(self, values: Array) -> dict[str, float]:
        # Under its own weight it sinks as it softens, loaded or not.
        return {"drift": SAG_M * self.fastest(values), "drift.settling": SAG_M * abs(float(values[0]))}


class Settling(_Softening):
    """It comes to an end: the springs' deflection grows by `s (1 - exp(-t / t0))`."""

    law = "settling"
    formula_source = "engineering judgement: what warms up comes to a temperature, as one heat capacity does"
    parameters = (
        Parameter("share", "1", 0.05, -0.9, 3.0,
                  source="engineering judgement: some per cent from cold grease to warm",
                  bounds_source="engineering judgement: ten times stiffer, to four times as soft as when it was cold"),
        SETTLES_S,
    )

    def fastest(self, values: Array) -> float:
        return abs(float(values[0] / values[1]))

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        share, settles = values
        return np.asarray(-share * np.expm1(-since_first(rows) / settles)[:, None] * rows.elastic)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        return [Signature(self.contribution(rows, joint, np.array([1.0, settles]))[:, :3, None], self.typical(rows, joint)[:1],
                          False, partial(np.append, values=settles), self) for settles in settling_times(rows)]


class Softening(_Softening):
    """The springs' deflection grows by `s t`, t the time since the first row: gears soften while they warm up. A force
    measurement whose gain wanders looks the same. The springs told are those of the first row: not those to mill with."""

    other_laws = (Settling(),)
    formula_source = "engineering judgement: a warm-up is slow against a measurement, so its first order in time is enough"
    parameters = (
        Parameter("per_hour", "1/h", 0.1, -2.0, 2.0,
                  source="engineering judgement: some per cent from cold grease to warm, within half an hour",
                  bounds_source="engineering judgement: what is three times as soft after an hour would have been noticed"),
    )

    def fastest(self, values: Array) -> float:
        return abs(float(values[0])) / HOUR_S

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.asarray(values[0] * since_first(rows)[:, None] / HOUR_S * rows.elastic)


def since_first(rows: LoadState) -> Array:
    """Time (n,) [s] since the first row of the file."""
    return np.asarray(np.nan_to_num(clock(rows)))
