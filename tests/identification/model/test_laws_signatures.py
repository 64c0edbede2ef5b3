"""What is searched for is what is fitted: each signature of each law, at each place, is the law's own contribution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identification.model.effects import Effect, effects
from identification.model.effects.kinds import OF_THE_KIND, GearTwist
from identification.model.law_of import known
from identification.model.load_state import LoadState, load_state
from identification.model.rotations import Frame
from tests.support import random_poses, robot

TOOL = Frame.from_quaternion([0.12, -0.03, 0.25], [0.9, 0.1, -0.3, 0.2])


def load_test(hung: bool = False, heavy: bool = False, name: str = "irb6700-200-2.60") -> LoadState:
    """Loads up and down at five poses, zeros taken anew once; along lines of their own, or of weights that hang."""
    arm, rng = robot(name), np.random.default_rng(11)
    if heavy:
        arm = replace(arm, link_mass=np.array([500, 400, 300, 100, 40, 20.0]), link_centre=np.full((6, 3), 0.2))
    sizes = np.array([0, 120, 310, 430, 310, 120, 0, 250, 430, 0.0])
    along = np.array([[0, 0, -1.0]]) if hung else rng.standard_normal((5, 3))
    along = np.repeat(along / np.linalg.norm(along, axis=1, keepdims=True), 50 // len(along), axis=0)
    wrench = np.concatenate([np.tile(sizes, 5)[:, None] * along, np.zeros((50, 3))], axis=1)
    theta = np.repeat(random_poses(arm, 5, rng, 0.6), 10, axis=0)
    rows = load_state(arm, TOOL, theta, wrench, 1 / arm.prior.stiffness)
    return replace(rows, visit=np.repeat(np.arange(5), 10), row=np.arange(1, 51), time=40.0 * np.arange(50) + 5,
                   dwell=np.tile([5.0, 15, 8, 30, 9, 12, 7, 25, 11, 6], 5), reference=np.repeat([0, 1], [20, 30]))


@pytest.fixture(scope="module")
def tests() -> list[LoadState]:
    return [load_test(), load_test(hung=True), load_test(heavy=True), load_test(hung=True, heavy=True),
            load_test(name="irb6660-205-1.90")]


# Of these a small size does something else than a large one: their own tests hold them at the size that was tried.
BENT = {"force_misalignment.pulley", "gauge_friction", "soft_gears.rolling", "parallelogram"}


@pytest.mark.parametrize("effect", effects().values(), ids=lambda effect: effect.name)
def test_a_signature_is_its_law_s_own_contribution(tests: list[LoadState], effect: Effect) -> None:
    """By a thousandth of each coefficient's typical size, from none of it; all else is as the signature says."""
    seen = 0
    for rows in (rows for rows in tests if not effect.missing(rows)):
        for joint in effect.places:
            for shape in effect.signatures(rows, joint):
                assert shape.rows.shape == (len(rows), 3, len(shape.scale))
                assert (shape.scale > 0).all()
                law, one = shape.effect, np.eye(len(shape.scale))
                size = law.parameters.index(law.size_parameter)
                if law.name != "parallelogram":     # whose size is by how much its path is another than the robot file's
                    assert shape.values(shape.scale * one[0])[size] == pytest.approx(law.typical(rows, joint)[size])
                assert all(p.low * (1 + 1e-5) <= value <= p.high * (1 + 1e-5) or not p.shape
                           for p, value in zip(law.parameters, shape.values(shape.scale), strict=True)), law.stored
                seen += 1
                if law.stored in BENT or not shape.rows.any():
                    continue
                nothing = law.contribution(rows, joint, shape.values(0 * shape.scale))[:, :3]
                for k, small in enumerate(1e-3 * shape.scale):
                    added = law.contribution(rows, joint, shape.values(small * one[k]))[:, :3] - nothing
                    wanted = small * shape.rows[:, :, k]
                    assert_allclose(added, wanted, atol=2e-4 * np.abs(wanted).max(), err_msg=f"{law.stored} {joint}")
    assert seen or effect.missing(tests[0]) in OF_THE_KIND


def test_a_warm_up_is_tried_that_ends_in_the_time_the_rows_take_and_a_wave_that_comes_again_in_it() -> None:
    """Rows over 1960 s, then over 122.5 s: a warm-up takes half a minute at least, a wave a minute."""
    for took in (1960.0, 122.5):
        rows = load_test()
        rows = replace(rows, time=5 + took * np.arange(50) / 49)
        tried: dict[str, list[list[float]]] = {}
        for shape in effects()["drift"].signatures(rows, None):
            tried.setdefault(shape.effect.law, []).append(shape.values(shape.scale)[len(shape.scale):].tolist())
        ends = [[max(share * took, 30.0)] for share in (0.1, 0.3, 1.0)]
        assert_allclose(tried["settling"], ends)
        assert_allclose(tried["growing"], ends)
        assert_allclose(tried["cycling"], [[phase * np.pi / 4, max(took / cycles, 60.0)] for cycles in (
            0.7, 1, 1.5, 2, 3, 4, 6, 8) for phase in range(4)])
        assert_allclose([shape.values(shape.scale)[1:] for shape in effects()["softening"].signatures(rows, None)
                         if shape.effect.law == "settling"], ends)


def test_a_gear_that_opens_is_a_fifth_softer_under_the_largest_torque_of_the_rows() -> None:
    """By the cubic law; of 10 N m where they are smaller."""
    law = known("soft_beyond.cubic")
    assert law is not None
    rows = load_test()
    largest = np.abs(rows.torque[:, 1]).max()
    (share,) = law.typical(rows, 2)
    twist = law.twist(rows, 1, np.array([share]))[np.abs(rows.torque[:, 1]).argmax()]
    assert abs(twist) == pytest.approx(0.2 * rows.compliance[1] * largest)
    light = load_state(rows.robot, TOOL, rows.theta, 1e-3 * rows.wrench, rows.compliance)
    assert law.typical(light, 2) == pytest.approx([0.2 * 100.0**2])


@pytest.mark.parametrize("where", ["first", "middle", "pose"])
def test_a_step_holds_until_the_zero_is_taken_anew(where: str) -> None:
    """Of 50 rows from each on, 30 of them after the second zero, and of each of five poses."""
    rows = load_test()
    steps = {next(iter(shape.effect.where.items())): (shape.rows, shape.local)
             for shape in effects()["sensor_step"].signatures(rows, None) if not shape.effect.law}
    assert len(steps) == 55
    key, wanted = {"first": (("row", 1), np.arange(50) < 20), "middle": (("row", 33), np.arange(50) >= 32),
                   "pose": (("pose", "2"), np.repeat(np.arange(5), 10) == 1)}[where]
    assert_allclose(steps[key][0], wanted[:, None, None] * np.eye(3))
    assert steps[key][1] == (where == "pose")


def test_a_worn_gear_is_tried_at_nine_angles_of_the_rows_and_two_widths() -> None:
    rows = load_test()
    tried = [shape.values(shape.scale)[1:] for shape in effects()["uneven_gear"].signatures(rows, 3)
             if shape.effect.law == "worn"]
    low, high = rows.theta[:, 2].min(), rows.theta[:, 2].max()
    assert_allclose(tried, [[low + k / 8 * (high - low), width] for k in range(9) for width in (0.25, 0.5)])


def test_play_of_unknown_weight_is_tried_where_it_turns_the_axis() -> None:
    """Three to thirty-one torques that hang there, each with each shape; where it has a twentieth of a lever at most, none."""
    rows = load_test()
    wrist = next(law for law in effects()["soft_zone"].other_laws if law.law == "wrist")
    found = wrist.signatures(rows, 5)
    weights = sorted({shape.weight for shape in found})
    assert len(found) == 5 * len(weights) == 5 * 11
    assert_allclose(weights, np.geomspace(40, 800, 31).round(1)[::3])
    for shape in found:
        assert shape.values(shape.scale)[-1] == shape.weight
    for lever, none in ((0.049, True), (0.051, False)):
        rows = load_test()
        vars(rows)["hung_on_flange"] = lever * np.sign(rows.hung_on_flange)
        assert (wrist.signatures(rows, 5) == []) == none


UNDER_WEIGHT = [law for effect in effects().values() for law in (effect, *effect.other_laws)
                if isinstance(law, GearTwist) and law.of_gravity]


@pytest.mark.parametrize("law", UNDER_WEIGHT, ids=lambda law: law.stored)
def test_a_gear_s_law_is_of_the_whole_torque_on_it(law: GearTwist) -> None:
    """Under weight a load turns it by what a gear without any has more under both than under the weight alone."""
    heavy, free = load_test(heavy=True), load_test()
    values = law.typical(heavy, law.places[1])
    i = law.index(law.places[1])
    assert np.ptp(heavy.gravity[:, i]) > 0
    if law.weighed:
        hangs = values[-1] * law.hanging(heavy)[:, i]
        values = np.append(values[:-1], 0.0)
    else:
        hangs = heavy.gravity[:, i]
    # Where the law bends, by the torques of the rows, so that each of them is on both sides of it.
    torque = np.quantile(np.abs(hangs), 0.6) + np.abs(heavy.torque[:, i]).max()
    for k, parameter in enumerate(law.parameters):
        if parameter.name == "torque_nm":
            values[k] = 0.5 * torque

    def twist(all_of_it: np.ndarray) -> np.ndarray:
        rows = load_state(free.robot, TOOL, free.theta, free.wrench, free.compliance)
        rows = replace(rows, visit=free.visit)
        vars(rows)["torque"] = np.repeat(all_of_it[:, None], 6, axis=1)
        vars(rows)["gravity"] = np.zeros((len(rows), 6))
        return law.twist(rows, i, values)

    whole = law.typical(heavy, law.places[1])
    whole[: len(values)] = values
    if law.weighed:
        whole[-1] = law.typical(heavy, law.places[1])[-1]
    got = law.twist(heavy, i, whole)
    assert np.abs(got).max() > 0
    assert_allclose(got, twist(hangs + heavy.torque[:, i]) - twist(hangs), atol=1e-12 + 1e-9 * np.abs(got).max())
