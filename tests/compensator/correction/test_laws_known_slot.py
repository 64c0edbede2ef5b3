"""What is known of the force in slots: by a stated depth, by the material, by two passes; on straight paths made here."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from compensator.correction.cutting_stiffness import CuttingStiffness
from compensator.correction.known_slot import known_slot, slot_of_passes
from compensator.correction.unloaded_robot import beside_a_rigid_motion, by_unloaded_robot
from identification.model.cell_file import CuttingFile
from tests.compensator.correction.test_laws_following import planned

SLOT, CLIMB = np.radians(115.0), np.radians(60.0)


def slotting(count: int, angle: float = SLOT, rise_um: float = 30.0, push: float = 100.0, **chosen: Any) -> Any:
    """A log whose first four targets are lighter, as where the tool enters; feed and speed as they are asked for."""
    size = np.where(np.arange(count) < 4, 0.5, 1.0) * push / np.sin(angle)
    force = np.column_stack([size * np.cos(angle), size * np.sin(angle), 0 * size])
    material, feed, rpm = chosen.pop("material", None), chosen.pop("feed", 0.02), chosen.pop("rpm", None)
    of_cell = chosen.pop("of_cell", None)
    job = planned(force.tolist(), list(range(count)), [[0, 20, rise_um]] * count, **chosen)
    job.path.toolpath.feed = np.full(count, feed)
    job.settings = SimpleNamespace(correction=job.settings.correction, log=SimpleNamespace(spindle_rpm=rpm))
    job.cell = SimpleNamespace(cutting=CuttingFile(material=material), force_log=SimpleNamespace(
        form=SimpleNamespace(spindle_rpm=of_cell)))
    return job


@pytest.mark.parametrize("aside_um", [0.0, 400.0])
def test_a_stated_depth_tells_what_a_slot_pushes_by_the_metre(aside_um: float) -> None:
    """The tool stood 30 um above it, and by its offsets so much more: of full slots the middle, known to 15 %."""
    job = slotting(20, slot_depth=2e-3)
    offsets = np.tile([0, 0, 1e-6 * aside_um], (20, 1)) if aside_um else None
    found, [said] = known_slot(job, offsets, CuttingStiffness(2e4, 1e3, "stated"))
    law = stats.lognorm(0.15, scale=100 / (2e-3 - 30e-6 - 1e-6 * aside_um))
    assert found is not None
    assert (found.value, found.std, found.mean_std) == pytest.approx((law.mean(), law.std(), law.std()), rel=1e-6)
    assert found.origin == "depth"
    assert (said.code, said.level, said.file) == ("CS3243", "note", "p.mod")
    assert said.message == f"in slots, by a depth of 2 mm: {found.words()} along the tool's axis"


@pytest.mark.parametrize("count", [9, 20])
def test_a_depth_of_slots_that_are_none_is_told(count: int) -> None:
    """Climb milling, and a slot in which no target has three others of it on either side."""
    job = slotting(9, slot_depth=2e-3) if count == 9 else slotting(20, CLIMB, slot_depth=2e-3)
    found, said = known_slot(job, None, None)
    assert found is None
    assert [one.message for one in said] == ["--slot-depth is stated, and by the direction of its force nothing is a slot"]


@pytest.mark.parametrize(("told", "wall", "known"), [
    ({"rpm": 6000.0}, None, True), ({"of_cell": 6000.0}, None, True), ({"rpm": 6000.0, "of_cell": 100.0}, None, True),
    ({}, None, False), ({"rpm": 6000.0, "material": None}, None, False), ({"rpm": 6000.0, "feed": np.nan}, None, False),
    ({"rpm": 6000.0}, CuttingStiffness(2e4, 1e3, "passes", climb_only=True), True),
    ({"rpm": 6000.0}, CuttingStiffness(2e4, 1e3, "stated"), False)])
def test_a_material_tells_it_with_feed_and_speed(told: dict[str, Any], wall: CuttingStiffness | None, known: bool) -> None:
    """A quarter of k_c f, the feed 0.2 mm a turn; unless a K is stated for all places, slots among them."""
    found, said = known_slot(slotting(20, **{"material": "steel"} | told), None, wall)
    if not known:
        assert (found, said) == (None, ())
        return
    middle = 1e3 * 0.25 * 1740 * (2 * 0.2 / (3 * np.pi)) ** -0.23 * 0.2
    assert found is not None
    assert found.value == pytest.approx(stats.lognorm(0.4, scale=middle).mean(), rel=1e-6)
    assert (found.origin, len(said)) == ("material", 1)
    assert said[0].message == f"in slots, by steel: {found.words()} along the tool's axis"


def test_no_material_is_asked_where_there_is_no_slot() -> None:
    assert known_slot(slotting(20, CLIMB, material="steel", rpm=6000.0), None, None) == (None, ())


@pytest.mark.parametrize(("count", "counts"), [(50, True), (49, False)])
@pytest.mark.parametrize("wall", [None, CuttingStiffness(2e4, 1e3, "passes"), CuttingStiffness(2e4, 0.0, "stated")])
def test_forty_targets_in_full_slots_tell_it_by_two_passes(count: int, counts: bool, wall: CuttingStiffness | None) -> None:
    """Four at the entry, and three more at either end, are none. The second pass stood 60 um deeper and met 9 N more: 150 N/mm,
    against a slot of 2 mm in 100 N, known to a factor; not where a K is stated as exact."""
    first, second = slotting(count, rise_um=30.0), slotting(count, rise_um=50.0, push=109.0)
    found, said = slot_of_passes(first, second, np.tile([0, 0, -80e-6], (count, 1)), wall)
    if not counts or (wall is not None and not wall.std):
        assert (found, said) == (None, ())
        return
    size, total = 40 * 60e-6**2, 40 * 60e-6
    of_zero = (2 * total / size) ** 2
    prior = stats.lognorm(0.8, scale=100 / (2e-3 - 30e-6))
    known = 1 / of_zero + 1 / prior.var()
    assert found is not None
    assert found.value == pytest.approx((150e3 / of_zero + prior.mean() / prior.var()) / known, rel=1e-6)
    assert (found.std, found.mean_std) == pytest.approx((known**-0.5, known**-0.5), rel=1e-6)
    assert (found.origin, found.pairs) == ("passes", 1)
    assert [one.message for one in said] == [f"in slots, from two passes: {found.words()} along the tool's axis"]


@pytest.mark.parametrize(("stated", "learned", "probed", "repeats", "counts"), [
    (True, False, False, "nothing", True), (True, False, True, "nothing", True), (True, True, False, "nothing", True),
    (True, True, True, "nothing", False), (True, True, False, "setup", False), (True, True, False, "job", False),
    (True, False, False, "setup", True), (False, False, False, "nothing", False)])
def test_the_unloaded_robot_is_off_as_stated_but_where_a_part_showed_it(
    stated: bool, learned: bool, probed: bool, repeats: str, counts: bool
) -> None:
    """300 um in all are 300 / sqrt(3) a component; another set-up that was not probed has it still."""
    accuracy = SimpleNamespace(position_um=300.0, length_mm=None, probed_by_robot=probed) if stated else None
    job: Any = SimpleNamespace(
        cell=SimpleNamespace(accuracy=accuracy), targets=np.arange(2),
        loaded=SimpleNamespace(learned=object() if learned else None),
        settings=SimpleNamespace(correction=SimpleNamespace(repeats=repeats)))
    found = by_unloaded_robot(job)
    assert (found is not None) == counts
    if found is not None:
        np.testing.assert_allclose(found, np.tile(3e-8 * np.eye(3), (2, 1, 1)))
    job.targets = np.arange(0)
    assert by_unloaded_robot(job) is None


def test_what_a_rigid_motion_leaves_is_that_of_a_share_of_a_long_program() -> None:
    """Of over two thousand places every second, third, ... tells it, and each has what it has among these alone."""
    angle = np.linspace(0, 2 * np.pi, 6600)
    place = np.column_stack([1.2 + 0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.1 * np.sin(3 * angle)])
    theta = np.column_stack([angle / 9, 0.2 + 0.1 * np.cos(angle), 0.1 * np.sin(angle), 0 * angle, 1 + 0 * angle, 0 * angle])
    found, alone = (beside_a_rigid_motion(place[::every], theta[::every], 0.3) for every in (1, 3))
    np.testing.assert_allclose(found[::3], alone, rtol=1e-9, atol=1e-15)
    assert 0 < np.trace(found, axis1=1, axis2=2).min() <= np.trace(found, axis1=1, axis2=2).max() < 3
