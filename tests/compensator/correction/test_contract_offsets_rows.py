"""The rows of offsets.csv and deviation.csv, number by number: which targets have which, in which unit, to how many digits."""

from __future__ import annotations

import csv
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import offsets
from compensator.correction.offsets import deviation_csv, offsets_csv

RNG = np.random.default_rng(12)
COUNT = 8
POSITION, AT_REST, STD = RNG.normal(size=(COUNT, 3)), 1e-4 * RNG.normal(size=(3, 3)), 1e-6 * RNG.uniform(1, 9, (3, 3))
TIME = RNG.uniform(0.1, 2.0, COUNT)
OFFSET, TURN = 1e-3 * RNG.normal(size=(4, 3)), 1e-3 * RNG.normal(size=(4, 3))
LEFT, CUT = 1e-6 * RNG.uniform(1, 90, (2, 4))
# Given: air; two with force; one with force that is computed at run time; one of a cut without a sample; one with force; one
# at which the log stood still; one with force by MoveAbsJ.
FORCED, SAMPLES = np.array([0, 1, 1, 1, 0, 1, 0, 1]) > 0, np.array([3, 4, 5, 6, 0, 7, 0, 9])
NOTES = ["no force", "", "backlash of joint 1 crosses its gap before this target", "left: computed at run time", "no sample",
         "", "the log stood still", "left: MoveAbsJ"]
UNKNOWN = {3, 4, 6, 7}
PLANNED = np.array([1, 2, 5])
# In the written program two targets stand between the second and the third, at 3 and 7 of 8 mm.
KEPT = np.array([0, 1, 4, 5, 6, 7, 8, 9])
LENGTH = 1e-3 * np.array([0, 10, 13, 17, 18, 30, 40, 50, 60, 70.0])


def job(*, silent: bool = False) -> Any:
    """silent: the third target with force, one of the program's own, shows none beside those that were added."""
    block = np.full(COUNT, "", dtype=object)
    block[3] = "computed at run time"
    toolpath = type("Targets", (SimpleNamespace,), {"__len__": lambda self: COUNT})(
        line=np.arange(COUNT) + 11, position=POSITION, block=block, feed=np.full(COUNT, 0.02),
        by_joints=np.full(COUNT, False))
    forces = SimpleNamespace(forced=FORCED, samples=SAMPLES, held=np.arange(COUNT) == 6)
    prediction = SimpleNamespace(at_rest=AT_REST, at_rest_std=STD, notes=np.array(["", NOTES[2], ""], dtype=object))
    planned = SimpleNamespace(path=SimpleNamespace(toolpath=toolpath, move_time=TIME), targets=PLANNED, forces=forces,
                              prediction=prediction)
    made = np.array([1, 2, 4, 7]) if not silent else np.array([1, 2, 3, 4])
    return SimpleNamespace(planned=planned, kept=KEPT, correction=SimpleNamespace(targets=made, offset=OFFSET, turn=TURN),
                           left=SimpleNamespace(std=LEFT, cut=CUT),
                           predicted=SimpleNamespace(path=SimpleNamespace(toolpath=range(10), length=LENGTH)))


def rows_of(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(content.decode().splitlines()))


def numbers(row: dict[str, str], names: str) -> list[float | None]:
    return [float(row[name]) if row[name] else None for name in names.split()]


def rounded(values: np.ndarray, decimals: int) -> list[float]:
    return [round(float(value), decimals) for value in values]


def check_predicted(rows: list[dict[str, str]]) -> None:
    """What both files have."""
    assert [int(row["target"]) for row in rows] == list(range(COUNT))
    assert [int(row["line"]) for row in rows] == list(range(11, 11 + COUNT))
    assert [int(row["samples"]) for row in rows] == SAMPLES.tolist()
    for k, row in enumerate(rows):
        assert numbers(row, "x_mm y_mm z_mm") == rounded(1e3 * POSITION[k], 6)
        assert numbers(row, "time_s") == rounded(TIME[:k + 1].sum(keepdims=True), 6)
        for names, values in (("dx_um dy_um dz_um", AT_REST), ("sx_um sy_um sz_um", STD)):
            at = np.flatnonzero(k == PLANNED)
            expected = [None] * 3 if k in UNKNOWN else rounded(1e6 * values[at[0]], 4) if len(at) else [0.0] * 3
            assert numbers(row, names) == expected, (k, names)


@pytest.mark.parametrize("chunk", [8192, 3])
def test_a_predicted_deviation_has_a_row_a_target(monkeypatch: pytest.MonkeyPatch, chunk: int) -> None:
    """However many rows are written at a time."""
    monkeypatch.setattr(offsets, "CHUNK", chunk)
    content = deviation_csv(job().planned)
    assert content.splitlines()[0].decode() == (
        "target,line,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um,time_s,samples,note")
    rows = rows_of(content)
    check_predicted(rows)
    assert [row["note"] for row in rows] == NOTES


@pytest.mark.parametrize("chunk", [8192, 3])
def test_offsets_are_those_of_the_targets_as_given_and_what_was_added_stands_beside_them(
    monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(offsets, "CHUNK", chunk)
    content = offsets_csv(job())
    assert content.splitlines()[0].decode() == (
        "target,line,x_mm,y_mm,z_mm,ox_mm,oy_mm,oz_mm,orx_deg,ory_deg,orz_deg,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um,time_s,"
        "samples,note,left_um,cut_um,added,added_mm,added_left_um")
    rows = rows_of(content)
    check_predicted(rows)
    assert [row["note"] for row in rows] == NOTES
    own = {1: 0, 2: 2, 5: 3}
    for k, row in enumerate(rows):
        offset, turn = (values[own[k]] if k in own else np.zeros(3) for values in (OFFSET, TURN))
        assert numbers(row, "ox_mm oy_mm oz_mm") == rounded(1e3 * offset, 6)
        assert numbers(row, "orx_deg ory_deg orz_deg") == rounded(np.degrees(turn), 8)
        left = [1e6 * LEFT[own[k]], 1e6 * CUT[own[k]]] if k in own else [0.0, 0.0]
        assert numbers(row, "left_um cut_um") == ([None, None] if k in UNKNOWN else rounded(np.array(left), 4))
        if k != 2:
            assert [row[name] for name in ("added", "added_mm", "added_left_um")] == [""] * 3
    # Of the two that were added the first is corrected.
    assert rows[2]["added"] == "0.375000 0.875000"
    assert rows[2]["added_mm"] == " ".join(f"{x:.6f}" for x in [*(1e3 * OFFSET[1]), 0.0, 0.0, 0.0])
    assert rows[2]["added_left_um"] == f"{1e6 * LEFT[1]:.4f} 0.0000"


def test_a_target_that_shows_no_force_beside_those_that_were_added_says_so() -> None:
    """What is left there is not known."""
    rows = rows_of(offsets_csv(job(silent=True)))
    assert rows[5]["note"] == "no force right at it: not corrected"
    assert numbers(rows[5], "ox_mm oy_mm oz_mm left_um cut_um") == [0, 0, 0, None, None]
    assert numbers(rows[5], "dx_um") == rounded(1e6 * AT_REST[2, :1], 4)
    assert numbers(rows[2], "ox_mm oy_mm oz_mm") == rounded(1e3 * OFFSET[3], 6)
    assert [row["note"] for row in rows[:5]] == NOTES[:5]
