"""Something between flange and tool tip has play: it lies on the side to which the load pushes it."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter, held_over
from identification.model.load_state import LoadState

# A force [N] and a moment [N m] from which on what has play has gone over (engineering judgement: they overcome its friction).
GOES_OVER_N, GOES_OVER_NM = 20.0, 5.0
# What a clamp holds, in shares of the largest moment of the rows.
SHARES = (0.15, 0.3, 0.5, 0.7)


class _Play(Effect):
    """What the laws have in common."""

    name = "tool_play"
    family = "tool"
    of_robot = True
    of_tool = True
    formula_source = "engineering judgement: a body in a round seat lies at its edge, where the load pushes it"
    settles = "push the tool to and fro by hand with a dial gauge at the spindle nose, then at the tool"


class Tilting(_Play):
    """Rotation by half the play about the flange, as the load's moment across flange z turns it: a tool changer that is not
    locked, a mount whose bolts have worked loose."""

    law = "tilting"
    parameters = (Parameter("half_gap_rad", "rad", 5e-5, 0.0, 3e-3,
                            source="engineering judgement: 10 um across the 200 mm of a changer's seat",
                            bounds_source="engineering judgement: none, to what is seen by eye"),)
    sentence = "the tool tilts to and fro on the flange, by the play of its changer or its mount"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        pivot, across = _across_flange(rows)
        return rows.turned(pivot, values[0] * _towards(across, GOES_OVER_NM))


class Hinge(_Play):
    """Rotation by half the play about one axis across flange z, as the load's moment about that axis turns it: a changer that
    sits on two of its pins."""

    law = "hinge"
    parameters = (*Tilting.parameters, Parameter(
        "axis_rad", "rad", 0.8, -1.6, 3.2, grid=tuple((np.arange(8) * np.pi / 8).round(4)), shape=True,
        source="engineering judgement: no direction is more likely than another",
        bounds_source="engineering judgement: any direction, half a turn"))
    sentence = "the tool tips to and fro about one axis across the flange, by the play of its changer or its mount"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return self._turned(rows, values, self._side(rows, values[1]))

    @staticmethod
    def _axis(rows: LoadState, angle: float) -> Array:
        """The axis of the play (n, 3), base frame."""
        return np.asarray(rows.flange @ np.array([np.cos(angle), np.sin(angle), 0.0]))

    def _side(self, rows: LoadState, angle: float) -> Array:
        """To which end the load presses the tool (n, 1), -1 to 1, less where its moment is too small to go over."""
        moment = rows.moment_about(rows.origins[:, 5])
        return _towards(np.sum(self._axis(rows, angle) * moment, axis=1, keepdims=True), GOES_OVER_NM)

    def _turned(self, rows: LoadState, values: Array, side: Array) -> Array:
        """What the tool does (n, 6) at sides (n, 1) of a play (half_gap, angle)."""
        return rows.turned(rows.origins[:, 5], values[0] * side * self._axis(rows, values[1]))


class HeldHinge(Hinge):
    """The same, held by friction: where the moment is too small to go over, the tool stays at the end to which it was last
    pressed in the visit."""

    law = "held"
    by_visit = True

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return self._turned(rows, values, self._held(rows, values[1]))

    def of_each_visit(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """At which end the way to the pose left the tool: it shows against the unloaded reading that is taken first as soon as
        a load has pressed it anywhere."""
        return -self._turned(rows, values, np.abs(self._held(rows, values[1])))[:, :, None]

    def _held(self, rows: LoadState, angle: float) -> Array:
        """At which end of its play the tool is (n, 1), -1 to 1; 0 before the visit's first load."""
        return held_over(self._side(rows, angle)[:, 0], rows.starts)[:, None]


class Opens(_Play):
    """Tilt about the flange by `c (|M| - m)` once the load's moment M across flange z passes what holds it, m: a changer or a
    clamp whose preload is too small."""

    law = "opens"
    formula_source = "engineering judgement: a joint that is held by a preload, and opens in proportion to what passes it"
    parameters = (
        Parameter("compliance_rad_per_nm", "rad/(N*m)", 1e-6, 0.0, 1e-4,
                  source="engineering judgement: 1e6 N m/rad, five times a large wrist's",
                  bounds_source="engineering judgement: rigid, to a coupling that hangs by its ball locks alone"),
        Parameter("holds_nm", "N*m", 100.0, 1.0, 5000.0, grid=SHARES, shape=True,
                  source="engineering judgement: it shows where it is a part of the largest moment in the rows",
                  bounds_source="engineering judgement: held by hand, to what no load test reaches"),
    )
    sentence = "what clamps the tool opens under load: it tilts on the flange once the moment passes the clamp's preload"
    settles = "a dial gauge across the changer's gap while the load on the tool grows"

    def grid(self, rows: LoadState, joint: int | None, parameter: Parameter) -> tuple[float, ...]:
        largest = np.linalg.norm(_across_flange(rows)[1], axis=1).max(initial=1.0)
        return tuple(share * float(largest) for share in parameter.grid)

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        compliance, holds = values
        pivot, across = _across_flange(rows)
        size = np.linalg.norm(across, axis=1, keepdims=True)
        beyond = np.maximum(size - holds, 0.0)
        return rows.turned(pivot, compliance * beyond * across / np.maximum(size, 1e-300))


class ToolPlay(_Play):
    """Half the play, in the direction of the force across tool z: a worn spindle bearing, a holder that does not sit."""

    other_laws = (Tilting(), Hinge(), HeldHinge(), Opens())
    parameters = (Parameter("half_gap_m", "m", 1e-5, 0.0, 5e-4,
                            source="engineering judgement: a worn spindle bearing has 5 to 20 um",
                            bounds_source="engineering judgement: none, to what is felt by hand"),)
    sentence = "tool or spindle have play: the tool lies on the side to which the load pushes it"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        axis, force = rows.tool[:, :, 2], rows.wrench[:, :3]
        across = force - axis * np.sum(axis * force, axis=1, keepdims=True)
        return np.concatenate([values[0] * _towards(across, GOES_OVER_N), np.zeros_like(across)], axis=1)


def _across_flange(rows: LoadState) -> tuple[Array, Array]:
    """The flange's places (n, 3) [m], and the part (n, 3) [N m] of the load's moment there across flange z."""
    axis, pivot = rows.flange[:, :, 2], rows.origins[:, 5]
    moment = rows.moment_about(pivot)
    return pivot, moment - axis * np.sum(axis * moment, axis=1, keepdims=True)


def _towards(pull: Array, goes_over: float) -> Array:
    """Unit vectors (n, k) along a pull, shorter where it is too small to go over."""
    size = np.linalg.norm(pull, axis=1, keepdims=True)
    return np.asarray(pull / np.maximum(size, 1e-300) * np.minimum(size / goes_over, 1.0))
