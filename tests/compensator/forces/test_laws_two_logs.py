"""Two logged passes of one program: passes that agree pass, each way in which one log is wrong is named.

The forces are drawn, not milled: a smooth force along a slot, there and back, and what a second pass changes of it: wear,
another engagement in places, noise.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.forces.placement import place_forces, read_force_log
from compensator.forces.target_forces import TargetForces
from compensator.forces.two_logs import _more, compared
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError, Refused
from identification.model.cell import read_cell

COUNT = 60
SWAPPED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
TURNED = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> RobotPath:
    folder = tmp_path_factory.mktemp("cell")
    (folder / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    moves = "\n".join(f"MoveL [[{1000 + 4 * min(k, 59 - k)},{0 if k < 30 else 30},700],[0.02522428,-0.00054983,-0.99944426,"
                      "0.02178562],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,z0,tSpindle;" for k in range(COUNT))
    program = f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n"
    return robot_path(read_rapid(program.encode(), "m.mod").toolpath, read_cell(folder / "cell.yaml"))


def force(rng: np.random.Generator) -> np.ndarray:
    """(COUNT, 3) [N]: air at both ends, else a steady part that turns with the feed, and one that wanders."""
    back = np.where(np.arange(COUNT) < 30, 1.0, -1.0)[:, None]
    wander = np.column_stack([np.interp(np.arange(COUNT), np.linspace(0, COUNT, 12), rng.normal(0, 60, 12)) for _ in range(3)])
    shown = back * rng.normal(0, 120, 3) + wander + [0, 0, -80]
    shown[[0, 1, 58, 59]] = 0
    return np.asarray(shown)


def second_pass(first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The same cut again: 15 % of wear and 5 % from place to place."""
    return np.asarray(first * rng.uniform(0.9, 1.15) * (1 + 0.05 * rng.standard_normal((COUNT, 1))))


def placed(shown: np.ndarray, path: RobotPath, file: Path, rng: np.random.Generator, moved: float = 0.0) -> TargetForces:
    """A log of 12 samples a target by path length [mm], 3 N of noise; moved [mm] along the path."""
    along = 1e3 * path.length
    place = np.linspace(along[0], along[-1], 12 * COUNT)
    values = np.column_stack([np.interp(place - moved, along, axis) for axis in shown.T]) + rng.normal(0, 3, (len(place), 3))
    np.savetxt(file, np.column_stack([place, values]), "%.4f", ",", header="path_mm,fx_n,fy_n,fz_n", comments="")
    return place_forces(read_force_log(file), path, path.cell, tare=(0, 1), trust_tare=True)


def two(path: RobotPath, folder: Path, seed: int, change=lambda shown: shown, moved: float = 0.0):
    rng = np.random.default_rng(seed)
    first = force(rng)
    return (placed(first, path, folder / "one.csv", rng),
            placed(change(second_pass(first, rng)), path, folder / "two.csv", rng, moved))


def test_two_passes_of_one_cut_agree(path: RobotPath, tmp_path: Path) -> None:
    """None of twenty is refused; that single targets differ is said of one at most."""
    warned = 0
    for seed in range(100, 120):
        findings = compared(*two(path, tmp_path, seed), path)
        assert (findings[0].code, findings[0].level) == ("CS3115", "note")
        assert {finding.code for finding in findings[1:]} <= {"CS3116"}
        warned += len(findings) > 1
    assert warned <= 1


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("code", "change", "words"), [
    ("CS3110", lambda shown: -shown, "the opposite sign"),
    ("CS3111", lambda shown: shown @ SWAPPED.T, "x y z of one as y x z of the other"),
    ("CS3111", lambda shown: shown @ TURNED.T, r"axes turned by 5[1-5] deg(?! and)"),
    ("CS3111", lambda shown: shown @ Rotation.from_euler("z", 34, degrees=True).as_matrix() * [1, 1, -1],
     "axes turned by 3[2-6] deg and mirrored"),
    ("CS3114", lambda shown: force(np.random.default_rng(77)), "no sign, frame"),
])
def test_a_log_read_wrongly_is_refused_by_name(
    path: RobotPath, tmp_path: Path, seed: int, code: str, change, words: str
) -> None:
    """Where the forces are nearly alike in the axes that are mixed up, as a warning."""
    try:
        findings = list(compared(*two(path, tmp_path, seed, change), path))
    except Refused as refused:
        findings = list(refused.findings)
    [said] = [finding for finding in findings if finding.code == code]
    assert said.level != "note"
    assert re.search(words, said.message)


@pytest.mark.parametrize("second", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_a_log_displaced_along_the_path_is_named(path: RobotPath, tmp_path: Path, seed: int, second: bool) -> None:
    """By 12 mm, three targets, too far on: placed so much further the other one would be as far off."""
    logs = two(path, tmp_path, seed, moved=12.0)
    try:
        findings = list(compared(*(logs if second else logs[::-1]), path))
    except Refused as refused:
        findings = list(refused.findings)
    [said] = [finding for finding in findings if finding.code == "CS3112"]
    assert said.level in ("warning", "error")
    assert f"{'the first' if second else 'the second'} placed" in said.message
    assert 8 < float(said.message.split("placed ")[1].split(" mm")[0]) < 16


@pytest.mark.parametrize("constant", [150.0, 400.0])
def test_a_tare_in_a_cut_of_one_of_them_is_named(path: RobotPath, tmp_path: Path, constant: float) -> None:
    """A constant on every target that cuts, which a tare elsewhere takes off wrongly."""
    def biased(shown: np.ndarray) -> np.ndarray:
        return shown + np.where(shown.any(axis=1), 1.0, 0.0)[:, None] * [0, constant, 0]

    try:
        findings = list(compared(*two(path, tmp_path, 3, biased), path))
    except Refused as refused:
        findings = list(refused.findings)
    [said] = [finding for finding in findings if finding.code == "CS3113"]
    assert (said.level, said.file) == ("error" if constant == 400 else "warning", str(tmp_path / "two.csv"))
    less = re.search(r"a constant of (-?\d+) (-?\d+) (-?\d+) N less in the second", said.message)
    assert less is not None
    np.testing.assert_allclose([float(one) for one in less.groups()], [0, constant, 0], atol=25)


def test_targets_that_differ_are_told(path: RobotPath, tmp_path: Path) -> None:
    def chipped(shown: np.ndarray) -> np.ndarray:
        shown = shown.copy()
        shown[20:24] += [0, 150, 0]
        return shown

    [said] = [finding for finding in compared(*two(path, tmp_path, 5, chipped), path) if finding.code == "CS3116"]
    assert said.level == "warning"
    low, high = (int(word) for word in said.message.split("(")[1].split(")")[0].split(",")[0].split(" to "))
    assert 19 <= low <= 21
    assert 22 <= high <= 24


def test_moments_hide_no_force_that_differs(path: RobotPath, tmp_path: Path) -> None:
    """What differs is held against a share of the largest force [N]; moments [N m], however large, are none."""
    def chipped(shown: np.ndarray) -> np.ndarray:
        shown = shown.copy()
        shown[20:24] += [0, 150, 0]
        return shown

    first, second = two(path, tmp_path, 5, chipped)
    turned = np.hstack([second.wrench[:, :3], np.full((COUNT, 3), 1e5)])
    said = {finding.code for finding in compared(first, replace(second, wrench=turned), path)}
    assert "CS3116" in said


@pytest.mark.parametrize("common", [5, 6])
def test_logs_with_hardly_a_target_in_common_are_not_compared(path: RobotPath, tmp_path: Path, common: int) -> None:
    first, second = two(path, tmp_path, 1)
    samples = np.where((np.arange(COUNT) >= 10) & (np.arange(COUNT) < 10 + common), second.samples, 0)
    if common == 6:
        assert compared(first, replace(second, samples=samples), path)[0].code == "CS3115"
        return
    with pytest.raises(Refused) as refused:
        compared(first, replace(second, samples=samples), path)
    [said] = refused.value.findings
    assert (said.code, said.file) == ("CS3114", str(tmp_path / "two.csv"))
    assert "have 5 targets with force in common, too few to compare" in said.message


def test_one_log_twice_is_an_error(path: RobotPath, tmp_path: Path) -> None:
    first, _ = two(path, tmp_path, 1)
    with pytest.raises(CompstiffError, match="CS3118"):
        compared(first, first, path)


def test_a_constant_besides_is_that_of_least_squares() -> None:
    """One factor for all axes and a constant for each, against SciPy's general solver; forces of one sign alone say no more."""
    rng = np.random.default_rng(40)
    a = rng.normal([40, -150, 20], 90, (COUNT, 3))
    b = 0.8 * a + rng.normal([12, 70, -33], 5, (COUNT, 3))
    columns = np.column_stack([a.ravel(), np.tile(np.eye(3), (COUNT, 1))])
    solution = np.linalg.lstsq(columns, b.ravel(), rcond=None)[0]
    found = _more(a, b)
    assert found.left == pytest.approx(np.sum((b.ravel() - columns @ solution) ** 2) / np.sum(b**2), rel=1e-9)
    assert found.text.startswith("a constant of " + " ".join(f"{x:.0f}" for x in solution[1:]) + " N")
    assert _more(a, -b).left == np.inf
