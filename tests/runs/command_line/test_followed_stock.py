"""Forces from the stock, of a program whose routines stand in another order than they run: roughing takes what it takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.cut import cut_of
from compensator.path.robot_path import robot_path
from compensator.posting.read_toolpath import read_toolpath
from identification.model.cell import read_cell
from tests.runs.command_line import user_files as kit

CUTTING = "force_log: {spindle_rpm: 9000}\ncutting: {tool_diameter_mm: 16, teeth: 3, flute_mm: 30, material: aluminium}\n"
STOCK = "box: {from_mm: [0, 0, -20], to_mm: [60, 40, 0]}\nresolution_mm: 0.25\n"


def moves(*places: tuple[float, float, float]) -> str:
    """Straight moves of an upright tool to places [mm] in the work object."""
    return "\n".join(kit.move(f"[[{x},{y},{z}],[1,0,0,0],[0,0,0,0],{kit.E}]") for x, y, z in places)


def away(y: float) -> tuple[float, float, float]:
    return -20, y, 30


# Roughing takes 5 mm off the side y = 0, finishing 1 mm more: without roughing it would take 6.
ROUGH = moves(away(-3), (-20, -3, -8), (80, -3, -8), (80, -3, 30), away(-3))
FINISH = moves(away(-2), (-20, -2, -8), (80, -2, -8), (80, -2, 30), away(-2))
REST = moves((0, 100, 80), (60, 100, 80))
MAIN = "PROC main()\nrRough;\nrFinish;\nENDPROC\n"


def routine(name: str, body: str) -> str:
    return f"PROC {name}()\n{body}\nENDPROC\n"


@pytest.mark.parametrize(("text", "rough", "finish"), [
    (MAIN + routine("rRough", ROUGH) + routine("rFinish", FINISH), 2, 7),
    (routine("rFinish", FINISH) + routine("rRough", ROUGH) + MAIN, 7, 2),
    (routine("rRest", FINISH) + MAIN + routine("rRough", ROUGH) + routine("rFinish", FINISH), 7, 12),
    (MAIN + routine("rRough", f"{ROUGH}\nERROR\n{FINISH}") + routine("rFinish", FINISH), 2, 12),
    (MAIN.replace("rFinish;", "rRest;\nrFinish;\nrRest;") + routine("rRough", ROUGH) + routine("rRest", REST)
     + routine("rFinish", FINISH), 2, 9),
    ("CONST num nKind:=2;\n" + MAIN.replace("rRough;", "IF nKind=1 rRest;\nrRough;") + routine("rRest", FINISH)
     + routine("rRough", ROUGH) + routine("rFinish", FINISH), 7, 12),
    (MAIN.replace("rRough;", "rRough;\nrRough;") + routine("rRough", ROUGH) + routine("rFinish", FINISH), 2, 7),
])
def test_the_stock_is_taken_away_as_it_is_driven(tmp_path: Path, text: str, rough: int, finish: int) -> None:
    (tmp_path / "cell.yaml").write_text(kit.cell_text(extra=CUTTING))
    (tmp_path / "stock.yaml").write_text(STOCK)
    data = kit.module([]).split("PROC")[0]
    (tmp_path / "part.mod").write_text(f"{data}{text}ENDMODULE\n")
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_toolpath(tmp_path / "part.mod", cell).toolpath, cell)
    cut = cut_of(path, tmp_path / "stock.yaml", None)
    width = {}
    for name, move in (("rough", rough), ("finish", finish)):
        steps = (cut.track.move == move) & cut.engagement.cuts
        assert (np.diff(cut.track.place[steps]) > 0).all()
        np.testing.assert_allclose(cut.track.place[steps].mean(), path.length[move - 1] + 0.05, atol=0.004)
        width[name] = 1e3 * float(np.median(cut.engagement.width[steps]))
    assert width["rough"] == pytest.approx(5, abs=0.15)
    assert width["finish"] == pytest.approx(1, abs=0.15)
    assert "CS3123" not in {finding.code for finding in cut.findings()}
    idle = set(range(len(path.toolpath))) - set(range(rough - 2, rough + 3)) - set(range(finish - 2, finish + 3))
    assert not (set(cut.track.target[cut.engagement.cuts].tolist()) & idle)


@pytest.mark.parametrize(("data", "rough", "width"), [("PERS bool bRough:=FALSE;\n", False, 6), ("VAR num nKind;\n", True, 1)])
def test_branches_that_nobody_knows_are_told(tmp_path: Path, data: str, rough: bool, width: float) -> None:
    """By the values in the file, or, where it has none, as if all were driven."""
    (tmp_path / "cell.yaml").write_text(kit.cell_text(extra=CUTTING))
    (tmp_path / "stock.yaml").write_text(STOCK)
    condition = "DInput(diRough)=1" if rough else "bRough"
    text = data + MAIN.replace("rRough;", f"IF {condition} rRough;") + routine("rRough", ROUGH) + routine("rFinish", FINISH)
    (tmp_path / "part.mod").write_text(f"{kit.module([]).split('PROC')[0]}{text}ENDMODULE\n")
    cell = read_cell(tmp_path / "cell.yaml")
    path = robot_path(read_toolpath(tmp_path / "part.mod", cell).toolpath, cell)
    cut = cut_of(path, tmp_path / "stock.yaml", None)
    assert [finding.level for finding in cut.findings() if finding.code == "CS3123"] == ["warning"]
    steps = (cut.track.move == 7) & cut.engagement.cuts
    assert 1e3 * float(np.median(cut.engagement.width[steps])) == pytest.approx(width, abs=0.15)
