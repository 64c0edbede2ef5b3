"""Logs of programs with branches: forces go to the moves that were driven, and where that is not known they are left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_followed_calls import AWAY, POINTS, A, B, force_at, log_of
from tests.runs.command_line.test_placement import IRB6660, TOOL, K, Path3
from tests.runs.command_line.user_files import Job
from tests.runs.milling.carried_job import SLIDE_ZERO, slide_yaml
from tests.support import long

DATA = "CONST num nKind:=2;\nPERS num nPart:=1;\nVAR num nTurn;\nLOCAL VAR bool bTry;\nPERS bool bCheck:=TRUE;\n"


def program(path: Path3, main: str) -> tuple[str, list[int]]:
    """The body of main with the moves of `A`, `B` and `AWAY` in it, and its targets in the order of its text."""
    order: list[int] = []
    lines = []
    for word in main.split():
        which = {"A": A, "B": B, "AWAY": AWAY}.get(word)
        order += which or []
        lines.append(word if which is None else "\n" + "\n".join(kit.move(path.text[target]) for target in which) + "\n")
    head = kit.module([]).split("PROC")[0].rstrip()
    return f"{head}\n{DATA}PROC main()\n{' '.join(lines)}\nENDPROC\nENDMODULE\n", order


def seen(folder: Path, order: list[int], path: Path3, left: set[int]) -> None:
    """Every target has the deviation of its own force, none where it is one of those `left`."""
    rows = kit.table(folder / "offsets.csv")
    assert len(rows) == len(order)
    for target, row in zip(order, rows, strict=True):
        deviation = kit.column([row], "dx_um", "dy_um", "dz_um")[0]
        if target in left or target in AWAY:
            assert not deviation.any(), (target, row)
        elif force_at(target - 1).any() and force_at(target + 1).any():       # the ends have samples of the air beside them
            meant = kit.deviation(IRB6660, path.q[target], TOOL.p, np.r_[force_at(target), 0, 0, 0], K) * 1e6
            np.testing.assert_allclose(deviation, meant, atol=2.0, err_msg=str(row))


SETTLED = {
    "a constant": "A IF nKind=1 THEN AWAY ENDIF B",
    "else": "IF nKind=2 THEN A ELSE AWAY ENDIF B",
    "elseif": "A IF nKind>2 THEN AWAY ELSEIF nKind>1 THEN B ELSE AWAY ENDIF",
    "words": "A IF NOT (nKind>=2 AND nKind<>3) OR FALSE THEN AWAY ENDIF B",
    "test": "A TEST nKind+1 CASE 1,2: AWAY CASE 3: B DEFAULT: AWAY ENDTEST",
    "assigned": "nTurn:=1; A nTurn:=nTurn+1; IF nTurn<2 THEN AWAY ENDIF B",
    "a loop's variable": "FOR i FROM 1 TO 2 DO IF i=1 THEN A ELSEIF i=3 THEN AWAY ELSE B ENDIF ENDFOR",
    "a loop of no turn": "A FOR i FROM 1 TO nKind-2 STEP 1 DO AWAY ENDFOR B",
    "return": "A B IF nKind=2 RETURN; AWAY",
    "a variable of this module alone": "A IF bTry THEN AWAY ENDIF B",
}


@pytest.mark.parametrize("key", ["path_mm", long("x_mm")])
@pytest.mark.parametrize("name", SETTLED)
def test_a_branch_that_the_text_settles_is_followed(tmp_path: Path, name: str, key: str) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, SETTLED[name])
    result = Job(tmp_path, program=text, forces=log_of(path, [*A, *B], key)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert kit.codes(result) & {"CS3122", "CS3123", "CS4118"} == ({"CS3122"} if list(A) + list(B) != order else set())
    seen(tmp_path, order, path, set())


@pytest.mark.parametrize("key", ["path_mm", long("x_mm")])
@pytest.mark.parametrize("body", [
    "A IF DInput(diCheck)=1 THEN AWAY ENDIF B",
    "A IF nTurn=0 THEN AWAY ENDIF B",                           # another module may set it
    "A IF bCheck THEN AWAY ENDIF B",                            # PERS data that someone has changed since
    "A IF DInput(diCheck)=1 THEN AWAY RETURN; ENDIF B",
    "A TEST GInput(giPart) CASE 1: B CASE 2: AWAY ENDTEST",
])
def test_the_log_tells_which_branch_was_driven(tmp_path: Path, body: str, key: str) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, body)
    result = Job(tmp_path, program=text, forces=log_of(path, [*A, *B], key)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert [finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3123"] == ["note"]
    seen(tmp_path, order, path, set())


@pytest.mark.parametrize("driven", [[*A, *AWAY, *B], [*A, *B]])
def test_a_branch_that_was_driven_is_known_by_it(tmp_path: Path, driven: list[int]) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A IF DInput(diCheck)=1 THEN AWAY ENDIF B")
    result = Job(tmp_path, program=text, forces=log_of(path, driven, "path_mm")).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert ("CS3122" in kit.codes(result)) == (len(driven) < len(order))
    seen(tmp_path, order, path, set())


def cut_short(log: str) -> str:
    """All but its last move, in which nothing cuts."""
    rows = log.splitlines()
    return "\n".join(rows[:-len(rows) // 14]) + "\n"


def test_where_nothing_tells_forces_behind_a_branch_are_left(tmp_path: Path) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A IF DInput(diCheck)=1 THEN AWAY ENDIF B")
    log = cut_short(log_of(path, [*A, *B], "path_mm"))
    result = Job(tmp_path, program=text, forces=log).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert [finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3123"] == ["warning"]
    seen(tmp_path, order, path, set(B))


def test_values_in_the_file_are_taken_where_nothing_else_tells_with_a_warning(tmp_path: Path) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A IF NOT bCheck THEN AWAY ENDIF B")
    log = cut_short(log_of(path, [*A, *B], "path_mm"))
    result = Job(tmp_path, program=text, forces=log).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert [finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3123"] == ["warning"]
    seen(tmp_path, order, path, set())


def test_a_log_that_lies_elsewhere_by_each_way_is_refused(tmp_path: Path) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, _ = program(path, "IF DInput(diCheck)=1 THEN AWAY ENDIF A B")
    result = Job(tmp_path, program=text, forces=cut_short(log_of(path, [*A, *B], "path_mm"))).correct("--json")
    assert result.code == 1, result
    assert "CS3123" in kit.codes(result)


def test_branches_without_moves_change_nothing(tmp_path: Path) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    body = " ".join(f"IF DInput(di{k})=1 THEN SetDO do{k},1; ELSE TPWrite name; ENDIF" for k in range(40))
    text, order = program(path, f"A {body} B IF DInput(diEnd)=1 RETURN;")
    result = Job(tmp_path, program=text, forces=log_of(path, order, "path_mm")).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert not kit.codes(result) & {"CS3122", "CS3123", "CS4118"}
    seen(tmp_path, order, path, set())


def on_a_track(text: str, path: Path3) -> str:
    """The program with another place of the robot's track at each target."""
    for target, one in enumerate(path.text):
        text = text.replace(one, one.replace(kit.E, f"[{SLIDE_ZERO + 0.5 * target},9E9,9E9,9E9,9E9,9E9]"))
    return text


@pytest.mark.parametrize("key", ["path_mm", long("x_mm")])
@pytest.mark.parametrize("body", ["A IF DInput(diCheck)=1 THEN AWAY ENDIF B", "A IF nKind=1 THEN AWAY ENDIF B"])
def test_a_branch_is_followed_on_a_moving_track(tmp_path: Path, body: str, key: str) -> None:
    """As the program without it is."""
    path = Path3(np.array(POINTS, dtype=float))
    log, cell = log_of(path, [*A, *B], key), kit.cell_text(extra=f"mechanical_units:\n{slide_yaml()}")
    tables = []
    for name, main in (("with", body), ("without", "A B")):
        (tmp_path / name).mkdir()
        text, order = program(path, main)
        result = Job(tmp_path / name, cell=cell, program=on_a_track(text, path), forces=log).correct("--json", "--keep-targets")
        assert result.code == 0, result
        assert [finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3123"] in ([], ["note"])
        rows = dict(zip(order, kit.table(tmp_path / name / "offsets.csv"), strict=True))
        tables.append(kit.column([rows[target] for target in [*A, *B]], "dx_um", "dy_um", "dz_um"))
    np.testing.assert_allclose(tables[0][:len(A) - 1], tables[1][:len(A) - 1], atol=0.01)
    np.testing.assert_allclose(tables[0][len(A) + 1:], tables[1][len(A) + 1:], atol=0.01)
    assert np.abs(tables[1]).max() > 100
