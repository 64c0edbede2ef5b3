"""A robot arm that shares no physics code with the packages: the independent truth of the tests and the samples.

Built from the zero pose of the arm as a drawing shows it (shoulder, elbow, wrist, flange as points, axes as unit vectors)
and products of rotations about them, for one pose or many. The parallel rod is what it is mechanically: the drive of joint 3
sets the forearm's angle against the horizontal, whatever the lower arm does. Springs sit at the drives; the loaded pose
solves the balance of virtual work `k_i dq_i = d(work of the load) / d q_i` with SciPy's root finder and differences of the
pose itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

X, Y, Z = np.eye(3)


def _about(axis: np.ndarray, angle: np.ndarray) -> Rotation:
    """Turned about an axis (3,) by one angle or many (n,) [rad]."""
    return Rotation.from_rotvec(np.multiply.outer(angle, axis))


@dataclass(frozen=True)
class Arm:
    """Lengths [m] as in a data sheet: base height, shoulder offset, lower arm, elbow offset, forearm, flange."""

    height: float
    shoulder: float
    lower_arm: float
    elbow: float
    forearm: float
    flange: float
    parallel_rod: bool

    def pose(self, q: np.ndarray, tcp: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """TCP position [m] and flange orientation at drive angles q (6,) or (n, 6) [rad]; tcp (3,) [m] in the flange frame."""
        turn, lean, lift, roll, bend, spin = q.T
        column = _about(Z, turn)
        lower = column * _about(Y, lean)
        forearm = column * _about(Y, lift if self.parallel_rod else lean + lift)
        shoulder = column.apply([self.shoulder, 0, self.height])
        elbow = shoulder + lower.apply([0, 0, self.lower_arm])
        wrist = elbow + forearm.apply([self.forearm, 0, self.elbow])
        hand = forearm * _about(X, roll) * _about(Y, bend) * _about(X, spin)
        # tool0: z out of the flange (along the forearm at zero), x downwards.
        flange = hand * Rotation.from_matrix([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
        return wrist + hand.apply([self.flange, 0, 0]) + flange.apply(tcp), flange

    def loaded(self, q: np.ndarray, tcp: np.ndarray, wrench: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        """Drive angles (6,) at rest under a wrench (6,) [N, N m] on the tool, base frame; stiffness (6,) [N m/rad]."""
        step, each = 1e-6, np.eye(6)

        def balance(yielded: np.ndarray) -> np.ndarray:
            angles = q + yielded * 1e-3
            (first, turned), (last, back) = self.pose(angles + step * each, tcp), self.pose(angles - step * each, tcp)
            torque = (first - last) @ wrench[:3] + (turned * back.inv()).as_rotvec() @ wrench[3:]
            return yielded - 1e3 * torque / (2 * step) / stiffness

        solution = root(balance, np.zeros(6), tol=1e-13)
        assert np.max(np.abs(solution.fun)) < 1e-8, solution.message
        return q + solution.x * 1e-3

    def deviation(
        self, q: np.ndarray, tcp: np.ndarray, wrench: np.ndarray, stiffness: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """TCP displacement (3,) [m] and rotation vector (3,) [rad] under the wrench, base frame."""
        before, flange = self.pose(q, tcp)
        after, turned = self.pose(self.loaded(q, tcp, wrench, stiffness), tcp)
        return after - before, (turned * flange.inv()).as_rotvec()


IRB6660 = Arm(0.8145, 0.3, 0.7, 0.28, 0.893, 0.2, parallel_rod=True)
IRB6700 = Arm(0.78, 0.32, 1.125, 0.2, 1.1425, 0.2, parallel_rod=False)
IRB6640 = Arm(0.78, 0.32, 1.075, 0.2, 1.1425, 0.2, parallel_rod=False)
IRB4400 = Arm(0.68, 0.2, 0.89, 0.15, 0.88, 0.14, parallel_rod=True)
ARMS = {"irb6660-205-1.90": IRB6660, "irb6700-200-2.60": IRB6700, "irb6640-235-2.55": IRB6640, "irb4400-60": IRB4400}
