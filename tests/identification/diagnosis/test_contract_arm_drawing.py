"""The drawing of the arm has a place for every cause of the dictionary, and marks the joint that is named."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from types import SimpleNamespace
from typing import Any

import pytest

from identification.diagnosis.arm_drawing import JOINTS, arm_drawing, places, sound_arm
from identification.model.effects import effects


def cause(name: str, joint: int | None, law: str = "") -> Any:
    effect = effects()[name]
    return SimpleNamespace(effect=next(one for one in (effect, *effect.other_laws) if one.law == law), joint=joint)


@pytest.mark.parametrize("name", sorted(effects()))
def test_every_cause_has_a_place(name: str) -> None:
    for law in ("", *(other.law for other in effects()[name].other_laws if other.law)):
        for joint in effects()[name].joints or (None,):
            one = cause(name, joint, law if law or not effects()[name].law else effects()[name].law)
            (_, (x, y)), = places([one])
            assert 0 < x < 640
            assert 0 < y < 320
            ET.fromstring(str(arm_drawing([one], certain=True)))


@pytest.mark.parametrize(("name", "joint", "law", "told"), [
    ("base_rocking", None, "column", "column"), ("gravity_compensator", 2, "worn", "joint 2"),
    ("uneven_gear", 5, "worn", "joint 5"), ("link_bending", 2, "twist", "link 2"),
    ("force_misalignment", None, "flange", "force sensor"),
    ("creep", None, "element", "all joints"), ("softening", None, "settling", "all joints"),
    ("soft_gears", None, effects()["soft_gears"].law, "all joints"),
    ("lost_motion", None, effects()["lost_motion"].law, "all joints")])
def test_a_law_sits_where_it_does(name: str, joint: int | None, law: str, told: str) -> None:
    """What the whole robot or all gears do had been marked at the lower arm, a worn gear at a compensator, a column as the
    floor."""
    picture = ET.fromstring(str(arm_drawing([cause(name, joint, law)], certain=True)))
    assert picture.get("aria-label") == f"The arm under test; marked: {told}"
    rings = {(int(one.get("cx")), int(one.get("cy"))) for one in picture.iter("circle") if one.get("r") == "21"}
    assert rings == (set(JOINTS.values()) if told == "all joints" else rings)
    assert len(rings) == (6 if told == "all joints" else 1)
    if told.startswith("joint"):
        assert rings == {JOINTS[joint]}


def test_links_have_their_names() -> None:
    bends, twists = effects()["link_bending"], effects()["link_bending"].other_laws[0]
    assert [bends.told(2), bends.told(3), twists.told(2)] == [
        "the lower arm (link 2) bends", "the forearm (link 3) bends", "the lower arm (link 2) twists about its length"]


def test_the_joint_is_marked_where_it_stands_and_told_in_words() -> None:
    for joint in (1, 2, 3, 4, 5, 6):
        picture = ET.fromstring(str(arm_drawing([cause("backlash", joint)], certain=True)))
        ring = next(one for one in picture.iter("circle") if one.get("r") == "21")
        assert (int(ring.get("cx")), int(ring.get("cy"))) == JOINTS[joint]
        number = next(text for text in picture.iter("text") if text.text == str(joint))
        assert abs(float(number.get("x")) - float(ring.get("cx"))) < 1
        assert f"joint {joint}" in picture.get("aria-label")


def test_what_is_open_is_drawn_otherwise_than_what_is_named() -> None:
    both = [cause("backlash", 2), cause("base_rocking", None)]
    named, opened = (str(arm_drawing(both, certain)) for certain in (True, False))
    assert named.count('r="21"') == opened.count('r="21"') == 2
    assert "dashed" in opened
    assert "dashed" not in named
    assert "may be" in opened


def test_a_rod_and_a_compensator_are_drawn_where_there_are_such() -> None:
    """Every robot had both."""
    gear, spring = [cause("backlash", 1)], [cause("gravity_compensator", 2)]
    bare, rod, compensated = (str(arm_drawing(causes, True, rod=rod)) for causes, rod in (
        (gear, False), (gear, True), (spring, False)))
    assert [picture.count("<path") for picture in (rod, compensated)] == [bare.count("<path") + 1] * 2
    assert rod != compensated


def test_names_stand_at_the_height_of_what_they_name() -> None:
    """Lines from name to ring do not cross each other."""
    causes = [cause("base_rocking", None), cause("backlash", 1), cause("backlash", 3), cause("stand_compliance", None),
              cause("spindle_compliance", None)]
    picture = ET.fromstring(str(arm_drawing(causes, certain=True)))
    lines = [tuple(map(int, re.findall(r"-?\d+", one.get("d")))) for one in picture.iter("path")
             if one.get("class") == "stroke-bad"]
    assert len(lines) == len(causes)
    for side in (True, False):
        ends = sorted((y0, y1) for x0, y0, x1, y1 in lines if (x1 < x0) == side)
        assert [end for _, end in ends] == sorted(end for _, end in ends)
    left, _, width, _ = map(float, picture.get("viewBox").split())
    for text in picture.iter("text"):
        if text.get("class") == "name":
            long = 8.5 * len(text.text)
            start = float(text.get("x")) - (long if text.get("text-anchor") == "end" else 0)
            assert left <= start
            assert start + long <= left + width


def test_nothing_to_blame_is_drawn_around_every_joint() -> None:
    picture = ET.fromstring(str(sound_arm(rod=True)))
    rings = {(int(one.get("cx")), int(one.get("cy"))) for one in picture.iter("circle") if "stroke-good" in one.get("class")}
    assert rings == set(JOINTS.values())
    assert "nothing to blame" in picture.get("aria-label")


def test_a_link_is_marked_between_its_ends() -> None:
    """The lower arm between joints 2 and 3, the forearm between joints 3 and 5; the links of an arm at its lower arm."""
    for joint, (one, other) in {2: (JOINTS[2], JOINTS[3]), 3: (JOINTS[3], JOINTS[5])}.items():
        [(_, (x, y))] = places([cause("link_bending", joint)])
        assert abs(x - (one[0] + other[0]) / 2) < 40
        assert abs(y - (one[1] + other[1]) / 2) < 20
