"""Whole revolutions: what repeats each revolution goes, an edge stays, and the spindle's speed is found where it shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from compensator.forces import log as force_log
from compensator.forces import revolutions
from compensator.forces.log import ForceLog, read_force_log
from identification.model.cell_file import ForceLogFile
from tests.support import long
from tests.virtual_cell.endmill import EndMill

RATE = 25600.0


def cutting(rpm: float, count: int, rate: float, *, teeth: int = 3, runout: float = 0.15, seed: int = 0) -> np.ndarray:
    """Forces (count, 3) [N] of interrupted cuts: each tooth a half-sine pulse, one tooth larger; mean 1 by construction.

    A generator that knows nothing of spectra: pulses in the spindle's angle, averaged over the sampling interval.
    """
    fine = 16
    angle = 2 * np.pi * rpm / 60 * (np.arange(count * fine) + 0.5) / (fine * rate) + seed
    force = np.zeros(count * fine)
    for tooth in range(teeth):
        phase = np.mod(angle - 2 * np.pi * tooth / teeth, 2 * np.pi)
        force += (1 + runout * (tooth == 0)) * np.where(phase < 2.0, np.sin(np.pi * phase / 2.0), 0.0)
    force = force.reshape(count, fine).mean(axis=1)
    mean = (teeth + runout) * (2.0 * 2 / np.pi) / (2 * np.pi)
    return np.outer(force / mean, [120.0, -200.0, 60.0])


def written(path: Path, force: np.ndarray, rate: float, columns: dict | None = None) -> Path:
    import pandas as pd

    data = {"time_s": np.arange(len(force)) / rate, "path_mm": np.arange(len(force)) * 0.4e-3} | (columns or {})
    pd.DataFrame(data | {f"f{axis}_n": force[:, k] for k, axis in enumerate("xyz")}).to_parquet(path)
    return path


def codes(log: ForceLog) -> set[str]:
    return {finding.code for finding in log.findings}


@pytest.mark.parametrize("window", [7.0, 10.25, 170.667])
@pytest.mark.parametrize("size", [13, 97, 5000])
def test_moving_mean_in_blocks_is_the_mean_over_the_window(window: float, size: int) -> None:
    """Against a mean worked out sample by sample, gaps and ends included."""
    rng = np.random.default_rng(1)
    load = rng.normal(0, 1, (1500, 3))
    gaps = {400, 405, 1000, 1499}

    def blocks():
        for first in range(0, len(load), size):
            stop = min(first + size, len(load))
            yield load[first:stop], np.array([g - first for g in sorted(gaps) if first <= g < stop], dtype=np.intp)

    found = np.concatenate(list(revolutions.averaged(blocks(), window)))
    expected = np.empty_like(load)
    for low, high in zip([0, *sorted(gaps)], [*sorted(gaps), len(load)], strict=True):
        for i in range(low, high):
            begin = min(max(i + 0.5 - window / 2, low), max(high - window, low))
            end = min(begin + window, high)
            share = np.clip(np.minimum(np.arange(low, high) + 1, end) - np.maximum(np.arange(low, high), begin), 0, 1)
            expected[i] = share @ load[low:high] / share.sum()
    assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("rpm", [9000.0, 8765.4, 23456.0])
def test_tooth_passing_and_runout_are_gone_and_the_edge_stays(tmp_path, rpm: float) -> None:
    """The tool enters the stock half way. Each sample's force is the mean; it rises within one revolution about the edge.

    The bound: a sample stands for the time up to the next, which leaves of a line of amplitude A at m lines a revolution no
    more than A / (2 n) with n samples a revolution.
    """
    count, edge = 40_000, 20_000
    force = cutting(rpm, count, RATE)
    force[:edge] = 0.0
    log = read_force_log(written(tmp_path / "a.parquet", force, RATE), spindle_rpm=rpm)
    assert "CS3027" in codes(log)
    turn = RATE * 60 / rpm
    mean = np.array([120.0, -200.0, 60.0])
    swing = np.ptp(force[edge:], axis=0) / 2
    inside = slice(int(edge + turn / 2 + 2), count)
    assert np.all(np.abs(log.force[inside] - mean).max(axis=0) < swing / (2 * turn))
    assert np.all(np.abs(force[inside] - mean).max(axis=0) > 0.5 * swing)       # which was there before
    assert np.all(np.abs(log.force[: int(edge - turn / 2 - 2)]) < 1e-9)


def test_a_plain_mean_of_a_stretch_is_off_by_what_the_revolutions_are_not(tmp_path) -> None:
    """Stretches of 2.5 revolutions: the plain means swing, those of revolutions do not."""
    rpm, count = 9000.0, 20_000
    force = cutting(rpm, count, RATE)
    length = int(2.5 * RATE * 60 / rpm)
    log = read_force_log(written(tmp_path / "a.parquet", force, RATE), spindle_rpm=rpm)
    whole = count // length * length
    plain, turned = (values[:whole].reshape(-1, length, 3).mean(axis=1)[:, 1] + 200 for values in (force, log.force))
    assert np.abs(plain).max() > 2.0
    assert np.abs(turned).max() < 0.2


@pytest.mark.parametrize(("rpm", "rate", "teeth"), [(9000, 25600.0, 3), (17_432, 25600.0, 2), (5230, 5000.0, 4),
                                                    (12_000, 2000.0, 1)])
@pytest.mark.parametrize("seed", [0, long(1), long(2)])
def test_the_speed_is_found_in_the_spectrum(tmp_path, rpm: float, rate: float, teeth: int, seed: int) -> None:
    count = int(4 * rate)
    rng = np.random.default_rng(seed)
    force = cutting(rpm, count, rate, teeth=teeth, seed=seed) + rng.normal(0, 10, (count, 3))
    force[: count // 3] = rng.normal(0, 10, (count // 3, 3))        # air before the cut
    log = read_force_log(written(tmp_path / "a.parquet", force, rate))
    assert log.revolution is not None
    assert 60 / log.revolution == pytest.approx(rpm, rel=1e-3)
    assert log.rate == pytest.approx(rate, rel=1e-6)


def test_without_runout_the_period_is_the_tooth(tmp_path) -> None:
    """Nothing repeats more slowly then: averaging over a tooth takes the same away."""
    force = cutting(9000, 50_000, RATE, runout=0.0) + np.random.default_rng(0).normal(0, 5, (50_000, 3))
    log = read_force_log(written(tmp_path / "a.parquet", force, RATE))
    assert log.revolution == pytest.approx(60 / 9000 / 3, rel=1e-3)


@pytest.mark.parametrize("kind", ["noise", "ramps", "chatter", "steps"])
def test_no_speed_where_there_is_none(tmp_path, kind: str) -> None:
    """Plain means then, the very samples; and it is said."""
    rng = np.random.default_rng(3)
    count = 40_000
    t = np.arange(count) / RATE
    force = {"noise": rng.normal(0, 20, (count, 3)),
             "ramps": np.outer(np.interp(t, [0, 0.4, 0.9, 1.6], [0, 300, 300, -50]), [1, 0.5, 0]),
             "chatter": np.column_stack([30 * np.sin(2 * np.pi * f * t) for f in (743, 1159, 3931)])
             + rng.normal(0, 5, (count, 3)),
             "steps": np.repeat(rng.normal(0, 100, (80, 3)), 500, axis=0)}[kind]
    log = read_force_log(written(tmp_path / "a.parquet", force, RATE))
    assert log.revolution is None
    assert "CS3028" in codes(log)
    assert np.array_equal(log.force, force)


def test_a_wrong_stated_speed_is_said_and_a_slip_is_taken_up(tmp_path) -> None:
    force = cutting(8960, 60_000, RATE) + np.random.default_rng(0).normal(0, 5, (60_000, 3))
    path = written(tmp_path / "a.parquet", force, RATE)
    slipped = read_force_log(path, ForceLogFile(spindle_rpm=9000))
    assert slipped.revolution == pytest.approx(60 / 8960, rel=2e-4)
    assert "CS3035" not in codes(slipped)
    wrong = read_force_log(path, spindle_rpm=7700)
    assert wrong.revolution == pytest.approx(60 / 7700)
    assert "CS3035" in codes(wrong)


@pytest.mark.parametrize(("stated", "said"), [(9000, False), (150, True)])
def test_turns_a_second_are_said(tmp_path, stated: float, said: bool) -> None:
    """150 a second for 9000 a minute: every line is a multiple of that, too, but a cutter has not so many teeth."""
    force = cutting(9000, 60_000, RATE) + np.random.default_rng(0).normal(0, 5, (60_000, 3))
    log = read_force_log(written(tmp_path / "a.parquet", force, RATE), spindle_rpm=stated)
    assert ("CS3035" in codes(log)) is said


def milled(rpm: float, count: int, rate: float, teeth: int = 3, runout: float = 0.012) -> np.ndarray:
    """Force (count, 3) [N] of the virtual cell's end mill on a wall, samples without a filter, with noise."""
    mill = EndMill(spindle_rpm=rpm, teeth=teeth, runout_mm=(runout, *(teeth - 1) * (0.0,)))
    wall = mill.coverage(-mill.rim_mm[:, 1] - (mill.radius_mm - 1.5))
    force = mill.force(wall, 4.0, 2 * np.pi * rpm / 60 * np.arange(count) / rate)
    return force + np.random.default_rng(1).normal(0, 0.5, force.shape)


@pytest.mark.parametrize(("teeth", "runout", "rate"), [(4, 0.0, 1000.0), (4, 0.0, 500.0), (3, 0.012, 1000.0)])
def test_a_folded_speed_is_ambiguous_unless_stated(tmp_path, teeth: int, runout: float, rate: float) -> None:
    """9000 rpm. Tooth passing at 600 Hz shows at 400 and 100 Hz, as that of 24 000 and 6 000 rpm. Plain means then, and what
    that costs, against the means over 0.1 s that keep most."""
    count = int(6 * rate)
    force = milled(9000, count, rate, teeth, runout)
    path = written(tmp_path / "a.parquet", force, rate)
    log = read_force_log(path)
    assert log.revolution is None
    assert np.array_equal(log.force, force)
    [said] = [finding for finding in log.findings if finding.code == "CS3067"]
    assert said.level == "warning"
    kept = float(said.message.split("keeps up to ")[1].split(" N")[0])
    size = int(0.1 * rate) - 1              # not a whole number of periods
    means = force[:count // size * size].reshape(-1, size, 3).mean(axis=1) - force.mean(axis=0)
    assert 0.4 < np.linalg.norm(means, axis=1).max() / kept < 1.5
    if runout:
        stated = read_force_log(path, spindle_rpm=1.005 * 9000)
        assert stated.revolution == pytest.approx(60 / 9000, rel=1e-3)
        assert "CS3035" not in codes(stated)


@pytest.mark.parametrize(("rpm", "rate"), [(9000, 4000.0), (8743, 2000.0), (8743, 1000.0)])
def test_folded_lines_do_not_make_a_slow_spindle(tmp_path, rpm: float, rate: float) -> None:
    """Harmonics of tooth passing above half the rate fall between the others, at multiples of 50 Hz or less."""
    log = read_force_log(written(tmp_path / "a.parquet", milled(rpm, int(6 * rate), rate), rate))
    assert log.revolution == pytest.approx(60 / rpm, rel=1e-3)


@pytest.mark.parametrize(("rpm", "rate"), [(2400, 2000.0), (3000, 1000.0), (4800, 2000.0)])
def test_teeth_whose_rate_folds_onto_the_run_out_are_not_taken_for_the_spindle(tmp_path, rpm: float, rate: float) -> None:
    """At 2 kHz multiples of 120 Hz, folded back, fall on every multiple of 40 Hz: three teeth look like a spindle of 7200 rpm.
    Means over a revolution of the one are means over three of the other; those over a tooth would keep the run-out."""
    count, teeth = 24_000, 3
    force = milled(rpm, count, rate, teeth)
    log = read_force_log(written(tmp_path / "a.parquet", force, rate))
    assert log.revolution == pytest.approx(60 / rpm, rel=2e-3)
    assert "CS3067" not in codes(log)
    [said] = [finding for finding in log.findings if finding.code == "CS3242"]
    assert f"{teeth * rpm}" in said.message
    edge = int(rate * 60 / rpm)
    assert (log.force - force.mean(axis=0))[edge:-edge].std(axis=0).max() < 0.1 * force.std(axis=0).max()


@pytest.mark.parametrize("runout", [0.0, 0.012])
def test_that_a_speed_found_may_be_that_of_the_teeth_is_said_unless_it_is_stated(tmp_path, runout: float) -> None:
    path = written(tmp_path / "a.parquet", milled(9000, 24_000, 4000.0, 3, runout), 4000.0)
    [said] = [finding for finding in read_force_log(path).findings if finding.code == "CS3242"]
    assert said.level == "note"
    assert "--spindle-rpm" in said.hint
    assert "CS3242" not in codes(read_force_log(path, spindle_rpm=9000))


@pytest.mark.parametrize(("rpm", "said"), [
    (3000, ("CS3027", "note", "forces averaged over whole revolutions of 20 ms, spindle at 3000.0 rpm (as stated)")),
    (3010, ("CS3028", "warning", "under two samples a revolution (100 Hz at 3010 rpm): plain means were taken")),
    (99, ("CS3027", "warning", "forces averaged over whole revolutions of 606.1 ms, spindle at 99.0 rpm (as stated)")),
    (101, ("CS3027", "note", "forces averaged over whole revolutions of 594.1 ms, spindle at 101.0 rpm (as stated)"))])
def test_a_stated_speed_is_used_from_two_samples_a_revolution_and_a_slow_one_doubted(
    tmp_path: Path, rpm: float, said: tuple[str, str, str]
) -> None:
    force = np.random.default_rng(5).normal(0, 3, (3000, 3))
    log = read_force_log(written(tmp_path / "a.parquet", force, 100.0), spindle_rpm=rpm)
    assert said in [(one.code, one.level, one.message) for one in log.findings]
    assert sum(one.code in ("CS3027", "CS3028") for one in log.findings) == 1
    assert (log.revolution is None) == (said[0] == "CS3028")
    assert np.array_equal(log.force, force) == (said[0] == "CS3028")


@pytest.mark.parametrize(("count", "why"), [(1023, "the log is too short"),
                                            (1024, "no comb of lines stands out of its spectrum")])
def test_a_log_that_is_too_short_for_its_spectrum_is_said_to_be(tmp_path: Path, count: int, why: str) -> None:
    log = read_force_log(written(tmp_path / "a.parquet", np.random.default_rng(5).normal(0, 3, (count, 3)), 1000.0))
    [found] = [one for one in log.findings if one.code == "CS3028"]
    assert (found.level, found.message) == ("note", f"spindle speed not found ({why}): plain means were taken")
    assert "--spindle-rpm" in found.hint


def test_a_stated_speed_without_a_rate_is_not_used_and_said(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("target,fx_n,fy_n,fz_n\n0,1,2,3\n0,2,3,4\n")
    log = read_force_log(tmp_path / "a.csv", spindle_rpm=9000)
    assert log.revolution is None
    assert [(one.level, one.message, one.hint) for one in log.findings if one.code == "CS3028"] == [(
        "warning", "the spindle speed 9000 rpm is stated, but not how fast the log was sampled: plain means were taken",
        "log time_s, or state force_log.rate_hz")]
    rated = read_force_log(tmp_path / "a.csv", ForceLogFile(rate_hz=1000), spindle_rpm=9000)
    assert (rated.revolution, "CS3028" in codes(rated)) == (pytest.approx(1 / 150), False)


@pytest.mark.parametrize("key", ["target", "path_mm", "position"])
def test_a_long_log_kept_as_means_gives_the_same_means(tmp_path, monkeypatch, key: str) -> None:
    """Rows of up to 20 samples; those of a target or a stretch of path never reach over its end."""
    rng = np.random.default_rng(2)
    count = 30_000
    along = np.cumsum(rng.uniform(0, 2e-3, count))
    border = np.linspace(0, along[-1], 41)[1:-1]
    target = np.searchsorted(border, along)
    columns = {"target": {"target": target}, "path_mm": {"path_mm": along},
               "position": {"x_mm": along, "y_mm": 0 * along, "z_mm": 0 * along}}[key]
    force = rng.normal(50, 30, (count, 3))
    import pandas as pd

    pd.DataFrame(columns | {f"f{axis}_n": force[:, k] for k, axis in enumerate("xyz")}).to_parquet(tmp_path / "a.parquet")
    monkeypatch.setattr(force_log, "ROWS", 1500)
    log = read_force_log(tmp_path / "a.parquet", borders=1e-3 * border if key == "path_mm" else None)
    assert len(log.weight) < 1700
    assert log.weight.sum() == count
    assert [(one.level, one.message) for one in log.findings if one.code == "CS3030"] == [
        ("note", f"kept as {len(log.weight)} means of up to 20 consecutive samples")]
    if key == "position":
        monkeypatch.setattr(force_log, "ROWS", count // 2 + 1)       # twice as many as there are fit
        assert "CS3030" not in codes(read_force_log(tmp_path / "a.parquet"))
        assert_allclose(np.average(log.place[:, 0], weights=log.weight), 1e-3 * along.mean(), rtol=1e-12)
        return
    index = log.place.astype(int) if key == "target" else np.searchsorted(1e-3 * border, log.place)
    means = np.array([np.average(log.force[index == k], axis=0, weights=log.weight[index == k]) for k in range(40)])
    assert_allclose(means, [force[target == k].mean(axis=0) for k in range(40)], atol=1e-9)


@pytest.mark.parametrize(("turns", "slope"), [(0.6, 0.0), (1.5, 0.0), (3.0, 0.0), long(12.0, 0.0), (4.5, 1.0), long(12.0, 1.0)])
def test_the_stated_error_of_a_mean_is_that_of_white_noise(tmp_path, turns: float, slope: float) -> None:
    """White noise about a force that is steady, or grows by 200 N in five targets, averaged over revolutions of 40 samples:
    over 150 targets the means scatter as stated."""
    from compensator.forces.placement import place_forces
    from tests.compensator.forces.test_contract_placement import plan

    rng, here = np.random.default_rng(4), plan(tmp_path)
    scatter, stated = [], []
    for _ in range(30):
        count = int(5 * turns * 40)
        path = tmp_path / "forces.csv"
        grows = slope * 200 * (np.arange(count) / count - 0.5)[:, None]
        target = np.arange(count) * 5 // count
        rows = np.column_stack([target, 200 + grows + rng.normal(0, 8, (count, 3))])
        path.write_text("target,fx_n,fy_n,fz_n\n" + "\n".join(",".join(f"{x:.6g}" for x in row) for row in rows))
        forces = place_forces(read_force_log(path, ForceLogFile(rate_hz=4000), spindle_rpm=6000), here,
                              here.cell)
        assert forces.samples.sum() == count
        scatter.append(forces.wrench[1:4, :3] - 200 - np.array([[grows[target == k].mean()] for k in (1, 2, 3)]))
        stated.append(forces.standard_error[1:4])
    ratio = np.sqrt(np.mean(np.square(scatter)) / np.mean(np.square(stated)))
    assert 0.8 < ratio < 1.25


@pytest.mark.parametrize("tare", [None, (0, 0)])
def test_a_target_beside_the_cut_stays_without_force(tmp_path, tare) -> None:
    """The cut begins exactly where the second target's stretch does: no mean over a revolution carries force into the first."""
    from compensator.forces.placement import place_forces
    from tests.compensator.forces.test_contract_placement import plan

    force = cutting(6000, 5 * 400, 4000.0)
    force[:800] = 0
    force += np.random.default_rng(1).normal(0, 0.5, force.shape)
    path = written(tmp_path / "a.parquet", force, 4000.0, {"target": np.arange(2000) // 400})
    here = plan(tmp_path)
    forces = place_forces(read_force_log(path, spindle_rpm=6000), here, here.cell, tare=tare)
    assert forces.forced.tolist() == [False, False, True, True, True]
    assert not forces.wrench[:2].any()
    # Half a revolution of a ramp lies on the other side of the edge: an eighth of a revolution's worth of force.
    lost = 0.125 * 40 / 400
    assert_allclose(forces.wrench[2:, 1], [-200 * (1 - lost), -200, -200], atol=1.0)


@pytest.mark.parametrize(("short", "said"), [((39,), "1 target with force"), ((40,), ""), ((39, 12), "2 targets with force")])
@pytest.mark.parametrize("spindle_rpm", [6000.0, None])
def test_targets_shorter_than_a_revolution_are_told(tmp_path, short: tuple[int, ...], said: str, spindle_rpm: float | None
                                                    ) -> None:
    """A revolution of 6000 rpm is 40 samples at 4 kHz. A target of fewer in the air is no matter, nor one of a log whose
    spindle is not known."""
    from compensator.forces.placement import place_forces
    from tests.compensator.forces.test_contract_placement import plan

    counts = [20, *short, *[80] * (4 - len(short))]
    target = np.repeat(np.arange(5), counts)
    force = np.where(target[:, None] > 0, [0.0, 200, 0], 0.0) + np.random.default_rng(2).normal(0, 0.5, (len(target), 3))
    path, here = written(tmp_path / "a.parquet", force, 4000.0, {"target": target}), plan(tmp_path)
    forces = place_forces(read_force_log(path, spindle_rpm=spindle_rpm), here, here.cell, tare=(0, 0))
    assert forces.forced.tolist() == [False, True, True, True, True]
    found = [one for one in forces.findings if one.code == "CS3029"]
    assert [(one.level, one.file, one.line, one.target) for one in found] == (
        [("note", "m.mod", 4, 1)] if said and spindle_rpm else [])
    assert all(one.message.startswith(f"{said} and less than one revolution of the spindle") for one in found)
