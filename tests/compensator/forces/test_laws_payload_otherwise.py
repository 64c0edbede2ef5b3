"""The same still readings written otherwise are the same payload: other rows, signs, columns, a sensor and an arm turned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.compensator.forces.test_laws_payload import BIAS, CELL, CENTRE, SENSOR_PLACE, SENSOR_TURN, WRIST, still_log, tare
from tests.runs.command_line import user_files as kit

FORCES = ["fx_n", "fy_n", "fz_n"]


def sensor(turn: kit.Rotation = SENSOR_TURN, place: np.ndarray = SENSOR_PLACE, sign: str = "on_tool") -> str:
    return CELL + (f"{{frame: sensor, sensor_position_mm: {(1e3 * place).tolist()}, "
                   f"sensor_quaternion: {kit.quaternion(turn).tolist()}, sign: {sign}}}")


def table(path: Path) -> tuple[list[str], np.ndarray]:
    return path.read_text().split("\n")[0].split(","), np.loadtxt(path, delimiter=",", skiprows=1)


def written(path: Path, names: list[str], values: np.ndarray, delimiter: str = ",", decimal: str = ".") -> Path:
    lines = [delimiter.join(f"{x:.9f}".replace(".", decimal) for x in row) for row in values]
    path.write_text("\n".join([delimiter.join(names), *lines]) + "\n")
    return path


def figures(said: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """mass and centre (4,), their 1 sigma, bias (6,), its 1 sigma."""
    found = said["result"]
    payload, bias = [found["mass_kg"], *found["centre_of_mass_mm"]], [*found["bias_n"], *found["bias_nm"]]
    mean, std, zero, unsure = ([one[key] for one in each] for each in (payload, bias) for key in ("estimate", "std"))
    return np.array(mean), np.array(std), np.array(zero), np.array(unsure)


def told(folder: Path, still: Path, cell: str) -> tuple[tuple[np.ndarray, ...], list[str]]:
    code, said = tare(folder, still, cell)
    assert code == 0, said
    return figures(said), sorted(finding["code"] for finding in said["findings"])


TURN = kit.Rotation.from_euler("zyx", [-70, 25, 110], degrees=True)


@pytest.mark.parametrize("how", [
    "time column", "semicolons", "columns turned round", "kilonewtons", "reaction", "another turn of axis 1",
    "orientations in another order", "spindle speed in the cell", "sensor turned", "sensor's origin elsewhere"])
def test_the_payload_hangs_on_nothing_but_the_weight(tmp_path: Path, how: str) -> None:
    still = still_log(tmp_path, np.random.default_rng(7), samples=12)
    (payload, std, bias, bias_std), codes = told(tmp_path, still, sensor())
    names, rows = table(still)
    cell, expected = sensor(), bias
    delimiter, decimal = ",", "."
    if how == "time column":
        names, rows = ["time_s", *names], np.column_stack([0.01 * np.arange(len(rows)), rows])
    elif how == "semicolons":
        delimiter, decimal = ";", ","
    elif how == "columns turned round":
        names, rows = names[::-1], rows[:, ::-1]
    elif how == "kilonewtons":
        names = [name.replace("_n", "_counts") if name in FORCES else name for name in names]
        rows[:, 6:9], cell = 1e-3 * rows[:, 6:9], sensor().replace("sign:", "counts_per_n: 1e-3, sign:")
    elif how == "reaction":
        rows[:, 6:], cell, expected = -rows[:, 6:], sensor(sign="by_tool"), -bias
    elif how == "another turn of axis 1":
        rows[:, 0] -= 87.0
    elif how == "orientations in another order":
        blocks = np.split(rows, np.flatnonzero(np.any(np.abs(np.diff(rows[:, :6], axis=0)) > 1.0, axis=1)) + 1)
        long = [block for block in blocks if len(block) > 2]
        assert len(long) == len(WRIST)
        rows = np.vstack(long[::-1])
        codes = [code for code in codes if code != "CS3038"]
    elif how == "spindle speed in the cell":                      # of programs that cut; a turn of it is 20 samples
        cell = sensor().replace("sign:", "rate_hz: 200, spindle_rpm: 600, sign:")
    elif how == "sensor turned":
        rows[:, 6:] = np.hstack([TURN.inv().apply(rows[:, 6:9]), TURN.inv().apply(rows[:, 9:])])
        cell = sensor(SENSOR_TURN * TURN)
        expected = np.concatenate([TURN.inv().apply(bias[:3]), TURN.inv().apply(bias[3:])])
    else:
        away = np.array([0.006, -0.012, 0.01])                     # in the sensor's axes; its moments have other noise
        rows[:, 9:] -= np.cross(away, rows[:, 6:9])
        cell = sensor(place=SENSOR_PLACE + SENSOR_TURN.apply(away))
        expected = np.concatenate([bias[:3], bias[3:] - np.cross(away, bias[:3])])
    (other, other_std, other_bias, other_bias_std), other_codes = told(
        tmp_path, written(tmp_path / "other.csv", names, rows, delimiter, decimal), cell)
    assert other_codes == codes
    noisier = np.concatenate([[0], std[1:]]) if "elsewhere" in how else np.zeros(4)
    assert (np.abs(other - payload) <= 1e-4 * np.abs(payload) + 1e-3 + noisier).all()
    assert_allclose(other_bias, expected, atol=2e-3 if "elsewhere" not in how else bias_std.max())
    assert np.abs(other[1:] - 1e3 * CENTRE).max() < 5 * other_std[1:].max()
    assert np.abs(bias - BIAS).max() < 5 * bias_std.max()
    if "sensor" not in how:
        assert_allclose(other_std, std, rtol=1e-3)
        assert_allclose(other_bias_std, bias_std, rtol=1e-3)


@pytest.mark.parametrize("keys", [
    "rate_hz: 200", "gain_std: 0.02, mounting_std_deg: 1", "saturation_n: 5000, saturation_nm: 5000",
    "spindle_rpm: 600, rate_hz: 50",
    "payload: {mass_kg: 12.4, centre_of_mass_mm: [12, -8, 143]}, weight: removed", "bias_n: [14, -31, 55], bias_nm: [1, 1, 1]",
    "target: ahead", "position_late_ms: 0"])
def test_what_the_cell_says_of_logs_of_programs_is_nothing_to_still_readings(tmp_path: Path, keys: str) -> None:
    still = still_log(tmp_path, np.random.default_rng(8), samples=12)
    plain, codes = told(tmp_path, still, sensor())
    other, other_codes = told(tmp_path, still, sensor().replace("sign:", f"{keys}, sign:"))
    for one, two in zip(other, plain, strict=True):
        assert_allclose(one, two, rtol=1e-9)
    assert other_codes == codes
