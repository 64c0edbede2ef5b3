"""Units move what they carry as drawn lines and directions do, by SciPy's rotations; and cell.yaml is read as it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identification.common.findings import CompstiffError
from identification.model.cell import Cell, read_cell
from identification.model.mechanical_units import travel
from identification.model.rotations import Frame

HEAD = "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 200]}\n"
TABLE = """mechanical_units:
  - name: STN1
    carries: workobject
    base_frame: {position_mm: [900, -300, 400], quaternion: [0.8, 0.1, -0.5, 0.3162277660168379]}
    axes:
      - {eax: f, kind: linear, direction: [0, 3, 4], zero_mm: 250}
      - {eax: b, kind: rotary, direction: [2, 0, 0], through_mm: [0, 50, 120], zero_deg: -10, speed_deg_s: 90,
         acceleration_deg_s2: 180}
      - {eax: d, kind: rotary, direction: [0, 0.6, 0.8], through_mm: [200, 0, 0]}
    user_frame: {position_mm: [10, 20, 30], quaternion: [0, 1, 0, 0]}
"""


def cell(folder: Path, units: str) -> Cell:
    (folder / "cell.yaml").write_text(HEAD + units)
    return read_cell(folder / "cell.yaml")


def test_a_slide_under_two_turns_moves_points_as_drawn(tmp_path: Path) -> None:
    (unit,) = cell(tmp_path, TABLE).units or ()
    values = np.random.default_rng(4).uniform(-170, 170, (20, 6))
    frame = unit.world_from_user(values)
    base = Rotation.from_quat([0.1, -0.5, 0.3162277660168379, 0.8])
    point = np.array([0.3, -0.2, 0.1])
    for row, rotation, position in zip(values, frame.rotation, frame.position, strict=True):
        # A point of the part is turned about the inner line, then about the outer one, then slid.
        p = np.array([0.01, 0.02, 0.03]) + Rotation.from_quat([1, 0, 0, 0]).apply(point)
        inner = Rotation.from_rotvec(np.radians(row[3]) * np.array([0, 0.6, 0.8]))
        p = np.add([0.2, 0, 0], inner.apply(p - [0.2, 0, 0]))
        outer = Rotation.from_rotvec(np.radians(row[1] + 10) * np.array([1.0, 0, 0]))
        p = np.add([0, 0.05, 0.12], outer.apply(p - [0, 0.05, 0.12]))
        p = p + 1e-3 * (row[5] - 250) * np.array([0, 0.6, 0.8])
        np.testing.assert_allclose(rotation @ point + position, np.add([0.9, -0.3, 0.4], base.apply(p)), atol=1e-12)
    still = np.zeros((1, 6))
    still[0, [5, 1]] = 250, -10
    np.testing.assert_allclose(unit.displacement(still).rotation[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(unit.displacement(still).position[0], 0, atol=1e-12)
    assert [(axis.name, axis.unit, axis.speed is None) for axis in unit.axes] == [
        ("eax_f", "mm", True), ("eax_b", "deg", False), ("eax_d", "deg", True)]
    assert unit.axes[1].speed == pytest.approx(np.pi / 2)


def test_a_cell_that_says_nothing_and_one_that_says_there_are_none(tmp_path: Path) -> None:
    assert cell(tmp_path, "").units is None
    assert cell(tmp_path, "mechanical_units: []\n").units == ()


AXIS = "axes: [{eax: a, kind: linear, direction: [1, 0, 0]}]"


@pytest.mark.parametrize(("units", "says"), [
    ([f"name: A, carries: nothing, {AXIS}", "name: a, carries: nothing, axes: [{eax: b}]"], "name 'a' stands twice"),
    ([f"name: A, carries: nothing, {AXIS}", f"name: B, carries: nothing, {AXIS}"], "eax 'a' stands twice"),
    ([f"name: A, carries: robot, {AXIS}", "name: B, carries: robot, axes: [{eax: b}]"], "A and B both carry the robot"),
    (["name: A, carries: robot, axes: [{eax: a, direction: [1, 0, 0], zero_deg: 4}]"], "found zero_deg of a linear axis"),
    (["name: A, carries: workobject, axes: [{eax: a, kind: rotary, speed_mm_s: 4}]"], "found speed_mm_s of a rotary axis"),
    (["name: A, carries: nothing, axes: [{eax: a, direction: [0, 0, 0]}]"], "direction has no length"),
    (["name: A, carries: nothing, axes: [{eax: a, speed_mm_s: 100}]"], "speed and acceleration belong together"),
    (["name: A, carries: nothing, axes: [{eax: a, acceleration_mm_s2: 100}]"], "speed and acceleration belong together"),
    (["name: A, carries: robot, axes: [{eax: a, kind: rotary, direction: [0, 0.000101, 1]}]"], "eax_a would tilt it"),
])
def test_units_that_contradict_themselves(tmp_path: Path, units: list[str], says: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        cell(tmp_path, "mechanical_units:\n" + "".join(f"  - {{{unit}}}\n" for unit in units))
    (finding,) = stopped.value.findings
    assert finding.code == "CS4506"
    assert says in finding.message


@pytest.mark.parametrize("unit", [
    "name: A, carries: robot, axes: [{eax: a, kind: rotary, direction: [0, 0.000099, 1]}]",
    "name: A, carries: workobject, axes: [{eax: a, kind: rotary, direction: [1, 0, 0], through_mm: [0, 0, 5], zero_deg: 4}]",
    "name: A, carries: nothing, axes: [{eax: a, speed_mm_s: 100, acceleration_mm_s2: 50, zero_mm: 4}]"])
def test_units_that_do_not(tmp_path: Path, unit: str) -> None:
    """A column under the robot that is upright to 0.1 mrad; a table turns about any line; each size in its own unit."""
    units = cell(tmp_path, f"mechanical_units:\n  - {{{unit}}}\n").units
    assert units is not None
    assert [one.name for one in units] == ["A"]


def test_a_turning_column_under_the_robot_is_upright_in_the_world_not_in_its_own_frame(tmp_path: Path) -> None:
    lying = "base_frame: {quaternion: [0.7071067811865476, 0.7071067811865476, 0, 0]}"
    (unit,) = cell(tmp_path, f"mechanical_units:\n  - {{name: A, carries: robot, {lying}, axes: [{{eax: a, kind: rotary, "
                   "direction: [0, 1, 0]}]}\n").units or ()
    np.testing.assert_allclose(unit.displacement(np.full((1, 6), 90.0)).rotation[0], [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
                               atol=1e-12)


def test_sizes_of_an_axis_are_in_si_whatever_its_kind(tmp_path: Path) -> None:
    """A direction of any length; what is not stated is not known, but for the zero, which is 0."""
    (unit,) = cell(tmp_path, """mechanical_units:
  - name: A
    carries: nothing
    axes:
      - {eax: c, direction: [0, -3, 4], zero_mm: 250, parked_mm: 40, speed_mm_s: 500, acceleration_mm_s2: 2500}
      - {eax: a, kind: rotary, direction: [2, 0, 0], through_mm: [1, 20, -300], zero_deg: -10, parked_deg: 90, speed_deg_s: 90,
         acceleration_deg_s2: 180}
      - {eax: f}
""").units or ()
    slide, turn, unknown = unit.axes
    assert unit.columns == [2, 0, 5]
    for axis, direction, point in ((slide, [0, -0.6, 0.8], [0, 0, 0]), (turn, [1, 0, 0], [1e-3, 0.02, -0.3])):
        np.testing.assert_allclose(axis.direction, direction, atol=1e-15)
        np.testing.assert_allclose(axis.point, point, atol=1e-15)
    told = [(axis.rotary, axis.zero, axis.parked, axis.speed, axis.acceleration) for axis in (slide, turn, unknown)]
    assert told == [(False, 250, 40, pytest.approx(0.5), pytest.approx(2.5)),
                    (True, -10, 90, pytest.approx(np.pi / 2), pytest.approx(np.pi)), (False, 0, None, None, None)]
    assert unknown.direction is None
    # It stands where it stands, whatever it is told.
    np.testing.assert_allclose(unknown.motion(np.array([700.0])).position, 0)


@pytest.mark.parametrize(("axes", "carries", "along"), [
    ("{eax: a, direction: [0, 2, 0]}", "robot", [0, 0, -1]), ("{eax: a}", "robot", None),
    ("{eax: a, kind: rotary, direction: [0, 0, 1]}", "robot", None), ("{eax: a, direction: [0, 2, 0]}", "workobject", None),
    ("{eax: a, direction: [0, 2, 0]}, {eax: b, direction: [1, 0, 0]}", "robot", None)])
def test_a_track_of_one_line_carries_the_robot_along_it(
        tmp_path: Path, axes: str, carries: str, along: list[float] | None) -> None:
    """As its base sees it, which stands a quarter turn about x in the world; of a unit that carries anything else nothing."""
    units = cell(tmp_path, "mechanical_units:\n  - {name: N, carries: nothing, axes: []}\n"
                 f"  - {{name: T, carries: {carries}, axes: [{axes}]}}\n").units
    found = travel(units, Frame(Rotation.from_rotvec([np.pi / 2, 0, 0]).as_matrix(), np.ones(3)))
    if along is None:
        assert found is None
    else:
        np.testing.assert_allclose(found, along, atol=1e-12)
    assert travel(None, Frame.identity()) is None
