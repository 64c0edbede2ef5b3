"""The reading grows with time, not with force."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import OfReading, along_axes
from identification.model.load_state import PACE_S, LoadState

HOUR_S = 3600.0
# Of what an arm grows by, so much may have come before the first row, 1 sigma (engineering judgement).
BEFORE = 0.3
# How soon a warm-up settles, as shares of the time that the rows take, is tried.
SETTLING = (0.1, 0.3, 1.0)
# How many cycles are tried in the time that the rows take.
CYCLES = (0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
# Where in a cycle the first row stands; the other half has the other sign.
PHASES = tuple(np.linspace(0, np.pi, 4, endpoint=False).tolist())
SETTLES_S = Parameter("settles_s", "s", 1800.0, 30.0, 1e5, shape=True,
                      source="engineering judgement: half an hour for grease, brackets and lasers",
                      bounds_source="engineering judgement: over before the next row, to a day")


class _Drift(OfReading):
    """What the laws have in common. It brings along a zero that seems not to be taken off: what came between that and the first
    row."""

    name = "drift"
    # So many times its size may have come before the first row: all, a wave from end to end, an hour's.
    before: ClassVar[float]
    sentence = "the reading drifts with time, loaded or not (temperature, mounting)"
    settles = "leave the robot unloaded and read the sensors every ten minutes"

    def brings(self, values: Array) -> dict[str, float]:
        return {"sensor_step": self.before * float(np.linalg.norm(values[:3]))}


class Settling(_Drift):
    """It comes to an end: `d (1 - exp(-t / t0))`, t the time since the unloaded reference was taken."""

    law = "settling"
    before = 1.0
    formula_source = "engineering judgement: what warms up comes to a temperature, as one heat capacity does"
    parameters = (*along_axes(
        "{}_m", "m", 1.5e-5, 1e-2,
        source="engineering judgement: half an hour of the first law's rate",
        bounds_source="engineering judgement: none, to 10 mm: the bracket fell off"), SETTLES_S)

    def misread(self, rows: LoadState, values: Array) -> Array:
        since = np.nan_to_num(since_reference(rows))
        return np.asarray(-np.expm1(-since / values[3])[:, None] * values[:3])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        scale, found = self.typical(rows, joint)[:3], []
        for settles in settling_times(rows):
            each = [self.contribution(rows, joint, np.append(one, settles))[:, :3] for one in np.eye(3)]
            found.append(Signature(np.stack(each, axis=2), scale, False, partial(np.append, values=settles), self))
        return found


class Cycling(_Drift):
    """It comes and goes: `d sin(w t + phi)` less what it was when the reference was taken."""

    law = "cycling"
    before = 2.0
    formula_source = "engineering judgement: a hall's heating and a spindle's cooler switch on and off at an even pace"
    parameters = (
        *along_axes("{}_m", "m", 1e-5, 1e-2,
                    source="engineering judgement: a stand of steel, half a metre long, two degrees warmer",
                    bounds_source="engineering judgement: to 10 mm: the bracket fell off"),
        Parameter("phase_rad", "rad", 1.0, -7.0, 7.0, shape=True,
                  source="engineering judgement: any phase, here a sixth of a turn",
                  bounds_source="engineering judgement: a turn either way"),
        Parameter("period_s", "s", 1800.0, 60.0, 2e5, shape=True,
                  source="engineering judgement: half an hour, as air conditioning switches",
                  bounds_source="engineering judgement: a minute to two days"))
    sentence = "the reading comes and goes with time, loaded or not (heating, cooling)"

    def misread(self, rows: LoadState, values: Array) -> Array:
        time, since = clock(rows), since_reference(rows)
        turn, phase = 2 * np.pi / values[4], values[3]
        wave = np.sin(turn * time + phase) - np.sin(turn * (time - since) + phase)
        return np.asarray(np.nan_to_num(wave)[:, None] * values[:3])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        time, scale, found = clock(rows), self.typical(rows, joint)[:3], []
        took = float(np.nanmax(time) - np.nanmin(time)) if np.isfinite(time).any() else 0.0
        for cycles in CYCLES:
            for phase in PHASES:
                shape = np.array([phase, np.clip(took / cycles, self.parameters[4].low, self.parameters[4].high)])
                each = [self.contribution(rows, joint, np.append(one, shape))[:, :3] for one in np.eye(3)]
                found.append(Signature(np.stack(each, axis=2), scale, False, partial(np.append, values=shape), self))
        return found


class Growing(_Drift):
    """All of the arm grows alike: `s (1 - exp(-t / t0))` of the way from the foot to the tool tip, t the time since the
    unloaded reference was taken. Further ways: what it had grown by before the first row."""

    law = "growing"
    before = 0.0
    ways = 1
    formula_source = "engineering judgement: all links warm up alike, so that the arm stays like itself"
    parameters = (
        Parameter("share", "1", 3e-5, -1e-2, 1e-2,
                  source="engineering judgement: an arm of aluminium or iron, two degrees warmer",
                  bounds_source="engineering judgement: to a hundred times what a foundry's day does"),
        SETTLES_S)
    sentence = "the robot grows while it warms up: the tool goes out in proportion to its distance from the foot"
    settles = "move the unloaded robot to one pose every ten minutes, and read the sensors there"

    def misread(self, rows: LoadState, values: Array) -> Array:
        since = np.nan_to_num(since_reference(rows))
        return np.asarray(-values[0] * np.expm1(-since / values[1])[:, None] * rows.tcp)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        return [Signature(self.contribution(rows, joint, np.array([1.0, settles]))[:, :3, None], self.typical(rows, joint)[:1],
                          False, partial(np.append, values=settles), self) for settles in settling_times(rows)]

    def further_ways(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        ways = np.zeros((len(rows), 6, self.ways))
        ways[rows.reference == 0, :3, 0] = BEFORE * values[0] * rows.tcp[rows.reference == 0]
        return ways


class Drift(_Drift):
    """Rate times the time since the unloaded reference was taken; without any times, times the rows' order at an even pace."""

    other_laws = (Settling(), Cycling(), Growing())
    before = HOUR_S
    formula_source = "engineering judgement: a warm-up is slow against a measurement, so its first order in time is enough"
    parameters = along_axes(
        "{}_m_per_s", "m/s", 8.3e-9, 1e-6,
        source="Pollack Periodica 15(3), p. 60, 2020: a laser tracker warms up for two hours and is off by up to tenths of "
               "a millimetre, 1.4e-8 m/s for one; 30 um an hour for a bracket is engineering judgement",
        bounds_source="engineering judgement: nothing in a hall warms up by 3.6 mm an hour")

    def misread(self, rows: LoadState, values: Array) -> Array:
        return np.asarray(np.nan_to_num(since_reference(rows))[:, None] * values)


def settling_times(rows: LoadState) -> list[float]:
    """Times [s] in which a warm-up may settle that these rows show."""
    time = clock(rows)
    took = float(np.nanmax(time) - np.nanmin(time)) if np.isfinite(time).any() else 0.0
    return [float(np.clip(share * took, SETTLES_S.low, SETTLES_S.high)) for share in SETTLING]


def clock(rows: LoadState) -> Array:
    """The file's own time (n,) [s], NaN where it has none; where no row has one, PACE_S a row."""
    return np.asarray(PACE_S * (rows.row - 1.0) if np.isnan(rows.time).all() else rows.time)


def since_reference(rows: LoadState) -> Array:
    """Time (n,) [s] since the unloaded reference was taken: the file's own for its first, from the first row for later ones."""
    time = clock(rows)
    since = time.copy()
    for reference in np.unique(rows.reference[rows.reference > 0]):
        members = rows.reference == reference
        since[members] -= np.nanmin(time[members])
    return since
