"""Reading measurements: every promised complaint, with its line and column, and what is accepted."""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from identification.common.findings import CompstiffError
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from tests.support import CELL, robot, write_cell

HEADER = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um"
ROW = "10,5,20,30,60,40,0,100,0,1.5,210.25,-3"


def read(folder: Path, *lines: str, encoding: str = "utf-8", end: str = "\n"):
    path = folder / "measurements.csv"
    path.write_bytes(end.join(lines).encode(encoding) + end.encode())
    return read_measurements(path, robot())


def complaint(folder: Path, *lines: str):
    with pytest.raises(CompstiffError) as caught:
        read(folder, *lines)
    return caught.value.findings[0]


def test_the_file_they_are_of_is_kept(tmp_path) -> None:
    rows = read(tmp_path, HEADER, ROW)
    content = (tmp_path / "measurements.csv").read_bytes()
    assert rows.made_from == ({"file": "measurements.csv", "sha256": hashlib.sha256(content).hexdigest()},)


def test_units_and_defaults(tmp_path) -> None:
    rows = read(tmp_path, HEADER, ROW)
    assert_allclose(rows.theta[0], np.radians([10, 5, 20, 30, 60, 40]))
    assert_allclose(rows.wrench[0], [0, 100, 0, 0, 0, 0])
    assert_allclose(rows.deflection[0], [1.5e-6, 210.25e-6, -3e-6])
    assert np.isnan(rows.sigma).all()
    assert not rows.validate.any()
    assert rows.line.tolist() == [2]


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), ("\t", ","), (";", "."), ("\t", "."), (",", ".")])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_spellings_of_csv(tmp_path, separator: str, decimal: str, end: str, encoding: str) -> None:
    def spell(line: str) -> str:
        return separator.join(cell.replace(".", decimal) for cell in line.split(","))

    rows = read(tmp_path, "# a comment, with a comma", spell(HEADER), "", spell(ROW), "  # another", spell(ROW),
                encoding=encoding, end=end)
    assert_allclose(rows.deflection, 1e-6 * np.array([[1.5, 210.25, -3]] * 2))
    assert rows.line.tolist() == [4, 6]


def test_parquet(tmp_path) -> None:
    values = [float(x) for x in ROW.split(",")]
    pd.DataFrame([values, values], columns=HEADER.split(",")).to_parquet(tmp_path / "m.parquet")
    rows = read_measurements(tmp_path / "m.parquet", robot())
    assert_allclose(rows.deflection[1], [1.5e-6, 210.25e-6, -3e-6])


def test_pose_visits(tmp_path) -> None:
    poses = ["A", "A", "B", "A", "A"]
    rows = read(tmp_path, HEADER + ",pose", *(f"{ROW},{pose}" for pose in poses))
    assert rows.visit.tolist() == [0, 0, 1, 2, 2]
    moved = ROW.replace("10,5", "11,5")
    assert read(tmp_path, HEADER, ROW, ROW, moved, ROW).visit.tolist() == [0, 0, 1, 2]


def test_rows_followed_by_others_stay_selectable(tmp_path) -> None:
    """Validate is a mask before and after: an integer array in its place would pick rows by number."""
    rows = read(tmp_path, HEADER + ",purpose", ROW + ",identify", ROW + ",validate")
    both = rows.followed_by(rows)
    assert both.select(~both.validate).row.tolist() == [1, 3]
    assert both.visit.tolist() == [0, 0, 1, 1]


def test_components_that_were_not_measured(tmp_path) -> None:
    rows = read(tmp_path, HEADER, "10,5,20,30,60,40,0,100,0,,210,")
    assert np.isnan(rows.deflection[0]).tolist() == [True, False, True]
    assert [finding.code for finding in rows.findings] == ["CS1007"]


def test_a_row_without_a_load_may_have_no_reading(tmp_path) -> None:
    rows = read(tmp_path, HEADER, ROW, "10,5,20,30,60,40,0,0,0,,,", "10,5,20,30,60,40,0,0,0,0,0,0")
    assert np.isnan(rows.deflection).all(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize(("lines", "code", "line", "column", "words"), [
    (["# c", HEADER.replace("fz_n", "f_n"), ROW], "CS0202", 2, None, "missing: fz_n"),
    ([HEADER + ",fx_n", ROW + ",1"], "CS0202", 1, None, "twice: fx_n"),
    ([HEADER, ROW, ROW.replace("100", "hundred")], "CS0203", 3, 8, "'hundred'"),
    ([HEADER, ROW, ROW.replace("100", "nan")], "CS0203", 3, 8, "'nan'"),
    ([HEADER, ROW, ROW.replace("100", "inf")], "CS0203", 3, 8, "'inf'"),
    ([HEADER, ROW, ROW.replace("100", "")], "CS0203", 3, 8, "an empty cell"),
    ([HEADER, ROW + ",7"], "CS0201", 2, None, "13 cells"),
    ([HEADER, "# c", "200" + ROW[2:]], "CS1002", 3, 1, "joint 1 at 200 deg"),
    ([HEADER, "10,-40,100,30,60,40,0,100,0,1,2,3"], "CS1002", 2, 3, "window -70 to 70"),
    ([HEADER, "10,5,20,30,60,40,0,100,0,,,"], "CS1004", 2, 10, "no deflection"),
    ([HEADER, ROW.replace("100", "0")], "CS1005", None, None, "none of the 1 rows"),
    ([HEADER, "10,5,20,30,60,40,0,100,0,0.3,1820000,5"], "CS1006", 2, None, "1820 mm"),
    ([HEADER + ",purpose", ROW + ",test"], "CS1001", 2, 13, "'test'"),
    ([HEADER + ",sx_um,sy_um,sz_um", ROW + ",1,0,1"], "CS1003", 2, 14, "greater than zero"),
    ([""], "CS0201", 1, None, "empty"),
])
def test_complaints(tmp_path, lines, code, line, column, words) -> None:
    finding = complaint(tmp_path, *lines)
    assert (finding.code, finding.line, finding.column) == (code, line, column)
    assert words in finding.message
    assert finding.file
    assert finding.file.endswith("measurements.csv")


@pytest.mark.parametrize(("header", "row", "code", "column", "message"), [
    (HEADER, "10,5,20,30,60,40,0,100,0,{},-50000,5", "CS1006", None, "a deflection of {:.4g} mm, the limit is 50 mm"),
    (HEADER, "10,5,20,30,60,40,0,100,0,5,{},", "CS1006", None, "a deflection of {:.4g} mm, the limit is 50 mm"),
    (HEADER, "10,5,20,30,60,40,0,{},0,1,2,3", "CS1080", 8, "column 'fy_n': found {:g}, the limit is 1e+09"),
    (HEADER + ",mx_nm,my_nm,mz_nm", ROW + ",0,0,{}", "CS1080", 15, "column 'mz_nm': found {:g}, the limit is 1e+09")])
@pytest.mark.parametrize("sign", [1, -1])
def test_sizes_that_cannot_be_right_are_refused_beyond_their_limit(tmp_path, header, row, code, column, message, sign) -> None:
    """At it, and without a word, they are read."""
    limit = sign * (50e3 if code == "CS1006" else 1e9)
    assert len(read(tmp_path, header, ROW + header.removeprefix(HEADER).count(",") * ",0", row.format(limit))) == 2
    beyond = limit * 1.2
    found = complaint(tmp_path, header, ROW + header.removeprefix(HEADER).count(",") * ",0", row.format(beyond))
    assert (found.code, found.line, found.column) == (code, 3, column)
    assert found.message == message.format(abs(1e-3 * beyond) if code == "CS1006" else beyond)


def test_all_places_at_fault_are_named(tmp_path) -> None:
    with pytest.raises(CompstiffError) as caught:
        read(tmp_path, HEADER, ROW.replace("100", "x"), ROW, ROW.replace("1.5", "y"))
    assert [(finding.line, finding.column) for finding in caught.value.findings] == [(2, 8), (4, 10)]


def test_not_text(tmp_path) -> None:
    path = tmp_path / "m.csv"
    path.write_bytes(b"q1_deg\n\xff\xfe")
    with pytest.raises(CompstiffError, match="CS0201.*UTF-8"):
        read_measurements(path, robot())
    (tmp_path / "m.parquet").write_bytes(b"not parquet")
    with pytest.raises(CompstiffError, match="CS0201.*Parquet"):
        read_measurements(tmp_path / "m.parquet", robot())


HUNG = HEADER.replace("fx_n,fy_n,fz_n", "mass_kg")
HUNG_ROW = "10,5,20,30,60,40,25,1.5,210.25,-3"


def cell_on_a_wall(folder: Path):
    """Base z level, base x up: weights pull along base -x."""
    return read_cell(write_cell(folder, CELL + "base_frame: {quaternion: [0.70710678, 0, -0.70710678, 0]}\n"))


def test_hung_masses_pull_down_whatever_way_the_base_stands(tmp_path) -> None:
    path = tmp_path / "measurements.csv"
    path.write_text("\n".join([HUNG, HUNG_ROW, HUNG_ROW.replace(",25,", ",-10,"), HUNG_ROW.replace(",25,", ",0,")]) + "\n")
    upright = read_measurements(path, read_cell(write_cell(tmp_path)))
    assert_allclose(upright.wrench[:, :3], np.outer([25, -10, 0], [0, 0, -9.80665]), atol=1e-12)
    on_a_wall = read_measurements(path, cell_on_a_wall(tmp_path))
    assert_allclose(on_a_wall.wrench[:, :3], np.outer([25, -10, 0], [-9.80665, 0, 0]), atol=1e-6)
    assert_allclose(upright.wrench[:, 3:], 0)


def test_masses_and_forces_in_one_file(tmp_path) -> None:
    path = tmp_path / "measurements.csv"
    path.write_text(f"{HEADER},mass_kg\n{ROW},\n{ROW.replace('0,100,0', ',,')},20\n")
    rows = read_measurements(path, read_cell(write_cell(tmp_path)))
    assert_allclose(rows.wrench[:, :3], [[0, 100, 0], [0, 0, -196.133]])
    path.write_text(f"{HEADER}\n{ROW}\n")
    forces = read_measurements(path, read_cell(write_cell(tmp_path)))
    assert forces.hung is None
    assert (rows.weights, forces.weights, rows.select(rows.hung).weights) == ((), (), ("--dead-weight", "20"))
    assert (rows.began, forces.began) == (0.0, 0.0)
    both = rows.followed_by(forces).hung, forces.followed_by(rows).hung
    assert [each is not None and each.tolist() for each in both] == [[False, True, False], [False, False, True]]
    assert forces.followed_by(forces).hung is None


@pytest.mark.parametrize(("lines", "code", "line", "words"), [
    ([HEADER + ",mass_kg", ROW + ",20"], "CS1508", 2, "a mass and a force: which of them acted?"),
    ([HEADER + ",mass_kg", ROW + ",", ROW.replace("0,100,0", ",,5") + ",20"], "CS1508", 3, "a mass and a force: which of them"),
    ([HEADER + ",mass_kg", ROW.replace("0,100,0", "5,,5") + ",", ROW + ","], "CS1508", 2,
     "neither a mass nor all three of fx_n fy_n fz_n"),
    ([HEADER + ",mass_kg", ROW + ",", ROW.replace("0,100,0", ",100,0") + ","], "CS1508", 3, "neither a mass nor"),
    ([HUNG, HUNG_ROW, HUNG_ROW.replace(",25,", ",,")], "CS1508", 3, "neither a mass nor"),
    ([HUNG, HUNG_ROW.replace(",25,", ",25000,")], "CS1510", 2, "25000 kg"),
    ([HUNG, HUNG_ROW.replace(",25,", ",heavy,")], "CS0203", 2, "'heavy'"),
    ([HUNG, HUNG_ROW.replace(",25,", ",0,")], "CS1005", None, "none of the 1 rows"),
    ([HEADER.replace(",fz_n", ",mass_kg"), ROW], "CS0202", 1, "without fz_n"),
])
def test_complaints_about_masses(tmp_path, lines, code, line, words) -> None:
    path = tmp_path / "measurements.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(CompstiffError) as caught:
        read_measurements(path, read_cell(write_cell(tmp_path)))
    (finding,) = caught.value.findings
    assert finding.code == code
    assert words in finding.message
    assert finding.line == line
    mass = lines[0].split(",").index("mass_kg") + 1
    assert code not in ("CS1508", "CS1510") or (finding.column, finding.level) == (mass, "error")


@pytest.mark.parametrize(("mass", "said"), [(5000, False), (-5000, False), (5001, True), (-5001, True)])
def test_a_mass_beyond_five_tonnes_is_in_another_unit(tmp_path, mass, said) -> None:
    path = tmp_path / "measurements.csv"
    path.write_text("\n".join([HUNG, HUNG_ROW, HUNG_ROW.replace(",25,", f",{mass},")]) + "\n")
    cell = read_cell(write_cell(tmp_path))
    if not said:
        assert_allclose(read_measurements(path, cell).wrench[1, 2], -9.80665 * mass)
        return
    with pytest.raises(CompstiffError) as caught:
        read_measurements(path, cell)
    (found,) = caught.value.findings
    assert (found.code, found.line, found.column, found.message) == (
        "CS1510", 3, 7, f"a mass of {mass} kg, the limit is 5000")


def test_masses_without_a_cell_are_refused(tmp_path) -> None:
    """A column of masses that no row fills asks for none: all loads are forces."""
    assert complaint(tmp_path, HUNG, HUNG_ROW).code == "CS1509"
    assert_allclose(read(tmp_path, HEADER + ",mass_kg", ROW + ",").wrench[0, :3], [0, 100, 0])


def up_and_down(step: float, visits: int = 6) -> list[str]:
    """Cycles of 20, 40, 60, 40, 20 kg at poses of their own, read to `step` [um]: on the way down as on the way up."""
    rng = np.random.default_rng(3)
    rows = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,mass_kg,dx_um,dy_um,dz_um"]
    for _ in range(visits):
        q, soft = np.append(rng.uniform([-60, -10, 0, -40, 30], [60, 30, 40, 40, 80]), 10.0), rng.uniform(-8, 8, 3)
        for mass in (20, 40, 60, 40, 20):
            read = np.round((soft * mass + rng.normal(0, 0.05, 3)) / step) * step
            rows.append(",".join(f"{value:.9g}" for value in (*q, mass, *read)))
    return rows


def test_coarse_gauges_read_alike_up_and_down_and_a_copy_is_still_found(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    cell = read_cell(tmp_path / "cell.yaml")

    def codes(rows: list[str]) -> set[str]:
        (tmp_path / "m.csv").write_text("\n".join(rows) + "\n")
        return {finding.code for finding in read_measurements(tmp_path / "m.csv", cell).findings}

    coarse = up_and_down(10.0, visits=20)       # so many that some of their angles are nearly alike
    assert len(set(coarse)) < len(coarse), "readings do repeat"
    assert "CS0012" not in codes(coarse)
    assert "CS0012" in codes([*coarse, *coarse[1:]])
    stuck = [coarse[0], *(row.rsplit(",", 3)[0] + ",70,70,70" for row in coarse[1:])]
    assert "CS0012" in codes(stuck), "one reading says nothing of a gauge's steps"
    fine = up_and_down(0.01)
    assert "CS0012" not in codes(fine)
    assert "CS0012" in codes([*fine, *[row for row in fine[1:6] for _ in range(2)]])
    # Copied where they stand: of gauges that show half a micrometre or less that is no chance, of coarser ones it may be.
    for step, told in ((0.01, True), (0.49, True), (0.51, False), (10.0, False)):
        rows = up_and_down(step)
        assert ("CS0012" in codes([rows[0], *(row for row in rows[1:] for _ in range(2))])) == told, step


@pytest.mark.parametrize("code", ["CS0012", "CS1025"])
@pytest.mark.parametrize(("loaded", "alike", "told"), [(20, 2, False), (20, 3, True), (30, 3, True), (31, 3, False)])
def test_three_rows_that_cannot_be_and_a_tenth_of_all_are_told(
    tmp_path: Path, code: str, loaded: int, alike: int, told: bool,
) -> None:
    """Copies of the first row, or rows in which nothing moved; rows without a load count for neither."""
    rng = np.random.default_rng(loaded)
    rows = [",".join(f"{value:.3f}" for value in (*rng.uniform(10, 40, 6), 0, 100, 0, *rng.normal(0, 50, 3)))
            for _ in range(loaded - alike)]
    bad = rows[:1] * alike if code == "CS0012" else [row.rsplit(",", 3)[0] + ",0,0,0" for row in rows[:alike]]
    unloaded = [row.replace(",100.000,", ",0,") for row in rows]
    findings = read(tmp_path, HEADER, *rows, *bad, *unloaded).findings
    assert (code in {finding.code for finding in findings}) == told


def test_weights_are_named_to_ten_grams(tmp_path: Path) -> None:
    path = tmp_path / "measurements.csv"
    rows = [HUNG_ROW.replace(",25,", f",{mass},") for mass in (0, 12.346, 12.354, 12.356, 0)]
    path.write_text("\n".join([HUNG, *rows]) + "\n")
    assert read_measurements(path, read_cell(write_cell(tmp_path))).weights == ("--dead-weight", "12.35,12.36")


@pytest.mark.parametrize("count", [1, 6, 7])
def test_up_to_six_weights_are_named_each_once(tmp_path: Path, count: int) -> None:
    """More masses are the same ones, each weighed with its hook."""
    path, masses = tmp_path / "measurements.csv", [10 * k for k in range(1, count + 1)]
    rows = [HUNG_ROW.replace(",25,", f",{mass},") for mass in (0, *masses, *masses[::-1], 0)]
    path.write_text("\n".join([HUNG, *rows]) + "\n")
    read_in = read_measurements(path, read_cell(write_cell(tmp_path)))
    assert read_in.weights == (("--dead-weight", ",".join(map(str, masses))) if count <= 6 else ())
    assert read_in.select(~read_in.wrench.any(axis=1)).weights == ()


@pytest.mark.parametrize("text", ["{}\n", "{}", "# a note\n{}\n\n# nothing yet\n", "{}\r\n"])
def test_a_header_alone_is_an_empty_sheet(tmp_path, text):
    names = [*(f"q{i}_deg" for i in range(1, 7)), "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um"]
    (tmp_path / "measurements.csv").write_bytes(text.format(",".join(names)).encode())
    with pytest.raises(CompstiffError) as stopped:
        read_measurements(tmp_path / "measurements.csv", robot())
    assert (stopped.value.findings[0].code, "0 rows" in stopped.value.findings[0].message) == ("CS1005", True)
    assert "the sheet is empty" in stopped.value.findings[0].hint


def timed(folder: Path, *times: tuple[float, str]):
    """Rows with these times and references, and the codes of what is said of the file."""
    rows = read(folder, f"{HEADER},time_s,reference", *(f"{ROW.replace('1.5', str(n))},{time:g},{reference}"
                                                        for n, (time, reference) in enumerate(times)))
    return rows, [finding.code for finding in rows.findings]


@pytest.mark.parametrize(("times", "running", "said"), [
    # From each zero reading; over the whole measurement; over each of two days; each visit of one reading.
    ([(40, "A"), (80, "A"), (40, "B"), (90, "B"), (30, "C")], [40, 80, 120, 170, 200], ["CS1028"]),
    ([(40, "A"), (80, "A"), (140, "B"), (190, "B"), (250, "C")], [40, 80, 140, 190, 250], []),
    ([(40, "A"), (80, "A"), (140, "B"), (20, "C"), (60, "D")], [40, 80, 140, 160, 200], ["CS1028"]),
    ([(40, "A"), (40, "B"), (40, "C"), (40, "D"), (40, "E")], [40, 80, 120, 160, 200], ["CS1028"]),
    # Of a clock that counts minutes two rows have the same one.
    ([(0, "A"), (60, "A"), (60, "B"), (120, "B"), (120, "C")], [0, 60, 60, 120, 120], []),
    ([(60, "A"), (120, "B"), (120, "C"), (180, "C"), (240, "D")], [60, 120, 120, 180, 240], []),
    ([(60, "A"), (60, "A"), (60, "A"), (90, "B"), (90, "B")], [60, 60, 60, 90, 90], []),
    # Within a reference that is a mistake, and stays as it is written.
    ([(40, "A"), (20, "A"), (60, "A"), (90, "B"), (120, "B")], [40, 20, 60, 90, 120], ["CS1008"]),
])
def test_time_runs_on_where_the_clock_begins_anew(tmp_path: Path, times, running, said) -> None:
    rows, codes = timed(tmp_path, *times)
    assert_allclose(rows.time, running)
    assert codes == said
    for finding in rows.findings:
        if finding.code == "CS1008":
            assert (finding.level, finding.line, finding.column) == ("warning", 3, 13)
        if finding.code == "CS1028":
            later = [k for k in range(1, len(times)) if times[k][1] != times[k - 1][1]]
            shift = [there - read for there, (read, _) in zip(running, times, strict=True)]
            anew = [k for k in later if shift[k] > shift[k - 1]]
            assert finding.message == (f"time_s begins anew at {len(anew)} of {len(later)} later references: each was taken "
                                       "to follow right after the reading before it")
            assert (finding.level, finding.line, finding.column) == ("note", 2 + anew[0], 13)


def test_what_is_wrong_is_told_in_the_order_of_the_lines(tmp_path: Path) -> None:
    """Whatever is wrong there; twenty of them are enough."""
    beyond, unknown = ROW.replace("10,", "999,") + ",identify", f"{ROW},guess"
    with pytest.raises(CompstiffError) as caught:
        read(tmp_path, f"{HEADER},purpose", beyond, f"{ROW},identify", unknown, beyond, unknown)
    assert [finding.line for finding in caught.value.findings] == [2, 4, 5, 6]
    with pytest.raises(CompstiffError) as caught:
        read(tmp_path, f"{HEADER},purpose", *[unknown] * 25)
    assert len(caught.value.findings) == 20


def test_rows_that_follow_have_visits_references_and_numbers_of_their_own(tmp_path: Path) -> None:
    header, *rows = up_and_down(0.01, visits=2)
    (tmp_path / "cell.yaml").write_text("robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n")
    (tmp_path / "m.csv").write_text("\n".join([header, *rows]) + "\n")
    one = read_measurements(tmp_path / "m.csv", read_cell(tmp_path / "cell.yaml"))
    both, count = one.followed_by(one), len(one)
    assert len(both) == 2 * count
    for name in ("visit", "reference", "row"):
        own, following = getattr(both, name)[:count], getattr(both, name)[count:]
        assert np.array_equal(own, getattr(one, name))
        assert following.min() == own.max() + 1, name
        assert np.array_equal(following - following.min(), own - own.min())
    assert_allclose(both.deflection, np.vstack([one.deflection, one.deflection]))


def test_rows_that_follow_count_on_from_the_last_of_each(tmp_path: Path) -> None:
    """Three references and poses of the first, two of the second, which does not begin at the first line either."""
    header = f"{HEADER},time_s,reference,pose"
    first, second = ((40, "A"), (90, "B"), (70, "B"), (130, "C")), ((10, "A"), (25, "B"))
    one = read(tmp_path, header, *(f"{ROW},{time},{name},{name}1" for time, name in first))
    two = read(tmp_path, "# of another day", header, *(f"{ROW},{time},{name},{name}2" for time, name in second))
    both = one.followed_by(two)
    assert both.reference.tolist() == [0, 1, 1, 2, 3, 4]
    assert both.visit.tolist() == [0, 1, 1, 2, 3, 4]
    assert both.row.tolist() == [1, 2, 3, 4, 5, 6]
    assert both.line.tolist() == [2, 3, 4, 5, 5 + 3, 5 + 4]
    assert_allclose(both.time, [40, 90, 70, 130, 140, 155])
    assert both.pose.tolist() == ["A1", "B1", "B1", "C1", "A2", "B2"]
    assert (both.source, both.sha256, both.began) == (one.source, "", 40.0)
    some = both.select(np.array([False, True, False, True, False, True]))
    assert (some.reference.tolist(), some.line.tolist(), some.pose.tolist()) == ([1, 2, 4], [3, 5, 9], ["B1", "C1", "B2"])
    # A table without times has none afterwards, and leaves the others' as they are.
    timeless = read(tmp_path, HEADER, ROW)
    assert_allclose(timeless.followed_by(two).time, [np.nan, 10, 25])


def test_a_weight_is_told_by_its_pull_alone(tmp_path: Path) -> None:
    """Not by the moment that a row states beside it."""
    path = tmp_path / "measurements.csv"
    rows = [HUNG_ROW.replace(",25,", f",{mass},") + f",{moment},0,{-2 * moment}"
            for mass, moment in ((0, 0), (12.3, 40), (20, 9))]
    path.write_text("\n".join([f"{HUNG},mx_nm,my_nm,mz_nm", *rows]) + "\n")
    read_in = read_measurements(path, read_cell(write_cell(tmp_path)))
    assert read_in.wrench[1, 3:].tolist() == [40, 0, -80]
    assert read_in.weights == ("--dead-weight", "12.3,20")
