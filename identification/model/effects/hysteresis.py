"""Friction inside a gear: the way back is not the way there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array, read_only
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.documents import NABTESCO
from identification.model.effects.kinds import NO_LOAD_OFF, GearTwist
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# Friction is seen where a load comes back: in so many rows at least, whose twist is off the first loading's by this share of
# the amplitude. Engineering judgement: fewer are single readings, and less is no loop.
FEWEST_WITNESSES, REMEMBERED = 3, 0.2
# What the way to a pose lets go of is told by several.
FEWEST_POSES = 2
# Of a step of many rows by arrays as many rows one by one take as long (measured).
ARRAY_STEP = 30
# States in which a gear may be when a pose begins: anywhere between its ends alike. Each way is 1 sigma of its own, since the
# load turns a gear sooner the one way than the other; together they are as wide as all states.
BEGINS = (6**-0.5, -(6**-0.5))


AMPLITUDE = Parameter(
    "amplitude_rad", "rad", 4.4e-5, -1e-3, 1e-3, source=f"{NABTESCO}: lost motion 0.3 to 0.6 arcmin on average; half of 0.3",
    bounds_source="engineering judgement: either sign, three times the 1 arcmin of hysteresis loss that gears stay under by "
                  f"{NABTESCO}")


def _slips_at(torque: float, grid: tuple[float, ...], source: str) -> Parameter:
    return Parameter("torque_nm", "N*m", torque, 2.0, 1000.0, grid=grid, shape=True, source=source,
                     bounds_source="engineering judgement: from a small gear's idle friction to a torque that no milling load "
                                   "reaches")


# Of rows that live the state that was asked for last, with what was asked: amplitudes of one law have the same.
_LAST: WeakKeyDictionary[LoadState, tuple[tuple[float, ...], Array]] = WeakKeyDictionary()


def last_state(rows: LoadState, asked: tuple[float, ...], worked_out: Callable[[], Array]) -> Array:
    """The state of these rows that is `asked` for, by numbers that tell it from others; worked out where it is not the last."""
    kept = _LAST.get(rows)
    if kept is None or kept[0] != asked:
        kept = _LAST[rows] = asked, worked_out()
    return kept[1]


class _Hysteresis(GearTwist):
    """What the laws have in common: `J_i h q`, q a state of the load path within -1 and 1, from zero at the start of each pose.
    With a negative amplitude the twist lags behind the torque, as friction makes it; a positive one runs ahead. elements: how
    many Maxwell-slip elements there are, which slip at torques evenly up to T; each holds as much as it slips at."""

    name = "hysteresis"
    sentence = "the gear of joint {joint} has friction inside: it does not come back the way it went when the load is taken off"
    turning = "slips the other way"
    settles = "load up, down and up again without leaving the pose, and read at zero load each time"
    by_visit = True
    elements = 1

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        slip = float(values[1])
        return np.asarray(values[0] * last_state(
            rows, (self.elements, i, slip), lambda: self.state(rows.torque[:, i], rows.starts, slip)))

    def state(self, torque: Array, starts: NDArray[np.bool_], slip: Array | float, begin: float = 0.0) -> Array:
        """State (n, ...) of torque paths (n, ...) [N m] of gears that slip at these torques, as `slip_state`."""
        share = np.arange(1, self.elements + 1) / self.elements
        states = slip_state(torque[..., None], starts, np.asarray(slip)[..., None] * share, begin)
        return np.asarray(states @ share / share.sum())

    def of_each_visit(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """The state in which the way to the pose left the gear, between -1 and 1: it shows against the unloaded reading that is
        taken first until the load has turned it once."""
        i = self.index(joint)
        begun = self.begun(rows.torque[:, i], rows.starts, values[1])
        return np.asarray(values[0] * rows.jacobian[:, :, i, None] * begun[:, None])

    def begun(self, torque: Array, starts: NDArray[np.bool_], slip: Array | float) -> Array:
        """By how much more the state (n, ..., 2) has changed since a visit began at each of BEGINS than from zero."""
        ways = [self.state(torque, starts, slip, begin) - self.state(torque, starts, slip) - begin for begin in BEGINS]
        return np.stack(ways, axis=-1)

    def missing(self, rows: LoadState) -> str:
        if any(self._witnesses(rows, joint, slip) for joint in self.joints for slip in self.parameters[1].grid):
            return ""
        return "no pose was loaded and unloaded, so that no load could leave anything behind"

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """Nothing for a slip that leaves no trace in these rows: where the load only grew from zero the twist is that of a soft
        gear, and tells nothing of friction."""
        others = self.of_other_laws(rows, joint)
        own = super().signatures(rows, joint)[: len(self.parameters[1].grid)]
        return [*(shape if self._witnesses(rows, joint, slip) else replace(shape, rows=np.zeros_like(shape.rows))
                  for slip, shape in zip(self.parameters[1].grid, own, strict=True)), *others]

    def _witnesses(self, rows: LoadState, joint: int | None, slip: float) -> bool:
        """Whether enough rows keep something of the loads before theirs."""
        torque = rows.torque[:, self.index(joint)]
        nothing = np.ones(len(torque), dtype=bool)
        kept = self.state(torque, rows.starts, slip) - self.state(torque, nothing, slip)
        return int(np.sum(np.abs(kept) > REMEMBERED)) >= FEWEST_WITNESSES

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.trunc(slip_state(rows.torque[:, self.index(joint)], rows.starts, values[1]))


class Smooth(_Hysteresis):
    """Many surfaces that slip one after the other, so that the loop has no corners."""

    law = "smooth"
    formula_source = ("W. D. Iwan, A distributed-element model for hysteresis and its steady-state dynamic response, J. Appl. "
                      "Mech. 33, 1966: elements that slip at evenly spread forces; here eight")
    parameters = (AMPLITUDE, _slips_at(100.0, (20.0, 40.0, 80.0, 160.0, 320.0),
                                       "engineering judgement: the last to slip, at twice what one element alone does"))
    elements = 8


class Seats(GearTwist):
    """`J_i c_i a tau_m`, tau_m the torque that was largest so far at this pose: the load leaves a share of its twist behind,
    until the robot moves: a program has none of it."""

    name = "hysteresis"
    law = "seats"
    of_robot = False
    formula_source = ("engineering judgement: teeth, bearings and bolted faces that seat under the first load and do not come "
                      "back until the robot moves, in proportion to it")
    parameters = (Parameter("share", "1", 0.05, 0.0, 2.0,
                            source="engineering judgement: some per cent, why machines are loaded once first",
                            bounds_source="engineering judgement: none, to twice what the spring gives"),)
    sentence = "the gear of joint {joint} seats under load: at each pose the largest load so far leaves something behind"
    settles = "load up and down twice without leaving the pose: the second time nothing more is left behind"

    def missing(self, rows: LoadState) -> str:
        if rows.starts.sum() < FEWEST_POSES:
            return "there are too few poses"
        largest = _largest_so_far(rows)
        return "" if np.any(np.abs(largest - rows.torque) > REMEMBERED * np.abs(largest)) else NO_LOAD_OFF

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return np.asarray(values[0] * rows.compliance[i] * _largest_so_far(rows)[:, i])


def _largest_so_far(rows: LoadState) -> Array:
    """The torques (n, 6) [N m] that were largest in size since the pose began."""
    size, number = np.abs(rows.torque), np.arange(len(rows))[:, None]
    # Every pose stands above all before it, so that the largest so far is its own.
    height = size + np.cumsum(rows.starts)[:, None] * (size.max(axis=0, initial=0.0) + 1.0)
    kept = np.maximum.accumulate(np.where(height >= np.maximum.accumulate(height, axis=0), number, 0), axis=0)
    return np.asarray(np.take_along_axis(rows.torque, kept, axis=0))


class Hysteresis(_Hysteresis):
    """q <- clip(q + dtau / T, -1, 1)."""

    other_laws = (Smooth(), Seats())
    formula_source = ("JSME Robotics and Mechatronics Conference 2012, 2P1-E07: harmonic drives' hysteresis as a "
                      "Maxwell-slip model; here one element. R. Dhaouadi, F. Ghorbel, Modeling and Analysis of Hysteresis "
                      "in Harmonic Drive Gears, Syst. Anal. Model. Simul., received 2002")
    parameters = (AMPLITUDE, _slips_at(
        50.0, (4.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0),
        f"{NABTESCO}: lost motion is read at 3 % of the rated torque; 50 N m is that of a gear of 1670 N m"))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * _slip_state_of_log(np.ascontiguousarray(log.torque).tobytes(), float(values[1])))


@lru_cache(maxsize=32)
def _slip_state_of_log(torque: bytes, slip: float) -> Array:
    """Slip state (n,) of a log from zero at its start; kept, since one torque is asked for again with every model of a log."""
    path = np.frombuffer(torque)
    state = slip_state(path, np.arange(len(path)) == 0, slip)
    read_only(state)
    return state


def slip_state(torque: Array, starts: NDArray[np.bool_], slip: Array | float, begin: float = 0.0) -> Array:
    """Maxwell-slip states (n, ...) of torque paths (n, ...) [N m] that slip at these torques: from `begin` at each start, the
    torque before it zero."""
    before = np.concatenate([np.zeros_like(torque[:1]), torque[:-1]])
    before[starts] = 0.0
    change = (torque - before) / slip
    place = np.arange(len(torque)) - np.maximum.accumulate(np.where(starts, np.arange(len(torque)), 0))
    # A step of all pose visits at once, or a row of one path after the other: the few poses of a load test, a long toolpath.
    if ARRAY_STEP * (int(place.max(initial=0)) + 1) < change.size:
        return _all_visits_at_once(change, place, begin)
    paths = [_one_path(path, starts, begin) for path in change.reshape(len(change), -1).T]
    return np.stack(paths, axis=1).reshape(change.shape)


def _all_visits_at_once(change: Array, place: NDArray[np.intp], begin: float) -> Array:
    """States (n, ...) by changes (n, ...) and the place (n,) of each row in its visit."""
    visit = np.cumsum(place == 0) - 1
    length = np.bincount(visit)
    # The longest visits first: the rows at one place follow the first of those at the place before.
    rank = np.empty_like(length)
    rank[np.argsort(-length, kind="stable")] = np.arange(len(length))
    order = np.lexsort((rank[visit], place))
    ends = np.cumsum(np.bincount(place))
    came, sorted_states = np.full(change.shape[1:], begin), change[order]
    for first, last in zip(np.concatenate([[0], ends]), ends, strict=False):
        here = sorted_states[first:last]
        here += came if first == 0 else came[: last - first]
        np.minimum(np.maximum(here, -1.0, out=here), 1.0, out=here)
        came = here
    states = np.empty_like(change)
    states[order] = sorted_states
    return states


def _one_path(change: Array, starts: NDArray[np.bool_], begin: float) -> Array:
    # Compared, not by min and max: of a long path their calls are most of the time.
    state, q = [], 0.0
    for new, step in zip(starts.tolist(), change.tolist(), strict=True):
        if new:
            q = begin
        q += step
        if q > -1.0:
            if q > 1.0:
                q = 1.0
        else:
            q = -1.0
        state.append(q)
    return np.array(state)
