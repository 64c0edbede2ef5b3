"""Logs of programs with loops of unknown turns, or that cannot be followed: forces go to what was driven, or it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_branches import cut_short, program, seen
from tests.runs.command_line.test_followed_calls import AWAY, POINTS, A, B, force_at, log_of
from tests.runs.command_line.test_placement import Path3
from tests.runs.command_line.user_files import Job
from tests.support import long


def levels(result: kit.Result, code: str) -> list[str]:
    return [finding["level"] for finding in result.json["findings"] if finding["code"] == code]


@pytest.mark.parametrize("key", [long("path_mm"), "x_mm"])
@pytest.mark.parametrize("turns", [0, long(1), 3])
@pytest.mark.parametrize("body", [
    "A FOR i FROM 1 TO GInput(giPasses) DO AWAY ENDFOR B",
    "nTurn:=GInput(giPasses); A WHILE nTurn>0 DO AWAY nTurn:=nTurn-1; ENDWHILE B",
    "A WHILE DInput(diMore)=1 DO AWAY ENDWHILE B",
])
def test_the_log_tells_how_often_a_loop_was_driven(tmp_path: Path, body: str, turns: int, key: str) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, body)
    result = Job(tmp_path, program=text, forces=log_of(path, [*A, *turns * list(AWAY), *B], key)).correct(
        "--json", "--keep-targets")
    assert result.code == 0, result
    assert levels(result, "CS3123") == ["note"]
    assert "CS4118" not in kit.codes(result)
    seen(tmp_path, order, path, set())


def test_turns_that_data_state_are_taken_where_the_log_does_not_tell(tmp_path: Path) -> None:
    """A log that was stopped early."""
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A FOR i FROM 0 TO nPart DO AWAY ENDFOR B")
    log = "\n".join(log_of(path, [*A, *AWAY, *AWAY, *B], "path_mm").splitlines()[:-60]) + "\n"
    result = Job(tmp_path, program=text, forces=log).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert levels(result, "CS3123") == ["warning"]
    ends = {target for target in B if target > B[-1] - 8}
    rows = [row for row, target in zip(kit.table(tmp_path / "offsets.csv"), order, strict=True) if target not in ends]
    for row, target in zip(rows, [target for target in order if target not in ends], strict=True):
        assert bool(kit.column([row], "dx_um", "dy_um", "dz_um").any()) == bool(force_at(target).any()), row


def test_a_jump_is_said_to_be_not_followed(tmp_path: Path) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, _ = program(path, "A GOTO behind; AWAY behind: B")
    line = next(number for number, row in enumerate(text.splitlines(), 1) if "GOTO" in row)
    result = Job(tmp_path, program=text, forces=log_of(path, [*A, *B], "path_mm")).correct("--json", "--keep-targets")
    [finding] = [finding for finding in result.json["findings"] if finding["code"] == "CS4118"]
    assert (finding["level"], finding["line"]) == ("warning", line)
    assert "order of the text" in finding["message"]


@pytest.mark.parametrize("word", ["TriggL {},v50,trig1,z1,{};", "SearchL di1,pFound,{},v50,{};"])
def test_path_lengths_behind_a_move_that_is_not_counted_are_left_out(tmp_path: Path, word: str) -> None:
    """The robot drove along it, so that the log's path length has it."""
    path = Path3(np.array(POINTS, dtype=float))
    tail = kit.move("p").rsplit(",", 1)[1].rstrip(";")
    text, order = program(path, f"A {word.format('pFound', tail)} B")
    text = text.replace("PROC main", f"VAR robtarget pFound:={path.text[AWAY[0]]};\nPROC main")
    driven = log_of(path, [*A, AWAY[0], *B], "path_mm")
    result = Job(tmp_path, program=text, forces=driven).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert levels(result, "CS3124") == ["warning"]
    seen(tmp_path, order, path, set(B))


def test_path_lengths_behind_a_straight_move_that_is_not_counted_are_used(tmp_path: Path) -> None:
    """Path length is the same with and without it."""
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A B")
    old = kit.move(path.text[A[4]])
    tail = old.rsplit(",", 1)[1]
    result = Job(tmp_path, program=text.replace(old, f"TriggL {path.text[A[4]]},v50,trig1,z1,{tail}"),
                 forces=log_of(path, [*A, *B], "path_mm")).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert "CS3124" not in kit.codes(result)
    moved = [kit.column([row], "dx_um", "dy_um", "dz_um").any() for row in kit.table(tmp_path / "offsets.csv")]
    inside = [bool(force_at(target - 1).any() and force_at(target + 1).any()) for target in order if target != A[4]]
    assert all(moved[k] for k, cuts in enumerate(inside) if cuts)


@pytest.mark.parametrize("driven", [[*A, *B], [*A, *AWAY, *B]])
def test_a_branch_beside_a_target_of_unknown_position(tmp_path: Path, driven: list[int]) -> None:
    """Each way leaves out other rows: what lies before the move is used."""
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, f"A {kit.move('pFar')} IF DInput(diCheck)=1 THEN AWAY ENDIF B")
    text = text.replace("PROC main", "VAR robtarget pFar;\nPROC main")
    result = Job(tmp_path, program=text, forces=cut_short(log_of(path, driven, "path_mm"))).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert levels(result, "CS3124") == ["warning"]
    rows = kit.table(tmp_path / "offsets.csv")
    for target, row in zip([*A, -1, *order[len(A):]], rows, strict=True):
        inside = target in A and force_at(target - 1).any() and force_at(target + 1).any()
        assert inside <= bool(kit.column([row], "dx_um", "dy_um", "dz_um").any()), row
        assert target in A or not kit.column([row], "dx_um", "dy_um", "dz_um").any(), row


@pytest.mark.parametrize(("call", "driven"), [
    ("cut\\Near;", [*A, *B]), ("cut;", [*A, *AWAY, *B]), ("cut\\Near:=TRUE;", [*A, *B])])
def test_an_optional_argument_is_present_or_not(tmp_path: Path, call: str, driven: list[int]) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = program(path, "A IF NOT Present(Near) THEN AWAY ENDIF B")
    text = text.replace("PROC main()", f"PROC main()\n{call}\nENDPROC\nPROC cut(\\switch Near)")
    log = "\n".join(log_of(path, driven, "path_mm").splitlines()[:-40]) + "\n"         # its length tells nothing
    result = Job(tmp_path, program=text, forces=log).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert "CS3123" not in kit.codes(result)
    assert ("CS3122" in kit.codes(result)) == (len(driven) < len(order))
    seen(tmp_path, order, path, set())


def test_a_log_by_path_length_through_a_parameter_that_is_not_followed_is_refused(tmp_path: Path) -> None:
    """The routine stands behind all other moves in the text, where a place that is not known does not show."""
    path = Path3(np.array(POINTS, dtype=float))
    text, _ = program(path, f"AWAY {' '.join(20 * [f'cut p{k};' for k in range(8)])} B")
    data = "".join(f"VAR robtarget p{k}:={path.text[A[k + 1]]};\n" for k in range(8))
    cut = f"PROC cut(VAR robtarget p)\n{kit.move('p')}\np.trans.x:=0;\nENDPROC\n"
    text = text.replace("PROC main", f"{data}PROC main").replace("ENDMODULE", f"{cut}ENDMODULE")
    log = log_of(path, [*AWAY, *20 * list(A[1:9]), *B], "path_mm")
    result = Job(tmp_path, program=text, forces=log).correct("--json")
    assert result.code == 1, result
    assert "CS3124" in kit.codes(result)
