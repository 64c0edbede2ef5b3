"""What is known of a cut's stiffness before passes were compared: by its material, tool and speeds, or by the logged force.

Power: the mean force along the edge's way is the specific cutting force times the chip's section, F = k_c b a v_f / v_c with
the contact b along the tool's axis, the depth a across the feed, the feed v_f and the cutting speed v_c = pi D n. So

    K = DIRECTION k_c(h) b v_f / (pi D n),    k_c(h) = k_c1.1 h^-m_c    (Kienzle; h [mm]),

DIRECTION the part of that force's growth which stands across the feed, and the chip's mean thickness h = v_f / (z n) sqrt(a/D)
with TEETH z and ENGAGED a/D as usual: h enters by its fourth root only. Where contact, diameter or
material are not known there are the force and the depth: K = GROWS F_n / a (`of_force`), and where no depth is stated those
that there are (`depths`).

GROWS = d ln F_n / d ln a. By the linear-edge coefficients of aluminium, steel and titanium (Altintas, Manufacturing Automation,
ch. 2), climb milling with cutters of 10 to 25 mm, feeds of 0.04 to 0.15 mm a tooth and depths of 0.2 mm up to half the
diameter: 0.56 to 0.99, 0.75 in the middle, standard deviation of its logarithm 0.16; the edges' part does not grow, and the
push across grows faster than the force as the engagement opens.

Depth: tool makers give it by the cutter's diameter, for circumference milling up to 3 % to finish and from 7 % on to rough (ATA
Group, catalogue 2022, cutting data of solid carbide end mills), their tables of shoulder milling end at 50 % (Dormer Pramet,
milling catalogue 2021/22). Of cutters of 8 to 20 mm a finishing cut is up to 0.24 to 0.6 mm, a roughing one 0.56 to 10 mm. A
log-normal with its middle at DEPTH and FORCE_WIDTH has 95 % between 0.16 and 3.6 mm; how often which is cut is engineering
judgement.

k_c1.1 and m_c: compensator/cutting/materials.py, which names the source. WIDTH and DIRECTION are engineering judgement: the
values of a group differ by a factor of 1.0 to 1.4 either way, a worn edge and its rake by 1.2, the direction by 1.3
(linear-edge coefficients of aluminium, steel and titanium, depths from 1 % to half of the diameter).
"""

from __future__ import annotations

import numpy as np

from compensator.correction.settings import DEPTH, CorrectionSettings, Estimate
from compensator.cutting.materials import MATERIALS
from identification.common.arrays import Array
from identification.model.cell_file import CuttingFile

DIRECTION, WIDTH = 0.8, 0.4
# Of the mean chip thickness alone: teeth, and depth by diameter.
TEETH, ENGAGED = 3, 0.1
# So large a share of the push across grows with the depth, and 1 sigma of its logarithm over cutters, as above.
GROWS, CUTTERS_DIFFER = 0.75, 0.16
# 1 sigma of ln K: where the depth was stated (cutters differ, and the stock that is there from the stock that was planned by
# 0.25), and where it was not. Engineering judgement.
DEPTH_WIDTH, FORCE_WIDTH = 0.3, 0.8
# 2.5 % of all cuts are less deep across the feed [m].
SHALLOWEST_CUT = DEPTH * float(np.exp(-2 * FORCE_WIDTH))
# The same of a slot whose depth along the axis was stated: where the stock's top and the tool's tip really are.
SLOT_WIDTH = 0.15
# Where none was stated: the middle, and 1 sigma of ln. 95 % within 5 % of the diameter of a cutter of 8 mm and half of that of
# one of 20 mm, 0.4 and 10 mm; engineering judgement.
SLOT_DEPTH, ANY_SLOT = 2e-3, 0.8
# Depths at which an integral over them is taken.
NODES = 9


def of_material(cutting: CuttingFile, feed: float | None, revolution: float | None) -> Estimate | None:
    """K [N/m] of a cut as cell.yaml describes it; feed [m/s] of its moves, revolution [s] of the spindle. None where one of
    them, the diameter or the contact is not known."""
    if not (cutting.material and cutting.tool_diameter_mm and cutting.contact_mm and feed and revolution):
        return None
    material = MATERIALS[cutting.material]
    a_turn, around = 1e3 * feed * revolution, np.pi * cutting.tool_diameter_mm
    chip = a_turn / TEETH * np.sqrt(ENGAGED)
    per_mm = DIRECTION * material.specific * chip**-material.exponent * cutting.contact_mm * a_turn / around
    return _log_normal(1e3 * float(per_mm), WIDTH)


def of_slot(cutting: CuttingFile, feed: float | None, revolution: float | None) -> Estimate | None:
    """K [N/m] of a slot (slot_cut.py), along the tool's axis; None where material, feed or revolution is not known."""
    if not (cutting.material and feed and revolution):
        return None
    material, a_turn = MATERIALS[cutting.material], 1e3 * feed * revolution
    return _log_normal(1e3 * 0.25 * material.specific * (2 * a_turn / (np.pi * TEETH)) ** -material.exponent * a_turn, WIDTH)


def of_slot_depth(push: float, width: float = SLOT_WIDTH) -> Estimate:
    """K [N/m] of a slot whose push across is `push` [N/m] of its depth; width: 1 sigma of ln K."""
    return _log_normal(push, width)


def of_force(across: float, depth: float, width: float = FORCE_WIDTH) -> Estimate:
    """K [N/m] of a cut whose force across the feed is `across` [N] at a depth [m]; width: 1 sigma of ln K."""
    return _log_normal(GROWS * across / depth, width)


def depths(settings: CorrectionSettings) -> tuple[Array, Array]:
    """Depths of cut (NODES,) [m] to reckon with, and their weights (NODES,): about the stated one, or all there are."""
    return _drawn(settings.taken_depth, FORCE_WIDTH if settings.depth_of_cut is None else DEPTH_WIDTH)


def slot_depths() -> tuple[Array, Array]:
    """The same of slots whose depth nobody stated."""
    return _drawn(SLOT_DEPTH, ANY_SLOT)


def _drawn(middle: float, width: float) -> tuple[Array, Array]:
    from numpy.polynomial.hermite_e import hermegauss

    nodes, weights = hermegauss(NODES)
    return middle * np.exp(width * nodes), weights / weights.sum()


def _log_normal(median: float, width: float) -> Estimate:
    """Mean and standard deviation of exp(N(ln median, width^2))."""
    mean = median * float(np.exp(0.5 * width**2))
    return Estimate(mean, mean * float(np.sqrt(np.expm1(width**2))))
