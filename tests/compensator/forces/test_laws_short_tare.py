"""A zero that is the mean of a few samples is off by their noise, and is said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.forces.log import read_force_log
from compensator.forces.placement import place_forces
from compensator.forces.target_forces import TargetForces
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
