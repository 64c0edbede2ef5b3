"""Lines: errors that repeat n times a turn of the joint, n any number: searched for, and found again where they were not.

The search is at full rate beside all that a log shows in any case. Each line is the highest peak of the angle spectrum, its
p-value that of the highest peak by chance, so it counts the search. A line is found again where a record that was not searched
has it too, in a narrow window about the same n, and the size that was fitted makes a prediction better there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.motion.angle_spectrum import BLOCK, MOST_CYCLES, angle_spectrum, frequencies
from identification.motion.autoregression import Autoregression, noise_beside
from identification.motion.axis import Axis, axis_of
from identification.motion.dictionary import ALWAYS
from identification.motion.log_file import MotionLog
from identification.motion.smooth import smooth_over

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
# p-value of a line's search, and of its being found again.
FOUND, AGAIN = 0.01, 0.01
MOST_LINES = 10
BY_CHANCE = 499
# A line has at least so many cycles in the angles visited; what has fewer is the smooth part.
LEAST_CYCLES = 2.0
# Frequencies that are tried about a peak, over one resolvable step to either side.
ABOUT = 41
# Shapes of a smooth error that stand beside the lines: as many as have no line's number of cycles.
SLOW = 3
# With the fitted phase a prediction is better by this share of what the record's own phase gives: the phase holds.
PHASE_HOLDS = 0.5
# Lines are looked for that this share of the samples, the slowest, sees at two samples a cycle or more; faster ones see them
# folded over, which the angle undoes.
SLOWLY = 0.2
# A joint that moves less than this [rad] shows no line.
LEAST_SPAN = 0.02


@dataclass(frozen=True, eq=False)
class Line:
    """cycles a turn with its standard deviation, p_value of the search; again: p-value of its being found again, NaN where that
    was not tried; larger: by how much the fitted size betters the prediction there, twice the log-likelihood, with the line's
    own phase and with the fitted one."""

    cycles: float
    std: float
    p_value: float
    again: float = np.nan
    larger: tuple[float, float] = (np.nan, np.nan)

    @property
    def confirmed(self) -> bool:
        """Whether it was found again."""
        return bool(self.again <= AGAIN and self.larger[0] > 0)

    @property
    def phase_holds(self) -> bool:
        """Whether the fitted phase predicts as well, nearly; otherwise each record has its own."""
        return bool(self.larger[1] > PHASE_HOLDS * self.larger[0])


@dataclass(frozen=True, eq=False)
class Session:
    """Pieces of one record at full rate: the joint's raw axis, and the columns (n, p) that stand beside any line."""

    axis: Axis
    base: Array

    @cached_property
    def resolution(self) -> float:
        """Cycles a turn that the angles visited can just tell apart."""
        return float(2 * np.pi / np.ptp(self.axis.angle))

    @cached_property
    def speed(self) -> Array:
        """Of the motor (n,) [rad/s]."""
        return np.concatenate([log.speed for log in self.axis.logs])

    def whitened(self, noise: Autoregression, columns: Array) -> Array:
        """Columns (n, p) whitened, piece by piece."""
        return np.concatenate([noise.whiten(part) for part in self.axis.parts(columns)])


def session(joint: int, pieces: list[MotionLog]) -> Session:
    """One record, or pieces of it, as it is searched."""
    axis = axis_of(joint, pieces, np.inf, only=ALWAYS)
    slow = smooth_over(axis.angle, 1.0).columns(axis.angle)[:, :SLOW]
    return Session(axis, np.column_stack([axis.widest, slow]))


@dataclass(frozen=True, eq=False)
class LineFit:
    """A session's base with some lines beside it. amplitudes (k,) [rad]: Re(amplitude exp(i cycles angle)) is a line; left
    (m,): the whitened residual; known (m, p): orthonormal, what was fitted."""

    session: Session
    noise: Autoregression
    amplitudes: Complex
    left: Array
    known: Array

    @cached_property
    def variance(self) -> float:
        """Of the white noise [rad^2]."""
        return float(np.mean(self.left**2))

    def white_lines(self, cycles: Array) -> Array:
        """Whitened cosine and sine (m, 2 F) of further lines, without what is fitted already."""
        white = self.session.whitened(self.noise, line_columns(self.session.axis.angle, cycles))
        return np.asarray(white - self.known @ (self.known.T @ white))

    def products(self, cycles: Array) -> Array:
        """Orthonormal pairs for each further line times the residual, sample by sample (m, F, 2)."""
        first, second = np.moveaxis(self.white_lines(cycles).reshape(len(self.left), -1, 2), 2, 0)
        first = first / np.maximum(np.linalg.norm(first, axis=0), 1e-300)
        second = second - first * np.sum(first * second, axis=0)
        second = second / np.maximum(np.linalg.norm(second, axis=0), 1e-300)
        return np.stack([first, second], axis=2) * self.left[:, None, None]

    def gain(self, cycles: Array) -> Array:
        """Twice the log-likelihood (F,) that each further line would gain."""
        return np.asarray(np.sum(np.sum(self.products(cycles), axis=0) ** 2, axis=1) / self.variance)

    def better_by(self, cycles: float, amplitude: complex) -> tuple[float, float]:
        """Twice the log-likelihood that a line of given size gains: with this record's own phase, and with the given one."""
        white = self.white_lines(np.array([cycles]))
        own = np.linalg.lstsq(white, self.left, rcond=None)[0]
        phases = own / max(float(np.hypot(*own)), 1e-300), np.array([amplitude.real, -amplitude.imag]) / abs(amplitude)
        lines = [white @ (abs(amplitude) * phase) for phase in phases]
        gains = [float(2 * line @ self.left - line @ line) / self.variance for line in lines]
        return gains[0], gains[1]


def fitted(one: Session, cycles: Array) -> LineFit:
    """Lines of so many cycles (k,) beside the session's base, and the noise beside both."""
    columns = np.column_stack([one.base, line_columns(one.axis.angle, cycles)])
    scale = np.linalg.norm(columns, axis=0)
    columns = columns / scale
    noise = noise_beside(one.axis.parts(columns), one.axis.parts(one.axis.deflection))
    white = one.whitened(noise, columns)
    deflection = one.whitened(noise, one.axis.deflection[:, None])[:, 0]
    answer = np.linalg.lstsq(white, deflection, rcond=1e-10)[0]
    of_lines = (answer / scale)[one.base.shape[1]:]
    left, spread, _ = np.linalg.svd(white, full_matrices=False)
    return LineFit(one, noise, of_lines[0::2] - 1j * of_lines[1::2], deflection - white @ answer,
                   left[:, spread > 1e-10 * spread[0]])


def line_columns(angle: Array, cycles: Array) -> Array:
    """Cosine and sine (n, 2 k) of each line by turns."""
    phase = angle[:, None] * np.asarray(cycles, dtype=float)
    return np.stack([np.cos(phase), np.sin(phase)], axis=2).reshape(len(angle), -1)


def lines_at(angle: Array, cycles: Array, amplitudes: Complex) -> Array:
    """The lines' sum (n,) [rad] at joint angles (n,) [rad]."""
    return np.asarray(line_columns(angle, cycles) @ np.column_stack([amplitudes.real, -amplitudes.imag]).ravel())


def search(sessions: list[Session], rng: np.random.Generator) -> list[Line]:
    """Lines that the sessions show together, each with amplitude and phase of its own; the strongest first."""
    moving = [one for one in sessions if np.ptp(one.axis.angle) >= LEAST_SPAN]
    if not moving:
        return []
    apart = min(one.resolution for one in moving)
    steps = [float(np.median(np.diff(one.axis.logs[0].time))) for one in moving]
    slow = max(float(np.quantile(np.abs(one.speed), SLOWLY)) for one in moving)
    highest = min(MOST_CYCLES, np.pi / min(steps) / max(slow, 1e-6))
    wanted = frequencies(2 * np.pi / apart, LEAST_CYCLES * apart, max(highest, 4 * LEAST_CYCLES * apart))
    lines: list[Line] = []
    shoulders: list[float] = []
    while len(lines) < MOST_LINES:
        fits = [fitted(one, np.array([line.cycles for line in lines])) for one in moving]
        spectra = [angle_spectrum(fit.left, fit.noise, fit.session.axis.angle, fit.session.speed, step, wanted)
                   for fit, step in zip(fits, steps, strict=True)]
        free = np.ones(len(wanted.cycles), dtype=bool)
        for taken in (*(line.cycles for line in lines), *shoulders):
            free &= np.abs(wanted.cycles - taken) > apart
        if not free.any():
            break
        gain = np.sum([spectrum.gain() for spectrum in spectra], axis=0)[free]
        chance = np.sum([spectrum.by_chance(BY_CHANCE, rng) for spectrum in spectra], axis=0)[:, free].max(axis=1)
        p_value = float((np.sum(chance >= gain.max()) + 1) / (BY_CHANCE + 1))
        if p_value > FOUND:
            break
        highest_at = float(wanted.cycles[free][int(np.argmax(gain))])
        peak = _refined(fits, highest_at, apart)
        if peak is not None and all(abs(peak[0] - line.cycles) > apart for line in lines):
            lines.append(Line(*peak, p_value))
        elif len(shoulders) < MOST_LINES:
            shoulders.append(highest_at)
        else:
            break
    return lines


def _refined(fits: list[LineFit], cycles: float, apart: float) -> tuple[float, float] | None:
    """The peak of the exact likelihood about a frequency, and the standard deviation that its curvature gives; None where it
    has none there, being the shoulder of another."""
    about = cycles + apart * np.linspace(-0.5, 0.5, ABOUT)
    gain = np.sum([fit.gain(about) for fit in fits], axis=0)
    if np.argmax(gain) in (0, ABOUT - 1):
        return None
    top = int(np.clip(np.argmax(gain), 2, ABOUT - 3))
    a, b, _ = np.polyfit(about[top - 2: top + 3] - about[top], gain[top - 2: top + 3], 2)
    if a >= 0:
        return float(about[top]), apart
    return float(about[top] + np.clip(-b / (2 * a), -apart / ABOUT, apart / ABOUT)), float(min(apart, (-1 / a) ** 0.5))


def found_again(lines: list[Line], searched: list[Session], others: list[Session], rng: np.random.Generator) -> list[Line]:
    """The lines with what sessions say that were not searched."""
    cycles = np.array([line.cycles for line in lines])
    size = shared([fitted(one, cycles).amplitudes for one in searched]) if lines else np.array([])
    told = []
    for k, line in enumerate(lines):
        fits = [fitted(one, np.delete(cycles, k)) for one in others]
        about = line.cycles + searched[0].resolution * np.linspace(-0.5, 0.5, 11)
        gain = np.sum([fit.gain(about) for fit in fits], axis=0).max()
        chance = np.sum([_by_chance(fit, about, rng) for fit in fits], axis=0).max(axis=1)
        p_value = float((np.sum(chance >= gain) + 1) / (BY_CHANCE + 1))
        own, same = np.sum([fit.better_by(line.cycles, complex(size[k])) for fit in fits], axis=0)
        told.append(replace(line, again=p_value, larger=(float(own), float(same))))
    return told


def _by_chance(fit: LineFit, cycles: Array, rng: np.random.Generator) -> Array:
    """The gains (count, F) with the signs of the residual's blocks of time drawn."""
    products = fit.products(cycles)
    size = max(1, round(BLOCK * fit.session.axis.rates[0]))
    blocks = np.add.reduceat(products, np.arange(0, len(products), size), axis=0)
    signs = rng.choice([-1.0, 1.0], (BY_CHANCE, len(blocks)))
    sums = (signs @ blocks.reshape(len(blocks), -1)).reshape(BY_CHANCE, len(cycles), 2)
    return np.asarray(np.sum(sums**2, axis=2) / fit.variance)


def shared(amplitudes: list[Complex]) -> Complex:
    """One amplitude a line for several records: their mean, its modulus the mean of theirs."""
    mean = np.mean(amplitudes, axis=0)
    return np.asarray(np.mean(np.abs(amplitudes), axis=0) * np.exp(1j * np.angle(mean)))
