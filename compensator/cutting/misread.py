"""A log that was read in another frame, sign or order of its columns than it was written in: what the stock lets expect tells.

Against the travel alone many wrong readings push as some cutter may; the stock says which force is where. Each reading is a
turn of the force at every place: 48 orders and signs of the three columns, in each frame that a log may be in. One is named
where it leaves far less than the stated one, and less than any other that is not next to the same forces; of those that are
next to the same the plainest.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from compensator.cutting.coefficients import Coefficients
from compensator.cutting.disagreement import root_of
from compensator.cutting.posterior import LEAST, ZERO, ForceRows
from identification.common.arrays import Array

# A reading is told where the log is off by at most so much of what it is off as stated, and known errors leave at most so much
# of the force (engineering judgement; the tool stood where the wrong forces did not push it, which leaves some of a force); and
# where it is likelier than the stated one and any that is another by over this share of the force: 20 to 1, of rows of which
# ten neighbours count as one. What is off by more than so many sigmas counts as these.
LEFT, OF_FORCE, ANOTHER, SURE, GROSS = 0.5, 0.35, 0.2, 2 * 10 * float(np.log(20.0)), 6.0
# So many rows tell it.
MOST_ROWS = 400
COLUMNS = ("fx_n", "fy_n", "fz_n")
# Frame, order and signs of the columns.
_Read = tuple[str, tuple[int, ...], tuple[int, ...]]


class Reading(NamedTuple):
    """frame: of force_log; order, signs: of the logged columns, as they stand for x, y, z; off, stated [N]: RMS of the
    log less what is expected, by it and as stated."""

    frame: str
    order: tuple[int, ...]
    signs: tuple[int, ...]
    off: float
    stated: float

    def words(self, frame: str) -> str:
        """For people; frame: the stated one."""
        parts = [f"in the frame {self.frame}"] if self.frame != frame else []
        if self.order != (0, 1, 2):
            parts.append(f"with the columns {' '.join(COLUMNS[k] for k in self.order)} in this order")
        turned = [axis for axis, sign in zip("xyz", self.signs, strict=True) if sign < 0]
        if len(turned) == len(COLUMNS):
            parts.append("with the other sign")
        elif turned:
            parts.append(f"with {' and '.join(turned)} turned over")
        return (f"read {', '.join(parts)} the log would be off what the stock lets expect by {self.off:.1f} N RMS, as it is "
                f"read by {self.stated:.1f} N")


def misread(
    rows: ForceRows, axes: Mapping[str, Array], stated: str, coefficients: Coefficients, position_std: float, step: float
) -> Reading | None:
    """The reading that the rows tell, None where they tell none. axes: the rotation base-from-log (n, 3, 3) of each frame that
    the log may be in; stated: that in which rows.force was read. The others as of `disagreement`."""
    some = np.unique(np.linspace(0, len(rows.force) - 1, MOST_ROWS).round().astype(int))
    weight, force = rows.weight[some], rows.force[some]
    expected = weight @ coefficients.mean
    of_model = coefficients.model_error * np.linalg.norm(expected, axis=1)
    scale = np.sqrt(rows.error[some] ** 2 + LEAST**2 + of_model[:, None] ** 2 / 3)
    known = [weight @ root_of(coefficients.covariance),
             np.broadcast_to(ZERO * np.eye(3), (len(some), 3, 3)), rows.aside[some] * (position_std / step)]
    design = np.concatenate(known, axis=2)
    flat = (design / scale[:, :, None]).reshape(-1, design.shape[2])
    solve = np.linalg.solve(flat.T @ flat + np.eye(design.shape[2]), flat.T)
    turned = {name: turn[some] for name, turn in axes.items()}
    tried = {}
    for reading in _readings(list(axes)):
        off = _read(force, turned, stated, reading) - expected
        x = solve @ (off / scale).reshape(-1)
        left = off - design @ x
        tried[reading] = _Tried(float(np.minimum((left / scale) ** 2, GROSS**2).sum() + x @ x), _rms(off), _rms(left))
    here = tried[stated, (0, 1, 2), (1, 1, 1)]
    order = sorted(tried, key=lambda reading: tried[reading].misfit)
    best, size = tried[order[0]], _rms(force)
    if best.off > LEFT * here.off or best.left > OF_FORCE * size or here.misfit - best.misfit < SURE:
        return None
    as_best = _read(force, turned, stated, order[0])
    alike = [reading for reading in order if tried[reading].misfit - best.misfit <= SURE]
    if any(_rms(_read(force, turned, stated, reading) - as_best) > ANOTHER * size for reading in alike):
        return None
    told = min(alike, key=lambda reading: _changes(reading, stated))
    return Reading(*told, tried[told].off, here.off)


class _Tried(NamedTuple):
    """misfit: twice the logarithm of how unlikely it is; off, left [N]: RMS of the log less what is expected, and less what
    known errors explain of that."""

    misfit: float
    off: float
    left: float


def _rms(force: Array) -> float:
    """Of the sizes (n, 3)."""
    return float(np.sqrt(np.mean(np.sum(force**2, axis=1))))


def _readings(frames: list[str]) -> Iterator[_Read]:
    yield from product(frames, permutations(range(3)), product((1, -1), repeat=3))


def _changes(reading: _Read, stated: str) -> int:
    """In how many ways a reading differs from the frame `stated`, as it is: one sign for all is fewer than some turned over."""
    frame, order, signs = reading
    return (frame != stated) + (order != (0, 1, 2)) + {3: 0, -3: 1}.get(sum(signs), 2)


def _read(force: Array, axes: Mapping[str, Array], stated: str, reading: _Read) -> Array:
    """The force (n, 3), base frame, of another reading than that in the frame `stated`."""
    frame, order, signs = reading
    logged = np.einsum("nji,nj->ni", axes[stated], force)
    return np.asarray(np.einsum("nij,nj->ni", axes[frame], logged[:, order] * signs))
