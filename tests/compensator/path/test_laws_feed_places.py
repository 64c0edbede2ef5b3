"""What the feed check says of places between the targets, and of what it could not judge: each told at its target of the
program as given. Angles come from the drawing of the arm (tests/virtual_cell) and a root finder, not from the package."""

from __future__ import annotations

import dataclasses
import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from compensator.path.feasibility import FeedCheck, check_feed, judge
from compensator.path.timing import drive
from identification.common.findings import CompstiffError, Finding, Refused
from identification.model.rotations import rotation_matrix
from tests.compensator.correction.test_laws_intermediate_targets import LINES, between, log
from tests.compensator.path.test_laws_timing import DOWN, RADIUS, forced, lines, program, swing, target
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import IRB6660, Frame, Job, Rotation
from tests.support import robot

TCP = Frame(np.array([0.12, 0.0, 0.25]), Rotation.identity())
FIRST_LINE = 3      # of the moves of `program`


def pose(degrees: list[float]) -> Frame:
    return kit.tcp_pose(IRB6660, np.radians(degrees), TCP)


def written(degrees: list[float]) -> str:
    """The target with the tool where these joint angles put it."""
    return kit.robtarget(pose(degrees), kit.confdata(np.radians(degrees)), digits=12)


def moves(angles: list[list[float]], speed: str = "v100", zone: str = "fine") -> list[str]:
    return [f"Move{'L' if i else 'J'} {written(q)},{speed},{zone},tSpindle;" for i, q in enumerate(angles)]


def angles_along(start: list[float], end: list[float], shares: np.ndarray) -> tuple[np.ndarray, float]:
    """Joint angles (n, 6) [rad] at these shares of the straight way between two poses, and its length [m]."""
    first, last, q = pose(start), pose(end), np.radians(start if shares[0] == 0 else end)
    found = []
    for share in shares:
        q = kit.solve(IRB6660, between(first, last, share) @ TCP.inv(), q)
        found.append(q)
    return np.array(found), float(np.linalg.norm(last.p - first.p))


def told(check: FeedCheck, code: str) -> list[Finding]:
    return [finding for finding in check.findings if finding.code == code]


def test_an_unknown_zone_is_a_stop(tmp_path: Path) -> None:
    points = [[1100, 0, 700], [1150, 0, 700], [1150, 50, 700], [1100, 50, 700]]
    texts = {}
    for zone in ("fine", "z5", "zUnknown"):
        texts[zone] = lines(points, "v100", "z1")
        texts[zone][2] = texts[zone][2].replace("z1", zone)
    plans = {zone: program(tmp_path, text) for zone, text in texts.items()}
    [found] = told(check_feed(judge(plans["zUnknown"], forced(4, [])), strict=False), "CS4410")
    assert (found.target, found.line) == (2, FIRST_LINE + 2)
    assert "the zone of 1 target is not known" in found.message
    times = {zone: drive(plan).time[-1] for zone, plan in plans.items()}
    assert times["zUnknown"] == times["fine"] > times["z5"]
    assert not told(check_feed(judge(plans["fine"], forced(4, [])), strict=False), "CS4410")


def test_a_joint_move_into_another_configuration(tmp_path: Path) -> None:
    """The third target is the pose of the second with the wrist turned over."""
    angles = [[0, 10, 20, 0, 40, 0], [0, 10, 20, 0, 30, 0], [0, 10, 20, 180, -30, -180]]
    text = [f"MoveAbsJ [{q},[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tSpindle;" for q in angles]
    assert_allclose(pose(angles[1]).p, pose(angles[2]).p, atol=1e-12)
    [found] = told(check_feed(judge(program(tmp_path, text), forced(3, [])), strict=False), "CS4408")
    assert (found.target, found.line) == (2, FIRST_LINE + 2)
    assert found.message.startswith("1 joint move into")
    assert not told(check_feed(judge(program(tmp_path, text[:2]), forced(2, [])), strict=False), "CS4408")


def test_a_joint_limit_left_between_targets(tmp_path: Path) -> None:
    """Along a chord the arm is drawn in: axis 2 leans farther back in the middle than at both ends."""
    text = lines([[900, -900, 700], [900, 900, 700]], "v100", "z1")
    start = np.array([*kit.solve(IRB6660, Frame(np.array([0.9, -0.9, 0.7]), Rotation.from_matrix(DOWN)) @ TCP.inv(),
                                 np.radians([-40, 16, 39, -5, 52, -37]))])
    q, lean = start, []
    for y in np.linspace(-0.9, 0.9, 181):
        q = kit.solve(IRB6660, Frame(np.array([0.9, y, 0.7]), Rotation.from_matrix(DOWN)) @ TCP.inv(), q)
        lean.append(q[1])
    lowest = min(lean)
    assert min(lean[0], lean[-1]) - lowest > np.radians(10)
    for limit, left in ((0.5 * (lowest + lean[0]), True), (lowest - 1e-3, False)):
        limits = robot().limits.copy()
        limits[1, 0] = limit
        check = check_feed(
            judge(program(tmp_path, text, dataclasses.replace(robot(), limits=limits)), forced(2, [])), strict=False)
        assert [(found.target, found.line) for found in told(check, "CS4407")] == [(1, FIRST_LINE + 1)] * left


def test_a_line_the_arm_cannot_follow(tmp_path: Path) -> None:
    """In its middle the wrist is nearer to axis 2 than the folded arm gets: no detour with the arm turned round is timed."""
    x, z = 0.35, 0.4
    wrist = Frame(np.array([x, 0, z]), Rotation.from_matrix(DOWN)) @ TCP.inv() @ Frame(np.array([0, 0, -0.2]), TCP.r)
    folded = np.hypot(IRB6660.elbow, IRB6660.forearm) - IRB6660.lower_arm
    # The line leads in y: somewhere on it the wrist stands before the robot's base.
    assert np.hypot(abs(wrist.p[0]) - IRB6660.shoulder, wrist.p[2] - IRB6660.height) < 0.9 * folded
    plan = program(tmp_path, lines([[1e3 * x, -900, 1e3 * z], [1e3 * x, 900, 1e3 * z]], "v100", "z1"))
    assert plan.reached.all()
    check = check_feed(judge(plan, forced(2, [])), strict=True)
    [found] = told(check, "CS4404")
    assert (found.target, found.line) == (1, FIRST_LINE + 1)
    assert "between 1 pair of targets" in found.message
    assert np.isnan(check.before.ratio).all()
    assert {one.code for one in check.findings} == {"CS4403", "CS4404"}
    with pytest.raises(Refused, match="CS4402: 1 cut the robot cannot follow"):
        check_feed(judge(plan, forced(2, [0, 1])), strict=True)


def test_moves_beside_a_target_out_of_reach(tmp_path: Path) -> None:
    points = [[1100, 0, 700], [1150, 0, 700], [5000, 0, 700], [1150, 10, 700], [1150, 50, 700]]
    plan = program(tmp_path, lines(points, "v50", "fine"))
    check = check_feed(judge(plan, forced(5, [])), strict=False)
    [found] = told(check, "CS4404")
    assert (found.target, found.line) == (2, FIRST_LINE + 2)
    assert found.message.startswith("2 moves from or to a target whose joint angles are not known")
    assert check.as_dict()["planned"]["judged"] == 2
    assert_allclose(check.before.drive.time[-1], 0.05 / 0.05 + 0.04 / 0.05, rtol=0.05)


FOLDED, STRETCHED = (np.hypot(IRB6660.elbow, IRB6660.forearm) + sign * IRB6660.lower_arm for sign in (-1, 1))


def from_axis_2(x: float, z: float) -> float:
    """How far [m] the wrist is from axis 2 with the tool straight before the robot."""
    wrist = (Frame(np.array([x, 0, z]), Rotation.from_matrix(DOWN)) @ TCP.inv() @ Frame(np.array([0, 0, -0.2]), TCP.r)).p
    return float(np.hypot(abs(wrist[0]) - IRB6660.shoulder, wrist[2] - IRB6660.height))


@pytest.mark.parametrize(("share", "lost"), [(0.98, True), (1.02, False)])
def test_a_line_past_the_robot_can_be_followed_that_keeps_the_arm_from_folding_up(
    tmp_path: Path, share: float, lost: bool
) -> None:
    """From 0.2 m beside it to 0.2 m on the other side, and nearest to axis 2 in the middle."""
    x = brentq(lambda x: from_axis_2(x, 0.4) - share * FOLDED, 0.3, 0.6)
    plan = program(tmp_path, lines([[1e3 * x, -200, 400], [1e3 * x, 200, 400]], "v100", "z1"))
    check = check_feed(judge(plan, forced(2, [])), strict=False)
    assert [(one.target, one.message) for one in told(check, "CS4404")] == [
        (1, "as planned: between 1 pair of targets the robot cannot follow the straight line or arc; these moves were not "
            "judged")] * lost
    assert check.as_dict()["planned"]["judged"] == 1 - lost


@pytest.mark.parametrize(("share", "known"), [(0.999, True), (1.001, False)])
def test_a_move_to_a_target_at_arms_length_is_judged_and_one_beyond_is_not(tmp_path: Path, share: float, known: bool) -> None:
    x = brentq(lambda x: from_axis_2(x, 0.7) - share * STRETCHED, 1.5, 3.0)
    plan = program(tmp_path, lines([[1e3 * x - 100, 0, 700], [1e3 * x, 0, 700]], "v50", "fine"))
    check = check_feed(judge(plan, forced(2, [])), strict=False)
    said = "1 move from or to a target whose joint angles are not known: neither judged nor timed"
    assert [(one.target, one.line, one.message) for one in told(check, "CS4404")] == [(1, FIRST_LINE + 1, said)] * (not known)
    assert check.as_dict()["planned"]["judged"] == known


@pytest.mark.parametrize(("wrist", "cut", "noted"), [(1.3, [], True), (3.0, [], False), (1.3, [0, 1, 2], False)])
def test_the_wrist_singularity_on_air_moves(tmp_path: Path, wrist: float, cut: list[int], noted: bool) -> None:
    """Joint 1 alone moves: axis 5 stays where it is. Targets with force are the correction's business (CS4110)."""
    first, *arc = [written([one, 10, 20, 0, wrist, 0]) for one in (-20, 0, 20)]
    plan = program(tmp_path, [f"MoveJ {first},v100,fine,tSpindle;", f"MoveC {arc[0]},{arc[1]},v100,fine,tSpindle;"])
    check = check_feed(judge(plan, forced(3, cut)), strict=False)
    assert_allclose(check.as_dict()["planned"]["wrist_margin_deg"], wrist, atol=1e-3)
    found = told(check, "CS4406")
    assert len(found) == noted
    if noted:
        assert found[0].target == 1
        assert "2 moves without force within 2 deg of the wrist singularity, the closest 1.30 deg" in found[0].message


def past_the_singularity(across: float, aside: float) -> list[float]:
    """The hand tilted by two small angles [deg], as joint angles."""
    turn = float(np.degrees(np.arctan2(across, aside)))
    return [0, 10, 20, turn, float(np.hypot(across, aside)), -turn]


def test_a_cut_that_passes_the_wrist_singularity_between_its_targets(tmp_path: Path) -> None:
    """Both of its targets are farther away than the correction minds."""
    start, end = past_the_singularity(-1.7, 1.8), past_the_singularity(1.7, 1.8)
    q, _ = angles_along(start, end, np.linspace(0, 1, 101))
    nearest = np.degrees(np.abs(q[:, 4])).min()
    assert nearest < 1.85 < 2.4 < np.degrees(q[[0, -1], 4]).min()
    check = check_feed(judge(program(tmp_path, moves([start, end], "v5")), forced(2, [0, 1])), strict=False)
    [found] = told(check, "CS4406")
    assert found.target == 1
    assert "1 move (1 with force, between its targets) within 2 deg" in found.message
    assert_allclose(float(re.findall(r"the closest ([\d.]+) deg", found.message)[0]), nearest, atol=0.05)


@pytest.mark.parametrize("aside", [1.0, 0.2, 0.02])
def test_axis_4_turns_as_fast_as_it_does(tmp_path: Path, aside: float) -> None:
    """The tool tilts towards the singularity: all the turn of axis 4 lies in a short piece at the end of a long move."""
    start, end = past_the_singularity(-4.0, aside), past_the_singularity(0.0, aside)
    # Backwards from the end, where it turns fastest: axis 5 stands at `aside`, and a hundredth of that is a small step.
    step = 0.01 * aside / 4.0
    q, length = angles_along(start, end, np.array([1.0, 1 - step, 1 - 2 * step]))
    fastest = np.abs(np.diff(q[:, 3])).max() / (step * length)
    judged = judge(program(tmp_path, moves([start, end], "v50")))
    assert judged.joint[1] == 3
    assert_allclose(judged.ratio[1], np.radians(150) / (fastest * 50e-3), rtol=0.02)


def test_no_speed_at_a_singular_start(tmp_path: Path) -> None:
    """From axis 5 at a thousand millionth of a degree: axis 4 must turn by 48 degrees on the first micrometres."""
    start, end = [[0, 10, 20, 0, 1e-9, 47.59169435], [-1.567237503e-06, 9.999848149684, 19.999936753538, 47.59157543994,
                                                     1.5846311539e-04, -5.01554021e-06]]
    with pytest.raises(CompstiffError, match=r"CS4409.*joint [46] turns .* deg a millimetre") as stopped:
        drive(program(tmp_path, moves([start, end], "v100")))
    [found] = stopped.value.findings
    assert (found.target, found.line) == (1, FIRST_LINE + 1)


def test_a_stop_in_the_middle_leaves_a_speed(tmp_path: Path) -> None:
    """Three moves the solver's rounding at the stop once left without any speed."""
    angles = [[0, 10, 20, 15.5486964403, 30, 0],
              [-0.44198534108, 10, 20, 13.7319089666, 29.016592008, 0.730322],
              [7.75976812356, 10.4936210953, 29.4343701777, 15.7546355926, 35.2284917486, -1.7371528]]
    text = moves(angles)
    text[1:] = [text[1].replace("v100", "v50"), text[2].replace("v100", "v5")]
    run = drive(program(tmp_path, text))
    lengths = [np.linalg.norm(pose(b).p - pose(a).p) for a, b in itertools.pairwise(angles)]
    # Length over feed and some ramps; the second move takes a minute.
    assert_allclose(run.time[-1], lengths[0] / 0.05 + lengths[1] / 0.005, rtol=5e-3)


def slow_job(folder: Path, zone: str) -> Job:
    """A robot whose joints turn so slowly that no long move holds 50 mm/s."""
    source = robot().source.read_text()
    (folder / "slow.yaml").write_text(re.sub(r"speed_deg_s: \d+", "speed_deg_s: 1", source))
    program_text = Path3(LINES).program().replace(",z1,", f",{zone},")
    return Job(folder, program=program_text, forces=log(160), cell=kit.cell_text("slow.yaml"))


def test_with_intermediate_targets_lines_and_targets_are_those_of_the_program_given(tmp_path: Path) -> None:
    job = slow_job(tmp_path, "z1")
    line_of = [i for i, text in enumerate(str(job.program).splitlines(), 1) if "Move" in text]
    result = job.correct("--json", "--check-feed", "--report", tmp_path / "report.html")
    assert result.code == 0, result.out
    assert result.json["result"]["added_targets"] > 5
    found = [one for one in result.json["findings"] if one["code"].startswith("CS44") and one["target"] is not None]
    assert {one["code"] for one in found} >= {"CS4401"}
    for one in found:
        assert 0 < one["target"] < 4
        assert one["line"] == line_of[one["target"]]
        assert Path(one["file"]).name == "part.mod"
    feed = result.json["result"]["feed_check"]
    for when in ("planned", "corrected"):
        assert feed[when]["judged"] == feed[when]["held_back"] == 3, "moves of the program given, each once"
        assert feed[when]["held_back_with_force"] <= 3
    assert_allclose(feed["planned"]["time_s"], feed["corrected"]["time_s"], rtol=0.02)
    shown = re.findall(r"target (\d+), line (\d+)", (tmp_path / "report.html").read_text())
    assert shown
    assert all(int(line) == line_of[int(number)] for number, line in shown)
    refused = job.correct("--json", "--force", "--strict-feed")
    assert refused.code == 3
    assert all(one["line"] == line_of[one["target"]] for one in refused.json["findings"] if one["code"] == "CS4402")


def test_as_planned_is_the_program_as_given(tmp_path: Path) -> None:
    """Zones made smaller slow the robot down in the corner: that is a difference of the correction, not of the plan."""
    job = slow_job(tmp_path, "z20")
    job.forces = "path_mm,fx_n,fy_n,fz_n\n" + "".join(f"{s},20,90,-30\n" for s in range(161))     # the corner is in the cut
    result = job.correct("--json", "--check-feed", "--tighten-zones")
    assert "CS4321" in kit.codes(result)
    feed = result.json["result"]["feed_check"]
    assert feed["corrected"]["time_s"] > 1.02 * feed["planned"]["time_s"]


def zigzag(folder: Path, degrees: list[float], leg: float, zone: str, speed: str) -> FeedCheck:
    """The feed check of a zigzag of legs [m] from a pose."""
    middle = pose(degrees)
    corners = [Frame(middle.p + np.array([leg * i, leg * (i % 2), 0.0]), middle.r) for i in range(12)]
    texts = [kit.robtarget(corner, kit.confdata(np.radians(degrees)), digits=12) for corner in corners]
    path = program(folder, [f"Move{'L' if i else 'J'} {text},{speed},{zone},tSpindle;" for i, text in enumerate(texts)])
    return check_feed(judge(path, np.ones(len(texts), dtype=bool)), strict=False)


def test_no_time_is_won_where_the_feed_cannot_be_held(tmp_path: Path) -> None:
    """Rounded corners are shorter than the legs: what they win is no negative loss."""
    check = zigzag(tmp_path, [10, 20, 20, 30, 60, -40], 0.01, "z5", "v200")
    assert np.nansum(check.before.lost[check.before.slow]) < 0, "the case is none"
    assert check.as_dict()["planned"]["lost_held_back_s"] == 0
    (found, *_) = told(check, "CS4401")
    assert "; 0.00 s lost" in found.message


@pytest.mark.parametrize(("wrist", "named"), [(60, False), (8, True)])
def test_the_wrist_is_blamed_where_it_is_near(tmp_path: Path, wrist: float, named: bool) -> None:
    (found, *_) = told(zigzag(tmp_path, [10, 20, 20, 30, wrist, -40], 2e-3, "z1", "v600"), "CS4401")
    assert ("wrist singularity" in found.hint) == named
    assert found.hint.startswith("lower the feed there")


@pytest.mark.parametrize(("wrist", "named"), [(19.0, True), (21.5, False)])
def test_the_wrist_is_blamed_within_twenty_degrees(tmp_path: Path, wrist: float, named: bool) -> None:
    """Legs of half a millimetre: axis 5 stays within half a degree of where it stands at first."""
    (found, *_) = told(zigzag(tmp_path, [10, 20, 20, 30, wrist, -40], 5e-4, "z1", "v600"), "CS4401")
    assert re.search(r"joint (4|6) at its", found.message)
    assert ("wrist singularity" in found.hint) == named


@pytest.mark.parametrize("far", [0, 1])
def test_the_corner_that_holds_a_leg_back_is_the_nearer_one(tmp_path: Path, far: int) -> None:
    """Of a leg with a corner of 90 degrees at one end and of a tenth of that at the other the sharp one is told, with the leg's
    own limit, whichever end it is at."""
    turn = np.radians(9.0)
    points = [[1000.0, 0, 700], [1130, 0, 700], [1130, 40, 700], [1130 - 30 * np.sin(turn), 40 + 30 * np.cos(turn), 700]]
    plan = program(tmp_path, lines(points[::-1] if far else points, "v400", "z5"))
    sharp = 2 if far else 1
    check = check_feed(judge(plan, forced(4, [1, 2])), strict=False)
    [found] = told(check, "CS4401")
    assert found.target == 2
    assert f"in the corner of 90 deg at target {sharp}, rounded by a zone of 5 mm" in found.message
    assert found.hint.startswith("lower the feed there, or round the corner with a larger zone")


def test_the_lowest_share_of_cuts_is_that_of_cuts(tmp_path: Path) -> None:
    """Beside it that of all moves, a sharp corner in air; where no move cuts nothing is held back in a cut."""
    points = [[1100.0, 0, 700], [1130, 0, 700], [1130, 30, 700], [1130, 60, 700], [1130, 90, 700]]
    plan = program(tmp_path, lines(points, "v400", "z5"))
    cut, air = (judge(plan, forced(5, which)) for which in ([3, 4], []))
    assert 0 < cut.as_dict()["lowest_feed_ratio"] < cut.as_dict()["lowest_feed_ratio_with_force"]
    assert cut.as_dict()["lowest_feed_ratio"] == air.as_dict()["lowest_feed_ratio"]
    assert air.as_dict()["lowest_feed_ratio_with_force"] == 1.0


@pytest.mark.parametrize(("share", "told_so"), [(0.985, True), (0.995, False)])
def test_a_feed_is_held_where_one_per_cent_of_it_is_lacking(tmp_path: Path, share: float, told_so: bool) -> None:
    """Joint 1 alone carries the tool round: its speed by the robot file, times the radius, is what can be driven."""
    plan = program(tmp_path, swing(1e3 * robot().speed[0] * RADIUS / share))
    found = told(check_feed(judge(plan, forced(3, [0, 1, 2])), strict=False), "CS4401")
    assert len(found) == told_so
    assert all(": 98 %, joint 1 at its speed limit" in one.message for one in found)


@pytest.mark.parametrize(("share", "told_so"), [(0.85, True), (0.95, False)])
def test_a_pass_of_the_singularity_is_told_that_is_a_tenth_nearer_than_both_ends(tmp_path: Path, share: float, told_so) -> None:
    """The hand tilts sideways past 1.8 degrees from where axis 5 stands at zero; at the ends it is farther by this share."""
    across = 1.8 * np.sqrt(share**-2 - 1)
    start, end = past_the_singularity(-across, 1.8), past_the_singularity(across, 1.8)
    check = check_feed(judge(program(tmp_path, moves([start, end], "v5")), forced(2, [0, 1])), strict=False)
    assert_allclose(check.as_dict()["planned"]["wrist_margin_deg"], 1.8, atol=0.01)
    assert len(told(check, "CS4406")) == told_so


@pytest.mark.parametrize(("degrees", "words"), [
    (148, "; at rest behind 1 linear move; "),
    (152, "; at rest behind 2 linear moves, 1 of them in a corner sharper than 150 deg; ")])
def test_a_corner_sharper_than_150_degrees_is_a_stop(tmp_path: Path, degrees: float, words: str) -> None:
    turn = np.radians(degrees)
    points = [[1100.0, 0, 700], [1150, 0, 700], [1150 + 50 * np.cos(turn), 50 * np.sin(turn), 700]]
    [found] = told(check_feed(judge(program(tmp_path, lines(points, "v50", "z1"))), strict=False), "CS4403")
    assert words in found.message


@pytest.mark.parametrize(("step_um", "turn", "judged", "by_joints"), [
    (0.9, 0.9e-5, 2, 0), (1.1, 0.9e-5, 3, 0), (0.9, 1.1e-5, 2, 1)])
def test_a_target_within_a_micrometre_and_ten_microradians_is_the_one_before(
        tmp_path: Path, step_um: float, turn: float, judged: int, by_joints: int) -> None:
    """Farther off it is a move with a feed; turned on the spot it takes what the joints need."""
    text = lines([[1100.0, 0, 700], [1150, 0, 700], [1150, 0, 700], [1150, 50, 700]], "v50", "fine")
    third = target(np.array([1150 + 1e-3 * step_um, 0, 700]), rotation_matrix(np.array([0, turn, 0])) @ DOWN)
    text[2] = f"MoveL {third},v50,fine,tSpindle;"
    check = check_feed(judge(program(tmp_path, text)), strict=False)
    assert check.as_dict()["planned"]["judged"] == judged
    [found] = told(check, "CS4403")
    assert f"; {by_joints} move{'' if by_joints == 1 else 's'} by joint angles timed, not judged by feed" in found.message
