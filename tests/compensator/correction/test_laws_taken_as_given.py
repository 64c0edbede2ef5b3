"""The cut that logged forces are those of, against end mills whose cut is known; forces of another cut than the stated one."""

from __future__ import annotations

import numpy as np
import pytest

from compensator.correction.taken_as_given import WITHIN, TakenAsGiven, _cut
from identification.model.cell_file import CuttingFile
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


@pytest.mark.parametrize(("area", "depth", "words"), [
    (23.8, 3e-3, ""), (24.2, 3e-3, "a cut of 24 mm2 in aluminium, within a factor of 2.5; it is stated as 6 mm2"),
    (1.52, 3e-3, ""), (1.48, 3e-3, "a cut of 1.5 mm2 in aluminium, within a factor of 2.5; it is stated as 6 mm2"),
    (79.0, None, ""), (81.0, None, "a cut of 81 mm2 in aluminium, within a factor of 2.5; it is stated as at most 32 mm2"),
    (79.0, 14e-3, ""), (81.0, 14e-3, "stated as 28 mm2"), (1e-3, None, "")])
def test_a_stated_cut_is_another_one_from_four_times_on_or_what_the_cutter_reaches(
    area: float, depth: float | None, words: str
) -> None:
    """2 mm along the axis of a cutter of 16 mm: a depth of 3 mm is 6 mm2, and all that it can take 32, which is known within
    2.5."""
    said = TakenAsGiven("", "", 1.0, 1.0, {"aluminium": area}).finding(STATED, depth, "log")
    assert [one.code for one in said] == ["CS3079"] * bool(words)
    assert all(words in one.message for one in said)
