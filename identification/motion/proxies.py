"""A cause, or what the torque would be without its noise?

Angle, acceleration and the torques of other joints know the motion, and the torque follows the motion. Where the torque is
noisy and the encoders are fine, they say together what the torque is without its noise, and mend the fit in place of the
spring. So the joint is also looked at from the other side: the torque by the twist, which knows the torque without its noise,
too. What is a cause betters that as well; what stands for the torque does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.joint_friction import JointFriction
from identification.model.effects.motor_inertia import MotorInertia
from identification.model.effects.transmission_error import TransmissionError
from identification.motion.axis import Axis, solve, straight_line
from identification.motion.dictionary import LINK_DELAY, Shape
from identification.motion.smooth import Smooth
from identification.motion.transmission import evidence_beside

Array = NDArray[np.float64]
# What may stand for the torque, and what beside it has no torque in it.
PROXIES = (MotorInertia.name, TransmissionError.name)
OF_THE_MOTION = (*PROXIES, JointFriction.name, LINK_DELAY)


def without_proxies(axis: Axis) -> Axis:
    """The axis without those causes that mend nothing but the torque's noise. Beside a smooth error over the angle that was
    found again all are kept."""
    if axis.smooth is not None:
        return axis
    doubtful = [group[0] for group in axis.dictionary if group[0].name in PROXIES]
    back = turned(axis, doubtful)
    dropped = [shape for shape in doubtful if evidence(back, shape, back.plain) <= 0]
    return replace(axis, dictionary=[group for group in axis.dictionary if group[0] not in dropped]) if dropped else axis


def stands_for_torque(axis: Axis, smooth: Smooth) -> bool:
    """Whether a smooth error over the angle betters nothing from the other side."""
    as_torque = replace(smooth, size=smooth.size / float(straight_line(axis)[-1]))
    back = replace(turned(axis, []), smooth=as_torque)
    return bool(evidence_beside(back, as_torque, back.spring, np.array([as_torque.size]))[0] <= 0)


def turned(axis: Axis, tried: list[Shape]) -> Axis:
    """The joint from the other side: its torque by its deflection, and by the shapes that are tried."""
    return replace(axis, deflection=axis.torque, torque=axis.deflection, dictionary=[[shape] for shape in tried], smooth=None)


def evidence(axis: Axis, shape: Shape, base: Array) -> float:
    """ln of the evidence (BIC) for a shape beside columns (n, p)."""
    without, beside = solve(axis, base), solve(axis, np.column_stack([base, shape.columns]))
    gain = 0.5 * beside.count * float(np.log(without.chi2 / beside.chi2))
    return float(gain - 0.5 * shape.columns.shape[1] * np.log(beside.count))
