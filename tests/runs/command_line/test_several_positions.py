"""Moves that drive to several positions, of an array in a loop or of a parameter: said as what they are, and nothing behind
them is placed by a path length that nobody knows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import IRB6660, ORIGIN, TOOL, K, Path3
from tests.runs.command_line.user_files import Job

# A cut, a way to and fro that one move drives, and another cut.
WAY = [[90.0 + 3 * (k % 2), 10.0 + k, 5] for k in range(10)]
POINTS = np.array([*([10.0 * k, 0, 0] for k in range(10)), *WAY, *([90 - 10.0 * k, 30, 0] for k in range(10))])
FORCE, OTHER = np.array([90.0, -150, 60]), np.array([-90.0, 50, 160])


def moves(targets: list[str]) -> str:
    return "".join(f"{kit.move(target)}\n" for target in targets)


def programs(path: Path3) -> dict[str, str]:
    """The same program by a loop over an array, by a parameter, and, `written`, by a move for each position."""
    array = "CONST robtarget aWay{10}:=[" + ",\n".join(path.text[10:20]) + "];\n"
    first, last = moves(path.text[:10]), moves(path.text[20:])
    bodies = {
        "loop": f"PROC main()\n{first}FOR i FROM 1 TO nLast DO\n{kit.move('aWay{i}')}\nENDFOR\n{last}ENDPROC\n",
        "known": f"PROC main()\n{first}FOR i FROM 1 TO Dim(aWay,1) DO\n{kit.move('aWay{i}')}\nENDFOR\n{last}ENDPROC\n",
        "parameter": f"PROC main()\n{first}{''.join(f'rTo aWay{{{k + 1}}};' for k in range(10))}\n{last}ENDPROC\n"
                     f"PROC rTo(robtarget p)\n{kit.move('p')}\nENDPROC\n",
        "written": f"PROC main()\n{first}{moves([f'aWay{{{k + 1}}}' for k in range(10)])}{last}ENDPROC\n",
    }
    head = kit.module([]).split("PROC")[0].rstrip()
    return {name: f"{head}\n{array}{body}ENDMODULE\n" for name, body in bodies.items()}


def log(path: Path3, without_the_way: bool = False) -> str:
    """By path length, of the whole program, or of the path without what the one move drives."""
    places = np.array([path.at(point)[0] for point in path.xyz])
    if without_the_way:
        places = np.concatenate([places[:10], places[20:]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    rows = ["path_mm,fx_n,fy_n,fz_n"]
    for at in np.arange(0.0, length[-1], 0.5):
        force = FORCE if at <= length[9] + 2 else OTHER if at >= length[-10] - 2 else np.zeros(3)
        rows.append(",".join(f"{value:.4f}" for value in (at, *force)))
    return "\n".join(rows) + "\n"


def deviations(folder: Path) -> np.ndarray:
    return kit.column(kit.table(folder / "offsets.csv"), "dx_um", "dy_um", "dz_um")


def only_the_first_ten(folder: Path, path: Path3) -> None:
    """They deviate by their own force, and what comes behind them by none."""
    seen = deviations(folder)
    meant = kit.deviation(IRB6660, path.q[5], TOOL.p, np.r_[FORCE, 0, 0, 0], K) * 1e6
    np.testing.assert_allclose(seen[5], meant, atol=0.5)
    assert not np.nan_to_num(seen[10:]).any()


def test_forces_behind_such_a_move_are_left_where_the_log_counts_its_way(tmp_path: Path) -> None:
    path = Path3(POINTS)
    result = Job(tmp_path, program=programs(path)["loop"], forces=log(path)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert {"CS2056", "CS3124"} <= kit.codes(result)
    only_the_first_ten(tmp_path, path)


@pytest.mark.parametrize("name", ["written", "known", "parameter"])
def test_such_moves_are_corrected_where_the_text_settles_them(tmp_path: Path, name: str) -> None:
    path = Path3(POINTS)
    result = Job(tmp_path, program=programs(path)[name], forces=log(path)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert not {"CS2056", "CS3124"} & kit.codes(result)
    meant = kit.deviation(IRB6660, path.q[25], TOOL.p, np.r_[OTHER, 0, 0, 0], K) * 1e6
    np.testing.assert_allclose(deviations(tmp_path)[25], meant, atol=0.5)


def test_forces_behind_a_routine_of_another_file_do_not_land_on_other_targets(tmp_path: Path) -> None:
    """It is given a target and drives from there: its way is in the log, and nobody knows how long it is."""
    path = Path3(POINTS)
    head, body = programs(path)["written"].split("PROC main()\n")
    body = "".join(line + "\n" for line in body.splitlines() if "aWay{" not in line)
    lines = body.splitlines(keepends=True)
    text = f"{head}PROC main()\n{''.join(lines[:10])}    rTo aWay{{1}};\n{''.join(lines[10:])}"
    result = Job(tmp_path, program=text, forces=log(path)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert {"CS2016", "CS3124"} <= kit.codes(result)
    only_the_first_ten(tmp_path, path)


def test_elements_that_a_loop_hands_over_are_corrected_in_the_array(tmp_path: Path) -> None:
    """Each as under its own force: by target numbers, which count the calls where they stand."""
    path = Path3(POINTS[:10])
    array = "CONST robtarget aCut{10}:=[" + ",\n".join(path.text) + "];\n"
    head = kit.module([]).split("PROC")[0].rstrip()
    text = (f"{head}\n{array}PROC main()\nFOR i FROM 1 TO 10 DO\nrCut aCut{{i}};\nENDFOR\nENDPROC\n"
            f"PROC rCut(robtarget p)\n{kit.move('p')}\nENDPROC\nENDMODULE\n")
    force = np.outer(np.arange(10), [9.0, -15, 6])
    rows = "".join(f"{k},{','.join(f'{value:.4f}' for value in force[k])}\n" for k in range(10))
    result = Job(tmp_path, program=text, forces=f"target,fx_n,fy_n,fz_n\n{rows}").correct("--json")
    assert result.code == 0, result
    for k, seen in enumerate(deviations(tmp_path)):
        if k:
            meant = kit.deviation(IRB6660, path.q[k], TOOL.p, np.r_[force[k], 0, 0, 0], K) * 1e6
            np.testing.assert_allclose(seen, meant, atol=0.5)
    written = (tmp_path / "out.mod").read_text()
    assert "rCut aCut{i};" in written
    assert written.count("robtarget") == text.count("robtarget")


def test_an_array_in_a_loop_gets_the_targets_that_a_step_of_force_asks_for(tmp_path: Path) -> None:
    """Along a straight pass of three moves the force turns round halfway between two targets."""
    path = Path3(np.array([[40.0 * k, 0, 0] for k in range(4)]))
    head = kit.module([]).split("PROC")[0].rstrip()
    array = "CONST robtarget aCut{4}:=[" + ",\n  ".join(path.text) + "];"
    loop = f"FOR i FROM 1 TO 4 DO\n{kit.move('aCut{i}')}\nENDFOR"
    text = f"{head}\n{array}\nPROC main()\n{loop}\nENDPROC\nENDMODULE\n"
    rows = "".join(f"{at:.1f},{','.join(map(str, FORCE if at < 60 else OTHER))}\n" for at in np.arange(0, 120.1, 0.2))
    result = Job(tmp_path, program=text, forces=f"path_mm,fx_n,fy_n,fz_n\n{rows}").correct("--json")
    assert result.code == 0, result

    written = (tmp_path / "out.mod").read_text()
    size = int(written.split("aCut{")[1].split("}")[0])
    assert size > 4
    assert written.split("PROC main()")[1] == text.split("PROC main()")[1].replace("TO 4 DO", f"TO {size} DO")
    assert len(written.splitlines()) == len(text.splitlines()) + size - 4      # an element a line, as before
    texts = re.findall(r"\[\[?\[([^][]*)\],\[[^][]*\],\[[^][]*\],\[9E", written)
    place = np.array([row.split(",") for row in texts], dtype=float)
    assert len(place) == size
    along, across = np.split((place - path.at([0, 0, 0])) @ ORIGIN.r.as_matrix(), [1], axis=1)
    assert (np.diff(along[:, 0]) > 0).all()
    near = np.abs(along[:, 0] - 60) < 2.5
    assert np.count_nonzero(np.abs(along[:, 0] - 60) < 5) >= 2
    for at, off in zip(along[~near, 0], across[~near], strict=True):
        force, joints = (FORCE, path.q[0]) if at < 60 else (OTHER, path.q[3])
        meant = kit.deviation(IRB6660, joints, TOOL.p, np.r_[force, 0, 0, 0], K)
        meant = (kit.work_object().r * ORIGIN.r).inv().apply(1e3 * meant)[1:]
        np.testing.assert_allclose(off, -meant, atol=0.1 * np.abs(meant).max())


def test_a_log_that_does_not_count_its_way_is_used(tmp_path: Path) -> None:
    path = Path3(POINTS)
    result = Job(tmp_path, program=programs(path)["loop"], forces=log(path, True)).correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert "CS3124" not in kit.codes(result)
    meant = kit.deviation(IRB6660, path.q[25], TOOL.p, np.r_[OTHER, 0, 0, 0], K) * 1e6
    np.testing.assert_allclose(deviations(tmp_path)[16], meant, atol=0.5)


def test_a_log_that_numbers_the_positions_is_told_why_there_are_fewer(tmp_path: Path) -> None:
    path = Path3(POINTS)
    rows = "".join(f"{k},90,-150,60\n" for k in range(30))
    text = programs(path)["loop"]
    result = Job(tmp_path, program=text, forces=f"target,fx_n,fy_n,fz_n\n{rows}").correct("--json")
    assert result.code == 1, result
    error = next(finding for finding in result.json["findings"] if finding["level"] == "error")
    line = next(k for k, row in enumerate(text.splitlines(), 1) if "MoveL aWay{i}" in row)
    assert error["code"] == "CS3004"
    assert f"the move in line {line} counts as one target" in error["hint"]
    assert "index of aWay" in error["hint"]


def test_a_program_of_nothing_else_is_told_why(tmp_path: Path) -> None:
    path = Path3(POINTS)
    text = programs(path)["loop"]
    for target in (*path.text[:10], *path.text[20:]):
        text = text.replace(kit.move(target) + "\n", "")
    result = Job(tmp_path, program=text, forces=log(path)).correct("--json")
    assert result.code == 1, result
    error = next(finding for finding in result.json["findings"] if finding["level"] == "error")
    assert error["code"] == "CS3005"
    assert "write a move to a robtarget in numbers for each position" in error["hint"]


def test_the_variable_of_a_loop_hides_a_constant_of_its_name(tmp_path: Path) -> None:
    path = Path3(POINTS[:10])
    text = path.program().replace("PROC main()", "CONST num i:=3;\nPROC main()").replace(
        kit.move(path.text[5]), f"FOR i FROM 1 TO 1 DO\n{kit.move(f'Offs({path.text[5]},0,0,i)')}\nENDFOR")
    result = Job(tmp_path, program=text, forces="target,fx_n,fy_n,fz_n\n4,90,-150,60\n5,90,-150,60\n").correct("--json")
    assert result.code == 0, result
    assert "CS2059" in kit.codes(result)        # its place is known, and what the counter moves is left as it is
    assert f"Offs({path.text[5]},0,0,i)" in (tmp_path / "out.mod").read_text()
