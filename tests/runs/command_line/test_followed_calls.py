"""Logs of programs that do not drive their moves in the order of the text: each sample goes to the move that was driven."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import IRB6660, TOOL, K, Path3
from tests.runs.command_line.user_files import Job

STEP, CUTS, LIFT = 5.0, 12, 20.0
# One cut of rA and one of rB, each with a move down to it and one up from it; those of rAway stand far off.
POINTS = [[0, 0, LIFT], *([STEP * i, 0, 0] for i in range(CUTS)), [STEP * (CUTS - 1), 0, LIFT],
          [0, 30, LIFT], *([STEP * i, 30, 0] for i in range(CUTS)), [STEP * (CUTS - 1), 30, LIFT],
          [-60, 90, 60], [60, 90, 60]]
A, B, AWAY = range(CUTS + 2), range(CUTS + 2, 2 * CUTS + 4), range(2 * CUTS + 4, 2 * CUTS + 6)
MAIN = "PROC main()\nrA;\nrB;\nENDPROC\n"


def force_at(target: int, share: float = 0.0) -> np.ndarray:
    """Force [N] at a target of a cut, or a share of the way to the next one; none beside the cuts."""
    place = (target - 1 if target in A else target - B[0] - 1) + share
    if not 0 <= place <= CUTS - 1 or target in AWAY:
        return np.zeros(3)
    return np.array([80.0, -150, 60]) + place * np.array([6.0, 9, -4]) if target in A else np.array(
        [-120.0, 40, 90]) + place * np.array([-5.0, 7, 3])


def routine(path: Path3, name: str, targets: range, handler: range | None = None, kind: str = "PROC") -> str:
    def moves(which: range) -> str:
        return "\n".join(kit.move(path.text[target]) for target in which)

    behind = "" if handler is None else f"\nERROR\nStopMove;\n{moves(handler)}\nRETRY;"
    return f"{kind} {name}{'' if kind == 'TRAP' else '()'}\n{moves(targets)}{behind}\nEND{kind}\n"


def log_of(path: Path3, driven: list[int], key: str) -> str:
    """Samples every half millimetre along the targets as driven."""
    rows, length, now = [f"{'time_s,x_mm,y_mm,z_mm' if key == 'x_mm' else key},fx_n,fy_n,fz_n"], 0.0, 0.0
    for here, there in pairwise(driven):
        start, end = (path.at(path.xyz[target])[0] for target in (here, there))
        way = float(np.linalg.norm(end - start))
        for share in np.arange(0, 1, 0.5 / way):
            f = force_at(here, share) if there == here + 1 else force_at(-1)
            point = start + share * (end - start)
            place = {"path_mm": [length + share * way], "x_mm": [now + share * way / 50, *point],
                     "target": [here if share < 0.5 else there]}[key]
            rows.append(",".join(f"{value:.6f}" for value in (*place, *f)))
        length, now = length + way, now + way / 50
    return "\n".join(rows) + "\n"


def programs(path: Path3) -> dict[str, tuple[str, list[int]]]:
    """The program, and its targets in the order of its text."""
    a, b = routine(path, "rA", A), routine(path, "rB", B)
    texts = {
        "service": (MAIN + a + routine(path, "rAway", AWAY) + b, [*A, *AWAY, *B]),
        "service first": (routine(path, "rAway", AWAY) + MAIN + a + b, [*AWAY, *A, *B]),
        "handler": (MAIN + routine(path, "rA", A, AWAY) + b, [*A, *AWAY, *B]),
        "trap": (MAIN + a + routine(path, "tAway", AWAY, kind="TRAP") + b, [*A, *AWAY, *B]),
        "other order": (b + a + MAIN, [*B, *A]),
        "by name": (b + a + MAIN.replace("rA;", '%"rA"%;'), [*B, *A]),
    }
    data = kit.module([]).split("PROC")[0].rstrip()
    return {name: (f"{data}\n{text}ENDMODULE\n", order) for name, (text, order) in texts.items()}


@pytest.mark.parametrize("key", ["path_mm", "x_mm", "target"])
@pytest.mark.parametrize("name", ["service", "service first", "handler", "trap", "other order", "by name"])
def test_a_log_follows_the_calls(tmp_path: Path, name: str, key: str) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, order = programs(path)[name]
    numbers = {target: number for number, target in enumerate(order)}
    log = log_of(path, [*A, *B], key)
    if key == "target":         # numbered by the text, as docs/formats.md says
        head, *rows = log.splitlines()
        log = "\n".join([head, *(f"{numbers[int(float(row.split(',')[0]))]},{row.split(',', 1)[1]}" for row in rows)]) + "\n"
    result = Job(tmp_path, program=text, forces=log).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert ("CS3122" in kit.codes(result)) == (key != "target")
    assert "CS4118" not in kit.codes(result)
    rows = kit.table(tmp_path / "offsets.csv")
    assert len(rows) == len(order)
    for target, row in zip(order, rows, strict=True):
        seen = kit.column([row], "dx_um", "dy_um", "dz_um")[0]
        wrench = np.r_[force_at(target), 0, 0, 0]
        if target in AWAY:
            assert (float(np.abs(seen).max()), row["samples"]) == (0.0, "0"), row
        elif force_at(target - 1).any() and force_at(target + 1).any():       # the ends have samples of the air beside them
            meant = kit.deviation(IRB6660, path.q[target], TOOL.p, wrench, K) * 1e6
            np.testing.assert_allclose(seen, meant, atol=2.0, err_msg=str(row))


def test_one_routine_started_by_itself_is_found_where_the_log_lies(tmp_path: Path) -> None:
    """The pointer set to a routine that main does not call."""
    path = Path3(np.array(POINTS, dtype=float))
    text, order = programs(path)["service"]
    result = Job(tmp_path, program=text.replace("\nrB;\n", "\n"), forces=log_of(path, [*B], "x_mm")).correct("--json")
    assert result.code == 0, result
    assert "CS3122" not in kit.codes(result)
    moved = [target for target, row in zip(order, kit.table(tmp_path / "offsets.csv"), strict=False) if float(row["ox_mm"])]
    assert moved
    assert set(moved) <= set(B)


@pytest.mark.parametrize(("key", "level"), [("path_mm", "warning"), ("x_mm", "note")])
def test_an_idle_routine_that_cuts_is_a_warning_where_no_position_tells(tmp_path: Path, key: str, level: str) -> None:
    path = Path3(np.array(POINTS, dtype=float))
    text, _ = programs(path)["service first"]
    result = Job(tmp_path, program=text, forces=log_of(path, [*A, *B], key)).correct("--json")
    assert [finding["level"] for finding in result.json["findings"] if finding["code"] == "CS3122"] == [level]


@pytest.mark.parametrize(("feed", "said"), [("v50", True), ("v500", False)])
def test_a_cut_that_goes_on_over_a_call_is_said_to_be_left_between_its_ends(tmp_path: Path, feed: str, said: bool) -> None:
    """No move of the text leads from rA to rB: what the force does between them nobody can add a target for."""
    path = Path3(np.array(POINTS, dtype=float))
    text, order = programs(path)["other order"]
    first = kit.move(path.text[B[0]])
    job = Job(tmp_path, program=text.replace(first, first.replace("v50", feed)), forces=log_of(path, [*A, *B], "x_mm"))
    result = job.correct("--json")
    assert result.code == 0, result
    [message] = [finding["message"] for finding in result.json["findings"] if finding["code"] == "CS3122"]
    line = next(k for k, row in enumerate(text.splitlines(), 1) if first.strip() == row.strip())
    assert (f"that a call leads to (line {line}) is looked at at both ends alone" in message) == said
    assert len(order) == len(A) + len(B)
