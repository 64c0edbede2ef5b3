"""A pass whose program had its offsets at added targets alone: one long move that begins and ends in the air."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import compstiff
from compensator.correction.offsets import _Columns
from compensator.correction.pass_offsets import PassOffsets, read_offsets
from compensator.correction.settings import Estimate
from identification.common.findings import CompstiffError, Refused
from identification.model.stiffness import IdentifiedModel
from tests.compensator.path.test_laws_timing import lines, program

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
force_log: {frame: base, sign: on_tool}
"""
# The cut [mm] along y of passes beside each other, each one MoveL from the air into the air; force [N] of a tool on its plan,
# and how stiff the cut is across the feed [N/mm].
PASSES, FIRST, LAST, BEGIN, END = (0.0, 8.0, 16.0), -70.0, 70.0, -50.0, 50.0
ON_PLAN, STIFFNESS, STEP = np.array([180.0, -40.0, 30.0]), 400.0, 0.25


def job(folder: Path) -> tuple[compstiff.Cell, Path, IdentifiedModel]:
    ways = [f"MoveL [[{1100 + x},{y},{z}],[0,0,1,0],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[{feed},500,5000,1000],fine,"
            "tSpindle\\WObj:=wobj0;" for x in PASSES for y, z, feed in (
                (FIRST, 640, 200), (FIRST, 600, 200), (LAST, 600, 20), (LAST, 640, 200))]
    (folder / "cell.yaml").write_text(CELL)
    program = folder / "passes.mod"
    program.write_text("MODULE Passes\nPERS tooldata tSpindle:=[TRUE,[[120,0,250],[1,0,0,0]],[80,[0,0,120],[1,0,0,0],0,0,0]];\n"
                       "PROC main()\n" + "\n".join(ways) + "\nENDPROC\nENDMODULE\n")
    cell = compstiff.read_cell(folder / "cell.yaml")
    return cell, program, IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(np.full(6, 1.5e6)), np.eye(6) * 1e-6)


def targets(text: str) -> np.ndarray:
    return np.array([[float(value) for value in found] for found in re.findall(
        r"MoveL\s*\[\[\s*([-\d.]+),\s*([-\d.]+),\s*([-\d.]+)\]", text)])


def log(file: Path, sent: np.ndarray, force: np.ndarray) -> Path:
    """Positions that the program sends, and this force where the tool is in the cut."""
    rows = []
    for start, end in pairwise(sent):
        for share in np.arange(0, 1, STEP / max(float(np.linalg.norm(end - start)), STEP)):
            at = start + share * (end - start)
            cuts = BEGIN < at[1] < END and at[2] < 610
            rows.append([*at, *(force if cuts else np.zeros(3))])
    file.write_text("x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "\n".join(",".join(f"{v:.4f}" for v in row) for row in rows) + "\n")
    return file


def offsets_in_cut(program: Path) -> np.ndarray:
    """What a written program has in the middle of its cuts [mm], straight between its targets."""
    sent, found = targets(program.read_text()), []
    for start, end in pairwise(sent):
        if min(start[1], end[1]) < 0 < max(start[1], end[1]) and max(start[2], end[2]) < 610:
            at = start + (0 - start[1]) / (end[1] - start[1]) * (end - start)
            found.append(at - [1100 + PASSES[len(found)], 0, 600])
    return np.array(found)


def test_a_pass_corrected_at_added_targets_is_not_corrected_twice(tmp_path: Path) -> None:
    """The tool of the second pass stood on its plan and met the force of the plan: its log asks for the offsets that it had."""
    cell, program, model = job(tmp_path)
    read = compstiff.read_toolpath(program, cell)
    planned = targets(program.read_text())

    def corrected(name: str, forces: Path, **more: object) -> tuple[Path, compstiff.Corrected]:
        settings = compstiff.Settings.of(cutting_stiffness=Estimate(1e3 * STIFFNESS, 0.0), tare=((0, 0),), **more)
        found = compstiff.correct(compstiff.predict(cell, read, model, forces, settings))
        (tmp_path / f"{name}.mod").write_bytes(found.content)
        (tmp_path / f"{name}.csv").write_bytes(compstiff.offsets_csv(found))
        return tmp_path / f"{name}.mod", found

    # While the first pass was logged the tool yielded, and cut less: its force is what is left of that of the plan.
    direction = np.array([ON_PLAN[0], 0, ON_PLAN[2]]) / np.hypot(ON_PLAN[0], ON_PLAN[2])
    at_plan = compstiff.predict(cell, read, model, log(tmp_path / "plan.csv", planned, ON_PLAN),
                                compstiff.Settings.of(tare=((0, 0),)))
    in_cut = np.linalg.norm(at_plan.prediction.position, axis=1).argmax()
    share = at_plan.forces.wrench[at_plan.targets[in_cut], :3] @ ON_PLAN / (ON_PLAN @ ON_PLAN)
    yields = 1e3 * at_plan.prediction.position[in_cut] @ direction / share
    grows = STIFFNESS * yields / np.hypot(ON_PLAN[0], ON_PLAN[2])
    assert 0.1 < grows < 0.6
    first, _ = corrected("first", log(tmp_path / "one.csv", planned, ON_PLAN / (1 + grows)))
    had = offsets_in_cut(first)
    assert len(had) == len(PASSES)
    assert np.linalg.norm(had, axis=1).min() > 0.05
    # The targets of the program itself stay in the air: all of the correction is in those that were added.
    assert not np.any([[float(row[f"o{axis}_mm"]) for axis in "xyz"] for row in rows_of(tmp_path / "first.csv")])
    two = log(tmp_path / "two.csv", targets(first.read_text()), ON_PLAN)
    second, found = corrected("second", two, logged_with=tmp_path / "first.csv")
    assert not {finding.code for finding in found.findings} & {"CS3075", "CS3076", "CS3120", "CS4130"}
    assert_allclose(offsets_in_cut(second), had, atol=0.04 * np.linalg.norm(had, axis=1).max())
    # Of an earlier version, without the offsets of the added targets: as if the pass had been uncorrected, and it is said.
    lines = (tmp_path / "first.csv").read_text().splitlines()
    (tmp_path / "first.csv").write_text("\n".join(line.rsplit(",", 2)[0] for line in lines) + "\n")
    without, found = corrected("without", two, logged_with=tmp_path / "first.csv")
    assert "CS4130" in {finding.code for finding in found.findings}
    assert np.linalg.norm(offsets_in_cut(without)[0]) > (1 + 0.7 * grows) * np.linalg.norm(had[0])


def test_cuts_between_targets_in_the_air_are_told_where_none_may_be_added(tmp_path: Path) -> None:
    cell, program, model = job(tmp_path)
    forces = log(tmp_path / "log.csv", targets(program.read_text()), ON_PLAN)
    planned = compstiff.predict(cell, compstiff.read_toolpath(program, cell), model, forces,
                                compstiff.Settings.of(tare=((0, 0),), keep_targets=True))
    with pytest.raises(Refused, match="between targets that stand in the air, and --keep-targets was given"):
        compstiff.correct(planned)


def rows_of(file: Path) -> list[dict[str, str]]:
    head, *rows = file.read_text().splitlines()
    return [dict(zip(head.split(","), row.split(","), strict=True)) for row in rows]


def test_offsets_are_read_as_they_were_written(tmp_path: Path) -> None:
    """The mean over the way of a target, by fine sums along the written program."""
    cell, program, model = job(tmp_path)
    read = compstiff.read_toolpath(program, cell)
    forces = log(tmp_path / "log.csv", targets(program.read_text()), ON_PLAN)
    found = compstiff.correct(compstiff.predict(cell, read, model, forces, compstiff.Settings.of(tare=((0, 0),))))
    (tmp_path / "offsets.csv").write_bytes(compstiff.offsets_csv(found))
    path = found.planned.path
    had = read_offsets(tmp_path / "offsets.csv", path)
    planned, sent = targets(program.read_text()), targets(found.content.decode())
    assert len(sent) == len(planned) + len(had.added)
    # Along each pass, from its first target half way to its last.
    for number, x in enumerate(PASSES):
        y = np.linspace(FIRST, 0.5 * (FIRST + LAST), 20001)
        here = (np.abs(sent[:, 0] - 1100 - x) < 3) & (sent[:, 2] < 610)
        off = np.column_stack([np.interp(y, sent[here, 1], sent[here, k]) for k in range(3)]) - np.column_stack(
            [np.full(len(y), 1100 + x), y, np.full(len(y), 600.0)])
        # Half way up to the target before there is none.
        way, above = 0.5 * (LAST - FIRST), 0.5 * 40.0
        mean = np.trapezoid(off, y, axis=0) / (way + above)
        assert_allclose(1e3 * had.over(path)[4 * number + 1][[0, 2]], mean[[0, 2]], atol=2e-3)


@pytest.mark.parametrize("targets_of_it", [np.array([1, 2, 3]), np.array([0, 1, 3])])
def test_some_of_them(targets_of_it: np.ndarray) -> None:
    """Added targets stay with the move that they belong to."""
    rng = np.random.default_rng(4)
    had = PassOffsets(rng.normal(size=(4, 3)), np.array([1, 2, 2, 3]), np.array([0.5, 0.2, 0.7, 0.4]), rng.normal(size=(4, 3)))
    few = had.some(targets_of_it)
    expected = {(1, 2, 3): [(1, 0.2), (1, 0.7), (2, 0.4)], (0, 1, 3): [(1, 0.5)]}[tuple(targets_of_it.tolist())]
    assert list(zip(few.before.tolist(), few.share.tolist(), strict=True)) == expected
    assert_allclose(few.given, had.given[targets_of_it])


@pytest.mark.parametrize(("off_um", "own"), [(1.8, True), (2.2, False)])
def test_offsets_are_a_programs_whose_places_they_have_to_two_micrometres(tmp_path: Path, off_um: float, own: bool) -> None:
    """The second of three targets stands elsewhere in the file."""
    path = program(tmp_path, lines([[1100.0, 0, 700], [1110, 0, 700], [1120, 0, 700]], "v50", "z1"))
    (tmp_path / "offsets.csv").write_text("target,x_mm,y_mm,z_mm,ox_mm,oy_mm,oz_mm\n0,1100,0,700,0,0,0\n"
                                          f"1,1110,{1e-3 * off_um:.6f},700,0.1,0.2,0.3\n2,1120,0,700,0,0,0\n")
    if own:
        np.testing.assert_allclose(read_offsets(tmp_path / "offsets.csv", path).given[1], [1e-4, 2e-4, 3e-4])
        return
    with pytest.raises(CompstiffError, match=r"CS4121: .*: target 1 is 0.0022 mm from where this program has it"):
        read_offsets(tmp_path / "offsets.csv", path)


@pytest.mark.parametrize("rows", [(0, 6), (1, 4), (4, 6), (2, 3)])
def test_columns_have_the_numbers_of_their_targets_and_nothing_at_others(rows: tuple[int, int]) -> None:
    """Blocks of rows fit together; no minus nothing, no infinity, and empty where there is none."""
    values = np.array([[1.234, -0.0004], [np.inf, 2.0], [-7.5, 0.5]])
    unknown = np.arange(6) == 5
    columns = _Columns("a b", values, 2, 10.0, np.array([1, 3, 4]), np.array([2, 0, 1]), unknown)
    whole = {"a": [0.0, -75.0, 0.0, 12.34, np.nan, np.nan], "b": [0.0, 5.0, 0.0, 0.0, 20.0, np.nan]}
    found = columns.rounded(slice(*rows))
    for name, expected in whole.items():
        np.testing.assert_array_equal(found[name], expected[slice(*rows)])
        assert not np.signbit(found[name][found[name] == 0]).any()
