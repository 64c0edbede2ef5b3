"""Effects in force together: what they add, under the force that really acted, and its derivatives by other differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identification.model.compliance import compliance_matrix
from identification.model.effects import Effect, effects
from identification.model.effects_in_force import (
    EffectInForce,
    added,
    as_felt,
    displaced,
    sizes,
    slopes,
    split,
    squares,
    turned,
)
from identification.model.law_of import LawOf, known, uncertain
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel
from tests.support import random_poses, robot

TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])
SOFT = 1 / np.array([1.6e6, 5.1e6, 1.5e6, 0.5e6, 0.2e6, 0.08e6])


def toolpath(compliance: np.ndarray = SOFT) -> LoadState:
    """A path of twelve targets under load, by an arm that weighs something."""
    rng = np.random.default_rng(5)
    arm = replace(robot("irb6700-200-2.60"), link_mass=np.array([500, 400, 300, 100, 40, 20.0]),
                  link_centre=np.full((6, 3), 0.2))
    wrench = np.concatenate([rng.uniform(-400, 400, (12, 3)), rng.uniform(-40, 40, (12, 3))], axis=1)
    return load_state(arm, TOOL, random_poses(arm, 12, rng, 0.6), wrench, compliance, at_load=True, dwell=np.full(12, 3.0))


def term(name: str, joint: int | None = None) -> EffectInForce:
    law = known(name)
    assert law is not None
    return EffectInForce(law, joint)


# Of each kind: laws of gears, one with a memory, structures with and without their law, the base, the force's measurement.
MANY = [term("soft_zone", 2), term("law_of_soft_zone", 2), term("hysteresis", 3), term("gear_creep", 4), term("base_rocking"),
        term("force_gain"), term("link_bending", 2), term("law_of_link_bending", 2), term("force_sensor_compliance"),
        term("one_sided", 5)]


def sized(rows: LoadState, terms: list[EffectInForce]) -> np.ndarray:
    rng = np.random.default_rng(9)
    return np.concatenate([one.effect.typical(rows, one.joint) * (
        0.1 * rng.standard_normal(len(one.effect.parameters)) if isinstance(one.effect, LawOf) else 1.0) for one in terms])


def test_values_are_split_as_the_names_stand() -> None:
    terms = [term("soft_zone", 2), term("force_gain"), term("backlash", 6)]
    assert [one.names for one in terms] == [
        ["soft_zone[2].extra_rad", "soft_zone[2].torque_nm"], ["force_gain.relative"], ["backlash[6].half_gap_rad"]]
    assert [part.tolist() for part in split(np.arange(4.0), terms)] == [[0, 1], [2], [3]]
    assert terms[0].sentence == "the gear of joint 2 is softer under small torques than under large ones"


def test_effects_of_the_robot_feel_the_force_that_really_acted() -> None:
    """A tenth more of it, and 20 N along x that no sensor saw: together, and beside what these do to the springs."""
    rows, terms = toolpath(), [term("force_gain"), term("base_shift"), term("force_offset")]
    values = np.array([0.1, 3e-8, 20.0, 0.0, 0.0])
    felt = as_felt(rows, terms, values)
    offset = np.zeros((12, 6))
    offset[:, 0] = 20.0
    assert_allclose(felt.wrench, 1.1 * rows.wrench + offset)
    moved = np.zeros((12, 6))
    moved[:, :2] = 3e-8 * felt.wrench[:, :2]
    assert_allclose(added(rows, terms, values), moved + rows.compliant(0.1 * rows.wrench) + rows.compliant(offset), atol=1e-15)
    assert as_felt(rows, terms[1:2], values[1:2]) is rows


def test_slopes_are_the_derivatives_of_what_is_added() -> None:
    """By the springs with the loaded pose held, and by each parameter; by central differences of other steps."""
    rows = toolpath()
    values = sized(rows, MANY)
    found = slopes(rows, MANY, values)
    assert found.shape == (12, 6, 6 + len(values))
    for joint in range(6):
        ahead, behind = (added(toolpath(SOFT * np.exp(step * np.eye(6)[joint])), MANY, values) for step in (3e-4, -3e-4))
        wanted = (ahead - behind) / 6e-4
        assert_allclose(found[:, :, joint], wanted, atol=3e-3 * np.abs(wanted).max())
    for k, size in enumerate(np.concatenate([one.effect.typical(rows, one.joint) for one in MANY])):
        step = 1e-4 * size * np.eye(len(values))[k]
        # Each by itself: what a gain does to the others is of second order, and left out.
        place = np.repeat(np.arange(len(MANY)), [len(one.effect.parameters) for one in MANY])
        mine, own = MANY[place[k]], place == place[k]
        ahead, behind = (mine.contribution(rows, (values + way * step)[own]) for way in (1, -1))
        wanted = (ahead - behind) / (2e-4 * size)
        assert_allclose(found[:, :, 6 + k], wanted, atol=2e-3 * np.abs(wanted).max() + 1e-14, err_msg=mine.names[0])


@pytest.mark.parametrize("law", [law for effect in effects().values() for law in (effect, *effect.other_laws)
                                 if uncertain(law) and not law.of_track], ids=lambda law: law.stored)
def test_a_real_law_is_the_sum_of_its_shapes_at_their_typical_size(law: Effect) -> None:
    rows = toolpath() if law.name != "parallelogram" else load_state(
        robot(), TOOL, random_poses(robot(), 12, np.random.default_rng(2)), toolpath().wrench, SOFT, at_load=True)
    rows = replace(rows, dwell=np.full(12, 3.0))
    if law.weighed:
        rows = replace(rows, robot=replace(rows.robot, link_mass=None, link_centre=None))
    of, joint = LawOf(law), law.places[0]
    rng = np.random.default_rng(1)
    values = rng.standard_normal(len(of.parameters))
    if law.weighed:
        values[-1] = law.parameters[-1].typical
    columns = of.columns(rows, joint, values)
    assert columns.shape == (12, 6, len(of.parameters))
    fitted = values.copy()
    if law.weighed:
        assert not columns[:, :, -1].any()
        fitted[-1] = 0.0
    assert_allclose(of.contribution(rows, joint, values), columns @ fitted, atol=1e-9 * np.abs(columns).max())
    assert known(f"law_of_{law.stored}").parameters == of.parameters


def test_which_laws_real_ones_need_not_follow() -> None:
    """Those with a shape that is tried, those of a gear that has others near it, uneven gears and structures; none that
    begins at a row."""
    certain = {law.stored for effect in effects().values() for law in (effect, *effect.other_laws) if not uncertain(law)}
    assert {"force_gain", "sensor_step", "encoder_zero", "drift", "tool_point", "one_sided"} <= certain
    assert not {"backlash", "soft_zone", "link_bending", "uneven_gear", "base_rocking", "creep"} & certain
    assert known("law_of_force_gain") is None
    assert known("law_of_nothing") is None
    assert known("soft_zone.none") is None


def test_squares_take_an_effect_and_its_own_law_together() -> None:
    rows = toolpath()
    terms = [term("soft_zone", 2), term("law_of_soft_zone", 2), term("soft_zone", 3)]
    values = sized(rows, terms)
    one, law, other = (each.contribution(rows, own) for each, own in zip(terms, split(values, terms), strict=True))
    wanted = np.stack([np.sum((one + law)[:, part] ** 2 + other[:, part] ** 2, axis=1)
                       for part in (slice(3), slice(3, 6))], axis=1)
    assert_allclose(squares(rows, terms, values), wanted)
    assert_allclose(sizes(one)[:, 1], np.linalg.norm(one[:, 3:], axis=1) ** 2)


@pytest.mark.parametrize("links", [False, True])
def test_a_prediction_s_covariance_is_that_of_its_parameters_and_of_what_is_not_known(links: bool) -> None:
    """Slopes by differences of predictions under a small load; beside them, alike in all directions, shares of what springs
    yield where the links' weights are not known, and of what effects do; and of each force, whichever way it may be off."""
    arm, rng = robot("irb6700-200-2.60"), np.random.default_rng(6)
    if links:
        arm = replace(arm, link_mass=np.array([500, 400, 300, 100, 40, 20.0]), link_centre=np.full((6, 3), 0.2))
    theta = random_poses(arm, 4, rng, 0.6)
    wrench = np.concatenate([rng.uniform(-3, 3, (4, 3)), rng.uniform(-0.3, 0.3, (4, 3))], axis=1)
    terms = (term("soft_zone", 2), term("base_shift"))
    root = 0.05 * rng.standard_normal((9, 9)) * np.array([1, 1, 1, 1, 1, 1, 1e-5, 20, 1e-8])[:, None]
    mean = np.concatenate([np.log(SOFT), [5e-5, 150.0, 3e-8]])
    model = IdentifiedModel(arm, TOOL, mean, root @ root.T, effects=terms, unknown_weight=0.03, unknown_law=0.2, differs=0.01)
    slope = model.deviation_slopes(theta, wrench, TOOL)
    assert slope.shape == (4, 6, 9)
    for k, step in enumerate([*6 * [1e-3], 1e-7, 0.1, 1e-10]):
        others = [replace(model, mean=mean + way * step * np.eye(9)[k]) for way in (1, -1)]
        ahead, behind = (np.concatenate(other.predict(theta, wrench)[:2], axis=1) for other in others)
        wanted = (ahead - behind) / (2 * step)
        # What the links' weight moves by softer springs is a few thousandths, and left out.
        assert_allclose(slope[:, :, k], wanted, atol=(1e-2 if links else 1e-3) * np.abs(wanted).max())
    yields = compliance_matrix(arm, theta, TOOL, SOFT)
    elastic = np.einsum("nij,nj->ni", yields, wrench)
    rows = model.load_state(theta, wrench, TOOL)
    each = [one.contribution(rows, own) for one, own in zip(terms, split(model.values, terms), strict=True)]
    wanted = np.einsum("nix,xy,njy->nij", slope, root @ root.T, slope)
    for part in (slice(3), slice(3, 6)):
        unknown = 0.2**2 * sum(np.sum(moved[:, part] ** 2, axis=1) for moved in each)
        if not links:
            unknown = unknown + 0.03**2 * np.sum(elastic[:, part] ** 2, axis=1)
        wanted[:, part, part] += unknown[:, None, None] / 3 * np.eye(3)
    by_force = yields[:, :, :3]
    wanted += 0.01**2 * np.sum(wrench[:, :3] ** 2, axis=1)[:, None, None] * (by_force @ by_force.swapaxes(1, 2))
    got = model.deviation_covariance(theta, wrench, TOOL)
    size = np.sqrt(np.einsum("nii->ni", wanted))
    assert_allclose(got / size[:, :, None] / size[:, None], wanted / size[:, :, None] / size[:, None], atol=2e-3)
    assert_allclose(model.deviation_covariance(theta, wrench, TOOL, rows=slice(3)), got[:, :3, :3])
    assert_allclose(model.predict(theta, wrench)[2], got)


def test_a_model_s_intervals_are_normal_in_the_logarithm_and_a_factor_is_shared() -> None:
    covariance = 0.01 * (np.eye(6) + 0.5)
    model = IdentifiedModel(robot(), TOOL, np.log(SOFT), covariance)
    assert_allclose(model.stiffness, 1 / SOFT)
    assert_allclose(model.log_std, np.sqrt(0.015))
    half = np.exp(1.959964 * np.sqrt(0.015))
    assert_allclose(model.interval_95, np.column_stack([1 / SOFT / half, half / SOFT]), rtol=1e-6)
    softer = model.scaled(1.1, 0.022)
    assert_allclose(softer.compliance, 1.1 * SOFT)
    assert_allclose(softer.covariance, covariance + 0.02**2)


def test_a_pose_is_displaced_and_turned_in_the_outer_frame() -> None:
    rng = np.random.default_rng(4)
    turns = Rotation.random(5, rng=rng)
    pose = Frame(turns.as_matrix(), rng.standard_normal((5, 3)))
    moved = rng.standard_normal((5, 6))
    there = displaced(pose, moved)
    assert_allclose(there.position, pose.position + moved[:, :3])
    assert_allclose(there.rotation, (Rotation.from_rotvec(moved[:, 3:]) * turns).as_matrix(), atol=1e-12)


def test_an_effect_has_turned_where_it_rests_at_another_end_than_last() -> None:
    side = np.array([0, 1, 0, 1, -1, 0, 0, 1, 1, 0, -1])
    assert np.flatnonzero(turned(side)).tolist() == [4, 7, 10]
    assert turned(np.zeros(3)).tolist() == [False] * 3
