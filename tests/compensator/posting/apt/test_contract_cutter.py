"""What APT files say of their cutter: its shape in millimetres, for the moves that are taken, and what forces make of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from compensator.cutting.cutter import Cutter, cutter_of, said_of_cutter
from compensator.posting.apt import read_apt
from compensator.toolpath import StatedCutter
from identification.common.findings import CompstiffError

MANNERS = Path(__file__).parent / "manners"


def stated(folder: Path, *lines: str) -> tuple[StatedCutter, ...]:
    file = folder / "part.apt"
    file.write_text("\n".join(["UNITS/MM", *lines, "FINI"]) + "\n")
    return read_apt(file).cutters


def of_cell(diameter: float | None = None, corner: float | None = None, teeth: int | None = 3) -> object:
    return SimpleNamespace(source=Path("cell.yaml"), cutting=SimpleNamespace(
        tool_diameter_mm=diameter, corner_radius_mm=corner, teeth=teeth, flute_mm=None))


MOVE = "FEDRAT/500,MMPM\nGOTO/1,2,3\nGOTO/5,2,3"


@pytest.mark.parametrize(("name", "tool", "diameter", "corner"), [
    ("camworks.apt", "4", 10.0, 0.0), ("nx.cls", None, 12.0, 0.0), ("creo.ncl.3", None, 8.0, None),
    ("mastercam.cl", None, 12.7, None), ("autodesk.apt", None, 10.0, 0.0)])
def test_every_manner_states_its_cutter(name: str, tool: str | None, diameter: float, corner: float | None) -> None:
    [own] = read_apt(MANNERS / name, tool).cutters
    assert 1e3 * own.diameter == pytest.approx(diameter)
    assert own.corner is None if corner is None else 1e3 * own.corner == pytest.approx(corner)
    assert own.beyond == ""
    text = (MANNERS / name).read_text().splitlines()[own.line - 1]
    assert "CUTTER" in text or "TLDATA" in text


def test_of_several_tools_it_is_that_of_the_one_taken() -> None:
    """Tool 9 of the file is a drill with a point of 118 degrees."""
    [drill] = read_apt(MANNERS / "camworks.apt", "9").cutters
    assert "its floor leans by 31 degrees" in drill.beyond


@pytest.mark.parametrize(("words", "diameter", "corner"), [
    ("CUTTER/16", 16, None), ("CUTTER/16,2", 16, 2), ("CUTTER/16,8", 16, 8), ("CUTTER/16,2,6,2,0,0,50", 16, 2),
    ("TLDATA/MILL,16,2,75,0,0", 16, 2), ("$$-> CUTTER / 16.000000", 16, None)])
def test_an_end_mill_is_read(tmp_path: Path, words: str, diameter: float, corner: float | None) -> None:
    [own] = stated(tmp_path, words, MOVE)
    assert (1e3 * own.diameter, own.beyond, own.line) == (pytest.approx(diameter), "", 2)
    assert own.corner is None if corner is None else 1e3 * own.corner == pytest.approx(corner)
    cutter = cutter_of(of_cell(), (own,))
    assert cutter == Cutter(pytest.approx(0.5e-3 * diameter), 3, pytest.approx(1e-3 * (corner or 0.0)))
    assert [finding.code for finding in said_of_cutter(of_cell(), (own,))] == ["CS4717"]


def test_inches(tmp_path: Path) -> None:
    file = tmp_path / "part.apt"
    file.write_text("UNITS/INCHES\nCUTTER/0.5,0.0625\nFEDRAT/20,IPM\nGOTO/1,2,3\nFINI\n")
    [own] = read_apt(file).cutters
    assert (1e3 * own.diameter, 1e3 * (own.corner or 0.0)) == (pytest.approx(12.7), pytest.approx(1.5875))


@pytest.mark.parametrize(("words", "said"), [
    ("CUTTER/16,2,6,2,0,5,50", "flank leans by 5"), ("CUTTER/16,0,8,3,31,0,50", "floor leans by 31"),
    ("CUTTER/16,2,3,2,0,0,50", "rounding"), ("CUTTER/16,2,3,2", "rounding"),
    ("CUTTER/16,9", "corner radius"), ("CUTTER/0", "diameter"),
    ("TLDATA/MILL,16,2,75,3,0", "flank leans by 3"), ("TLDATA/DRILL,8,118", "no end mill"),
    ("CUTTER/MILL,5", "cannot be read")])
def test_what_is_not_modelled_is_read_and_refused_for_forces_alone(tmp_path: Path, words: str, said: str) -> None:
    [own] = stated(tmp_path, words, MOVE)
    assert said in own.beyond
    with pytest.raises(CompstiffError) as stopped:
        cutter_of(of_cell(16.0), (own,))
    [finding] = stopped.value.findings
    assert (finding.code, finding.line) == ("CS4718", 2)
    assert said in finding.message


@pytest.mark.parametrize(("diameter", "corner", "words"), [
    (12.0, None, "16 mm, cutting.tool_diameter_mm of cell.yaml 12"),
    (16.0, 1.0, "2 mm, cutting.corner_radius_mm of cell.yaml 1"),
    (16.05, 2.0, "16 mm, cutting.tool_diameter_mm of cell.yaml 16.05")])
def test_a_contradiction_names_the_line(tmp_path: Path, diameter: float, corner: float | None, words: str) -> None:
    cutters = stated(tmp_path, "CUTTER/16,2", MOVE)
    with pytest.raises(CompstiffError) as stopped:
        cutter_of(of_cell(diameter, corner), cutters)
    [finding] = stopped.value.findings
    assert (finding.code, finding.line, finding.column) == ("CS4716", 2, 1)
    assert finding.message == f"CUTTER/16,2 has {words}"
    assert cutter_of(of_cell(16.0, 2.0), cutters) == Cutter(8e-3, 3, 2e-3)
    assert said_of_cutter(of_cell(16.0, 2.0), cutters) == []


def test_two_cutters_of_one_tool_are_refused_and_repetitions_are_none(tmp_path: Path) -> None:
    assert len(stated(tmp_path, "CUTTER/16,2", MOVE, "CUTTER/16,2", "GOTO/9,2,3")) == 1
    assert len(stated(tmp_path, "CUTTER/12", "CUTTER/16,2", MOVE)) == 1     # the first never moved
    cutters = stated(tmp_path, "CUTTER/16,2", MOVE, "CUTTER/12", "GOTO/9,2,3")
    with pytest.raises(CompstiffError) as stopped:
        cutter_of(of_cell(16.0, 2.0), cutters)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].line) == ("CS4719", 6)


def test_teeth_are_stated_by_no_file(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match=r"CS4701.*cutting\.teeth of|cutting\.teeth of"):
        cutter_of(of_cell(teeth=None), stated(tmp_path, "CUTTER/16,2", MOVE))


@pytest.mark.parametrize(("diameter", "corner", "same"), [(16.009, 1.991, True), (16.011, 2.0, False), (16.0, 1.989, False)])
def test_lengths_of_a_cutter_are_one_to_a_hundredth_of_a_millimetre(tmp_path: Path, diameter: float, corner, same) -> None:
    cutters = stated(tmp_path, "CUTTER/16,2", MOVE)
    if same:
        assert cutter_of(of_cell(diameter, corner), cutters).radius == pytest.approx(0.5e-3 * diameter)
        return
    with pytest.raises(CompstiffError, match="CS4716"):
        cutter_of(of_cell(diameter, corner), cutters)
