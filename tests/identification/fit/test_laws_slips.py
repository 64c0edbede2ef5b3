"""Slips that are tried at a visit: each of them, made on purpose, is among those that undo it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from identification.fit.slips import Slip, slips_of, slips_of_pen
from identification.measurements import Measurements

ANGLES = np.radians([[10.0, 20.0, 30.0, 40.0, 50.0, 60.0], [11.0, 22.0, 33.0, 44.0, 55.0, 66.0],
                     [12.0, 24.0, 36.0, 48.0, 60.0, 72.0]])
FORCE = np.array([[100.0, 20.0, -30.0], [200.0, 40.0, -60.0], [300.0, 60.0, -90.0]])


def slips(theta: np.ndarray, bad: frozenset[str] = frozenset(), readings: np.ndarray | None = None,
          expected: np.ndarray | None = None) -> list[Slip]:
    """Three visits of three rows, the first of them tried; its readings, and those that are expected of it."""
    visit = np.repeat(np.arange(3), 3)
    rows = SimpleNamespace(
        theta=theta, wrench=np.hstack([np.tile(FORCE, (3, 1)), np.zeros((9, 3))]), visit=visit,
        deflection=np.vstack([np.zeros((3, 3)) if readings is None else readings, np.zeros((6, 3))]),
        pose=np.array([f"P{number}" for number in visit], dtype=object), line=np.arange(2, 11), row=np.arange(1, 10))
    return list(slips_of(cast(Measurements, rows), visit == 0, bad, np.zeros((3, 3)) if expected is None else expected))


def test_a_load_with_the_wrong_sign_is_turned_and_nothing_else() -> None:
    tried = [slip.force for slip in slips(np.repeat(ANGLES, 3, axis=0)) if slip.kind == "sign of a load"]
    signs = [force / FORCE for force in tried if force is not None]
    meant = [-np.ones((3, 3)), *(np.where(np.arange(3) == axis, -1.0, 1.0) * np.ones((3, 3)) for axis in range(3)),
             *(np.where(np.arange(3) == row, -1.0, 1.0)[:, None] * np.ones((3, 3)) for row in range(3))]
    assert len(signs) == len(meant) == len(tried)
    assert all(any(np.allclose(one, other) for other in signs) for one in meant)


def test_what_is_of_the_pose_is_not_of_rows() -> None:
    """A visit is given another pose for the one, its rows other loads or readings for the other."""
    of_rows = {slip.kind for slip in slips(np.repeat(ANGLES, 3, axis=0)) if slip.in_rows}
    of_pose = {slip.kind for slip in slips(np.repeat(ANGLES, 3, axis=0)) if not slip.in_rows}
    assert of_rows == {"sign of a load", "size of the loads", "readings slipped", "readings exchanged"}
    assert "columns exchanged" in of_pose
    assert not of_rows & of_pose


def test_the_angles_of_another_visit_are_those_of_one_that_stood_still() -> None:
    """One that moved an axis between its rows has no pose that could have been written for another."""
    theta = np.repeat(ANGLES, 3, axis=0)
    theta[7, 4] += 1e-3
    from_others = [slip.theta for slip in slips(theta) if "the angles of" in slip.what]
    assert len(from_others) == 1
    np.testing.assert_array_equal(from_others[0], ANGLES[1])


def test_readings_that_stand_a_row_off_or_were_exchanged_are_those_of_the_loads_they_were_taken_under() -> None:
    """In lines 2, 3 and 4, under loads a, b and c: what stands where another load's reading should."""
    tried = [slip for slip in slips(np.repeat(ANGLES, 3, axis=0)) if slip.kind.startswith("readings")]
    wanted = [("slipped", "its readings a row too high from line 2 on", "bcc"),
              ("slipped", "its readings a row too low from line 3 on", "aab"),
              ("exchanged", "the readings of lines 2 and 3 exchanged", "bac"),
              ("exchanged", "the readings of lines 2 and 4 exchanged", "cba"),
              ("slipped", "its readings a row too high from line 3 on", "acc"),
              ("slipped", "its readings a row too low from line 4 on", "abb"),
              ("exchanged", "the readings of lines 3 and 4 exchanged", "acb")]
    assert [(slip.kind, slip.what) for slip in tried] == [
        (f"readings {kind}", f"{words}: put back they would fit") for kind, words, _ in wanted]
    for slip, (_, _, loads) in zip(tried, wanted, strict=True):
        np.testing.assert_array_equal(slip.force, FORCE[["abc".index(load) for load in loads]])
        np.testing.assert_array_equal(slip.theta, ANGLES[0])


def test_turns_that_were_not_counted_are_as_many_as_bring_the_readings_nearest() -> None:
    """430 um were expected along y, and 30 read; of a dial of 500 um one turn is nearer than none, of one of a millimetre none.
    What was not read has no turns."""
    readings, expected = np.full((3, 3), 3e-5), np.full((3, 3), 3e-5)
    expected[:, 1], readings[2, 1] = 4.3e-4, np.nan
    tried = [slip for slip in slips(np.repeat(ANGLES, 3, axis=0), readings=readings, expected=expected)
             if slip.kind == "whole turns"]
    assert [slip.what for slip in tried] == [
        f"dy with the whole turns of {turn} um that were not counted would fit" for turn in (100, 200, 500)]
    for slip, whole in zip(tried, (4.3e-4, 4.3e-4, 5.3e-4), strict=True):
        wanted = readings.copy()
        wanted[:2, 1] = whole
        np.testing.assert_allclose(slip.readings, wanted)


def test_columns_of_angles_and_visits_are_exchanged_in_words() -> None:
    """Each two axes; the angles of a visit that is bad itself were exchanged, those of a right one copied."""
    tried = slips(np.repeat(ANGLES, 3, axis=0), frozenset({"P0", "P2"}))
    columns = [slip for slip in tried if slip.kind == "columns exchanged"]
    assert [slip.what for slip in columns] == [
        f"axes {j} and {i} are {10 * j} and {10 * i} in the table; exchanged they would fit"
        for i in range(1, 7) for j in range(1, i)]
    for slip, (one, other) in zip(columns, [(i, j) for i in range(6) for j in range(i)], strict=True):
        assert slip.theta[[one, other]].tolist() == ANGLES[0][[other, one]].tolist()
        assert np.delete(slip.theta, [one, other]).tolist() == np.delete(ANGLES[0], [one, other]).tolist()
    assert [(slip.kind, slip.what) for slip in tried if "the angles of" in slip.what] == [
        ("another visit's angles", "the angles of P1 would fit: is it that pose?"),
        ("visits exchanged", "the angles of P2 would fit: were the two exchanged?")]
    (sign,) = [slip for slip in tried if slip.kind == "sign" and slip.what.startswith("axis 3 ")]
    assert sign.what == "axis 3 is 30 in the table; -30 would fit"
    assert sign.theta.tolist() == pytest.approx([*ANGLES[0][:2], -ANGLES[0][2], *ANGLES[0][3:]])


@pytest.mark.parametrize(("text", "wanted"), [
    ("-7", {"sign": "7", "digit": "-0 -1 -2 -3 -4 -5 -6 -8 -9", "digit lost": "-17 -27 -37 -47 -57 -67 -77 -87 -97 "
            "-70 -71 -72 -73 -74 -75 -76 -78 -79", "decimal point": "-0.7"}),
    ("12.5", {"sign": "-12.5", "digits exchanged": "21.5 15.2",
              "digit": "2.5 22.5 32.5 42.5 52.5 62.5 72.5 82.5 92.5 10.5 11.5 13.5 14.5 15.5 16.5 17.5 18.5 19.5 "
                       "12 12.1 12.2 12.3 12.4 12.6 12.7 12.8 12.9",
              "digit lost": "112.5 212.5 312.5 412.5 512.5 612.5 712.5 812.5 912.5 102.5 122.5 132.5 142.5 152.5 162.5 172.5 "
                            "182.5 192.5 120.5 121.5 123.5 124.5 125.5 126.5 127.5 128.5 129.5",
              "digit too many": "1.5", "decimal point": "125 1.25"})])
def test_every_slip_of_the_pen_is_tried_once_by_its_simplest_kind(text: str, wanted: dict[str, str]) -> None:
    """A digit is lost or one too many before the point alone; ten times 7 is a lost digit, 12.5 without its 1 another digit."""
    found: dict[str, set[float]] = {}
    tried = slips_of_pen(text)
    for kind, other in tried:
        found.setdefault(kind, set()).add(float(other))
    assert found == {kind: {float(other) for other in others.split()} for kind, others in wanted.items()}
    assert len(tried) == sum(len(others) for others in found.values())
