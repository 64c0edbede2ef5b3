"""A force sensor that is turned in its seat by a little turns every force: what that makes of the deviation.

Turned by a small r about its own origin it reads force and moment that are turned by as much. Carried to the TCP, with the
lever l from the TCP to that origin,

    dF = r x F,      dM = r x M - (r x l) x F,

of which the springs make d = C (dF, dM). r has the same sigma about each axis, so that it is the same in all frames. Where
the log has no moments, or has them about the TCP, l is nothing. It is the force of the cut that is turned: what a turned sensor
does to the weight that is taken off is left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compensator.correction.loaded_path import LoadedPath
from identification.common.arrays import Array
from identification.model.compliance import cross

Indices = NDArray[np.intp]


def mounting_std(loaded: LoadedPath) -> float:
    """1 sigma [rad] of how the sensor may be turned about each axis; 0 where cell.yaml does not say."""
    return float(np.radians(loaded.path.cell.force_log.form.mounting_std_deg or 0.0))


def lever_of(loaded: LoadedPath) -> Array:
    """From the TCP to what logged moments turn about (M, 3) [m], base frame."""
    path, frame = loaded.path, loaded.path.cell.force_log
    if not loaded.forces.log.has_moment or frame.kind != "sensor" or frame.flange_from_sensor is None:
        return np.zeros((len(loaded.targets), 3))
    origin = path.base_from_flange[loaded.targets] @ frame.flange_from_sensor
    return np.asarray(origin.position - path.base_from_tcp.position[loaded.targets])


def by_turned_sensor(columns: Array, compliance: Array, wrench: Array, lever: Array, std: float) -> Array:
    """Covariance (3, 3, n) [m^2] of the deviation, components first, by a sensor turned by std [rad] about each axis: of
    springs with the Jacobian's columns (6, 6, n) and compliance (6,) [rad/(N m)] under wrench (n, 6) [N, N m] at the TCP;
    lever (n, 3) [m], base frame."""
    force, moment = wrench.T[:3], wrench.T[3:]
    total: Any = 0.0
    for axis in np.eye(3)[:, :, None]:
        turned, aside = cross(axis, force), cross(axis, moment) - cross(cross(axis, lever.T), force)
        torque = np.einsum("irn,rn->in", columns[:, :3], turned) + np.einsum("irn,rn->in", columns[:, 3:], aside)
        moved = np.einsum("irn,in->rn", columns[:, :3], compliance[:, None] * torque)
        total = total + moved[:, None] * moved[None]
    return np.asarray(std**2 * total)
