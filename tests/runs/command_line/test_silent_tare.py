"""`tare` with still readings of the virtual arm, right, and with the mistakes that are made of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import TOOL, workshop
from tests.virtual_cell.arm import ARMS

ROBOT, MASS, CENTRE = "irb6700-200-2.60", 12.4, np.array([0.0, 0, 0.08])
NAMES = [*(f"q{i}_deg" for i in range(1, 7)), *(f"f{axis}_n" for axis in "xyz"), *(f"m{axis}_nm" for axis in "xyz")]
Stills = tuple[np.ndarray, np.ndarray, np.ndarray]
Change = Callable[[np.ndarray, np.ndarray, np.ndarray], Stills]


def stills(seed: int) -> Stills:
    """Ten readings at each of six orientations: angles (60, 6) [deg], forces and moments (60, 3) in the tool's frame."""
    rng = np.random.default_rng((3048, seed))
    angles = np.array([[8 * k, 5.0, 20.0, 30 + 20 * k, (-1) ** k * (30 + 10 * k), 20.0 * k] for k in range(6)])
    angles = np.repeat(np.round(angles + rng.uniform(-5, 5, (6, 6)), 3), 10, axis=0)
    turns = np.array([kit.tcp_pose(ARMS[ROBOT], np.radians(q), TOOL).r.as_matrix() for q in angles])
    weight = MASS * np.einsum("nji,j->ni", turns, [0, 0, -9.80665])
    arm = CENTRE - TOOL.p
    return (angles, weight + np.array([3, -5, 7]) + rng.normal(0, 0.5, weight.shape),
            np.cross(arm, weight) + np.array([0.1, 0.2, -0.3]) + rng.normal(0, 0.05, weight.shape))


def touched(q: np.ndarray, force: np.ndarray, moment: np.ndarray) -> Stills:
    force = force.copy()
    force[30:40, 2] += 150.0
    return q, force, moment


MISTAKES: dict[str, tuple[Change, str, int]] = {
    "none": (lambda q, f, m: (q, f, m), "", 0),
    "no moments": (lambda q, f, m: (q, f, 0 * m), "CS3044", 0),
    "in kilograms": (lambda q, f, m: (q, f / 9.80665, m / 9.80665), "CS3049", 0),
    "ten times the gain": (lambda q, f, m: (q, 10 * f, 10 * m), "CS3049", 0),
    "in kilonewtons": (lambda q, f, m: (q, 1e-3 * f, m), "CS3047", 1),
    "moments in N mm": (lambda q, f, m: (q, f, 1e3 * m), "CS3047", 1),
    "y and z swapped": (lambda q, f, m: (q, f[:, [0, 2, 1]], m), "CS3048", 3),
    "a joint's sign": (lambda q, f, m: (q * [1, 1, 1, 1, -1, 1], f, m), "CS3048", 3),
    "the tool touched once": (touched, "CS3048", 3)}


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.parametrize("seed", range(3))
def test_still_readings(tmp_path: Path, name: str, seed: int) -> None:
    change, code, answer = MISTAKES[name]
    cell = workshop(ROBOT).files["cell.yaml"].replace("frame: base", "frame: tool").replace(
        "tool: {", "tool: {mass_kg: 15, centre_of_mass_mm: [0, 0, 80], ")
    (tmp_path / "cell.yaml").write_text(cell)
    rows = [",".join(f"{x:.5f}" for x in row) for row in np.column_stack(change(*stills(seed)))]
    (tmp_path / "still.csv").write_text("\n".join([",".join(NAMES), *rows]) + "\n")
    keys = tmp_path / "payload.yaml"
    run = kit.run("tare", tmp_path / "cell.yaml", tmp_path / "still.csv", "-o", keys, "--json")
    assert run.code == answer, run
    assert keys.exists() == (answer == 0)       # numbers that are not to be used were a file to copy from
    told = {one["code"] for one in run.json["findings"]} - {"CS3003", "CS3043", "CS3045"}
    assert told == ({code} if code else set())
    if not code:
        mass = run.json["result"]["mass_kg"]
        assert mass["interval_95"][0] - 0.05 < MASS < mass["interval_95"][1] + 0.05


def test_pauses_between_orientations_are_no_lost_samples(tmp_path: Path) -> None:
    cell = workshop(ROBOT).files["cell.yaml"].replace("frame: base", "frame: tool")
    (tmp_path / "cell.yaml").write_text(cell)
    values = np.column_stack(stills(0))
    time = 0.01 * np.arange(len(values)) + 5.0 * (np.arange(len(values)) // 10)
    rows = [",".join(f"{x:.5f}" for x in row) for row in np.column_stack([time, values])]
    (tmp_path / "still.csv").write_text("\n".join([",".join(["time_s", *NAMES]), *rows]) + "\n")
    run = kit.run("tare", tmp_path / "cell.yaml", tmp_path / "still.csv", "--json")
    assert run.code == 0, run
    assert "CS3025" not in kit.codes(run)


def test_a_tare_that_is_refused_says_that_the_old_keys_stand_there(tmp_path: Path) -> None:
    """With --force, so that a script that looks for the file finds one: it is named, and is as it was; without one nothing is
    said."""
    cell = workshop(ROBOT).files["cell.yaml"].replace("frame: base", "frame: tool")
    (tmp_path / "cell.yaml").write_text(cell)
    values = np.column_stack(MISTAKES["y and z swapped"][0](*stills(0)))
    rows = [",".join(f"{x:.5f}" for x in row) for row in values]
    (tmp_path / "still.csv").write_text("\n".join([",".join(NAMES), *rows]) + "\n")
    keys = tmp_path / "payload.yaml"
    words = ("tare", tmp_path / "cell.yaml", tmp_path / "still.csv", "-o", keys, "--force", "--json")
    first = kit.run(*words)
    keys.write_text("mass_kg: 3\n")
    again = kit.run(*words)
    assert (first.code, again.code) == (3, 3), again
    assert [one["message"] for one in first.json["findings"] if one["code"] == "CS0014"] == []
    [said] = [one["message"] for one in again.json["findings"] if one["code"] == "CS0014"]
    assert said.startswith("payload.yaml stands there still")
    assert keys.read_text() == "mass_kg: 3\n"


@pytest.mark.parametrize("stem", ["a\udcffb", "a\nspeed_hz: 5\nb", "m\u00fcde"])
def test_the_name_of_a_log_writes_no_keys(tmp_path: Path, stem: str) -> None:
    """It stands in a comment of the keys, whatever a file system allows as a name."""
    (tmp_path / "cell.yaml").write_text(workshop(ROBOT).files["cell.yaml"].replace("frame: base", "frame: tool"))
    rows = [",".join(f"{x:.5f}" for x in row) for row in np.column_stack(stills(0))]
    for name in ("still", stem):
        (tmp_path / f"{name}.csv").write_text("\n".join([",".join(NAMES), *rows]) + "\n")
        done = kit.run("tare", tmp_path / "cell.yaml", tmp_path / f"{name}.csv", "-o", tmp_path / "payload.yaml", "--force")
        assert done.code == 0, done
        keys = yaml.safe_load((tmp_path / "payload.yaml").read_text())
        assert list(keys) == ["force_log"]
