"""Measured passes: what is read of a table, what is refused, and which places of two passes belong together."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compensator.verification.readings import nearest, read_readings
from compensator.verification.verify import verify as verify_files
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.compensator.verification.measured_passes import SIGMAS, csv, passes_in, verify
from tests.support import write_cell


@pytest.fixture
def passes(tmp_path: Path) -> dict[str, Path]:
    return passes_in(tmp_path)


@pytest.mark.parametrize(("unit", "said"), [(1.0, None), (1e-3, "in millimetres?"), (0.0, "Were they measured?")])
@pytest.mark.parametrize("sigmas", ["", ",sx_um,sy_um,sz_um"])
def test_a_part_measured_in_millimetres_is_not_accepted(tmp_path: Path, unit: float, said: str | None, sigmas: str) -> None:
    """24 um in millimetres are 0.024: within any tolerance. A probe of 10 nm that says so is believed."""
    rng, cell = np.random.default_rng(5), read_cell(write_cell(tmp_path))
    rows = unit * rng.normal(0, 14, (20, 3))
    file = tmp_path / "after.csv"

    def written(sigma: float) -> Path:
        file.write_text("target,dx_um,dy_um,dz_um" + sigmas + "\n" + "".join(
            f"{k},{','.join(f'{x:.5f}' for x in row)}{f',{sigma},{sigma},{sigma}' if sigmas else ''}\n"
            for k, row in enumerate(rows)))
        return file

    if said is None:
        assert len(read_readings(written(2.0), cell)) == 20
        return
    with pytest.raises(CompstiffError, match="CS6035") as refused:
        read_readings(written(2.0), cell)
    assert said in refused.value.findings[0].hint
    if sigmas and unit:
        assert len(read_readings(written(0.01), cell)) == 20


@pytest.mark.parametrize("seed", range(30))
def test_a_unit_that_the_sigma_has_too_is_told(tmp_path: Path, seed: int) -> None:
    """Readings and their 1 sigma in millimetres show a part without error, of a probe that does not exist; in nanometres one
    that is off by centimetres. Any part of 0.5 to 2000 um and a probe of 0.05 to 30 are believed."""
    rng, cell = np.random.default_rng((6036, seed)), read_cell(write_cell(tmp_path))
    size, sigma = 10 ** rng.uniform(-0.3, 3.3), 10 ** rng.uniform(-1.3, 1.5)
    rows, file = rng.normal(0, np.hypot(size, sigma), (int(rng.integers(5, 60)), 3)), tmp_path / "part.csv"

    def written(unit: float, stated: float) -> Path:
        file.write_text("target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um\n" + "".join(
            f"{k},{','.join(f'{unit * x:.9g}' for x in row)}{3 * f',{unit * stated:.9g}'}\n" for k, row in enumerate(rows)))
        return file

    assert len(read_readings(written(1.0, sigma), cell)) == len(rows)
    with pytest.raises(CompstiffError, match="CS6036"):
        read_readings(written(1e-3, 2.0), cell)
    with pytest.raises(CompstiffError, match="CS6036"):
        read_readings(written(1e6, sigma), cell)
    lines = written(1.0, sigma).read_text().splitlines()
    lines[3] = f"2,{','.join(f'{x:.9g}' for x in rows[2])},{sigma:.9g},1e-160,{sigma:.9g}"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(CompstiffError, match="CS6036") as stopped:
        read_readings(file, cell)
    assert stopped.value.findings[0].line == 4


@pytest.mark.parametrize("within", [1e-3, 0.0])
def test_readings_of_two_walls_that_stand_closer_than_the_distance_are_paired_by_their_normals(
    tmp_path: Path, within: float
) -> None:
    """Each a little beside the place of the other wall's in the other pass, or both at one place where none may be between."""
    aside = 0.4 if within else 0.0
    rows = [[5 * k + aside * wall, 0, 0, wall == 0, wall == 1, 0, 50 + 10 * k + wall] for k in range(6) for wall in (0, 1)]
    moved = [[5 * k + aside * (1 - wall), 0, 0, wall == 0, wall == 1, 0, 20] for k in range(6) for wall in (1, 0)]
    before, after = (csv(tmp_path, name, "x_mm,y_mm,z_mm,nx,ny,nz,dn_um", np.array(table, dtype=float))
                     for name, table in (("b.csv", rows), ("a.csv", moved)))
    result = verify_files(read_cell(write_cell(tmp_path)), before, after, within=within)
    assert (result.rows_before.tolist(), result.rows_after.tolist()) == (
        list(range(12)), [k + 1 - 2 * (k % 2) for k in range(12)])


@pytest.mark.parametrize("columns", ["target", "x_mm,y_mm,z_mm"])
@pytest.mark.parametrize(("shared", "words"), [(3, ""), (2, "only 2 of 30 rows belong"), (0, "no row belongs")])
def test_a_tenth_of_the_places_belongs_together(tmp_path: Path, columns: str, shared: int, words: str) -> None:
    """Of the smaller pass; how many have no counterpart is told of each. Targets have no distance to set."""
    cell, rng = read_cell(write_cell(tmp_path)), np.random.default_rng(23)

    def file(name: str, target: np.ndarray) -> Path:
        where = target[:, None] if columns == "target" else np.column_stack([5.0 * target, 0 * target, 0 * target])
        off = rng.normal(0, 40, (len(target), 3))
        return csv(tmp_path, name, f"{columns},dx_um,dy_um,dz_um", np.column_stack([where, off]))

    before, after = file("before.csv", np.arange(40)), file("after.csv", np.arange(30) + 40 - shared)
    if not words:
        told = [one for one in verify_files(cell, before, after).findings if one.code == "CS6022"]
        assert [(one.level, one.file, one.message.partition(" without")[0]) for one in told] == [
            ("warning", str(before), "37 readings of 40"), ("warning", str(after), "27 readings of 30")]
        return
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, before, after)
    (found,) = stopped.value.findings
    assert (found.code, found.file, found.message.startswith(words)) == ("CS6023", str(after), True)
    assert ("within-mm" in found.hint, "at most 1 mm apart" in found.message) == (columns != "target", columns != "target")


def test_pairs_are_each_others_nearest_within_the_distance() -> None:
    first = np.array([[0.0], [1.0], [2.0], [10.0]])
    second = np.array([[0.1], [0.2], [2.4], [50.0]])
    mine, other = nearest(first, second, 0.5)
    assert (mine.tolist(), other.tolist()) == ([0, 2], [0, 2])


def test_readings_at_one_place_are_paired_along_their_normals_and_in_their_order(tmp_path: Path) -> None:
    """Both walls of six corners, each read twice; the second pass in another order. So the hint of CS6020 can be followed."""
    corner, wall, again = (grid.ravel() for grid in np.meshgrid(np.arange(6), [0, 1], [0, 1], indexing="ij"))
    off = 100.0 + 10 * corner + 50 * wall + again
    rows = np.column_stack([5 * corner, 0 * corner, 0 * corner, wall == 0, wall == 1, 0 * corner, off])
    cell, columns = read_cell(write_cell(tmp_path)), "x_mm,y_mm,z_mm,nx,ny,nz,dn_um"
    before = csv(tmp_path, "before.csv", columns, rows)
    order = np.lexsort([again, -corner, wall])
    half = rows[order].copy()
    half[:, 6] /= 2
    result = verify_files(cell, before, csv(tmp_path, "after.csv", columns, half))
    assert "CS6022" not in {one.code for one in result.findings}
    assert result.rows_after.tolist() == np.argsort(order).tolist()
    assert result.comparison.before.points == 24
    assert result.comparison.ratio == pytest.approx(2, rel=1e-9)

    other_way = half.copy()
    other_way[:, 3:] *= -1
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, before, csv(tmp_path, "turned.csv", columns, other_way))
    (found,) = stopped.value.findings
    assert (found.code, "at most 1 mm apart, along normals at most 30 degrees apart" in found.message) == ("CS6023", True)
    assert "out of the material" in found.hint


@pytest.mark.parametrize(("other", "file", "said"), [
    ("target,dn_um,nx,ny,nz\n0,5,0,0,1\n1,5,0,0,1\n", "other", "has the deviation along normal"),
    ("target,dy_um\n0,5\n1,5\n", "other", "no component was measured in both passes"),
    ("target,dx_um\n0,5\n1,5\n", "", "")])
def test_passes_that_were_not_measured_alike_are_not_compared(
    passes: dict[str, Path], tmp_path: Path, other: str, file: str, said: str
) -> None:
    first, second = tmp_path / "first.csv", tmp_path / "other.csv"
    first.write_text("target,dx_um,dz_um\n0,50,20\n1,55,20\n")
    second.write_text(other)
    result = verify(passes["cell"], first, second, "--json")
    told = [one for one in json.loads(result.stdout)["findings"] if one["level"] == "error"]
    assert result.exit_code == (1 if said else 0)
    assert [(one["code"], one["file"]) for one in told] == ([("CS6020", str(second))] if said else [])
    assert all(said in one["message"] for one in told)


def test_rows_without_a_number_are_left_out_and_counted(tmp_path: Path) -> None:
    """One component of three is a measured row."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    file.write_text("target,dx_um,dy_um,dz_um\n0,5,,\n1,5,6,7\n")
    whole = read_readings(file, cell)
    assert (len(whole), "CS6032" in {finding.code for finding in whole.findings}) == (2, False)
    file.write_text("target,dx_um,dy_um,dz_um\n0,5,,\n2,,,\n1,5,6,7\n3,,,\n")
    left = read_readings(file, cell)
    assert left.place.tolist() == [[0.0], [1.0]]
    [finding] = [finding for finding in left.findings if finding.code == "CS6032"]
    assert (finding.level, finding.message, finding.file) == ("note", "2 rows without a measured component left out", str(file))


def test_readings_of_one_target_are_averaged_and_counted(tmp_path: Path) -> None:
    """The mean of those that there are, with the sigma of a mean: of 3 and 4 um the half of 5 um."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    file.write_text("target,dx_um,dy_um,sx_um,sy_um,sz_um\n7,4,1,3,2,1\n3,10,2,1,2,1\n7,8,,4,2,1\n")
    read = read_readings(file, cell)
    assert read.place.tolist() == [[3.0], [7.0]]
    np.testing.assert_allclose(1e6 * read.deviation[:, :2], [[10, 2], [6, 1]])
    np.testing.assert_allclose(1e6 * read.sigma[:, :2], [[1, 2], [2.5, 2]])
    [finding] = [finding for finding in read.findings if finding.code == "CS6033"]
    assert (finding.level, finding.file) == ("note", str(file))
    assert finding.message == "1 further reading of a target that has one: averaged with it"
    file.write_text("path_mm,dx_um\n7,4\n7,8\n")          # at one place, but not of one target
    assert (len(read_readings(file, cell)), "CS6033" in {one.code for one in read_readings(file, cell).findings}) == (2, False)
    file.write_text("target,dx_um\n7,4\n8,8\n")
    assert "CS6033" not in {one.code for one in read_readings(file, cell).findings}


@pytest.mark.parametrize("degrees", [0, 29, 31, 90, 180])
def test_readings_of_one_target_along_other_normals_are_not_one(tmp_path: Path, degrees: float) -> None:
    """Of two walls of a corner, or of a rib: their mean is nobody's deviation. Of all components it is, whatever the normal."""
    cell, file = read_cell(write_cell(tmp_path)), tmp_path / "pass.csv"
    along = f"{np.cos(np.radians(degrees)):.6f},{np.sin(np.radians(degrees)):.6f},0"
    file.write_text(f"target,dx_um,nx,ny,nz\n7,40,1,0,0\n7,-40,{along}\n")
    np.testing.assert_allclose(read_readings(file, cell).deviation[0, 0], 0, atol=1e-12)
    file.write_text(f"path_mm,dn_um,nx,ny,nz\n7,40,1,0,0\n7,-40,{along}\n")
    assert len(read_readings(file, cell)) == 2
    file.write_text(f"target,dn_um,nx,ny,nz\n7,40,1,0,0\n9,10,0,0,1\n7,,{along}\n")      # one that was not measured
    np.testing.assert_allclose(1e6 * read_readings(file, cell).deviation, [[40], [10]], atol=1e-9)
    file.write_text(f"target,dn_um,nx,ny,nz\n7,40,1,0,0\n9,10,0,0,1\n7,-40,{along}\n")
    if degrees < 30:
        np.testing.assert_allclose(1e6 * read_readings(file, cell).deviation, [[0], [10]], atol=1e-9)
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, cell)
    [finding] = stopped.value.findings
    assert (finding.code, finding.line) == ("CS6020", 4)
    assert f"target 7 has readings along normals that are {degrees:g} degrees apart" in finding.message


@pytest.mark.parametrize(("count", "share", "refused"), [
    (9, 0.05, False), (10, 0.05, True), (10, 0.11, False), (40, 0.095, True)])
def test_readings_are_too_small_from_ten_numbers_and_under_a_tenth_of_their_sigma(
    tmp_path: Path, count: int, share: float, refused: bool
) -> None:
    file = csv(tmp_path, "part.csv", "target,dn_um,sn_um", np.array([[k, share * 2 * (-1) ** k, 2] for k in range(count)]))
    if not refused:
        assert len(read_readings(file, read_cell(write_cell(tmp_path)))) == count
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, read_cell(write_cell(tmp_path)))
    [found] = stopped.value.findings
    assert (found.code, found.file) == ("CS6035", str(file))
    assert found.message.startswith(f"all {count} deviations together are {share:.2g} times their own 1 sigma, RMS")


@pytest.mark.parametrize(("numbers", "code", "kept"), [
    ([0, 1], "", [0, 1]), ([0, 1, 2], "CS6038", [0, 1, 2]), ([2, 3], "CS6038", [2, 3]), ([1, 2, 4], "", [1, 2, 4]),
    ([0, 2, 4, 5], "CS6037", [0, 2, 3]), ([1, 3, 6, 6], "CS6037", [1, 4])])
def test_whose_numbers_readings_name_is_told_where_it_matters(
    tmp_path: Path, numbers: list[int], code: str, kept: list[int]
) -> None:
    """Of five targets the corrected program has seven, two added before the third: up to 1 both count alike, up to 4 it may be
    either's (the last of the planned ones is theirs), from 5 on it is the corrected one's: its 4, 5, 6 are the planned 2, 3, 4.
    """
    offsets = tmp_path / "offsets.csv"
    offsets.write_text("target,dx_um,dy_um,dz_um,added\n" + "".join(
        f"{k},{40 + k},{k * k},3,{'0.3 0.6' if k == 2 else ''}\n" for k in range(5)))
    before = csv(tmp_path, "before.csv", "target,dx_um", np.array([[k, 40 + k] for k in range(5)]))
    after = csv(tmp_path, "after.csv", "target,dx_um", np.array([[k, 10 + k] for k in numbers]))
    found = verify_files(read_cell(write_cell(tmp_path)), before, after, offsets)
    told = [one for one in found.findings if one.code in ("CS6037", "CS6038")]
    assert [(one.code, one.file) for one in told] == [(code, str(after))] * bool(code)
    assert found.after.place[:, 0].tolist() == kept
    if code == "CS6038":
        assert told[0].message == (f"names targets up to {max(numbers)}: taken as the planned program numbers them; the "
                                   "corrected one has 2 more and numbers them otherwise from target 2 on")
    elif code:
        assert f"({sum(k in (2, 3) for k in numbers)} row at targets that were added left out)" in told[0].message


@pytest.mark.parametrize(("header", "row", "code"), [
    ("target,fx_n", [1, 2], "CS6020"),
    ("target,dx_um,dn_um", [1, 2, 3], "CS6020"),
    ("target,dx_um", [1, np.nan], "CS6020"),
    ("dx_um", [1], "CS6021"),
    ("path_mm,dx_um", [1, 2], "CS6021"),
    ("target,dz_um", [7000, 2], "CS6023"),
    ("target,dx_um", [1.5, 2], "CS3004"),
    ("target,dn_um,nx,ny,nz", [1, 2, 1, 1, 0], "CS0203"),
    ("target,dx_um,sx_um,sy_um,sz_um", [1, 2, 0, 1, 1], "CS0203"),
])
def test_files_that_cannot_be_compared(
    passes: dict[str, Path], tmp_path: Path, header: str, row: list[float], code: str
) -> None:
    other = csv(tmp_path, "other.csv", header, np.array([row]))
    result = verify(passes["cell"], passes["before"], other)
    assert result.exit_code == 1
    assert f"error {code}" in result.stderr


def test_a_reading_along_a_normal_has_the_mean_variance_of_the_cell_s_axes(passes: dict[str, Path], tmp_path: Path) -> None:
    cell = read_cell(passes["cell"])
    cell = replace(cell, noise=replace(cell.noise, deflection=1e-6 * np.array([1.0, 2.0, 4.0])))
    along, across = (read_readings(csv(tmp_path, "r.csv", f"target,{names}", np.array([row])), cell).sigma
                     for names, row in (("dn_um,nx,ny,nz", [0, 5, 1, 0, 0]), ("dx_um,dy_um,dz_um", [0, 5, 6, 7])))
    np.testing.assert_allclose(1e6 * along, [[np.sqrt(7.0)]])
    np.testing.assert_allclose(1e6 * across, [[1.0, 2.0, 4.0]])


@pytest.mark.parametrize(("noise", "header", "said"), [
    ("4, 1, 1", "target,dx_um,dy_um,dz_um", "no column sx_um sy_um sz_um: {}, 4, 1, 1 um"),
    ("2, 2, 2", "target,dx_um,dy_um,dz_um", "no column sx_um sy_um sz_um: {}, 2 um"),
    ("4, 1, 1", "target,dn_um", "no column sn_um: {}, 2.45 um"),
    ("4, 1, 1", "target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um", ""), ("4, 1, 1", "target,dn_um,sn_um", ""),
    ("4, 1, 1", "target,dx_um,dy_um,dz_um,std_um", "")])
def test_a_sigma_that_is_not_stated_is_the_cells_which_is_said_axis_by_axis(
    tmp_path: Path, noise: str, header: str, said: str
) -> None:
    cell = write_cell(tmp_path, write_cell(tmp_path).read_text() + f"measurement: {{deflection_std_um: [{noise}]}}\n")
    row = [40 + 7 * k for k in range(len(header.split(",")))]
    found = [one for one in read_readings(csv(tmp_path, "p.csv", header, np.array([[0, *row[1:]]])), read_cell(cell)).findings
             if one.code == "CS6025"]
    text = said.format("1 sigma of a reading taken from the cell's measurement.deflection_std_um")
    assert [(one.level, one.message) for one in found] == [("note", text)] * bool(said)


@pytest.mark.parametrize(("header", "rows", "line"), [
    ("target,dx_um", [[0, 1], [1.5, 2], [3, 1], [-1, 2]], 3), ("target,dn_um,nx,ny,nz", [[0, 1, 1, 0, 0], [1, 2, 1, 1, 0]], 3),
    ("target,dn_um,nx,ny,nz", [[0, 1, 1.2, 0, 0], [1, 2, 0.5, 0, 0]], 3)])
def test_the_first_line_that_is_wrong_is_named(
    passes: dict[str, Path], tmp_path: Path, header: str, rows: list[list[float]], line: int,
) -> None:
    with pytest.raises(CompstiffError) as stopped:
        read_readings(csv(tmp_path, "r.csv", header, np.array(rows)), read_cell(passes["cell"]))
    assert stopped.value.findings[0].line == line


def test_a_measured_table_may_have_rows_without_a_place(passes: dict[str, Path], tmp_path: Path) -> None:
    """As they stand where a sheet was made from offsets.csv; not where something was measured there, and by its place."""
    cell = read_cell(passes["cell"])
    (tmp_path / "m.csv").write_text("x_mm,y_mm,z_mm,dx_um\n,,,\n1,2,3,40\n")
    assert read_readings(tmp_path / "m.csv", cell).place.tolist() == [[pytest.approx(x) for x in (0.001, 0.002, 0.003)]]
    (tmp_path / "m.csv").write_text("x_mm,y_mm,z_mm,dx_um\n,,,7\n1,2,3,40\n")
    with pytest.raises(CompstiffError) as stopped:
        read_readings(tmp_path / "m.csv", cell)
    assert (stopped.value.findings[0].code, stopped.value.findings[0].line) == ("CS0203", 2)
    (tmp_path / "m.csv").write_text("target,x_mm,y_mm,z_mm,dx_um\n0,,,,7\n1,1,2,3,40\n")
    assert read_readings(tmp_path / "m.csv", cell).place.tolist() == [[0.0], [1.0]]
    (tmp_path / "m.csv").write_text("target,x_mm,y_mm,z_mm,dx_um,time_s,samples,note\n0,,,,7,0,0,\n1,1,2,3,40,1,5,\n")
    with pytest.raises(CompstiffError, match="CS6039"):
        read_readings(tmp_path / "m.csv", cell)


@pytest.mark.parametrize(("header", "value", "place"), [
    ("path_mm", "12.5", [0.0125]), ("x_mm,y_mm,z_mm", "12.5,-40,3", [0.0125, -0.04, 0.003]), ("target", "7", [7.0])])
def test_places_are_read_in_metres(tmp_path: Path, header: str, value: str, place: list[float]) -> None:
    (tmp_path / "pass.csv").write_text(f"{header},dx_um\n{value},5\n")
    read = read_readings(tmp_path / "pass.csv", read_cell(write_cell(tmp_path)))
    assert (read.place.tolist(), read.key) == ([pytest.approx(place)], header.replace(",", " "))


@pytest.mark.parametrize(("count", "size", "code"), [
    (10, 0.09, "CS6035"), (9, 0.09, ""), (10, 0.11, ""), (10, 2250.0, ""), (10, 2750.0, "CS6036")])
def test_ten_readings_of_a_tenth_of_their_sigma_or_ten_millimetres_are_no_part(tmp_path: Path, count, size, code: str) -> None:
    """Of a sigma of 4 um: 9 and 11 mm are 2250 and 2750 of it."""
    values = 4 * size * (-1.0) ** np.arange(count)
    file = csv(tmp_path, "r.csv", SIGMAS, np.column_stack([np.arange(count), values, *[np.full(count, np.nan)] * 2,
                                                           *[np.full(count, 4.0)] * 3]))
    cell = read_cell(write_cell(tmp_path))
    if not code:
        assert len(read_readings(file, cell)) == count
        return
    with pytest.raises(CompstiffError) as stopped:
        read_readings(file, cell)
    [found] = stopped.value.findings
    assert found.code == code
    assert found.message.startswith("all 10 deviations together are 0.09 times their own 1 sigma" if size < 1
                                    else "deviations of 1.1e+04 um, RMS")


@pytest.mark.parametrize(("shared", "said"), [(4, ""), (3, "only 3 of 40 rows belong to a row of "), (0, "no row belongs")])
def test_two_passes_share_a_tenth_of_the_smaller_ones_places(tmp_path: Path, shared: int, said: str) -> None:
    cell = read_cell(write_cell(tmp_path))
    first, second = (csv(tmp_path, name, "target,dx_um", np.column_stack([targets, np.full(len(targets), 30.0)]))
                     for name, targets in (("b.csv", np.arange(100)), ("a.csv", np.arange(40) + 100 - shared)))
    if not said:
        assert verify_files(cell, first, second).comparison.before.points == shared
        return
    with pytest.raises(CompstiffError) as stopped:
        verify_files(cell, first, second)
    [found] = stopped.value.findings
    assert (found.code, found.file, found.message[:len(said)]) == ("CS6023", str(second), said)
