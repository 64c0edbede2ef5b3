"""How much of what is hidden a load test can show at all, from the generator alone.

The noise-free signal in standard deviations of the true noise, once the six springs have taken what they can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.second_cell.cell import Case

STEP = 1e-3     # of ln k
DETECTABLE, CLEAR = 5.0, 10.0       # sigmas of signal from which an effect can be detected, or stands out


def signal(case: Case) -> float:
    """Length of the signal [sigma] that is left with the springs free."""
    plan, noise = case.plan, case.noise
    plain = 1e6 * case.plain_arm().displacement(plan, plan.load)
    written = 1e6 * case.plain_arm().displacement(replace(plan, q=case.world.table_q), plan.load)
    columns = [case.seen_um - written]
    for i in range(6):
        softer = case.stiffness * np.exp(-STEP * np.eye(6)[i])
        columns.append((1e6 * case.plain_arm(softer).displacement(plan, plan.load) - plain) / STEP)
    give = np.stack([1e6 * case.plain_arm().displacement(plan, np.broadcast_to(axis, plan.load.shape))
                     for axis in np.eye(3)], axis=2)        # (n, 3, 3) [um/N]
    pushed = (plan.load != 0).any(axis=1)[:, None]
    force = np.asarray((noise.relative * plan.load) ** 2 + pushed * noise.absolute**2)
    own = np.einsum("nij,nj,nkj->nik", give, force, give) + max(noise.sensor, 1e-3) ** 2 * np.eye(3)
    whitened = []
    for visit in range(plan.visits):
        mine = np.flatnonzero(plan.visit == visit)
        covariance = np.kron(np.ones((len(mine), len(mine))), noise.seating**2 * np.eye(3))
        for k, row in enumerate(mine):
            covariance[3 * k:3 * k + 3, 3 * k:3 * k + 3] += own[row]
        kept = plan.read[mine].ravel()
        whitened.append(np.linalg.solve(np.linalg.cholesky(covariance[np.ix_(kept, kept)]),
                                        np.column_stack([c[mine].ravel()[kept] for c in columns])))
    shown, springs = np.concatenate(whitened)[:, 0], np.concatenate(whitened)[:, 1:]
    left = shown - springs @ np.linalg.lstsq(springs, shown, rcond=None)[0]
    return float(np.linalg.norm(left))
