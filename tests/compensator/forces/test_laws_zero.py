"""What a log shows without contact at each target, worked out by hand: bias, weight and moment of what hangs on the sensor."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from compensator.forces.payload import estimate_payload
from compensator.forces.placement import _in_frames
from compensator.forces.target_rows import TargetRows
from compensator.forces.zero import Zero, zero_of
from compensator.path.robot_path import RobotPath
from identification.common.findings import CompstiffError
from tests.compensator.forces.test_laws_payload import tilted_plan

CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\nforce_log: "
PLACE, QUATERNION = np.array([5.0, -20, 90]), [0.9, 0.1, -0.3, 0.3]
TURN = Rotation.from_quat([0.1, -0.3, 0.3, 0.9])
SENSOR = f"sensor_position_mm: {PLACE.tolist()}, sensor_quaternion: {QUATERNION}"
MASS, CENTRE, COUNT = 9.5, np.array([0.03, -0.05, 0.12]), 12
STATED = np.array([14.0, -31, 55, 0.6, -1.4, 0.25])
BIAS = "bias_n: [14, -31, 55], bias_nm: [0.6, -1.4, 0.25]"
PAYLOAD = "payload: {mass_kg: 9.5, centre_of_mass_mm: [30, -50, 120]}"


def axes(path: RobotPath, frame: str) -> tuple[Rotation, np.ndarray]:
    """The log's axes in the base at each target, and where its origin is."""
    flange = Rotation.from_matrix(path.base_from_flange.rotation)
    if frame == "tool":
        return Rotation.from_matrix(path.base_from_tcp.rotation), path.base_from_tcp.position
    return flange * TURN, path.base_from_flange.position + flange.apply(1e-3 * PLACE)


def hanging(path: RobotPath, frame: str, mass: float, centre: np.ndarray | None) -> np.ndarray:
    """What a sensor in such a frame shows (N, 6) of a mass at its centre (3,) in the flange frame; no centre: no moment."""
    turn, origin = axes(path, frame)
    pulls = np.tile([0, 0, -9.80665 * mass], (COUNT, 1))
    at = origin if centre is None else path.base_from_flange.position + Rotation.from_matrix(
        path.base_from_flange.rotation).apply(centre)
    return np.hstack([turn.inv().apply(pulls), turn.inv().apply(np.cross(at - origin, pulls))])


def log_of(has_moment: bool = True) -> Any:
    return SimpleNamespace(source="log.csv", has_moment=has_moment)


def zero(path: RobotPath, shown: np.ndarray, tare: tuple[tuple[int, int], ...] = (), each: Any = 4, has_moment: bool = True
         ) -> Zero:
    """The zero of a log with so many rows of two samples at each target, whose means are `shown` (N, 6)."""
    target = np.repeat(np.arange(COUNT), each)
    rows = TargetRows(COUNT, target, np.full(len(target), 2.0))
    return zero_of(log_of(has_moment), path, path.cell, shown[target][:, : 6 if has_moment else 3], rows, tare, trusted=True)


def said(found: Zero, *codes: str) -> list[tuple[str, str, str]]:
    assert all(one.file == "log.csv" for one in found.findings)
    return [(one.code, one.level, one.message) for one in found.findings if one.code in codes]


@pytest.mark.parametrize("frame", ["tool", "sensor"])
@pytest.mark.parametrize(("sign", "times"), [("on_tool", 1), ("by_tool", -1)])
@pytest.mark.parametrize(("stated", "has_moment"), [
    (f", {BIAS}, weight: in_log, {PAYLOAD}", True), (f", {BIAS}, weight: in_log, {PAYLOAD}", False),
    (f", weight: in_log, {PAYLOAD}", True), (f", {PAYLOAD}", True), (f", {BIAS}, payload: {{mass_kg: 9.5}}", True),
    (f", {BIAS}, weight: removed, {PAYLOAD}", True), (f", {BIAS}", True), ("", True)])
def test_without_a_tare_the_zero_is_what_the_cell_states(
    tmp_path: Path, frame: str, sign: str, times: int, stated: str, has_moment: bool
) -> None:
    path = tilted_plan(tmp_path, CELL + f"{{frame: {frame}, {SENSOR}, sign: {sign}{stated}}}")
    bias = STATED * (BIAS in stated) * ([1] * 3 + [has_moment] * 3)
    holds = "payload" in stated and "removed" not in stated
    knows = holds and "centre" in stated and has_moment
    weight = times * hanging(path, frame, MASS * holds, CENTRE if knows else None)
    found = zero(path, bias + weight, has_moment=has_moment)
    assert_allclose(found.offset, bias + weight, atol=1e-6)
    if BIAS in stated:
        assert found.bias == pytest.approx(bias)
    assert (found.bias is None, found.noise, found.spread, found.own_std) == (BIAS not in stated, None, None, 0.0)
    sure = BIAS in stated or "weight" in stated
    assert said(found, "CS3031", "CS3013", "CS3008") == [
        ("CS3013", "warning", "the moment of the payload of 9.5 kg is not subtracted: its centre of mass is not known")
    ] * (holds and not knows and has_moment) + [
        ("CS3031", "note" if sure else "warning", "the weight of the payload of 9.5 kg, 93 N, was subtracted at each target's "
         "orientation")] * holds


def test_a_log_in_the_base_frame_has_no_weight_taken_off(tmp_path: Path) -> None:
    path = tilted_plan(tmp_path, CELL + f"{{frame: base, sign: on_tool, {BIAS}, weight: in_log, {PAYLOAD}}}")
    found = zero(path, np.tile(STATED, (COUNT, 1)))
    assert_allclose(found.offset, np.tile(STATED, (COUNT, 1)))
    assert found.findings == ()


@pytest.mark.parametrize("sign", ["on_tool", "by_tool"])
@pytest.mark.parametrize("each", [4, [4] * 6 + [40] + [4] * 5])
def test_a_tare_gives_the_bias_beside_the_stated_weight(tmp_path: Path, sign: str, each: Any) -> None:
    """Whatever cell.yaml says of the bias, and however many rows a target has: stretches count alike, and in each its rows."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: sensor, {SENSOR}, sign: {sign}, {BIAS}, weight: in_log, {PAYLOAD}}}")
    weight = (1 if sign == "on_tool" else -1) * hanging(path, "sensor", MASS, CENTRE)
    bias, apart = np.array([3.011, 2.003, -1.004, 0.1, 0.2, 0.3]), np.arange(COUNT)[:, None] * [0.5, -0.25, 0.1, 0.01, 0.02, 0]
    found = zero(path, bias + weight + apart, ((0, 1), (6, 8)), each)
    middle = (10 * 6 + 7 + 8) / 12 if isinstance(each, list) else 7.0
    expected = bias + 0.5 * (0.5 + middle) * np.array([0.5, -0.25, 0.1, 0.01, 0.02, 0])
    assert found.bias == pytest.approx(expected, abs=1e-6)
    assert_allclose(found.offset, expected + weight, atol=1e-6)
    assert [one[:2] for one in said(found, "CS3031", "CS3013", "CS3033")] == [("CS3031", "note")]
    [(_, level, message)] = said(found, "CS3008")
    listed = ", ".join(f"{x:.2f}" for x in expected[:3])
    assert (level, message) == ("note", f"bias {listed} N, mean of targets 0 to 1, 6 to 8, was subtracted")


@pytest.mark.parametrize(("frame", "has_moment"), [("sensor", True), ("tool", True), ("sensor", False)])
@pytest.mark.parametrize("sign", ["on_tool", "by_tool"])
def test_stretches_tell_a_payload_that_is_held_at_each_target(tmp_path: Path, frame: str, has_moment: bool, sign: str) -> None:
    """That of still readings which are the means over the stretches (test_laws_payload_numbers), in the noise of these; its
    centre in the log's frame; as unsure as they make it at each target."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: {frame}, {SENSOR}, sign: {sign}}}")
    times = 1 if sign == "on_tool" else -1
    rng, stretches = np.random.default_rng(3), ((0, 0), (3, 3), (6, 6), (11, 11))
    each = [40, 1, 1, 60, 1, 1, 80, 1, 1, 1, 1, 120]
    target = np.repeat(np.arange(COUNT), each)
    load = (STATED + times * hanging(path, frame, MASS, CENTRE))[target]
    load += rng.normal(0, [0.3] * 3 + [0.02] * 3, load.shape)
    rows = TargetRows(COUNT, target, np.full(len(target), 2.0))
    found = zero_of(log_of(has_moment), path, path.cell, load[:, : 6 if has_moment else 3], rows, stretches, trusted=True)
    means = np.array([load[target == k].mean(axis=0) for k, _ in stretches])
    means[:, 3:] *= has_moment
    fall = axes(path, frame)[0].inv().apply(np.tile([0, 0, -9.80665], (COUNT, 1)))
    assert found.noise is not None
    assert found.spread is not None
    samples = 2.0 * np.array([40, 60, 80, 120])
    told = estimate_payload(fall[[k for k, _ in stretches]], times * means, has_moment=has_moment,
                            noise=found.noise / np.sqrt(samples)[:, None])
    assert told is not None
    arm = np.zeros(3) if told.centre is None else told.centre
    pulls = told.mass * fall
    weight = times * np.hstack([pulls, np.cross(np.tile(arm, (COUNT, 1)), pulls)])
    bias = (means - weight[[k for k, _ in stretches]]).mean(axis=0)
    assert found.bias == pytest.approx(bias, abs=1e-5)
    assert_allclose(found.offset, bias + weight, atol=1e-5)
    effective = 16 / np.sum(1 / samples)
    assert_allclose(found.spread[1], told.covariance(fall, found.spread[0][3:, 3:] / effective), rtol=1e-5, atol=1e-9)
    assert found.own_std == 0.0
    text = f"payload {told.mass:.2f} +- {2 * told.mass_std:.2f} kg"
    if told.centre is not None and told.centre_std is not None:
        text += ", centre {} +- {} mm in the log's frame".format(*(
            ", ".join(f"{1e3 * x:.1f}" for x in values) for values in (told.centre, 2 * told.centre_std)))
    assert said(found, "CS3033") == [("CS3033", "note", f"{text}, estimated from 4 stretches of --tare (+-: 2 sigma)")]
    assert [one[:2] for one in said(found, "CS3013")] == []
    assert (told.centre is None) == (not has_moment)


def test_stretches_that_hardly_turn_the_sensor_tell_no_payload(tmp_path: Path) -> None:
    """Two neighbours: the turn about their middle, as the message says it."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: sensor, {SENSOR}, sign: on_tool}}", count=60)
    target = np.repeat(np.arange(60), 4)
    found = zero_of(log_of(), path, path.cell, np.zeros((240, 6)), TargetRows(60, target, np.ones(240)), ((0, 0), (1, 1)),
                    trusted=True)
    fall = Rotation.from_matrix(path.base_from_flange.rotation[:2]).inv().apply([0, 0, -1.0])
    turn = np.degrees(np.linalg.norm(fall[1] - fall[0]) / 2)
    assert said(found, "CS3034") == [("CS3034", "note", f"the 2 stretches of --tare turn the sensor by {turn:.1f} deg: that "
                                      "does not tell a payload from the bias")]
    assert found.own_std == 0.0
    assert found.spread is not None
    assert found.spread[1].shape == (6, 6)


@pytest.mark.parametrize("kind", ["sensor", "tool", "base"])
@pytest.mark.parametrize("known", [True, False])
def test_a_log_is_read_in_each_frame_that_it_may_be_in(tmp_path: Path, kind: str, known: bool) -> None:
    """In the one that is stated as it is read; in the sensor's where that is known, and with its quaternion in the other order
    where it is the sensor's log."""
    if kind == "sensor" and not known:
        return
    path = tilted_plan(tmp_path, CELL + f"{{frame: {kind}, sign: by_tool{', ' + SENSOR if known else ''}}}")
    logged, force = np.random.default_rng(1).normal(0, 50, (2, COUNT, 3))
    frames = {"base": -logged, "tool": axes(path, "tool")[0].apply(-logged)}
    if known:
        frames["sensor"] = axes(path, "sensor")[0].apply(-logged)
    if kind == "sensor":
        flange = Rotation.from_matrix(path.base_from_flange.rotation)
        frames["sensor, its quaternion read as x y z w"] = (flange * Rotation.from_quat(QUATERNION)).apply(-logged)
    found = _in_frames(force, logged, path, path.cell)
    assert set(found) == set(frames)
    for name, expected in (frames | {kind: force}).items():
        assert_allclose(found[name], expected, atol=1e-6)


@pytest.mark.parametrize(("silent", "holding", "of_it", "refused"), [
    (3, 0, 1.0, True), (2, 0, 1.0, False), (35, 2, 1.0, True), (35, 3, 1.0, False), (35, 3, 0.19, True), (35, 3, 0.21, False)])
def test_a_log_holds_no_weight_by_the_quietest_twentieth_of_its_targets(
    tmp_path: Path, silent: int, holding: int, of_it: float, refused: bool
) -> None:
    """The third of 41: of those that show least, and of those that are left with least when the weight is taken off. Some show
    nothing, some the weight or a part of it, all others a force as large as it the other way."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: sensor, {SENSOR}, sign: on_tool, {PAYLOAD}}}", count=41)
    turn = Rotation.from_matrix(path.base_from_flange.rotation) * TURN
    weight = turn.inv().apply([0, 0, -9.80665 * MASS])
    times = np.where(np.arange(41) < silent, 0, np.where(np.arange(41) >= 41 - holding, of_it, -1))
    rows, load = TargetRows(41, np.arange(41), np.ones(41)), times[:, None] * weight
    if not refused:
        assert zero_of(log_of(False), path, path.cell, load, rows, ()).bias is None
        return
    with pytest.raises(CompstiffError, match="CS3032.* of 9.5 kg weighs 93 N, and the quietest targets of the log show 0.0 N"):
        zero_of(log_of(False), path, path.cell, load, rows, ())


@pytest.mark.parametrize("newton", [9.80665, 4.4482216])
def test_a_tare_that_takes_most_of_a_weight_back_names_the_unit_that_would(tmp_path: Path, newton: float) -> None:
    """A weight in another unit, to three tenths of it either way."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: sensor, {SENSOR}, sign: on_tool, {PAYLOAD}}}")
    weight = hanging(path, "sensor", MASS, CENTRE)[0]
    for times, named in ((1.29, True), (1.31, False), (0.71, True), (0.69, False)):
        shown = np.tile(weight, (COUNT, 1)) * times / newton
        [(_, level, message)] = said(zero(path, shown, ((0, 0),)), "CS3130")
        assert level == "warning"
        left = times / newton
        assert message.startswith(f"the bias takes {100 * (1 - left):.0f} % of the weight of 9.5 kg back: the log shows "
                                  f"{93.163175 * left:.0f} of 93 N")
        assert (f"; forces in {'kgf' if newton > 5 else 'lbf'} would be so" in message) == named


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize(("mass", "noise"), [(0.5, 3.0), (9.5, 0.1)])
def test_stretches_contradict_a_mass_by_a_tenth_of_its_weight_and_beyond_chance(
    tmp_path: Path, count: int, mass: float, noise: float
) -> None:
    """One is off the others, so far off their mean as four sigma of how far it would be off it by noise, in space, or a tenth
    of the weight; a little more is told, a little less is not."""
    path = tilted_plan(tmp_path, CELL + f"{{frame: sensor, {SENSOR}, sign: on_tool, payload: {{mass_kg: {mass}}}}}")
    stretches, each = ((0, 0), (3, 3), (6, 6), (11, 11))[:count], np.ones(COUNT, dtype=int)
    each[[0, 3, 6, 11]] = [30, 60, 120, 240]
    target = np.repeat(np.arange(COUNT), each)
    load = hanging(path, "sensor", mass, None)[target, :3] + noise * np.random.default_rng(5).normal(0, 1, (len(target), 3))
    rows, own = TargetRows(COUNT, target, np.ones(len(target))), each[[0, 3, 6, 11]][:count]
    found = zero_of(log_of(False), path, path.cell, load, rows, stretches, trusted=True)
    assert found.noise is not None
    means = np.array([(load - hanging(path, "sensor", mass, None)[target, :3])[target == k].mean(axis=0) for k, _ in stretches])
    to_mean = np.eye(count) - 1 / count
    # Each is known to noise^2 / n, and so what is off the mean of all.
    sigma = np.linalg.norm(found.noise[:3]) * np.sqrt(np.diag(to_mean @ np.diag(1 / own) @ to_mean.T))
    limit = np.maximum(4 * sigma, 0.1 * mass * 9.80665)
    for share in (0.98, 1.02):
        # The first shifted along x so far that one of them is at that share of its limit, as they scatter besides.
        shifts = np.linspace(0, 100, 100_001)
        off = np.linalg.norm((to_mean @ means)[:, None] + to_mean[:, [0]][:, None] * np.outer(shifts, [1, 0, 0]), axis=2)
        shift = shifts[np.flatnonzero((off / limit[:, None]).max(axis=0) < share)[-1]]
        moved = load + np.outer(target == 0, [shift, 0, 0])
        again = zero_of(log_of(False), path, path.cell, moved, rows, stretches, trusted=True)
        apart = np.linalg.norm(to_mean @ (means + np.outer(np.arange(count) == 0, [shift, 0, 0])), axis=1).max()
        words = f"with a payload of {mass:g} kg taken off, the stretches of --tare differ from their mean by up to {apart:.1f}"
        assert said(again, "CS3046") == ([("CS3046", "warning", f"{words} N")] if share > 1 else [])
