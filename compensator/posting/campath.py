"""CamPath: the moves a CAM system wrote in APT or CSV, before they are posted as RAPID."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compensator.toolpath import StatedCutter
from identification.common.arrays import Array, read_only
from identification.common.findings import Finding


@dataclass(frozen=True, eq=False)
class CamPath:
    """N targets in the order of the text, in the work object.

    source: the file; form: "APT" or "CSV". move (N,) `Move`: LINEAR, or ARC_VIA and ARC_END in pairs. line (N,) in the source.
    position (N, 3) [m]. Either axis (N, 3), unit, from the tip towards the spindle, or quaternion (N, 4) w x y z, unit.
    rapid (N,): reached in the air. feed (N,) [m/s], NaN where rapid. stop (N,): a stop point, as the bottom of a hole.
    confdata (N, 4) and joints (N, 6) [rad]: None where the file has none. remarks: what stood above a target and is worth
    keeping, one text a line; key N is the end of the file. cutters: that the file states for
    these moves. spindle_rpm: at which moves cut, each once in their order, as far as the file says.
    """

    source: str
    form: str
    move: NDArray[np.uint8]
    line: NDArray[np.int64]
    position: Array
    axis: Array | None
    quaternion: Array | None
    rapid: NDArray[np.bool_]
    feed: Array
    stop: NDArray[np.bool_]
    confdata: NDArray[np.int64] | None
    joints: Array | None
    remarks: Mapping[int, tuple[str, ...]]
    findings: tuple[Finding, ...]
    cutters: tuple[StatedCutter, ...] = ()
    spindle_rpm: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        read_only(*(array for array in vars(self).values() if isinstance(array, np.ndarray)))

    def __len__(self) -> int:
        return len(self.move)
