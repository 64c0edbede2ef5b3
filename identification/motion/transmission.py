"""Transmission: the error of a joint's gear or encoders that repeats with its angle, named only where it is found again.

Lines (lines.py) and a smooth part (smooth.py) are fitted to some records and must then predict others, each with a zero of its
own. Where there is one record only, its first part is fitted and its last part, some way apart in time, has to agree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.motion.axis import Axis, axis_of, solve, straight_line
from identification.motion.band import BAND
from identification.motion.blocks import ratio_interval
from identification.motion.dictionary import ALWAYS, Shape
from identification.motion.lines import (
    BY_CHANCE,
    LEAST_SPAN,
    Complex,
    Line,
    fitted,
    found_again,
    lines_at,
    search,
    session,
    shared,
)
from identification.motion.log_file import MotionLog
from identification.motion.smooth import Smooth, log_evidence, smooth_over

Array = NDArray[np.float64]
# Share of a single record that is searched, and of what has to agree at its other end; shorter records are not searched [s].
PART = 0.45
SHORTEST = 6.0
# Sizes of the smooth part that are tried [rad], of waves of the whole turn and of finer ones; these fall from so many waves in
# the angles visited on. The odds from which on it is looked for where it was not fitted.
SIZES, FINER = np.geomspace(5e-5, 2e-3, 9), np.geomspace(5e-7, 2e-4, 9)
BENDS = (0.5, 1.0, 2.0)
ODDS = 20.0
# It must better the prediction by this ratio: a gear's law that is left out imitates it, up to 1.12 in simulated logs.
LEAST_GAIN = 1.25


@dataclass(frozen=True, eq=False)
class SmoothTest:
    """The smooth part on what was not fitted. log_odds: ln of the evidence where it was fitted; before, after: RMS [rad] there
    without and with it, under the band, each record with its own zero; interval_95 of their ratio; line: RMS that a straight
    line through the torque leaves there."""

    smooth: Smooth
    log_odds: float
    before: float
    after: float
    interval: tuple[float, float]
    line: float

    @property
    def confirmed(self) -> bool:
        """Whether it predicts, and not only mends what the causes of any motion do to a record that does not tell them."""
        return self.interval[0] > 1.0 and min(self.before, self.line) > LEAST_GAIN * self.after


@dataclass(frozen=True, eq=False)
class Transmission:
    """lines: all that were found where was searched, found again or not; smooth: the test of the smooth part, None where the
    fitted record does not speak for one; again_on: what was not fitted, in words."""

    joint: int
    lines: tuple[Line, ...] = ()
    smooth_test: SmoothTest | None = None
    again_on: str = ""

    @property
    def confirmed(self) -> tuple[Line, ...]:
        """The lines that were found again."""
        return tuple(line for line in self.lines if line.confirmed)

    @property
    def smooth(self) -> Smooth | None:
        """The smooth part, where it predicts."""
        return self.smooth_test.smooth if self.smooth_test is not None and self.smooth_test.confirmed else None

    def smooth_over(self, records: list[MotionLog]) -> Smooth | None:
        """The smooth part as it is fitted to records, None where it does not predict."""
        if self.smooth is None:
            return None
        angles = [record.joints[self.joint].angle for record in records if self.joint in record.joints]
        return smooth_over(np.concatenate(angles), self.smooth.size, self.smooth.bend)

    @property
    def named(self) -> bool:
        """Whether any of it was found again."""
        return bool(self.confirmed) or self.smooth is not None

    @property
    def words(self) -> str:
        """What of it is named, in words; "" where nothing is."""
        count = len(self.confirmed)
        parts = [f"{count} line{'s' if count > 1 else ''}"] if count else []
        parts += ["a smooth part"] if self.smooth is not None else []
        return f"a transmission error ({' and '.join(parts)} over the angle, found again in {self.again_on})" if parts else ""

    @property
    def p_value(self) -> float:
        """Of the search of the strongest line that was found again; 1 where there is none."""
        return min((line.p_value for line in self.confirmed), default=1.0)

    @property
    def p_resolution(self) -> float:
        """The smallest that this p-value can be."""
        return 1 / (BY_CHANCE + 1) if self.confirmed else 1.0

    @property
    def cycles(self) -> Array:
        """Of the lines that were found again, a turn (k,)."""
        return np.array([line.cycles for line in self.confirmed])

    def amplitudes(self, pieces: list[MotionLog]) -> Complex:
        """The lines' amplitudes (k,) [rad] in a record, or in pieces of one."""
        return fitted(session(self.joint, pieces), self.cycles).amplitudes

    def cleaned(self, records: list[MotionLog]) -> list[MotionLog]:
        """The records without the lines, each with what was fitted to it; pieces of one record share that."""
        if not self.confirmed:
            return records
        by_source: dict[str, list[MotionLog]] = {}
        for record in records:
            if self.joint in record.joints:
                by_source.setdefault(record.source, []).append(record)
        sizes = {source: self.amplitudes(pieces) for source, pieces in by_source.items()}
        return [self._less(record, sizes[record.source]) if record.source in sizes else record for record in records]

    def predicted(self, fitted_to: list[MotionLog], record: MotionLog) -> MotionLog:
        """A record that was not fitted without the lines as `fitted_to` tell their sizes; the phase is the record's own where
        it does not hold, and where it is a piece of a fitted record that record's."""
        if not self.confirmed:
            return record
        same = [piece for piece in fitted_to if piece.source == record.source]
        if same:
            return self._less(record, self.amplitudes(same))
        by_source = {piece.source: [other for other in fitted_to if other.source == piece.source] for piece in fitted_to
                     if self.joint in piece.joints}
        size, own = shared([self.amplitudes(pieces) for pieces in by_source.values()]), self.amplitudes([record])
        holds = np.array([line.phase_holds for line in self.confirmed])
        return self._less(record, np.abs(size) * np.exp(1j * np.angle(np.where(holds, size, own))))

    def _less(self, record: MotionLog, amplitudes: Complex) -> MotionLog:
        return record.less(self.joint, lines_at(record.joints[self.joint].angle, self.cycles, amplitudes))

    def as_dict(self, records: list[MotionLog]) -> dict[str, Any]:
        """JSON values; records: those that were fitted."""
        having = [record for record in records if self.joint in record.joints]
        sizes = [self.amplitudes([record]) for record in having] if self.confirmed else []
        lines = []
        for line in self.lines:
            one: dict[str, Any] = {"cycles_per_turn": line.cycles, "std": line.std, "p_value": line.p_value,
                                   "found_again": line.confirmed, "p_value_again": finite(line.again)}
            if line.confirmed:
                k = self.confirmed.index(line)
                by_record = [{"record": record.source, "amplitude_rad": float(abs(size[k])),
                              "phase_rad": float(np.angle(size[k]))} for record, size in zip(having, sizes, strict=True)]
                one |= {"phase_holds": line.phase_holds, "records": by_record}
            lines.append(one)
        test = self.smooth_test
        smooth = None if test is None else {
            "size_rad": test.smooth.size, "found_again": test.confirmed, "rms_before_urad": 1e6 * test.before,
            "rms_after_urad": 1e6 * test.after, "interval": list(test.interval)}
        return {"named": self.named, "lines": lines, "smooth": smooth, "not_fitted": self.again_on}


def finite(value: float) -> float | None:
    """As JSON has it."""
    return float(value) if np.isfinite(value) else None


def find_transmission(joint: int, records: list[MotionLog], validate: MotionLog | None, seed: int = 0) -> Transmission:
    """What repeats with the joint's angle. Searched in the records and found again in `validate`; without that searched in the
    first record and found again in the others; of a single record searched in the first part, found again in the last."""
    having = [record for record in records if joint in record.joints]
    if validate is not None:
        searched, others, how = having, [validate], validate.source
    elif len(having) > 1:
        searched, others, how = having[:1], having[1:], ", ".join(record.source for record in having[1:])
    else:
        count = len(having[0].time)
        searched, others = [having[0].cut(0, int(PART * count))], [having[0].cut(count - int(PART * count), count)]
        how = f"the last {100 * PART:g} % of the same record"
    if min(float(record.time[-1] - record.time[0]) for record in (*searched, *others)) < PART * SHORTEST:
        return Transmission(joint)
    rng = np.random.default_rng(seed)
    sessions, fresh = ([session(joint, [record]) for record in several] for several in (searched, others))
    lines = found_again(search(sessions, rng), sessions, fresh, rng)
    found = Transmission(joint, tuple(lines), None, how)
    return replace(found, smooth_test=_smooth_test(joint, found.cleaned(searched), _each_cleaned(found, others)))


def _each_cleaned(found: Transmission, records: list[MotionLog]) -> list[MotionLog]:
    return [found.cleaned([record])[0] for record in records]


def _smooth_test(joint: int, searched: list[MotionLog], others: list[MotionLog]) -> SmoothTest | None:
    """Waves of the whole turn, or finer ones: those that predict, of both the likelier where they were fitted."""
    coarse = _tested(joint, searched, others, SIZES, (1.0,))
    span = float(np.ptp(np.concatenate([record.joints[joint].angle for record in searched])))
    if span < LEAST_SPAN:
        return coarse
    finer = _tested(joint, searched, others, FINER, tuple(2 * np.pi * share / span for share in BENDS))
    if finer is None or not finer.confirmed:
        return coarse
    return finer if coarse is None or not coarse.confirmed or finer.log_odds > coarse.log_odds else coarse


def _tested(
    joint: int, searched: list[MotionLog], others: list[MotionLog], sizes: Array, bends: tuple[float, ...]
) -> SmoothTest | None:
    angle = np.concatenate([record.joints[joint].angle for record in searched])
    tried = [smooth_over(angle, 1.0, bend) for bend in bends]
    axis = axis_of(joint, searched, BAND, tried[-1])
    if min(smooth.mix.shape[1] for smooth in tried) == 0 or len(axis.torque) < 2 * axis.widest.shape[1]:
        return None
    always = [group[0] for group in axis.dictionary if group[0].name in ALWAYS]
    evidence = np.array([evidence_beside(axis, smooth, _beside(replace(axis, smooth=None), always), sizes) for smooth in tried])
    odds = float(np.logaddexp.reduce(evidence, axis=None) - np.log(evidence.size))
    if odds < np.log(ODDS):
        return None
    bend, size = np.unravel_index(int(np.argmax(evidence)), evidence.shape)
    smooth = replace(tried[bend], size=float(sizes[size]))
    left: list[list[Array]] = [[], []]
    tested = [axis_of(joint, [record], BAND) for record in others]
    for parts, model in zip(left, (None, smooth), strict=True):
        fit = solve(replace(axis, smooth=model), _beside(replace(axis, smooth=model), always)).coefficients[len(axis.lengths):]
        for test in tested:
            columns = _beside(replace(test, smooth=model), always)[:, len(test.lengths):]
            rest = test.deflection - columns @ fit
            parts.append(rest - rest.mean())
    straight = [test.deflection - straight_line(axis)[-1] * test.torque for test in tested]
    line = np.concatenate([rest - rest.mean() for rest in straight])
    before, after = (np.concatenate(parts) for parts in left)
    seconds = sum(float(record.time[-1] - record.time[0]) for record in others)
    return SmoothTest(smooth, odds, float(np.std(before)), float(np.std(after)),
                      ratio_interval(before, after, seconds), float(np.std(line)))


def evidence_beside(axis: Axis, smooth: Smooth, base: Array, sizes: Array) -> Array:
    """ln of the evidence (S,) for a smooth part of each size beside columns (n, p), by the noise beside that of the axis."""
    white = axis.whiten(base)
    return log_evidence(axis.whiten(smooth.columns(axis.angle)), white / np.linalg.norm(white, axis=0), axis.white_deflection,
                        axis.white_variance, sizes)


def _beside(axis: Axis, always: list[Shape]) -> Array:
    """Columns of the plain spring with its smooth error, and of what is in any motion, as the fitted records show it."""
    return np.column_stack([axis.plain, *(shape.on(axis.logs, axis.rates, axis.band)[:, :1] for shape in always)])
