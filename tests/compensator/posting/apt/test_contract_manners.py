"""Files in the manner of seven CAM systems, written for this test: what the tool does, from the CAD of each by hand.

Each mills the same quarter of a circle of radius 10 about (20, 20), counter-clockwise from (30, 20) to (20, 30).
"""

from pathlib import Path

import numpy as np
import pytest

from compensator.posting.apt import read_apt
from compensator.posting.campath import CamPath
from compensator.posting.suffixes import toolpath_stem, toolpath_suffix
from identification.common.findings import CompstiffError

MANNERS = Path(__file__).parent / "manners"
HALFWAY = [20 + 10 * np.sqrt(0.5), 20 + 10 * np.sqrt(0.5)]


def read(name: str, tool: str | None = None) -> CamPath:
    return read_apt(MANNERS / name, tool)


def millimetres(path: CamPath) -> list[list[float]]:
    return np.round(1e3 * path.position, 6).tolist()


def rows(path: CamPath) -> list[tuple[float, ...]]:
    """x y z [mm] and feed [mm/min], 0 in the air."""
    feed = np.where(path.rapid, 0, 6e4 * np.nan_to_num(path.feed))
    return [tuple(row) for row in np.round(np.column_stack([1e3 * path.position, feed]), 4).tolist()]


def passed(path: CamPath) -> dict[str, str]:
    return {finding.code: finding.message for finding in path.findings}


@pytest.mark.parametrize(("name", "tool", "z", "feed", "first"), [
    ("camworks.apt", "4", -2, 900, 3), ("nx.cls", None, 5, 500, 2), ("creo.ncl.3", None, -1.5, 600, 2),
    ("catia.aptsource", None, 5, 300, 1), ("autodesk.apt", None, 5, 333.3, 2),
])
def test_the_same_quarter_of_a_circle_in_five_manners(name, tool, z, feed, first):
    found = rows(read(name, tool))
    assert found[first - 1][:3] == (30, 20, z)
    assert found[first] == (*np.round(HALFWAY, 4), z, feed)
    assert found[first + 1] == (20, 30, z, feed)


def test_mastercam_in_inches():
    found = np.array(rows(read("mastercam.cl")))
    np.testing.assert_allclose(found[0], [76.2, 50.8, 25.4, 0])
    np.testing.assert_allclose(found[-1], [50.8, 76.2, 12.7, 12 * 25.4])
    np.testing.assert_allclose(np.hypot(found[1:, 0] - 50.8, found[1:, 1] - 50.8), 25.4, atol=1e-4)


def test_a_transformation_turns_and_shifts_what_stands_behind_it():
    """x' = 100 - y, y' = 50 + x, z' = z + 10: a quarter turn about z, then a shift; the arc goes on the same way round."""
    path = read("solidcam.apt")
    assert rows(path) == [(80, 80, 60, 0), (80, 80, 15, 400), (round(100 - HALFWAY[1], 4), round(50 + HALFWAY[0], 4), 15, 400),
                          (70, 70, 15, 400), (80, 70, 60, 0)]


def test_a_transformation_turns_the_tool_axis_too(tmp_path):
    """A quarter turn about x: y becomes z, z becomes -y."""
    file = tmp_path / "a.apt"
    file.write_text("UNITS/INCHES\nFEDRAT/1,MMPM\nTRACUT/1,0,0,0,0,0,-1,0,0,1,0,2\nGOTO/0,1,3\nGODLTA/0,1,0\n"
                    "GOTO/0,0,0,0.6,0,0.8\nINDIRV/0,1,0\nTRACUT/NOMORE\nGOTO/1,0,0\n")
    path = read_apt(file)
    np.testing.assert_allclose(1e3 * path.position / 25.4, [[0, -3, 3], [0, -3, 4], [0, 0, 2], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(path.axis, [[0, -1, 0], [0, -1, 0], [0.6, -0.8, 0], [0.6, 0, 0.8]], atol=1e-12)


def test_camworks_peck_drilling_from_the_side():
    """12 mm deep in pecks of 5, 4 and 3 along -x; 25 mm out after each hole, across at that height to the next."""
    path = read("camworks.apt", "9")
    hole = [(83, 0), (75, 120), (83, 0), (76, 0), (71, 120), (83, 0), (72, 0), (68, 120), (105, 0)]
    assert rows(path) == [(105, y, -5, 0) if not x else (x, y, -5, feed) for y in (10, 30) for x, feed in [(0, 0), *hole]]
    assert {tuple(axis) for axis in path.axis.tolist()} == {(1, 0, 0)}
    assert [row[0] for row, stop in zip(rows(path), path.stop, strict=True) if stop] == [75, 71, 68] * 2
    assert "2 holes" in passed(path)["CS2183"]
    assert passed(path)["CS2181"].startswith("6 motions of other tools than 9")


def test_creo_peck_drilling():
    """From 2 mm: clearance 1 mm above 0.5, pecks of 1 to 3.5 mm; back to 2 mm, for no RETURN says how far."""
    found = rows(read("creo.ncl.3"))[5:]
    assert found == [(0, 0, 2, 0), (0, 0, 1.5, 0), (0, 0, -0.5, 50), (0, 0, 1.5, 0), (0, 0, 0.5, 0), (0, 0, -1.5, 50),
                     (0, 0, 1.5, 0), (0, 0, -0.5, 0), (0, 0, -2.5, 50), (0, 0, 1.5, 0), (0, 0, -1.5, 0), (0, 0, -3, 50),
                     (0, 0, 2, 0)]
    assert "height it had before" in passed(read("creo.ncl.3"))["CS2183"]


def test_nx_drilling_counts_the_depth_along_the_tool_axis():
    assert rows(read("nx.cls"))[4:] == [(20, 30, 8, 0), (0, 0, 8, 0), (0, 0, -3, 100), (0, 0, 8, 0)]


def test_every_word_passed_over_is_told():
    found = passed(read("nx.cls"))
    assert found["CS2180"] == ("left out, for no point of the path depends on it: END-OF-PATH (1), PAINT (5), TLDATA (1)")
    assert "CS2104" not in found
    assert "CUTTER (2)" in passed(read("camworks.apt", "4"))["CS2180"]


def test_several_tools_are_one_program_each():
    with pytest.raises(CompstiffError, match="found tool 9 behind tool 4") as caught:
        read("camworks.apt")
    finding = caught.value.findings[0]
    assert (finding.code, finding.line) == ("CS2110", 29)
    assert "--tool 4 and --tool 9" in finding.hint
    assert (len(read("camworks.apt", "4")), len(read("camworks.apt", "9"))) == (8, 20)
    with pytest.raises(CompstiffError, match="tool 5 is not in this file, which has 4, 9"):
        read("camworks.apt", "5")
    assert len(read("nx.cls", "mill_d12")) == len(read("nx.cls", "2")) == len(read("nx.cls"))


@pytest.mark.parametrize(("name", "suffix", "stem"), [
    ("a.ncl.12", ".ncl", "a"), ("a.NCL", ".ncl", "a"), ("b.c.aptsource", ".aptsource", "b.c"), ("part.mod", ".mod", "part"),
    ("part.mod.1", ".1", "part.mod"), ("part.v2.cls.3", ".cls", "part.v2"), ("7.ncl.1", ".ncl", "7"), (".1", "", ".1"),
])
def test_creos_version_numbers_are_no_part_of_the_format(name, suffix, stem):
    assert (toolpath_suffix(Path(name)), toolpath_stem(Path(name))) == (suffix, stem)


@pytest.mark.parametrize(("axis", "said"), [
    (("", "", ""), True), (("MULTAX/OFF\n", "", ""), False), (("TLAXIS/0,0,1\n", "", ""), False), (("", ",0,0,1", ""), False),
    (("", "", ",0,0.6,0.8"), False)])
def test_an_axis_that_nobody_states_is_said_to_be_upright(tmp_path: Path, axis: tuple[str, str, str], said: bool) -> None:
    """Where one point alone has it it is stated."""
    above, first, second = axis
    file = tmp_path / "part.apt"
    file.write_text(f"UNITS/MM\nFEDRAT/3000,MMPM\n{above}GOTO/0,0,0{first}\nGOTO/10,0,0{second}\nFINI\n")
    path = read_apt(file)
    assert [finding.code for finding in path.findings if finding.code == "CS2184"] == ["CS2184"] * said
    np.testing.assert_allclose(path.axis[0], [0, 0, 1])
