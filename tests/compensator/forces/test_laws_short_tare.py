"""A zero that is the mean of a few samples is off by their noise, and is said to be."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.forces.log import read_force_log
from compensator.forces.placement import place_forces
from compensator.forces.target_forces import TargetForces
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import Zero, zero_of
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.model.cell import read_cell
from tests.compensator.forces.test_contract_placement import CELL, QUATERNION, log_text

NOISE, PUSH, ZERO = 3.0, 60.0, np.array([-7.0, 12.0, 4.0])
# Four moves in the air and twelve in the cut [mm], about whose ends stand so many samples each but at the first target.
PLACES, SAMPLES = np.cumsum([0.0, 30, 30, 30, *[10] * 12, 30, 30]), 10
AIR = np.isin(np.arange(len(PLACES)), [0, 1, 2, 3, 16, 17])


def program(folder: Path) -> RobotPath:
    moves = "\n".join(
        f"Move{'L' if i else 'J'} [[{1000 + x:g},0,700],[{','.join(map(str, QUATERNION))}],[-1,-1,-1,0],"
        f"[9E9,9E9,9E9,9E9,9E9,9E9]],[{100 if air else 10},500,5000,1000],z0,tSpindle;"
        for i, (x, air) in enumerate(zip(PLACES, AIR, strict=True)))
    (folder / "cell.yaml").write_text(CELL)
    return robot_path(read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath,
                      read_cell(folder / "cell.yaml"))


def logged(folder: Path, path: RobotPath, tare_samples: int, seed: int) -> TargetForces:
    """By path length, so many samples at the first target, which is the tare."""
    count = np.where(np.arange(len(PLACES)) == 0, tare_samples, SAMPLES)
    target = np.repeat(np.arange(len(PLACES)), count)
    noise = np.random.default_rng((seed, 5)).normal(0, NOISE, (len(target), 3))
    force = np.outer(~AIR[target], [PUSH, 0.0, 0.0]) + ZERO + noise
    rows = "\n".join(f"{PLACES[k] - 1 + j:.3f},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}" for k, j, f in zip(
        target, np.concatenate([np.linspace(1 if k == 0 else 0, 1, n) for k, n in enumerate(count)]), force, strict=True))
    (folder / "forces.csv").write_text(f"path_mm,fx_n,fy_n,fz_n\n{rows}\n")
    return place_forces(read_force_log(folder / "forces.csv"), path, path.cell, tare=(0, 0), trust_tare=True)


@pytest.mark.parametrize("tare_samples", [1, 3, 30])
def test_the_zero_is_as_far_off_as_its_samples_scatter(tmp_path: Path, tare_samples: int) -> None:
    """Over 60 logs; of one sample by as much as the moves in the air beside it do. The moves in the air are no cut."""
    path, off, stated, in_air = program(tmp_path), [], [], 0
    for seed in range(60):
        forces = logged(tmp_path, path, tare_samples, seed)
        assert forces.tare is not None
        off.append(forces.tare[:3] - ZERO)
        stated.append(forces.zero_std)
        in_air += int(forces.forced[AIR].sum())
        assert forces.forced[~AIR].all()
    assert 0.75 < np.sqrt(np.mean(np.square(off)) / np.mean(np.square(stated))) < 1.35
    assert np.std(stated) < 0.5 * np.mean(stated)
    assert in_air <= 0.03 * 60 * AIR.sum()


@pytest.mark.parametrize(("tare_samples", "level"), [(1, "warning"), (7, "warning"), (8, "note"), (30, "note")])
def test_a_zero_of_a_few_samples_is_said(tmp_path: Path, tare_samples: int, level: str) -> None:
    [said] = [finding for finding in logged(tmp_path, program(tmp_path), tare_samples, 1).findings if finding.code == "CS3008"]
    assert said.level == level
    if level == "warning":
        assert f"{tare_samples} sample{'s' * (tare_samples > 1)} of targets 0 to 0" in said.message
        two_sigma = float(said.message.split("known to +-")[1].split(" N")[0])
        assert two_sigma == pytest.approx(2 * NOISE / np.sqrt(tare_samples), rel=0.3)
    assert bool(said.hint) == (level == "warning")


def test_a_short_stretch_beside_a_long_one_makes_a_zero_as_unsure_as_it_is(tmp_path: Path) -> None:
    """The stretches count alike, whatever they drifted between: one sample before the cut and 200 behind it are known to half
    the noise of the one, not to that of 201. The short one is named; without it the zero is sure."""
    path, off, stated = program(tmp_path), [], []
    for seed in range(40):
        target = np.repeat([0, *range(4, 16), 17], [1, *[SAMPLES] * 12, 200])
        noise = np.random.default_rng((seed, 6)).normal(0, NOISE, (len(target), 3))
        rows = np.column_stack([target, np.outer(~AIR[target], [PUSH, 0.0, 0.0]) + ZERO + noise])
        (tmp_path / "forces.csv").write_text(log_text("target,fx_n,fy_n,fz_n", rows))
        log = read_force_log(tmp_path / "forces.csv")
        forces = place_forces(log, path, path.cell, tare=[(0, 0), (17, 17)], trust_tare=True)
        assert forces.tare is not None
        off.append(forces.tare[:3] - ZERO)
        stated.append(forces.zero_std)
    assert 0.75 < np.sqrt(np.mean(np.square(off)) / np.mean(np.square(stated))) < 1.3
    [said] = [finding for finding in forces.findings if finding.code == "CS3008"]
    assert said.level == "warning"
    assert "mean of 201 samples of targets 0 to 0, 17 to 17" in said.message
    assert float(said.message.split("known to +-")[1].split(" N")[0]) == pytest.approx(NOISE, rel=0.3)
    assert said.hint.endswith("leave targets 0 to 0 out, a stretch of 1 sample that counts as much as each other one")
    left = place_forces(log, path, path.cell, tare=(17, 17), trust_tare=True)
    assert [one.level for one in left.findings if one.code == "CS3008"] == ["note"]
    assert left.zero_std < 0.25 * forces.zero_std


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    return program(tmp_path_factory.mktemp("program"))


def tared(
    path: RobotPath, loads: list[np.ndarray], targets: list[int], tare: list[tuple[int, int]], weight: float = 1.0
) -> Zero:
    """The zero of a log with these rows (n, 6) at each of these targets, a row the mean of so many samples."""
    target = np.repeat(targets, [len(each) for each in loads])
    rows = TargetRows(len(PLACES), target, np.full(len(target), weight))
    log: Any = SimpleNamespace(source="log.csv", has_moment=True)
    return zero_of(log, path, path.cell, np.concatenate(loads), rows, tare, trusted=True)


def rows(count: int, seed: int) -> np.ndarray:
    """Noise (count, 6) that drifts, about a zero."""
    rng = np.random.default_rng((seed, 9))
    return rng.normal(0, 3, (count, 6)) + np.cumsum(rng.normal(0, 0.5, (count, 6)), axis=0) + [5, -3, 2, 1, 1, 1]


def scattered(values: np.ndarray, groups: int) -> np.ndarray:
    """The covariance (6, 6) of the mean of so many equal groups of neighbours, by their scatter."""
    return np.asarray(np.cov(values.reshape(groups, -1, 6).mean(axis=1), rowvar=False) / groups)


def squared(values: np.ndarray, groups: int) -> np.ndarray:
    """Its variance (6,)."""
    return np.diag(scattered(values, groups))


def sure(found: Zero, variance: np.ndarray, samples: float) -> None:
    """The zero is as sure as this variance (6,) of a mean of so many samples says: in all of them, and along the axes of force
    and of moment, root mean square."""
    assert found.noise == pytest.approx(np.sqrt(variance * samples), rel=1e-9)
    assert found.own_std == pytest.approx(np.sqrt(variance[:3].mean()), rel=1e-9)
    assert found.spread is not None
    assert [np.diag(part).reshape(2, 3).mean(axis=1) for part in found.spread] == [
        pytest.approx(times * variance.reshape(2, 3).mean(axis=1), rel=1e-9) for times in (samples, 1.0)]


@pytest.mark.parametrize(("count", "groups"), [(256, 32), (320, 32), (120, 30), (36, 9)])
def test_the_zero_of_a_long_stretch_is_as_sure_as_its_batches_scatter(path: RobotPath, count: int, groups: int) -> None:
    """32 of them at most, of four rows at least; so many rows of ten samples each make the same of it."""
    values = rows(count, count)
    for weight in (1.0, 10.0):
        found = tared(path, [values], [1], [(1, 1)], weight)
        assert found.bias == pytest.approx(values.mean(axis=0), rel=1e-12)
        covariance = scattered(values, groups)
        sure(found, np.diag(covariance), weight * count)
        # Eight more degrees of freedom say that the axes are alike, and scatter by themselves.
        alike = np.diag(np.repeat(np.diag(covariance).reshape(2, 3).mean(axis=1), 3))
        expected = ((groups - 1) * covariance + 8 * alike) / (groups + 7)
        assert found.spread is not None
        np.testing.assert_allclose(found.spread[1], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found.spread[0], weight * count * expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("weight", [1.0, 10.0])
def test_of_few_batches_the_scatter_of_the_samples_stands_in_for_the_missing_ones(path: RobotPath, weight: float) -> None:
    """Twelve rows are three batches: two degrees of freedom of eight, and six of the samples themselves."""
    values = rows(12, 3)
    expected = (2 * squared(values, 3) + 6 * squared(values, 12)) / 8
    sure(tared(path, [values], [1], [(1, 1)], weight), expected, 12 * weight)


@pytest.mark.parametrize("weight", [1.0, 10.0])
@pytest.mark.parametrize("beside", [6, 5])
def test_of_a_very_short_stretch_the_rows_beside_it_in_the_air_tell(path: RobotPath, beside: int, weight: float) -> None:
    """Three rows: two degrees of freedom, and six by how far neighbours in the air differ, in the middle: the median of |x - y|
    is 0.6745 sqrt(2) sigma. That takes eight pairs, of nine rows with these; of seven the three are all that is known. Rows of
    the last air move before the cut, and of the cut, are not asked."""
    values, others = rows(3, 4), rows(beside, 5)
    found = tared(path, [values, others, 50 * rows(40, 6), 90 * rows(60, 7)], [0, 2, 3, 7], [(0, 0)], weight)
    steps = np.abs(np.diff(np.concatenate([values, others]), axis=0))
    own = squared(values, 3)
    of_steps = 0.5 * (np.median(steps, axis=0) / 0.6745) ** 2 / 3
    expected = (2 * own + 6 * of_steps) / 8 if beside == 6 else own
    sure(found, expected, 3 * weight)


def test_stretches_count_alike_in_the_zero_and_in_how_sure_it_is(path: RobotPath) -> None:
    """64 and 256 rows: 16 batches and 32, of one noise; half of each mean."""
    short, long = rows(64, 1), rows(256, 2)
    found = tared(path, [short, long], [1, 17], [(1, 1), (17, 17)])
    assert found.bias == pytest.approx(0.5 * (short.mean(axis=0) + long.mean(axis=0)), rel=1e-12)
    # One noise of a sample by the scatter of both, each about its own mean.
    noise = (15 * 64 * squared(short, 16) + 31 * 256 * squared(long, 32)) / 46
    sure(found, noise * (1 / 64 + 1 / 256) / 4, 4 / (1 / 64 + 1 / 256))
