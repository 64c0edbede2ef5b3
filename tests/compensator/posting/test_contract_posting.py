"""APT and CSV posted as RAPID: the numbers come back, the robot holds one configuration, an independent grammar accepts it."""

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from compensator.correction.settings import DEFAULTS, Settings
from compensator.path.configurations import hold, tool_frames
from compensator.path.robot_path import robot_path
from compensator.posting.apt import read_apt
from compensator.posting.job import post_files
from compensator.posting.module_text import module_name
from compensator.posting.post import post, read_cam_path
from compensator.posting.read_toolpath import read_toolpath
from compensator.posting.settings import PostingSettings
from compensator.rapid import marks_of, read_rapid
from compensator.toolpath import Move
from identification.common.findings import CompstiffError, Refused
from identification.model.cell import read_cell
from identification.model.inverse import wrist_distance
from identification.model.kinematics import forward
from identification.model.rotations import Frame, quaternion_to_matrix
from tests.compensator.rapid.test_contract_checker import CONFIGURATION
from tests.support import compstiff, write_cell

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250], mass_kg: 80, centre_of_mass_mm: [0, 0, 120]}
base_frame: {position_mm: [10, 20, 30], quaternion: [0.9238795325112867, 0, 0, 0.3826834323650898]}
workobject: {position_mm: [1010, 990, 700], quaternion: [0.96592583, 0, 0, 0.25881905]}
"""
APT = """\
PARTNO SHELL "1" ! quoted
UNITS/MM
MULTAX/ON
LOADTL/7
SPINDL/9000,RPM,CLW
RAPID
GOTO/-60,-20,80,0,0,1
RAPID
GOTO/-60,-20,5,0.0871557427,0,0.9961946981
FEDRAT/1234.5,MMPM
""" + "".join(
    f"GOTO/{x},{-20 + 0.013 * x:.4f},{0.001 * x * x:.4f},{np.sin(0.1 + 0.004 * x):.9f},0.0,{np.cos(0.1 + 0.004 * x):.9f}\n"
    for x in range(-60, 61, 3)) + """\
MULTAX/OFF
FEDRAT/35.7,IPM
GOTO/50,0,2
CIRCLE/40,0,2,0,0,1,10
GOTO/40,-10,2
RAPID
GOTO/40,-10,80
FINI
"""


def planned(path, cell, settings=DEFAULTS):
    return read_toolpath(path, cell, settings.posting).text


@pytest.fixture
def cell(tmp_path):
    return read_cell(write_cell(tmp_path, CELL))


@pytest.fixture
def posted(tmp_path, cell):
    (tmp_path / "shell.apt").write_text(APT)
    return post(read_apt(tmp_path / "shell.apt"), cell, DEFAULTS.posting, "shell.mod")


def test_what_is_posted_reads_back(tmp_path, posted, cell):
    path, read = read_apt(tmp_path / "shell.apt"), read_rapid(posted.content).toolpath
    assert np.abs(1e3 * (read.position - path.position)).max() <= 0.5001e-4
    z = quaternion_to_matrix(read.quaternion)[:, :, 2]
    assert np.abs(z + path.axis).max() < 3e-8                          # the tool's z looks out of the spindle, into the part
    np.testing.assert_allclose(read.feed, np.where(path.rapid, 0.2, path.feed), rtol=1e-11)
    assert set(np.round(1e3 * 60 * read.feed[~path.rapid], 9)) == {1234.5, round(35.7 * 25.4, 9)}
    assert read.move.tolist() == [Move.JOINT, *path.move[1:].tolist()]
    assert (read.move == Move.ARC_END).sum() == 3                       # 270 degrees
    assert read.zone.tolist() == [0.0, *([0.3e-3] * (len(path) - 2)), 0.0]
    tool, part = read.tools[0], read.workobjects[0]
    np.testing.assert_allclose(tool.position, cell.flange_from_tcp.position)
    np.testing.assert_allclose(Frame.from_quaternion(part.position, part.quaternion).rotation, cell.world_from_object.rotation,
                               atol=1e-8)
    assert read.findings == ()


@pytest.mark.parametrize(("said", "instead"), [
    ("[[-57.0000,-20.7410,3.2490]", "[[-57.0000,-20.7411,3.2490]"),         # a target 0.1 um off
    ("0.05533095,", "0.05533195,"),                                         # turned by a few microradians
    ("[0,-1,-1,0]", "[0,-1,-1,1]"), ("[9E9,9E9", "[12,9E9"),
    ("[15.113,", "[15.114,"),                                               # a feed that is not the file's
    ("    MoveL [[-54", "    !MoveL [[-54"),                                # one move less
])
def test_a_text_that_does_not_say_what_was_meant_is_not_written(tmp_path, cell, monkeypatch, said, instead):
    """Each by itself, everything else as it should be."""
    from compensator.posting import post as posting

    real = posting.module_text
    assert said in real_text(tmp_path, cell)
    monkeypatch.setattr(posting, "module_text", lambda *given: real(*given).replace(said, instead, 1))
    with pytest.raises(CompstiffError) as stopped:
        real_text(tmp_path, cell)
    assert stopped.value.findings[0].code == "CS4306"


def real_text(tmp_path, cell):
    (tmp_path / "shell.apt").write_text(APT)
    return post(read_apt(tmp_path / "shell.apt"), cell, DEFAULTS.posting, "shell.mod").content.decode()


def test_the_robot_holds_one_configuration_all_along(posted, cell):
    plan = robot_path(posted.program.toolpath, cell)
    assert plan.findings == ()                                          # the confdata lead where the path leads
    assert plan.reached.all()
    assert np.abs(np.diff(plan.theta, axis=0)).max() < np.radians(25)
    assert (cell.robot.limit_excess(plan.theta) == 0).all()
    assert wrist_distance(cell.robot, plan.theta).min() > np.radians(20)
    back = forward(cell.robot, plan.theta, cell.flange_from_tcp)
    np.testing.assert_allclose(back.position, plan.base_from_tcp.position, atol=1e-9)


def test_each_speed_is_declared_once_and_exactly(posted):
    declared = re.findall(rb"CONST speeddata (\w+):=\[([^,]+),", posted.content)
    assert len({name for name, _ in declared}) == len(declared) == 3
    assert sorted(speed for _, speed in declared) == [b"15.113", b"20.575", b"200.0"]      # 35.7 in/min, 1234.5 mm/min


def test_findings_name_the_posted_program(posted):
    assert posted.program.toolpath.source == "shell.mod"


def test_the_choices_are_said(posted):
    codes = {finding.code for finding in posted.program.toolpath.findings}
    assert {"CS4300", "CS4302", "CS2111"} <= codes
    assert posted.assumed["smallest_reserve_deg"] > 20
    assert np.linalg.norm(posted.assumed["tool_x_towards"]) == pytest.approx(1)
    assert b'! SHELL "1" ! quoted' in posted.content
    assert b"! SPINDL/9000,RPM,CLW" in posted.content


def test_the_tools_x_follows_the_stated_direction(tmp_path, posted, cell):
    path = read_apt(tmp_path / "shell.apt")
    want = np.array([0.5, -1, 0]) / np.sqrt(1.25)
    turned = post(path, cell, PostingSettings(tool_x=(0.5, -1, 0)), "shell.mod").program.toolpath
    x = quaternion_to_matrix(turned.quaternion)[:, :, 0]
    # Of all turns about the tool axis the one whose x is nearest: x lies in the plane of the axis and the direction.
    np.testing.assert_allclose(np.einsum("ni,ni->n", x, np.cross(path.axis, want)), 0, atol=1e-7)
    assert (x @ want > 0.9).all()
    with pytest.raises(CompstiffError, match=r"CS4304: .* 0\.0 degrees"):
        post(path, cell, PostingSettings(tool_x=(0, 0, 1)), "shell.mod")


@pytest.mark.parametrize(("degrees", "refused"), [(9.9, True), (10.1, False)])
def test_a_tool_axis_within_ten_degrees_of_the_stated_direction_is_refused(tmp_path, cell, degrees, refused):
    """With the line where it is nearest, and how near. The same angle at another place is not."""
    lean = np.radians([40, 90 - degrees, 50])
    (tmp_path / "part.apt").write_text("UNITS/MM\nMULTAX/ON\nFEDRAT/600,MMPM\n" + "".join(
        f"GOTO/{5 * k},0,0,{np.sin(a):.12f},0,{np.cos(a):.12f}\n" for k, a in enumerate(lean)))
    cam_path, chosen = read_apt(tmp_path / "part.apt"), PostingSettings(tool_x=(2.0, 0.0, 0.0))
    try:
        post(cam_path, cell, chosen, "part.mod")
        found = []
    except CompstiffError as stopped:
        found = [one for one in stopped.findings if one.code == "CS4304"]
    assert [(one.line, one.target, one.file, one.message.partition(",")[0]) for one in found] == [
        (5, 1, str(tmp_path / "part.apt"), "the tool axis comes within 9.9 degrees of the direction --tool-x")] * refused


@pytest.mark.parametrize(("lean", "refused"), [(79, False), (81, True)])
def test_a_tool_axis_that_comes_near_every_horizontal_direction_is_refused(tmp_path, cell, lean, refused):
    """Round a cone, at 11 or at 9 degrees from the plane in which tool x is searched. Where it is refused --tool-x 0,0,1 is not
    for that."""
    turn, tilt = np.radians(np.arange(0, 360, 2)), np.radians(lean)
    (tmp_path / "part.apt").write_text("UNITS/MM\nMULTAX/ON\nFEDRAT/600,MMPM\n" + "".join(
        f"GOTO/{40 * np.cos(a):.6f},{40 * np.sin(a):.6f},0,{np.sin(tilt) * np.cos(a):.12f},{np.sin(tilt) * np.sin(a):.12f},"
        f"{np.cos(tilt):.12f}\n" for a in turn))
    for chosen, near in ((PostingSettings(), refused), (PostingSettings(tool_x=(0.0, 0.0, 1.0)), False)):
        try:
            post(read_apt(tmp_path / "part.apt"), cell, chosen, "part.mod")
            found = []
        except CompstiffError as stopped:       # no robot turns its tool round such a cone
            found = [one.code for one in stopped.findings]
        assert ("CS4304" in found) == near


def test_a_chosen_direction_leaves_at_least_the_reserve_of_every_other(tmp_path, posted, cell):
    path = read_apt(tmp_path / "shell.apt")
    for angle in np.radians(np.arange(0, 360, 45)):
        try:
            other = post(path, cell, PostingSettings(tool_x=(np.cos(angle), np.sin(angle), 0.0)), "shell.mod")
        except CompstiffError:
            continue
        assert other.assumed["smallest_reserve_deg"] <= posted.assumed["smallest_reserve_deg"] + 1e-3


def test_out_of_reach_is_refused_with_the_line(tmp_path, cell):
    (tmp_path / "far.apt").write_text("UNITS/MM\nFEDRAT/600,MMPM\nGOTO/0,0,0\nGOTO/5000,0,0\n")
    with pytest.raises(Refused, match="CS4303") as caught:
        planned(tmp_path / "far.apt", cell)
    (found,) = caught.value.findings
    assert (found.line, found.target, found.file) == (4, 1, str(tmp_path / "far.apt"))
    assert "ends at target 1 of 2 " in found.message


def table(tmp_path, cell, **extra):
    """A straight cut as a table; extra columns of 20 values."""
    x = np.linspace(-30, 30, 20)
    axis = np.tile([np.sin(0.2), 0, np.cos(0.2)], (20, 1))
    quaternion = tool_frames(axis, np.array([-1.0, 0, 0]))
    columns = {"x_mm": x, "y_mm": np.zeros(20), "z_mm": np.zeros(20), **dict(zip(("q1", "q2", "q3", "q4"), quaternion.T,
                                                                                 strict=True)),
               **extra}
    lines = [",".join(columns), *(",".join(f"{value:.10g}" for value in row) for row in zip(*columns.values(), strict=True))]
    (tmp_path / "cut.csv").write_text("\n".join(lines) + "\n")
    return tmp_path / "cut.csv"


def reference(cell, branch_of_zero=True):
    """Joint angles along `table` by the program's own inverse, for a file that carries them."""
    axis = np.tile([np.sin(0.2), 0, np.cos(0.2)], (20, 1))
    object_from_tcp = Frame.from_quaternion(np.column_stack([np.linspace(-30, 30, 20) / 1e3, np.zeros((20, 2))]),
                                            tool_frames(axis, np.array([-1.0, 0, 0])))
    flange = cell.world_from_base.inverse() @ cell.world_from_object @ object_from_tcp @ cell.flange_from_tcp.inverse()
    branches = np.zeros(8, dtype=bool)
    branches[1] = True                                                  # axis 5 negative: not what is chosen without being told
    return hold(cell.robot, flange, branches=branches).theta


def test_a_table_with_its_feeds(tmp_path, cell):
    feed = np.linspace(10, 25, 20)
    rapid = np.zeros(20)
    rapid[[0, 19]] = 1
    read = planned(table(tmp_path, cell, feed_mm_s=feed, rapid=rapid), cell).toolpath
    np.testing.assert_allclose(1e3 * read.feed, [200, *feed[1:-1], 200], rtol=1e-8)
    np.testing.assert_allclose(1e3 * read.position[:, 0], np.linspace(-30, 30, 20), atol=0.5001e-4)
    assert robot_path(read, cell).reached.all()


def test_a_table_without_feeds_says_what_is_assumed(tmp_path, cell):
    read = planned(table(tmp_path, cell), cell, Settings.of(feed_mm_s=12.5)).toolpath
    assert set(read.feed) == {0.0125}
    assert "12.5 mm/s" in next(finding.message for finding in read.findings if finding.code == "CS2150")


@pytest.mark.parametrize(("cell_of", "rapid", "words"), [
    ("0", 0, "found 0, expected a feed above zero"), ("-3", 0, "found -3, expected a feed above zero"),
    ("", 0, "found an empty cell, expected a feed above zero"), ("", 1, ""), ("0", 1, ""), ("0.6", 0, "")])
def test_a_row_that_cuts_has_a_feed_above_zero(tmp_path, cell, cell_of, rapid, words):
    """At the eighth row, in line 9; a move in the air needs none."""
    path = table(tmp_path, cell, feed_mm_s=np.full(20, 5.0), rapid=np.zeros(20))
    lines = path.read_text().splitlines()
    lines[8] = ",".join([*lines[8].split(",")[:-2], cell_of, str(rapid)])
    path.write_text("\n".join(lines))
    if not words:
        read = read_cam_path(path, DEFAULTS.posting)
        np.testing.assert_allclose(1e3 * read.feed, [5.0] * 7 + [np.nan if rapid else 0.6] + [5.0] * 12)
        assert "CS2150" not in [one.code for one in read.findings]
        return
    with pytest.raises(CompstiffError) as stopped:
        read_cam_path(path, DEFAULTS.posting)
    (found,) = stopped.value.findings
    assert (found.code, found.line, found.message) == ("CS2150", 9, f"column 'feed_mm_s': {words}")


@pytest.mark.parametrize(("feeds", "cutter", "words"), [
    ((0.51, 20), "", ""), ((0.49, 20), "", "cutting feeds from 0.49 to 20 mm/s: robots mill at 0.5 to 500"),
    ((20, 499), "", ""), ((20, 501), "", "cutting feeds from 20 to 501 mm/s: robots mill at 0.5 to 500"),
    # Of 16 mm at 6000 rpm a quarter of the diameter a turn is 400 mm/s, and a five-hundredth 3.2; the median counts.
    ((396, 20), "16", ""), ((404, 20), "16", "at 404 mm/s and 6000 rpm the feed is 4 mm a turn, of a cutter of 16 mm"),
    ((3.3, 20), "16", ""), ((3.1, 20), "16", "at 3.1 mm/s and 6000 rpm the feed is 0.031 mm a turn, of a cutter of 16 mm")])
def test_feeds_that_no_robot_mills_at_or_no_cutter_are_told(tmp_path, feeds, cutter, words):
    """Most of the cuts have the first one."""
    stated = f"force_log: {{spindle_rpm: 6000}}\ncutting: {{material: steel, tool_diameter_mm: {cutter}}}\n" if cutter else ""
    cell = read_cell(write_cell(tmp_path, CELL + stated))
    feed = np.full(20, float(feeds[0]))
    feed[12:18] = feeds[1]
    feed[[0, 19]] = 5000.0
    rapid = np.isin(np.arange(20), (0, 19)).astype(int)
    path = table(tmp_path, cell, feed_mm_s=feed, rapid=rapid)
    found = [one for one in planned(path, cell).toolpath.findings if one.code == "CS4307"]
    assert [(one.level, one.file, one.message) for one in found] == [("warning", str(path), words)] * bool(words)


@pytest.mark.parametrize(("options", "words"), [
    ({}, "zone 0.3 mm with stop points at both ends only, 200 mm/s in the air"),
    ({"zone_mm": 1.5, "rapid_mm_s": 80.0}, "zone 1.5 mm with stop points at both ends only, 80 mm/s in the air")])
def test_what_is_assumed_is_what_is_written(tmp_path, cell, options, words):
    (tmp_path / "shell.apt").write_text(APT)
    written = planned(tmp_path / "shell.apt", cell, Settings.of(**options))
    (found,) = (one for one in written.toolpath.findings if one.code == "CS4300")
    assert found.message == f"assumed: coordinates in the work object of cell.yaml, its tool, {words}"
    zone, speed = float(words.split()[1]), float(words.split(", ")[-1].split()[0])
    np.testing.assert_allclose(written.toolpath.zone[1:-1], 1e-3 * zone)
    assert written.toolpath.feed[0] == pytest.approx(1e-3 * speed)


def test_the_turn_that_was_chosen_is_kept_by_the_option_that_is_told(tmp_path):
    """A table states it; nothing is said of it there."""
    cell_file = write_cell(tmp_path, CELL)
    (tmp_path / "shell.apt").write_text(APT)

    def said(*options):
        run = compstiff("post", cell_file, tmp_path / "shell.apt", "-o", tmp_path / "shell.mod", "--json", "--force", *options)
        assert run.returncode == 0, run.stderr
        return next(one for one in json.loads(run.stdout)["findings"] if one["code"] == "CS4302")

    found = said()
    chosen = read_rapid((tmp_path / "shell.mod").read_bytes()).toolpath
    assert found["message"].endswith(" of the work object, which leaves most room")
    option, value, *rest = found["hint"].split()
    assert (option, rest) == ("--tool-x", ["keeps", "it", "so", "when", "the", "path", "changes"])
    kept = said(option, value)
    assert (kept["message"], kept["hint"]) == (found["message"].removesuffix(", which leaves most room"), "")
    again = read_rapid((tmp_path / "shell.mod").read_bytes()).toolpath
    np.testing.assert_allclose(again.quaternion, chosen.quaternion, atol=2e-6)
    np.testing.assert_array_equal(again.confdata, chosen.confdata)
    cell = read_cell(cell_file)
    assert "CS4302" not in [one.code for one in planned(table(tmp_path, cell), cell).toolpath.findings]


def test_joint_angles_of_a_table_give_the_configuration(tmp_path, cell):
    theta = reference(cell)
    free = robot_path(planned(table(tmp_path, cell), cell).toolpath, cell)
    told = robot_path(planned(table(tmp_path, cell, **{f"q{i + 1}_deg": np.degrees(theta[:, i]) for i in range(6)}),
                                   cell).toolpath,
                     cell)
    np.testing.assert_allclose(told.theta, theta, atol=1e-6)
    assert np.abs(free.theta - theta).max() > 0.5
    off = np.degrees(theta[:, 0]) + 0.2
    with pytest.raises(CompstiffError, match=r"CS2153: .* mm and 0\.200 degrees"):
        planned(table(tmp_path, cell, q1_deg=off, **{f"q{i + 1}_deg": np.degrees(theta[:, i]) for i in range(1, 6)}),
                      cell)


@pytest.mark.parametrize(("joint", "degrees", "refused"), [
    (5, 0.098, False), (5, 0.102, True), (0, 0.018, False), (0, 0.019, True)])
def test_joint_angles_off_their_pose_by_half_a_millimetre_or_a_tenth_of_a_degree_are_refused(
        tmp_path, cell, joint, degrees, refused):
    """At the eighth row. The last axis turns the flange about itself; the first carries it round its own, 1.5 m away."""
    theta = reference(cell)
    degree = np.degrees(theta)
    degree[7, joint] += degrees
    file = table(tmp_path, cell, **{f"q{i + 1}_deg": degree[:, i] for i in range(6)})
    if not refused:
        assert len(planned(file, cell).toolpath) == 20
        return
    with pytest.raises(CompstiffError) as stopped:
        planned(file, cell)
    (found,) = stopped.value.findings
    place = forward(cell.robot, theta[7:8], Frame.identity()).position[0, :2]
    apart = 0 if joint else 2e3 * np.linalg.norm(place) * np.sin(np.radians(degrees / 2))
    assert (found.code, found.line, found.target) == ("CS2153", 9, 7)
    assert found.message.startswith(f"the joint angles put the flange {apart:.3f} mm and {degrees:.3f} degrees off this row's")


def test_confdata_of_a_table_are_kept(tmp_path, cell):
    theta = reference(cell)
    quadrants = np.floor(theta[:, [0, 3, 5]] / (np.pi / 2))
    read = planned(table(tmp_path, cell, **dict(zip(("cf1", "cf4", "cf6"), quadrants.T, strict=True)), cfx=np.ones(20)),
                         cell).toolpath
    np.testing.assert_array_equal(read.confdata, np.column_stack([quadrants, np.ones(20)]))
    np.testing.assert_allclose(robot_path(read, cell).theta, theta, atol=1e-6)


@pytest.mark.parametrize(("column", "value", "code", "where"), [
    ("q1", 0.9, "CS2151", 4), ("feed_mm_s", -1, "CS2150", 8), ("cf4", 0.5, "CS2152", 10), ("cfx", -1, "CS2152", 12),
    ("rapid", 2, "CS2152", 13), ("x_mm", np.nan, "CS0203", 1),
])
def test_wrong_cells_of_a_table(tmp_path, cell, column, value, code, where):
    extra = {"feed_mm_s": np.full(20, 5.0), "cf1": np.zeros(20), "cf4": np.zeros(20), "cf6": np.zeros(20), "cfx": np.zeros(20),
             "rapid": np.zeros(20)}
    path = table(tmp_path, cell, **extra)
    lines = path.read_text().splitlines()
    cells = lines[5].split(",")
    cells[lines[0].split(",").index(column)] = f"{value}"
    lines[5] = ",".join(cells)
    path.write_text("\n".join(lines))
    with pytest.raises(CompstiffError, match=code) as caught:
        read_cam_path(path, DEFAULTS.posting)
    found = caught.value.findings[0]
    assert (found.line, found.column) == (6, lines[0].split(",").index(column) + 1)


@pytest.mark.parametrize(("off", "said"), [(0.9e-5, False), (1.2e-5, True), (0.9e-3, True), (1.1e-3, False)])
def test_quaternions_a_little_off_the_unit_are_normalised_and_told(tmp_path, cell, off, said):
    """With the row that is farthest off, and how many are; more than a thousandth off it is refused."""
    path = table(tmp_path, cell)
    header, *rows = path.read_text().splitlines()
    first = header.split(",").index("q1")
    for row, scale in ((4, 1 + off / 2 if off > 1e-4 else 1 + off), (7, 1 - off)):
        cells = rows[row].split(",")
        cells[first:first + 4] = [f"{scale * float(value):.12f}" for value in cells[first:first + 4]]
        rows[row] = ",".join(cells)
    plain = read_cam_path(path, DEFAULTS.posting)
    path.write_text("\n".join([header, *rows]))
    if off > 1e-3:
        with pytest.raises(CompstiffError) as stopped:
            read_cam_path(path, DEFAULTS.posting)
        (found,) = stopped.value.findings
        assert (found.code, found.line, found.column) == ("CS2151", 9, first + 1)
        assert found.message == f"column 'q1': the quaternion has length {1 - off:.4f}, expected 1 within 0.001"
        return
    read = read_cam_path(path, DEFAULTS.posting)
    np.testing.assert_allclose(np.linalg.norm(read.quaternion, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(read.quaternion, plain.quaternion, atol=1e-9)
    found = [one for one in read.findings if one.code == "CS2151"]
    assert [(one.level, one.file, one.column, one.count) for one in found] == (
        [("note", str(path), first + 1, 2)] if said else [])
    assert [one.message for one in found] == (
        [f"quaternions are off the unit by up to {off:.2g} and were normalised"] if said else [])
    if off > 1e-4:
        assert found[0].line == 9


@pytest.mark.parametrize(("length", "refused"), [(0.9991, False), (1.0009, False), (0.9989, True), (1.0011, True)])
def test_a_quaternion_a_thousandth_off_the_unit_is_none(tmp_path, length, refused):
    """The first row that is, beside one that is a little nearer to the unit."""
    (tmp_path / "cut.csv").write_text(f"x_mm,y_mm,z_mm,q1,q2,q3,q4\n0,0,0,1,0,0,0\n1,0,0,0,{length:g},0,0\n"
                                      f"2,0,0,0,{1 + 1.01 * (length - 1):.8f},0,0\n")
    if not refused:
        assert read_cam_path(tmp_path / "cut.csv", DEFAULTS.posting).quaternion[1] == pytest.approx([0, 1, 0, 0])
        return
    with pytest.raises(CompstiffError) as stopped:
        read_cam_path(tmp_path / "cut.csv", DEFAULTS.posting)
    found, = stopped.value.findings
    assert (found.code, found.line) == ("CS2151", 3)
    assert f"the quaternion has length {length:g}, expected 1 within 0.001" in found.message


@pytest.mark.parametrize(("quadrant", "cfx", "words"), [
    (7, 7, ""), (-7, 0, ""), (8, 0, "'cf6': found 8, expected a whole number from -7 to 7"),
    (-8, 0, "'cf6': found -8, expected a whole number from -7 to 7"),
    (0, 8, "'cfx': found 8, expected a whole number from 0 to 7")])
def test_quadrants_of_a_table_reach_to_seven(tmp_path, quadrant, cfx, words):
    (tmp_path / "cut.csv").write_text(f"x_mm,y_mm,z_mm,q1,q2,q3,q4,cf1,cf4,cf6,cfx\n0,0,0,1,0,0,0,0,0,{quadrant},{cfx}\n")
    if not words:
        assert read_cam_path(tmp_path / "cut.csv", DEFAULTS.posting).confdata.tolist() == [[0, 0, quadrant, cfx]]
        return
    with pytest.raises(CompstiffError, match=f"CS2152: column {words}"):
        read_cam_path(tmp_path / "cut.csv", DEFAULTS.posting)


def test_twenty_millimetres_a_second_are_assumed_where_nothing_states_a_feed(tmp_path, cell):
    read = post(read_cam_path(table(tmp_path, cell), DEFAULTS.posting), cell, DEFAULTS.posting, "part.mod").program.toolpath
    assert set(read.feed) == {0.02}
    assert [one.message for one in read.findings if one.code == "CS2150"] == [
        "no column feed_mm_s: 20 mm/s is assumed for every cut"]


@pytest.mark.parametrize(("column", "row", "off", "words"), [
    ("x_mm", 4, 0.45, ""), ("x_mm", 4, 0.55, "0.550 mm and 0.000 degrees off this row's pose, at most 0.5 mm and 0.1 "),
    ("q6_deg", 7, 0.09, ""), ("q6_deg", 7, -0.11, "0.000 mm and 0.110 degrees off this row's pose, at most 0.5 mm and 0.1 ")])
def test_joint_angles_and_pose_of_a_row_agree_within_half_a_millimetre_and_a_tenth_of_a_degree(
        tmp_path, cell, column, row, off, words):
    """Joint 6 turns the flange on the spot."""
    joints = {f"q{i + 1}_deg": angle for i, angle in enumerate(np.degrees(reference(cell)).T)}
    path = table(tmp_path, cell, **joints)
    header, *rows = path.read_text().splitlines()
    cells = rows[row].split(",")
    at = header.split(",").index(column)
    cells[at] = f"{float(cells[at]) + off:.9f}"
    rows[row] = ",".join(cells)
    path.write_text("\n".join([header, *rows]))
    if not words:
        assert robot_path(planned(path, cell).toolpath, cell).reached.all()
        return
    with pytest.raises(CompstiffError) as stopped:
        planned(path, cell)
    found, = stopped.value.findings
    assert (found.code, found.line, found.target) == ("CS2153", row + 2, row)
    assert words in found.message


@pytest.mark.parametrize(("lean", "words"), [
    (79.0, ""), (81.0, "the tool axis comes within 9.0 degrees of the direction --tool-x, at least 10 are needed")])
def test_the_tool_may_lean_to_ten_degrees_from_the_direction_its_x_is_turned_to(tmp_path, cell, lean, words):
    """The second of two targets does, against --tool-x."""
    sine, cosine = np.sin(np.radians(lean)), np.cos(np.radians(lean))
    (tmp_path / "part.apt").write_text("UNITS/MM\nMULTAX/ON\nFEDRAT/1200,MMPM\nGOTO/0,0,0,0,0,1\n"
                                       f"GOTO/1,0,0,{-sine:.9f},0,{cosine:.9f}\n")
    with pytest.raises((CompstiffError, Refused)) as stopped:
        post(read_apt(tmp_path / "part.apt"), cell, replace(DEFAULTS.posting, tool_x=(2.0, 0, 0)), "part.mod")
    found, = stopped.value.findings
    # Within, so far a turn in a millimetre is what no arm does.
    assert (found.code, found.line, found.target) == ("CS4304" if words else "CS4303", 5, 1)
    assert words in found.message


@pytest.mark.parametrize("length", [200, 201])
def test_a_comment_of_two_hundred_letters_is_kept_whole(tmp_path, cell, length):
    text = "".join(chr(97 + k % 26) for k in range(length))
    (tmp_path / "shell.apt").write_text(APT.replace("MULTAX/ON", f"PPRINT/{text}\nMULTAX/ON", 1))
    lines = post(read_apt(tmp_path / "shell.apt"), cell, DEFAULTS.posting, "shell.mod").content.decode().splitlines()
    assert [line.strip() for line in lines if text[:50] in line] == [f"! {text if length == 200 else text[:197] + '...'}"]


@pytest.mark.parametrize(("count", "more"), [(8, ""), (9, ", and 1 more mm/s"), (12, ", and 4 more mm/s")])
def test_of_many_speeds_the_first_are_shown(tmp_path, cell, count, more):
    path = table(tmp_path, cell, feed_mm_s=5.0 + np.minimum(np.arange(20), count - 1))
    (line,) = (text for text in post(read_cam_path(path, DEFAULTS.posting), cell, DEFAULTS.posting, "part").lines()
               if text.startswith("speeds: "))
    shown = ", ".join(f"{5 + k}" for k in range(min(count, 8)))
    assert line.startswith(f"speeds: {shown}{more or ' mm/s'};")


@pytest.mark.parametrize("above", ["", "# from the CAM system\n\n"])
def test_a_table_of_a_header_alone_is_none(tmp_path, cell, above):
    """The line is that of its header; one row below it is enough."""
    file = table(tmp_path, cell)
    header, row = file.read_text().splitlines()[:2]
    file.write_text(f"{above}{header}\n")
    with pytest.raises(CompstiffError) as caught:
        read_toolpath(file, cell)
    found, = caught.value.findings
    assert str(found).startswith(f"{file}:{above.count(chr(10)) + 1}: error CS2154: the table has no row below its header")
    file.write_text(f"{above}{header}\n{row}\n")
    assert len(read_toolpath(file, cell).toolpath) == 1


@pytest.mark.parametrize(("name", "posted"), [("part.csv", True), ("PART.CSV", True), ("part.nc", False), ("part", False)])
def test_what_is_posted_is_told_by_its_suffix(tmp_path, cell, name, posted):
    """Refused by `post` and by whatever reads a toolpath."""
    file = table(tmp_path, cell).rename(tmp_path / name)
    told = compstiff("post", tmp_path / "cell.yaml", file, "-o", tmp_path / "out.mod")
    assert told.returncode == (0 if posted else 1), told.stderr
    assert (f"error CS4201: toolpath format '{file.suffix}' is not posted" in told.stderr) != posted
    if not posted:
        with pytest.raises(CompstiffError, match=f"CS4201: toolpath format '{file.suffix}' is not read, expected one of .mod"):
            read_toolpath(file, cell)


@pytest.mark.parametrize("lost", ["", ", mass_kg: 80, centre_of_mass_mm: [0, 0, 120]", ", centre_of_mass_mm: [0, 0, 120]"])
def test_a_tool_without_load_is_said(tmp_path, lost):
    """Without its mass, or where that is."""
    assert lost in CELL
    cell = read_cell(write_cell(tmp_path, CELL.replace(lost, "")))
    read = planned(table(tmp_path, cell), cell).toolpath
    assert [(finding.level, finding.file) for finding in read.findings if finding.code == "CS4301"] == [
        ("warning", str(tmp_path / "cell.yaml"))] * bool(lost)


@pytest.mark.parametrize(("stem", "name"), [("Part 1-b", "Part_1_b"), ("12", "M12"), ("main", "main_part"),
                                            ("x" * 40, "x" * 32), ("Test", "Test_part"), ("Größe", "Gr__e")])
def test_the_modules_name_is_one_the_controller_takes(stem, name):
    assert module_name(stem) == name


def accepted(folder, content: bytes) -> bool:
    (folder / "rapidchecker.toml").write_text(CONFIGURATION)
    file = folder / "checked.sys"
    # rapidchecker's grammar begins at MODULE: the block of RobotWare 5 and 6 above it is no RAPID.
    file.write_bytes(content.split(b"%%%\n")[-1].lstrip())
    return subprocess.run([sys.executable, "-m", "rapidchecker", str(file)], cwd=folder, capture_output=True).returncode == 0


def test_an_independent_grammar_accepts_it(tmp_path, posted):
    assert accepted(tmp_path, posted.content)
    assert not accepted(tmp_path, posted.content.replace(b"vAir,fine", b"vAir fine", 1))


def test_the_command_writes_program_and_record_and_parts(tmp_path):
    cell_file = write_cell(tmp_path, CELL)
    (tmp_path / "shell.apt").write_text(APT)
    run = compstiff("post", cell_file, tmp_path / "shell.apt", "-o", tmp_path / "shell.mod", "--json")
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)["result"]
    record = json.loads((tmp_path / "shell.mod.json").read_text())
    assert record["summary"] == result
    assert record["format"] == "compstiff-post"
    assert result["in_the_air"] == 3
    again = compstiff("post", cell_file, tmp_path / "shell.apt", "-o", tmp_path / "shell.mod")
    assert again.returncode == 1
    assert "CS0003" in again.stderr
    parts = compstiff("post", cell_file, tmp_path / "shell.apt", "-o", tmp_path / "many.mod", "--split", "20", "--split-load")
    assert parts.returncode == 0, parts.stderr
    assert "CS4311" in parts.stderr
    assert sorted(path.name for path in tmp_path.glob("many*")) == ["many.mod", "many.mod.json", "many_001.mod", "many_002.mod"]
    for name in ("many.mod", "many_002.mod"):
        assert accepted(tmp_path, (tmp_path / name).read_bytes()), name
    assert compstiff("post", cell_file, tmp_path / "shell.mod", "-o", tmp_path / "b.mod").returncode == 1


@pytest.mark.parametrize("split", [None, 20])
def test_a_marked_program_is_the_posted_one_with_its_marks(tmp_path, cell, split):
    """Whole or in parts; read again with the same options it has the same marks. The test module switches the same output."""
    (tmp_path / "shell.apt").write_text(APT)
    plain = post_files(tmp_path / "cell.yaml", tmp_path / "shell.apt", tmp_path / "p.mod", Settings.of(split=split).posting)
    settings = Settings.of(mark="doMark", split=split)
    marked = post_files(tmp_path / "cell.yaml", tmp_path / "shell.apt", tmp_path / "p.mod", settings.posting)
    # Killed between two renames, no program is left without its record.
    assert next(iter(marked.files)) == next(iter(plain.files)) == tmp_path / "p.mod.json"
    text = b"".join(marked.files[tmp_path / file.name] for file in plain.files if file.suffix == ".mod")
    assert re.sub(rb"(Move[LC])DO\b([^;]*),doMark,[01];", rb"\1\2;", text) == b"".join(
        content for file, content in plain.files.items() if file.suffix == ".mod")
    assert b"SetDO doMark,1;" in marked.files[tmp_path / "p_marktest.mod"]
    assert read_rapid(marked.files[tmp_path / "p_marktest.mod"], "t.mod").toolpath.move.size == 0
    # Ten pulses of 0.25 s, as docs/marking.md says.
    body = marked.files[tmp_path / "p_marktest.mod"].partition(b"PROC main()")[2]
    assert re.findall(rb"FROM 1 TO \d+|WaitTime [\d.]+", body) == [
        b"WaitTime 1", b"FROM 1 TO 10", b"WaitTime 0.25", b"WaitTime 0.25"]
    again = marks_of(planned(tmp_path / "shell.apt", cell, settings))
    assert again is not None
    assert len(again) == text.count(b",doMark,") >= 5


def test_a_file_of_several_tools_is_posted_tool_by_tool_with_stops_at_the_bottom_of_holes(tmp_path):
    (tmp_path / "cell.yaml").write_text(CELL)
    file = tmp_path / "holes.ncl.2"
    file.write_text("UNIT/MM\nLOAD/TOOL,1\nFEDRAT/600,MMPM\nRAPID\nGOTO/0,0,50\nGOTO/0,0,5\nLOAD/TOOL,2\nRAPID\nGOTO/0,0,50\n"
                    "CYCLE/DRILL,DEPTH,5,CLEAR,2,MMPM,60,RETURN,50\nGOTO/0,0,10\nGOTO/20,0,10\nCYCLE/OFF\nFINI\n")
    options = ["post", "cell.yaml", "holes.ncl.2", "-o", "two.mod"]
    refused = compstiff(*options, cwd=tmp_path)
    assert refused.returncode == 1
    assert "holes.ncl.2:7:1: error CS2110" in refused.stderr
    done = compstiff(*options, "--tool", "2", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"CS2181", "CS2183"} <= {finding["code"] for finding in json.loads(done.stdout)["findings"]}
    assert json.loads(done.stdout)["result"]["size_mm"] == [20, 0, 0]       # the bottoms of the two holes
    text = (tmp_path / "two.mod").read_text()
    assert "MODULE holes\n" in text
    moves = re.findall(r"(Move[LJ]) \[\[([-\d.]+),[-\d.]+,([-\d.]+)\].*?,(v\w+),(\w+),tMill", text)
    assert [(float(x), float(z), speed, zone) for _, x, z, speed, zone in moves] == [
        (0, 50, "vAir", "fine"), (0, 12, "vAir", "zPath"), (0, 5, "vFeed1", "fine"), (0, 60, "vAir", "zPath"),
        (20, 60, "vAir", "zPath"), (20, 12, "vAir", "zPath"), (20, 5, "vFeed1", "fine"), (20, 60, "vAir", "fine")]
    read = read_rapid(text.encode(), "two.mod").toolpath
    assert read.feed[2] == pytest.approx(1e-3)


def test_comments_of_the_cam_file_stay_comments(tmp_path, cell):
    """Control characters, other alphabets and lines without an end: one printable line each, and the same moves."""
    said = "\x1b[31m ! x\x07\x85 MoveL \u2028 Fräsen " + "x" * 5000
    (tmp_path / "shell.apt").write_text(APT.replace("MULTAX/ON", f"PPRINT {said}\nMULTAX/ON", 1), encoding="utf-8")
    content = post(read_apt(tmp_path / "shell.apt"), cell, DEFAULTS.posting, "shell.mod").content
    (tmp_path / "shell.apt").write_text(APT)
    plain = post(read_apt(tmp_path / "shell.apt"), cell, DEFAULTS.posting, "shell.mod").content
    more = [line for line in content.splitlines() if line not in plain.splitlines()]
    assert more
    assert all(line.lstrip().startswith(b"!") and len(line) < 250 for line in more)
    assert re.fullmatch(rb"[\n\r\t -~]*", content)
    assert [line for line in content.splitlines() if line not in more] == plain.splitlines()


def test_how_large_a_cut_is_and_how_long_it_takes_is_told(tmp_path) -> None:
    """Two lines of 240 and 80 mm at 20 mm/s: 16 s. A wrong unit of lengths or feeds shows here; the way in the air counts for
    neither."""
    (tmp_path / "part.apt").write_text("UNITS/MM\nRAPID\nGOTO/0,0,60,0,0,1\nFEDRAT/1200,MMPM\nGOTO/0,0,0\nGOTO/240,0,0\n"
                                       "GOTO/240,80,0\n")
    (tmp_path / "cell.yaml").write_text(
        "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250], mass_kg: 50, centre_of_mass_mm: [0, 0, 100]}\n"
        "workobject: {position_mm: [1400, 500, 800], quaternion: [1, 0, 0, 0]}\n")
    posted = post(read_apt(tmp_path / "part.apt"), read_cell(tmp_path / "cell.yaml"), DEFAULTS.posting, "part.mod")
    assert posted.size == pytest.approx([240, 80, 0])
    assert posted.minutes == pytest.approx((60 + 240 + 80) / 20 / 60)
