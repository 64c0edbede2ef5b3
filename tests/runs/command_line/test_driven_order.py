"""Programs whose routines are called twice, under a displacement or out of order: no correction without a word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import Path3, line
from tests.runs.command_line.user_files import Job

FORCE = "90,-150,60"


def job(folder: Path, path: Path3, main: str, header: str = "x_mm,y_mm,z_mm", first: bool = False) -> Job:
    """The path as routine rCut, an air move as rHome, and main that calls them."""
    program = path.program()
    away = kit.move(kit.robtarget(path.frames[0], kit.confdata(path.q[0]), digits=8), "MoveJ")
    name = next(row for row in program.splitlines() if "PROC" in row.upper())
    own = f"PROC main()\n{main}\nENDPROC\n"
    home = f"PROC rHome()\n{away}\nENDPROC\n"
    body = program.replace(name, f"{own if first else ''}PROC rCut()", 1)
    end = body.upper().rindex("ENDMODULE")
    body = body[:end] + home + ("" if first else own) + body[end:]
    places = np.arange(0.0, 190.1, 0.5)
    if header == "path_mm":
        rows = "".join(f"{place:.4f},{FORCE}\n" for place in places)
    else:
        start, stop = path.at(path.xyz[0])[0], path.at(path.xyz[-1])[0]
        points = start + np.multiply.outer(places / places[-1], stop - start)
        rows = "".join(f"{x:.4f},{y:.4f},{z:.4f},{FORCE}\n" for x, y, z in points)
    return Job(folder, program=body, forces=f"{header},fx_n,fy_n,fz_n\n{rows}")


@pytest.mark.parametrize(("main", "told"), [
    ("rHome;\nrCut;\nrHome;", False),
    ("rHome;\nWHILE TRUE DO\nrCut;\nENDWHILE", False),
    ("rCut;\nrCut;", True),
    ("rHome;\nFOR i FROM 1 TO 2 DO\nrCut;\nENDFOR", True),
    ("VAR num n:=0;\nrHome;\nWHILE n<2 DO\nrCut;\nn:=n+1;\nENDWHILE", True),
    ("VAR num n:=0;\nrHome;\nWHILE n<2 DO\nrCut;\nIncr n;\nENDWHILE", True),
    ('rHome;\n%"rCut"%;\n%"rCut"%;', True),
    ("VAR num n:=0;\nVAR bool last:=FALSE;\nrHome;\nWHILE NOT last DO\nrCut;\nIncr n;\nlast:=n=2;\nENDWHILE", True),
    ("VAR bool last;\nWHILE NOT last DO\nrCut;\nlast:=TestDI(diLast);\nENDWHILE", False),
])
def test_targets_that_cut_twice_are_told(tmp_path: Path, main: str, told: bool) -> None:
    cut = job(tmp_path, line(20, 10), main)
    result = cut.correct("--json")
    assert result.code == 0
    found = [finding for finding in result.json["findings"] if finding["code"] == "CS4117"]
    text = str(cut.program).splitlines()
    calls = [str(number) for number, row in enumerate(text, 1) if "rCut" in row and "PROC" not in row]
    first = next(number for number, row in enumerate(text, 1) if "Move" in row)
    assert [(one["line"], one["target"], one["message"].partition(":")[0]) for one in found] == [
        (first, 0, f"20 targets with force are driven more than once a run (called in line {', '.join(calls)})")] * told
    assert "CS4118" not in kit.codes(result)


@pytest.mark.parametrize("first", [False, True])
def test_a_routine_called_under_a_displacement_is_left_as_it_is(tmp_path: Path, first: bool) -> None:
    shift = "PDispSet [[0,0,-2],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    for main in (f"{shift}\nrCut;\nPDispOff;", f"FOR i FROM 1 TO 2 DO\nrCut;\n{shift}\nENDFOR\nPDispOff;"):
        result = job(tmp_path, line(20, 10), main, first=first).correct("--json")
        assert result.code == 3
        assert {"CS2015", "CS3086"} <= kit.codes(result)


TURNS = [10, 11, 12, 13, 14, 15, 16, 17, 18, 19, *range(10)]      # of the targets of the text, as driven


def behind_first(path: Path3) -> str:
    """The second half of the path as a routine behind the first half's, and main that calls it first."""
    first, second = ("".join(f"{kit.move(target)}\n" for target in some) for some in (path.text[:10], path.text[10:]))
    head = kit.module([]).split("PROC")[0]
    return (f"{head}PROC rFirst()\n{first}ENDPROC\nPROC rSecond()\n{second}ENDPROC\n"
            "PROC main()\nrSecond;\nrFirst;\nENDPROC\nENDMODULE\n")


def test_a_target_ahead_is_driven_to_from_the_one_before_it_in_the_order_of_the_calls(tmp_path: Path) -> None:
    """Ten samples on the way to each; the force is another one behind each target."""
    path, force = line(20, 10), np.outer(np.arange(1, 21), [9.0, -15, 6])
    rows = "".join(f"{number},{','.join(f'{value:.4f}' for value in force[turn])}\n"
                   for turn, number in enumerate(TURNS) for _ in range(10))
    cut = Job(tmp_path, program=behind_first(path), forces=f"target,fx_n,fy_n,fz_n\n{rows}")
    cut.cell += "force_log: {target: ahead}\n" if "force_log:" not in cut.cell else ""
    result = cut.correct("--json", "--keep-targets")
    assert result.code == 0, result
    assert {"CS3040", "CS3122"} <= kit.codes(result)
    seen = kit.column(cut.offsets(), "dx_um", "dy_um", "dz_um")
    for turn, number in enumerate(TURNS[:-1]):
        if number in (9, 19, 0, 10):        # where a routine ends the way on is not in the text
            continue
        meant = kit.deviation(kit.IRB6660, path.q[number], kit.TOOL.p, np.r_[force[turn:turn + 2].mean(axis=0), 0, 0, 0], kit.K)
        np.testing.assert_allclose(seen[number], 1e6 * meant, rtol=0.03, atol=0.5)


@pytest.mark.parametrize("turns", [[*TURNS, *TURNS], list(range(20))])
def test_targets_ahead_in_another_order_or_twice_are_told(tmp_path: Path, turns: list[int]) -> None:
    rows = "".join(f"{number},{FORCE}\n" for number in turns for _ in range(10))
    cut = Job(tmp_path, program=behind_first(line(20, 10)), forces=f"target,fx_n,fy_n,fz_n\n{rows}")
    cut.cell += "force_log: {target: ahead}\n"
    result = cut.correct("--json")
    assert result.code == 1
    assert "CS3119" in kit.codes(result)


@pytest.mark.parametrize("named", ["ahead", "nearest"])
def test_numbers_of_the_corrected_program_count_as_it_drives(tmp_path: Path, named: str) -> None:
    """The second half is cut first; the force turns round in the middle of a move, so that targets are added there. A second
    log, with the written program's numbers, is placed as the first, by positions."""
    path = line(20, 10)
    cut = Job(tmp_path, program=behind_first(path))
    cut.cell += f"force_log: {{target: {named}}}\n"
    along = np.concatenate([np.arange(100.0, 190.1, 0.1), np.arange(0.0, 90.1, 0.1)])
    force = np.where(((along > 55) ^ (along > 145))[:, None], [90.0, -150, 60], [-90.0, 150, -60])
    loads = [",".join(map(str, row)) for row in force.tolist()]
    places = np.round(path.at(np.outer(along, [1, 0, 0])), 4).tolist()
    cut.forces = "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "".join(
        f"{','.join(map(str, place))},{load}\n" for place, load in zip(places, loads, strict=True))
    result = cut.correct("--json")
    assert result.code == 0, result
    first = cut.offsets()
    cut.offsets_file.rename(tmp_path / "first.csv")
    shares = [[*(float(share) for share in row["added"].split()), 1.0] for row in first]
    given = 10 * np.array([place - 1 + share for place, some in enumerate(shares) for share in some])
    assert len(given) > 20
    routine = given < 95 - 1e-9
    numbers = np.empty(len(along), dtype=int)
    for half, mine in ((True, along <= 90), (False, along >= 100)):
        own, (at,) = given[routine == half], np.nonzero(routine == half)
        if named == "ahead":
            numbers[mine] = at[np.minimum(np.searchsorted(own, along[mine] - 1e-6), len(own) - 1)]
        else:
            numbers[mine] = at[np.argmin(np.abs(along[mine][:, None] - own), axis=1)]
    cut.forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{number},{load}\n" for number, load in zip(numbers, loads, strict=True))
    again = cut.correct("--json", "--force", "--correct-again", "--logged-with", tmp_path / "first.csv")
    assert again.code == 0, again
    assert "CS4127" in kit.codes(again)
    before, after = (kit.column(rows, "dx_um", "dy_um", "dz_um") for rows in (first, cut.offsets()))
    inner = [k for k in range(20) if k not in (0, 9, 10, 19)]
    np.testing.assert_allclose(after[inner], before[inner], rtol=0.04)


@pytest.mark.parametrize(("header", "main", "told"), [
    ("path_mm", "rCut;\nrHome;", False), ("path_mm", "rHome;\nrCut;", False), ("x_mm,y_mm,z_mm", "rHome;\nrCut;", False),
    ("path_mm", "GOTO over;\nover:\nrHome;\nrCut;", True)])
def test_path_lengths_of_another_order_are_told(tmp_path: Path, header: str, main: str, told: bool) -> None:
    """rHome stands behind rCut in the text: driven before it, the path length of the log begins with it. It is told where the
    text is not followed."""
    result = job(tmp_path, line(20, 10), main, header).correct("--json")
    assert result.code == 0
    assert ("CS4118" in kit.codes(result)) == told
