"""What handbooks know of a material's cutting force, and the six coefficients they stand for, with their width.

Kienzle's law for the force along the edge's way is F = k_c1.1 b h^(1 - m_c). k_c1.1 and m_c: ISCAR, Turning Tools catalogue
2017, p. 558, and Boring Systems 2022, p. 111, material groups by DIN/ISO 513 and VDI 3323; the middle of a group's values in
logarithms (the two differ for titanium alone). Its tangent at a chip thickness h is the linear-edge model there:

    Ktc = (1 - m) k_c1.1 h^-m,    Kte = m k_c1.1 h^(1 - m) .

The radial and the axial coefficients are taken as shares of these (RATIOS). Their middle and width are engineering judgement
about published sets of coefficients of end mills in aluminium (Al7075-T6: 767, 169, 222 N/mm^2 and 27.7, 26.6, 0.7 N/mm,
Chinese Journal of Mechanical Engineering, doi 10.1186/s10033-021-00536-9, table 5): a set of another tool or alloy lies within
half to twice of them. The edge's radial force of that set is as large as its tangential one, whose share of the force is
0.6 at a chip of 0.025 mm, where the tangent above has a quarter: so that the force points as that set's, with 0.66 of it across
the edge's way, the share is 1.75. Engineering judgement is WIDTH too, of all six together: the values of a group, a worn edge
and its rake.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from identification.common.arrays import Array


class Material(NamedTuple):
    """specific: k_c1.1 [N/mm^2], of a chip 1 mm thick and wide; exponent: m_c."""

    specific: float
    exponent: float


MATERIALS = {
    "aluminium": Material(735.0, 0.25),            # groups 21 to 25: 700 to 800
    "copper_alloy": Material(700.0, 0.27),         # 26 to 28: 700
    "cast_iron": Material(1270.0, 0.26),           # 15 to 20: 1150 to 1420
    "steel": Material(1740.0, 0.23),               # 1 to 11: 1350 to 2500
    "stainless_steel": Material(1970.0, 0.21),     # 12 to 14: 1875 to 2150
    "titanium": Material(1560.0, 0.23),            # 36, 37: 1160 to 2110
    "superalloy": Material(3090.0, 0.24),          # 31 to 35: 2600 to 3300
    "hardened_steel": Material(4600.0, 0.24),      # 38 to 41: 4500 to 4700; its exponent is not given: as of steel
}
# Krc / Ktc, Kac / Ktc, Kre / Kte, Kae / Kte: middle, and 1 sigma of each. Then 1 sigma of ln of Ktc and Kte together, of Ktc
# alone and of Kte alone: the curve's tangent tells the edge's part badly.
RATIOS, RATIO_STD = np.array([0.3, 0.2, 1.75, 0.1]), np.array([0.15, 0.15, 0.8, 0.3])
WIDTH, OF_SHEAR, OF_EDGE = 0.4, 0.1, 0.4
THINNEST, THICKEST = 0.005e-3, 0.3e-3


def coefficients_of(material: str, chip: float) -> tuple[Array, Array]:
    """Mean (6,) and covariance (6, 6) of Ktc Krc Kac [N/m^2] and Kte Kre Kae [N/m] of a material of MATERIALS, for a feed a
    tooth `chip` [m], whose chips are half as thick in the middle."""
    known = MATERIALS[material]
    thick = 1e3 * float(np.clip(0.5 * chip, THINNEST, THICKEST))
    shear = 1e6 * (1 - known.exponent) * known.specific * thick**-known.exponent
    edge = 1e3 * known.exponent * known.specific * thick ** (1 - known.exponent)
    mean = np.array([shear, RATIOS[0] * shear, RATIOS[1] * shear, edge, RATIOS[2] * edge, RATIOS[3] * edge])
    of_shear = mean * (np.arange(6) < 3)
    of_edge = mean - of_shear
    own = np.repeat([shear, edge], 3) * [0.0, *RATIO_STD[:2], 0.0, *RATIO_STD[2:]]
    covariance = (WIDTH**2 * np.outer(mean, mean) + OF_SHEAR**2 * np.outer(of_shear, of_shear)
                  + OF_EDGE**2 * np.outer(of_edge, of_edge) + np.diag(own**2))
    return mean, covariance
