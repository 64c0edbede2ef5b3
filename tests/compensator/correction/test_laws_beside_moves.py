"""What logged positions beside the path say of the pass, on paths and logs that are made here: each limit, each number."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compensator.correction.as_driven import _another_version, _left_of, said_of_positions
from compensator.toolpath import Move
from identification.common.findings import Finding
from identification.model.rotations import Frame

TURN = Rotation.from_rotvec([0.3, -0.2, 1.1])


def told(target: int, code: str, level: Any, message: str, hint: str = "") -> Finding:
    return Finding(code, level, message, target=target, hint=hint)


def job(length_mm: list[float], place_mm: np.ndarray, beside_mm: np.ndarray, **more: Any) -> Any:
    """A path along base x, whose base stands turned in the world, and samples beside it (n, 3), base frame, all targets with
    force; more: deflection_mm (N, 3), zone_mm, move, targets, findings."""
    count = len(length_mm)
    length = 1e-3 * np.array(length_mm)
    toolpath = type("Targets", (SimpleNamespace,), {"__len__": lambda self: count})(
        driven=None, ways=(), zone=np.full(count, 1e-3 * more.get("zone_mm", 0.0)), line=100 + np.arange(count),
        move=np.full(count, more.get("move", Move.LINEAR)))
    path = SimpleNamespace(
        toolpath=toolpath, length=length, base_from_tcp=SimpleNamespace(position=np.outer(length, [1.0, 0, 0])),
        axes=SimpleNamespace(driven=False, world_from_base=Frame(TURN.as_matrix(), np.zeros(3))), finding=told)
    targets = np.array(more.get("targets", range(count)))
    deflection = 1e-3 * np.array(more.get("deflection_mm", np.zeros((count, 3))))[targets]
    log = SimpleNamespace(place=1e-3 * place_mm, beside=1e-3 * TURN.apply(beside_mm), source="log.csv")
    return SimpleNamespace(path=path, targets=targets, prediction=SimpleNamespace(position=deflection),
                           forces=SimpleNamespace(log=log), findings=more.get("findings", ()))


def test_what_a_corrected_pass_stands_off_is_taken_off_up_to_half_as_much_again() -> None:
    """The deflection at either end or their mean, of either sign, by trying; a quarter of it is the lag of zones."""
    rng = np.random.default_rng(3)
    times = np.linspace(-1.5, 1.5, 30_001)[:, None]
    for _ in range(30):
        aside, yields = rng.normal(size=3), rng.normal(size=(2, 3)) * rng.uniform(0, 1)
        left = min(np.linalg.norm(aside - times * one, axis=1).min() - 0.25 * np.linalg.norm(one)
                   for one in (*yields, yields.mean(axis=0)))
        assert _left_of(aside, yields) == pytest.approx(left, abs=1e-6)


def middle_of(first_mm: float, last_mm: float, aside_mm: float, step_mm: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Samples over 60 mm, those of this stretch aside along y, all others far away, all of them late along x."""
    place = np.arange(0.25, 60, step_mm)
    inside = (place > first_mm) & (place < last_mm)
    return place, np.column_stack([np.full(len(place), -7.0), np.where(inside, aside_mm, 30.0), 0 * place])


@pytest.mark.parametrize(("aside", "changed", "said"), [
    (1.01, {}, True), (0.99, {}, False),                                                            # a millimetre
    (1.01, {"zone_mm": 5.9}, True), (1.01, {"zone_mm": 6.1}, False),                                # a fifth of the move
    (1.3, {"deflection_mm": [[0, 0, 0], [0, 0.2, 0], [0, 0, 0]]}, False),                           # 1.3 - 1.75 of 0.2
    (1.4, {"deflection_mm": [[0, 0, 0], [0, 0.2, 0], [0, 0, 0]]}, True),
    (-1.4, {"deflection_mm": [[0, 0, 0], [0, 0.2, 0], [0, 0, 0]]}, True),
    (1.01, {"targets": [0, 2]}, False), (1.01, {"move": Move.JOINT}, False)])
def test_a_long_move_beside_which_the_middle_of_its_samples_lies_is_told(
    aside: float, changed: dict[str, Any], said: bool
) -> None:
    """The second move of two, of 30 mm: on three fifths of it."""
    place, beside = middle_of(36, 54, aside)
    found = said_of_positions(job([0, 30, 60], place, np.where(place[:, None] < 30, 0.0, beside), **changed), None)
    assert [(one.code, one.level, one.target, one.message) for one in found] == ([(
        "CS3120", "warning", 2, f"the samples of 1 long move lie beside the path, here most, by {abs(aside):.2g} mm (+0.00, "
        f"{aside:+.2f}, +0.00 mm, base frame)")] if said else [])


@pytest.mark.parametrize(("length_mm", "move", "said"), [
    (20.1, Move.LINEAR, True), (19.9, Move.LINEAR, False), (10.1, Move.ARC_VIA, True), (10.1, Move.ARC_END, True),
    (9.9, Move.ARC_END, False)])
def test_a_line_of_two_centimetres_and_half_an_arc_of_one_are_long(length_mm: float, move: Move, said: bool) -> None:
    place = np.arange(0.05, length_mm, 0.1)
    beside = np.tile([0.0, 0, -2], (len(place), 1))
    assert bool(said_of_positions(job([0, length_mm], place, beside, move=move), None)) == said


@pytest.mark.parametrize(("samples", "said"), [(20, True), (19, False)])
def test_twenty_samples_tell_of_a_move_and_the_worst_of_several_is_named(samples: int, said: bool) -> None:
    """From the middle of the first, with as many of the second; some of the log have no place, or come in another order."""
    place = np.concatenate([np.linspace(6.1, 23.9, samples), np.linspace(36.1, 53.9, 30), [np.nan, 1.0]])
    beside = np.column_stack([0 * place, np.where(place < 30, 3.0, 2.0), 0 * place])
    order = np.random.default_rng(2).permutation(len(place))
    [found] = said_of_positions(job([0, 30, 60], place[order], beside[order]), None)
    assert (found.target, found.message.partition(" lie ")[0]) == ((1, "the samples of 2 long moves") if said else
                                                                   (2, "the samples of 1 long move"))


def row(count: int, off_um: float, **more: Any) -> Any:
    """Targets a millimetre apart with a sample each, that stand off by so many times a deflection of 50 um, or so many um."""
    way = np.where(np.arange(count) % 2, 1.0, -1.0)
    deflection = np.column_stack([np.full(count, 0.3), 0.03 * way, 0.04 * way]) * more.get("size", 1.0)
    beside = np.column_stack([np.full(count, 0.2), *(deflection[:, 1:] * off_um).T])
    beside[:, 1:] += more.get("else_mm", 0.0) * np.column_stack([0.8 * way, -0.6 * way])
    return job(list(range(count)), np.arange(count, dtype=float), beside, deflection_mm=deflection)


@pytest.mark.parametrize(("count", "times", "more", "words"), [
    (12, -0.72, {}, "against the deflection"), (12, -0.69, {}, ""), (12, -1.38, {}, "against the deflection"),
    (12, -1.41, {}, ""), (12, 0.72, {}, "by the deflection itself"), (12, 1.41, {}, ""), (11, -1.0, {}, ""),
    (20, -1.0, {"size": 0.62}, "against the deflection"), (20, -1.0, {"size": 0.59}, ""),           # 30 um
    (20, -1.0, {"else_mm": 0.049}, "against the deflection"), (20, -1.0, {"else_mm": 0.051}, "")])  # half of the square
def test_positions_that_stand_off_as_a_corrected_pass_does_are_told(
    count: int, times: float, more: dict[str, float], words: str
) -> None:
    """What lies along the path does not count."""
    found = said_of_positions(row(count, times, **more), None)
    size = 1e3 * np.hypot(0.05 * more.get("size", 1.0) * times, more.get("else_mm", 0.0))
    assert [(one.code, one.level, one.file) for one in found] == ([("CS3075", "warning", "log.csv")] if words else [])
    for one in found:
        assert one.message.startswith(f"the positions in the log stand {size:.0f} um RMS off the path, {words}")


@pytest.mark.parametrize(("share", "size", "said"), [(0.28, 1.0, True), (0.31, 1.0, False), (-1.0, 1.0, True),
                                                     (0.0, 0.62, True), (0.0, 0.58, False)])
def test_positions_that_do_not_show_the_offsets_of_the_pass_are_told(share: float, size: float, said: bool) -> None:
    """Three tenths of them, and of 30 um and more."""
    planned = row(20, share, size=size)
    offsets = planned.prediction.position.copy()
    found = said_of_positions(planned, offsets)
    assert [(one.code, one.message) for one in found] == ([(
        "CS3076", f"the positions in the log stand {50 * size * abs(share):.0f} um RMS off the planned path, and not as the "
        f"offsets of --logged-with do ({50 * size:.0f} um)")] if said else [])


@pytest.mark.parametrize(("count", "off_mm", "said"), [(40, 0.151, True), (40, 0.149, False), (39, 1.0, False)])
def test_a_pass_that_stands_off_by_the_same_everywhere_is_told(count: int, off_mm: float, said: bool) -> None:
    """In the middle: every third elsewhere, to and fro, changes nothing."""
    off = np.tile([0.0, 0.6e-3 * off_mm, -0.8e-3 * off_mm], (count, 1))
    off[::6], off[3::6] = 0.05, -0.05
    found = _another_version(off, np.arange(count), job(list(range(count)), np.zeros(1), np.zeros((1, 3))))
    assert [(one.code, one.message) for one in found] == ([(
        "CS3120", f"the samples lie beside the path, by {off_mm:.2g} mm in the middle of the cuts (+0.00, {0.6 * off_mm:+.2f}, "
        f"{-0.8 * off_mm:+.2f} mm, base frame)")] if said else [])


@pytest.mark.parametrize(("aside", "off_mm", "said"), [(10, 0.26, True), (9, 0.26, False), (10, 0.24, False)])
def test_a_stretch_that_stands_off_by_the_same_is_told_from_an_eighth_of_the_targets_on(
    aside: int, off_mm: float, said: bool
) -> None:
    """Of 200: as many in a row, from the 50th on, and the seven on either side that share a middle of fifteen with most of
    them: 24 and 23."""
    off = np.zeros((200, 3))
    off[50:50 + aside] = 1e-3 * off_mm * np.array([0.6, 0, 0.8])
    found = _another_version(off, np.arange(0, 400, 2), job(list(range(400)), np.zeros(1), np.zeros((1, 3))))
    assert [(one.code, one.message) for one in found] == ([(
        "CS3120", f"the samples of 24 of 200 targets, from line {100 + 2 * 43} to {100 + 2 * 66}, lie beside the path by up to "
        f"{off_mm:.2g} mm ({0.6 * off_mm:+.2f}, +0.00, {0.8 * off_mm:+.2f} mm, base frame)")] if said else [])


def test_of_a_stretch_the_place_is_told_that_is_the_farthest_off() -> None:
    off = np.zeros((200, 3))
    off[50:75, 1], off[60:72, 1] = 0.26e-3, -0.5e-3
    [found] = _another_version(off, np.arange(200), job(list(range(200)), np.zeros(1), np.zeros((1, 3))))
    assert found.message.endswith("lie beside the path by up to 0.5 mm (+0.00, -0.50, +0.00 mm, base frame)")
