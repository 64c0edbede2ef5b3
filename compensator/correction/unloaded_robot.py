"""How far the robot stands from where it is sent without any load, as a calibration states it (`accuracy` in cell.yaml).

The statement is the root mean square P of the distance over the work space: P / sqrt(3) a component. Of a part that was placed
otherwise all of that counts. Of one whose work object was measured with this robot, at the part, a shift and a turn that all
of the part has in common are in the work object already, and what is left is how the error changes over the part. It is taken
for a Gaussian process over the work space as the learned remainder is (compensator/learned/remainder.py), f ~ k, with the rigid
motion that fits it best at places U spread over the targets taken off:

    f(x) - H(x) H_U^+ f(U),      var = k(x, x) - A k(U, x) - (A k(U, x))^T + A k(U, U) A^T,      A = H(x) H_U^+ .

Both passes of a program have it alike. Where a measured part was learned from, what is left of it is in what was learned, but
for a set-up that is another one (`--repeats nothing`) and was not probed.
"""

from __future__ import annotations

import numpy as np

from compensator.correction.predict import Predicted
from compensator.learned.remainder import features, kernel, spread_out
from identification.common.arrays import Array
from identification.model.kinematics import chunks

# The rigid motion is that of so many places at most, chosen among so many targets.
PLACES, AMONG = 60, 2000


def by_unloaded_robot(predicted: Predicted) -> Array | None:
    """Covariance (M, 3, 3) [m^2] of where the tool stands without load, base frame; None where nothing is stated."""
    accuracy, count = predicted.cell.accuracy, len(predicted.targets)
    another_set_up = predicted.settings.correction.repeats == "nothing"
    if accuracy is None or not count or (
            predicted.loaded.learned is not None and (accuracy.probed_by_robot or not another_set_up)):
        return None
    variance = (1e-6 * accuracy.position_um) ** 2 / 3
    if accuracy.length_mm is None:
        return np.broadcast_to(variance * np.eye(3), (count, 3, 3))
    return variance * beside_a_rigid_motion(predicted.loaded.plan.position, predicted.loaded.planned_theta,
                                            1e-3 * accuracy.length_mm)


def beside_a_rigid_motion(position: Array, theta: Array, length: float) -> Array:
    """Covariance (n, 3, 3) of what a rigid motion leaves of a process of unit variance a component, at TCP positions (n, 3) [m]
    and joint angles (n, 6) [rad]; length [m] over which it changes."""
    every = max(len(position) // AMONG, 1)
    chosen = every * spread_out(position[::every], theta[::every], length, PLACES)
    middle = position[chosen].mean(axis=0)
    size = max(float(np.linalg.norm(position[chosen] - middle, axis=1).max()), 1e-9)

    def motion(at: Array) -> Array:
        """Displacements (k, 3, 6) of three shifts and three turns."""
        lever = (at - middle) / size
        turns = np.cross(np.eye(3), lever[:, None])
        return np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns.swapaxes(1, 2)], axis=2)

    places = features(position[chosen], theta[chosen], length)
    fit = np.linalg.pinv(motion(position[chosen]).reshape(-1, 6)).reshape(6, -1, 3)
    known = np.einsum("aui,uv,bvi->ab", fit, kernel(places, places), fit)
    found = np.empty((len(position), 3, 3))
    for part in chunks(len(position)):
        here = motion(position[part])
        with_places = kernel(features(position[part], theta[part], length), places)
        shared = here @ np.einsum("aui,nu->nai", fit, with_places)
        found[part] = np.eye(3) - shared - shared.swapaxes(1, 2) + here @ known @ here.swapaxes(1, 2)
    return found
