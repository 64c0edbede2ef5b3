"""The measured numbers as rows of a linear model: neighbours averaged, and what each parameter of the model does to them.

Means of neighbours along the path are linear in the parameters, as the numbers themselves are: nothing is assumed but that the
smooth remainder does not change within a place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from compensator.correction.pass_offsets import PassOffsets
from compensator.correction.predict import Predicted
from compensator.learning.measured_points import MeasuredPoints
from compensator.learning.path_places import PathPlaces
from compensator.path.robot_path import RobotPath
from identification.common.arrays import Array
from identification.common.findings import Finding

Indices = NDArray[np.intp]
# Places that the work is done with; its cost grows with the third power.
MOST_PLACES = 140
# No mean reaches over a gap of this [m].
GAP = 10e-3


@dataclass(frozen=True, eq=False)
class Rows:
    """n numbers at P places. value, sigma (n,) [m]: measured, less the offsets that the pass had; direction (n, 3), base frame,
    means of unit vectors; place (n,). position (P, 3) [m] and posture (P, 6) [rad] as planned, length (P,) [m] along the path,
    time (P,) [s]. steep (n,) [m/m]: how fast the predicted deviation changes there along the path, seen along the direction.
    of_targets (n, 3 M) sparse: means of a displacement (M, 3) of the targets with force, along the directions. along_normals:
    these are the surface's. resting (P, 3) [m]: the places in the resting frame, to_base (P, 3, 3) its directions in the base
    frame; None where that is the base."""

    value: Array
    sigma: Array
    direction: Array
    place: Indices
    position: Array
    posture: Array
    length: Array
    time: Array
    steep: Array
    of_targets: sparse.csr_array
    findings: tuple[Finding, ...] = ()
    along_normals: bool = False
    resting: Array | None = None
    to_base: Array | None = None

    @property
    def on_part(self) -> Array:
        """The places (P, 3) [m] over the part, which stands still: in the resting frame."""
        return self.position if self.resting is None else self.resting

    def __len__(self) -> int:
        return len(self.value)

    def seen(self, displacement: Array) -> Array:
        """What the rows see (n, ...) of displacements (M, 3, ...) at the targets with force."""
        return np.asarray(self.of_targets @ displacement.reshape(3 * len(displacement), -1))

    def spread(self, basis: Array) -> Array:
        """Slopes (n, 3 m) by the remainder's weights, of its basis (P, m) at the places."""
        return np.asarray((basis[self.place][:, :, None] * self.direction[:, None, :]).reshape(len(self), -1))

    def along(self, columns: Array) -> Array:
        """What the rows see (n, k) of displacements (P, 3, k) at the places."""
        return np.asarray(np.einsum("nc,nck->nk", self.direction, columns[self.place]))

    def select(self, chosen: NDArray[np.bool_]) -> Rows:
        """These rows (n,) alone, places as they are."""
        return Rows(self.value[chosen], self.sigma[chosen], self.direction[chosen], self.place[chosen], self.position,
                    self.posture, self.length, self.time, self.steep[chosen], self.of_targets[np.flatnonzero(chosen)],
                    along_normals=self.along_normals, resting=self.resting, to_base=self.to_base)


def rows_of(
    points: MeasuredPoints, placed: PathPlaces, predicted: Predicted, offsets: PassOffsets | None = None,
    most: int = MOST_PLACES,
) -> Rows:
    """The numbers of the points that have a place, in the base frame, less the offsets that the pass had, None: none; means of
    neighbours where there are over `most` points."""
    path, targets = predicted.path, predicted.targets
    count, size = len(placed.rows), len(targets)
    group = _groups(placed.length, most)
    # A number belongs to a point, a point to its order along the path, and that to a group.
    order = np.full(len(points), -1)
    order[placed.rows] = np.arange(count)
    used = np.flatnonzero(order[points.point] >= 0)
    at = order[points.point[used]]
    near = np.where(placed.share > 0.5, placed.after, placed.before)
    turn = path.base_from_object.rotation[targets[near[at]]]
    direction = np.einsum("nij,nj->ni", turn, points.direction[used])
    # Numbers are averaged with those along nearly the same direction: opposite walls would cancel.
    main = np.argmax(np.abs(points.direction[used]), axis=1)
    kind = main + 3 * (points.direction[used, main] < 0)
    keys, row = np.unique(np.column_stack([group[at], kind]), axis=0, return_inverse=True)
    row, number = row.ravel(), len(keys)
    weight = 1.0 / np.bincount(row, minlength=number)
    mean = sparse.csr_array((weight[row], (row, np.arange(len(used)))), shape=(number, len(used)))
    share = placed.share[at]
    entries, columns, which = [], [], []
    for where, part in ((placed.before[at], 1 - share), (placed.after[at], share)):
        for axis in range(3):
            entries.append(part * direction[:, axis])
            columns.append(3 * where + axis)
            which.append(np.arange(len(used)))
    of_targets = sparse.csr_array((np.concatenate(entries), (np.concatenate(which), np.concatenate(columns))),
                                  shape=(len(used), 3 * size))
    before, after, way = targets[placed.before], targets[placed.after], placed.share[:, None]
    inside = 1.0 / np.bincount(group)

    def middle(values: Array) -> Array:
        flat = values.reshape(count, -1)
        return np.column_stack([np.bincount(group, column) for column in flat.T]) * inside[:, None]

    position = middle((1 - way) * path.base_from_tcp.position[before] + way * path.base_from_tcp.position[after])
    posture = middle((1 - way) * path.theta[before] + way * path.theta[after])
    findings = [] if len(position) == count else [Finding(
        "CS5308", "note", f"{count} points are averaged to {len(position)} places along the path", file=points.source)]
    value = points.value[used]
    if offsets is not None:
        # As the deviation: of the way of each target, straight between them.
        value = value - of_targets @ offsets.over(path)[targets].ravel()
    sigma = np.sqrt(np.bincount(row, points.sigma[used] ** 2, minlength=number)) * weight
    return Rows(np.asarray(mean @ value), sigma, np.asarray(mean @ direction), keys[:, 0].astype(np.intp),
                position, posture, middle(placed.length)[:, 0], middle(placed.time)[:, 0],
                steep_at(mean @ of_targets, slope_along(predicted, predicted.prediction.position)),
                sparse.csr_array(mean @ of_targets),
                tuple(findings), points.along_normals, *_resting(path, middle, before, after, way))


def _resting(
    path: RobotPath, middle: Callable[[Array], Array], before: Indices, after: Indices, way: Array
) -> tuple[Array | None, Array | None]:
    """`resting` and `to_base` of rows whose places are means, `middle`, of those between the targets before and after."""
    turned = path.axes.base_from_rest
    if turned is None:
        return None, None
    place, ahead = path.rest_from_tcp.position, turned.rotation.reshape(-1, 9)
    resting = middle((1 - way) * place[before] + way * place[after])
    u, _, vt = np.linalg.svd(middle((1 - way) * ahead[before] + way * ahead[after]).reshape(-1, 3, 3))
    return resting, np.asarray(u @ vt)


def slope_along(predicted: Predicted, moved: Array) -> Array:
    """How fast a displacement (M, 3) [m] of the targets with force changes along the path [m/m]: (2, M, 3), before and behind
    each target."""
    length = predicted.path.length[predicted.targets]
    slope = np.diff(moved, axis=0) / np.maximum(np.diff(length), 1e-4)[:, None]
    nothing = np.zeros((1, 3))
    return np.stack([np.concatenate(sides)[:len(length)] for sides in ((nothing, slope), (slope, nothing))])


def steep_at(of_targets: sparse.csr_array, slopes: Array) -> Array:
    """What rows (n, 3 M) see of slopes (2, M, 3) along their own directions, on the steeper side of each target (n,)."""
    sides = []
    for slope in slopes:
        seen = sparse.csr_array(
            (of_targets.data * slope.ravel()[of_targets.indices], of_targets.indices // 3, of_targets.indptr),
            shape=(of_targets.shape[0], len(slope)), copy=True)
        seen.sum_duplicates()       # in place
        sides.append(abs(seen))
    return np.asarray(sides[0].maximum(sides[1]) @ np.ones(slopes.shape[1]))


def _groups(length: Array, most: int) -> Indices:
    """The group (K,) of each point, ascending path lengths (K,) [m]: each its own, or neighbours of equal number."""
    count = len(length)
    if count <= most:
        return np.arange(count)
    group = np.arange(count) * most // count
    breaks = np.concatenate([[True], (np.diff(group) > 0) | (np.diff(length) > GAP)])
    return np.cumsum(breaks) - 1
