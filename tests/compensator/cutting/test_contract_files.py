"""Stock files and cutting.json: what they may hold, what is refused, and that they come back as they were."""

from __future__ import annotations

import json
import tracemalloc
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.coefficients import Coefficients, check_same, read_coefficients
from compensator.cutting.cutter import Cutter
from compensator.cutting.materials import coefficients_of
from compensator.cutting.removal import mill_through
from compensator.cutting.stock_file import named_by, read_npz, read_stock, stock_npz
from identification.common.findings import CompstiffError
from tests.compensator.cutting.milled import FLAT, block, milled, track_along

BOX = "box: {from_mm: [0, 0, -20], to_mm: [50, 40, 0]}\n"


def code_of(file: Path) -> str:
    with pytest.raises(CompstiffError) as stopped:
        read_stock(file)
    return stopped.value.findings[0].code


def written(folder: Path, text: str) -> Path:
    file = folder / "stock.yaml"
    file.write_text(text)
    return file


def test_a_box_is_a_box(tmp_path: Path) -> None:
    blank = read_stock(written(tmp_path, BOX + "resolution_mm: 0.5\nposition_std_mm: 0.2\n"))
    stock = blank.stock(1e-3 * np.array([-5.0, -8.0]), 0.0)
    assert stock.volume == pytest.approx(50e-3 * 40e-3 * 20e-3, rel=0.01)
    assert 1e3 * stock.height == pytest.approx([-20, -8, -5, 0])
    assert (blank.cell, blank.position_std, blank.stated) == (0.5e-3, 0.2e-3, True)


def test_what_a_stock_does_not_state_is_as_documented(tmp_path: Path) -> None:
    """docs/cutting.md: points 0.2 mm apart, and a blank that stands where it is said to 0.1 mm, which nobody stated."""
    blank = read_stock(written(tmp_path, BOX))
    assert (blank.cell, blank.position_std, blank.stated) == (0.2e-3, 0.1e-3, False)
    assert blank.stock(np.array([-5e-3]), 0.0).position_std == 0.1e-3


@pytest.mark.parametrize(("text", "code"), [
    ("resolution_mm: 0.2\n", "CS0102"), (BOX + "left_by: a.npz\n", "CS0102"),
    ("box: {from_mm: [0, 0, 0], to_mm: [50, 40, 0]}\n", "CS0102"), (BOX + "resolution_mm: 0.001\n", "CS0102"),
    (BOX + "positon_std_mm: 1\n", "CS0102"), ("left_by: gone.npz\n", "CS0005"), ("box: 5\n", "CS0102"),
    ("box: {from_mm: [0, 0, -20], to_mm: [9000, 9000, 0]}\nresolution_mm: 0.02\n", "CS4704")])
def test_what_is_no_stock_is_refused(tmp_path: Path, text: str, code: str) -> None:
    assert code_of(written(tmp_path, text)) == code


@pytest.mark.parametrize(("width", "said"), [
    (524.71, ""), (524.83, "the stock would take 2.1 GB: 1 layer of 26247 x 20005 points, expected at most 2.1 GB"),
    (5247.99, "the stock would take 21 GB: 1 layer of 262405 x 20005 points, expected at most 2.1 GB")])
def test_a_stock_that_takes_too_much_memory_is_refused_with_its_file(tmp_path: Path, width: float, said: str) -> None:
    """400 mm long, at 0.02 mm, two points more at either end: 2.1e9 bytes are 26243 by 20005 numbers of four."""
    file = written(tmp_path, f"box: {{from_mm: [0, 0, -5], to_mm: [{width}, 399.99, 0]}}\nresolution_mm: 0.02\n")
    if not said:
        assert read_stock(file).cell == 0.02e-3
        return
    with pytest.raises(CompstiffError) as stopped:
        read_stock(file)
    [found] = stopped.value.findings
    assert (found.code, found.level, found.message, found.file) == ("CS4704", "error", said, str(file))


def test_a_box_takes_little_more_memory_than_its_layer_while_it_is_made(tmp_path: Path) -> None:
    """16 million points of four bytes, in any number of layers; the same numbers as of a box that is made in one piece."""
    blank = read_stock(written(tmp_path, "box: {from_mm: [0, 0, -5], to_mm: [800, 799, 0]}\nresolution_mm: 0.2\n"))
    tracemalloc.start()
    try:
        stock = blank.stock(np.array([-2e-3, -3e-3]), 0.0)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert stock.inside.shape == (3, 4000, 4005)
    assert 1 < peak / (4 * 4000 * 4005) < 1.5
    x, y = (1e3 * (stock.origin[axis] + stock.cell * np.arange(count)) for axis, count in ((0, 4005), (1, 4000)))
    for row in (0, 1, 700, 1998, 3999):
        off = np.abs(np.stack(np.broadcast_arrays(x - 400, y[row] - 399.5))) - np.array([[400], [399.5]])
        away = np.where((off <= 0).all(axis=0), off.max(axis=0), np.hypot(*np.maximum(off, 0)))
        np.testing.assert_allclose(1e3 * stock.inside[2, row], -away, atol=1e-4)


@pytest.mark.parametrize(("text", "words", "hint"), [
    ("left_by: earlier.npz\nresolution_mm: 0.2\n", "resolution_mm is stated, and a stock that was left has its own",
     "leave it out"),
    ("stl: blank.stl\n", "an STL says nothing of its units: stl and units go together", "units: mm, or units: inch"),
    (BOX + "units: mm\n", "an STL says nothing of its units: stl and units go together", "units: mm, or units: inch"),
    (BOX + "stl: blank.stl\nunits: mm\n", "names box and stl of box, stl and left_by, expected one", "left_by: what --leaves")])
def test_what_of_a_stock_does_not_go_together_is_named(tmp_path: Path, text: str, words: str, hint: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read_stock(written(tmp_path, text))
    (found,) = stopped.value.findings
    assert (found.code, found.level, found.file, found.message) == ("CS0102", "error", str(tmp_path / "stock.yaml"), words)
    assert hint in found.hint


def test_the_files_that_a_stock_stands_on_are_known(tmp_path: Path) -> None:
    """Those that it names beside itself; what a program left stands alone."""
    assert named_by(written(tmp_path, "stl: blank.stl\nunits: mm\n")) == (tmp_path / "blank.stl",)
    assert named_by(written(tmp_path, "left_by: earlier.npz\n")) == (tmp_path / "earlier.npz",)
    assert named_by(written(tmp_path, BOX)) == named_by(tmp_path / "earlier.npz") == ()


def test_what_a_program_left_comes_back(tmp_path: Path) -> None:
    stock = block((-60.0, -40.0, -20.0), (60.0, 40.0, 0.0), (-4.0,), 0.5)
    _, stock = mill_through(stock, track_along(np.array([[-80.0, 0.0, -4.0], [80.0, 0.0, -4.0]])), FLAT)
    file = tmp_path / "left.npz"
    file.write_bytes(stock_npz(replace(stock, position_std=0.3e-3)))
    back = read_npz(file)
    assert back.volume == pytest.approx(stock.volume, rel=1e-6)
    assert np.array_equal(back.inside, stock.inside) or np.allclose(back.inside, stock.inside, atol=1e-8)
    # The slot is still there for the next program, which goes deeper.
    again = read_stock(file).stock(np.array([-6e-3]), 0.0)
    _, engaged, _ = milled(again, np.array([[-80.0, 0.0, -6.0], [80.0, 0.0, -6.0]]))
    assert engaged.depth.max() == pytest.approx(2e-3, rel=1e-6)
    assert again.position_std == pytest.approx(0.3e-3)


@pytest.mark.parametrize("broken", ["text", "format", "version", "missing", "shape", "nan", "order", "cut"])
def test_a_damaged_stock_is_refused(tmp_path: Path, broken: str) -> None:
    stock = block((0.0, 0.0, -5.0), (10.0, 10.0, 0.0), ())
    file = tmp_path / "left.npz"
    file.write_bytes(stock_npz(stock))
    with np.load(file) as content:
        arrays = {name: content[name] for name in content.files}
    assert arrays["version"] == 1, "files of version 1 are read tomorrow too"
    if broken == "text":
        file.write_text("no archive")
    elif broken == "cut":
        file.write_bytes(file.read_bytes()[:200])
    else:
        arrays |= {"format": {"format": np.array("other")}, "version": {"version": np.array(2)},
                   "shape": {"height_mm": np.arange(5.0)},
                   "nan": {"inside_mm": np.full_like(arrays["inside_mm"], np.nan)},
                   "order": {"height_mm": arrays["height_mm"][::-1]}}.get(broken, {})
        if broken == "missing":
            del arrays["origin_mm"]
        np.savez(file, **arrays)
    assert code_of(file) == "CS4705"


def test_a_stock_with_a_wrong_byte_is_refused_or_comes_back_whole(tmp_path: Path) -> None:
    """Anywhere: of 250, of which most are in what is packed, none ends as a defect, and none is another stock."""
    own = block((0.0, 0.0, -5.0), (10.0, 10.0, 0.0), ())
    content, rng, file, refused = stock_npz(own), np.random.default_rng(3), tmp_path / "left.npz", 0
    for _ in range(250):
        damaged = bytearray(content)
        damaged[rng.integers(len(damaged))] ^= int(rng.integers(1, 256))
        file.write_bytes(damaged)
        try:
            back = read_npz(file)
        except CompstiffError as stopped:
            [found] = stopped.findings
            assert found.code in ("CS4705", "CS0005")
            assert found.file == str(file)
            refused += 1
            continue
        np.testing.assert_allclose(back.inside, own.inside, rtol=1e-6)
        np.testing.assert_allclose(back.height, own.height, rtol=1e-12)
    assert refused > 125
    with file.open("wb") as stream:      # an array alone, by the name of an archive
        np.save(stream, np.zeros(3))
    assert code_of(file) == "CS4705"


def coefficients() -> Coefficients:
    mean, covariance = coefficients_of("aluminium", 1e-4)
    return Coefficients(mean, covariance, 0.04, Cutter(8e-3, 3, 1e-3, 30e-3), "aluminium", (5e-5, 1e-4), {"from": "log"})


def test_coefficients_come_back(tmp_path: Path) -> None:
    file, own = tmp_path / "cutting.json", coefficients()
    file.write_text(json.dumps(own.as_dict()))
    back = read_coefficients(file)
    assert back.mean == pytest.approx(own.mean, rel=1e-12)
    assert back.covariance == pytest.approx(own.covariance, rel=1e-12)
    assert (back.cutter.teeth, back.material, back.model_error) == (3, "aluminium", 0.04)
    assert 1e3 * back.cutter.flute == pytest.approx(30)


@pytest.mark.parametrize("changed", [{"format": "x"}, {"version": 2}, {"mean": [1, 2]}, {"covariance": [[1]]},
                                     {"mean": [1, 2, 3, 4, 5, None]}, {"cutter": {}}, {"coefficients": ["a"] * 6},
                                     {"covariance": [[-1.0], *([0.0] * k + [1.0] for k in range(1, 6))]}, None])
def test_no_coefficients_are_refused(tmp_path: Path, changed: dict[str, object] | None) -> None:
    file = tmp_path / "cutting.json"
    file.write_text("{" if changed is None else json.dumps(coefficients().as_dict() | changed))
    with pytest.raises(CompstiffError) as stopped:
        read_coefficients(file)
    assert stopped.value.findings[0].code == "CS4720"


def test_coefficients_of_another_tool_are_refused() -> None:
    own = coefficients()
    check_same(own, own.cutter, "aluminium", "cell.yaml")
    check_same(own, replace(own.cutter, teeth=4), None, "cell.yaml")     # the same edges, more of them
    bull = "a bull-nose R1 end mill, diameter 16 mm, 3 teeth, the cell's is a "
    for cutter, material, words in (
            (Cutter(8e-3, 2), "aluminium", f"{bull}flat end mill, diameter 16 mm, 2 teeth"),
            (Cutter(8e-3, 2, 8e-3), None, f"{bull}ball end mill, diameter 16 mm, 2 teeth"),
            (own.cutter, "steel", "aluminium, the cell states steel"),
            (Cutter(5e-3, 2), "steel", f"{bull}flat end mill, diameter 10 mm, 2 teeth and of aluminium, the cell states "
                                       "steel")):
        with pytest.raises(CompstiffError) as stopped:
            check_same(replace(own, source=Path("cutting.json")), cutter, material, "cell/cell.yaml")
        (found,) = stopped.value.findings
        assert (found.code, found.file, found.message) == ("CS4721", "cutting.json", f"the coefficients are those of {words}")
        assert found.hint == "fit them from a log with this tool and material, or correct `cutting` in cell.yaml"


@pytest.mark.parametrize(("key", "within", "beyond"), [
    ("resolution_mm", 0.021, 0.019), ("resolution_mm", 4.9, 5.1), ("position_std_mm", 9.9, 10.1)])
def test_a_resolution_of_0_02_to_5_mm_and_a_place_to_10_mm_are_a_stocks(tmp_path: Path, key, within, beyond) -> None:
    blank = read_stock(written(tmp_path, f"{BOX}{key}: {within}\n"))
    assert 1e3 * (blank.cell if key == "resolution_mm" else blank.position_std) == pytest.approx(within)
    assert code_of(written(tmp_path, f"{BOX}{key}: {beyond}\n")) == "CS0102"


@pytest.mark.parametrize(("key", "most", "beyond"), [
    ("diameter_mm", 1000.0, 1001.0), ("teeth", 100, 101), ("corner_radius_mm", 500.0, 501.0), ("model_error", 10.0, 10.1)])
def test_sizes_of_a_cutter_that_is_none_are_refused(tmp_path: Path, key: str, most: float, beyond: float) -> None:
    for value in (most, beyond):
        content = coefficients().as_dict()
        (content if key == "model_error" else content["cutter"])[key] = value
        (tmp_path / "cutting.json").write_text(json.dumps(content))
        if value == most:
            assert read_coefficients(tmp_path / "cutting.json").material == "aluminium"
            continue
        with pytest.raises(CompstiffError, match=rf"CS4720: \S*{key}: Input should be less than or equal to"):
            read_coefficients(tmp_path / "cutting.json")


@pytest.mark.parametrize(("radius", "corner", "same"), [(9e-6, -9e-6, True), (11e-6, 0.0, False), (0.0, -11e-6, False)])
def test_coefficients_are_those_of_a_cutter_to_a_hundredth_of_a_millimetre(radius: float, corner: float, same: bool) -> None:
    """Of its radius, and of its corner's."""
    own = coefficients()
    other = replace(own.cutter, radius=own.cutter.radius + radius, corner=own.cutter.corner + corner)
    with nullcontext() if same else pytest.raises(CompstiffError, match="CS4721"):
        check_same(own, other, "aluminium", "cell.yaml")
