"""`correct --split`: what the correction itself declares never keeps the program from being split."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tests.runs.command_line.workshop import workshop


def test_a_copy_of_a_named_target_is_seen_by_the_parts(tmp_path: Path) -> None:
    """pA is reached in the cut and in the air: the correction declares a copy, in the module that calls the parts."""
    job = workshop("irb6660-205-1.90")
    head, body = job.files["part.mod"].split("PROC main()\n")
    moves = [line for line in body.splitlines() if "MoveL" in line]
    place = re.findall(r"MoveL (\[\[.*?9E9\]\])", body)
    named = "    MoveL pA,v50,z1,tMill\\WObj:=wPart;"
    air = [moves[5].replace("[[574", "[[634"), named]
    lines = [*moves[:5], named, *moves[6:], *air, *moves[:4]]
    program = f"{head}CONST robtarget pA:={place[5]};\nPROC main()\n" + "\n".join(lines) + "\nENDPROC\nENDMODULE\n"
    cut = [2 <= k <= 10 or k >= 15 for k in range(len(lines))]
    rng = np.random.default_rng(4)
    log = "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{k},{','.join(f'{value:.4f}' for value in rng.normal(0, 1, 3) + np.multiply(cuts, (80, 150, -60)))}\n"
        for k, cuts in enumerate(cut) for _ in range(20))
    run = job.run(tmp_path, {"part.mod": program, "forces.csv": log}, "correct", "@cell.yaml", "@part.mod", "--stiffness",
                  "@stiffness.json", "--forces", "@forces.csv", "--tare", "0:1", "-o", "@out.mod", "--split", "8")
    assert run.code == 0, run
    assert "CONST robtarget pA_c1" in (tmp_path / "out.mod").read_text()
    assert "LOCAL" not in (tmp_path / "out.mod").read_text()
    parts = [part.read_text() for part in sorted(tmp_path.glob("out_0*.mod"))]
    assert [("MoveL pA_c1," in part, "MoveL pA," in part) for part in parts if "MoveL pA" in part] == [
        (True, False), (False, True)]
    assert any(one["code"] == "CS2041" and "the parts see them" in one["hint"] for one in run.json["findings"])
