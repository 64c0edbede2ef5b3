"""Numbers of absurd size in any file: refused where they stand, before anything overflows; and no input is a defect.

The long form with more input is benchmarks/unbreakable.py.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from benchmarks import unbreakable
from identification.common.findings import CompstiffError
from identification.fit.own_noise import inverse_of_three
from identification.measurements import read_measurements
from identification.model.cell import read_cell
from identification.model.stiffness_file import read_stiffness
from tests.runs.command_line import user_files as kit

FILES = unbreakable.sound_files()


def read_all(folder: Path) -> None:
    cell = read_cell(folder / "cell.yaml")
    read_measurements(folder / "measurements.csv", cell.robot)
    read_stiffness(folder / "stiffness.json", cell)


def found(folder: Path, name: str, before: str, after: str) -> tuple[str, int | None, int | None, str]:
    """Code, place and words of what is said to one number changed."""
    for file, text in FILES.items():
        (folder / file).write_text(text.replace(before, after, 1) if file == name else text)
    assert before in FILES[name]
    with pytest.raises(CompstiffError) as caught:
        read_all(folder)
    first = caught.value.findings[0]
    return first.code, first.line, first.column, first.message


@pytest.mark.parametrize(("before", "after", "at", "says"), [
    ("quaternion: [1, 0, 0, 0], mass", "quaternion: [1e300, 0, 0, 0], mass", "1e300",
     "must be at most 1e+12 in size; found 1e+300"),
    ("[900, 50, 400]", "[900, 50, 1e160]", "1e160", "found 1e+160"),
    ("deflection_std_um: [2,", "deflection_std_um: [1e-320,", "1e-320", "must be at least 1e-12"),
    ("force_std_n: [1,", "force_std_n: [1e-320,", "1e-320", "must be zero, or at least 1e-12"),
    ("0.22e6", "1e-12", "1e-12", "must be greater than zero, 0.001 to 1e+20 N m/rad"),
    ("relative_std: 2.0", "relative_std: 1e300", "relative_std", "at most 1e+12"),
    ("reach_mm: [600, 1700]", "reach_mm: [600, 1e300]", "1e300", "at most 1e+12"),
])
def test_the_cell_file(tmp_path, before, after, at, says):
    code, line, column, message = found(tmp_path, "cell.yaml", before, after)
    lines = FILES["cell.yaml"].replace(before, after, 1).split("\n")
    number = next(k for k, text in enumerate(lines, 1) if after in text)
    assert (code, line, column) == ("CS0102", number, lines[number - 1].index(at) + 1)
    assert says in message


@pytest.mark.parametrize(("before", "after", "says"), [
    ("{max_offset_mm: 2.0, max_tilt_deg: 0.5}", "5", "'limits': must have keys of its own, such as {key: value}; found 5"),
    ("max_offset_mm: 2.0,", "max_offset_mm: two,", "'limits.max_offset_mm': must be a plain number, without a unit; found"),
    ("deflection_std_um: [2, 2, 2]", "deflection_std_um: 2.5", "must be a list in square brackets, such as [120, 0, 250]"),
])
def test_what_was_expected_is_said(tmp_path, before, after, says):
    assert says in found(tmp_path, "cell.yaml", before, after)[3]


ROW = FILES["measurements.csv"].split("\n")[1]


@pytest.mark.parametrize(("cell", "value", "code", "says"), [
    (6, "1e300", "CS0203", "column 'fx_n': found '1e+300', expected a finite number up to 1e+19 in size"),
    (6, "1e12", "CS1080", "column 'fx_n': found 1e+12, the limit is 1e+09"),
    (9, "-1e308", "CS0203", "up to 1e+19"),
    (9, "nan", "CS0203", "expected a finite number"),
])
def test_measurements(tmp_path, cell, value, code, says):
    cells = ROW.split(",")
    cells[cell] = value
    told = found(tmp_path, "measurements.csv", ROW, ",".join(cells))
    assert told[:3] == (code, 2, cell + 1)
    assert says in told[3]


def test_a_sigma_of_nothing(tmp_path):
    text = FILES["measurements.csv"].replace("dz_um\n", "dz_um,sx_um,sy_um,sz_um\n").replace("\n", ",1,1,1\n").replace(
        "sz_um,1,1,1", "sz_um").replace(",1,1,1", ",1e-12,1,1", 1)
    (tmp_path / "m.csv").write_text(text)
    (tmp_path / "cell.yaml").write_text(FILES["cell.yaml"])
    with pytest.raises(CompstiffError, match="CS1003.*must be greater than zero, at least 1e-09"):
        read_measurements(tmp_path / "m.csv", read_cell(tmp_path / "cell.yaml").robot)


def test_stiffness_files(tmp_path):
    text = FILES["stiffness.json"]
    estimate = re.findall(r'"estimate": ([\d.e+]+)', text)[1]
    variance = re.findall(r'"covariance": \[\[([\d.e+]+)', text)[0]
    for before, after, says in (
        (f'"estimate": {estimate}', '"estimate": 1e-320', "k2: a stiffness of 9.99989e-321 N m/rad"),
        (f'"estimate": {estimate}', '"estimate": 1e300', "k2: a stiffness of 1e+300 N m/rad"),
        (f"[[{variance}", "[[1e308", "covariance holds 1e+308, at most 1e+60"),
        (", 0.0,", ", 1e59,", "larger than its variances allow"),
    ):
        code, _, _, message = found(tmp_path, "stiffness.json", before, after)
        assert code == "CS1203"
        assert says in message


def test_a_force_error_beyond_what_a_double_holds_is_refused_at_its_row(tmp_path):
    rows = FILES["measurements.csv"].split("\n")
    cells = rows[4].split(",")
    cells[6] = "3e8"
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "measurements.csv").write_text("\n".join([*rows[:4], ",".join(cells), *rows[5:]]))
    result = kit.run("identify", tmp_path / "cell.yaml", tmp_path / "measurements.csv", "-o", tmp_path / "k.json")
    assert result.code == 1
    assert "measurements.csv:5: error CS1081" in result.err


def test_inverse_and_determinant_hold_where_one_direction_is_very_much_noisier():
    """I + r^2 v v^T has the determinant 1 + r^2 and the inverse I - r^2 v v^T / (1 + r^2)."""
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    outer = direction[:, :, None] * direction[:, None, :]
    for ratio, off in ((1.0, 1e-14), (1e4, 1e-6), (1e6, 1e-3)):
        inverse, determinant = inverse_of_three(np.eye(3) + ratio**2 * outer)
        np.testing.assert_allclose(determinant, 1 + ratio**2, rtol=off)
        np.testing.assert_allclose(inverse, np.eye(3) - outer * ratio**2 / (1 + ratio**2), atol=off)


@pytest.mark.parametrize("command", ["correct", "predict", "post"])
def test_no_input_is_a_defect(tmp_path, command):
    """Twenty spoilt files each: an answer, and no warning."""
    names, words = unbreakable.COMMANDS[command]
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    rng = np.random.default_rng(len(command))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for turn in range(20):
            name = names[turn % len(names)]
            what, content = unbreakable.spoilt(FILES[name], rng)
            (tmp_path / name).write_bytes(content)
            result = kit.run(*(tmp_path / word[1:] if word.startswith("@") else word for word in words), "--json", "--force")
            (tmp_path / name).write_text(FILES[name])
            assert result.code in (0, 1, 3), (name, what, result)
            assert "Warning" not in result.err, (name, what, result.err)
