"""What of an STL is refused, by which code, and that the message says what to do; a blank that is whole is taken."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.cut import _check_near
from compensator.cutting.solid import read_solid
from compensator.cutting.stock_file import read_stock
from identification.common.findings import CompstiffError
from tests.compensator.cutting.milled import FLAT, track_along
from tests.compensator.cutting.solids import ascii_stl, binary, box_faces, stock_of

FACES = box_faces((-60.0, -40.0, -20.0), (60.0, 40.0, 0.0))
TURNED = np.concatenate([FACES[:2, ::-1], FACES[2:]])
WITHIN = box_faces((-10.0, -10.0, -15.0), (10.0, 10.0, -5.0))


def refused(folder: Path, content: bytes, more: str = "units: mm\n") -> tuple[str, str]:
    with pytest.raises(CompstiffError) as stopped:
        read_stock(stock_of(folder, content, more)).stock(np.array([-4e-3, -10e-3]), 0.0)
    return stopped.value.findings[0].code, str(stopped.value)


@pytest.mark.parametrize(("content", "code", "words"), [
    (b"", "CS4712", "no triangles"), (b"solid x\nendsolid x\n", "CS4712", "no triangles"),
    (b"no STL at all", "CS4712", "no triangles"), (binary(FACES)[:400], "CS4712", "no triangles"),
    (binary(np.where(FACES == 60.0, np.nan, FACES)), "CS4712", "no numbers"),
    (ascii_stl(FACES)[:900], "CS471", ""), (ascii_stl(FACES).replace(b"60", b"six"), "CS4712", "is no STL: "),
    (binary(FACES[:-1]), "CS4713", "not watertight"), (binary(np.concatenate([FACES, FACES[:1]])), "CS4713", "not watertight"),
    (binary(TURNED), "CS4713", "face against"), (binary(FACES[:, ::-1]), "CS4713", "inside out"),
    (binary(np.concatenate([FACES, WITHIN])), "CS4713", "overlap"),
    (binary(FACES / 1e3), "CS4714", "metres"), (binary(FACES * 1e3), "CS4714", "at most")],
    ids=["nothing", "no facet", "text", "cut short", "nan", "half a text", "no numbers", "a face is gone", "a face twice",
         "one face turned", "inside out", "two bodies", "metres", "micrometres"])
def test_what_is_no_blank_is_refused(tmp_path: Path, content: bytes, code: str, words: str) -> None:
    found, message = refused(tmp_path, content)
    assert found.startswith(code)
    assert words in message
    assert "blank.stl" in message


@pytest.mark.parametrize("more", ["", "units: cm\n", "units: mm\nbox: {from_mm: [0, 0, -5], to_mm: [5, 5, 0]}\n"])
def test_units_are_stated_and_the_blank_is_one(tmp_path: Path, more: str) -> None:
    assert refused(tmp_path, binary(FACES), more)[0] == "CS0102"


@pytest.mark.parametrize(("size_mm", "said"), [
    ((9990, 40, 20), ""), ((40, 10010, 20), "40 x 1.001e+04 x 20 mm, expected at most 10000"), ((0.51, 40, 20), ""),
    ((120, 80, 0.49), "120 x 80 x 0.49 mm, expected at least 0.5 each way")])
def test_a_blank_is_of_a_size_that_a_robot_mills(tmp_path: Path, size_mm: tuple[float, float, float], said: str) -> None:
    file = tmp_path / "a.stl"
    file.write_bytes(binary(box_faces((0.0, 0.0, 0.0), size_mm)))
    if not said:
        assert 1e3 * np.ptp(read_solid(file, 1e-3).bounds, axis=0) == pytest.approx(size_mm, rel=1e-5)
        return
    with pytest.raises(CompstiffError) as stopped:
        read_solid(file, 1e-3)
    [found] = stopped.value.findings
    assert (found.code, found.level, found.file, found.message) == ("CS4714", "error", str(file), f"the blank is {said}")


def test_units_without_an_stl_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "stock.yaml"
    file.write_text("box: {from_mm: [0, 0, -5], to_mm: [5, 5, 0]}\nunits: mm\n")
    with pytest.raises(CompstiffError, match="CS0102"):
        read_stock(file)


def test_a_gone_stl_is_named(tmp_path: Path) -> None:
    (tmp_path / "stock.yaml").write_text("stl: gone.stl\nunits: mm\n")
    with pytest.raises(CompstiffError, match=r"gone\.stl.*CS0005|CS0005.*gone\.stl"):
        read_stock(tmp_path / "stock.yaml")


def test_a_void_is_a_void(tmp_path: Path) -> None:
    """A body within that is turned inside out is a hollow."""
    blank = read_stock(stock_of(tmp_path, binary(np.concatenate([FACES, WITHIN[:, ::-1]]))))
    stock = blank.stock(np.array([-4e-3, -19e-3]), 0.0)
    assert 1e9 * stock.volume == pytest.approx(120 * 80 * 20 - 20 * 20 * 10, rel=1e-3)


def test_flat_faces_are_levels_and_upright_walls_need_no_layers(tmp_path: Path) -> None:
    """A step at -7 mm is a level; nothing else is."""
    step = box_faces((-60.0, -40.0, -20.0), (60.0, 40.0, -7.0))
    tower = box_faces((-20.0, -20.0, -7.0 + 1e-3), (20.0, 20.0, 0.0))
    stock = read_stock(stock_of(tmp_path, binary(np.concatenate([step, tower])))).stock(np.array([-4e-3]), 0.0)
    assert 1e3 * stock.height == pytest.approx([-20, -7, -7 + 1e-3, -4, 0], abs=3e-3) or 1e3 * stock.height == pytest.approx(
        [-20, -7, -4, 0], abs=3e-3)


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize(("moved_mm", "away"), [
    ((0, 0, 0), False), ((127, 0, 0), False), ((129, 0, 0), True), ((-127, 0, 0), False), ((-129, 0, 0), True),
    ((0, 46, 0), False), ((0, 48, 0), True), ((0, -51, 0), False), ((0, -53, 0), True), ((0, 0, -3.9), False),
    ((0, 0, -4.1), True), ((0, 0, 30), False)])
def test_a_blank_beside_the_program_is_refused_on_every_side(
    tmp_path: Path, moved_mm: tuple[float, ...], away: bool, back: bool
) -> None:
    """A way of 120 mm in one step, from y -4 to -1, 1 to 4 mm deep, with a cutter of 16 mm: the blank reaches as far as 60 and
    40 mm, up to z 0."""
    way = np.array([[-60.0, -4.0, -1.0], [60.0, -1.0, -4.0]])
    track = track_along(way[::-1] if back else way, 0.1, 200.0)
    blank = read_stock(stock_of(tmp_path, binary(FACES + np.array(moved_mm, dtype=float))))
    with pytest.raises(CompstiffError, match="CS4715") if away else nullcontext():
        _check_near(blank, track, FLAT)


@pytest.mark.parametrize(("sides", "words"), [
    ((9900.0, 100, 50), ""), ((10_100.0, 100, 50), "the blank is 1.01e+04 x 100 x 50 mm, expected at most 10000"),
    ((100.0, 50, 0.55), ""), ((100.0, 50, 0.45), "the blank is 100 x 50 x 0.45 mm, expected at least 0.5 each way")])
def test_a_blank_has_sides_of_half_a_millimetre_to_ten_metres(tmp_path: Path, sides: tuple[float, ...], words: str) -> None:
    file = stock_of(tmp_path, binary(box_faces((0.0, 0.0, 0.0), sides)), "units: mm\nresolution_mm: 5\n")
    if not words:
        assert 1e3 * read_stock(file).bounds[1] == pytest.approx(sides, rel=1e-5)
        return
    with pytest.raises(CompstiffError, match=f"CS4714: {re.escape(words)}"):
        read_stock(file)


@pytest.mark.parametrize("corners", [(0, 0, 1), (0, 1, 1), (0, 1, 0), (0, 0, 0)])
def test_a_triangle_without_an_area_is_left_out(tmp_path: Path, corners: tuple[int, ...]) -> None:
    """Two of its corners are one, whichever: the rest is the same block."""
    needle = FACES[3][list(corners)]
    solid = read_solid(stock_of(tmp_path, binary(np.concatenate([FACES, needle[None]]))).parent / "blank.stl", 1e-3)
    assert len(solid.corner) == len(FACES)
    assert 1e3 * solid.bounds == pytest.approx(np.array([[-60, -40, -20], [60, 40, 0]]))
