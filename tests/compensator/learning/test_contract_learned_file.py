"""learned.json holds what was learned: written and read back it is the same, its numbers in the units of their names."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import compstiff
from compensator.learned.learned import DRIFT, SETUP, JobFrame, Learned, Repeats, Rest
from compensator.learned.learned_file import learned_json, read_learned
from compensator.learned.remainder import Remainder
from compensator.learning.terms import frame_of
from compensator.path.robot_path import robot_path
from identification.common.findings import CompstiffError, Refused
from identification.model.cell import read_cell
from identification.model.rotations import Frame
from identification.model.stiffness import IdentifiedModel
from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import CarriedJob
from tests.support import robot, write_cell

PLACES, SPRINGS = 3, 6


def learned() -> Learned:
    """Of six springs and three places; every number another one."""
    rng = np.random.default_rng(61)
    count = SPRINGS + SETUP + DRIFT + 3 * PLACES
    root, untold = rng.standard_normal((count, count)), rng.standard_normal((SETUP + DRIFT, SETUP + DRIFT))
    base_from_object = Frame.from_quaternion(np.array([1.2, -0.3, 0.6]), np.array([0.8, 0.0, 0.6, 0.0]))
    frame = JobFrame(base_from_object, np.array([1.3, 0.1, 0.7]), 0.083, 412.0)
    remainder = Remainder(np.round(rng.standard_normal((PLACES, 3)), 6), rng.standard_normal((PLACES, 6)), 0.14, 23e-6)
    return Learned(rng.standard_normal(SPRINGS), rng.standard_normal(count), root @ root.T, frame, remainder, (),
                   {"motion": 1.2}, None, 1e-10 * untold @ untold.T)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    cell, given = read_cell(write_cell(tmp_path)), learned()
    file = tmp_path / "learned.json"
    file.write_text(json.dumps(learned_json(given, cell)))
    back = read_learned(file, cell)
    for one, other in ((back.prior, given.prior), (back.mean, given.mean), (back.covariance, given.covariance),
                       (back.unshown, given.unshown), (back.frame.centre, given.frame.centre),
                       (back.frame.base_from_object.position, given.frame.base_from_object.position),
                       (back.frame.base_from_object.quaternion, given.frame.base_from_object.quaternion),
                       (back.remainder.places, given.remainder.places)):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(other).max())
    np.testing.assert_allclose(back.remainder.posture, given.remainder.posture, atol=1e-8)
    assert (back.frame.radius, back.frame.duration) == pytest.approx((0.083, 412.0), rel=1e-12)
    assert (back.remainder.length, back.remainder.amplitude) == pytest.approx((0.14, 23e-6), rel=1e-12)
    assert (back.effects, back.told, back.source) == ((), {"motion": 1.2}, file)


def still() -> Any:
    """External axes that stand still."""
    return SimpleNamespace(to_rest=lambda frames, rows: frames)


@pytest.mark.parametrize(("off_um", "turn_urad", "repeats", "said"), [
    (9.9, 9.9, "job", ""), (10.1, 0, "setup", "stands 0.0101 mm from where it was measured"),
    (0, 10.1, "job", "is turned by 0.000579 deg against it"), (2000, 0, "nothing", ""),
    (2000, 52360, "job", "stands 2 mm from where it was measured and is turned by 3 deg against it")])
def test_a_set_up_repeats_where_the_work_object_stands_as_it_did(
    off_um: float, turn_urad: float, repeats: Repeats, said: str
) -> None:
    """To 10 um and 10 urad, about any axis, at each target that cuts."""
    given = learned()
    axis = np.array([2.0, -1, 2]) / 3
    moved = Frame(Rotation.from_rotvec(1e-6 * turn_urad * axis).as_matrix(), 1e-6 * off_um * axis[::-1])
    own, there = given.frame.base_from_object, given.frame.base_from_object @ moved
    path: Any = SimpleNamespace(toolpath=SimpleNamespace(source="part.mod"), axes=still(), base_from_object=Frame(
        np.array([own.rotation, there.rotation]), np.array([own.position, there.position])))
    given.check_set_up(path, np.array([0]), repeats)
    given.check_set_up(path, np.array([], dtype=np.intp), repeats)
    if not said:
        given.check_set_up(path, np.array([0, 1]), repeats)
        return
    with pytest.raises(Refused) as stopped:
        given.check_set_up(path, np.array([0, 1]), repeats)
    [found] = stopped.value.findings
    assert (found.code, found.level, found.file) == ("CS5322", "error", "part.mod")
    assert found.message == f"--repeats {repeats}, but the work object {said}: this is another set-up"


@pytest.mark.parametrize("on", ["slide", "table", "both"])
@pytest.mark.parametrize(("moved_mm", "said"), [(0.0, ""), (0.008, ""), (0.012, "stands 0.012 mm"), (3.0, "stands 3 mm")])
def test_a_set_up_repeats_on_a_table_that_turns_and_beside_a_robot_that_travels(
    tmp_path: Path, on: str, moved_mm: float, said: str
) -> None:
    """The work object on its table, and the robot's base, are where they were at the program's first values, whatever they do
    on the way; a part that was clamped elsewhere is another set-up."""
    job = CarriedJob(tmp_path, "J 0,0 L 20,0 L 40,0 L 60,0", on=on, ends=np.array([[950.0, 12, -20], [940.0, 4, 30]]))
    ready = job.job("target,fx_n,fy_n,fz_n\n1,1,1,1\n")
    ready.program = job.program
    ready.write()
    cell, file = read_cell(tmp_path / "cell.yaml"), tmp_path / "part.mod"
    path = robot_path(compstiff.read_toolpath(file, cell).toolpath, cell)
    rows: Any = SimpleNamespace(on_part=path.rest_from_tcp.position[1:], time=np.arange(3.0))
    given = replace(learned(), frame=frame_of(rows, cast(Any, SimpleNamespace(path=path, targets=np.arange(1, 4)))))
    frame = job.in_world if on == "slide" else job.on_unit
    program = file.read_text()
    assert program.count(frame.rapid()) == 1
    file.write_text(program.replace(frame.rapid(), kit.Frame(frame.p + np.array([0, 0, 1e-3 * moved_mm]), frame.r).rapid()))
    again = robot_path(compstiff.read_toolpath(file, cell).toolpath, cell)
    if not said:
        given.check_set_up(again, np.arange(1, 4), "job")
        return
    with pytest.raises(Refused, match=f"CS5322: --repeats job, but the work object {said} from where it was measured"):
        given.check_set_up(again, np.arange(1, 4), "job")


def test_its_numbers_are_in_the_units_of_their_names(tmp_path: Path) -> None:
    written, given = learned_json(learned(), read_cell(write_cell(tmp_path))), learned()
    assert written["job"]["position_mm"] == pytest.approx([1200.0, -300.0, 600.0])
    assert written["job"]["centre_mm"] == pytest.approx([1300.0, 100.0, 700.0])
    assert (written["job"]["radius_mm"], written["job"]["duration_s"]) == pytest.approx((83.0, 412.0))
    assert (written["remainder"]["length_mm"], written["remainder"]["amplitude_um"]) == pytest.approx((140.0, 23.0))
    np.testing.assert_allclose(written["remainder"]["places_mm"], 1000 * given.remainder.places, atol=1e-4)
    np.testing.assert_allclose(written["remainder"]["posture_deg"], given.remainder.posture * 180 / np.pi, atol=1e-6)


@pytest.mark.parametrize(("off", "kept"), [(0.0, True), (0.5e-6, True), (1e-3, False)])
def test_a_covariance_that_is_none_is_refused(tmp_path: Path, off: float, kept: bool) -> None:
    """Beyond rounding: two parameters that go together by more than wholly."""
    cell, given = read_cell(write_cell(tmp_path)), learned()
    content = learned_json(given, cell)
    variance = np.diag(given.covariance)
    content["covariance"] = [[0.0] * k + [variance[k]] for k in range(len(variance))]
    content["covariance"][1][0] = (1 + off) * float(np.sqrt(variance[0] * variance[1]))
    file = tmp_path / "learned.json"
    file.write_text(json.dumps(content))
    if kept:
        assert read_learned(file, cell).covariance[0, 1] == content["covariance"][1][0]
        return
    with pytest.raises(CompstiffError, match="semidefinite") as stopped:
        read_learned(file, cell)
    assert stopped.value.findings[0].code == "CS5320"


@pytest.mark.parametrize("variance", [-1e-6, 1e70])
def test_a_variance_that_is_none_is_refused(tmp_path: Path, variance: float) -> None:
    """Below nothing, or beyond all sense, by itself."""
    cell, given = read_cell(write_cell(tmp_path)), learned()
    content = learned_json(given, cell)
    size = len(given.covariance)
    content["covariance"] = [[0.0] * k + [variance if k == size - 1 else 1e-3] for k in range(size)]
    file = tmp_path / "learned.json"
    file.write_text(json.dumps(content))
    with pytest.raises(CompstiffError, match="CS5320"):
        read_learned(file, cell)


@pytest.mark.parametrize(("changed", "own", "code"), [
    ({}, "", ""), ({"version": 2}, "", "CS5320"), ({"format": "compstiff-stiffness"}, "", "CS5320"),
    ({"version": 2, "format": "x"}, "", "CS5320"), ({"springs": 5}, "", "CS5320"), ({"springs": 7}, "", "CS5320"),
    ({"mean": [0.0] * 20}, "", "CS5320"), ({"prior": [0.0] * 5}, "", "CS5320"), ({"covariance": [[1.0]]}, "", "CS5320"),
    ({"robot": "another"}, "", "CS5321"), ({"robot_sha256": "0"}, "", ""), ({"geometry_sha256": "0"}, "", ""),
    ({"robot_sha256": "0", "geometry_sha256": "0"}, "", "CS5321"),
    ({"serial_number": "A1"}, "A1", ""), ({"serial_number": "A1"}, "", ""), ({}, "A1", ""),
    ({"serial_number": "A1"}, "A2", "CS5321")])
def test_what_was_learned_elsewhere_or_is_not_whole_is_refused(
        tmp_path: Path, changed: dict[str, object], own: str, code: str) -> None:
    """A robot is the same by its file or by its geometry, and another one by its serial number where both are known."""
    cell = read_cell(write_cell(tmp_path))
    content = learned_json(learned(), cell) | changed
    file = tmp_path / "learned.json"
    file.write_text(json.dumps(content))
    cell = replace(cell, robot=replace(cell.robot, serial_number=own or None))
    if not code:
        assert read_learned(file, cell).springs == SPRINGS
        return
    with pytest.raises(CompstiffError) as stopped:
        read_learned(file, cell)
    assert stopped.value.findings[0].code == code


@pytest.mark.parametrize("text", ["[1, 2]", "no json", "[" * 100_000])
def test_what_is_no_learned_file_is_refused(tmp_path: Path, text: str) -> None:
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "learned.json"
    file.write_text(text)
    with pytest.raises(CompstiffError) as stopped:
        read_learned(file, cell)
    assert stopped.value.findings[0].code == "CS5320"


@pytest.mark.parametrize(("part", "name", "most", "least"), [
    ("job", "radius_mm", 1e5, 0.0), ("job", "duration_s", 1e9, -1e-9), ("remainder", "length_mm", 1e6, 0.0),
    ("remainder", "amplitude_um", 1e5, -1e-9)])
def test_sizes_that_no_job_has_are_refused(tmp_path: Path, part: str, name: str, most: float, least: float) -> None:
    """Just beyond the largest, and what is none; the largest itself is read, and so is a time or an amplitude of nothing."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "learned.json"
    content = learned_json(learned(), cell)
    for value, words in ((most, ""), (least + 1e-9, ""), (1.1 * most, f"{part}.{name}: Input should be less than or equal to"),
                         (least, f"{part}.{name}: Input should be greater than")):
        content[part][name] = value
        file.write_text(json.dumps(content))
        if not words:
            assert read_learned(file, cell).springs == SPRINGS
            continue
        with pytest.raises(CompstiffError, match=f"CS5320: {words}"):
            read_learned(file, cell)


@pytest.mark.parametrize(("key", "most"), [("springs", 200), ("effects", 20), ("places_mm", 500), ("posture_deg", 500)])
def test_more_than_learn_writes_is_refused(tmp_path: Path, key: str, most: int) -> None:
    """As many as may be are counted against what the file has beside them."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "learned.json"
    for count in (most, most + 1):
        content = learned_json(learned(), cell)
        if key == "springs":
            content[key] = count
        elif key == "effects":
            content[key] = [{"effect": "no such", "joint": 1}] * count
        else:
            content["remainder"][key] = [[0.0] * (3 if key == "places_mm" else 6)] * count
        file.write_text(json.dumps(content))
        with pytest.raises(CompstiffError) as stopped:
            read_learned(file, cell)
        [found] = stopped.value.findings
        assert (found.code == "CS5320" and found.message.split(": ")[0].endswith(key)) == (count > most), found


@pytest.mark.parametrize(("off", "same"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_stiffness_file_is_the_same_to_a_millionth(off: float, same: bool) -> None:
    """Of the largest of its parameters."""
    given = replace(learned(), prior=np.array([-15.0, -14, -13, -12, -11, -10]))
    model = IdentifiedModel(robot(), Frame.identity(), given.prior + np.array([0, 15 * off, 0, 0, 0, 0]), np.eye(6))
    if same:
        np.testing.assert_array_equal(given.model(model).mean, given.mean[:SPRINGS])
        return
    with pytest.raises(CompstiffError, match="CS5321: was learned with another stiffness file"):
        given.model(model)


def one_place(share: float = 0.1) -> Learned:
    """A remainder of one place, of whose weights the part left so much of the variance of 20 um, and nothing else."""
    size = SPRINGS + SETUP + DRIFT
    covariance = np.zeros((size + 3, size + 3))
    covariance[size:, size:] = share * 20e-6**2 * np.eye(3)
    return Learned(np.zeros(SPRINGS), np.zeros(size + 3), covariance, learned().frame,
                   Remainder(np.array([[1.0, 0, 0.5]]), np.zeros((1, 6)), 0.1, 20e-6))


def matern(distance: float) -> float:
    """Of unit length."""
    r = float(np.sqrt(5) * distance)
    return (1 + r + r * r / 3) * float(np.exp(-r))


def at(given: Learned, off: float = 0.0, turned: float = 0.0) -> Rest:
    """So far [m] beside the place, joint 4 turned by so much [rad]."""
    frame = Frame(np.eye(3)[None], np.array([[1.0, off, 0.5]]))
    path: Any = SimpleNamespace(base_from_tcp=frame, rest_from_tcp=frame, axes=SimpleNamespace(base_from_rest=None),
                                theta=np.array([[0, 0, 0, turned, 0, 0]]), move_time=np.zeros(1))
    return given.rest(path, np.arange(1))


def test_half_a_radian_of_a_joint_is_as_far_as_the_length_of_the_remainder() -> None:
    """On its circle, whose chord is a hundredth shorter; farther than that little is known."""
    for turned in (0.1, 0.5, 1.0):
        told = at(one_place(), turned=turned).basis[0, 0]
        assert told == pytest.approx(at(one_place(), off=0.1 * 2 * np.sin(turned / 2) / 0.5).basis[0, 0], rel=1e-9)
        assert told == pytest.approx(matern(2 * np.sin(turned / 2) / 0.5), rel=1e-5)


@pytest.mark.parametrize(("share", "inside"), [(0.55, True), (0.45, False)])
def test_a_place_is_inside_of_what_was_measured_where_half_its_variance_is_told(share: float, inside: bool) -> None:
    off = brentq(lambda distance: matern(distance) ** 2 - share, 0.01, 3)
    assert at(one_place(), off=0.1 * off).inside.tolist() == [inside]


@pytest.mark.parametrize(("share", "untold"), [(0.28, True), (0.22, False)])
def test_what_the_part_left_a_quarter_of_was_not_measured(share: float, untold: bool) -> None:
    """Knowing it would take its own variance away, beside what lies between the places, which at a place is nothing."""
    given = one_place(share)
    added, unseen = given.covariance_beside(np.zeros((1, 3, SPRINGS)), at(given))
    np.testing.assert_allclose(added[0], share * 400e-12 * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(unseen[0], untold * share * 400e-12 * np.eye(3), atol=1e-15)
