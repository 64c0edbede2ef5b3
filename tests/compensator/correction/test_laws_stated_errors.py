"""What cell.yaml states of the sensor's seat and of the unloaded robot is in the sigma on the part: against turned forces and
drawn errors that know nothing of how it is worked out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.budget import error_budget
from compensator.correction.correct import correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.unloaded_robot import beside_a_rigid_motion
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_landing import SENSOR
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import IRB6660, TOOL, Job, K

PATH, STD = line(3, 40), 2.0
FORCE, MOMENT = np.array([70.0, 220.0, -90.0]), np.array([11.0, -6.0, 4.0])       # at the TCP, base frame
SEAT = f"""force_log:
  frame: sensor
  sensor_position_mm: [{", ".join(f"{v:.9f}" for v in SENSOR.p * 1e3)}]
  sensor_quaternion: [{", ".join(f"{v:.12f}" for v in kit.quaternion(SENSOR.r))}]
"""
FORCES = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},0,200,0\n" for i in range(6))


def origin(q: np.ndarray) -> kit.Frame:
    """The sensor in the base frame."""
    return kit.tcp_pose(IRB6660, q, SENSOR)


def log(moments: bool) -> str:
    """Of the same wrench everywhere, as the sensor shows it: about its own origin, in its own axes."""
    rows = []
    for i, q in enumerate(PATH.q):
        sensor = origin(q)
        about = MOMENT - np.cross(sensor.p - kit.tcp_pose(IRB6660, q, TOOL).p, FORCE)
        row = [*sensor.r.inv().apply(FORCE), *(sensor.r.inv().apply(about) if moments else ())]
        rows.append(f"{i}," + ",".join(f"{value:.12g}" for value in row) + "\n")
    return f"target,fx_n,fy_n,fz_n{',mx_nm,my_nm,mz_nm' if moments else ''}\n" + "".join(rows)


@pytest.mark.parametrize("moments", [True, False], ids=["with moments", "forces alone"])
def test_forces_turned_about_the_sensor_spread_as_stated(tmp_path: Path, moments: bool) -> None:
    """20000 sensors, each turned in its seat; what they show is carried to the TCP and yielded to by an arm of its own."""
    cell = kit.cell_text(extra=SEAT + f"  mounting_std_deg: {STD}\n")
    result = Job(tmp_path, cell=cell, program=PATH.program(), forces=log(moments)).correct("--json", "--keep-targets")
    turns = Rotation.from_rotvec(np.radians(STD) * np.random.default_rng(2).standard_normal((20_000, 3)))
    square = []
    for q in PATH.q:
        away = origin(q).p - kit.tcp_pose(IRB6660, q, TOOL).p
        about = MOMENT - np.cross(away, FORCE)
        shown = np.concatenate([turns.apply(FORCE), np.zeros((20_000, 3))], axis=1)
        if moments:
            shown[:, 3:] = turns.apply(about) + np.cross(away, shown[:, :3])
        yields = np.array([kit.deviation(IRB6660, q, TOOL.p, unit, K) for unit in np.eye(6)])
        truth = np.r_[FORCE, MOMENT if moments else np.zeros(3)]
        square.append(np.mean(np.sum(((shown - truth) @ yields) ** 2, axis=1)))
    stated = result.json["result"]["expected_left_um"]
    assert stated["mounting"] == pytest.approx(1e6 * np.sqrt(np.mean(square)), rel=0.02)
    assert stated["accuracy"] == 0


def test_what_is_not_stated_is_said_to_be_taken_as_exact(tmp_path: Path) -> None:
    """And changes nothing; stated as none it is not said."""
    job = Job(tmp_path, program=line(6, 5).program(), forces=FORCES)
    silent = job.correct("--force", "--json")
    told = job.correct("--force").out
    assert "taken as exact" in told
    assert "mounting_std_deg" in told
    assert "(accuracy)" in told
    left = silent.json["result"]["expected_left_um"]
    assert (left["mounting"], left["accuracy"]) == (0, 0)
    job.cell = kit.cell_text(extra="force_log: {mounting_std_deg: 0}\naccuracy: {position_um: 5}\n")
    assert "taken as exact" not in job.correct("--force").out


@pytest.mark.parametrize("stated", ["accuracy: {position_um: 240}", "force_log: {mounting_std_deg: 18}"])
def test_both_passes_have_it_and_so_targets_get_worse(tmp_path: Path, stated: str) -> None:
    """By chance: the same error before and after; springs known to a fiftieth, gain and motion add little. Of a turned sensor
    under a force that the arm yields little to: turned it yields more, or the other way."""
    path, rng, worse = line(6, 5), np.random.default_rng(6), 0.0
    yields = [np.array([kit.deviation(IRB6660, q, TOOL.p, unit, K) for unit in np.eye(6)])[:3] for q in path.q]
    axes = np.linalg.svd(yields[0])[0]
    force = np.round(200 * (axes @ [0.25, 0.0, 1.0]), 3) if "mounting" in stated else np.array([0.0, 200.0, 0.0])
    forces = FORCES.replace("0,200,0", ",".join(map(str, force)))
    job = Job(tmp_path, cell=kit.cell_text(extra=f"{stated}\n"), program=path.program(), forces=forces)
    answer = job.correct("--json", "--force", "--cutting-stiffness", "50:0", "--keep-targets").json["result"]
    for seen in yields:
        before = 1e6 * force @ seen
        error = 240 / np.sqrt(3) * rng.standard_normal((100_000, 3))
        if "mounting" in stated:
            error = 1e6 * np.cross(np.radians(18) * rng.standard_normal((100_000, 3)), force) @ seen
        error += before * (0.03 * rng.standard_normal(100_000))[:, None]
        worse += np.mean(np.linalg.norm(error, axis=1) > np.linalg.norm(before + error, axis=1))
    assert worse > 0.1
    assert answer["expected_worse"] == pytest.approx(worse, rel=0.05)
    if "accuracy" in stated:
        assert answer["expected_left_um"]["accuracy"] == pytest.approx(240)


def matern(place: np.ndarray, length: float) -> np.ndarray:
    r = np.sqrt(5) * np.linalg.norm(place[:, None] - place[None], axis=2) / length
    return np.asarray((1 + r + r**2 / 3) * np.exp(-r))


@pytest.mark.parametrize("length", [0.15, 0.6])
def test_what_a_probed_part_leaves_is_what_no_shift_and_turn_takes(length: float) -> None:
    """Smooth errors drawn over a part; a shift and a small turn fitted to each, as probing the part does."""
    rng = np.random.default_rng(11)
    place = rng.uniform(-0.15, 0.15, (40, 3)) * [1, 0.7, 0.1]
    fields = np.einsum("ij,djc->dic", np.linalg.cholesky(matern(place, length) + 1e-10 * np.eye(40)),
                       rng.standard_normal((4000, 40, 3)))
    x, y, z = place.T
    nothing, one = np.zeros(40), np.ones(40)
    turns = [(nothing, -z, y), (z, nothing, -x), (-y, x, nothing)]
    shifts = [(one, nothing, nothing), (nothing, one, nothing), (nothing, nothing, one)]
    motions = np.array([np.column_stack(each).ravel() for each in shifts + turns]).T
    rows = fields.reshape(4000, -1)
    left = (rows - rows @ np.linalg.pinv(motions).T @ motions.T).reshape(4000, 40, 3)
    stated = beside_a_rigid_motion(place, np.zeros((40, 6)), length)
    assert np.trace(stated, axis1=1, axis2=2) == pytest.approx(np.mean(np.sum(left**2, axis=2), axis=0), rel=0.12)
    assert stated[3] == pytest.approx(np.einsum("di,dj->ij", left[:, 3], left[:, 3]) / 4000, abs=0.06 * stated[3].max())


def test_a_part_that_is_small_against_the_length_is_all_but_placed_right() -> None:
    place = np.random.default_rng(1).uniform(-0.05, 0.05, (200, 3))
    small, smaller, large = (np.trace(beside_a_rigid_motion(place, np.zeros((200, 6)), length), axis1=1, axis2=2).mean()
                             for length in (2.0, 20.0, 0.001))
    assert 0 <= smaller < small < 0.005
    assert small == pytest.approx(100 * smaller, rel=0.05), "what is left grows with the part as a scale would"
    assert large == pytest.approx(3, rel=0.15), "places that know nothing of each other have all of it"


def test_the_budget_says_what_a_statement_costs(tmp_path: Path) -> None:
    """Each remedy is worth what stating its number gives."""
    program = line(6, 5).program()
    left = {}
    for name, extra in (("now", "force_log: {mounting_std_deg: 4}\naccuracy: {position_um: 30}\n"),
                        ("read", "force_log: {mounting_std_deg: 0.3}\naccuracy: {position_um: 30}\n"),
                        ("learned", "force_log: {mounting_std_deg: 4}\n")):
        folder = tmp_path / name
        folder.mkdir()
        Job(folder, cell=kit.cell_text(extra=extra), program=program, forces=FORCES).write()
        files = (folder / file for file in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv"))
        left[name] = (error_budget if name == "now" else lambda made, _: correct(made))(predict_files(Inputs(*files)), 20e-6)
    for name, words in (("read", "two postures"), ("learned", "compstiff learn")):
        (remedy,) = (one for one in left["now"].remedies if words in one.name)
        assert remedy.left == pytest.approx(left[name].left.std, rel=1e-6)


@pytest.mark.parametrize(("stated", "said"), [
    ("accuracy: {position_um: 100, length_mm: 400}", "accuracy.length_mm is stated without probed_by_robot"),
    ("accuracy: {position_um: 100, probed_by_robot: true}", "accuracy.probed_by_robot is stated without length_mm"),
    ("accuracy: {position_um: 0.3}", "accuracy.position_um"), ("force_log: {mounting_std_deg: -1}", "mounting_std_deg"),
    ("accuracy: {}", "position_um")])
def test_half_a_statement_is_refused(tmp_path: Path, stated: str, said: str) -> None:
    result = Job(tmp_path, cell=kit.cell_text(extra=f"{stated}\n"), program=line(3, 5).program(), forces=FORCES).correct()
    assert result.code == 1
    assert said in result.err
