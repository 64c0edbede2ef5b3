"""How often a force repeats in a turn: of pulses that are made here, tooth by tooth."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.forces.revolutions import spectrum
from compensator.forces.ripple import ripple_of, said_of_teeth

RATE, TURN = 4000.0, 97.0


def seen(heights: list[float], turn: float = TURN, rate: float = RATE, noise: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """The spectrum of half sines, one a tooth over 80 degrees each, with the teeth's heights as run-out makes them unequal."""
    rng = np.random.default_rng(3)
    fine = 8
    time = np.arange(int(12 * rate * fine)) / (rate * fine)
    force = np.zeros(len(time))
    for tooth, height in enumerate(heights):
        angle = (2 * np.pi * (turn * time - tooth / len(heights))) % (2 * np.pi)
        force += height * np.where(angle < np.radians(80), np.sin(np.pi * angle / np.radians(80)), 0.0)
    force = force.reshape(-1, fine).mean(axis=1)        # as an anti-alias filter does
    load = np.column_stack([force, 0.5 * force, 0.2 * force]) + noise * rng.standard_normal((len(force), 3))

    def stretches(shares: list[float], count: int):
        return (load[(first := int(share * (len(load) - count))):first + count] for share in shares)

    found = spectrum(stretches, rate, len(load))
    assert found is not None
    return found


def told(heights: list[float], teeth: int | None, speed: float = TURN, **how: float) -> list[str]:
    return [one.message for one in said_of_teeth(ripple_of(*seen(heights, **how), speed), teeth, "log.csv")]


@pytest.mark.parametrize("heights", [[1.0], [1, 0.9], [1, 1], [1, 0.9, 0.95], [1.0] * 3, [1, 0.2, 0.2], [1.0] * 4, [1, 0.8] * 2,
                                     [1.0] * 6, [1, 0.7, 0.9] * 2])
def test_nothing_is_said_of_the_cutter_s_own_teeth(heights: list[float]) -> None:
    """Alike, with run-out to where one tooth cuts next to alone, and at uneven heights in pairs and threes."""
    assert told(heights, len(heights)) == []
    assert told(heights, None) == []


@pytest.mark.parametrize(("heights", "stated"), [([1, 0.95, 0.97], 2), ([1, 0.95, 0.97], 4), ([1, 0.98], 3), ([1.0] * 4, 3),
                                                 ([1.0] * 4, 2), ([1.0] * 3, 1)])
def test_another_number_of_teeth(heights: list[float], stated: int) -> None:
    message = f"the force repeats {len(heights)} times in a turn of {60 * TURN:.0f} rpm, which {stated} t"
    assert [one.startswith(message) for one in told(heights, stated)] == [True]


@pytest.mark.parametrize("heights", [[1, 0.9, 0.95], [1.0] * 4, [1.0] * 2])
def test_a_spindle_at_twice_the_stated_speed(heights: list[float]) -> None:
    """Three alike teeth at half the speed are as six, which three make in a slot: that is not told."""
    assert len(told(heights, len(heights), speed=0.5 * TURN)) == 1
    assert told([1.0] * 3, 3, speed=0.5 * TURN) == []


def test_nothing_is_said_where_the_spectrum_cannot_tell() -> None:
    """The teeth's line folded back at half the rate; a speed that the spectrum does not have; noise alone."""
    assert told([1.0] * 3, 4, rate=600.0) == []
    assert told([1.0] * 3, 4, speed=1.23 * TURN) == []
    assert told([0.0] * 3, 4) == []
