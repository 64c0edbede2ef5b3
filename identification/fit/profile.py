"""Profile likelihood of each stiffness: what the data alone say, whatever the prior.

The likelihood is Gaussian in the compliances (linear model about the MAP), so the profile of one of them is
a bounded least-squares problem in the five others: they must stay positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.fit.posterior import Posterior

Array = NDArray[np.float64]

# Half the 95 % quantile of chi-squared with one degree of freedom: the drop of ln likelihood at the interval's ends.
DROP_95 = 1.9207294103470620
SPAN = 50.0
POINTS = 81


@dataclass(frozen=True, eq=False)
class Profile:
    """One joint: stiffness (POINTS,) [N m/rad] and the drop of ln likelihood there (POINTS,), 0 at the best.

    kind: bounded (the 95 % limit is crossed on both sides), one-sided, or flat. interval: where it is crossed, None where
    it is not within the points (8 posterior sigmas, at most a factor 50, either way; about what the data say where the prior
    holds the stiffness away from that).
    """

    joint: int
    stiffness: Array
    drop: Array
    kind: str
    interval: tuple[float | None, float | None]

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return {"name": f"k{self.joint}", "kind": self.kind, "interval_95": list(self.interval),
                "stiffness": self.stiffness.tolist(), "log_likelihood_drop": self.drop.tolist()}


def profiles(posterior: Posterior) -> tuple[Profile, ...]:
    """The profiles of the six joints."""
    from scipy.optimize import lsq_linear

    at, scale = posterior.at_map, posterior.compliance
    # Minus ln likelihood in units of c0: 0.5 |R (c / c0 - 1) - q|^2 with R^T R the information.
    information = posterior.information
    pull = posterior.weights.inner(at.design, at.residual[:, :, None])[:, 0]
    eigenvalues, vectors = np.linalg.eigh(information)
    root = np.sqrt(np.maximum(eigenvalues, 1e-12 * eigenvalues.max()))[:, None] * vectors.T
    target = np.linalg.solve(root.T, pull) + root @ np.ones(6)
    likeliest = lsq_linear(root, target, bounds=(0.0, np.inf), method="bvls")
    # Data that want no compliance, or less than they can tell, say how stiff it is at least: that is about one sigma of it.
    best, compliance_std = likeliest.cost, np.sqrt(np.diag(np.linalg.inv(root.T @ root)))
    of_data = np.maximum(likeliest.x, compliance_std)
    results = []
    for joint in range(6):
        others = np.arange(6) != joint

        def cost_at(factor: float, joint: int = joint, others: NDArray[np.bool_] = others) -> float:
            reduced = target - root[:, joint] / factor
            return float(lsq_linear(root[:, others], reduced, bounds=(0.0, np.inf), method="bvls").cost)

        # Eight posterior sigmas either way, as far as the prior lets a stiffness be unknown; where the prior holds it away from
        # what the data say, as many of theirs about that.
        middle, std = 1.0, np.sqrt(posterior.laplace[joint, joint])
        if cost_at(1.0) - best > 0.5 * DROP_95:
            middle, std = 1 / of_data[joint], compliance_std[joint] / of_data[joint]
        span = float(np.exp(np.clip(8 * std, np.log(1.01), np.log(SPAN))))
        factors = np.geomspace(middle / span, middle * span, POINTS)            # of the stiffness
        cost = np.array([cost_at(factor) for factor in factors])
        drop = np.maximum(cost - min(best, cost.min()), 0.0)
        results.append(_classified(joint + 1, factors / scale[joint], drop))
    return tuple(results)


def _classified(joint: int, stiffness: Array, drop: Array) -> Profile:
    inside = np.flatnonzero(drop <= max(DROP_95, drop.min()))
    first, last = int(inside[0]), int(inside[-1])
    low = None if first == 0 else _crossing(stiffness, drop, first - 1, first)
    high = None if last == len(drop) - 1 else _crossing(stiffness, drop, last, last + 1)
    kind = "flat" if low is None and high is None else "bounded" if low is not None and high is not None else "one-sided"
    return Profile(joint, stiffness, drop, kind, (low, high))


def _crossing(stiffness: Array, drop: Array, left: int, right: int) -> float:
    """Where the drop passes the limit between two points, on the logarithm of the stiffness."""
    share = (DROP_95 - drop[left]) / (drop[right] - drop[left])
    return float(np.exp((1 - share) * np.log(stiffness[left]) + share * np.log(stiffness[right])))
