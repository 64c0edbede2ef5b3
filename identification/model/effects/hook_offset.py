"""A weight hangs beside the tool point, always on the same side of the cell."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import OfWrench, hanging, nothing_hangs
from identification.model.load_state import LoadState

JUDGED = "engineering judgement: 10 to 40 mm, their geometric mean: half the width of what a sling or a shackle goes round"
BOUNDED = "engineering judgement: 150 mm, the radius of a large spindle"


class HookOffset(OfWrench):
    """The springs' answer to the moment `d x F` of a weight whose line passes the TCP at d = x a + y b, a and b across gravity:
    a base x (base y where x is plumb) made level, b = up x a. How far below it hangs is the same: a plumb line has no lever
    along itself. A hook that is fixed in the tool is `tool_point`."""

    name = "hook_offset"
    family = "load path"
    formula_source = "the paper, eq. 5, with another lever"
    parameters = (Parameter("x_m", "m", 0.02, -0.15, 0.15, source=JUDGED, bounds_source=BOUNDED),
                  Parameter("y_m", "m", 0.02, -0.15, 0.15, source=JUDGED, bounds_source=BOUNDED))
    sentence = "the weight hung beside the tool point, on the same side of the cell at every pose"
    settles = "hold a plumb line to the hook and measure how far it passes the tool point"

    def missing(self, rows: LoadState) -> str:
        return nothing_hangs(rows)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        up = -rows.fall / np.linalg.norm(rows.fall)
        level = np.eye(3)[0] if abs(up[0]) < 0.99 else np.eye(3)[1]
        level = level - (level @ up) * up
        level /= np.linalg.norm(level)
        lever = values[0] * level + values[1] * np.cross(up, level)
        force = rows.wrench[:, :3] * hanging(rows)[:, None]
        return np.concatenate([rows.wrench[:, :3], rows.wrench[:, 3:] + np.cross(lever, force)], axis=1)
