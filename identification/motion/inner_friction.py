"""Friction inside a gear, or noise of the torque channel?

A gear with friction inside does not follow small changes of its torque. Neither does it follow those that only the torque's
noise makes: a slip state that is worked out from a noisy torque holds this noise, and takes it off. So the gear is also looked
at from the other side: the torque by the twist, which the torque's noise is not in, and a slip state of the twist. What is
friction inside shows from both sides; from this one noise of the encoders has the other sign.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.model.effects.hysteresis import Hysteresis, slip_state
from identification.motion.axis import Axis, solve
from identification.motion.dictionary import LINK_DELAY, Shape

Array = NDArray[np.float64]
# ln of the evidence (BIC) that the twist must have for friction inside.
SEEN = 3.0
# What is in the recorded deflection and no twist of the gear.
NO_TWIST = (LINK_DELAY, "transmission_error")


def without_torque_noise(axis: Axis) -> Axis:
    """The axis without friction inside the gear among its causes, where the twist does not show it."""
    inside = next((group for group in axis.dictionary if group[0].name == Hysteresis.name), None)
    if inside is None or _seen(axis, inside):
        return axis
    return replace(axis, dictionary=[group for group in axis.dictionary if group is not inside])


def _seen(axis: Axis, inside: list[Shape]) -> bool:
    return _more_than_noise(axis, inside) or _evidence(axis, inside) > SEEN


def _more_than_noise(axis: Axis, inside: list[Shape]) -> bool:
    """Whether small changes of the torque turn the twist back: noise that the gear does not follow leaves it where it is."""
    solved = [solve(axis, np.column_stack([axis.plain, shape.columns])) for shape in inside]
    best = int(np.argmin([one.chi2 for one in solved]))
    compliance, amplitude = solved[best].coefficients[len(axis.lengths)], solved[best].coefficients[-1]
    return bool(-amplitude > compliance * np.nanmax(inside[best].fixed) > 0)


def _evidence(axis: Axis, inside: list[Shape]) -> float:
    """ln of the evidence for a torque that is more than the twist's spring by a slip state of the twist, with its sign."""
    others = [group[0] for group in axis.dictionary if group[0].name in NO_TWIST]
    forward = np.column_stack([axis.plain, *(shape.columns for shape in others)])
    fitted = solve(axis, forward)
    compliance = float(fitted.coefficients[len(axis.lengths)])
    if compliance <= 0:
        return 0.0
    twist = axis.deflection - _no_twist(axis, others, forward, fitted.coefficients)
    damped = np.concatenate([np.gradient(part) for part in axis.parts(twist)])
    turned = replace(axis, deflection=axis.torque, torque=twist, dictionary=[], smooth=None)
    beside = np.column_stack([turned.spring, damped, *(shape.columns for shape in others)])
    without = solve(turned, beside)
    best = 0.0
    for slip in dict.fromkeys(float(np.nanmax(shape.fixed)) for shape in inside):
        states = [slip_state(part / compliance, np.arange(len(part)) == 0, slip) for part in axis.parts(twist)]
        solved = solve(turned, np.column_stack([beside, np.concatenate(states)]))
        if solved.coefficients[-1] > 0:
            gain = 0.5 * solved.count * float(np.log(without.chi2 / solved.chi2))
            best = max(best, gain - 0.5 * float(np.log(solved.count)))
    return best


def _no_twist(axis: Axis, others: list[Shape], beside: Array, coefficients: Array) -> Array:
    """What the fit has in the deflection that is no twist (n,): the records' zeros, the angle's error, the encoders' delay."""
    records = len(axis.lengths)
    ours = [*range(records), *range(axis.spring.shape[1], axis.plain.shape[1])]
    place = axis.plain.shape[1]
    for shape in others:
        width = shape.columns.shape[1]
        ours += [*range(place, place + width)] if shape.name in NO_TWIST else []
        place += width
    return np.asarray(beside[:, ours] @ coefficients[ours])
