"""What the milling job asks of the stiffnesses: the weight of the I-criterion.

Where a program's target has the position Jacobian J (3, 6) and the cutting force has the second moment F = E[f f^T] (3, 3), the
predicted deflection `G f` with `G = J diag(c) J^T` has, for an uncertainty C of ln c, the mean variance

    E trace( D(f) C D(f)^T ) = trace(W C) ,    W = E[D(f)^T D(f)] = (c c^T) * (J^T J) * (J^T F J)

(elementwise products), since column i of D(f) is `c_i J_i (J_i . f)`. W is the mean over the program's targets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.findings import Finding
from identification.design.information import Instrument
from identification.model.kinematics import forward, jacobian
from identification.model.rotations import Frame

Array = NDArray[np.float64]
# Cutting force where no log is given: as much along each base axis, so that the criterion does not favour a direction.
USUAL_FORCE_N = 100.0


@dataclass(frozen=True, eq=False)
class MillingPoses:
    """The targets a job is milled at: theta (n, 6) [rad], flange_from_tcp (n) of their tools, tcp (n, 3) [m] in the base frame,
    source: the program's name. targets: how many the program has. force (3, 3) or (n, 3, 3) [N^2]: second moment of the
    cutting force in the base frame, assumed where no log was given. findings: of the program and its log."""

    theta: Array
    flange_from_tcp: Frame
    tcp: Array
    source: str
    targets: int
    force: Array
    findings: tuple[Finding, ...] = ()


def assumed_force() -> Array:
    """Second moment (3, 3) [N^2] of a force that is as large along each base axis."""
    return USUAL_FORCE_N**2 * np.eye(3)


def prediction_weight(rig: Instrument, milling: MillingPoses) -> Array:
    """W (6, 6) [m^2]: trace(W C) is the mean variance of the predicted deflection, all three components together."""
    robot = rig.cell.robot
    flange = jacobian(robot, milling.theta, Frame.identity())
    # From the flange's origin to the TCP, whose tool may be another at each target.
    base_from_flange = forward(robot, milling.theta, Frame.identity())
    lever = np.einsum("nij,nj->ni", base_from_flange.rotation,
                      np.broadcast_to(milling.flange_from_tcp.position, (len(milling.theta), 3)))
    columns = flange[:, :3] + np.swapaxes(np.cross(np.swapaxes(flange[:, 3:], 1, 2), lever[:, None, :]), 1, 2)
    turned = np.swapaxes(columns, 1, 2)
    moment = (turned @ columns) * (turned @ milling.force @ columns)
    return np.asarray(np.outer(rig.compliance, rig.compliance) * moment.mean(axis=0))
