"""Whether a joint's deflection follows the torque of another joint: a cause that is offered only where the log speaks for it.

The torque of another axis knows the motion without this axis' noise, so that beside all other columns it may mend what noise
made of them. It must better the likeliest set of other causes, too, and that from both sides (proxies.py); and each record must
have it by itself, of a single one each half.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.model.effects import Effect
from identification.model.effects.torque_crosstalk import TorqueCrosstalk
from identification.motion.axis import Axis, solve
from identification.motion.dictionary import Shape, shapes
from identification.motion.proxies import OF_THE_MOTION, evidence, turned
from identification.motion.search import survey

Array = NDArray[np.float64]
# ln of the evidence (BIC) from which on it is a cause among the others.
SEEN = 3.0
# Standard deviations from which on a part of the log has it by itself, and up to which two parts have the same.
AGAIN, APART = 4.0, 3.0


def with_crosstalk(axis: Axis) -> Axis:
    """The axis with the torques of the other joints among its causes, as far as the log speaks for them."""
    return replace(axis, dictionary=[*axis.dictionary, *([shape] for shape in crosstalk(axis))])


def crosstalk(axis: Axis) -> list[Shape]:
    """The torques of the other joints that the log speaks for."""
    others = set.intersection(*(set(log.others) for log in axis.logs))
    offered: list[Effect] = [TorqueCrosstalk(other) for other in sorted(others)]
    tried = [group[0] for group in shapes(axis.logs, axis.rates, axis.band, offered)]
    tried = [shape for shape in tried if evidence(axis, shape, axis.widest) > SEEN]
    if not tried:
        return []
    best = survey(axis)[0]
    back = turned(axis, tried)
    beside = np.column_stack([back.plain, *(shape.columns for shape in best.shapes if shape.name in OF_THE_MOTION)])
    return [shape for shape in tried if evidence(axis, shape, best.columns(axis)) > SEEN and evidence(back, shape, beside) > 0
            and _found_again(axis, best.columns(axis), shape.columns[:, 0])]


def _found_again(axis: Axis, base: Array, column: Array) -> bool:
    """Whether each record, or each half of a single one, has it by itself, of one size."""
    lengths = axis.lengths if len(axis.lengths) > 1 else (len(column) // 2, len(column) - len(column) // 2)
    part = np.repeat(np.arange(len(lengths)), lengths)
    own = np.where(part[:, None] == np.arange(len(lengths)), column[:, None], 0.0)
    solved = solve(axis, np.column_stack([base, own]))
    size, covariance = solved.coefficients[base.shape[1]:], solved.covariance[base.shape[1]:, base.shape[1]:]
    variance = np.diag(covariance)
    apart = np.abs(np.subtract.outer(size, size))
    differs = np.sqrt(np.maximum(np.add.outer(variance, variance) - 2 * covariance, 1e-300))
    return bool(np.all(np.abs(size) > AGAIN * np.sqrt(variance)) and np.all(np.sign(size) == np.sign(size[0]))
                and np.all(apart < APART * differs))
