"""The spectrum of a residual over the joint's angle, and how large its highest peak would be by chance.

A line `a cos(n angle + phi)` is looked for by a matched filter in the residual that the noise's autoregression has whitened.
By chance means: the same residual with the signs of its blocks of time drawn anew. That keeps its spectrum, its tails, and
where it is loud (at which speeds), and breaks what only a line keeps from block to block, the phase.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.motion.autoregression import Autoregression

Array = NDArray[np.float64]
# Length of a block [s].
BLOCK = 0.4
# Angle bins a cycle at the highest frequency, frequencies a resolvable step, classes of speed.
BINS, FINER, SPEEDS = 12, 4, 80
# Cycles a turn that are looked at, at most.
MOST_CYCLES = 4000.0


@dataclass(frozen=True, eq=False)
class AngleSpectrum:
    """blocks (b, F): amplitude of each block of time at each frequency, complex; norm (F,): so that the squared modulus of the
    blocks' sum over it is twice the log-likelihood that a line there would gain."""

    blocks: NDArray[np.complex128]
    norm: Array

    def gain(self) -> Array:
        """Twice the log-likelihood (F,) that a line gains at each frequency."""
        return np.asarray(np.abs(self.blocks.sum(axis=0)) ** 2 / self.norm)

    def by_chance(self, count: int, rng: np.random.Generator) -> Array:
        """The same (count, F) with the blocks' signs drawn."""
        signs = rng.choice([-1.0, 1.0], (count, len(self.blocks)))
        return np.asarray(np.abs(signs @ self.blocks) ** 2 / self.norm)


@dataclass(frozen=True, eq=False)
class Frequencies:
    """Cycles a turn (F,), evenly spaced, all that angles within `span` [rad] can tell apart; bin: their angle step [rad];
    length: of the transform; first: place of the first."""

    cycles: Array
    bin: float
    length: int
    first: int


def frequencies(span: float, lowest: float, highest: float) -> Frequencies:
    """From lowest to highest cycles a turn, for records that stay within `span` [rad]."""
    step = 2 * np.pi / (BINS * highest)
    length = int(2 ** np.ceil(np.log2(FINER * span / step)))
    cycles = np.asarray(np.arange(length // 2 + 1) * (2 * np.pi / (length * step)), dtype=float)
    first, stop = np.searchsorted(cycles, [lowest, highest])
    return Frequencies(cycles[first:stop], step, length, int(first))


def angle_spectrum(
    residual: Array, noise: Autoregression, angle: Array, speed: Array, step: float, wanted: Frequencies
) -> AngleSpectrum:
    """Of a whitened residual (n - order,) at joint angles (n,) [rad] and speeds (n,) [rad/s], sampled every `step` [s]."""
    order, count = len(noise.phi), len(angle)
    places = np.rint((angle - angle.min()) / wanted.bin).astype(int)
    size = max(1, round(BLOCK / step))
    blocks = []
    for start in range(order, count, size):
        stop = min(start + size, count)
        # The filter's adjoint: what each sample of the angle gives to the whitened residual of this block.
        matched = np.zeros(stop - start + order)
        part = residual[start - order: stop - order]
        matched[order:] = part
        for k, weight in enumerate(noise.phi, start=1):
            matched[order - k: len(matched) - k] -= weight * part
        binned = np.bincount(places[start - order: stop], matched, minlength=wanted.length)
        blocks.append(np.fft.rfft(binned, wanted.length)[wanted.first: wanted.first + len(wanted.cycles)])
    norm = 0.5 * _power(noise, speed, step, wanted.cycles) * float(np.mean(residual**2))
    return AngleSpectrum(np.array(blocks), norm)


def _power(noise: Autoregression, speed: Array, step: float, cycles: Array) -> Array:
    """Sum over the samples of the whitening's squared response to a line (F,), which sweeps with the speed."""
    shares, edges = np.histogram(np.abs(speed), SPEEDS)
    turn = 0.5 * (edges[1:] + edges[:-1]) * step
    phase = np.linspace(0.0, 2 * np.pi, 1025)
    response = np.abs(1 - np.exp(-1j * phase[:, None] * np.arange(1, len(noise.phi) + 1)) @ noise.phi) ** 2
    power = np.zeros(len(cycles))
    for share, each in zip(shares, turn, strict=True):
        power += share * np.interp(np.mod(cycles * each, 2 * np.pi), phase, response)
    return np.asarray(np.maximum(power, 1e-6 * power.max()))
