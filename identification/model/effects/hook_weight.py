"""Every load is larger than reported by the same: a hook that nobody weighed."""

from __future__ import annotations

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter
from identification.model.effects.kinds import ONE_SIZE, OfWrench
from identification.model.load_state import LoadState

# Loads of fewer sizes than two, this share apart, tell it not from a gain of all forces.
APART = 0.05


class HookWeight(OfWrench):
    """A force along the reported one, alike in all loaded rows."""

    name = "hook_weight"
    family = "load path"
    formula_source = "engineering judgement: a weight that hangs wherever a load does"
    parameters = (Parameter("force_n", "N", 10.0, -200.0, 200.0,
                            source="engineering judgement: a hook, a shackle and a sling of 1 kg",
                            bounds_source="engineering judgement: a carrier of 20 kg, counted twice or not at all"),)
    sentence = ("every load was larger or smaller than reported by the same: a hook or a carrier that was not counted, or a "
                "load cell that reads nothing of small loads")
    settles = "weigh what hangs with the empty hook, or hang the hook alone and read"

    def missing(self, rows: LoadState) -> str:
        size = np.linalg.norm(rows.wrench[:, :3], axis=1)
        loaded = size[size > 0]
        return "" if len(loaded) and np.ptp(loaded) > APART * loaded.max() else ONE_SIZE

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        size = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True)
        along = np.divide(rows.wrench[:, :3], size, out=np.zeros((len(size), 3)), where=size > 0)
        return np.concatenate([rows.wrench[:, :3] + values[0] * along, rows.wrench[:, 3:]], axis=1)
