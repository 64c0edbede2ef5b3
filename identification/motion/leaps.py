"""Leaps: what happens at one moment of a record. An encoder slips, or samples of its channel are lost.

Two looks must agree on the moment. Under the band, beside the whole dictionary, what was there before the moment must be gone
for good; the p-value is that of the largest such step anywhere in noise of the same autoregression. At full rate, where noise
hides what lasts, the moment must be the most abrupt of the record. A law of the gear that comes and goes (free play) is not
gone for good, a slow change is not abrupt.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.common.arrays import rms
from identification.common.findings import Finding
from identification.common.quantities import two_sigma
from identification.model.effects.encoder_slip import EncoderSlip
from identification.model.effects.joint_friction import STANDSTILL
from identification.model.effects.lost_samples import LostSamples
from identification.motion.autoregression import Autoregression
from identification.motion.axis import Axis, axis_of
from identification.motion.band import BAND, low_pass, passed_step
from identification.motion.lines import session
from identification.motion.log_file import MotionLog

Array = NDArray[np.float64]
KINDS = (EncoderSlip(), LostSamples())
# p-value of a leap's search, with so many simulated residuals.
FOUND, BY_CHANCE = 0.01, 199
# Moments that are tried under the band, evenly over the record, beside the most abrupt one; how close both looks must come to
# one another [s].
MOMENTS, WITHIN = 400, 0.3
# A zero leaps while the joint moves one way for so long before and after [s].
MOVING = 0.1
# A joint that leaps more often has a law, and no leaps.
MOST_LEAPS = 3
# Ratio of what is left with and without lost samples.
FAR_LARGER = 2.0
# Rounds in which a leap's size settles.
ROUNDS = 3
# Share of a step's size that nothing else explains: with less it cannot be told.
LEAST_OWN = 1e-3


@dataclass(frozen=True, eq=False)
class Leap:
    """What happened: an effect with its values (shift [rad] or delay [s]; the time `at` [s]) in a record. std: of its size."""

    effect: EncoderSlip | LostSamples
    joint: int
    record: str
    size: float
    std: float
    at: float
    p_value: float

    @property
    def values(self) -> Array:
        """As the effect takes them."""
        return np.array([self.size, self.at])

    @property
    def words(self) -> str:
        """How much, and when."""
        if isinstance(self.effect, EncoderSlip):
            return f"{1e6 * self.size:+.0f} urad (+- {two_sigma(1e6 * self.std):.1g}) at {self.at:.2f} s of {self.record}"
        lost = "missing" if self.size < 0 else "too many"
        return f"{1e3 * abs(self.size):.3g} ms of the link's channel {lost} at {self.at:.2f} s of {self.record}"

    @property
    def finding(self) -> Finding:
        """What a user must know of it."""
        return Finding("CS1617", "warning", f"{self.effect.told(self.joint)} ({self.words}); the record is taken without it",
                       file=self.record, hint=self.effect.settles)

    def as_dict(self) -> dict[str, object]:
        """JSON values."""
        return {"effect": self.effect.name, "record": self.record, self.effect.parameters[0].name: self.size, "std": self.std,
                "at_s": self.at, "p_value": self.p_value}


def without(leaps: Iterable[Leap], records: list[MotionLog]) -> list[MotionLog]:
    """The records as they would be without what happened in them; the latest leap goes last, as it was found."""
    cleaned = []
    for record in records:
        for leap in leaps:
            if leap.record == record.source:
                record = _less(record, leap)
        cleaned.append(record)
    return cleaned


def _less(record: MotionLog, leap: Leap) -> MotionLog:
    return record.less(leap.joint, leap.effect.log_contribution(record.joints[leap.joint], leap.values))


def find_leaps(joint: int, records: Iterable[MotionLog]) -> tuple[Leap, ...]:
    """All leaps of a joint in records, record by record."""
    return tuple(leap for record in records if joint in record.joints for leap in _of_record(joint, record))


def _of_record(joint: int, record: MotionLog) -> list[Leap]:
    leaps: list[Leap] = []
    rng = np.random.default_rng(0)
    while (leap := _largest(joint, record, rng)) is not None:
        if len(leaps) == MOST_LEAPS:
            return []
        leaps.append(leap)
        record = _less(record, leap)
    return leaps


def _largest(joint: int, record: MotionLog, rng: np.random.Generator) -> Leap | None:
    """The largest leap, where both looks see it, and an eye would."""
    axis, moment = axis_of(joint, [record], BAND), _most_abrupt(session(joint, [record]).axis, record)
    if moment is None:
        return None
    evenly = axis.time[np.linspace(1, len(axis.time) - 2, min(MOMENTS, len(axis.time) - 2)).astype(int)]
    moments = np.unique([*evenly, np.clip(moment, evenly[0], evenly[-1])])
    steps = _steps(axis, record, moments)
    if steps is None:
        return None
    # Of several leaps of one size each look may hold another for the largest: the step is looked for where it is abrupt.
    along = np.abs(steps.along) * np.tile(np.abs(moments - moment) <= WITHIN, len(KINDS))
    kind = int(np.argmax(along)) // len(moments)
    p_value = steps.by_chance(float(along.max()), rng)
    if p_value > FOUND:
        return None
    leap = _at(moment, kind, joint, record, p_value)
    return leap if leap is not None and _seen(leap, record) else None


def _at(moment: float, kind: int, joint: int, record: MotionLog, p_value: float) -> Leap | None:
    """A leap at a known moment with its size, which is found by taking it off; whole samples of lost ones."""
    effect, log, cleaned = KINDS[kind], record.joints[joint], record
    size = std = 0.0
    for _ in range(ROUNDS):
        steps = _steps(axis_of(joint, [cleaned], BAND), cleaned, np.array([moment]))
        if steps is None:
            return None
        more, std = float(steps.along[kind] / steps.norm[kind]), steps.scatter / float(steps.norm[kind])
        size += log.step * round(more / log.step) if isinstance(effect, LostSamples) else more
        if abs(size) > effect.parameters[0].high:
            return None
        leap = Leap(effect, joint, record.source, size, std, moment, p_value)
        cleaned = _less(record, leap)
    return leap


def _seen(leap: Leap, record: MotionLog) -> bool:
    """Whether an eye would see it. Lost samples leave far more, from the moment on, than the record without them does. A zero
    leaps by more than the samples scatter, and in motion: at a standstill, and where a joint turns round, friction lets go."""
    log = record.joints[leap.joint]
    after = log.time >= leap.at
    told, without_it = (_left(leap.joint, each) for each in (record, _less(record, leap)))
    if isinstance(leap.effect, LostSamples):
        return rms(told[after]) > FAR_LARGER * rms(without_it[after])
    about = log.speed[np.abs(log.time - leap.at) <= MOVING]
    return abs(leap.size) > rms(without_it) and bool(np.all(about > STANDSTILL) or np.all(about < -STANDSTILL))


def _left(joint: int, record: MotionLog) -> Array:
    """What least squares leave of a record at full rate (n,), beside what is in any motion."""
    axis = session(joint, [record]).axis
    return np.asarray(axis.deflection - axis.widest @ np.linalg.lstsq(axis.widest, axis.deflection, rcond=None)[0])


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps under the band, K kinds at M moments. unit (m, K M): whitened, orthogonal to what is fitted, of length one; norm
    (K M,): that length; along (K M,): the residual's part along each; known (m, p): what is fitted, orthonormal; scatter: of
    the residual."""

    unit: Array
    norm: Array
    along: Array
    known: Array
    scatter: float

    def by_chance(self, largest: float, rng: np.random.Generator) -> float:
        """How often noise has one as large."""
        noise = rng.standard_normal((len(self.unit), BY_CHANCE))
        noise -= self.known @ (self.known.T @ noise)
        free = len(self.unit) - self.known.shape[1]
        chance = np.abs(self.unit.T @ noise).max(axis=0) / np.sqrt(np.sum(noise**2, axis=0) / free)
        return float((np.sum(chance >= largest / self.scatter) + 1) / (BY_CHANCE + 1))


def _steps(axis: Axis, record: MotionLog, moments: Array) -> _Steps | None:
    """At each moment [s] the deflection steps, and the speed in it; None of a record that is too short."""
    known, left = _beside(axis, axis.widest)
    free = len(left) - known.shape[1]
    if free < known.shape[1]:
        return None
    speed = low_pass(record.joints[axis.joint].speed[:, None], record.rate)
    steps = passed_step(axis.time[:, None] - moments, record.rate)
    white = axis.whiten(np.concatenate([steps, speed * steps], axis=1))
    own = white - known @ (known.T @ white)
    norm = np.linalg.norm(own, axis=0)
    told = norm > LEAST_OWN * np.linalg.norm(white, axis=0)
    unit = np.where(told, own / np.where(told, norm, 1.0), 0.0)
    return _Steps(unit, np.where(told, norm, np.inf), unit.T @ left, known, float(np.sqrt(left @ left / free)))


def _beside(axis: Axis, columns: Array) -> tuple[Array, Array]:
    """What is fitted, whitened and orthonormal (m, p), and what it leaves of the whitened deflection (m,)."""
    white = axis.whiten(columns / np.linalg.norm(columns, axis=0))
    basis, spread, _ = np.linalg.svd(white, full_matrices=False)
    known = basis[:, spread > 1e-10 * spread[0]]
    return known, axis.white_deflection - known @ (known.T @ axis.white_deflection)


def _most_abrupt(axis: Axis, record: MotionLog) -> float | None:
    """The time [s] of the full-rate record from which on a step gains most; None where a step so close to an end of the record
    that it cannot be told gains more than that: then what is seen is that one's."""
    known, left = _beside(axis, axis.widest)
    log = record.joints[axis.joint]
    gains = [step_gains(axis.noise, known, left, column)
             for column in (np.ones(len(log.time)), log.speed)]
    order = len(axis.noise.phi)
    gain = np.max(gains, axis=0)
    inner = gain.copy()
    inner[: order + 2] = 0.0
    inner[len(gain) - order - 2:] = 0.0
    best = int(np.argmax(inner))
    near = np.abs(log.time - log.time[best]) <= WITHIN
    return None if gain[near].max() > inner[best] else float(log.time[best])


def step_gains(noise: Autoregression, known: Array, left: Array, column: Array) -> Array:
    """What a column (n,) that is there from each sample on would take (n,) off the squares of a whitened residual (n - order,),
    beside what is known (n - order, p); by sums from the end, all samples at once."""
    count, order = len(column), len(noise.phi)
    weights = np.concatenate([[1.0], -noise.phi])

    def from_here_on(white: Array) -> Array:
        # The filter's adjoint, then all that follows a sample.
        back = np.zeros((count, white.shape[1]))
        for k, weight in enumerate(weights):
            back[order - k: count - k] += weight * white
        return np.cumsum((column[:, None] * back)[::-1], axis=0)[::-1]

    own = from_here_on(left[:, None])[:, 0]
    whole = np.zeros(count + order)
    whole[order: count] = noise.whiten(column[:, None])[:, 0] ** 2
    squares = np.cumsum(whole[::-1])[::-1][order:]
    # The first samples behind the step see a part of the filter only.
    for j in range(order):
        part = np.zeros(count)
        for k in range(j + 1):
            part[: count - j] += weights[k] * column[j - k: count - k]
        # Of the record's first samples there is no whitened row.
        part[: order - j] = 0.0
        squares = squares + part**2
    left_of_it = squares - np.sum(from_here_on(known) ** 2, axis=1)
    told = left_of_it > LEAST_OWN**2 * squares
    return np.where(told, own**2 / np.where(told, left_of_it, 1.0), 0.0)
