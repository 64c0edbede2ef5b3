"""The targets that `correct` added, as offsets.csv tells of them in its column `added`.

It has, in the row of a target as given, the shares of the move to it at which others were added before it, and beside them the
offsets that these have. The written program counts them too: behind the first of them a number names another target than in the
planned program.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import Array
from identification.common.findings import error

if TYPE_CHECKING:
    from identification.common.tables import Table

Indices = NDArray[np.intp]
ADDED = "added"
ADDED_OFFSETS = ("added_ox_mm", "added_oy_mm", "added_oz_mm")


@dataclass(frozen=True, eq=False)
class AddedTargets:
    """Of a written program of W targets: given (W,): the target as given that the move to each belongs to; share (W,): of that
    move which is done there, 1 at the given target itself. source: the file that tells it."""

    source: str
    given: Indices
    share: Array

    @property
    def number(self) -> Indices:
        """What the written program counts each target as given (N,)."""
        return np.flatnonzero(self.share == 1)

    @property
    def first(self) -> int:
        """The first number that means different targets in the two programs."""
        return int(np.argmax(self.share < 1))

    def place(self, length: Array) -> Array:
        """Path lengths (W,) [m] by those of the given targets (N,)."""
        start = length[np.maximum(self.given - 1, 0)]
        return np.asarray(start + self.share * (length[self.given] - start))

    def numbered(self, highest: int) -> bool | None:
        """Whether numbers up to `highest` are those of the written program; None: they may be either's."""
        last = int(self.given[-1])
        if highest < self.first or highest == last:
            return False
        return True if highest > last else None


def added_text(kept: Indices, length: Array) -> NDArray[np.object_]:
    """The column for targets as given at the places kept (N,) of a program with path lengths (W,) [m]."""
    text = np.full(len(kept), "", dtype=object)
    for target in np.flatnonzero(np.diff(kept, prepend=-1) > 1):
        before = kept[target - 1] if target else 0
        way = (length[before + 1:kept[target]] - length[before]) / (length[kept[target]] - length[before])
        text[target] = " ".join(f"{share:.6f}" for share in way)
    return text


def added_offset_texts(kept: Indices, offset: Array) -> dict[str, NDArray[np.object_]]:
    """The columns ADDED_OFFSETS for targets as given at the places kept (N,) of a program whose targets have offsets (W, 3)
    [m], work object."""
    texts = {name: np.full(len(kept), "", dtype=object) for name in ADDED_OFFSETS}
    for target in np.flatnonzero(np.diff(kept, prepend=-1) > 1):
        before = kept[target - 1] if target else 0
        for text, axis in zip(texts.values(), np.round(1e3 * offset[before + 1:kept[target]], 4).T + 0.0, strict=True):
            text[target] = " ".join(f"{one:g}" for one in axis)
    return texts


def added_offsets(table: Table, added: AddedTargets) -> Array | None:
    """The offsets (W, 3) [m], work object, of the targets that were added, NaN at those as given; None: the file has no such
    columns. Raises CompstiffError (CS4121) for others than numbers, as many as were added."""
    if any(name not in table.texts for name in ADDED_OFFSETS):
        return None
    offset = np.full((len(added.given), 3), np.nan)
    for axis, name in enumerate(ADDED_OFFSETS):
        for row in np.unique(added.given[added.share < 1]):
            here = np.flatnonzero((added.given == row) & (added.share < 1))
            words = str(table.texts[name][row])
            try:
                found = np.array([float(word) for word in words.split()])
            except ValueError:
                found = np.array([np.nan])
            if len(found) != len(here) or not np.isfinite(found).all():
                raise error("CS4121", f"column '{name}': found {words!r}, expected {len(here)} numbers, one for each in "
                            f"'{ADDED}'", file=table.source, line=int(table.line[row]),
                            hint="use the file as correct --offsets wrote it")
            offset[here, axis] = 1e-3 * found
    return offset


def read_added(file: Path) -> AddedTargets | None:
    """None where the file has no such column, or nothing was added. Raises CompstiffError: CS4121 shares that are none; what
    `read_table` raises."""
    from identification.common.tables import read_table

    return added_of(read_table(file, required=("target",), texts=(ADDED,)))


def added_of(table: Table) -> AddedTargets | None:
    """The same of a table that was read with the text column ADDED."""
    text = table.texts.get(ADDED)
    if text is None or not any(text):
        return None
    given, share = [], []
    for row, words in enumerate(text):
        try:
            here = [float(word) for word in str(words).split()]
        except ValueError:
            here = [np.nan]
        if not all(0 < one < 1 for one in here) or any(np.diff(here) <= 0):
            raise error("CS4121", f"column '{ADDED}': found {words!r}, expected shares of a move between 0 and 1, ascending",
                        file=table.source, line=int(table.line[row]), hint="use the file as correct --offsets wrote it")
        given += [row] * (len(here) + 1)
        share += [*here, 1.0]
    return AddedTargets(table.source, np.array(given), np.array(share))
