"""How well the size of the noise is known in the directions that a test looks at: degrees of freedom of an F in place of chi^2.

A test statistic b^T G^+ b, b = E^T W r of columns E beside the design D that is free, has the variance that the variance
components say, G = E^T W E - E^T W D (D^T W D + P)^-1 D^T W E. These are estimates. Along an eigenvector v_m of G, to first
order, ln of the variance changes by s_m = -v_m^T (dG / d ln sigma) v_m / lambda_m with them; with their covariance C,
Var(ln of the variance) = s_m^T C s_m is 2 / nu_m of a chi-squared (Satterthwaite 1946, Biometrics Bulletin 2, 110). Over
several directions the harmonic mean, the first order of Fai and Cornelius (1996, J. Stat. Comput. Simul. 54, 363).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.fit.noise import Weights
from identification.fit.posterior import Posterior
from identification.fit.sag import sag_columns

Array = NDArray[np.float64]
# Of the differences by which slopes are taken, in ln of a component.
STEP = 0.1


@dataclass(frozen=True, eq=False)
class NoiseDegrees:
    """Of tests beside the design (n, 3, q) [noise's coordinates], whose prior has that precision (q, q)."""

    fitted: Posterior
    design: Array
    precision: Array

    def along(self, columns: Array, eigenvalues: Array, vectors: Array) -> float:
        """Degrees of freedom of a test of columns (n, 3, m) along eigenvectors (m, r) of their G, eigenvalues (r,)."""
        behind, ahead = (np.array([self._along(columns, vectors, *beside) for beside in side]) for side in self._beside)
        slopes = (behind - ahead) / (2 * STEP * eigenvalues)
        covariance = self.fitted.components_covariance[np.ix_(self._free, self._free)]
        return float(2.0 / max(np.mean(np.einsum("km,kl,lm->m", slopes, covariance, slopes)), 1e-12))

    @cached_property
    def _free(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.fitted.at_map.noise.active)

    @cached_property
    def _beside(self) -> list[list[tuple[Weights, Array]]]:
        """Sigma^-1 and (D^T W D + P)^-1 with each free component a step smaller, and a step larger."""
        at, components = self.fitted.at_map, self.fitted.components
        sides: list[list[tuple[Weights, Array]]] = []
        for step in (-STEP, STEP):
            sides.append([])
            for part in self._free:
                weights = at.noise.weights(components.with_logs(components.logs + step * np.eye(6)[part]), at.row_weight)
                information = weights.inner(self.design, self.design) + self.precision
                sides[-1].append((weights, np.asarray(np.linalg.inv(information), dtype=float)))
        return sides

    def _along(self, columns: Array, vectors: Array, weights: Weights, inverse: Array) -> Array:
        """v^T G v (r,) with these weights."""
        along = columns @ vectors
        cross = weights.inner(self.design, along)
        return np.asarray(np.diag(weights.inner(along, along)) - np.einsum("qr,qp,pr->r", cross, inverse, cross))


def beside_the_springs(fitted: Posterior) -> tuple[Array, Array]:
    """The fit's design (n, 3, q) in the noise's coordinates with these columns behind it, and the precision (q, q) of its prior
    with that of their usual sizes."""
    at = fitted.at_map
    sag = sag_columns(fitted.load_state, at.noise)
    own = at.design.shape[2]
    precision = np.eye(own + sag.shape[2])
    precision[:own, :own] = fitted.prior.precision(fitted.map)
    return np.concatenate([at.design, sag], axis=2), precision
