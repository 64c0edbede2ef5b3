"""What the dictionary of causes adds to a joint's deflection in a log: columns, linear in their coefficients.

An effect says by `log_contribution` what it adds. Its columns are differences of that; where the effect acts through the
joint's spring (friction, inertia, the delay of the torque) the coefficient is the parameter times the compliance.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from identification.model.effects import Effect, effects
from identification.model.effects.channel_delay import ChannelDelay
from identification.model.effects.encoder_slip import EncoderSlip
from identification.model.effects.lost_samples import LostSamples
from identification.model.effects.torque_crosstalk import TorqueCrosstalk
from identification.model.effects.transmission_error import OnceATurn, TransmissionError
from identification.model.joint_log import JointLog
from identification.motion.band import low_pass

Array = NDArray[np.float64]
# A shape is offered where it is this far from a straight line through the torque (share of its own size), else c holds it.
STRAIGHT = 0.02
# The logged torque is the gear's but for noise and friction of this size [N m], so free play is crossed early or late; on small
# joints it is no larger than such a share of the largest torque.
SMEARED, SMEARED_SHARE = (0.0, 30.0, 100.0), (0.0, 0.015, 0.06)
# A soft zone ends at one torque, or over a range of it: so wide, as a share of that torque.
ROUNDED = (0.0, 0.6)
# Quantiles of the standard normal distribution, equally likely.
NORMAL = tuple(NormalDist().inv_cdf((k + 0.5) / 15) for k in range(15))
# Names of the delays of two channels, as `label` gives them.
LINK_DELAY, TORQUE_DELAY = "channel_delay (link)", "channel_delay (torque)"
# What is in any motion beside the spring.
ALWAYS = (LINK_DELAY, "joint_friction", "motor_inertia")
# Multiples of an effect's grid of torques, for gears whose torques are larger or smaller than the grid was made for, and from
# which share of a log's largest torque on smaller ones are tried.
WIDER, NARROWER, LEAST = (1.0, 4.0, 16.0), (1 / 64, 1 / 16, 1 / 4), 0.01
# Friction inside a gear takes energy from the motion: the twist lags behind the torque, it never runs ahead.
LAGS = ("hysteresis",)
# Effects that are searched for by themselves, or offered by a rule of their own.
BY_THEMSELVES = (ChannelDelay.name, TransmissionError.name, EncoderSlip.name, LostSamples.name, TorqueCrosstalk.name)
# Laws of which a log can tell one at most: two of a gear's compliance only mend each other's, and a torque that was recorded
# early looks like a gear that is damped.
EXCLUSIVE = ({"backlash", "soft_zone"}, {"gear_damping", TORQUE_DELAY})


@dataclass(frozen=True, eq=False)
class Shape:
    """One effect with the values that are not linear fixed. columns: of the full-rate log (n, p), one a free parameter;
    free: which those are; through_spring: whether the coefficient is the parameter times the compliance; signs (p,): 1 or -1
    where the coefficient's is known, else 0; smear: standard deviation [N m] of the torque it is averaged over."""

    effect: Effect
    fixed: Array
    free: tuple[int, ...]
    columns: Array
    through_spring: bool
    signs: tuple[int, ...]
    smear: float = 0.0

    @property
    def name(self) -> str:
        """The effect, and which channel it is about."""
        return label(self.effect)

    def values(self, coefficients: Array, compliance: float) -> Array:
        """Parameter values (P,) of coefficients (p,)."""
        values = self.fixed.copy()
        values[list(self.free)] = coefficients / compliance if self.through_spring else coefficients
        return values

    def on(self, logs: list[JointLog], rates: list[float], band: float) -> Array:
        """Its columns (n, p) on other logs, or at another band."""
        return _columns(self.effect, self.fixed, self.free, self.smear, logs, rates, band)


def catalogue(only: tuple[str, ...] = (), *, over_angle: bool = False) -> list[Effect]:
    """The effects that show in logs; the delay once for each channel. over_angle: where no transmission error was found again,
    one once a turn stands for it beside the others, so that none of them is named for it."""
    shown = [effect for effect in effects().values() if type(effect).log_contribution is not Effect.log_contribution
             and effect.name not in BY_THEMSELVES]
    offered = [ChannelDelay("link"), ChannelDelay("torque"), *shown, *([OnceATurn()] if over_angle else [])]
    return [effect for effect in offered if not only or label(effect) in only]


def label(effect: Effect) -> str:
    """The effect, and which channel or other joint it is about: channel_delay (link)."""
    about = [str(effect.where[key]) for key in ("channel", "torque_of") if key in effect.where]
    return f"{effect.name} ({about[0]})" if about else effect.name


def shapes(logs: list[JointLog], rates: list[float], band: float, offered: list[Effect]) -> list[list[Shape]]:
    """The shapes of each effect, most effects have one; columns are the records' below one another, low-passed."""
    reach = max(float(np.abs(log.torque).max()) for log in logs)
    torque = np.concatenate([low_pass(log.torque[:, None], rate, band)[:, 0] for log, rate in zip(logs, rates, strict=True)])
    line = np.column_stack([np.ones_like(torque), torque])
    groups = []
    for effect in offered:
        group = [shape for fixed in _grid(effect, reach)
                 for shape in _of_fixed(effect, fixed, logs, rates, band, _smears(effect, fixed, reach), line)]
        if group:
            groups.append(group)
    return groups


def _grid(effect: Effect, reach: float) -> list[Array]:
    """Values of what is not linear, NaN for what is; reach: the largest torque [N m]."""
    axes: list[list[float]] = []
    for parameter in effect.parameters:
        if not parameter.grid:
            axes.append([np.nan])
            continue
        small = {value * factor for value in parameter.grid for factor in NARROWER}
        wide = sorted({value * factor for value in parameter.grid for factor in WIDER}
                      | {value for value in small if value >= max(LEAST * reach, parameter.low)})
        axes.append([value for value in wide if value <= min(parameter.high, 0.5 * reach)] or [wide[0]])
    return [np.array(choice) for choice in itertools.product(*axes)]


def _smears(effect: Effect, fixed: Array, reach: float) -> tuple[float, ...]:
    """Standard deviations [N m] of the torque that an effect is tried with."""
    if effect.name == "backlash":
        return tuple(min(size, share * reach) for size, share in zip(SMEARED, SMEARED_SHARE, strict=True))
    return tuple(share * float(np.nanmax(fixed)) for share in ROUNDED) if effect.name == "soft_zone" else (0.0,)


def _of_fixed(
    effect: Effect, fixed: Array, logs: list[JointLog], rates: list[float], band: float, smears: tuple[float, ...], line: Array
) -> Iterator[Shape]:
    """The shapes that are more than a straight line (n, 2) over the torque, one for each smear at most."""
    free = tuple(int(k) for k in np.flatnonzero(np.isnan(fixed)))
    start = np.nan_to_num(fixed)
    through = None
    for smear in smears:
        columns = _columns(effect, start, free, smear, logs, rates, band)
        size, left = np.std(columns, axis=0), np.std(columns - line @ np.linalg.lstsq(line, columns, rcond=None)[0], axis=0)
        kept = np.flatnonzero((size > 0) & (left > STRAIGHT * size)).tolist()
        if not kept:
            continue
        if through is None:
            once = _column(effect, start, free[0], logs, rates, band) if smear else columns[:, 0]
            through = _goes_through_spring(effect, start, free[0], logs, rates, band, once)
        yield Shape(effect, start, tuple(free[j] for j in kept), columns[:, kept], through,
                    tuple(_sign(effect, free[j]) for j in kept), smear)


def _goes_through_spring(
    effect: Effect, start: Array, which: int, logs: list[JointLog], rates: list[float], band: float, once: Array
) -> bool:
    """Whether a column, once (n,), is twice as large where the spring gives twice as much."""
    softer = [replace(log, compliance=2.0) for log in logs]
    twice = _column(effect, start, which, softer, rates, band)
    return bool(np.allclose(twice, 2 * once, rtol=1e-6, atol=1e-12 * float(np.abs(once).max() + 1e-300)) and np.any(once != 0))


def _sign(effect: Effect, which: int) -> int:
    """1 or -1 where the sign of a parameter is known, else 0."""
    parameter = effect.parameters[which]
    return 1 if parameter.low >= 0 else -1 if parameter.high <= 0 or effect.name in LAGS else 0


def _columns(effect: Effect, fixed: Array, free: tuple[int, ...], smear: float, logs: list[JointLog], rates: list[float],
             band: float) -> Array:
    """Contribution for one unit of each free parameter (n, p), averaged over torques that are off by `smear` [N m]."""
    turns = NORMAL if smear else (0.0,)
    return np.column_stack([_column(effect, fixed, k, logs, rates, band, tuple(smear * turn for turn in turns)) for k in free])


def _column(effect: Effect, fixed: Array, which: int, logs: list[JointLog], rates: list[float], band: float,
            off: tuple[float, ...] = (0.0,)) -> Array:
    """Contribution for one unit of a linear parameter (n,), the mean over torques that are off by so much [N m], low-passed,
    records below one another."""
    parts = []
    for log, rate in zip(logs, rates, strict=True):
        slopes = [_slope(effect, fixed, which, replace(log, torque=log.torque + each) if each else log) for each in off]
        parts.append(low_pass(np.mean(slopes, axis=0)[:, None], rate, band)[:, 0])
    return np.concatenate(parts)


def _slope(effect: Effect, fixed: Array, which: int, log: JointLog) -> Array:
    """Contribution for one unit of a linear parameter (n,), at full rate."""
    parameter = effect.parameters[which]
    step = np.zeros(len(fixed))
    step[which] = parameter.typical
    ahead = effect.log_contribution(log, fixed + step)
    assert ahead is not None
    if parameter.positive:
        return np.asarray(ahead / parameter.typical)
    behind = effect.log_contribution(log, fixed - step)
    assert behind is not None
    return np.asarray((ahead - behind) / (2 * parameter.typical))
