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
    ("VAR bool last;\nWHILE NOT last DO\nrCut;\nlast:=TestDI(diLast);\nENDWHILE", False),
])
def test_targets_that_cut_twice_are_told(tmp_path: Path, main: str, told: bool) -> None:
    result = job(tmp_path, line(20, 10), main).correct("--json")
    assert result.code == 0
    assert ("CS4117" in kit.codes(result)) == told
    assert "CS4118" not in kit.codes(result)


@pytest.mark.parametrize("first", [False, True])
def test_a_routine_called_under_a_displacement_is_left_as_it_is(tmp_path: Path, first: bool) -> None:
    shift = "PDispSet [[0,0,-2],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    result = job(tmp_path, line(20, 10), f"{shift}\nrCut;\nPDispOff;", first=first).correct("--json")
    assert result.code == 3
    assert {"CS2015", "CS3086"} <= kit.codes(result)


@pytest.mark.parametrize(("header", "main", "told"), [
    ("path_mm", "rCut;\nrHome;", False), ("path_mm", "rHome;\nrCut;", False), ("x_mm,y_mm,z_mm", "rHome;\nrCut;", False),
    ("path_mm", "GOTO over;\nover:\nrHome;\nrCut;", True)])
def test_path_lengths_of_another_order_are_told(tmp_path: Path, header: str, main: str, told: bool) -> None:
    """rHome stands behind rCut in the text: driven before it, the path length of the log begins with it. It is told where the
    text is not followed."""
    result = job(tmp_path, line(20, 10), main, header).correct("--json")
    assert result.code == 0
    assert ("CS4118" in kit.codes(result)) == told
