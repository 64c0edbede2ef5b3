"""Friction in every gear: none comes back the way it went."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Effect, Parameter
from identification.model.effects.documents import NABTESCO
from identification.model.effects.hysteresis import AMPLITUDE, Smooth, last_state
from identification.model.effects.kinds import NO_LOAD_OFF
from identification.model.load_state import LoadState

ONE_GEAR = Smooth()


class LostMotion(Effect):
    """The sum over all six gears of `J_i h_i q_i`, q_i the state of `hysteresis.smooth` that slips at the torque under which
    gear i winds up by w: by how much each lost is its own, when it slips an angle that all have in common."""

    name = "lost_motion"
    family = "gear"
    of_robot = True
    by_visit = True
    formula_source = (f"{NABTESCO}: lost motion and hysteresis loss are angles that hold for all sizes of a series; the loop "
                      "of each gear: W. D. Iwan, J. Appl. Mech. 33, 1966")
    parameters = (
        *(replace(AMPLITUDE, name=f"amplitude_{joint}_rad") for joint in ONE_GEAR.joints),
        Parameter("wind_up_rad", "rad", 1e-4, 1e-6, 1e-2, grid=(2.5e-5, 5e-5, 1e-4, 2e-4, 4e-4, 8e-4), shape=True,
                  source=f"{NABTESCO}: a gear winds up by about an arcmin under its rated torque; the last surface slips at a "
                         "third of that: engineering judgement",
                  bounds_source="engineering judgement: friction that nothing but a dial would show, to half a degree"),
    )
    sentence = "every gear has friction inside: the arm does not come back the way it went when the load is taken off"
    settles = "load up, down and up again without leaving the pose, joint after joint, and read at zero load each time"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        wind_up = float(values[-1])
        state = last_state(rows, (wind_up,), lambda: ONE_GEAR.state(rows.torque, rows.starts, wind_up / rows.compliance))
        return np.asarray(np.einsum("nri,i,ni->nr", rows.jacobian, values[:-1], state))

    def of_each_visit(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        """The state in which the way to the pose left each gear."""
        begun = ONE_GEAR.begun(rows.torque, rows.starts, values[-1] / rows.compliance)
        return np.asarray(np.einsum("nri,i,nib->nrib", rows.jacobian, values[:-1], begun).reshape(*rows.jacobian.shape[:2], -1))

    def missing(self, rows: LoadState) -> str:
        return NO_LOAD_OFF if ONE_GEAR.missing(rows) else ""
