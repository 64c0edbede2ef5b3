"""The spring or cylinder that carries the lower arm makes joint 2's stiffness change with its angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.base import Effect, Parameter, Signature, polar
from identification.model.load_state import LoadState

Array = NDArray[np.float64]


class GravityCompensator(Effect):
    """`J_2 tau_2 c_2 alpha cos(2 q2 + phi)`; linear in alpha cos phi and alpha sin phi."""

    name = "gravity_compensator"
    family = "gear"
    of_robot = True
    joints = (2,)
    parameters = (Parameter("amplitude", "1", 0.27, 0.0, 1.0),
                  Parameter("phase_rad", "rad", 1.0, -3.1416, 3.1416, shape=True),)
    sentence = "the gravity compensator makes joint 2 stiffer at some angles than at others"
    settles = "measure at more angles of joint 2"

    def contribution(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        share = values[0] * np.cos(2 * rows.theta[:, 1] + values[1])
        return np.asarray(rows.jacobian[:, :, 1] * (rows.torque[:, 1] * rows.compliance[1] * share)[:, None])

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        columns = [self.contribution(rows, joint, np.array([1.0, phase]))[:, :3] for phase in (0.0, np.pi / 2)]
        return [Signature(np.stack(columns, axis=2), np.full(2, self.parameters[0].typical), False, polar, self)]
