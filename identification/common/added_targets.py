"""The targets that `correct` added, as offsets.csv tells of them in its columns `added`, `added_mm`, `added_left_um`.

They have, in the row of a target as given, the shares of the move to it at which others were added before it, the offsets of
these, three numbers each, and 1 sigma of what is expected to be left there. The written program counts them too: behind the
first of them a number names another target than in the planned program.
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
ADDED, ADDED_MM, ADDED_LEFT = "added", "added_mm", "added_left_um"


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


def added_numbers(kept: Indices, values: Array, decimals: int) -> NDArray[np.object_]:
    """A column for targets as given at the places kept (N,) of a program: the values (W, k) of those that were added before
    each, to so many decimals, one target's after another's."""
    text = np.full(len(kept), "", dtype=object)
    for target in np.flatnonzero(np.diff(kept, prepend=-1) > 1):
        before = kept[target - 1] if target else -1
        text[target] = " ".join(f"{value:.{decimals}f}" for value in (values[before + 1:kept[target]] + 0.0).ravel())
    return text


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


def added_offsets(table: Table) -> Array | None:
    """The offsets (A, 3) [mm] of the added targets of a table that was read with both text columns, in the order of `added_of`;
    None: it does not tell. Raises CompstiffError (CS4121) where they are not three numbers for each share."""
    text = table.texts.get(ADDED_MM)
    if text is None or not any(text):
        return None
    offsets: list[float] = []
    of_shares = table.texts.get(ADDED, np.full(len(text), ""))
    for row, (words, shares) in enumerate(zip(text, of_shares, strict=True)):
        try:
            here = [float(word) for word in str(words).split()]
        except ValueError:
            here = [np.nan]
        if len(here) != 3 * len(str(shares).split()) or not np.isfinite(here).all():
            raise error("CS4121", f"column '{ADDED_MM}': found {words!r}, expected three finite numbers for each share in "
                        f"'{ADDED}'", file=table.source, line=int(table.line[row]),
                        hint="use the file as correct --offsets wrote it")
        offsets += here
    return np.array(offsets).reshape(-1, 3)
