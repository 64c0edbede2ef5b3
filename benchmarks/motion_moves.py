"""What an axis is told to do in the motion judge's records: multi-sines, moves back and forth, slow sweeps; S-curved."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def averaged(path: Array, step: float, time: float) -> Array:
    """The mean of the last `time` seconds, shifted to its middle: a ramp gets round ends of that length."""
    width = max(1, round(time / step)) | 1
    padded = np.concatenate([np.full(width // 2, path[0]), path, np.full(width // 2, path[-1])])
    sums = np.concatenate([[0.0], np.cumsum(padded)])
    return np.asarray((sums[width:] - sums[:-width]) / width)


def multisine(rng: np.random.Generator, count: int, step: float, speed: float, acceleration: float) -> Array:
    """A dozen sines at random phases, as fast as the axis may; it begins and ends at rest."""
    t = np.arange(count) * step
    frequencies = np.exp(rng.uniform(np.log(0.07), np.log(rng.uniform(0.8, 3.5)), int(rng.integers(5, 13))))
    path = np.sum([rng.uniform(0.5, 1) / (1 + f / 0.3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
                   for f in frequencies], 0)
    ends = np.clip(np.minimum(t, t[-1] - t) / min(1.0, t[-1] / 5), 0, 1)
    path *= ends * ends * (3 - 2 * ends)
    first = np.gradient(path, step)
    most = min(speed / np.abs(first).max(), acceleration / np.abs(np.gradient(first, step)).max())
    return np.asarray(path * most * rng.uniform(0.6, 1))


def to_and_fro(rng: np.random.Generator, count: int, step: float, speed: float, acceleration: float, *,
               sweep: bool = False) -> Array:
    """Moves between random places (a sweep: between the same two, evenly) with trapezoids of speed and a bounded jerk."""
    reach = min(rng.uniform(0.4, 1.2), speed * count * step / 3)
    override = rng.choice([0.05, 0.1, 0.2]) if sweep else rng.choice([0.25, 0.5, 1.0])
    pace = max(float(override) * speed, 6 * reach / (count * step) if sweep else 0.0)
    rest = max(pace / acceleration, 0.05) / 2 + 0.1                               # it begins and ends at rest
    knots, places, here = [0.0, rest], [0.0, 0.0], 0.0
    side, settled = 1.0, count * step - rest
    while True:
        there = side * reach / 2 if sweep else float(rng.uniform(-reach, reach))
        side = -side
        arrival = knots[-1] + max(abs(there - here) / pace, 0.05)
        if arrival > settled:
            break
        knots.append(arrival)
        places.append(there)
        here = there
        knots.append(knots[-1] + float(rng.uniform(0.0, 0.1 if sweep else 0.6)))
        places.append(here)
    path = np.interp(np.arange(count) * step, knots, places)
    return averaged(averaged(path, step, max(pace / acceleration, 0.05)), step, float(rng.uniform(0.04, 0.12)))


def move(rng: np.random.Generator, kind: str, count: int, step: float, speed: float, acceleration: float) -> Array:
    """Angles from the place where the axis begins [rad], (count,)."""
    if kind == "multisine":
        return multisine(rng, count, step, speed, acceleration)
    if kind == "mixed":
        half = count // 2
        one = to_and_fro(rng, half, step, speed, acceleration, sweep=True)
        return np.concatenate([one, one[-1] + multisine(rng, count - half, step, speed, acceleration)])
    return to_and_fro(rng, count, step, speed, acceleration, sweep=kind == "sweep")


KINDS = ("multisine", "to_and_fro", "sweep", "mixed")
