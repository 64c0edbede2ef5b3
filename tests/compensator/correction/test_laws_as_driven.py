"""Positions in the log against the program: the offsets of the pass are in them; whose they are the deflection tells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from compensator.correction.as_driven import said_of_positions
from compensator.correction.correct import correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.predict import Predicted
from compensator.correction.settings import Settings
from tests.runs.command_line.test_placement import ORIGIN, Path3
from tests.runs.command_line.user_files import Job, module, move, work_object
from tests.support import long


@pytest.fixture(scope="module")
def planned(sample_inputs: Inputs) -> Predicted:
    return predict_files(sample_inputs, Settings.of(tare=((0, 2),)))


def beside(planned: Predicted, values: np.ndarray) -> Predicted:
    """The log with rows that stand off the path by what values (N, 3) [m] are at their targets."""
    log, length = planned.forces.log, planned.path.length
    off = np.column_stack([np.interp(log.place, length, axis) for axis in values.T])
    forces = replace(planned.forces, log=replace(log, beside=off))
    return replace(planned, loaded=replace(planned.loaded, forces=forces))


def codes(planned: Predicted, offsets: np.ndarray | None) -> list[str]:
    return [f"{finding.code} {'--logged-with' in finding.hint}" for finding in said_of_positions(planned, offsets)]


def deflection(planned: Predicted) -> np.ndarray:
    """(N, 3) [m]: at every target, none in the air."""
    values = np.zeros((len(planned.path.toolpath), 3))
    values[planned.targets] = planned.prediction.position
    return values


@pytest.mark.parametrize("seed", [*range(5), *map(long, range(5, 30))])
def test_a_right_log_is_left_in_peace_and_another_pass_is_told(planned: Predicted, seed: int) -> None:
    """Controllers cut corners, lag and drift by up to a tenth of a millimetre, in any direction; the pass was planned or had
    offsets of 0.9 to 1.2 of the deflection, with such errors too."""
    rng, d = np.random.default_rng((3075, seed)), deflection(planned)
    position = planned.path.base_from_tcp.position
    bend = np.gradient(np.gradient(position, axis=0), axis=0)
    size = rng.uniform(0, 1e-4)
    errors = (rng.normal(0, 1, d.shape) * rng.uniform(0, 5e-5) + bend * size / max(np.abs(bend).max(), 1e-12)
              + np.cumsum(rng.normal(0, 1, d.shape), axis=0) / np.sqrt(len(d)) * rng.uniform(0, 1e-4))
    offsets = -rng.uniform(0.9, 1.2) * d
    assert codes(beside(planned, errors), None) == []
    assert codes(beside(planned, offsets + errors), offsets) == []
    assert codes(beside(planned, offsets + errors), None) == ["CS3075 True"]
    assert codes(beside(planned, errors), offsets) == ["CS3076 True"]
    for version in 3e-4 * np.eye(3)[1:]:        # along the passes, x, a version does not show
        assert codes(beside(planned, errors + version), None) == ["CS3120 False"]
        assert codes(beside(planned, errors + offsets + version), offsets) == ["CS3120 False"]
    assert codes(beside(planned, -offsets + errors), None) == ["CS3075 False"]
    # One operation of several was changed since, by half a millimetre across the passes.
    first = int(rng.integers(len(d) // 2))
    operation = np.zeros_like(d)
    operation[first:first + len(d) // 3, 1 + int(rng.integers(2))] = 5e-4
    assert codes(beside(planned, errors + operation), None) == ["CS3120 False"]
    assert codes(beside(planned, errors + offsets + operation), offsets) == ["CS3120 False"]


def test_of_a_dozen_targets_the_offsets_of_a_pass_are_told(planned: Predicted) -> None:
    """Long moves have few; of the first fifteen cutting targets of the sample whether they had offsets, and no version."""
    few = planned.targets[:15]
    prediction = SimpleNamespace(position=planned.prediction.position[:15])
    short = SimpleNamespace(forces=planned.forces, path=planned.path, targets=few, prediction=prediction, findings=())
    d = deflection(planned)

    def told(values: np.ndarray, offsets: np.ndarray | None) -> list[str]:
        short.forces = beside(planned, values).forces
        return codes(short, offsets)

    assert told(0 * d, None) == []
    assert told(-d, None) == ["CS3075 True"]
    assert told(-d, -d) == []
    assert told(0 * d, -d) == ["CS3076 True"]


def test_the_sample_as_it_is_and_its_corrected_program(sample_inputs: Inputs, planned: Predicted, tmp_path: Path) -> None:
    """From the files: the shipped log beside the shipped program, and beside what `correct` made of it."""
    corrected = correct(planned)
    assert not {"CS3075", "CS3076"} & {finding.code for finding in corrected.findings}
    (tmp_path / "part.mod").write_bytes(corrected.content)
    again = correct(predict_files(replace(sample_inputs, toolpath=tmp_path / "part.mod"), Settings.of(tare=((0, 2),))))
    assert "CS3075" in {finding.code for finding in again.findings}


@pytest.mark.parametrize(("long_mm", "aside_mm", "said"), [
    (30.0, 0.0, []), (30.0, 0.9, []), (30.0, 1.1, ["CS3120 False"]), (30.0, -2.0, ["CS3120 False"]),
    (22.0, 2.0, ["CS3120 False"]), (18.0, 2.0, [])])
def test_a_long_move_that_was_changed_since_is_told(tmp_path: Path, long_mm: float, aside_mm: float, said: list[str]) -> None:
    """Five straight moves, from 20 mm on; the pass that was logged had one of them elsewhere, by over a millimetre, as of the
    program before an edit."""
    path = Path3(np.array([[long_mm * i, 0, 0] for i in range(6)]))
    way = np.arange(0.0, 5 * long_mm, 0.05)
    there = np.column_stack([way, np.where((way > 2 * long_mm) & (way < 3 * long_mm), aside_mm, 0.0), 0 * way])
    rows = np.column_stack([path.at(there), np.tile([20.0, 10.0, -5.0], (len(way), 1))])
    Job(tmp_path, program=path.program(), forces="\n".join(["x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", *(
        ",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n").write()
    planned = predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "stiffness.json",
                                   tmp_path / "forces.csv"))
    assert codes(planned, None) == said


@pytest.mark.parametrize(("deeper_mm", "of_deflection", "said"), [
    (-2.0, 0.0, ["CS3120 False"]), (2.0, -1.0, ["CS3120 False"]), (0.0, 0.0, []), (0.0, -1.0, []), (0.0, -1.4, [])])
def test_on_a_soft_arm_a_changed_depth_is_told_from_the_offsets_of_a_pass(
    tmp_path: Path, deeper_mm: float, of_deflection: float, said: list[str]
) -> None:
    """Under 900 N the tool yields by more than a millimetre: a cut that was made deeper by two since it was logged, across the
    way and across the yield, stands off along another line than a corrected pass does."""
    path = Path3(np.array([[30.0 * i, 0, 0] for i in range(6)]))
    way = np.arange(0.0, 150.0, 0.05)

    def placed(off_mm: np.ndarray) -> Predicted:
        there = np.column_stack([way, 0 * way, 0 * way]) + np.where((way > 60) & (way < 90), 1.0, 0.0)[:, None] * off_mm
        rows = np.column_stack([path.at(there), np.tile([0.0, 900.0, 0.0], (len(way), 1))])
        Job(tmp_path, program=path.program(), forces="\n".join(["x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", *(
            ",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n").write()
        return predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "stiffness.json",
                                    tmp_path / "forces.csv"))

    # The yield across the way, in the axes of the path.
    yielded = 1e3 * (work_object().r * ORIGIN.r).inv().apply(placed(np.zeros(3)).prediction.position[2:4].mean(axis=0))
    yielded[0] = 0.0
    size = float(np.linalg.norm(yielded))
    assert size > 1.0
    across = np.cross([1.0, 0, 0], yielded / size)
    assert codes(placed(deeper_mm * across + of_deflection * yielded), None) == said


def test_an_arc_that_was_changed_since_is_told(tmp_path: Path) -> None:
    """A quarter circle of 25 mm, and the log of the program before, whose corner had 20 mm: both ends and the ways there lie on
    the new path, the middle two millimetres beside it."""
    turn = np.radians(np.linspace(0, 90, 3))
    ends = np.array([[-40.0, -25, 0], [0, -25, 0]])
    arc = np.column_stack([25 * np.sin(turn), -25 * np.cos(turn), 0 * turn])
    path = Path3(np.concatenate([ends[:1], arc, [[25.0, 40, 0]]]))
    program = module([move(path.text[0]), move(path.text[1]),
                      f"    MoveC {path.text[2]},{path.text[3]},v50,z1,tMill\\WObj:=wPart;", move(path.text[4])])
    straight = np.arange(0.0, 45, 0.1)
    bend = np.radians(np.arange(0.0, 90, 0.2))
    old = np.concatenate([np.column_stack([-40 + straight, -25 + 0 * straight]), np.column_stack(
        [5 + 20 * np.sin(bend), -5 - 20 * np.cos(bend)]), np.column_stack([25 + 0 * straight, -5 + straight])])
    rows = np.column_stack([path.at(np.column_stack([old, 0 * old[:, 0]])), np.tile([20.0, 10.0, -5.0], (len(old), 1))])
    Job(tmp_path, program=program, forces="\n".join(["x_mm,y_mm,z_mm,fx_n,fy_n,fz_n", *(
        ",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n").write()
    planned = predict_files(Inputs(tmp_path / "cell.yaml", tmp_path / "part.mod", tmp_path / "stiffness.json",
                                   tmp_path / "forces.csv"))
    assert codes(planned, None) == ["CS3120 False"]


def shares(planned: Predicted) -> tuple[np.ndarray, np.ndarray]:
    """The deflection (N, 3) [m] across the path, and as much across both."""
    way = np.gradient(planned.path.base_from_tcp.position, axis=0)
    way /= np.linalg.norm(way, axis=1)[:, None]
    d = deflection(planned)
    d -= np.einsum("ni,ni->n", d, way)[:, None] * way
    return d, np.cross(way, d)


@pytest.mark.parametrize(("times", "said"), [
    (-0.65, []), (-0.75, ["CS3075 True"]), (-1.35, ["CS3075 True"]), (-1.45, []), (0.65, []), (0.75, ["CS3075 False"])])
def test_positions_off_by_0_7_to_1_4_of_the_deflection_are_a_corrected_pass(planned: Predicted, times: float, said) -> None:
    """Of another size they may be another version's."""
    told = codes(beside(planned, times * deflection(planned)), None)
    assert [code for code in told if code != "CS3120 False"] == said


@pytest.mark.parametrize(("other", "said"), [(0.44, ["CS3075 True"]), (0.56, [])])
def test_half_of_what_the_positions_are_off_by_is_the_deflection(planned: Predicted, other: float, said: list[str]) -> None:
    """By its square; the other half stands across it."""
    d, across = shares(planned)
    told = codes(beside(planned, -d + np.sqrt(other / (1 - other)) * across), None)
    assert [code for code in told if code != "CS3120 False"] == said


@pytest.mark.parametrize(("share", "said"), [(0.27, ["CS3076 True"]), (0.33, [])])
def test_a_pass_had_the_offsets_of_which_its_positions_show_three_tenths(planned: Predicted, share: float, said) -> None:
    d = deflection(planned)
    assert codes(beside(planned, -share * d), -d) == said


@pytest.mark.parametrize(("rms_um", "said"), [(27.0, False), (33.0, True)])
def test_a_deflection_of_thirty_micrometres_shows_in_the_positions(planned: Predicted, rms_um: float, said: bool) -> None:
    """And so do offsets."""
    targets = planned.targets
    d = shares(planned)[0][targets]
    scale = 1e-6 * rms_um / np.sqrt(np.mean(np.sum(d**2, axis=1)))
    prediction = SimpleNamespace(position=scale * planned.prediction.position)
    there, none = scale * deflection(planned), 0 * deflection(planned)
    for values, offsets, code in ((-there, None, "CS3075 True"), (none, -there, "CS3076 True")):
        seen = SimpleNamespace(forces=beside(planned, values).forces, path=planned.path, targets=targets, prediction=prediction,
                               findings=())
        assert codes(seen, offsets) == [code] * said


@pytest.mark.parametrize(("share", "off_mm", "words"), [
    (1.0, 0.14, ""), (1.0, 0.16, "the samples lie beside the path, by 0.16 mm in the middle of the cuts"),
    (0.3, 0.23, ""), (0.3, 0.27, "lie beside the path by up to 0.27 mm"), (0.1, 0.5, ""), (0.14, 0.5, "by up to 0.5 mm")])
def test_a_version_is_told_that_is_off_everywhere_or_along_an_eighth(planned: Predicted, share, off_mm, words: str) -> None:
    """By 0.15 mm upwards in the middle of all, or by a quarter of a millimetre over twelve hundredths of the targets."""
    values = np.zeros((len(planned.path.toolpath), 3))
    values[planned.targets[:round(share * len(planned.targets))], 2] = 1e-3 * off_mm
    found = said_of_positions(beside(planned, values), None)
    assert [words in one.message for one in found] == [True] * bool(words)


@pytest.mark.parametrize(("count", "codes_said"), [(11, []), (12, ["CS3075"]), (39, ["CS3075"]), (40, ["CS3075"])])
def test_a_dozen_targets_tell_of_offsets_and_forty_of_a_version(planned: Predicted, count: int, codes_said: list[str]) -> None:
    def told(values: np.ndarray) -> list[str]:
        return [one.code for one in said_of_positions(SimpleNamespace(
            forces=beside(planned, values).forces, path=planned.path, targets=planned.targets[:count], findings=(),
            prediction=SimpleNamespace(position=planned.prediction.position[:count])), None)]

    d = deflection(planned)
    assert told(-d) == codes_said
    assert told(0 * d + [0, 0, 4e-4]) == (["CS3120"] if count == 40 else [])
