"""What docs/formats.md promises of the table of measured points: what is read, and what is said of what is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.learning.measured_points import read_points
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.virtual_cell.cell import simulate

GOOD = "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um\n10,20,-1,5,,-7,3\n11,20,-1,6,2,-8,4\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("points")
    simulate(1).write(place)
    return place


def read(folder: Path, text: str):
    file = folder / "points.csv"
    file.write_text(text)
    return read_points(file, read_cell(folder / "cell.yaml"))


def test_components_and_their_sigma(folder: Path) -> None:
    points = read(folder, GOOD)
    assert len(points) == 2
    assert points.point.tolist() == [0, 0, 1, 1, 1]
    assert np.allclose(1e6 * points.value, [5, -7, 6, 2, -8])
    assert np.allclose(1e6 * points.sigma, [3, 3, 4, 4, 4])
    assert np.allclose(points.direction, np.eye(3)[[0, 2, 0, 1, 2]])
    assert np.allclose(1e3 * points.position, [[10, 20, -1], [11, 20, -1]])


def test_a_deviation_of_just_under_two_centimetres_is_one(folder: Path) -> None:
    assert np.allclose(1e6 * read(folder, "x_mm,y_mm,z_mm,dx_um\n1,2,3,4\n1,2,3,-19900\n").value, [4, -19900])


@pytest.mark.parametrize("name", ["dn_um", "d_um"])
def test_along_the_normal(folder: Path, name: str) -> None:
    points = read(folder, f"x_mm,y_mm,z_mm,nx,ny,nz,{name},target\n10,20,-1,0,0.6,0.8,12,\n11,20,-1,0,0,1,-4,7\n")
    assert np.allclose(1e6 * points.value, [12, -4])
    assert np.allclose(points.direction, [[0, 0.6, 0.8], [0, 0, 1]])
    assert points.target.tolist() == [-1, 7]
    assert [finding.code for finding in points.findings] == ["CS5302"]
    assert not read(folder, f"x_mm,y_mm,z_mm,nx,ny,nz,{name},std_um\n10,20,-1,0,0.6,0.8,12,3\n").findings


def test_a_normal_that_is_off_its_length_by_what_is_written_is_one_of_length_one(folder: Path) -> None:
    """To two digits, as some probes write it; beyond a hundredth it is refused (below)."""
    points = read(folder, "x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n10,20,-1,0.71,0.71,0,12\n11,20,-1,0,0,0.991,-4\n")
    assert np.allclose(points.direction, [[np.sqrt(0.5), np.sqrt(0.5), 0], [0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(("text", "code", "line", "words"), [
    ("x_mm,y_mm,z_mm\n1,2,3\n", "CS5300", 1, "neither"),
    ("x_mm,y_mm,z_mm,dn_um\n1,2,3,4\n", "CS5300", 1, "no nx ny nz"),
    ("x_mm,y_mm,z_mm,dx_um,nx,ny,nz,dn_um\n1,2,3,4,0,0,1,4\n", "CS5300", 1, "dn_um and dx_um"),
    ("x_mm,y_mm,z_mm,dx_um\n1,2,3,\n", "CS5300", None, "no row"),
    ("x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n1,2,3,0,0,1,4\n1,2,3,0,0,2,4\n", "CS0203", 3, "length 2"),
    ("x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n1,2,3,0,0,1.009,4\n1,2,3,0,0,-1.011,4\n", "CS0203", 3, "length 1.011, expected 1"),
    ("x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n1,2,3,0,0.991,0,4\n1,2,3,0,0,0.989,4\n", "CS0203", 3, "length 0.989"),
    ("x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n1,2,3,1e300,0,1e300,4\n", "CS0203", 2, ""),
    ("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,4,0\n", "CS0203", 2, "larger than 0"),
    ("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,4,3\n1,2,3,4,0\n1,2,3,4,-1\n", "CS0203", 3, "std_um is 0"),
    ("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,4,3\n1,2,3,4,0.01\n1,2,3,4,-1.5\n", "CS0203", 4, "std_um is -1.5"),
    ("x_mm,y_mm,z_mm,dx_um,std_um\n1,2,3,4,0.01\n1,2,3,4,0.002\n", "CS6036", 3, "std_um is 0.002"),
    ("x_mm,y_mm,z_mm,dx_um\n1,2,3,4\n1,2,3,-20100\n", "CS5301", 3, "a deviation of 20.1 mm, expected under 20 mm"),
    ("x_mm,y_mm,z_mm,nx,ny,nz,dn_um\n1,2,3,0,0,1,30000\n1,2,3,0,0,1,4\n", "CS5301", 2, "a deviation of 30 mm"),
    ("x_mm,y_mm,z_mm,dx_um,target\n1,2,3,4,1.5\n", "CS3004", 2, "1.5"),
    ("x_mm,y_mm,z_mm,dx_um,target\n1,2,3,4,0\n1,2,3,4,-1\n", "CS3004", 3, "target -1 is not a target number"),
    ("x_mm,y_mm,z_mm,dx_um,target\n1,2,3,4,1e9\n1,2,3,4,1.001e9\n", "CS3004", 3, "target 1.001e+09 is not"),
    ("x_mm,y_mm,dx_um\n1,2,3\n", "CS0202", 1, "z_mm"),
    ("x_mm,y_mm,z_mm,dx_um\n1,2,3,four\n", "CS0203", 2, "four"),
])
def test_what_is_wrong_is_said_where_it_is(folder: Path, text: str, code: str, line: int | None, words: str) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read(folder, text)
    finding = stopped.value.findings[0]
    assert (finding.code, finding.line) == (code, line)
    assert words in finding.message


@pytest.mark.parametrize("seed", range(30))
def test_points_that_were_copied_are_told(folder: Path, seed: int) -> None:
    """Points measured twice at one place differ by their noise, and say nothing; a table that was appended to itself does."""
    rng = np.random.default_rng((12, seed))
    place = np.round(rng.uniform(0, 100, (int(rng.integers(5, 60)), 3)), 2)
    header = "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um\n"

    def rows(count: int) -> list[str]:
        return [",".join(f"{x:g}" for x in (*place[k], *np.round(rng.normal(0, 30, 3), 1))) for k in range(count)]

    def said(lines: list[str]) -> bool:
        return "CS0012" in {finding.code for finding in read(folder, header + "\n".join(lines) + "\n").findings}

    once = rows(len(place))
    assert not said(once)
    assert not said(once + rows(len(place)))
    assert said(once + once)


@pytest.mark.parametrize(("copies", "count", "said"), [(2, 10, False), (3, 13, True), (3, 30, True), (3, 31, False),
                                                       (5, 50, True), (5, 51, False)])
def test_three_copies_and_a_tenth_of_the_points_are_told_with_the_first(
    folder: Path, copies: int, count: int, said: bool
) -> None:
    """Of `count` points in all; a deviation that was not measured is the same as another that was not."""
    lines = [f"{k},1,2,{100 + k},{'' if k % 2 else k}" for k in range(count - copies)]
    lines[3:3] = lines[:copies]
    found = [one for one in read(folder, "x_mm,y_mm,z_mm,dx_um,dy_um\n" + "\n".join(lines) + "\n").findings
             if one.code == "CS0012"]
    assert [(one.level, one.line, one.message.partition(",")[0]) for one in found] == ([(
        "warning", 5, f"{copies} of {count} points stand in the table before")] if said else [])


@pytest.mark.parametrize(("zeros", "said"), [(29, False), (31, True)])
def test_zeros_are_typed_where_they_are_three_times_what_the_noise_makes(folder: Path, zeros: int, said: bool) -> None:
    """Steps of 1 um at a noise of 4: a tenth of a normal density's reading falls on one step, of a hundred points ten on 0."""
    values = [0] * zeros + [2 + k % 40 for k in range(100 - zeros)]
    text = "x_mm,y_mm,z_mm,nx,ny,nz,dn_um,std_um\n" + "".join(f"{k},1,2,0,0,1,{one},4\n" for k, one in enumerate(values))
    found = [one for one in read(folder, text).findings if one.code == "CS6047"]
    assert [(one.level, one.line, one.message.partition(":")[0]) for one in found] == (
        [("warning", 2, "31 of 100 readings are exactly 0")] if said else [])


def test_a_sigma_that_is_not_stated_is_the_cell_s_root_mean_square(folder: Path) -> None:
    """Of 4, 1 and 1 um the root of 6."""
    cell = read_cell(folder / "cell.yaml")
    cell = replace(cell, noise=replace(cell.noise, deflection=1e-6 * np.array([4.0, 1.0, 1.0])))
    file = folder / "points.csv"
    file.write_text("x_mm,y_mm,z_mm,dx_um\n1,2,3,4\n5,6,7,8\n")
    points = read_points(file, cell)
    assert 1e6 * points.sigma == pytest.approx(np.sqrt([6.0, 6.0]))
    assert [(one.code, one.level, one.message) for one in points.findings] == [(
        "CS5302", "note", "no column std_um: 1 sigma of a measured number taken from the cell's measurement.deflection_std_um, "
        "2.44949 um")]
