"""The built-in robots against the public files their numbers come from, and the maker's way of counting angles."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.model.compliance import equilibrium
from identification.model.effects import effects
from identification.model.inverse import inverse
from identification.model.kinematics import forward, jacobian
from identification.model.load_state import load_state
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.robot_check import check_robot
from identification.model.rotations import Frame
from tests.identification.model.urdf_arms import ARMS
from tests.support import random_poses, robot

ROBOTS = sorted(built_in_robots())
NONE = Frame.identity()
TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])
# The URDF has the forearm of this arm without its half millimetre; the other library, and the reach, have it.
ROUNDED = {"irb6640-185-2.80": 0.5e-3}
# Parameters [mm] as RobotComponents has them: a1 a2 b c1 c2 c3 c4 of Brandstoetter's ortho-parallel arms.
OTHER_LIBRARY = {
    "irb4600-60-2.05": (175, -175, 0, 495, 900, 960, 135),
    "irb6620-150-2.20": (320, -200, 0, 680, 975, 887, 200),
    "irb6640-185-2.80": (320, -200, 0, 780, 1075, 1392.5, 200),
    "irb6650s-125-3.50": (600, -200, 0, 630, 1280, 1592, 200),
    "irb6700-155-2.85": (320, -200, 0, 780, 1125, 1392.5, 200),
    "irb7600-150-3.50": (410, -165, 0, 780, 1075, 2012, 250),
}


@pytest.mark.parametrize("name", sorted(ARMS))
def test_flange_stands_where_the_urdf_puts_it(name: str) -> None:
    theta = random_poses(robot(name), 200, np.random.default_rng(11))
    flange = forward(robot(name), theta, NONE)
    for q, position, rotation in zip(np.degrees(theta), flange.position, flange.rotation, strict=True):
        wanted, turned = ARMS[name].flange(q)
        assert_allclose(rotation, turned, atol=1e-9)
        assert np.linalg.norm(position - wanted) < ROUNDED.get(name, 0.0) + 1e-9


@pytest.mark.parametrize("name", sorted(OTHER_LIBRARY))
def test_flange_stands_where_another_library_puts_it(name: str) -> None:
    opw = pytest.importorskip("py_opw_kinematics")
    a1, a2, b, c1, c2, c3, c4 = 1e-3 * np.array(OTHER_LIBRARY[name])
    other = opw.Robot(opw.KinematicModel(a1=a1, a2=a2, b=b, c1=c1, c2=c2, c3=c3, c4=c4, flip_axes=(False,) * 6,
                                         offsets=(0, 0, -np.pi / 2, 0, 0, 0)), degrees=False)
    theta = random_poses(robot(name), 50, np.random.default_rng(12))
    flange = forward(robot(name), theta, NONE)
    for q, position, rotation in zip(theta, flange.position, flange.rotation, strict=True):
        pose = other.forward(tuple(q)).as_matrix()
        assert_allclose(position, pose[:3, 3], atol=1e-9)
        assert_allclose(rotation, pose[:3, :3], atol=1e-9)


def test_every_built_in_robot_is_held_against_something() -> None:
    """A URDF, another library, or the independent arms of the other tests; and none has an error or a number without source."""
    others = {"irb4400-60", "irb6640-235-2.55", "irb6660-205-1.90"}         # tests/virtual_cell/arm.py
    assert set(ROBOTS) == set(ARMS) | set(OTHER_LIBRARY) | others
    assert len(ROBOTS) >= 12
    assert {robot(name).manufacturer for name in ROBOTS} == {"ABB", "KUKA", "FANUC"}
    for name, file in built_in_robots().items():
        check = check_robot(file)
        assert check.sound, (name, check.findings)
        assert {finding.code for finding in check.findings} <= {"CS0066"}, name


@pytest.mark.parametrize("name", ROBOTS)
def test_inverse_gives_every_branch_back(name: str) -> None:
    model = robot(name)
    theta = random_poses(model, 3000, np.random.default_rng(13))
    flange = forward(model, theta, NONE)
    solutions = inverse(model, flange, theta)
    assert solutions.reachable.any(axis=1).all()
    for branch in range(8):
        rows = solutions.reachable[:, branch]
        again = forward(model, solutions.theta[rows, branch], NONE)
        assert np.max(np.abs(again.position - flange.position[rows])) < 1e-9
        assert np.max(np.abs(again.rotation - flange.rotation[rows])) < 1e-9
    # One of the branches is the pose the flange was put in.
    off = np.abs(np.angle(np.exp(1j * (solutions.theta - theta[:, None])))).max(axis=2)
    away = np.where(solutions.reachable, off, np.inf).min(axis=1)
    assert np.median(away) < 1e-9
    assert np.mean(away < 1e-6) > 0.98


def test_kuka_counts_as_its_pendant_shows() -> None:
    """A2 = 0 lower arm level, -90 upright; A3 = 0 in line with it; A1 turns clockwise seen from above."""
    model = robot("kr210-r2700-extra")
    turns = np.radians([[0, -90, 90, 0, 0, 0], [90, -90, 90, 0, 0, 0], [0, -90, 0, 0, 0, 0]])
    level, right, upright = forward(model, turns, NONE).position
    assert_allclose(level, [0.35 + 1.2 + 0.215, 0, 0.675 + 1.15 - 0.041], atol=1e-12)
    assert_allclose(right, [0, -level[0], level[2]], atol=1e-12)
    assert_allclose(upright[2], 0.675 + 1.15 + 1.2 + 0.215, atol=1e-12)


@pytest.mark.parametrize("name", ["m710ic-50", "r2000ic-210f"])
def test_fanuc_forearm_keeps_its_slope_while_j2_moves(name: str) -> None:
    model = robot(name)
    turns = np.zeros((20, 6))
    turns[:, 1] = np.radians(np.linspace(-50, 70, 20))
    flange = forward(model, turns, NONE)
    assert_allclose(flange.rotation, np.broadcast_to(flange.rotation[0], (20, 3, 3)), atol=1e-12)
    up = turns[:1].copy()
    up[0, 2] = np.radians(30)
    assert forward(model, up, NONE).position[0, 2] > flange.position[0, 2] + 0.3      # J3 positive raises the forearm


def _recounted(name: str, folder: Path, load_path: str) -> tuple[RobotModel, RobotModel, np.ndarray]:
    """An arm, the same one whose controller counts joints 1, 3, 4 and 6 the other way, and the senses."""
    text = built_in_robots()[name].read_text()
    senses = np.array([-1, 1, -1, -1, 1, -1])
    rows = iter(senses)
    mirrored = re.sub(r"limits_deg: \[([-\d.]+), ([-\d.]+)\]", lambda m: (
        f"sense: -1, limits_deg: [{-float(m[2]):g}, {-float(m[1]):g}]" if next(rows) < 0 else m[0]), text)
    models = []
    for number, each in enumerate((text, mirrored)):
        path = folder / f"{number}.yaml"
        path.write_text(re.sub(r"load_path: \w+", f"load_path: {load_path}", each.partition("data_sheet:")[0]))
        models.append(read_robot(path))
    return models[0], models[1], senses


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "irb6700-200-2.60"])
@pytest.mark.parametrize("load_path", ["drive", "serial"])
def test_how_angles_are_counted_changes_nothing_physical(name: str, load_path: str, tmp_path: Path) -> None:
    """Flange, limits, compliance and the deviation under load are the arm's, whatever its controller calls positive."""
    plain, other, senses = _recounted(name, tmp_path, load_path)
    theta = random_poses(plain, 100, np.random.default_rng(14))
    assert_allclose(plain.limit_excess(theta), 0)
    assert_allclose(other.limit_excess(theta * senses), 0)
    beyond = plain.limits[:, 1] + 0.1
    assert_allclose(np.sort(other.limit_excess(beyond * senses))[-3:], np.sort(plain.limit_excess(beyond))[-3:], atol=1e-12)
    one, two = forward(plain, theta, TOOL), forward(other, theta * senses, TOOL)
    assert_allclose(two.position, one.position, atol=1e-12)
    wrench = np.random.default_rng(15).normal(0, 300, (100, 6)) * [1, 1, 1, 0.2, 0.2, 0.2]
    compliance = 1 / plain.prior.stiffness
    bent, again = (equilibrium(model, q, TOOL, wrench, compliance) for model, q in ((plain, theta), (other, theta * senses)))
    assert np.abs(bent.position).max() > 1e-4
    assert_allclose(again.position, bent.position, atol=1e-11)
    columns = jacobian(plain, theta, TOOL), jacobian(other, theta * senses, TOOL)
    assert_allclose(*(np.einsum("nij,j,nkj->nik", each, compliance, each) for each in columns), atol=1e-15)
    assert np.abs(columns[0]).max() > 0.5


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "irb6700-200-2.60"])
def test_within_the_limits_is_what_exceeds_them_by_no_more_than_the_slack(name: str) -> None:
    """Every joint, and the window of the parallel rod, a little within and a little beyond the slack, and angles not known."""
    model, slack = read_robot(built_in_robots()[name]), 1e-3
    rng = np.random.default_rng(8)
    theta = rng.uniform(model.limits[:, 0] - 0.3, model.limits[:, 1] + 0.3, (2000, 6))
    edges = np.repeat(random_poses(model, 1, rng), 24, axis=0)
    for joint in range(6):
        for row, (end, beyond) in enumerate([(0, -0.999), (0, -1.001), (1, 0.999), (1, 1.001)]):
            edges[4 * joint + row, joint] = model.limits[joint, end] + beyond * slack
    theta = np.concatenate([theta, edges, np.full((1, 6), np.nan)])
    inside = model.within_limits(theta, slack)
    assert 0 < inside.sum() < len(theta)
    assert not inside[-1]
    assert inside[:-1].tolist() == (model.limit_excess(theta[:-1]).max(axis=1) <= slack).tolist()


def test_a_controller_s_coupling_is_no_parallel_rod(tmp_path: Path) -> None:
    """FANUC's pendant couples J2 and J3, its arm does not: no effect takes it for a rod."""
    text = built_in_robots()["m710ic-50"].read_text().partition("data_sheet:")[0]
    plain = re.sub(r"coupling: .*\n|sense: -?1, *", "", text)
    assert plain != text
    (tmp_path / "one.yaml").write_text(text)
    (tmp_path / "two.yaml").write_text(plain)
    pendant, serial = read_robot(tmp_path / "one.yaml"), read_robot(tmp_path / "two.yaml")
    theta = random_poses(pendant, 40, np.random.default_rng(16))
    counted = theta * [1, 1, -1, -1, -1, -1]           # by the frames' own axes, the forearm against the lower arm
    counted[:, 2] -= theta[:, 1]
    assert np.array_equal(serial.coupling, np.eye(6))
    wrench = np.random.default_rng(17).normal(0, 300, (40, 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
    rows = [load_state(model, TOOL, angles, wrench, 1 / model.prior.stiffness)
            for model, angles in ((pendant, theta), (serial, counted))]
    assert effects()["parallelogram"].missing(rows[0])
    rod = robot("irb6660-205-1.90")
    poses = random_poses(rod, 40, np.random.default_rng(18))
    assert not effects()["parallelogram"].missing(load_state(rod, TOOL, poses, wrench, 1 / rod.prior.stiffness))
    bending = effects()["link_bending"]
    bent = [bending.contribution(each, 2, np.array([1e-7])) for each in rows]
    assert np.abs(bent[0]).max() > 1e-6
    assert_allclose(bent[0], bent[1], atol=1e-15)
