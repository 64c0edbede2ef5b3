"""`compstiff robots --check`: a sound file broken in one place each time, and what is said of it."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from identification.common.catalogue import catalogue
from identification.common.findings import CompstiffError
from identification.model import robot_check
from identification.model.reach import reach
from identification.model.robot import RobotModel, built_in_robots, read_robot
from identification.model.robot_check import RobotCheck, check_robot
from identification.model.rotations import Frame
from tests.identification.model.urdf_arms import ARMS
from tests.support import robot

KUKA = "kr210-r2700-extra"


def checked(folder: Path, name: str, change: Callable[[str], str]) -> RobotCheck:
    text = built_in_robots()[name].read_text()
    changed = change(text)
    assert changed != text
    path = folder / "mine.yaml"
    path.write_text(changed)
    return check_robot(path)


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text, old
        return text.replace(old, new, 1)

    return change


def scaled(key: str, factor: float) -> Callable[[str], str]:
    """All numbers of a key times a factor, as in another unit."""
    def change(text: str) -> str:
        number = r"-?[\d.]+(?:e\d+)?"
        return re.sub(rf"({key}: )(\[[^\]]*\]|{number})",
                      lambda m: m[1] + re.sub(number, lambda n: f"{float(n[0]) * factor:.8g}", m[2]), text)

    return change


def without(key: str) -> Callable[[str], str]:
    """The file without a line of sources, or a top-level block of one line."""
    def change(text: str) -> str:
        lines = text.splitlines(keepends=True)
        at = next(i for i, line in enumerate(lines) if line.startswith(f"  {key}: "))
        end = at + 1
        while end < len(lines) and lines[end].startswith("    "):
            end += 1
        return "".join(lines[:at] + lines[end:])

    return change


def test_a_joint_that_says_nothing_counts_from_its_frame_and_with_it(tmp_path: Path) -> None:
    text = built_in_robots()[KUKA].read_text()
    left_out = text.replace("offset_deg: 0,   ", "").replace("sense: 1,  ", "")
    assert (text.count("offset_deg"), left_out.count("offset_deg")) == (6, 2)
    (tmp_path / "mine.yaml").write_text(left_out)
    told, whole = read_robot(tmp_path / "mine.yaml"), read_robot(built_in_robots()[KUKA])
    np.testing.assert_array_equal(told.offset, whole.offset)
    np.testing.assert_array_equal(told.coupling, whole.coupling)


# What is broken, the file, the break, the code, and words of the message or hint.
BROKEN = [
    ("lengths in metres", KUKA, lambda t: scaled("d_mm", 1e-3)(scaled("a_mm", 1e-3)(t)), "CS0062", "milling arm"),
    ("limits in radians", KUKA, scaled("limits_deg", np.pi / 180), "CS0062", "limits_deg"),
    ("speeds in radians", KUKA, scaled("speed_deg_s", np.pi / 180), "CS0062", "57.2958"),
    ("speeds a minute", KUKA, scaled("speed_deg_s", 60), "CS0062", "not a minute"),
    ("twists in radians", KUKA, scaled("alpha_deg", np.pi / 180), "CS0062", "1.5708 is 90"),
    ("prior in N m/arcmin", KUKA, scaled("stiffness_nm_per_rad", 1 / 3437.75), "CS0062", "3437.75"),
    ("an offset wrist", KUKA, swap("alpha_deg: 90,  a_mm: 0, ", "alpha_deg: 90,  a_mm: 40,"), "CS0061", "a of joints 1, 5"),
    ("an offset shoulder", KUKA, swap("a_mm: 350,  d_mm: 0", "a_mm: 350,  d_mm: 50"), "CS0061", "d of joints 2, 3 and 5"),
    ("axis 3 across", KUKA, swap("alpha_deg: 0,   a_mm: 1150", "alpha_deg: 90,  a_mm: 1150"), "CS0061", "0 or 180"),
    ("a wrong lower arm", KUKA, swap("a_mm: 1150", "a_mm: 1250"), "CS0063", "2700 mm"),
    ("a wrong limit", KUKA, swap("limits_deg: [-140, -5]", "limits_deg: [-140, -40]"), "CS0063", "limits of joints 2 and 3"),
    ("reach from axis 2", KUKA, swap("reach_mm: 2700", "reach_mm: 2350"), "CS0063", "state reach_from: axis 2"),
    ("a reach of another arm", "irb6660-205-1.90", lambda t: swap("reach_mm: 1900, reach_from: axis 1, reach_tolerance_mm: 50",
                                                     "reach_mm: 2000, reach_from: axis 1, reach_tolerance_mm: 20")(t),
     "CS0063", "1933"),
    ("sense of A1 forgotten", KUKA, swap("offset_deg: 0,   sense: -1, limits_deg: [-185, 185]",
                                         "offset_deg: 0,   sense: 1, limits_deg: [-185, 185]"), "CS0064", "flange_mm"),
    ("sense of A6 forgotten", KUKA, swap("offset_deg: 180, sense: -1", "offset_deg: 180, sense: 1"), "CS0064", "turned by"),
    ("zero of A3", KUKA, swap("offset_deg: -90, sense: 1", "offset_deg: 0, sense: 1"), "CS0064", "mm away"),
    ("flange the other way round", KUKA, swap("offset_deg: 180", "offset_deg: 0"), "CS0064", "quaternion"),
    ("coupling forgotten", "m710ic-50", lambda t: swap("coupling: {joint: 3, driven_by: 2, ratio: -1, rod: false}\n", "")(t),
     "CS0064", "coupling"),
    ("coupling the other way", "m710ic-50", swap("ratio: -1", "ratio: 1"), "CS0064", "coupling"),
    ("a wrong wrist", "irb6620-150-2.20", swap("wrist_mm: [1207", "wrist_mm: [1209"), "CS0064", "wrist_mm"),
    ("a pose of another variant", KUKA, swap("joints_deg: [20, -80", "joints_deg: [20, -3"), "CS0067", "joint 2"),
    ("a window that leaves nothing", "irb6660-205-1.90", swap("window_deg: [-70, 70]", "window_deg: [170, 175]"), "CS0068",
     "leaves"),
    ("no source of the limits", KUKA, without("limits"), "CS0065", "sources.limits"),
    ("no source of the coupling", "m710ic-50", without("coupling"), "CS0065", "sources.coupling"),
    ("no source of the data sheet", KUKA, without("data_sheet"), "CS0065", "sources.data_sheet"),
    ("no reach", KUKA, swap("reach_mm: 2700, ", ""), "CS0066", "reach_mm"),
]


@pytest.mark.parametrize(("name", "change", "code", "words"), [each[1:] for each in BROKEN], ids=[each[0] for each in BROKEN])
def test_each_break_is_found(name: str, change: Callable[[str], str], code: str, words: str, tmp_path: Path) -> None:
    assert check_robot(built_in_robots()[name]).sound
    check = checked(tmp_path, name, change)
    mine = [finding for finding in check.findings if finding.code == code]
    assert mine, [str(finding) for finding in check.findings]
    assert any(words in f"{finding.message} {finding.hint}" for finding in mine), [str(finding) for finding in mine]
    warns = code in ("CS0065", "CS0066", "CS0067")
    assert check.sound == (warns and all(finding.level != "error" for finding in check.findings))
    assert {finding.level for finding in mine} == {"warning" if warns else "error"}
    assert code in catalogue()
    row = next(row for row in check.rows if mine[0] in row.findings)
    assert row.verdict in ("error", mine[0].level)
    assert any(row.verdict in line for line in check.lines())


@pytest.mark.parametrize(("keys", "limit", "stated", "over", "said"), [
    # All lengths of the file together, the largest limit, the fastest joint, the prior of joint 1.
    (("a_mm", "d_mm"), 300, 3631, True, "all lengths together are {:.6g} mm; of a milling arm 300 to 15000 mm are expected"),
    (("a_mm", "d_mm"), 15000, 3631, False, "all lengths together are {:.6g} mm; of a milling arm 300 to 15000 mm are expected"),
    (("limits_deg",), 7, 350, True, "the largest limits_deg of all joints is {:.4g}; more than 7 is expected"),
    (("speed_deg_s",), 7, 219, True, "the largest speed_deg_s of all joints is {:.4g}; more than 7 is expected"),
    (("speed_deg_s",), 1500, 219, False, "the largest speed_deg_s is {:.4g}; at most 1500 is expected"),
    (("stiffness_nm_per_rad",), 1e4, None, True, "the prior of joint 1 is {:.4g} N m/rad; over 10000 is expected")])
def test_a_number_is_of_another_unit_beyond_its_limit(
    tmp_path: Path, keys: tuple[str, ...], limit: float, stated: float | None, over: bool, said: str,
) -> None:
    """What is expected lies over the limit, or under it."""
    stated = stated or read_robot(built_in_robots()[KUKA]).prior.stiffness[0]

    def told(share: float) -> list[str]:
        def change(text: str) -> str:
            for key in keys:
                text = scaled(key, share * limit / stated)(text)
            return text

        return [one.message for one in checked(tmp_path, KUKA, change).findings if one.code == "CS0062"]

    assert told(1.003 if over else 0.997) == []
    assert told(0.997 if over else 1.003) == [said.format((0.997 if over else 1.003) * limit)]


def test_the_line_of_units_has_their_numbers_and_a_twist_its_joint(tmp_path: Path) -> None:
    check = checked(tmp_path, KUKA, swap("alpha_deg: -90, a_mm: 350", "alpha_deg: -89, a_mm: 350"))
    units = next(row for row in check.rows if row.subject == "units")
    prior = read_robot(built_in_robots()[KUKA]).prior.stiffness[0]
    assert units.found == f"lengths 3631 mm in all, fastest joint 219 deg/s, prior of joint 1 {prior:.3g} N m/rad"
    assert [one.message for one in units.findings] == ["alpha_deg is no multiple of 90 (joint 2: -89)"]


def test_a_file_without_a_pose_proves_no_sign(tmp_path: Path) -> None:
    check = checked(tmp_path, KUKA, lambda text: text[:text.index("poses:")] + text[text.index("sources:"):])
    row = next(row for row in check.rows if row.subject == "poses")
    assert (row.found, row.verdict) == ("none stated", "warning")
    assert [(one.code, one.level, one.message) for one in check.findings] == [
        ("CS0066", "warning", "no pose to hold the forward kinematics against: signs and zeros of the joints are unproved")]
    assert check.sound


@pytest.mark.parametrize(("stated", "tolerance", "off", "told"), [
    (2700, 3.69, -3.7, False), (2700, 3.67, -3.7, True), (2690, 6.33, 6.3, False), (2690, 6.31, 6.3, True)])
def test_a_reach_is_told_that_is_off_by_more_than_its_tolerance(
    tmp_path: Path, stated: float, tolerance: float, off: float, told: bool,
) -> None:
    """The upper arm comes down to 5 degrees, the forearm to level: 350 + 1150 cos 5 + hypot(1200, 41) = 2696.32 mm."""
    check = checked(tmp_path, KUKA, swap("reach_mm: 2700, ", f"reach_mm: {stated}, reach_tolerance_mm: {tolerance}, "))
    row = next(row for row in check.rows if row.subject == "reach")
    assert row.found == ("2696.3 mm from axis 1: the wrist centre's largest distance inside the limits; "
                         f"stated {stated} mm, {off:+.1f}")
    assert [(one.code, one.message) for one in row.findings] == [
        ("CS0063", f"reaches 2696.3 mm from axis 1, the data sheet states {stated} mm, tolerance {tolerance} mm")][:told]


@pytest.mark.parametrize(("tolerance", "told"), [("tolerance_mm: 3.06, tolerance_deg: 2.01", 0), ("tolerance_mm: 3.03", 1)])
def test_a_pose_is_told_that_is_off_by_more_than_its_tolerance(tmp_path: Path, tolerance: str, told: int) -> None:
    """A flange 215 mm away from the wrist whose angle of axis 6 is 2 degrees off, stated 3.05 mm too far along x."""
    check = checked(tmp_path, KUKA, lambda text: swap("flange_mm: [1692.53,", f"{tolerance}, flange_mm: [1695.58,")(
        swap("40, -50]", "40, -48]")(text)))
    row = next(row for row in check.rows if row.subject == "pose 1")
    assert row.found.startswith("flange off by 3.0")
    assert ", turned by 2.00" in row.found
    messages = [one.message for one in row.findings if one.code == "CS0064"]
    assert len(messages) == 2 * told
    if told:
        assert messages[0] == ("pose 1: flange_mm is [1695.58, -689.57, 1299.11] in the document, the file's geometry gives "
                               "[1692.53, -689.57, 1299.11], 3.05 mm away, tolerance 3.03 mm")
        assert re.fullmatch(r"pose 1: the flange is turned by 2\.00\d deg against the document's quaternion, tolerance "
                            r"0\.1 deg", messages[1])


@pytest.mark.parametrize(("old", "new", "words"), [
    ("sense: -1", "sense: -2", "sense"),
    ("limits_deg: [-140, -5]", "limits_deg: [-5, -140]", "ascending"),
    ("flange_mm: [", "flange_m: [", "flange_m"),
    ("reach_from: axis 1", "reach_from: axis 3", "axis 1"),
    ("load_path: serial", "load_path: serial\ncoupling: {joint: 3, driven_by: 3, ratio: 1}", "driven by itself"),
    ("load_path: serial", "load_path: drive\ncoupling: {joint: 3, driven_by: 2, ratio: -1, rod: false}",
     "load_path must be serial"),
    ("load_path: serial\n", "", "load_path must be drive or serial where joints are given; received none"),
    ("load_path: serial", "load_path: serial\ncoupling: {joint: 3, driven_by: 2, ratio: -1, window_deg: [5, 5]}",
     "window_deg must be an ascending pair; received [5.0, 5.0]"),
    ("geometry: \"", "geometri: \"", "geometri"),
])
def test_what_is_no_robot_file_is_refused_with_its_place(old: str, new: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(swap(old, new)(built_in_robots()[KUKA].read_text()))
    with pytest.raises(CompstiffError) as refused:
        check_robot(path)
    assert any(words in str(finding) and finding.code == "CS0102" for finding in refused.value.findings)
    assert not any("found {" in str(finding) for finding in refused.value.findings)
    assert any(finding.line for finding in refused.value.findings)


def test_what_needs_joints_is_refused_without_them(tmp_path: Path) -> None:
    """A file of a name and a prior alone is one, and reading a coupling past it would be silent."""
    text = built_in_robots()[KUKA].read_text()
    joints, prior, poses, sources = (text.index(f"\n{key}:") + 1 for key in ("joints", "prior", "poses", "sources"))
    bare = text[:joints] + text[prior:poses] + text[sources:]
    path = tmp_path / "mine.yaml"
    path.write_text(bare)
    assert read_robot(path, geometry=False).name == "kr210-r2700-extra"
    for more in ("coupling: {joint: 3, driven_by: 2, ratio: -1}\n", text[poses:sources]):
        path.write_text(bare + more)
        with pytest.raises(CompstiffError) as refused:
            read_robot(path, geometry=False)
        (finding,) = refused.value.findings
        assert (finding.code, finding.file) == ("CS0102", str(path))
        assert finding.message == "coupling, links and poses need joints; received none"      # and not the whole file


@pytest.mark.parametrize(("width_deg", "told"), [(0.07, True), (0.28, False)])
def test_a_window_is_told_that_leaves_under_a_thousandth_of_what_the_limits_allow(
    tmp_path: Path, width_deg: float, told: bool,
) -> None:
    """theta_3 - theta_2 of -20 ... 120.5 and -42 ... 85 degrees: between 22 and 35.5 a degree is 1 / 140.5 of all."""
    check = checked(tmp_path, "irb6660-205-1.90", swap("window_deg: [-70, 70]", f"window_deg: [25, {25 + width_deg}]"))
    found = [one for one in check.findings if one.code == "CS0068"]
    assert [(one.level, re.sub(r"[\d.]+ %", "x %", one.message)) for one in found] == [
        ("error", "the window of the coupled angle leaves x % of what the joints' limits allow")][: told]
    if told:
        share = re.search(r"([\d.]+) %", found[0].message)
        assert share
        assert float(share[1]) == pytest.approx(100 * width_deg / 140.5, rel=0.4)


@pytest.mark.parametrize(("old", "new", "which"), [
    ("window_deg: [-70, 70]", "window_deg: [-70, 0]", ""),
    ("window_deg: [-70, 70]", "window_deg: [-70, -0.1]", "the window of the coupled angle"),
    ("limits_deg: [-42, 85]", "limits_deg: [0, 85]", ""), ("limits_deg: [-42, 85]", "limits_deg: [0.1, 85]", "joint 2")])
def test_a_pose_outside_the_limits_is_told_with_what_it_is_outside_of(tmp_path: Path, old: str, new: str, which: str) -> None:
    """The document's pose has all joints at zero."""
    check = checked(tmp_path, "irb6660-205-1.90", swap(old, new))
    assert [(one.level, one.message) for one in check.findings if one.code == "CS0067"] == [
        ("warning", f"pose 1 is outside the limits of the file: {which}")][: bool(which)]


def test_a_window_that_no_angle_meets_is_said_once(tmp_path: Path) -> None:
    check = checked(tmp_path, "irb6660-205-1.90", swap("window_deg: [-70, 70]", "window_deg: [300, 310]"))
    assert [finding.code for finding in check.findings if finding.level == "error"] == ["CS0068"]
    assert "nan" not in " ".join(check.lines())


@pytest.mark.parametrize(("off", "lost"), [(0.0, 0), (2e-10, 0), (2e-9, 7), (np.nan, 7)])
def test_poses_that_the_inverse_does_not_give_back_are_counted(monkeypatch: pytest.MonkeyPatch, off: float, lost: int) -> None:
    """To a nanometre and 1e-9 rad; an inverse that is wrong here is none to correct with. An arm of half a metre to 2 m from
    axis 1 moves by less than 1e-9 m and more than that, turned so far about it."""
    def off_at_seven(robot: RobotModel, flange: Frame, theta: np.ndarray) -> np.ndarray:
        return theta + np.where(np.arange(len(theta)) < 7, off, 0.0)[:, None] * np.eye(6)[0]

    monkeypatch.setattr(robot_check, "nearest_angles", off_at_seven)
    found = check_robot(built_in_robots()["irb6700-200-2.60"])
    row = next(row for row in found.rows if row.subject == "inverse")
    assert (row.verdict, found.sound) == (("error", False) if lost else ("ok", True))
    assert row.found.startswith("2000 random poses inside the limits, given back to ")
    assert [(one.code, one.level, one.message) for one in row.findings] == [
        ("CS0061", "error", "at 7 of 2000 poses inside the limits the inverse kinematics gives another pose")][: bool(lost)]


def test_a_pose_that_says_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match="must say flange_mm, wrist_mm or quaternion"):
        checked(tmp_path, KUKA, lambda t: t.partition("poses:")[0] + "poses: [{joints_deg: [0, 0, 0, 0, 0, 0], source: x}]\n")


def test_poses_without_source_are_named(tmp_path: Path) -> None:
    check = checked(tmp_path, KUKA, lambda t: t.partition("poses:")[0]
                    + "poses: [{joints_deg: [0, -90, 90, 0, 0, 0], flange_mm: [1765, 0, 1784]}]\n")
    assert check.sound
    assert "poses[0].source" in " ".join(finding.message for finding in check.findings)
    # Nothing else has a source in this file either: geometry, limits, speed, acceleration, prior, data_sheet.
    assert sum(finding.code == "CS0065" for finding in check.findings) == 7


def planar_reach(name: str, steps: int = 2001) -> float:
    """Brute force over joints 2 and 3 by the URDF's own chain, wrist centre over axis 1 [m], without any window."""
    arm, limits = ARMS[name], robot(name).limits
    origins = np.array(arm.origins)
    lower, elbow = origins[2], origins[3] + origins[4]
    q2, q3 = (np.linspace(*limits[k], steps) for k in (1, 2))
    if arm.interlocked:
        best = 0.0
        for second in q2:
            # the forearm's slope against the horizontal is J3 itself, positive upwards
            away = origins[1][0] + lower[2] * np.sin(second) + elbow[0] * np.cos(q3) - elbow[2] * np.sin(q3)
            best = max(best, float(np.abs(away).max()))
        return best
    at = origins[0][0] + origins[1][0] + lower[0] * np.cos(q2) + lower[2] * np.sin(q2)
    both = q2[:, None] + q3
    return float(np.abs(at[:, None] + elbow[0] * np.cos(both) + elbow[2] * np.sin(both)).max())


@pytest.mark.parametrize("name", sorted(set(ARMS) - {"irb6640-185-2.80"}))
def test_reach_is_the_brute_force_one(name: str) -> None:
    assert abs(reach(robot(name)) - planar_reach(name)) < 1e-5


def test_reach_obeys_the_rod(tmp_path: Path) -> None:
    """Where the rod's window is narrow the arm does not stretch: the forearm stays near square to the lower arm."""
    path = tmp_path / "narrow.yaml"
    path.write_text(swap("window_deg: [-70, 70]", "window_deg: [-50, 50]")(built_in_robots()["irb6660-205-1.90"].read_text()))
    model = read_robot(path)
    q2, slope = np.meshgrid(np.radians(np.linspace(-42, 85, 1500)), np.radians(np.linspace(-20, 120.5, 1500)))
    far = 0.3 + 0.7 * np.sin(q2) + 0.893 * np.cos(slope) + 0.28 * np.sin(slope)
    far[np.abs(slope - q2) > np.radians(50)] = 0
    assert abs(reach(model) - far.max()) < 1e-3         # the grid's step along the window's edge
    assert reach(model) < reach(robot("irb6660-205-1.90")) - 0.01


def test_reach_from_axis_2_is_the_stretched_arm() -> None:
    assert abs(reach(read_robot(built_in_robots()[KUKA]), 2) - (1.150 + np.hypot(1.2, 0.041))) < 1e-6


@pytest.mark.parametrize("count", [5, 7])
@pytest.mark.parametrize("key", ["joints", "links"])
def test_an_arm_has_six_joints_and_six_links(tmp_path: Path, key: str, count: int) -> None:
    described = yaml.safe_load(built_in_robots()["irb6700-200-2.60"].read_text())
    link = {"mass_kg": 10.0, "centre_of_mass_mm": [0, 0, 0]}
    described |= {"links": [link] * 6}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(described))
    assert read_robot(tmp_path / "robot.yaml").link_mass.tolist() == [10.0] * 6
    described[key] = (described[key] * 2)[:count]
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(described))
    with pytest.raises(CompstiffError) as refused:
        read_robot(tmp_path / "robot.yaml")
    (finding,) = refused.value.findings
    assert finding.message.startswith(f"'{key}': must be a list of at {'most' if count > 6 else 'least'} 6; found [")
