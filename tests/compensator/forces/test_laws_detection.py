"""Which targets show a force: by so many sigmas of the sensor's own noise, and of its zero."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.forces.detection import over_noise, over_scatter, without_gaps
from compensator.forces.log import read_force_log
from compensator.forces.placement import _of_weight, place_forces
from compensator.forces.target_forces import TargetForces
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import Zero
from tests.compensator.forces.test_contract_placement import log_text, plan


@pytest.mark.parametrize(("samples", "tared"), [(1, np.inf), (16, np.inf), (16, 36.0), (400, 9.0)])
def test_a_force_is_five_sigma_of_the_mean_and_three_and_a_half_of_the_zero(samples: int, tared: float) -> None:
    """Of noise of 2 N a sample the mean of n scatters by 2 / sqrt(n), and the zero, which all targets share, by 2 / sqrt(m)."""
    rows = TargetRows(4, np.repeat(np.arange(3), samples), np.ones(3 * samples))
    least = np.hypot(5 * 2 / np.sqrt(samples), 3.44 * 2 / np.sqrt(tared))
    mean = np.zeros((4, 6))
    mean[:, 1] = np.array([0.99, -1.01, 1.01, 5.0]) * least
    # The last target has no sample.
    assert over_noise(mean, rows, 4.0 * np.eye(6), 4.0 / tared * np.eye(6)).tolist() == [False, True, True, False]


@pytest.mark.parametrize("part", [0, 3])
@pytest.mark.parametrize("of_each", [False, True])
def test_a_force_is_held_against_the_noise_in_its_own_direction(part: int, of_each: bool) -> None:
    """Forces and moments each by themselves: along (2, 3, 6)/7 noise of 1, 2 and 0.5 along the axes is that of 7/7 in all, and
    the same in axes that are turned; a zero is asked for 3.44 of its own. What is known of the zero at each target
    counts there."""
    direction, axes = np.array([2.0, 3.0, 6.0]) / 7, np.diag([1.0, 2.0, 0.5]) ** 2
    sigma = np.sqrt(2.0**2 + (2 * 3.0) ** 2 + (0.5 * 6.0) ** 2) / 7
    for turned in (np.eye(3), Rotation.from_euler("xyz", [20, 45, 70], degrees=True).as_matrix()):
        noise, zero = np.zeros((6, 6)), np.zeros((6, 6))
        noise[part:part + 3, part:part + 3] = turned @ axes @ turned.T
        zero = noise / 9 if not of_each else np.array([noise, noise, 4 * noise, 0 * noise]) / 9
        least = sigma * np.sqrt(25 / 16 + (3.44 / 3) ** 2 * np.array([1, 1, 4 if of_each else 1, 0 if of_each else 1]))
        for size, over in ((0.999, False), (1.001, True)):
            mean = np.zeros((4, 6))
            mean[:, part:part + 3] = np.outer(size * least, turned @ direction)
            assert over_noise(mean, of_rows(16, 16, 16, 16), noise, zero).tolist() == [over] * 4


def logged_turned(folder: Path, degrees: float, size: float, *, tared: bool = True) -> TargetForces:
    """Ten targets, at which a tool pushes from the fourth on, at the last one across its axis with `size` of what is told; a
    sensor that is turned about that axis by so many degrees, and whose noise is 2 N along each axis."""
    rng, samples = np.random.default_rng(3), 40
    target = np.repeat(np.arange(10), samples)
    force = np.where((target > 2)[:, None], [80.0, 60.0, 20.0], 0.0)
    noise, across = rng.normal(0, 2.0, force.shape), np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    noise -= np.array([noise[target == k].mean(axis=0) for k in range(10)])[target]
    # One sample in air, as the means of 30 batches of four of the three targets show it, 29 degrees of freedom, and eight more
    # that hold all axes for alike; the zero is the mean of all of them.
    batches = 2 * noise[:120].reshape(30, 4, 3).mean(axis=1)
    sigma = np.sqrt((29 * np.var(batches @ across, ddof=1) + 8 * np.var(batches, axis=0, ddof=1).mean()) / 37)
    force[target == 9] = size * sigma * np.sqrt(25 / 40 + 3.44**2 / 120) * across
    turn = Rotation.from_euler("z", degrees, degrees=True)
    x, y, z, w = turn.as_quat()
    path = plan(folder, "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\nforce_log: {frame: sensor, "
                f"sensor_position_mm: [0, 0, 100], sensor_quaternion: [{w}, {x}, {y}, {z}]}}\n", count=10)
    file = folder / "forces.csv"
    file.write_text(log_text("target,fx_n,fy_n,fz_n", np.column_stack([target, turn.inv().apply(force + noise)])))
    return place_forces(read_force_log(file), path, path.cell, tare=(0, 2) if tared else None, trust_tare=True)


@pytest.mark.parametrize(("size", "told"), [(0.99, False), (1.01, True)])
def test_a_sensor_turned_about_the_tool_tells_the_same_targets(tmp_path: Path, size: float, told: bool) -> None:
    """The weak push at the end of a cut, over 5 sigma along its own direction and under them along each axis of one that is
    not turned."""
    as_it_was = logged_turned(tmp_path, 0.0, size)
    assert as_it_was.forced.tolist() == [False] * 3 + [True] * 6 + [told]
    for degrees in (30.0, 45.0, 137.0):
        turned = logged_turned(tmp_path, degrees, size)
        assert turned.forced.tolist() == as_it_was.forced.tolist()
        np.testing.assert_allclose(turned.wrench, as_it_was.wrench, atol=1e-6)
        assert turned.zero_std == pytest.approx(as_it_was.zero_std, rel=1e-6)
        assert [(one.code, one.message) for one in turned.findings if one.code not in ("CS3008", "CS3071")] == [
            (one.code, one.message) for one in as_it_was.findings if one.code not in ("CS3008", "CS3071")]


@pytest.mark.parametrize("tared", [True, False])
def test_how_sure_a_force_is_does_not_hang_on_how_the_sensor_sits(tmp_path: Path, tared: bool) -> None:
    """Along the base: of samples that scatter more along one line than across it no axis of the sensor knows by itself. Nor do
    the targets that show a force without a tare."""
    as_it_was = logged_turned(tmp_path, 0.0, 0.7, tared=tared)
    for degrees in (30.0, 45.0, 137.0):
        turned = logged_turned(tmp_path, degrees, 0.7, tared=tared)
        np.testing.assert_allclose(turned.standard_error, as_it_was.standard_error, rtol=1e-5)
        assert turned.forced.tolist() == as_it_was.forced.tolist()
        np.testing.assert_allclose(turned.wrench, as_it_was.wrench, atol=1e-6)


def test_how_sure_a_zero_is_whose_weight_the_tare_told_is_said_along_the_base(tmp_path: Path) -> None:
    """Its covariance (N, 3, 3) in the sensor's axes turned, less what is said of all targets; nothing of a zero that is one."""
    axes = Rotation.from_euler("zyx", [50, 20, -30], degrees=True)
    x, y, z, w = axes.as_quat()
    path = plan(tmp_path, "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 250]}\nforce_log: {frame: sensor, "
                f"sensor_position_mm: [0, 0, 100], sensor_quaternion: [{w}, {x}, {y}, {z}]}}\n", count=4)
    rng = np.random.default_rng(5)
    root = np.zeros((4, 6, 6))
    root[:, :3, :3], root[:, 3:, 3:] = rng.normal(0, 2, (4, 3, 3)), rng.normal(0, 90, (4, 3, 3))
    covariance = root @ np.swapaxes(root, 1, 2)
    zero = Zero(np.zeros((4, 6)), np.zeros(6), np.ones(6), (), (np.eye(6), covariance))
    turned = Rotation.from_matrix(path.base_from_flange.rotation) * axes
    found = _of_weight(zero, 1.5, path, path.cell)
    assert found is not None
    for k, turn in enumerate(turned):
        # By how far what scatters so goes along each axis of the base.
        along = np.sum(turn.apply(root[k, :3, :3].T) ** 2, axis=0)
        np.testing.assert_allclose(found[k], np.sqrt(np.maximum(along - 1.5**2, 0.0)), atol=1e-5)
    assert _of_weight(replace(zero, spread=(np.eye(6), covariance[0])), 1.5, path, path.cell) is None
    assert _of_weight(replace(zero, spread=None), 0.0, path, path.cell) is None


def of_rows(*each: int) -> TargetRows:
    """So many rows at each target."""
    return TargetRows(len(each), np.repeat(np.arange(len(each)), each), np.ones(sum(each)))


def test_a_component_without_noise_shows_a_force_by_being_other_than_zero() -> None:
    mean = np.zeros((3, 6))
    mean[1, 4], mean[2, 4] = 1e-9, 1e-12
    assert over_noise(mean, of_rows(4, 4, 4), np.zeros((6, 6)), np.zeros((6, 6))).tolist() == [False, True, False]


@pytest.mark.parametrize(("sigmas", "forced"), [
    ((0, 4.9, 0), (0, 0, 0)), ((0, -5.1, 0), (0, 1, 0)), ((1.9, 5.1, -1.9), (0, 1, 0)), ((2.1, -5.1, 2.1), (1, 1, 1)),
    # Together the mean of n of as many sigmas has sqrt(n) times as many: 3 of 2.8 are 4.85, 4 of 2.6 are 5.2.
    ((2.8, 2.8, 2.8, 0), (0, 0, 0, 0)), ((0, 2.6, 2.6, 2.6, 2.6), (0, 1, 1, 1, 1)), ((2.6, -2.6, 2.6, -2.6), (0, 0, 0, 0)),
    ((2.1, 5.1, 0, 2.1, 2.1), (1, 1, 0, 0, 0))])
@pytest.mark.parametrize("axis", [0, 2])
def test_without_a_tare_a_run_of_two_sigmas_has_a_force_where_one_of_it_or_all_have_five(
    sigmas: tuple[float, ...], forced: tuple[int, ...], axis: int
) -> None:
    """All scatter alike, by 3 N in the mean."""
    mean = np.zeros((len(sigmas), 6))
    mean[:, axis] = 3.0 * np.array(sigmas)
    error = np.full((len(sigmas), 3), 3.0)
    assert over_scatter(mean, error, of_rows(*[8] * len(sigmas))).tolist() == [bool(one) for one in forced]


@pytest.mark.parametrize(("error", "rows", "least"), [
    # Half of its own scatter of a sample and half of the lower quartile's, which is 8 N^2 here.
    (1.0, 8, 5.0), (3.0, 8, 5 * np.sqrt(5.0)), (1.0, 32, 5 * np.sqrt(0.5 * (32 + 8) / 32)), (0.5, 8, 5 * np.sqrt(0.625))])
def test_the_scatter_of_a_target_is_steadied_by_that_of_the_calm_ones(error: float, rows: int, least: float) -> None:
    """Of eight others of 1 N in eight rows."""
    errors, rows_of = np.ones((9, 3)), of_rows(*[8] * 4, rows, *[8] * 4)
    errors[4] = error
    for size in (0.99, 1.01):
        mean = np.zeros((9, 6))
        mean[4, 1] = size * least
        assert over_scatter(mean, errors, rows_of).tolist() == [False] * 4 + [size > 1] + [False] * 4


def test_of_few_rows_and_of_moments_any_mean_that_is_not_zero_is_a_force() -> None:
    """Seven rows of one target, eight of the others, none of the last: its mean is nothing by itself."""
    mean, rows = np.zeros((6, 6)), of_rows(8, 7, 7, 8, 8, 0)
    mean[1, 0], mean[3, 5] = 1e-6, 1e-6
    assert over_scatter(mean, np.ones((6, 3)), rows).tolist() == [False, True, False, True, False, False]
    assert over_scatter(mean[:3], np.ones((3, 3)), of_rows(1, 7, 7)).tolist() == [False, True, False]


GAP_CASES = [
    # Between 100 N at target 1 and 200 N behind the gap: shares of what stands between, what is sampled, which moves cut.
    ((0.51,), {}, True), ((0.49,), {}, False), ((-1.0,), {}, False), ((0.51, 0.51, 0.51), {}, True),
    ((0.51, 0.51, 0.51, 0.51), {}, False), ((1.0, 0.49, 1.0), {}, False), ((1.0, 1.0), {"air": 2}, False),
    ((1.0, 1.0), {"air": 4}, False), ((1.0, 1.0), {"air": 1}, True), ((1.0, 1.0), {"air": 5}, True)]


@pytest.mark.parametrize(("shares", "change", "filled"), GAP_CASES)
def test_up_to_three_targets_with_half_of_the_force_beside_them_belong_to_the_cut(
    shares: tuple[float, ...], change: dict[str, int], filled: bool
) -> None:
    """The move to target 2 goes into the gap, that to the target behind it out of it; one without a sample stays without."""
    count = len(shares)
    force = np.zeros((count + 4, 3))
    force[1], force[count + 2] = [60, 80, 0], [120, 160, 0]
    way = np.arange(1, count + 1)[:, None] / (count + 1)
    force[2:count + 2] = np.array(shares)[:, None] * ((1 - way) * force[1] + way * force[count + 2])
    forced = np.isin(np.arange(count + 4), (1, count + 2))
    cutting = np.arange(count + 4) != change.get("air", -1)
    sampled = np.arange(count + 4) != 3
    found = without_gaps(forced, sampled, cutting, force)
    expected = forced.copy()
    expected[2:count + 2] = filled & sampled[2:count + 2]
    assert found.tolist() == expected.tolist()
    # Nothing between two means that are none is no force.
    assert without_gaps(forced, sampled, cutting, 0 * force).tolist() == forced.tolist()


def test_forces_that_turn_round_between_the_ends_of_a_gap_have_nothing_half_way() -> None:
    """100 N one way and the other: at one quarter 50 N are expected, in the middle none."""
    forced, every = np.array([True, False, False, False, True]), np.ones(5, dtype=bool)
    force = np.zeros((5, 3))
    force[:, 0] = [100, 50, 0, -50, -100]
    assert without_gaps(forced, every, every, force).tolist() == forced.tolist()
