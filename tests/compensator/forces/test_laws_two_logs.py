"""Two logged passes of one program: passes that agree pass, each way in which one log is wrong is named.

The forces are drawn, not milled: a smooth force along a slot, there and back, and what a second pass changes of it: wear,
another engagement in places, noise.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

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


def unlike(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Two sets of forces (count, 3) without a pattern, of mean zero and energy one, neither with anything of the other."""
    drawn = np.random.default_rng(seed).normal(size=(count, 3, 2))
    basis = np.linalg.qr((drawn - drawn.mean(axis=0)).reshape(3 * count, 2))[0]
    return basis[:, 0].reshape(count, 3), basis[:, 1].reshape(count, 3)


A, E = unlike(COUNT, 3116)


def given(path: RobotPath, shown: np.ndarray, name: str, error: float = 0.0) -> TargetForces:
    """Such a force (COUNT, 3) [N] at each target, with a standard error [N] of each axis."""
    return TargetForces(np.hstack([shown, np.zeros((COUNT, 3))]), np.ones(COUNT, dtype=np.intp), np.full((COUNT, 3), error),
                        np.ones(COUNT, dtype=bool), None, (), SimpleNamespace(source=name), None, None)


def said_of(path: RobotPath, first: np.ndarray, second: np.ndarray, error: float = 0.0) -> list[tuple[str, str, str]]:
    """Code, level and message of all that is said."""
    try:
        found = compared(given(path, first, "a.csv", error), given(path, second, "b.csv", error), path)
    except Refused as refused:
        found = list(refused.findings)
    assert all(one.file == ("m.mod" if one.code == "CS3116" else "b.csv") for one in found)
    return [(one.code, one.level, one.message) for one in found]


@pytest.mark.parametrize(("left", "said"), [(0.248, "CS3115"), (0.252, "CS3114")])
def test_logs_of_which_a_quarter_differs_are_of_two_jobs(path: RobotPath, left: float, said: str) -> None:
    """Of the energy of the second: its force is that of the first, and something else that no reading tells."""
    found = said_of(path, 1000 * A, 1000 * (np.sqrt(1 - left) * A + np.sqrt(left) * E))
    assert found[0] == {
        "CS3115": (said, "note", "a.csv and b.csv agree at 60 targets: the force of the second is "
                   f"{np.sqrt(1 - left):.2f} times that of the first, and {100 * left:.1f} % of its energy differs"),
        "CS3114": (said, "error", f"a.csv and b.csv do not agree: {100 * left:.0f} % of the force of one is not that of the "
                   "other, and no sign, frame, displacement or zero mends it")}[said]


@pytest.mark.parametrize(("left", "said"), [(0.118, "CS3110"), (0.122, "CS3114")])
def test_a_reading_that_leaves_an_eighth_is_not_what_is_wrong(path: RobotPath, left: float, said: str) -> None:
    [(code, level, message)] = said_of(path, 1000 * A, 1000 * (-np.sqrt(1 - left) * A + np.sqrt(left) * E))
    assert (code, level) == (said, "error")
    assert message == "a.csv and b.csv do not agree: 100 % of the force of one is not that of the other" + (
        f"; the opposite sign of one of them leaves {100 * left:.0f} %" if said == "CS3110" else
        ", and no sign, frame, displacement or zero mends it")


PERMUTED = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


@pytest.mark.parametrize(("turn", "how"), [
    (PERMUTED, "x y z of one as -y x z of the other"),
    # A cosine of 0.95 is one of 18.2 degrees; so little besides an exchange is not told, and alone it is a turn.
    (PERMUTED @ Rotation.from_euler("z", 17.7, degrees=True).as_matrix(), "x y z of one as -y x z of the other"),
    (PERMUTED @ Rotation.from_euler("z", 18.7, degrees=True).as_matrix(), "axes turned by 109 deg"),
    (Rotation.from_euler("z", 17.7, degrees=True).as_matrix(), "axes turned by 18 deg"),
    (Rotation.from_euler("x", 140, degrees=True).as_matrix(), "axes turned by 140 deg"),
    (Rotation.from_rotvec(np.radians(75) * np.array([0.6, 0, 0.8])).as_matrix(), "axes turned by 75 deg"),
    # A mirror square to the axis of turning.
    (Rotation.from_euler("z", 130, degrees=True).as_matrix() * [1, 1, -1], "axes turned by 130 deg and mirrored")])
def test_other_axes_are_told_as_they_are(path: RobotPath, turn: np.ndarray, how: str) -> None:
    """b = turn a, of an error or, where the turn is small, of a warning."""
    codes = {code: message for code, _, message in said_of(path, 1000 * A, 1200 * A @ turn.T)}
    assert how in codes["CS3111"]
    assert ("and mirrored" in codes["CS3111"]) == ("and mirrored" in how)


@pytest.mark.parametrize(("factor", "level"), [(0.674, "note"), (0.666, "warning"), (1.494, "note"), (1.506, "warning")])
def test_a_second_pass_of_half_as_much_again_is_a_warning(path: RobotPath, factor: float, level: str) -> None:
    [(code, found, message)] = said_of(path, 1000 * A, 1000 * factor * A + 1e-3 * E)
    assert (code, found) == ("CS3115", level)
    assert f"the force of the second is {factor:.2f} times that of the first, and 0.0 % of its energy differs" in message


@pytest.mark.parametrize(("more", "left", "said"), [(0.0205, 0.0, True), (0.0195, 0.0, False), (0.1, 0.045, True),
                                                    (0.1, 0.052, False)])
def test_a_constant_is_told_of_logs_that_agree_roughly_where_it_halves_what_differs(
    path: RobotPath, more: float, left: float, said: bool
) -> None:
    """Logs of which over a fiftieth differs: by a constant, of which `left` of the energy is not."""
    constant = np.sqrt((more - left) / COUNT) * np.array([0.6, 0, 0.8])
    found = said_of(path, 1000 * A, 1000 * (np.sqrt(1 - more) * A + np.sqrt(left) * E + constant))
    assert [one for one in found if one[0] not in ("CS3115", "CS3116")] == ([(
        "CS3113", "warning", f"a.csv and b.csv agree better with a constant of {600 * np.sqrt((more - left) / COUNT):.0f} 0 "
        f"{800 * np.sqrt((more - left) / COUNT):.0f} N less in the second (base frame): {100 * left:.1f} % differs in place of "
        f"{100 * more:.1f} %")] if said else [])


@pytest.mark.parametrize(("newton", "largest", "factor", "errors", "said"), [
    # 5 N where forces are small; a fifth of the largest of the second; 5 sigma of both, each of three axes, by their factor.
    (4.9, 10.0, 1.0, (0, 0), False), (5.1, 10.0, 1.0, (0, 0), True), (39.5, 200.0, 1.0, (0, 0), False),
    (41.2, 200.0, 1.0, (0, 0), True), (41.2, 200.0, 1.0, (3.5, 3.5), False), (41.2, 200.0, 1.0, (3.3, 3.3), True),
    (27.4, 100.0, 0.5, (5.0, 2.0), False), (28.1, 100.0, 0.5, (5.0, 2.0), True)])
def test_a_target_differs_by_newtons_a_share_and_its_scatter(
    path: RobotPath, newton: float, largest: float, factor: float, errors: tuple[float, float], said: bool
) -> None:
    """Six targets apart, of which one has the most, and two beside each other at the end; sqrt(6) x 3.36 N x 5 is 41.2 N, and
    sqrt(3) x sqrt(2^2 + 2.5^2) N x 5 is 27.7. What the one log does not have is not compared."""
    shown = np.tile([0.0, largest, 0.0], (COUNT, 1))
    first, second = given(path, shown / factor, "a.csv", errors[0]), given(path, shown, "b.csv", errors[1])
    apart, wrench = [3, 7, 11, 15, 19, 58, 59], second.wrench.copy()
    wrench[apart, 0] = [*[newton] * 3, newton + 0.05, *[newton] * 3]
    samples = np.where(np.arange(COUNT) == 30, 0, second.samples)
    second = replace(second, wrench=np.where(samples[:, None] > 0, wrench, 0.0), samples=samples, forced=samples > 0)
    found = [one for one in compared(first, second, path) if one.code == "CS3116"]
    assert [(one.level, one.target, one.line, one.message) for one in found] == ([(
        "warning", 15, 18, "the forces of the two logs differ beyond their scatter at 7 targets (3, 7, 11, 15, 19 ...), most "
        f"at target 15, by {newton + 0.05:.0f} N")] if said else [])


def test_what_differs_stands_in_runs(path: RobotPath) -> None:
    shown = np.tile([0.0, 100.0, 0.0], (COUNT, 1))
    other = shown.copy()
    other[[0, 1, 2, 9, 40, 41, 57, 59], 2] = 30.0
    [found] = [one for one in said_of(path, shown, other) if one[0] == "CS3116"]
    assert "at 8 targets (0 to 2, 9, 40 to 41, 57, 59), most at target 0, by 30 N" in found[2]


@pytest.mark.parametrize(("share", "code"), [(0.248, "CS3112"), (0.27, "CS3114")])
def test_a_place_is_looked_for_within_a_quarter_of_the_path(path: RobotPath, share: float, code: str) -> None:
    """The path is 262 mm long; a short wave of force, at so much of it too far on in the second log."""
    there, moved = (np.column_stack([np.exp(-0.5 * ((1e3 * path.length - aside - at) / 9) ** 2) * size for at, size in (
        (95, 300), (105, -200), (88, 150))]) for aside in (0.0, share * 1e3 * np.ptp(path.length)))
    [(found, level, message)] = said_of(path, there, moved)
    assert (found, level) == (code, "error")
    if code == "CS3112":
        far = float(message.split("the first placed ")[1].split(" mm further along the path leaves")[0])
        assert far == pytest.approx(262 * share, abs=262 / 240 + 0.5)


@pytest.mark.parametrize("last", [0, 9])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_log_without_a_force_where_the_other_has_one_agrees_with_nothing(path: RobotPath, last: int, swapped: bool) -> None:
    """A pass in the air, or one that cut at the last nine of sixty targets alone: no sign, and no place along the path."""
    there, none = 1000 * A, 1000 * A * (np.arange(COUNT) >= COUNT - last)[:, None]
    [(code, level, message)] = said_of(path, none, there) if swapped else said_of(path, there, none)
    assert (code, level) == ("CS3114", "error")
    assert message.endswith("and no sign, frame, displacement or zero mends it")


@pytest.mark.parametrize(("thin", "told"), [(0.0018, False), (0.0022, True)])
def test_forces_along_one_line_tell_no_other_axes(path: RobotPath, thin: float, told: bool) -> None:
    """Square to each other, their energies in this ratio: singular values of b^T a are so, too, of b turned by a quarter."""
    along, across = np.linalg.qr(np.random.default_rng(4).normal(size=(COUNT, 2)))[0].T
    first = 1000 * np.column_stack([along, np.sqrt(thin) * across, 0 * along])
    second = first @ Rotation.from_euler("z", 90, degrees=True).as_matrix().T
    assert [code for code, _, _ in said_of(path, first, second)] == ["CS3111" if told else "CS3114"]
