"""The spindle's speed from a spectrum that is drawn line by line, and what of the lines a mean keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from compensator.forces.revolutions import find_spindle, lines_of, spectrum
from identification.common.arrays import Array

RATE, LENGTH = 2000.0, 4096
STEP = RATE / LENGTH
OTHER = 797


def folded(frequency: float) -> float:
    """Where a line shows that is logged at RATE."""
    rest = frequency % RATE
    return min(rest, RATE - rest)


def drawn(lines: dict[float, float], seed: int = 0, noise: float = 1e-3) -> tuple[Array, Array]:
    """Frequencies and power of sines of these amplitudes, by frequency [Hz], in white noise, through a Hann window."""
    rng = np.random.default_rng(seed)
    time = np.arange(LENGTH) / RATE
    force = noise * rng.standard_normal(LENGTH)
    for number, (frequency, amplitude) in enumerate(lines.items()):
        force = force + amplitude * np.cos(2 * np.pi * frequency * time + number)
    power = np.abs(np.fft.rfft(force * np.hanning(LENGTH))) ** 2
    return np.fft.rfftfreq(LENGTH, 1 / RATE), power


def comb(first: float, *amplitudes: float) -> dict[float, float]:
    return {first * (k + 1): amplitude for k, amplitude in enumerate(amplitudes) if amplitude}


def test_a_line_stands_between_its_bins_and_over_its_neighbours() -> None:
    """Hann's main lobe is nearly a parabola of logarithms: a hundredth of a bin. Its power is that of half of half the sum."""
    _, power = drawn({200.3: 2.0, 500.0: 0.5}, noise=0.05)
    place, height, over = lines_of(power)
    np.testing.assert_allclose(place * STEP, [200.3, 500.0], atol=0.03 * STEP)
    np.testing.assert_allclose(height, (np.array([2.0, 0.5]) * LENGTH / 4) ** 2, rtol=0.35)
    # White noise of sigma s has a mean power of 3/8 n s^2 in a Hann window, its median is ln 2 of that.
    np.testing.assert_allclose(over, height / (np.log(2) * 3 / 8 * LENGTH * 0.05**2), rtol=0.3)


@pytest.mark.parametrize(("share", "seen"), [(0.7, 1), (1.5, 2)])
def test_a_line_is_thirty_times_the_median_about_it_and_over_a_millionth_of_the_strongest(share: float, seen: int) -> None:
    """The noise's own peaks are no lines; a side lobe of a strong line is none either."""
    noise = 0.05
    floor = np.log(2) * 3 / 8 * LENGTH * noise**2
    weak = share * np.sqrt(30 * floor) * 4 / LENGTH
    _, power = drawn({100 * STEP: 1.0, 900 * STEP: weak}, noise=noise)
    assert len(lines_of(power)[0]) == seen
    _, power = drawn({100 * STEP: 1.0, 900 * STEP: 1e-3 * share}, noise=1e-9)
    assert len(lines_of(power)[0]) == seen


@pytest.mark.parametrize("first", [37.3, 61.0, 143.7])
def test_the_speed_is_that_of_the_comb(first: float) -> None:
    """Four teeth and some run-out: the lines of the teeth are the strongest. Half of what a mean over t keeps of a line is at
    most its amplitude over pi f t."""
    lines = comb(first, 0.3, 0.2, 0.1, 2.0, 0.1, 0.1, 0.1, 0.6)
    found = find_spindle(*drawn({f: a for f, a in lines.items() if f < 0.5 * RATE}))
    assert found is not None
    assert found.frequency == pytest.approx(first, rel=2e-4)
    assert found.strongest == pytest.approx(4 * first, rel=1e-3)
    assert (found.rivals, found.faster) == ((), None)
    assert 0.95 < found.share <= 1.0
    kept = [a / (np.pi * f) for f, a in lines.items() if f < 0.5 * RATE]
    assert found.left == pytest.approx(np.linalg.norm(kept), rel=0.2)


@pytest.mark.parametrize(("held", "found"), [(0.82, True), (0.785, False)])
def test_a_comb_holds_four_fifths_of_the_lines(held: float, found: bool) -> None:
    """Beyond what would lie on it by chance, three bins a line: 1.5 %. The rest stands where no comb of the strongest has a
    line."""
    speed = find_spindle(*drawn(comb(205 * STEP, 0.2, 0.1, 0.1, 0.6) | {OTHER * STEP: (1 - held) / held}))
    assert (speed is not None) == found
    if speed is not None:
        assert speed.frequency == pytest.approx(205 * STEP, rel=1e-3)
        assert speed.share == pytest.approx((held - 30 / 2050) / (1 - 30 / 2050), abs=0.01)


@pytest.mark.parametrize(("over", "found"), [(200, False), (450, True)])
def test_the_strongest_line_stands_out_by_three_hundred_unless_a_speed_is_stated(over: float, found: bool) -> None:
    noise = 0.05
    floor = np.log(2) * 3 / 8 * LENGTH * noise**2
    amplitude = np.sqrt(over * floor) * 4 / LENGTH
    spectra = drawn(comb(102.5 / 4096 * RATE, 0, amplitude, 0.9 * amplitude, 0.8 * amplitude, 0.7 * amplitude), noise=noise)
    assert (find_spindle(*spectra) is not None) == found
    stated = find_spindle(*spectra, 102.5 / 4096 * RATE)
    assert stated is not None
    assert stated.frequency == pytest.approx(102.5 / 4096 * RATE, rel=1e-3)


@pytest.mark.parametrize(("stated", "found"), [
    (101.0, 100.0), (97.2, 100.0), (103.0, 100.0), (50.5, 50.0), (103.2, None), (96.9, None)])
def test_a_stated_speed_is_looked_for_within_three_hundredths(stated: float, found: float | None) -> None:
    speed = find_spindle(*drawn(comb(100.0, 0.5, 0.3, 0.1, 2.0, 0.2)), stated)
    assert (speed is None) == (found is None)
    if speed is not None:
        assert speed.frequency == pytest.approx(found, rel=1e-3)


def test_a_line_too_near_to_zero_is_none() -> None:
    """A spindle turns four times a second at least, and eight steps of the spectrum."""
    assert find_spindle(*drawn(comb(3.5, 1.0, 0))) is None
    found = find_spindle(*drawn(comb(4.5, 1.0, 0.5, 0.5, 0.5) | {2.0: 5.0}))
    assert found is not None
    assert found.frequency == pytest.approx(4.5, rel=1e-2)


@pytest.mark.parametrize(("line", "shown", "teeth"), [(1398.0, 602.0, [3, 4, 5, 7]), (1165.0, 835.0, [2, 3, 5])])
def test_teeth_that_pass_faster_than_half_the_rate_have_rivals(line: float, shown: float, teeth: list[int]) -> None:
    """A line that is folded back may stand where it shows, or where it is: of so many teeth, up to eight, of a spindle that
    turns at most 667 times a second. One is named of those that are whole fractions of each other; of combs so dense that two
    lines lie on them by chance, as of more teeth here, none is."""
    found = find_spindle(*drawn({folded(line): 1.0, folded(2 * line): 0.2}))
    assert found is not None
    assert [found.frequency, *found.rivals] == pytest.approx([shown, *(line / number for number in teeth)], rel=1e-4)


@pytest.mark.parametrize(("bins", "lines"), [(41, 50), (205, 40)])
def test_what_would_lie_on_a_comb_by_chance_is_taken_off(bins: int, lines: int) -> None:
    """Three bins of the spectrum a line of it, of 2050: its multiples to half the rate, or forty, those beyond folded back."""
    top = 820 // bins
    comb_of = {bins * STEP: 0.2, 2 * bins * STEP: 0.2, top * bins * STEP: 0.6}
    speed = find_spindle(*drawn(comb_of | {OTHER * STEP: 0.15}, noise=1e-5))
    assert speed is not None
    chance, held = 3 * lines / 2050, 1 / 1.15
    assert speed.share == pytest.approx((held - chance) / (1 - chance), abs=1e-3)


def test_run_out_below_the_teeth_makes_a_turn_of_them() -> None:
    """Three teeth at 40 Hz, and a line of 40 Hz: under a fiftieth of the lines' amplitude it is passed over."""
    for runout, frequency in ((0.01, 120.0), (0.2, 40.0)):
        found = find_spindle(*drawn({40.0: runout, 80.0: runout} | comb(120.0, 2.0, 0.5, 0.25)))
        assert found is not None
        assert found.frequency == pytest.approx(frequency, rel=1e-3)


def pieces(force: Array, given: list[tuple[list[float], int]]):
    def stretches(shares: Sequence[float], size: int) -> Iterator[Array]:
        given.append((list(shares), size))
        for share in shares:
            begin = round(share * (len(force) - size))
            yield force[begin:begin + size]
    return stretches


@pytest.mark.parametrize(("rate", "length"), [(100.0, 1024), (2000.0, 1024), (5000.0, 4096), (25_600.0, 16_384), (9e4, 16_384)])
def test_a_spectrum_is_of_six_tenths_of_a_second(rate: float, length: int) -> None:
    """To the next power of two, 1024 to 16384 samples; of up to twelve stretches, an eighth longer each for gaps."""
    asked: list[tuple[list[float], int]] = []
    force = np.random.default_rng(0).standard_normal((3 * length + 7, 3))
    found = spectrum(pieces(force, asked), rate, len(force))
    assert found is not None
    assert asked == [([0.0, 0.5, 1.0], length + length // 8)]
    np.testing.assert_allclose(found[0], np.arange(length // 2 + 1) * rate / length)
    assert spectrum(pieces(force, asked), rate, length - 1) is None
    spectrum(pieces(force, asked), rate, 40 * length)
    assert asked[-1][0] == pytest.approx(np.linspace(0, 1, 12).tolist())
    assert spectrum(lambda shares, size: iter([force[:length - 1]]), rate, len(force)) is None


def test_a_spectrum_is_the_mean_of_the_livelier_half_without_drift_and_moments() -> None:
    """Three stretches, of which two are taken: those of 2 N and 3 N, not that of 1 N; what drifts evenly is no line."""
    time = np.arange(1024)
    line = np.cos(2 * np.pi * 100 * time / 1024)
    given = [np.column_stack([5 + a * line, 1e-3 * time, 0 * time, 99 * line, line, line]) for a in (2.0, 1.0, 3.0)]
    found = spectrum(lambda shares, size: iter(given), 1000.0, 3 * 1024)
    assert found is not None
    # A Hann window halves a sine, whose amplitude stands half at each sign of its frequency.
    assert found[1][100] == pytest.approx((4 + 9) / 2 * (1023 / 4) ** 2, rel=1e-3)
    assert found[1][1:90].max() < 1e-5 * found[1][100]
