"""A frame as YAML files give it: position and quaternion."""

from __future__ import annotations

import numpy as np

from identification.common.yaml_source import Quaternion, Strict, Triple
from identification.model.rotations import Frame

ZERO: Triple = (0.0, 0.0, 0.0)
UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)


class FrameFile(Strict):
    """A frame as position and quaternion."""

    position_mm: Triple = ZERO
    quaternion: Quaternion = UPRIGHT

    def frame(self) -> Frame:
        """In metres."""
        return Frame.from_quaternion(1e-3 * np.array(self.position_mm), self.quaternion)
