"""What happens at one moment of a record: a zero that leaps, samples of a channel that are lost; what only looks like it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from identification.model.cell import read_cell
from identification.model.effects.lost_samples import LostSamples
from identification.model.joint_log import JointLog
from identification.motion import leaps
from identification.motion.autoregression import Autoregression
from identification.motion.axis import axis_of
from identification.motion.band import BAND, low_pass, passed_step, thinned
from identification.motion.fit import fit_joint_logs
from identification.motion.leaps import find_leaps, step_gains, without
from identification.motion.log_file import MotionLog, read_motion_log
from identification.motion.procedure import diagnose_axes
from tests.identification.motion.simulated_joint import RATE, STIFFNESS, columns, write

MOTION = {"channel_delay": 1.0, "joint_friction": 1.0, "motor_inertia": 1.0}


def log_of(path: Path, values: dict[str, np.ndarray]) -> MotionLog:
    return read_motion_log(write(path, values))


def slipped(values: dict[str, np.ndarray], shift: float, at: float) -> dict[str, np.ndarray]:
    """The link encoder reads so much less [rad] from a time on."""
    return values | {"q2_link_deg": values["q2_link_deg"] - np.degrees(shift) * (values["time_s"] > at)}


def missing(values: dict[str, np.ndarray], samples: int, first: int) -> dict[str, np.ndarray]:
    """The link encoder's channel without so many samples; what comes after it moves up, the record is as much shorter."""
    link = np.delete(values["q2_link_deg"], np.arange(first, first + samples))
    return {name: (link if name == "q2_link_deg" else column[: len(link)]) for name, column in values.items()}


def test_a_zero_that_leaps_is_named_and_taken_out(tmp_path: Path) -> None:
    """By 6e-5 rad, beside all that motion brings; the stiffness is that of the record without it."""
    values = columns(400, MOTION)
    clean, log = (log_of(tmp_path / f"{name}.csv", each) for name, each in (
        ("clean", values), ("log", slipped(values, 6e-5, 11.9))))
    (leap,) = find_leaps(2, [log])
    assert leap.effect.name == "encoder_slip"
    assert leap.at == pytest.approx(11.9, abs=2 / RATE)
    assert abs(leap.size - 6e-5) < 4 * leap.std < 6e-5
    one, without_it = (diagnose_axes([record], replicates=19)[0] for record in (log, clean))
    assert one.verdict == "named"
    assert {cause.shape.name for cause in one.causes} == {"encoder_slip"} | {c.shape.name for c in without_it.causes}
    assert one.stiffness.compliance == pytest.approx(without_it.stiffness.compliance, rel=0.03)
    assert one.fitted_std[1] == pytest.approx(without_it.fitted_std[1], rel=0.05)


def test_a_zero_that_leaps_alone_is_all_there_is(tmp_path: Path) -> None:
    """A spring and nothing else: what is left beside it is the noise of the channels."""
    log = log_of(tmp_path / "log.csv", slipped(columns(405, {}, seconds=6), 2e-4, 3.3))
    one = diagnose_axes([log], replicates=19)[0]
    assert [cause.shape.name for cause in one.causes] == ["encoder_slip"]
    noise = np.sqrt(8e-6**2 + 8e-6**2 + (15 / STIFFNESS) ** 2)
    assert one.fitted_std[1] == pytest.approx(noise, rel=0.15)
    assert one.fitted_std[0] > 1.5 * noise
    (leap,) = one.as_dict()["leaps"]
    assert leap.pop("shift_rad") == pytest.approx(2e-4, abs=4 * leap.pop("std"))
    assert leap.pop("at_s") == pytest.approx(3.3, abs=2 / RATE)
    assert 0 < leap.pop("p_value") <= 0.01
    assert leap == {"effect": "encoder_slip", "record": log.source}


# Long: the zero that leaps is told beside all that motion brings above, and a law is no leap below.
@pytest.mark.long
@pytest.mark.parametrize("wave", [300.0, pytest.param(500.0, marks=pytest.mark.long)])
def test_a_leap_is_sure_beside_what_nothing_explains(tmp_path: Path, wave: float) -> None:
    """A deflection that goes up and down over the torque is no cause's; the zero has leapt all the same."""
    values = columns(420, {}, noise=2e-6)
    values["q2_link_deg"] = values["q2_link_deg"] - np.degrees(6e-5 * np.sin(values["q2_torque_nm"] / wave))
    clean, log = (log_of(tmp_path / f"{name}.csv", each) for name, each in (
        ("clean", values), ("log", slipped(values, 2e-4, 11.9))))
    assert diagnose_axes([clean], replicates=19)[0].verdict == "unknown", "the case must be one"
    one = diagnose_axes([log], replicates=19)[0]
    assert one.verdict == "named"
    assert [cause.shape.name for cause in one.causes] == ["encoder_slip"]
    assert one.gain is None
    assert one.left.patterns


def test_of_causes_that_do_not_explain_the_rest_the_leap_alone_is_sure(tmp_path: Path) -> None:
    """An encoder that is late by 0.9 ms and a law of no dictionary: what is likely beside the leap stays open, each
    cause once."""
    values = columns(405, {"channel_delay": 0.3}, seconds=5, noise=2e-6)
    values["q2_link_deg"] = values["q2_link_deg"] - np.degrees(1e-4 * np.sin(values["q2_torque_nm"] / 150.0))
    one = diagnose_axes([log_of(tmp_path / "log.csv", slipped(values, 6e-4, 2.7))], replicates=19)[0]
    assert (one.verdict, [cause.shape.name for cause in one.causes]) == ("named", ["encoder_slip"])
    assert one.left.patterns
    others = [cause.shape.name for cause in one.alternatives]
    assert "channel_delay (link)" in others
    assert "encoder_slip" not in others
    assert len(others) == len(set(others))


@pytest.mark.parametrize(("seed", "silent", "told"), [(420, (1, 3, -1), (4, -5)), (421, (1, 2, 3), (4, -6))])
def test_a_leap_near_an_end_is_told_as_it_is_or_not_at_all(
    tmp_path: Path, seed: int, silent: tuple[int, ...], told: tuple[int, ...]
) -> None:
    """Ten samples a second, so that few rows stand before it: never at another moment, nor of another size."""
    values = {name: column[::25] for name, column in columns(seed, {}).items()}
    time = values["time_s"]
    for place in (*silent, *told):
        found = find_leaps(2, [log_of(tmp_path / "log.csv", slipped(values, 1e-3, time[place] - 0.05))])
        assert [leap.at for leap in found] == ([] if place in silent else [pytest.approx(time[place])])
        assert [leap.size for leap in found] == ([] if place in silent else [pytest.approx(1e-3, rel=0.05)])


@pytest.mark.parametrize("samples", [1, 7])
def test_samples_that_are_missing_are_counted(tmp_path: Path, samples: int) -> None:
    values = columns(401, {}, seconds=12)
    log = log_of(tmp_path / "log.csv", missing(values, samples, 1500))
    (leap,) = find_leaps(2, [log])
    assert leap.effect.name == "lost_samples"
    assert leap.size == pytest.approx(-samples / RATE, rel=1e-6)
    assert leap.at == pytest.approx(1500 / RATE, abs=(1 + samples) / RATE)
    # The link stood at each row where it stands in the record that lost nothing.
    (mended,) = without((leap,), [log])
    whole = log_of(tmp_path / "whole.csv", values).joints[2].deflection[: len(mended.time)]
    off = np.abs(mended.joints[2].deflection - whole)
    assert np.median(off) < 1e-9
    assert off.max() < 2e-4


@pytest.mark.parametrize("noise", [4e-4, 8e-4, 1.6e-3])
def test_a_sample_that_hides_in_the_noise_is_not_told(tmp_path: Path, noise: float) -> None:
    """A sample's way is as long as the noise is high, or shorter: the search finds one, at another moment as often as not."""
    assert find_leaps(2, [log_of(tmp_path / "log.csv", missing(columns(401, {}, seconds=12, noise=noise), 1, 1500))]) == ()


def test_identify_says_what_it_took_out(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("name: r\nmanufacturer: m\nload_path: serial\nprior:\n  relative_std: 2.0\n"
                                         "  stiffness_nm_per_rad: [5.0e6, 5.0e6, 5.0e6, 1.0e6, 1.0e6, 5.0e5]\n")
    (tmp_path / "cell.yaml").write_text("robot: robot.yaml\ntool: {position_mm: [0, 0, 200], quaternion: [1, 0, 0, 0]}\n")
    log = log_of(tmp_path / "log.csv", missing(columns(402, {}), 3, 2000))
    fit = fit_joint_logs(read_cell(tmp_path / "cell.yaml", geometry=False), [log])
    (said,) = [finding for finding in fit.findings if finding.code == "CS1617"]
    assert "12 ms of the link's channel missing at 8.0" in said.message
    low, high = fit.joints[0].interval_95
    assert low < STIFFNESS < high


@pytest.mark.parametrize("fault", ["backlash", "soft_zone", "hysteresis", "joint_friction", "angle_error", "torque_delay"])
def test_a_law_is_no_leap(tmp_path: Path, fault: str) -> None:
    """Free play crosses its gap abruptly, and comes back."""
    for seed in (410, 411):
        assert find_leaps(2, [log_of(tmp_path / "log.csv", columns(seed, {fault: 3.0}))]) == ()


def test_a_zero_that_walks_is_no_leap(tmp_path: Path) -> None:
    values = columns(412, {})
    walk = np.degrees(2e-4 * np.sin(0.2 * values["time_s"]))
    assert find_leaps(2, [log_of(tmp_path / "log.csv", values | {"q2_link_deg": values["q2_link_deg"] + walk})]) == ()


def test_a_joint_that_leaps_all_the_time_has_no_leaps(tmp_path: Path) -> None:
    values = columns(413, {})
    for at in (2.0, 5.0, 8.0, 11.0, 14.0, 17.0):
        values = slipped(values, 2e-4, at)
    assert find_leaps(2, [log_of(tmp_path / "log.csv", values)]) == ()


def test_a_leap_is_told_at_any_moment_of_a_long_record(tmp_path: Path) -> None:
    """Five minutes: moments that are tried evenly lie farther apart than the looks may."""
    values = {name: column[::10] for name, column in columns(430, {}, seconds=300).items()}
    at = 51.7
    about = np.abs(values["time_s"] - at) < 0.2
    assert np.all(values["q2_speed_deg_s"][about] > 3), "the joint must move"
    (leap,) = find_leaps(2, [log_of(tmp_path / "log.csv", slipped(values, 3e-4, at))])
    assert leap.at == pytest.approx(at, abs=0.05)
    assert leap.size == pytest.approx(3e-4, abs=4 * leap.std)


@pytest.mark.parametrize(("count", "sizes"), [
    (3, (8e-4, -4e-4, 2e-4)), (3, (3e-4, 3e-4, 3e-4)), (4, (8e-4, -4e-4, 2e-4, -1.6e-3))])
def test_three_leaps_of_a_record_are_told_and_four_are_a_law(tmp_path: Path, count: int, sizes: tuple[float, ...]) -> None:
    """Also where they are of one size, and none is the largest."""
    values = columns(414, {})
    hidden = list(zip((5.0, 8.0, 13.0, 16.9), sizes, strict=False))
    for at, shift in hidden:
        values = slipped(values, shift, at)
    found = sorted((leap.at, leap.size) for leap in find_leaps(2, [log_of(tmp_path / "log.csv", values)]))
    expected = hidden if count == 3 else []
    assert [at for at, _ in found] == pytest.approx([at for at, _ in expected], abs=2 / RATE)
    assert [size for _, size in found] == pytest.approx([shift for _, shift in expected], abs=2e-5)


def test_squares_of_a_step_are_those_of_least_squares() -> None:
    """At each sample by itself: two fits, with and without the step, of the same whitened rows."""
    rng = np.random.default_rng(0)
    count, noise = 60, Autoregression(np.array([0.5, -0.3, 0.2]))
    column, base, deflection = rng.standard_normal(count), rng.standard_normal((count, 3)), rng.standard_normal((count, 1))
    white, base = noise.whiten(deflection)[:, 0], noise.whiten(base)
    known = np.linalg.qr(base)[0]
    gains = step_gains(noise, known, white - known @ (known.T @ white), column)
    for first in (0, 1, 5, 30, count - 4):
        step = noise.whiten((column * (np.arange(count) >= first))[:, None])
        left = [np.sum((white - x @ np.linalg.lstsq(x, white, rcond=None)[0]) ** 2)
                for x in (base, np.column_stack([base, step]))]
        assert gains[first] == pytest.approx(left[0] - left[1], rel=1e-9)


@pytest.mark.parametrize(("share", "told"), [(2e-2, True), (1.5e-3, True), (7e-4, False)])
def test_a_step_is_told_by_what_of_it_nothing_else_explains(share: float, told: bool) -> None:
    """A thousandth of its size at least; what it takes off the squares is then still that of least squares."""
    rng = np.random.default_rng(4)
    count, first, noise = 60, 20, Autoregression(np.zeros(0))
    column, deflection = rng.standard_normal(count), rng.standard_normal(count)
    column[-3:] = 0.0
    step = column * (np.arange(count) >= first)
    aside = rng.standard_normal(count)
    aside -= step * (aside @ step) / (step @ step)
    angle = np.arcsin(share)
    known = np.cos(angle) * step / np.linalg.norm(step) + np.sin(angle) * aside / np.linalg.norm(aside)
    left = deflection - known * (known @ deflection)
    both = np.column_stack([known, step])
    fitted = left @ left - np.sum((deflection - both @ np.linalg.lstsq(both, deflection, rcond=None)[0]) ** 2)
    gains = step_gains(noise, known[:, None], left, column)
    assert gains[first] == pytest.approx(fitted if told else 0.0, rel=1e-6)
    assert np.all(gains[-3:] == 0.0), "of a column that is nothing there"


@pytest.mark.parametrize("place", [40, 150, 155, 280])
def test_a_step_under_the_band_has_the_size_of_least_squares(tmp_path: Path, place: int) -> None:
    """Beside all that motion brings: of a zero that leaps, and of a channel that comes late from then on, which is the speed
    from then on; the step is one at full rate, low-passed as the log is. Nothing steps behind the end."""
    log = log_of(tmp_path / "log.csv", slipped(columns(404, MOTION), 1e-4, 11.9))
    axis, one = axis_of(2, [log], BAND), log.joints[2]
    moment = float(axis.time[place])
    steps = leaps._steps(axis, log, np.array([moment, log.time[-1] + 9.0]))
    assert steps is not None
    known = axis.whiten(axis.widest / np.linalg.norm(axis.widest, axis=0))
    target = axis.whiten(axis.deflection[:, None])[:, 0]
    alone = target - known @ np.linalg.lstsq(known, target, rcond=1e-10)[0]
    assert steps.scatter == pytest.approx(np.sqrt(alone @ alone / (len(target) - known.shape[1])), rel=1e-6)
    step = low_pass((one.time > moment - 0.5 / RATE)[:, None].astype(float), RATE)
    for kind, column in enumerate((step, step * low_pass(one.speed[:, None], RATE))):
        white = axis.whiten(column)[:, 0]
        design = np.column_stack([known, white])
        own = white - known @ np.linalg.lstsq(known, white, rcond=1e-10)[0]
        size = np.linalg.lstsq(design, target, rcond=1e-12)[0][-1]
        assert steps.along[2 * kind] / steps.norm[2 * kind] == pytest.approx(size, rel=1e-6)
        assert steps.norm[2 * kind] == pytest.approx(np.linalg.norm(own), rel=1e-6)
    assert steps.along[[1, 3]].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("largest", [0.0, 1.5, 2.0, 2.5, 3.0, 90.0])
def test_a_step_is_as_rare_as_noise_has_the_largest_of_all(largest: float) -> None:
    """Of eight directions in forty, two of which the model holds: 199 draws of noise in a scatter of 2.0, the record itself is
    the two-hundredth."""
    unit = np.eye(40)[:, :8]
    free = 40 - 2
    steps = leaps._Steps(unit, np.ones(8), np.zeros(8), np.eye(40)[:, [6, 7]], 2.0)
    found = steps.by_chance(2.0 * largest, np.random.default_rng(1))
    # The square of one direction's share of all is beta-distributed.
    beyond = float(stats.beta.sf(min(largest**2 / free, 1.0), 0.5, (free - 1) / 2))
    expected = 1 - (1 - beyond) ** 6
    assert round(200 * found) == pytest.approx(200 * found, abs=1e-9)
    assert found == pytest.approx((199 * expected + 1) / 200, abs=4 * np.sqrt(expected * (1 - expected) / 199) + 1e-9)


@pytest.mark.parametrize("rate", [1000.0, 250.0, 40.0])
def test_the_band_lets_through_half_at_its_edge(rate: float) -> None:
    """A wave well below 6 Hz passes as it is, in step; at 6 Hz half of it, at twice that nothing."""
    time = np.arange(int(8 * rate)) / rate
    for hertz, passes in ((0.7, 1.0), (2.0, 1.0), (BAND, 0.5), (2 * BAND, 0.0)):
        passed = low_pass(np.sin(2 * np.pi * hertz * time)[:, None], rate)[:, 0]
        kept = thinned(time, rate)
        np.testing.assert_allclose(passed, passes * np.sin(2 * np.pi * hertz * kept), atol=0.02)


@pytest.mark.parametrize("rate", [250.0, 40.0, 8.0])
def test_a_step_passes_the_band_as_said(rate: float) -> None:
    time = np.arange(int(8 * rate)) / rate
    passed = low_pass((time >= 3.0)[:, None].astype(float), rate)[:, 0]
    kept = thinned(time, rate, BAND)
    # The step is between two samples.
    np.testing.assert_allclose(passed_step(kept - 3.0, rate), passed, atol=1e-12)


def test_what_lost_samples_add_is_the_way_of_the_link() -> None:
    """A link at constant speed: so much behind, from the moment on."""
    time = np.arange(100) / 100.0
    log = JointLog(1, time, np.zeros(100), np.full(100, 0.5), np.zeros(100), 0.5 * time, 1.0)
    told = np.where(time >= 0.4, 0.5 * (time + 0.03), 0.5 * time)
    early = JointLog(1, time, log.torque, log.speed, log.angle - told, log.angle, 1.0)
    added = LostSamples().log_contribution(early, np.array([-0.03, 0.4]))
    np.testing.assert_allclose(added, np.where(time >= 0.4, -0.015, 0.0), atol=1e-12)
