"""Laws of physics that the dictionary's effects obey, whatever the pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.model.compliance import compliance_matrix, loaded_angles
from identification.model.effects import Effect, effects
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

COMPLIANCE = 1 / np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])
TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])
LINEAR = [*(("bearing_tilt", joint) for joint in range(1, 6)), ("link_bending", 2), ("link_bending", 3), ("base_rocking", None),
          ("base_shift", None), ("force_sensor_compliance", None), ("spindle_compliance", None)]
COUPLING = [("parallelogram", None), ("wrist_coupling", None), ("gravity_compensator", 2)]


def at_rest(name: str, theta: np.ndarray, wrench: np.ndarray) -> LoadState:
    return load_state(robot(name), TOOL, theta, wrench, COMPLIANCE, at_load=True)


def effect_matrix(effect: Effect, joint: int | None, name: str = "irb6660-205-1.90") -> tuple[np.ndarray, np.ndarray]:
    """What the effect adds to the compliance (n, 6, 6) at random poses, by unit wrenches, and the angles (n, 6) [rad]."""
    theta = random_poses(robot(name), 40, np.random.default_rng(3))
    values = np.array([0.3 if parameter.name == "ratio" else parameter.typical for parameter in effect.parameters])
    columns = [effect.contribution(at_rest(name, theta, np.repeat(unit[None], len(theta), axis=0)), joint, values)
               for unit in np.eye(6)]
    return np.stack(columns, axis=2), theta


def scaled(matrix: np.ndarray) -> np.ndarray:
    """With moments in N per 0.1 m and rotations in m at 0.1 m, so that both parts are of one size."""
    size = np.array([1.0, 1, 1, 0.1, 0.1, 0.1])
    return matrix * size[:, None] * size


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "irb6700-200-2.60"])
@pytest.mark.parametrize(("label", "joint"), LINEAR)
def test_maxwell_betti(label: str, joint: int | None, name: str) -> None:
    """Passive and linear: what a load along a moves along b, the same load along b moves along a; no load gains energy."""
    matrix = scaled(effect_matrix(effects()[label], joint, name)[0])
    largest = np.abs(matrix).max(axis=(1, 2))
    assert largest.min() > 0
    assert np.all(np.abs(matrix - np.swapaxes(matrix, 1, 2)).max(axis=(1, 2)) < 1e-12 * largest)
    assert np.all(np.linalg.eigvalsh(matrix)[:, 0] > -1e-9 * largest)


def test_what_stands_on_the_flange_bends_as_a_cantilever() -> None:
    """Deflection and slope at the end of a clamped beam, as every book of strength of materials has them (F L^3 / 3 E I,
    F L^2 / 2 E I, M L^2 / 2 E I, M L / E I), carried to a tip that stands beside the beam's axis."""
    law = known("spindle_compliance.beam")
    assert law is not None
    theta = random_poses(robot(), 20, np.random.default_rng(8))
    wrench = np.random.default_rng(9).normal(0, 1, (20, 6)) * [300, 300, 300, 40, 40, 40]
    rows = at_rest("irb6660-205-1.90", theta, wrench)
    aside, length, soft = np.array([*TOOL.position[:2], 0.0]), TOOL.position[2], 7e-6
    for n in range(20):
        force, moment = rows.flange[n].T @ wrench[n, :3], rows.flange[n].T @ wrench[n, 3:]
        at_end = moment + np.cross(aside, force)
        moved = soft * np.array([length**3 / 3 * force[0] + length**2 / 2 * at_end[1],
                                 length**3 / 3 * force[1] - length**2 / 2 * at_end[0], 0.0])
        slope = soft * np.array([length * at_end[0] - length**2 / 2 * force[1],
                                 length * at_end[1] + length**2 / 2 * force[0], 0.0])
        wanted = np.concatenate([rows.flange[n] @ (moved + np.cross(slope, aside)), rows.flange[n] @ slope])
        assert_allclose(law.contribution(rows, None, np.array([soft]))[n], wanted, rtol=1e-10, atol=1e-14)


@pytest.mark.parametrize(("label", "joint"), COUPLING)
def test_maxwell_betti_where_the_effect_changes_the_springs_themselves(label: str, joint: int | None) -> None:
    """These take compliance away as well as give it: symmetric by themselves, positive together with the springs."""
    matrix, theta = effect_matrix(effects()[label], joint)
    together = scaled(matrix + compliance_matrix(robot(), theta, TOOL, COMPLIANCE))
    matrix, largest = scaled(matrix), np.abs(together).max(axis=(1, 2))
    assert np.all(np.abs(matrix - np.swapaxes(matrix, 1, 2)).max(axis=(1, 2)) < 1e-12 * largest)
    assert np.all(np.linalg.eigvalsh(together)[:, 0] > -1e-9 * largest)


def test_the_other_load_path_is_the_parallelogram() -> None:
    """Springs at the drives with an ideal rod, and a rod that carries nothing: the serial reading of the springs."""
    matrix, theta = effect_matrix(effects()["parallelogram"], None)
    values = np.array([0.0])
    columns = [effects()["parallelogram"].contribution(at_rest("irb6660-205-1.90", theta, np.repeat(unit[None], 40, axis=0)),
                                                       None, values) for unit in np.eye(6)]
    drive, serial = robot(), replace(robot(), load_path="serial")
    difference = (compliance_matrix(serial, theta, TOOL, COMPLIANCE) - compliance_matrix(drive, theta, TOOL, COMPLIANCE))
    assert_allclose(np.stack(columns, axis=2), difference, atol=1e-12 * np.abs(difference).max())
    assert np.abs(matrix).max() > 0


def test_the_other_load_path_is_seen_beside_a_gear_that_a_wrong_fit_made_rigid() -> None:
    """From springs with a rigid gear 2 to those of the serial reading with the gear as the maker's robots have it: one of the
    signatures is all of that, not a multiple of what another path makes of a rigid gear."""
    theta = random_poses(robot(), 40, np.random.default_rng(5))
    wrench = np.random.default_rng(6).normal(0, 300, (40, 6))
    rigid, usual = COMPLIANCE.copy(), COMPLIANCE.copy()
    rigid[1] /= 50
    usual[1] = 1 / robot().prior.stiffness[1]
    serial = compliance_matrix(replace(robot(), load_path="serial"), theta, TOOL, usual)
    moved = np.einsum("nij,nj->ni", serial - compliance_matrix(robot(), theta, TOOL, rigid), wrench)[:, :3]
    rows = load_state(robot(), TOOL, theta, wrench, rigid, at_load=True)
    off = [np.abs(shape.rows[:, :, 0] - moved).max() for shape in effects()["parallelogram"].signatures(rows, None)
           if not shape.effect.law and shape.values(np.ones(1)) == 0.0]
    assert min(off) < 1e-9 * np.abs(moved).max()


@pytest.mark.parametrize("effect", [effect for effect in effects().values() if effect.of_robot], ids=lambda effect: effect.name)
def test_no_load_no_contribution_of_the_robot(effect: Effect) -> None:
    theta = random_poses(robot(), 10, np.random.default_rng(4))
    rows = at_rest("irb6660-205-1.90", theta, np.zeros((10, 6)))
    for joint in effect.places:
        typical = np.array([parameter.typical for parameter in effect.parameters])
        assert np.all(effect.contribution(rows, joint, typical) == 0)


def test_a_tool_for_each_row_is_the_same_as_one_tool_at_a_time() -> None:
    theta = random_poses(robot(), 3, np.random.default_rng(5))      # three rows: a matrix product would not notice its mistake
    wrench = np.random.default_rng(6).uniform(-300, 300, (3, 6))
    tools = [Frame.from_quaternion([0.1 * i, 0.02, 0.2], [1.0, 0.1 * i, 0, 0]) for i in range(3)]
    every = Frame(np.stack([tool.rotation for tool in tools]), np.stack([tool.position for tool in tools]))
    together = load_state(robot(), every, theta, wrench, COMPLIANCE, at_load=True)
    for i, tool in enumerate(tools):
        alone = load_state(robot(), tool, theta[i:i + 1], wrench[i:i + 1], COMPLIANCE, at_load=True)
        for name in ("tcp", "tool", "serial_jacobian", "torque", "elastic", "elastic_position"):
            assert_allclose(getattr(together, name)[i], getattr(alone, name)[0], rtol=1e-12, atol=1e-15)


def test_other_springs_at_the_same_loaded_pose() -> None:
    theta = random_poses(robot(), 5, np.random.default_rng(7))
    wrench = np.random.default_rng(8).uniform(-300, 300, (5, 6))
    first = load_state(robot(), TOOL, theta, wrench, COMPLIANCE, at_load=True)
    for name in ("elastic", "elastic_position", "gravity", "torque"):
        getattr(first, name)                                # worked out before the springs change
    other = first.with_compliance(2 * COMPLIANCE)
    fresh = load_state(robot(), TOOL, theta, wrench, 2 * COMPLIANCE, at_load=True)
    for name in ("loaded", "torque", "elastic", "elastic_position", "tcp"):
        assert_allclose(getattr(other, name), getattr(fresh, name), rtol=1e-13, atol=0)


def test_other_springs_at_a_commanded_pose_are_those_of_first_order() -> None:
    """The deviation grows as a new equilibrium says; the loaded pose, which changes by micrometres, is held."""
    theta = random_poses(robot(), 5, np.random.default_rng(7))
    wrench = np.random.default_rng(8).uniform(-300, 300, (5, 6))
    softer = COMPLIANCE * np.exp([0.01, 0, 0.02, 0, -0.01, 0.005])
    first = load_state(robot(), TOOL, theta, wrench, COMPLIANCE)
    other, fresh = first.with_compliance(softer), load_state(robot(), TOOL, theta, wrench, softer)
    grown = fresh.elastic - first.elastic
    assert_allclose(other.elastic - first.elastic, grown, rtol=0, atol=0.01 * np.abs(grown).max())
    for name in ("loaded", "torque", "tcp", "jacobian"):
        assert_allclose(getattr(other, name), getattr(first, name), rtol=0, atol=0)


@pytest.mark.parametrize("name", ["irb6660-205-1.90", "irb6640-235-2.55", "kr210-r2700-extra"])
def test_what_hangs_on_flange_and_forearm_turns_the_joints_by_virtual_work(name: str) -> None:
    """The torque at a spring is the work of the weight where it gives way by a little, the others held."""
    model = robot(name)
    theta = random_poses(model, 6, np.random.default_rng(5))
    tool, nothing = Frame(np.eye(3), np.array([0.1, 0.0, 0.2])), np.zeros((6, 6))

    def state(angles: np.ndarray) -> LoadState:
        return load_state(model, tool, angles, nothing, 1 / model.prior.stiffness, at_load=True)

    def fallen(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far down (6,) a point a metre out on the flange's axis stands, one on the forearm, one a metre out to the TCP."""
        rows = state(angles)
        elbow, wrist = rows.origins[:, 2], rows.origins[:, 4]
        lower_arm = np.linalg.norm(rows.origins[:, 2] - rows.origins[:, 1], axis=1)
        flange = wrist + model.d[5] * rows.flange[:, :, 2]
        out = (rows.tcp - flange) / np.linalg.norm(tool.position)
        return (-(wrist + rows.flange[:, :, 2])[:, 2], -(elbow + 0.4 * (wrist - elbow))[:, 2] / lower_arm,
                -(flange + out)[:, 2])

    rows, step = state(theta), 1e-6 * np.eye(6)
    for joint in range(1, 6):
        ahead, behind = (fallen(loaded_angles(model, theta, twist)) for twist in (step[joint][None], -step[joint][None]))
        work = [(first - last) / 2e-6 for first, last in zip(ahead, behind, strict=True)]
        if joint < 3:
            np.testing.assert_allclose(rows.hung_on_forearm[:, joint], work[1], atol=1e-8)
        else:
            np.testing.assert_allclose(rows.hung_on_flange[:, joint], work[2 * (joint == 5)], atol=1e-8)


def test_the_scale_of_the_force_is_all_springs_changed_together() -> None:
    """Also where the arm moves by millimetres under the load: half of the force on springs of half the stiffness is the same
    deflection, to the last nanometre. In proportion alone it would be off by micrometres, which rows of a soft arm show."""
    effect, theta = effects()["force_gain"], random_poses(robot(), 30, np.random.default_rng(2))
    wrench = np.tile([0.0, 0.0, -1300.0, 0.0, 0.0, 0.0], (len(theta), 1))
    soft = 4 * COMPLIANCE
    for gain in (-0.5, 0.3):
        as_it_is = load_state(robot(), TOOL, theta, wrench, soft)
        others = load_state(robot(), TOOL, theta, wrench, soft / (1 + gain))
        scaled_too = others.elastic_position + effect.contribution(others, None, np.array([gain]))[:, :3]
        assert np.linalg.norm(as_it_is.elastic_position, axis=1).max() > 3e-3
        assert_allclose(scaled_too, as_it_is.elastic_position, atol=1e-9)
        in_proportion = (1 + gain) * others.elastic_position - as_it_is.elastic_position
        assert np.abs(in_proportion).max() > 1e-6


def test_a_direction_is_tried_all_round() -> None:
    """Of an angle that may be any a grid leaves no side out: from each start it is equally far to the next."""
    angles = [parameter for effect in effects().values() for law in (effect, *effect.other_laws) for parameter in law.parameters
              if parameter.unit == "rad" and parameter.grid and parameter.high - parameter.low > 6.28]
    assert angles
    for angle in angles:
        starts = np.sort(angle.grid)
        assert_allclose(np.diff([*starts, starts[0] + 2 * np.pi]), 2 * np.pi / len(starts), atol=2e-3)
