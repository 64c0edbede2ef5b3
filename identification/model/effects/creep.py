"""The deflection goes on growing while the load is on, and goes back as slowly when it is gone."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.kinematics import Chain
from identification.model.load_state import LoadState

# log(1 + u) as a sum of Kelvin elements: the integral of (1 - exp(-s u)) exp(-s) / s over s, by steps of ln s.
STEP = 1.2
RATES = np.exp(np.arange(-12.0, 2.5, STEP))
SHARES = STEP * np.exp(-RATES)
# Numbers held at once; the elements of a longer file go in turns.
CHUNK = 2_000_000


class _Creep(Effect):
    """What the laws have in common."""

    name = "creep"
    family = "structure"
    of_robot = True
    sentence = "the robot goes on yielding while the load is on"
    settles = "hold one load and read the sensors after 5 and after 60 seconds"


class OneElement(_Creep):
    """Each change of the springs' deflection creeps on by `rho (1 - exp(-t / t0))`, as one Kelvin element does, and comes to an
    end."""

    law = "element"
    formula_source = ("W. N. Findley, J. S. Lai, K. Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976: "
                      "the Kelvin element")
    parameters = (
        Parameter("ratio", "1", 0.03, 0.0, 1.0,
                  source="engineering judgement: what `rho log(1 + t / t0)` of the first law comes to in a minute or so",
                  bounds_source="engineering judgement: never backwards, to as much as the springs yield at once"),
        Parameter("time_s", "s", 20.0, 0.2, 600.0, grid=(4.0, 15.0, 60.0), shape=True,
                  source="engineering judgement: from the first reading after loading to the time one pose takes",
                  bounds_source="engineering judgement: over before the first reading, to ten minutes"),
    )

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        twist = rows.compliance * crept(rows, rows.torque, values[1])
        return np.asarray(values[0] * np.einsum("nri,ni->nr", rows.jacobian, twist))


class Creep(_Creep):
    """Each change of the springs' deflection creeps on by `rho log(1 + t / t0)`, t the time since it came (Boltzmann's
    superposition): what crept under earlier loads of the visit goes back as slowly as it came. memory 0: nothing of it was
    left, because the robot rested before each load. Along a toolpath nothing rests."""

    other_laws = (OneElement(),)
    formula_source = ("M. E. Kassner, K. K. Smith, C. S. Campbell, Low-temperature creep in pure metals and alloys, J. "
                      "Mater. Sci. 50, 2015: logarithmic in time; in proportion to the deflection, changes of the load "
                      "superposed as in linear viscoelasticity: engineering judgement")
    parameters = (
        Parameter("ratio", "1", 0.017, 0.0, 0.3,
                  source="engineering judgement: 1 to 3 % for each factor e of time, their geometric mean",
                  bounds_source="engineering judgement: never backwards, under a third of the deflection"),
        Parameter("time_s", "s", 3.0, 0.05, 300.0, grid=(1.0, 3.0, 10.0), shape=True,
                  source="engineering judgement: 1 to 10 s, when the first reading after loading is taken",
                  bounds_source="engineering judgement: from one reading to the time one pose takes"),
        Parameter("memory", "1", 1.0, 0.0, 1.0, grid=(0.0, 1.0), shape=True,
                  source="engineering judgement: in a load cycle nobody waits for the robot to recover",
                  bounds_source="engineering judgement: what crept under earlier loads is all there still, or nothing of it"),
    )

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        ratio, time, memory = values
        if rows.at_load:
            memory = 1.0
        crept = rows.torque * np.log1p(rows.held / time)[:, None]
        if memory:
            crept = crept + memory * _left_of_torques(rows, time)
        return np.asarray(ratio * np.einsum("nri,ni->nr", rows.jacobian, rows.compliance * crept))


def crept(rows: LoadState, load: Array, time: float) -> Array:
    """By how much what follows loads (n, k) has crept on, as one Kelvin element of this time [s] does, under these and what is
    left of earlier ones of their visit."""
    held = rows.held
    left = _left_of_earlier(rows, load, held, np.array([1 / time]), np.ones(1))
    return np.asarray(load * -np.expm1(-held / time)[:, None] + left)


# Of a loaded pose, whatever springs hold it, what was asked for last, with its time: slopes by the springs ask for the same.
_LAST: WeakKeyDictionary[Chain, tuple[float, Array]] = WeakKeyDictionary()


def _left_of_torques(rows: LoadState, time: float) -> Array:
    """`_left_of_earlier` of the torques at the springs, in the elements of a logarithm that begins with this time [s]."""
    kept = _LAST.get(rows.frames)
    if kept is None or kept[0] != time:
        kept = _LAST[rows.frames] = time, _left_of_earlier(rows, rows.torque, rows.held, RATES / time, SHARES)
    return kept[1]


def _left_of_earlier(rows: LoadState, load: Array, held: Array, rates: Array, shares: Array) -> Array:
    """What is still there (n, k) of what crept under the loads (n, k) of the visit before each row's own, in elements of these
    rates (m,) [1/s] and shares (m,).

    An element that stood at z when a load came stands at `load + (z - load) exp(-t / T)` a time t after. Between the reading
    before and a row's load the load before is still on; where no times are known, no time passes there.
    """
    from scipy.linalg.lapack import dtbtrs

    before = np.concatenate([load[:1], load[:-1]])
    pause = np.diff(rows.time, prepend=np.nan) - held
    pause = np.where(pause > 0, pause, 0.0)
    later, total = ~rows.starts, np.zeros_like(load)
    at_once = max(1, CHUNK // load.size)
    for start in range(0, len(rates), at_once):
        rate, share = rates[start: start + at_once, None], shares[start: start + at_once]
        stays, waits = np.exp(-rate * held), np.exp(-rate * pause)                                      # (elements, n)
        # All elements as one chain that begins anew with each of them, as it does with each visit.
        bands = np.zeros((2, stays.size))
        bands[1, :-1] = np.where(later, -stays * waits, 0.0).ravel()[1:]
        own = load * (1 - stays)[:, :, None]
        driven = own + before * np.where(later, stays * (1 - waits), 0.0)[:, :, None]
        z, _ = dtbtrs(bands, driven.reshape(-1, load.shape[1]), uplo="L", diag="U")
        # The part of z that is not this row's own load.
        total += np.tensordot(share, z.reshape(own.shape) - own, axes=1)
    return total
