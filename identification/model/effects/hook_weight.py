"""Every load is larger than reported by the same: a hook that nobody weighed; or those with one disc, or of one size, are."""

from __future__ import annotations

from functools import partial

import numpy as np

from identification.common.arrays import Array
from identification.model.effects.base import Parameter, Signature
from identification.model.effects.kinds import ONE_SIZE, OfWrench, as_it_is, nothing_hangs
from identification.model.load_state import LoadState

# Loads of fewer sizes than two, this share apart, tell it not from a gain of all forces.
APART = 0.05
# Loads that differ by no more than this share are of one size; one of fewer sizes that is off is a gain and a hook's weight.
ALIKE = 0.02
FEWEST_SIZES, MOST_SIZES = 3, 12
FEW_SIZES = "loads are not of three sizes and a few more, each at two poses"


class Disc(OfWrench):
    """A force along the reported one, alike in all rows whose load is as large as one of those that were hung, or larger."""

    name = "hook_weight"
    law = "disc"
    family = "load path"
    formula_source = "engineering judgement: discs are hung one on the other, so that all loads from one of them on have it"
    parameters = (
        Parameter("force_n", "N", 10.0, -500.0, 500.0,
                  source="engineering judgement: a disc that weighs a kilogram more than is stamped on it",
                  bounds_source="engineering judgement: a disc of 50 kg that was not hung, or hung twice"),
        Parameter("from_n", "N", 300.0, 0.0, 1e5, shape=True, source="engineering judgement: any of the loads",
                  bounds_source="engineering judgement: any load that hangs"),
    )
    sentence = ("the loads from one of the discs on were larger or smaller than reported by the same: it weighs otherwise than "
                "is stamped on it, or another one was hung")
    settles = "weigh each disc"

    def missing(self, rows: LoadState) -> str:
        return nothing_hangs(rows) or ("" if len(_first_of_each_size(rows)) else ONE_SIZE)

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        from_there = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True) >= values[1]
        return np.where(from_there, _longer_by(rows, values[0]), rows.wrench)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        scale = self.typical(rows, joint)[:1]
        return [Signature(self._slope(rows, joint, np.array([0.0, size]), 0)[:, :, None], scale, False,
                          partial(np.append, values=size), self) for size in _first_of_each_size(rows)]


class OfOneSize(OfWrench):
    """A force along the reported one in the rows with loads of one size: of one weight of a set, or of one mark of a scale."""

    name = "hook_weight"
    law = "one_size"
    family = "load path"
    formula_source = "engineering judgement: each size is hung, or set, by a weight or a mark of its own"
    parameters = (Parameter("force_n", "N", 10.0, -500.0, 500.0,
                            source="engineering judgement: a weight of one kilogram more than is stamped on it",
                            bounds_source="engineering judgement: a weight of 50 kg less, or twice"),)
    sentence = ("the loads of one size were larger or smaller than reported, those of other sizes not: that weight is not what "
                "is stamped on it, or that mark of the scale is read wrongly")
    settles = "weigh what makes the loads of that size"

    def __init__(self, size: float = 0.0) -> None:
        """size: of the loads that are off [N]."""
        self.size = size

    @property
    def where(self) -> dict[str, int | str | float]:
        return {"size_n": self.size}

    def missing(self, rows: LoadState) -> str:
        return "" if _sizes(rows) else FEW_SIZES

    def true_wrench(self, rows: LoadState, joint: int | None, values: Array) -> Array:
        size = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True)
        return np.where(np.abs(size - self.size) <= ALIKE * self.size, _longer_by(rows, values[0]), rows.wrench)

    def signatures(self, rows: LoadState, joint: int | None) -> list[Signature]:
        of_sizes = map(OfOneSize, _sizes(rows))
        return [Signature(one._slope(rows, joint, np.zeros(1), 0)[:, :, None], self.typical(rows, joint), False, as_it_is, one)
                for one in of_sizes]


class HookWeight(OfWrench):
    """A force along the reported one, alike in all loaded rows."""

    name = "hook_weight"
    other_laws = (Disc(), OfOneSize())
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
        return _longer_by(rows, values[0])


def _longer_by(rows: LoadState, force: float) -> Array:
    """The reported wrenches (n, 6), the force of the loaded ones longer by so much [N]."""
    size = np.linalg.norm(rows.wrench[:, :3], axis=1, keepdims=True)
    along = np.divide(rows.wrench[:, :3], size, out=np.zeros((len(size), 3)), where=size > 0)
    return np.concatenate([rows.wrench[:, :3] + force * along, rows.wrench[:, 3:]], axis=1)


def _first_of_each_size(rows: LoadState) -> list[float]:
    """A force [N] between the loads of each size and those of the next smaller, but for the smallest: sizes are APART of the
    largest from each other."""
    size = np.sort(np.linalg.norm(rows.wrench[:, :3], axis=1))
    step = np.flatnonzero((np.diff(size) > APART * size[-1]) & (size[:-1] > APART * size[-1]))
    return list((size[step] + size[step + 1]) / 2)


def _sizes(rows: LoadState) -> list[float]:
    """The sizes [N] of the loads where there are a few of them, each at two poses or more; none where not."""
    size = np.linalg.norm(rows.wrench[:, :3], axis=1)
    loaded = np.flatnonzero(size > 0)
    loaded = loaded[np.argsort(size[loaded])]
    alike = np.split(loaded, np.flatnonzero(np.diff(size[loaded]) > ALIKE * size[loaded[1:]]) + 1)
    alike = [each for each in alike if len(each) and np.ptp(size[each]) <= ALIKE * size[each].mean()]
    if sum(map(len, alike)) < len(loaded) or not FEWEST_SIZES <= len(alike) <= MOST_SIZES:
        return []
    return [float(size[each].mean()) for each in alike if len(np.unique(rows.visit[each])) > 1]
