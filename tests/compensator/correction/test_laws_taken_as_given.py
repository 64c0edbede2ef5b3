"""The cut that logged forces are those of, against end mills whose cut is known; forces of another cut than the stated one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction.settings import Settings
from compensator.correction.taken_as_given import WITHIN, TakenAsGiven, _cut, taken_as_given
from identification.model.cell_file import CuttingFile
from tests.compensator.correction.test_laws_following import planned
from tests.virtual_cell.endmill import EndMill

STATED = CuttingFile(material="aluminium", tool_diameter_mm=16.0, contact_mm=2.0)


def drawn(seed: int) -> tuple[EndMill, float, float]:
    """A cutter in aluminium with radial and edge parts of half to twice the usual, its width and depth of cut [mm]."""
    rng = np.random.default_rng((3079, seed))
    teeth, shear, edge = int(rng.integers(1, 5)), np.array(EndMill.shear_n_mm2), np.array(EndMill.edge_n_mm)
    cutter = EndMill(teeth=teeth, runout_mm=teeth * (0.0,), feed_mm_s=rng.uniform(15, 80),
                     shear_n_mm2=tuple(shear * [1, rng.uniform(0.5, 2), 1]), edge_n_mm=tuple(edge * rng.uniform(0.5, 2, 3)))
    return cutter, float(rng.uniform(0.8, 14)), float(rng.uniform(0.5, 4))


def section(cutter: EndMill, width: float, depth: float, gain: float = 1.0) -> float:
    """What is said of a cut of such a width [mm] of the rim and depth along the axis [mm], in aluminium."""
    along, left, _ = cutter.mean_force(cutter.coverage(width - cutter.radius_mm - cutter.rim_mm[:, 1]), depth)
    force = np.full(5, gain * np.hypot(along, left))
    _, sections = _cut(force, np.full(5, 1e-3 * cutter.feed_mm_s), STATED.model_copy(update={"teeth": cutter.teeth}),
                       cutter.spindle_rpm)
    return sections["aluminium"]


def test_the_cut_is_known_within_the_factor_that_is_said() -> None:
    """Of 60 end mills; a log in kilograms or pounds is not."""
    jobs = [drawn(seed) for seed in range(60)]
    for gain, most, least in ((1.0, 1.0, 0.95), (1 / 9.80665, 0.05, 0.0), (4.44822, 0.35, 0.0)):
        times = np.array([section(*job, gain) / (job[1] * job[2]) for job in jobs])
        assert least <= np.mean((times > 1 / WITHIN) & (times < WITHIN)) <= most, gain


@pytest.mark.parametrize(("gain", "told"), [(1.0, False), (2.0, False), (1 / 9.80665, True), (9.80665, True)])
def test_a_cut_that_is_stated_is_held_against_the_forces(gain: float, told: bool) -> None:
    """Stated as it is, over 20 end mills: no word of a right log, nor of twice the force, which lies within what is known."""
    said = []
    for seed in range(20):
        cutter, width, depth = drawn(seed)
        given = TakenAsGiven("", "", 1.0, 1.0, {"aluminium": section(cutter, width, depth, gain)})
        found = given.finding(STATED.model_copy(update={"contact_mm": depth}), 1e-3 * width, "log")
        said += [one.code for one in found]
    assert said == (20 * ["CS3079"] if told else [])
    if gain > 2:
        assert given.finding(STATED.model_copy(update={"contact_mm": 0.01}), None, "log")[0].code == "CS3079"
        assert not given.finding(CuttingFile(), None, "log")


@pytest.mark.parametrize(("area", "depth_mm", "words"), [
    (72.0, None, ""), (88.0, None, "a cut of 88 mm2 in aluminium, within a factor of 2.5; it is stated as at most 32 mm2"),
    (28.8, 4.0, ""), (35.2, 4.0, "a cut of 35 mm2 in aluminium, within a factor of 2.5; it is stated as 8 mm2"),
    (2.22, 4.0, ""), (1.82, 4.0, "a cut of 1.8 mm2 in aluminium, within a factor of 2.5; it is stated as 8 mm2")])
def test_a_cut_is_another_beyond_two_and_a_half_of_the_largest_or_four_of_the_stated_one(area, depth_mm, words: str) -> None:
    """2 mm along the edge, and as deep as the cutter is wide, 16 mm, or as stated."""
    given = TakenAsGiven("", "", 1.0, 1.0, {"aluminium": area})
    found = given.finding(STATED, None if depth_mm is None else 1e-3 * depth_mm, "log")
    assert [one.message for one in found] == [f"these forces take {words}"] * bool(words)


CUT = {"material": "steel", "tool_diameter_mm": 12.0, "contact_mm": 4.0}


@pytest.mark.parametrize(("told", "rpm", "teeth", "names"), [
    (CUT, 3000.0, 3, ["steel"]), (CUT | {"teeth": 4}, 3000.0, 4, ["steel"]),
    ({"tool_diameter_mm": 12.0}, 3000.0, 3, ["aluminium", "steel"]), (CUT, None, 3, []),
    ({"material": "steel"}, 3000.0, 3, [])])
def test_the_section_of_a_cut_is_its_power_by_that_of_a_square_millimetre(
    told: dict[str, Any], rpm: float | None, teeth: int, names: list[str]
) -> None:
    """Nine tenths of the force across at the edges' speed, by k_c (Kienzle, chips of sqrt(0.1) of the feed a tooth) times the
    feed; the middle of the targets whose feed is known."""
    across, feed = np.array([100.0, 300, 200, 900, 500]), np.array([0.01, 0.02, 0.015, np.nan, 0.0])
    power, sections = _cut(across, feed, CuttingFile(**told), rpm)
    assert list(sections) == names
    if not names:
        assert power is None
        return
    speed = np.pi * 0.012 * 3000 / 60
    assert power == pytest.approx(0.9 * 200 * speed)
    for name, (specific, exponent) in (("aluminium", (735, 0.25)), ("steel", (1740, 0.23))):
        if name in names:
            areas = [0.9 * one * speed / (specific * (1e3 * v * 60 / 3000 / teeth * np.sqrt(0.1)) ** -exponent * v)
                     for one, v in ((100, 0.01), (300, 0.02), (200, 0.015))]
            assert sections[name] == pytest.approx(np.median(areas))
    assert _cut(across[3:], feed[3:], CuttingFile(**told), rpm) == (None, {})


def test_what_is_taken_as_given_is_said_in_a_line_each() -> None:
    given = TakenAsGiven("an arm", "cuts at x 1 to 2", 123.4, 812.0, {"aluminium": 2.34, "copper_alloy": 1.06}, "the seat",
                         "on average 3 N, as in climb milling")
    cut = ("123 N across the tool in the middle, as a cut of 2.3 mm2 in aluminium or 1.1 mm2 in copper alloy takes (depth x "
           "width, within a factor of 2.5), 0.81 kW at the edges")
    words = ["robot: an arm", "part: cuts at x 1 to 2", f"cut: {cut}", "force on the tool: on average 3 N, as in climb milling",
             "taken as exact, as cell.yaml says nothing of it: the seat"]
    assert given.words == words
    assert given.lines() == ["taken as given, compare:", *(f"  {one}" for one in words)]
    unknown = replace(given, power=None, sections={}, direction="", unstated="")
    assert unknown.words[2:] == ["cut: 123 N across the tool in the middle (cutting.material and tool_diameter_mm in "
                                 "cell.yaml, a spindle speed: then what cut that is)"]
    assert replace(unknown, of_stock="from the stock").words[2:] == ["cut: from the stock"]
    assert replace(unknown, force=0.0).words[2:] == []
    assert replace(given, place="").lines() == []


@pytest.mark.parametrize(("serial", "source", "robot_words"), [
    (None, None, "arm, no serial_number in cell.yaml: those of another robot of this type would not be noticed"),
    ("A1", "stiff.json", "arm, serial number A1, stiffnesses from stiff.json"),
    (None, "stiff.json", "arm, no serial_number in cell.yaml, stiffnesses from stiff.json: those of another robot of this type "
     "would not be noticed")])
def test_where_the_program_cuts_and_by_which_robot_is_said(serial: str | None, source: str | None, robot_words: str) -> None:
    """In whole millimetres around all of its targets with force; of predicted forces without their size."""
    job = planned([[30, 40, -50]] * 3 + [[0, 0, 0]], [0.2, 1.0, 2.7, 9.0], [[0, 0, 0]] * 3)
    job.path.cell = SimpleNamespace(
        robot=SimpleNamespace(name="arm", serial_number=serial), cutting=CuttingFile(), accuracy=None,
        force_log=SimpleNamespace(form=SimpleNamespace(spindle_rpm=None, mounting_std_deg=None)))
    job.path.toolpath.feed = np.full(4, 0.01)
    job.path.base_from_tcp.position[:, 2] = 0.7004
    job.path.toolpath.by_joints = np.zeros(4, dtype=bool)
    job.path.steps = np.diff(job.path.base_from_tcp.position, axis=0, prepend=0.0)
    loaded: Any = SimpleNamespace(path=job.path, targets=job.targets, forces=job.forces, learned=None,
                                  model=SimpleNamespace(source=None if source is None else Path(source)))
    job.forces.unknown = np.zeros((4, 3, 3))
    found = taken_as_given(loaded, Settings())
    assert (found.robot, found.place) == (robot_words, "cuts at x 0 to 3, y 0 to 0, z 700 to 701 mm from the robot's base")
    assert (found.force, found.direction, found.unstated) == (0.0, "", "where the robot stands without load (accuracy)")
    job.forces.unknown = None
    found = taken_as_given(loaded, Settings())
    assert found.force == pytest.approx(50.0)
    assert found.unstated == ("how the force sensor is turned (force_log.mounting_std_deg), where the robot stands without "
                              "load (accuracy)")
    loaded.targets = np.arange(0)
    assert taken_as_given(loaded, Settings()).lines() == []
