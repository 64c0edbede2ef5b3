"""Friction inside a gear: the way back is not the way there."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array, read_only
from identification.model.effects.base import Parameter, Signature, saturated
from identification.model.effects.documents import NABTESCO
from identification.model.effects.kinds import GearTwist
from identification.model.joint_log import JointLog
from identification.model.load_state import LoadState

# Friction is seen where a load comes back: in so many rows at least, whose twist is off the first loading's by this share of
# the amplitude. Engineering judgement: fewer are single readings, and less is no loop.
FEWEST_WITNESSES, REMEMBERED = 3, 0.2


class Hysteresis(GearTwist):
    """`J_i h q`, q a Maxwell-slip state of the load path: q <- clip(q + dtau / T, -1, 1), from zero at the start of each
    pose. With a negative amplitude the twist lags behind the torque, as friction makes it; a positive one runs ahead."""

    name = "hysteresis"
    formula_source = ("JSME Robotics and Mechatronics Conference 2012, 2P1-E07: harmonic drives' hysteresis as a "
                      "Maxwell-slip model; here one element. R. Dhaouadi, F. Ghorbel, Modeling and Analysis of Hysteresis "
                      "in Harmonic Drive Gears, Syst. Anal. Model. Simul., received 2002")
    parameters = (
        Parameter("amplitude_rad", "rad", 4.4e-5, -1e-3, 1e-3,
                  source=f"{NABTESCO}: lost motion 0.3 to 0.6 arcmin on average; half of 0.3",
                  bounds_source="engineering judgement: either sign, three times the 1 arcmin of hysteresis loss that gears "
                                f"stay under by {NABTESCO}"),
        Parameter("torque_nm", "N*m", 50.0, 2.0, 1000.0, grid=(10.0, 20.0, 40.0, 80.0, 160.0), shape=True,
                  source=f"{NABTESCO}: lost motion is read at 3 % of the rated torque; 50 N m is that of a gear of 1670 N m",
                  bounds_source="engineering judgement: from a small gear's idle friction to a torque that no milling load "
                                "reaches"),
    )
    sentence = "the gear of joint {joint} has friction inside: it does not come back the way it went when the load is taken off"
    turning = "slips the other way"
    settles = "load up, down and up again without leaving the pose, and read at zero load each time"

    def twist(self, rows: LoadState, i: int, values: Array) -> Array:
        return np.asarray(values[0] * slip_state(rows.torque[:, i], rows.starts, values[1]))

    def missing(self, rows: LoadState) -> str:
        if any(self._witnesses(rows, joint, slip) for joint in self.joints for slip in self.parameters[1].grid):
            return ""
        return "no pose was loaded and unloaded, so that no load could leave anything behind"

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        """Nothing for a slip that leaves no trace in these rows: where the load only grew from zero the twist is that of a soft
        gear, and tells nothing of friction."""
        return [shape if self._witnesses(rows, joint, slip) else replace(shape, rows=np.zeros_like(shape.rows))
                for slip, shape in zip(self.parameters[1].grid, super().signatures(rows, joint), strict=True)]

    def _witnesses(self, rows: LoadState, joint: int | None, slip: float) -> bool:
        """Whether enough rows keep something of the loads before theirs."""
        torque = rows.torque[:, self.index(joint)]
        kept = slip_state(torque, rows.starts, slip) - saturated(torque / slip)
        return int(np.sum(np.abs(kept) > REMEMBERED)) >= FEWEST_WITNESSES

    def side(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        return np.trunc(slip_state(rows.torque[:, self.index(joint)], rows.starts, values[1]))

    def log_contribution(self, log: JointLog, values: Array) -> Array:
        return np.asarray(values[0] * _slip_state_of_log(np.ascontiguousarray(log.torque).tobytes(), float(values[1])))


@lru_cache(maxsize=32)
def _slip_state_of_log(torque: bytes, slip: float) -> Array:
    """Slip state (n,) of a log from zero at its start; kept, since one torque is asked for again with every model of a log."""
    path = np.frombuffer(torque)
    state = slip_state(path, np.arange(len(path)) == 0, slip)
    read_only(state)
    return state


def slip_state(torque: Array, starts: NDArray[np.bool_], slip: float) -> Array:
    """Maxwell-slip state (n,) of a torque path (n,) [N m]: from zero at each start, the torque before it zero too."""
    before = np.concatenate([[0.0], torque[:-1]])
    before[starts] = 0.0
    change = ((torque - before) / slip).tolist()
    state, q = [], 0.0
    for new, step in zip(starts.tolist(), change, strict=True):
        q = min(1.0, max(-1.0, (0.0 if new else q) + step))
        state.append(q)
    return np.array(state)
