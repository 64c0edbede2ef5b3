"""Where the axes stand, how the joints follow, and what a leg is, where the robot's base or the part moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import compstiff
from compensator.correction.engagement import across_feed
from compensator.path.driven_path import driven_path
from compensator.path.external_axes import _share_of_arc, external_axes, standing_values
from compensator.path.legs import Poses, build_legs
from compensator.path.robot_path import RobotPath, robot_path
from compensator.path.route import joint_rates
from compensator.path.timing import drive
from tests.runs.command_line import user_files as kit
from tests.runs.milling.carried_job import CarriedJob
from tests.runs.milling.line_job import ARCS, LINES
from tests.virtual_cell import controller

LIMITS = ", speed_deg_s: 20, acceleration_deg_s2: 40"
TURNING = np.array([[950.0, 12.0, -20.0], [950.0, 4.0, 30.0]])


def planned(job: CarriedJob, text: str = "") -> RobotPath:
    ready = job.job("target,fx_n,fy_n,fz_n\n1,1,1,1\n")
    ready.program = text or job.program
    ready.write()
    cell = compstiff.read_cell(job.folder / "cell.yaml")
    return robot_path(compstiff.read_toolpath(job.folder / "part.mod", cell).toolpath, cell)


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_poses_and_lengths_are_those_of_the_drawn_units(tmp_path: Path, on: str) -> None:
    """The arm meets each target where the units put it; lengths are those over the part."""
    job = CarriedJob(tmp_path, ARCS, on=on)
    path = planned(job)
    origin, turned = job.stands(job.values)
    points = np.array([1e3 * pose.p for pose in job.poses])
    place = origin + turned.apply(points / 1e3)
    np.testing.assert_allclose(path.base_from_tcp.position, place, atol=5e-7)     # the circle points' axes are rounded
    attitude = turned * Rotation.concatenate([pose.r for pose in job.poses])
    np.testing.assert_allclose(path.base_from_tcp.rotation, attitude.as_matrix(), atol=1e-6)
    np.testing.assert_allclose(1e3 * path.length, job.target_lengths, atol=1e-5)
    # Ways over the part, as the base sees them there.
    np.testing.assert_allclose(path.steps[1:], turned[1:].apply(np.diff(points, axis=0) / 1e3), atol=1e-7)


def test_what_is_across_the_feed_is_so_where_the_part_has_turned(tmp_path: Path) -> None:
    """A force along the way over the part has nothing across it, whatever the table's angle."""
    job = CarriedJob(tmp_path, "J 0,0 L 20,0 L 40,0 L 60,0", on="table", ends=TURNING)
    path = planned(job)
    along = job.stands(job.values)[1].apply(job.origin.r.apply([100.0, 0, 0]))
    _, across = across_feed(path, along)
    assert across.max() < 1e-3
    _, across = across_feed(path, np.tile(along[:1], (4, 1)))
    assert across[-1] > 10


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_the_rates_of_the_joints_at_the_ends_of_the_legs(tmp_path: Path, on: str) -> None:
    """On lines and arcs, at either end: differences of the virtual cell's own angles."""
    job = CarriedJob(tmp_path, ARCS, on=on, limits=LIMITS)
    path = planned(job)
    legs = build_legs(path, Poses(path.base_from_tcp, path.theta))
    to = np.flatnonzero(legs.linear)
    starts = joint_rates(path, path.theta, legs.before[to], legs, to, legs.first)
    ends = joint_rates(path, path.theta, to, legs, to, legs.last)
    number = 0
    for leg in job.planned:
        fine = controller.drive([leg], 0.01, zones=False)
        step = leg.length / (len(fine.position) - 1) * 1e-3
        q = job.angles(fine.position, fine.turn, fine.external)
        np.testing.assert_allclose(starts[number, :6], (-1.5 * q[0] + 2 * q[1] - 0.5 * q[2]) / step, atol=1e-4)
        number += len(leg.points) - 2
        np.testing.assert_allclose(ends[number, :6], (1.5 * q[-1] - 2 * q[-2] + 0.5 * q[-3]) / step, atol=1e-4)
        number += 1
    assert number == len(to) == 7
    assert starts.shape[1] == 6 + {"slide": 1, "table": 2, "both": 3}[on]


def test_a_table_that_turns_under_a_resting_tip_takes_its_time(tmp_path: Path) -> None:
    """The tool stays where it is on the part, which turns by 15 degrees at 20 deg/s and 40 deg/s^2."""
    job = CarriedJob(tmp_path, "J 0,0 L 30,0 L 30,0 L 60,0", on="table", limits=LIMITS, ends=TURNING)
    texts = job.program.replace(job.external(2), "[9E9,8.00000,-10.00000,9E9,9E9,9E9]").replace(
        job.external(1), "[9E9,8.00000,5.00000,9E9,9E9,9E9]")
    lines = texts.splitlines()
    moves = [number for number, line in enumerate(lines) if "Move" in line]
    place = lines[moves[1]].split("]")[:3]
    lines[moves[2]] = "]".join(place + lines[moves[2]].split("]")[3:])
    path = planned(job, "\n".join(lines) + "\n")
    driven = drive(path)
    assert driven.route.legs.joint.tolist() == [False, False, True, False]
    assert driven.duration[2] == pytest.approx(15 / 20 + 20 / 40, rel=1e-6)


def test_a_way_from_the_floor_to_the_table_is_no_line_over_the_part(tmp_path: Path) -> None:
    job = CarriedJob(tmp_path, LINES, on="table")
    text = job.program.replace("PROC main()", kit.wobjdata(user=kit.USER).replace("wPart", "wFloor") + "\nPROC main()")
    first = text.index("wPart;")
    path = planned(job, text[:first] + "wFloor;" + text[first + len("wPart;"):])
    legs = build_legs(path, Poses(path.base_from_tcp, path.theta))
    assert not legs.linear[1]
    assert legs.linear[2:].all()


def test_where_the_axes_stand(tmp_path: Path) -> None:
    """A circle point counts for nothing, in between or for what follows; an axis of no unit is as written."""
    path = planned(CarriedJob(tmp_path, ARCS, on="slide"))
    toolpath, nan = path.toolpath, np.nan
    external = np.full((len(toolpath), 6), nan)
    external[:, 0] = [10, 20, 999, 40, 50, 999, nan, 70, 80][:len(toolpath)]
    external[2, 5] = 7.0
    values = standing_values(replace(toolpath, external=external), path.cell)
    arc = kit_share(path)
    np.testing.assert_allclose(values[:, 0], [10, 20, 20 + arc * 20, 40, 50, 50, 50, 70])
    np.testing.assert_array_equal(values[:, 5], external[:, 5])


def test_on_an_arc_from_one_side_of_the_zero_to_the_other_the_axis_passes_it(tmp_path: Path) -> None:
    """As much on the one side as on the other is not the same value."""
    path = planned(CarriedJob(tmp_path, ARCS, on="slide"))
    external = np.full((len(path.toolpath), 6), np.nan)
    external[:, 0] = [-20.0, -20.0, np.nan, *[20.0] * (len(path.toolpath) - 3)]
    values = standing_values(replace(path.toolpath, external=external), path.cell)
    assert values[2, 0] == pytest.approx(-20 + 40 * kit_share(path))


def test_what_nobody_knows_counts_as_the_first_value_known_and_is_named(tmp_path: Path) -> None:
    """A track of which the program tells from the third target on, and cell.yaml nothing: where the first two lie is not
    known, and the resting frame is that of the third."""
    path = planned(CarriedJob(tmp_path, LINES, on="slide"))
    count = len(path.toolpath)
    external = np.full((count, 6), np.nan)
    external[2:, 0] = 30.0 + 10 * np.arange(count - 2)
    axes = external_axes(replace(path.toolpath, external=external), path.cell)
    np.testing.assert_array_equal(axes.values[:, 0], [30.0, 30.0, *external[2:, 0]])
    assert axes.rest[0] == 30.0
    assert [bool(why) for why in axes.problem] == [True, True, *[False] * (count - 2)]
    [unit] = path.cell.units or ()
    assert set(axes.problem[:2]) == {
        f"{unit.name} carries the robot, and nothing tells where {unit.axes[0].name} stands: neither the program before it nor "
        "parked_mm or parked_deg in cell.yaml"}
    assert axes.base_from_rest is not None
    way = unit.displacement(axes.values)[2:].position - unit.displacement(axes.rest[None]).position
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.01 * np.arange(count - 2), atol=1e-12)
    still = external_axes(replace(path.toolpath, external=np.where(np.isnan(external), np.nan, 30.0)), path.cell)
    assert (still.moves, still.base_moves) == (False, False)


def kit_share(path: RobotPath) -> float:
    """Which share of the first arc stands before its circle point, by the lengths of its parts."""
    length = path.length
    return float((length[2] - length[1]) / (length[3] - length[1]))


@pytest.mark.parametrize("unknown", [None, 0, 1, 2])
def test_a_circle_point_stands_half_way_where_its_arc_is_not_known(unknown: int | None) -> None:
    """An arc of 120 degrees whose circle point stands behind 30: a quarter of it, but with a point of it unknown half."""
    angle = np.radians([0.0, 30.0, 120.0, 130.0])
    position = 0.2 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) + [1.0, 0.4, 0.3]
    if unknown is not None:
        position[unknown] = np.nan
    share = _share_of_arc(position, np.array([1]))
    assert share == pytest.approx([0.25 if unknown is None else 0.5], rel=1e-9)


@pytest.mark.parametrize(("way", "moves"), [(0.9e-4, False), (1.1e-4, True)])
def test_an_axis_stands_that_is_written_alike_to_a_tenth_of_a_micrometre(tmp_path: Path, way: float, moves: bool) -> None:
    ends = np.array([[950.0, 12.0, -20.0], [950.0 + way, 12.0, -20.0]])
    axes = planned(CarriedJob(tmp_path, LINES, on="slide", ends=ends)).axes
    assert (axes.moves, axes.base_moves) == (moves, moves)


@pytest.mark.parametrize("on", ["slide", "table", "both"])
def test_frames_and_directions_go_to_the_resting_frame_and_back(tmp_path: Path, on: str) -> None:
    """All of them, or those of some targets; the path there is that over the part as it lies at the first target."""
    job = CarriedJob(tmp_path, LINES, on=on)
    path = planned(job)
    axes, some = path.axes, np.array([3, 1])
    assert (axes.moves, axes.base_moves) == (True, on != "table")
    [part] = path.used_frames.workobjects
    np.testing.assert_allclose(part.position, job.in_world.p, atol=1e-7)
    np.testing.assert_allclose(part.rotation, job.in_world.r.as_matrix(), atol=1e-6)
    points = np.array([pose.p for pose in job.poses])
    np.testing.assert_allclose(path.world_position, job.in_world.p + job.in_world.r.apply(points), atol=1e-6)
    back = axes.to_base(path.rest_from_tcp)
    np.testing.assert_allclose(back.position, path.base_from_tcp.position, atol=1e-12)
    rest_and_base = path.rest_from_tcp, path.base_from_tcp
    for there, whole, here in ((axes.to_rest, *rest_and_base), (axes.to_base, *rest_and_base[::-1])):
        few = there(here[some], some)
        np.testing.assert_allclose(few.position, whole.position[some], atol=1e-12)
        np.testing.assert_allclose(few.rotation, whole.rotation[some], atol=1e-12)
    # A direction over the part goes with it.
    turned = job.stands(job.values)[1]
    over_part = np.random.default_rng(2).normal(size=(len(points), 3))
    rest = turned[0].apply(over_part) if on != "slide" else over_part
    base = turned.apply(over_part) if on != "slide" else over_part
    np.testing.assert_allclose(axes.turned_to_base(rest), base, atol=1e-6)
    np.testing.assert_allclose(axes.turned_to_base(rest[some], some), base[some], atol=1e-6)
    np.testing.assert_allclose(axes.turned_to_rest(base), rest, atol=1e-6)
    np.testing.assert_allclose(axes.turned_to_rest(base[some], some), rest[some], atol=1e-6)


def test_where_no_axis_moves_the_resting_frame_is_the_base(tmp_path: Path) -> None:
    path = planned(CarriedJob(tmp_path, LINES, on="both", ends=np.tile([[950.0, 12.0, -20.0]], (2, 1))))
    axes, vectors = path.axes, np.eye(3)
    assert not axes.moves
    assert not axes.base_moves
    assert axes.to_rest(path.base_from_tcp) is axes.to_base(path.base_from_tcp) is path.base_from_tcp
    assert axes.turned_to_rest(vectors) is axes.turned_to_base(vectors) is vectors


def test_on_a_circle_point_in_line_axes_stand_by_the_chords() -> None:
    position = np.array([[0, 0, 0], [0.03, 0, 0], [0.1, 0, 0], [0.2, 0, 0.0]])
    assert _share_of_arc(position, np.array([1])) == pytest.approx([0.3])


def test_a_unit_that_is_switched_off_stands_until_it_is_on_again(tmp_path: Path) -> None:
    """What the program writes for it then counts for nothing; that another one is switched on does not either."""
    path = planned(CarriedJob(tmp_path, LINES, on="both"))
    count = len(path.toolpath)
    external = np.full((count, 6), np.nan)
    external[:, 0], external[:, 1] = 100.0 + np.arange(count), 10.0 + np.arange(count)
    for switched, slide in (
            (((1, "track_1", False), (2, "stn1", True), (count - 1, "track_1", True)), [100.0] * (count - 1) + [99.0 + count]),
            (((2, "track_1", False),), [100.0, 101.0] + [101.0] * (count - 2)),
            (((1, "stn1", False),), 100.0 + np.arange(count))):
        values = standing_values(replace(path.toolpath, external=external, switched=switched), path.cell)
        np.testing.assert_array_equal(values[:, 0], slide)
        np.testing.assert_array_equal(values[:, 1], external[:, 1] if switched[0][1] == "track_1" else 10.0)


def test_the_limits_are_those_of_the_joints_and_of_the_axes_that_are_driven(tmp_path: Path) -> None:
    """20 mm/s of the slide, 20 deg/s of either angle of the table."""
    path = planned(CarriedJob(tmp_path, LINES, on="both", limits=LIMITS))
    robot = path.cell.robot
    np.testing.assert_allclose(path.limits.speed, [*robot.speed, 0.02, np.radians(20), np.radians(20)])
    np.testing.assert_allclose(path.limits.acceleration, [*robot.acceleration, 0.04, np.radians(40), np.radians(40)])
    unjudged = planned(CarriedJob(tmp_path, LINES, on="both"))
    np.testing.assert_allclose(unjudged.limits.speed, robot.speed)
    assert [axis.name for axis in unjudged.axes.unjudged] == ["eax_a", "eax_b", "eax_c"]


@pytest.mark.parametrize(("unsaid", "order", "there"), [
    (None, [0, 2, 1, 3], True), (None, [1, 0, 2, 3], False),
    (2, [0, 2, 1, 3], False), (2, [0, 1, 2, 1, 3], True)])
def test_a_way_as_driven_is_told_where_the_axes_stand_as_in_the_text(
        tmp_path: Path, unsaid: int | None, order: list[int], there: bool) -> None:
    """Each target says where the slide is, or one does not, which is then met where the one before it was; and the path over
    the part is that of the first target's slide, whichever is driven first."""
    path = planned(CarriedJob(tmp_path, LINES, on="slide"))
    external = path.toolpath.external.copy()
    if unsaid is not None:
        external[unsaid] = np.nan
    path = robot_path(replace(path.toolpath, external=external), path.cell)
    driven = driven_path(path, np.array(order))
    assert (driven is not None) == there
    if driven is not None:
        np.testing.assert_array_equal(driven.run.axes.values, path.axes.values[order])


def test_a_base_that_moves_while_the_table_stands_is_met_where_it_is(tmp_path: Path) -> None:
    """One axis of three moves: the slide, by 50 mm a target; the table stands at 12 and -20 degrees."""
    job = CarriedJob(tmp_path, LINES, on="both", ends=np.array([[950.0, 12.0, -20.0], [800.0, 12.0, -20.0]]))
    path = planned(job)
    assert (path.axes.moves, path.axes.base_moves) == (True, True)
    origin, turned = job.stands(job.values)
    points = np.array([pose.p for pose in job.poses])
    np.testing.assert_allclose(path.base_from_tcp.position, origin + turned.apply(points), atol=5e-7)
    assert np.ptp(origin @ [0.6, 0.64, -0.48]) > 0.1
