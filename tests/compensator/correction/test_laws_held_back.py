"""What is held back of a correction and what refuses it: by how much, where, and how it is said, on targets made here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.correctable import refuse_outside
from compensator.correction.correction import (
    Restraint,
    _at_corners,
    _before_walls,
    _beside_air,
    _check_size,
    _hold_back,
    _in_objects,
    _limited,
    _restrained,
    _singularity,
)
from compensator.path.legs import Poses
from compensator.rapid import read_rapid
from identification.common.findings import Finding, Refused
from identification.model.kinematics import forward
from identification.model.rotations import Frame
from tests.runs.command_line import user_files as kit
from tests.support import robot

TURN = Rotation.from_rotvec([0.4, -0.9, 0.3])
START = np.radians([10.0, 20, -15, 25, 40, 30])


def told(target: int, code: str, level: Any, message: str, hint: str = "") -> Finding:
    return Finding(code, level, message, target=target, hint=hint)


def turned() -> Any:
    """The resting frame stands turned in the base."""
    return SimpleNamespace(turned_to_rest=lambda vectors, rows: TURN.inv().apply(vectors),
                           turned_to_base=lambda vectors, rows: TURN.apply(vectors))


def corner(count: int = 5) -> Any:
    """So many targets a millimetre apart along x, and as many along y from the last of them."""
    places = [(k, 0) for k in range(count)] + [(count - 1, k) for k in range(1, count)]
    text = read_rapid(kit.module([kit.move(f"[[{x},{y},0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]")
                                  for x, y in places]).encode())
    length = 1e-3 * np.arange(len(places))
    return SimpleNamespace(toolpath=text.toolpath, world_position=text.toolpath.position, length=length, axes=turned(),
                           finding=told, known=np.full(len(places), True),
                           rest_from_tcp=SimpleNamespace(position=text.toolpath.position))


def loaded(path: Any, **more: Any) -> Any:
    count = len(path.toolpath)
    forces = SimpleNamespace(samples=np.ones(count), forced=np.full(count, True))
    given = {"path": path, "targets": np.arange(count), "forces": forces, "wrench": np.zeros((count, 6))}
    return SimpleNamespace(**given | more)


def restraint(position: np.ndarray, sigma: float, **more: Any) -> Restraint:
    """A prediction with this sigma [m] of each component."""
    count = len(position)
    known: Any = SimpleNamespace(position=position, known=np.tile(sigma**2 * np.eye(3), (count, 1, 1)))
    return Restraint(**{"prediction": known, "stood": np.zeros((count, 3)), "confidence": 0.9, "slope": np.inf,
                        "tolerance": 5e-6, "depth": np.full(count, np.nan), "air": np.zeros(count)} | more)


def test_a_correction_that_is_small_against_its_sigma_is_reduced_or_left_out() -> None:
    """At a confidence of 0.9, 1.2816 sigma: a straight line of 20, 100, 1000 um with 50 of sigma. Of 20 nothing is made, of 100
    2 (1 - 0.6408), and all of 1000."""
    path = corner(3)
    size = 1e-6 * np.array([20.0, 100, 1000, 1000, 1000])
    full = np.outer(size, [0.6, 0, -0.8])
    made, findings = _restrained(loaded(path, targets=np.array([0, 1])), full[:2], restraint(-full[:2], 50e-6))
    share = 2 * (1 - 1.2815516 * 50 / 100)
    np.testing.assert_allclose(made, [[0, 0, 0], share * full[1]], atol=1e-12)
    [said] = findings
    assert (said.code, said.level, said.target) == ("CS4112", "note", 1)
    assert said.message == ("small against their own uncertainty: 2 corrections; 1 left out, 1 reduced; up to "
                            f"{100 * (1 - share):.1f} um of expected deviation stay")
    assert "at least 0.9 (--confidence)" in said.hint
    made, findings = _restrained(loaded(path, targets=np.array([0])), full[2:3], restraint(-full[2:3], 50e-6))
    np.testing.assert_allclose(made, full[2:3], atol=1e-15)
    assert findings == []


@pytest.mark.parametrize(("slope", "held_um"), [(0.02, [0, 0, 0, 0]), (0.01, [0, 10, 0, 0]), (0.005, [0, 15, 0, 0])])
def test_a_step_is_held_to_the_slope_and_told_where_it_is_held_the_most(slope: float, held_um: list[float]) -> None:
    """20 um at one target of a straight way, a millimetre from its neighbours, along one axis of the resting frame."""
    path = corner(4)
    full = TURN.apply(1e-6 * np.outer([0, 20, 0, 0], [0, 1.0, 0]))
    made, findings = _restrained(loaded(path, targets=np.arange(4)), full, restraint(-1e3 * full - 1e-3, 1e-9, slope=slope))
    np.testing.assert_allclose(1e6 * np.linalg.norm(full - made, axis=1), held_um, atol=1e-6)
    assert [(one.code, one.level, one.target, one.message) for one in findings] == ([(
        "CS4113", "warning", 1, f"the correction would change by more than {1e3 * slope:g} um a millimetre: it is reduced at 1 "
        f"target, by up to {held_um[1]:.1f} um")] if any(held_um) else [])


def test_of_several_steps_the_one_is_told_that_is_held_the_most() -> None:
    path = corner(9)
    full = TURN.apply(1e-6 * np.outer([0, 20, 0, 0, 0, 40, 0, 0], [0, 0, 1.0]))
    _, [said] = _restrained(loaded(path, targets=np.arange(8)), full, restraint(-1e3 * full - 1e-3, 1e-9, slope=0.01))
    assert (said.code, said.target) == ("CS4113", 5)
    assert said.message.endswith("it is reduced at 2 targets, by up to 30.0 um")


def test_no_slope_limits_the_way_to_a_sharp_corner_and_from_it_and_air_stays() -> None:
    """Steps of 100 um at the corner, target 4, stay; between others the slope is 10 um a millimetre; what has samples and no
    force is air and stands still, what has none is no neighbour."""
    path, offset = corner(5), np.zeros((9, 3))
    offset[:, 2] = 1e-6 * np.array([0, 0, 0, 100, 300, 200, 200, 200, 200])
    made = _limited(loaded(path), offset, 0.01)
    assert 1e6 * made[:, 2] == pytest.approx([0, 0, 0, 10, 300, 200, 200, 200, 200])
    some = np.array([3, 4, 5, 6, 7])
    forces = SimpleNamespace(samples=np.array([1, 1, 0, 1, 1, 1, 1, 1, 5]), forced=np.isin(np.arange(9), some))
    made = _limited(loaded(path, targets=some, forces=forces), offset[some], 0.01)
    assert 1e6 * made[:, 2] == pytest.approx([20, 300, 30, 20, 10])
    forces.samples[[0, 1, 8]] = 0
    assert 1e6 * _limited(loaded(path, targets=some, forces=forces), offset[some], 0.01)[:, 2] == pytest.approx(
        [100, 300, 200, 200, 200])


@pytest.mark.parametrize(("tolerance", "said"), [(99e-6, True), (101e-6, False)])
def test_a_corner_that_serves_two_forces_is_told_with_what_each_asks_for(tolerance: float, said: bool) -> None:
    """200 um are asked for before it and 100 behind it, 161 apart; of what the means over both ask for 117 um would be left
    behind it, which it takes no more of than it had: 100."""
    path, offset = corner(3), np.zeros((5, 3))
    offset[:2], offset[3:], offset[2] = [200e-6, 0, 0], [60e-6, 80e-6, 0], [160e-6, 20e-6, 0]
    asked = TURN.apply(offset)
    made, findings = _at_corners(loaded(path), asked, restraint(asked, 0.0, tolerance=tolerance))
    step = offset[2] - offset[3]
    there = offset[3] + step / np.linalg.norm(step) * 100e-6
    np.testing.assert_allclose(made, TURN.apply(np.vstack([offset[:2], there, offset[3:]])), atol=1e-9)
    assert [(one.code, one.level, one.target, one.message) for one in findings] == ([(
        "CS4114", "warning", 2, "one target serves two forces at 1 corner: before this one 200 um are asked for, behind it "
        "100 um, 161 um apart; up to 100 um are left there")] if said else [])
    straight = _at_corners(loaded(path, targets=np.arange(2)), asked[:2], restraint(asked[:2], 0.0))
    assert (straight[0].tolist(), straight[1]) == (asked[:2].tolist(), [])


@pytest.mark.parametrize(("tolerance", "said"), [(59e-6, True), (61e-6, False)])
def test_what_is_held_beside_air_is_told_beyond_the_tolerance(tolerance: float, said: bool) -> None:
    """Of 100 um, three quarters of the way to which is air, as much is made as is off by the 30 um of its sigma there: 40."""
    path = corner(3)
    offset = np.outer([100e-6, 100e-6, 10e-6, 0, 0], [0, 0.6, 0.8])
    air = np.array([0.0, 0.75, 0.75, 0, 0])
    made, findings = _beside_air(loaded(path), offset, restraint(offset, 30e-6 / np.sqrt(3), air=air, tolerance=tolerance))
    assert 1e6 * np.linalg.norm(made, axis=1) == pytest.approx([100, 40, 10, 0, 0])
    assert [(one.code, one.level, one.target) for one in findings] == ([("CS4119", "note", 1)] if said else [])
    assert all("air than one can be added: 1 correction is held back beside it, by up to 60 um, so as" in one.message
               for one in findings)


def test_before_a_wall_that_nothing_tells_of_nothing_is_held() -> None:
    offset = np.outer(np.full(5, 100e-6), [0, 0.6, 0.8])
    made, findings = _before_walls(loaded(corner(3), targets=np.arange(2)), offset[:2], restraint(offset[:2], 1e-6))
    np.testing.assert_allclose(made, offset[:2], atol=1e-15)
    assert findings == []


@pytest.mark.parametrize(("offset_mm", "tilt_deg", "said"), [
    ((0.99, 0.2, 0), (0, 0.99, 0), []),
    ((1.01, 0.2, 1.5), (0, 0, 0), ["2 corrections exceed the limit: the largest offset is 1.500 mm, the limit 1 mm"]),
    ((0, 0, 0), (0, 1.01, 0), ["1 correction exceeds the limit: the largest rotation is 1.010 deg, the limit 1 deg"]),
    ((1.2, 0, 0), (2, 0, 3), ["1 correction exceeds the limit: the largest offset is 1.200 mm, the limit 1 mm",
                              "2 corrections exceed the limit: the largest rotation is 3.000 deg, the limit 1 deg"])])
def test_a_correction_over_the_limits_of_the_cell_is_refused(
    offset_mm: tuple[float, ...], tilt_deg: tuple[float, ...], said: list[str]
) -> None:
    path: Any = SimpleNamespace(cell=SimpleNamespace(max_offset=1e-3, max_tilt=np.radians(1.0)), finding=told)
    asked = np.array([4, 7, 9]), 1e-3 * np.outer(offset_mm, [0, 0.6, -0.8]), np.radians(np.outer(tilt_deg, [0.8, 0, 0.6]))
    if not said:
        _check_size(path, *asked)
        return
    with pytest.raises(Refused) as stopped:
        _check_size(path, *asked)
    worst = [int(asked[0][np.argmax(values)]) for values, over in ((offset_mm, 1), (tilt_deg, 1)) if max(values) > over]
    assert [(one.code, one.level, one.target, one.message) for one in stopped.value.findings] == [
        ("CS4107", "error", target, words) for target, words in zip(worst, said, strict=True)]


def beside(fifth: list[float]) -> tuple[Any, np.ndarray]:
    """Targets with axis 5 at so many degrees."""
    theta = np.tile(START, (len(fifth), 1))
    theta[:, 4] = np.radians(fifth)
    return SimpleNamespace(cell=SimpleNamespace(robot=robot()), theta=theta, finding=told), theta


@pytest.mark.parametrize(("fifth", "code", "words"), [
    ([30, 2.01, -2.01], "", ""),
    ([30, -1.99, 2.5], "CS4110", "1 target with force is within 2 deg of the wrist singularity, the closest 1.99 deg: axes 4 "
                                 "and 6 turn fast there"),
    ([0.101, 1.5, 1], "CS4110", "3 targets with force are within 2 deg of the wrist singularity, the closest 0.10 deg: axes 4 "
                                "and 6 turn fast there")])
def test_near_the_wrist_singularity_is_told_with_the_closest(fifth: list[float], code: str, words: str) -> None:
    path, theta = beside(fifth)
    found = _singularity(path, np.arange(3), theta)
    closest = int(np.argmin(np.abs(fifth)))
    assert [(one.code, one.level, one.target, one.message) for one in found] == (
        [(code, "warning", closest, words)] if code else [])


def test_at_the_wrist_singularity_or_past_it_is_refused() -> None:
    """0.1 deg are needed, on the side where the plan is; twenty places are told, and how many more."""
    path, _ = beside([30, 0.3, 0.3, 0.3, -0.3])
    theta = path.theta.copy()
    theta[1:, 4] = np.radians([0.099, -0.2, 0.101, -0.101])
    with pytest.raises(Refused) as stopped:
        _singularity(path, np.arange(5), theta)
    assert [(one.code, one.target, one.message) for one in stopped.value.findings] == [
        ("CS4106", 1, "axis 5 is 0.099 deg from the wrist singularity after correction, at least 0.1 deg are needed"),
        ("CS4106", 2, "the correction takes axis 5 through zero, the wrist singularity, to 0.200 deg on the other side")]
    many, theta = beside([0.05] * 23)
    with pytest.raises(Refused) as stopped:
        _singularity(many, np.arange(23), theta)
    assert len(stopped.value.findings) == 21
    assert stopped.value.findings[-1].target == 20
    assert stopped.value.findings[-1].message == "3 more targets at the wrist singularity after correction, or past it"


def test_a_joint_beyond_its_limits_is_refused_where_it_is_farthest() -> None:
    """A finding a joint, of so many targets; at the limit itself it is none."""
    one = robot()
    high, low = np.degrees([one.limits[5, 1], one.limits[0, 0]])
    theta = np.tile(START, (4, 1))
    theta[:, 5] = one.limits[5, 1] + np.radians([0.0, 0.5, 1.5, -3])
    theta[3, 0] = one.limits[0, 0] - np.radians(0.25)
    frame = SimpleNamespace(name="tMill", position=np.zeros(3))
    path: Any = SimpleNamespace(cell=SimpleNamespace(robot=one), finding=told, toolpath=SimpleNamespace(
        tool=np.zeros(9, dtype=int), workobject=np.zeros(9, dtype=int), tools=(frame,), workobjects=(frame,)))
    refuse_outside(path, np.array([2, 4]), theta[[0, 0]], "as planned")
    with pytest.raises(Refused) as stopped:
        refuse_outside(path, np.array([2, 4, 6, 8]), theta, "after correction")
    limits = [f"limits {np.degrees(a):g} to {np.degrees(b):g} deg" for a, b in one.limits[[0, 5]]]
    assert [(found.code, found.level, found.target, found.count, found.message) for found in stopped.value.findings] == [
        ("CS4105", "error", 8, 1, f"after correction: joint 1 at {low - 0.25:.4f} deg, {limits[0]}"),
        ("CS4105", "error", 6, 2, f"after correction: joint 6 at {high + 1.5:.4f} deg, {limits[1]}")]


def test_a_part_of_a_correction_is_that_part_of_its_turn_and_the_offset_that_is_asked_for() -> None:
    """Reached by the joints, at the places that are held alone; a share over one turns no farther than in full."""
    one, tool = robot(), Frame(np.eye(3), np.array([0.05, 0.02, 0.25]))
    theta = START + 0.05 * np.arange(4)[:, None] * [1, 0, -1, 1, 1, 0]
    plan, turns = forward(one, theta, tool), Rotation.from_rotvec(1e-3 * np.random.default_rng(5).normal(size=(4, 3)))
    full = Frame(turns.as_matrix() @ plan.rotation, plan.position + 1e-4)
    job: Any = SimpleNamespace(
        targets=np.array([1, 3, 5, 6]), model=SimpleNamespace(robot=one), path=SimpleNamespace(
            base_from_tcp=Frame(np.tile(np.eye(3), (7, 1, 1)), np.zeros((7, 3))),
            flange_from_tcp=Frame(np.tile(tool.rotation, (7, 1, 1)), np.tile(tool.position, (7, 1)))))
    job.path.base_from_tcp.rotation[job.targets], job.path.base_from_tcp.position[job.targets] = plan.rotation, plan.position
    commanded = Poses(Frame(full.rotation.copy(), full.position.copy()), theta.copy())
    offset = 1e-5 * np.array([[1.0, 2, 3], [4, 5, 6]])
    _hold_back(job, commanded, np.array([1, 2]), np.array([0.25, 1.3]), offset)
    for k, (place, share) in enumerate(((1, 0.25), (2, 1.0))):
        part = Rotation.from_rotvec(share * turns[place].as_rotvec()).as_matrix() @ plan.rotation[place]
        np.testing.assert_allclose(commanded.base_from_tcp.rotation[place], part, atol=1e-12)
        np.testing.assert_allclose(commanded.base_from_tcp.position[place], plan.position[place] + offset[k], atol=1e-12)
    there = forward(one, commanded.theta, tool)
    np.testing.assert_allclose(there.position[1:3], commanded.base_from_tcp.position[1:3], atol=1e-8)
    np.testing.assert_allclose(there.rotation[1:3], commanded.base_from_tcp.rotation[1:3], atol=1e-8)
    np.testing.assert_array_equal(commanded.theta[[0, 3]], theta[[0, 3]])
    np.testing.assert_array_equal(commanded.base_from_tcp.position[[0, 3]], full.position[[0, 3]])


def test_what_is_commanded_is_told_in_each_target_s_work_object() -> None:
    """Commanded minus planned, along its axes; by which vector it is turned against the plan."""
    rng = np.random.default_rng(6)
    objects, planned = Rotation.random(6, random_state=1), Rotation.random(6, random_state=2)
    origin, place, shift = rng.normal(size=(3, 6, 3))
    turn = 0.02 * rng.normal(size=(6, 3))
    chosen = np.array([1, 2, 5])
    job: Any = SimpleNamespace(targets=chosen, path=SimpleNamespace(
        base_from_object=Frame(objects.as_matrix(), origin), base_from_tcp=Frame(planned.as_matrix(), place)))
    commanded = Frame((Rotation.from_rotvec(turn) * planned).as_matrix()[chosen], (place + 1e-3 * shift)[chosen])
    position, quaternion, offset, turned_by = _in_objects(job, commanded)
    back = objects[chosen].inv()
    np.testing.assert_allclose(position, back.apply((place + 1e-3 * shift - origin)[chosen]), atol=1e-12)
    np.testing.assert_allclose(offset, 1e-3 * back.apply(shift[chosen]), atol=1e-12)
    np.testing.assert_allclose(turned_by, back.apply(turn[chosen]), atol=1e-9)
    found = Rotation.from_quat(quaternion, scalar_first=True)
    assert (found * (back * Rotation.from_matrix(commanded.rotation)).inv()).magnitude() == pytest.approx(0, abs=1e-7)
