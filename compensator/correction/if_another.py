"""What it would mean for the part were stock, cutter or material another than stated, in micrometres: forces from the stock.

A stock that stands aside within what is plausible, a cutter of the next diameter or another alloy go through every check; only
the engagement shows them. So what a millimetre of each does to the correction stands beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compensator.correction.loaded_path import LoadedPath
from compensator.forces.predicted_forces import StockCut
from identification.common.arrays import Array, rms
from identification.model.compliance import position_compliance

# A stock aside by, a cutter thicker by [m]; forces larger by, edges worn so that they need so much more.
ASIDE, THICKER, LARGER, WORN = 1e-3, 1e-3, 0.1, 0.5
# A cut so much as wide as its cutter has material on both sides of it.
SLOT = 0.9


@dataclass(frozen=True)
class IfAnother:
    """aside, higher, thicker, larger, worn [um]: RMS over the targets by which the correction would be another.
    cut: as it is stated."""

    cut: StockCut
    aside: float
    higher: float
    thicker: float
    larger: float
    worn: float

    @property
    def words(self) -> str:
        """One sentence."""
        return (f"{self.cut.words}. The correction would be another by about {self.aside:.0f} um RMS were the stock "
                f"{1e3 * ASIDE:g} mm aside, by {self.higher:.0f} um were its top {1e3 * ASIDE:g} mm higher, by "
                f"{self.thicker:.0f} um were the cutter {1e3 * THICKER:g} mm thicker, by {self.larger:.0f} um for each "
                f"{100 * LARGER:.0f} % of force that the material takes more, by {self.worn:.0f} um were the edges worn by "
                "half since the log")


def if_another(loaded: LoadedPath, deviation: Array) -> IfAnother | None:
    """Of a program whose forces were predicted, deviation (M, 3) [m] of its targets; None for a log, or where nothing cuts."""
    forces, targets = loaded.forces, loaded.targets
    cut = None if forces.log.predicted is None else forces.log.predicted.cut
    if cut is None or forces.follows is None or not len(targets):
        return None
    follows, moved = forces.follows[targets], np.empty((len(targets), 3, 3))
    worn, higher = np.empty((2, len(targets), 3))
    for tool, places in loaded.each_tool():
        compliance = position_compliance(loaded.model.robot, loaded.planned_theta[places], tool, loaded.model.compliance)
        moved[places] = compliance @ follows[places]
        worn[places] = WORN * np.einsum("nij,nj->ni", compliance, cut.of_edges[targets[places]])
        higher[places] = ASIDE * np.einsum("nij,nj->ni", compliance, cut.of_top[targets[places]])
    # By where the stock stands along x and y of the work object; the worse of the two.
    axes = loaded.path.base_from_object.rotation[targets][:, :, :2]
    along = 1e6 * ASIDE * np.linalg.norm(moved @ axes, axis=1)
    size, width = 1e6 * np.linalg.norm(deviation, axis=1), cut.width[targets]
    # One side of the cutter comes nearer to the material by half of what it is thicker, both sides where it is a slot.
    wider = THICKER * np.where(width > SLOT * cut.diameter, 1.0, 0.5)
    return IfAnother(cut, max(rms(column) for column in along.T), 1e6 * rms(np.linalg.norm(higher, axis=1)),
                     rms(size * wider / np.maximum(width, wider)), LARGER * rms(size), 1e6 * rms(np.linalg.norm(worn, axis=1)))
