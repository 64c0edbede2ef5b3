"""The track under the robot gives way: as the virtual cell has it, named where it is hidden, and offered where there is one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.common.findings import CompstiffError
from identification.model.cell import Cell, read_cell
from identification.model.effects import effects
from identification.model.effects_in_force import EffectInForce
from identification.model.load_state import load_state
from identification.model.rotations import Frame
from identification.model.stiffness_file import check_track, read_stiffness
from tests.runs.command_line import user_files as kit
from tests.support import write_cell
from tests.virtual_cell.cell import Case, Hidden, simulate
from tests.virtual_cell.effects_track import TRAVEL, UNITS

# Tracks along the travel; lying turned in the world under a turned robot; and what has no travel along one line.
TURNED = ("base_frame: {quaternion: [0.7071067811865476, 0, 0, 0.7071067811865476]}\n"
          "mechanical_units:\n  - {name: T, carries: robot, "
          "base_frame: {quaternion: [0, 0, 0, 1]}, axes: [{eax: a, direction: [0.8, -0.6, 0]}]}\n")
NO_TRAVEL = ["", "mechanical_units: []\n", UNITS.replace("robot", "workobject"),
             UNITS.replace("linear", "rotary").replace("[0.6, 0.8, 0.0]", "[0, 0, 1]"),
             UNITS.replace("]}]}", "]}, {eax: b, direction: [0, 1, 0]}]}")]
# Enough to tell 5 % from less; where they are not, the program draws more.
FEW = ("--replicates", "39")


def with_track(case: Case, folder: Path, units: str = UNITS) -> tuple[Path, Path]:
    cell, measurements = case.write(folder)
    cell.write_text(cell.read_text() + units)
    return cell, measurements


def cell(folder: Path, units: str) -> Cell:
    return read_cell(with_track(simulate(1), folder, units)[0])


def test_the_travel_is_seen_from_the_base(tmp_path: Path) -> None:
    np.testing.assert_allclose(cell(tmp_path, UNITS).robot.track, TRAVEL, atol=1e-12)
    np.testing.assert_allclose(np.abs(cell(tmp_path, TURNED).robot.track), TRAVEL, atol=1e-12)
    assert all(cell(tmp_path, units).robot.track is None for units in NO_TRAVEL)


def test_it_is_the_virtual_cell_s(tmp_path: Path) -> None:
    case = simulate(1, "ladder12", [Hidden("soft_track")], "none")
    entry, truth = effects()["soft_track"], case.truth[0]["parameters"]
    rows = load_state(cell(tmp_path, UNITS).robot, Frame(np.eye(3), np.array(case.tool.tcp)), case.theta, case.wrench,
                      1 / case.stiffness, tool_mass=case.tool.mass, tool_centre=np.array(case.tool.centre))
    added = entry.contribution(rows, None, np.array([truth[parameter.name] for parameter in entry.parameters]))
    size = np.sqrt(np.mean(case.effect_um**2))
    assert size > 5
    assert np.sqrt(np.mean((1e6 * added[:, :3] - case.effect_um) ** 2)) < 0.01 * size
    other = replace(rows, robot=replace(rows.robot, track=None))
    assert not entry.contribution(other, None, np.array([1e-7, 1e-7])).any()
    assert entry.missing(other)
    assert not entry.missing(rows)


@pytest.mark.parametrize("track", [True, False])
def test_an_effect_of_the_track_needs_a_track(tmp_path: Path, track: bool) -> None:
    """One of the robot does not."""
    cell = read_cell(write_cell(tmp_path))
    cell = replace(cell, robot=replace(cell.robot, track=np.array([1.0, 0, 0]) if track else None))
    check_track(cell, (EffectInForce(effects()["backlash"], 2),), "k.json")
    named = (EffectInForce(effects()["soft_track"], None), EffectInForce(effects()["backlash"], 2))
    if track:
        check_track(cell, named, "k.json")
        return
    with pytest.raises(CompstiffError) as stopped:
        check_track(cell, named, "k.json")
    (said,) = stopped.value.findings
    assert (said.code, said.file, said.message) == (
        "CS4512", "k.json", "soft_track is an effect of the track under the robot, and the cell has none along one line")


def test_it_is_named_where_it_is_hidden_and_carried_on(tmp_path: Path) -> None:
    """The extended file is not read in a cell without a track: it would be taken for nothing."""
    case = simulate(612, "poses20", [Hidden("soft_track", None, 2.0)])
    files = with_track(case, tmp_path)
    done = kit.run("diagnose", *files, "-o", tmp_path / "diagnosis.json", "--extended", tmp_path / "stiffness.json", *FEW,
                   "--json")
    assert done.code == 0, done
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert found["verdict"] == "named", found["verdict"]
    assert [cause["effect"] for cause in found["causes"]] == ["soft_track"]
    for name, parameter in found["causes"][0]["parameters"].items():
        truth = case.truth[0]["parameters"][name]
        assert abs(parameter["estimate"] - truth) < 4 * parameter["std"] + 0.1 * truth
    model = read_stiffness(tmp_path / "stiffness.json", read_cell(files[0]))
    assert "soft_track" in {term.effect.name for term in model.effects}
    files[0].write_text(files[0].read_text().replace(UNITS, ""))
    with pytest.raises(CompstiffError) as stopped:
        read_stiffness(tmp_path / "stiffness.json", read_cell(files[0]))
    assert stopped.value.findings[0].code == "CS4512"


# Long: where it is missing is asked of every kind of cell above.
@pytest.mark.long
def test_it_is_not_offered_where_there_is_no_track(tmp_path: Path) -> None:
    """And what is left is not given to it."""
    files = with_track(simulate(612, "poses20", [Hidden("soft_track", None, 2.0)]), tmp_path, "")
    done = kit.run("diagnose", *files, "-o", tmp_path / "diagnosis.json", *FEW, "--json")
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert "track" in found["not_offered"]["soft_track"], done
    assert "soft_track" not in json.dumps(found["causes"])
    assert not any("soft_track" in finding["message"] for finding in done.json["findings"])


def test_nothing_hidden_is_not_named(tmp_path: Path) -> None:
    files = with_track(simulate(613, "poses20"), tmp_path)
    kit.run("diagnose", *files, "-o", tmp_path / "diagnosis.json", *FEW)
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == "adequate"


def test_maxwell_betti(tmp_path: Path) -> None:
    """What a load along a moves along b, the same load along b moves along a; no load gains energy."""
    case, track = simulate(1), cell(tmp_path, UNITS).robot
    entry, count = effects()["soft_track"], len(case.theta)
    rows = [load_state(track, Frame.identity(), case.theta, np.tile(unit, (count, 1)), 1 / case.stiffness, at_load=True)
            for unit in np.eye(6)]
    columns = [entry.contribution(one, None, np.array([3e-7, 2e-7])) for one in rows]
    matrix = np.stack(columns, axis=2) * np.array([1, 1, 1, 0.1, 0.1, 0.1])[:, None] * np.array([1, 1, 1, 0.1, 0.1, 0.1])
    largest = np.abs(matrix).max(axis=(1, 2))
    assert np.all(np.abs(matrix - np.swapaxes(matrix, 1, 2)).max(axis=(1, 2)) < 1e-12 * largest)
    assert np.all(np.linalg.eigvalsh(matrix)[:, 0] > -1e-9 * largest)
