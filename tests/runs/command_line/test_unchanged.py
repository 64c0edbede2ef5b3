"""What must not change does not: bytes, encodings, line ends, air targets, programs without force; records and rewrites."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import F0, Path3, line
from tests.runs.command_line.user_files import Job
from tests.support import cpu_seconds, started


def by_target(forces: dict[int, np.ndarray]) -> str:
    return "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{f[0]},{f[1]},{f[2]}\n" for i, f in forces.items())


def rich(path: Path3) -> str:
    """Everything a post-processor and a programmer leave in a file."""
    t = path.text
    return f"""%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Fräsen(SYSMODULE)
  ! Teil 4711 – "nicht" [[1,2,3],[1,0,0,0],[0,0,0,0],{kit.E}] ändern
  {kit.tooldata()}
  {kit.wobjdata()}
  CONST robtarget pHome := {t[0]}  ;   ! comment; with := inside
  PERS   robtarget pCut:={t[2]};
  LOCAL CONST string s:="a ! b := MoveL [[1,2,3],[1,0,0,0]";
  VAR num n := 9E+09;
  PROC main ( )
\tConfL\\Off;  SingArea\\Wrist;
    TPWrite "start ! MoveL pCut";
    movel pHome , v1000, fine\\Inpos:=inpos20 ,tMill \\WObj := wPart ;
    SetDO doSpindle , 1 ;
    MOVEL\t{t[1]}, [50,500,5000,1000] \\V:=40, z1\\Z:=0.5, tMill\\WObj:=wPart ;  ! cut 1
    MoveL\\Conc, pCut, v50\\T:=2.5, z1, tMill, \\WObj:=wPart;
    IF n > 3 THEN
      MoveL {t[3].split("],[")[0]}],
        [{"],[".join(t[3].split("],[")[1:])},
        v50,z1,tMill\\WObj:=wPart; WaitTime\\InPos,0.1;
    ENDIF
    MoveL {t[4].replace(",", " , ")},v50,z1,tMill\\WObj:=wPart;
    MoveL pHome,v1000,fine,tMill\\WObj:=wPart;
  ERROR
    RETRY;
  ENDPROC
ENDMODULE
"""


FORCES = {1: F0, 2: F0 * 0.5, 3: F0 * 2, 4: -F0}


def skeleton(text: str) -> str:
    """The text without what a robtarget's first seven numbers are."""
    number = r"\s*[-+0-9.eE]+\s*"
    pattern = re.compile(
        rf"\[\s*\[({number},){{2}}{number}\]\s*,\s*\[({number},){{3}}{number}\]\s*,\s*(?=\[{number},{number},{number},{number}\])"
    )
    return pattern.sub("@", text)


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r\r\n"])
@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-8-sig"])
def test_only_numbers_change(tmp_path: Path, encoding: str, ends: str) -> None:
    path = line(5, 10)
    text = rich(path).replace("–", "-") if encoding == "latin-1" else rich(path)
    raw = text.replace("\n", ends).encode(encoding)
    job = Job(tmp_path, program=raw, forces=by_target(FORCES))
    result = job.correct()
    assert result.code == 0, result
    out = job.out.read_bytes()
    assert out != raw
    before, after = raw.decode(encoding), out.decode(encoding)
    assert out[:3] == raw[:3]
    if ends != "\n":
        assert after.count("\r\n") == after.count("\n")
    assert len(before.split(ends)) == len(after.split(ends))
    # a target broken over lines may be written on one: compare what is no blank
    squeeze = re.compile(r"\s+")
    assert squeeze.sub("", skeleton(before)) == squeeze.sub("", skeleton(after))
    assert re.sub(r"[-+0-9.eE]", "", before) == re.sub(r"[-+0-9.eE]", "", after), "blanks and line breaks stay too"


@pytest.mark.parametrize("without", ["0,0,0,0\n", "2,0,0,0\n1,0,0,0\n"])
def test_moves_without_force_byte_for_byte(tmp_path: Path, without: str) -> None:
    """Unusual in every way the contract names, and no force on them: same bytes around the one move that is corrected."""
    moves = [
        "MoveL [[1,2,3],[0.9,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tMill\\WObj:=wPart;",
        "MoveL CRobT(),v50,z1,tMill;",
        "MoveL p100,v50,z1,tUnknown\\WObj:=wElsewhere;",
        "MoveL [[1e5,2,3],[1,0,0,0],[0,0,0,0],[12.5,9E9,9E9,9E9,9E9,9E9]],v50,z1,tMill\\Corr;",
        kit.move(line(3, 10).text[1]).replace("tMill", "tGood").replace("wPart", "wGood"),
    ]
    good = [kit.tooldata().replace("tMill", "tGood"), kit.wobjdata().replace("wPart", "wGood")]
    raw = (
        kit.module(moves, [kit.tooldata(held="FALSE"), kit.wobjdata(held="TRUE", fixed="FALSE", unit="STN1"), *good])
        .replace("\n", "\r\n")
        .encode()
    )
    job = Job(tmp_path, program=raw, forces=f"target,fx_n,fy_n,fz_n\n{without}4,60,90,-120\n")
    result = job.correct("--json")
    assert result.code == 0, result
    before, after = raw.split(b"\r\n"), job.out.read_bytes().split(b"\r\n")
    assert [a == b for a, b in zip(before, after, strict=True)] == [True] * 10 + [False] + [True] * 3
    assert result.json["findings"]
    rows = job.offsets()
    assert len(rows) == 5
    offsets = kit.column(rows, "ox_mm", "oy_mm", "oz_mm", "orx_deg", "ory_deg", "orz_deg")
    assert not np.any(np.nan_to_num(offsets[:4]))
    assert np.any(offsets[4])


def test_a_program_without_force_is_not_written(tmp_path: Path) -> None:
    """It would be the planned one under another name."""
    job = Job(tmp_path, program=line(3, 10).program(), forces=by_target({0: F0 * 0, 1: F0 * 0, 2: F0 * 0}))
    result = job.correct("--json")
    assert (result.code, result.json["findings"][0]["code"]) == (3, "CS3086")
    job.nothing_written()


def test_record(tmp_path: Path) -> None:
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0}))
    assert job.correct().code == 0
    record = json.loads((tmp_path / "out.mod.json").read_text())
    names = {
        "input": "part.mod",
        "output": "out.mod",
        "stiffness": "stiffness.json",
        "cell": "cell.yaml",
        "forces": "forces.csv",
    }
    for key, name in names.items():
        assert record[key]["sha256"] == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest(), key
    assert record["findings"] is not None
    assert any("version" in key or key == "compstiff" for key in record)


def test_nothing_is_corrected_twice(tmp_path: Path) -> None:
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0}))
    assert job.correct().code == 0
    again = [
        "correct",
        tmp_path / "cell.yaml",
        tmp_path / "out.mod",
        "--stiffness",
        tmp_path / "stiffness.json",
        "--forces",
        tmp_path / "forces.csv",
        "-o",
        tmp_path / "twice.mod",
    ]
    result = kit.run(*again, "--json")
    assert result.code == 3, result
    assert result.json["status"] != "ok"
    assert not (tmp_path / "twice.mod").exists()
    assert not (tmp_path / "twice.mod.json").exists()
    # renamed, it is still the same bytes
    (tmp_path / "renamed.mod").write_bytes(job.out.read_bytes())
    assert kit.run(*[tmp_path / "renamed.mod" if a == tmp_path / "out.mod" else a for a in again]).code == 3
    # --force is for files that exist: it says nothing of the program
    assert kit.run(*again, "--force").code == 3
    assert not (tmp_path / "twice.mod").exists()
    # nor does another folder help, where the record lies in the one that is written to
    (tmp_path / "elsewhere").mkdir()
    moved = tmp_path / "elsewhere" / "renamed.mod"
    (tmp_path / "renamed.mod").rename(moved)
    assert kit.run(*[moved if a == tmp_path / "out.mod" else a for a in again]).code == 3
    assert kit.run(*again, "--correct-again").code == 0


def test_a_corrected_program_edited_by_hand_is_still_corrected(tmp_path: Path) -> None:
    """The record names the output: a comment added to it does not make it the CAM system's program."""
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0}))
    assert job.correct().code == 0
    job.out.write_text(job.out.read_text() + "\n! touched up\n")
    result = kit.run(
        "correct",
        tmp_path / "cell.yaml",
        job.out,
        "--stiffness",
        tmp_path / "stiffness.json",
        "--forces",
        tmp_path / "forces.csv",
        "-o",
        tmp_path / "twice.mod",
    )
    assert result.code == 3, result


def test_files_are_not_overwritten_without_force(tmp_path: Path) -> None:
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0})).write()
    for name in ("out.mod", "offsets.csv", "out.mod.json", "report.html"):
        (tmp_path / name).write_text("mine")
        result = kit.run(*job.arguments("--report", tmp_path / "report.html"))
        assert result.code == 1, (name, result)
        assert name in result.err
        assert (tmp_path / name).read_text() == "mine"
        left = {p.name for p in tmp_path.iterdir()} - {"cell.yaml", "part.mod", "stiffness.json", "forces.csv"}
        assert left == {name}, "all or nothing"
        (tmp_path / name).unlink()


def test_output_over_an_input_is_refused(tmp_path: Path) -> None:
    """--force overwrites old results, not the program, the log or the cell it works from."""
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0})).write()
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    base = job.arguments("--force")
    for name in ("part.mod", "forces.csv", "stiffness.json", "cell.yaml"):
        result = kit.run(*[tmp_path / name if a == job.out else a for a in base])
        assert result.code in (1, 2, 3), (name, result.code)
        assert {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.name in before} == before
        result = kit.run(*[tmp_path / name if a == job.offsets_file else a for a in base])
        assert result.code in (1, 2, 3), (name, result.code)
        assert {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.name in before} == before


def test_two_outputs_of_one_name_are_refused(tmp_path: Path) -> None:
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0})).write()
    result = kit.run(*[job.out if a == job.offsets_file else a for a in job.arguments()])
    assert result.code in (1, 2), result
    job.nothing_written()


def test_same_input_same_bytes(tmp_path: Path) -> None:
    path = line(5, 10)
    outs = []
    for _ in range(2):
        job = Job(tmp_path, program=rich(path), forces=by_target(FORCES))
        assert job.correct("--force", "--report", tmp_path / "report.html").code == 0
        outs.append({p.name: p.read_bytes() for p in tmp_path.iterdir()})
    assert outs[0] == outs[1]


def test_the_folder_does_not_matter(tmp_path: Path) -> None:
    path = line(5, 10)
    outs = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        job = Job(tmp_path / name, program=rich(path), forces=by_target(FORCES))
        assert job.correct().code == 0
        outs.append((job.out.read_bytes(), job.offsets_file.read_bytes()))
    assert outs[0] == outs[1]


def big(tmp_path: Path, count: int = 6000) -> Job:
    path = line(3, 10)
    rng = np.random.default_rng(0)
    forces = "target,fx_n,fy_n,fz_n\n" + "".join(
        f"{i},{a:.3f},{b:.3f},{c:.3f}\n" for i, (a, b, c) in enumerate(rng.uniform(-200, 200, (count, 3)))
    )
    return Job(tmp_path, program=kit.module([kit.move(path.text[i % 3]) for i in range(count)]), forces=forces).write()


# Long: killed at steps of its writing, in tests/runs/faults/test_faults.py.
@pytest.mark.long
def test_killed_while_it_runs(tmp_path: Path) -> None:
    """Late, where the files are written: after these shares of the CPU time, a little earlier where it was over by then."""
    job = big(tmp_path)
    before = os.times().children_user + os.times().children_system
    whole = kit.spawn(*job.arguments())
    took = os.times().children_user + os.times().children_system - before
    assert whole.code == 0, whole
    good = {name: (tmp_path / name).read_bytes() for name in ("out.mod", "offsets.csv", "out.mod.json")}
    for share in (0.7, 0.85, 0.95):
        ended = 0
        while ended != -signal.SIGKILL:
            for name in good:
                (tmp_path / name).write_bytes(b"old")
            with started(sys.executable, "-m", "compstiff", *job.arguments("--force"), stdout=subprocess.DEVNULL,
                         stderr=subprocess.DEVNULL) as process:
                while process.poll() is None and cpu_seconds(process) < share * took:
                    time.sleep(0.002)
                process.send_signal(signal.SIGKILL)
                ended = process.wait()
            share *= 0.95
        for name, text in good.items():
            assert (tmp_path / name).read_bytes() in (b"old", text), name


def test_ctrl_c(tmp_path: Path) -> None:
    job = big(tmp_path, 120_000)    # six times the CPU time after which it is interrupted: a busy machine looks late
    with started(sys.executable, "-m", "compstiff", *job.arguments(), stdout=subprocess.PIPE,
                 stderr=subprocess.PIPE) as process:
        while process.poll() is None and cpu_seconds(process) < 0.8:
            time.sleep(0.01)
        assert process.poll() is None, "it was over before it could be interrupted"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert b"Traceback" not in err
    job.nothing_written()


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    path = line(3, 10)
    job = Job(tmp_path, program=path.program(), forces=by_target({1: F0})).write()
    for where in (
        Path("/proc/compstiff/out.mod"),
        tmp_path / "no" / "such" / "folder" / "out.mod",
        tmp_path,
        tmp_path / "part.mod" / "out.mod",
    ):
        result = kit.run(*[where if a == job.out else a for a in job.arguments()])
        assert result.code in (1, 2), (where, result)
        assert "Traceback" not in result.err
        job.nothing_written()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write into a read-only folder; runs as any other user")
def test_a_read_only_folder(tmp_path: Path) -> None:
    job = Job(tmp_path, program=line(3, 10).program(), forces=by_target({1: F0})).write()
    tmp_path.chmod(0o500)
    try:
        assert kit.run(*job.arguments()).code == 1
    finally:
        tmp_path.chmod(0o700)


def test_modes_of_output_follow_the_umask(tmp_path: Path) -> None:
    """A temporary file's 0600 would lock the controller's share out of the program."""
    job = Job(tmp_path, program=line(3, 10).program(), forces=by_target({1: F0}))
    assert job.correct().code == 0
    mask = os.umask(0)
    os.umask(mask)
    for name in ("out.mod", "offsets.csv", "out.mod.json"):
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o666 & ~mask, name


@pytest.mark.parametrize("noise", [0.0, 10.0])
def test_air_moves_between_cuts_keep_the_targets_they_share_with_them(tmp_path: Path, noise: float) -> None:
    """Back over two named targets at the air feed, then into the cut again: those two moves name what they named."""
    path = Path3(np.array([[10.0 * i, 0, 0] for i in range(6)]))
    order, back = [0, 1, 2, 3, 2, 1, 2, 3, 4, 5], (4, 5)
    data = [kit.tooldata(), kit.wobjdata(), *(f"CONST robtarget p{i}:={text};" for i, text in enumerate(path.text))]
    moves = [f"    MoveL p{i},{'v500' if k in back else 'v30'},fine,tMill\\WObj:=wPart;" for k, i in enumerate(order)]
    target = np.repeat(np.arange(len(order)), 50)
    force = np.where(np.isin(target, (0, *back))[:, None], 0.0, [60.0, 150.0, -80.0])
    force = force + noise * np.random.default_rng(0).standard_normal(force.shape)
    rows = "".join(f"{k},{f[0]:.4f},{f[1]:.4f},{f[2]:.4f}\n" for k, f in zip(target, force, strict=True))
    job = kit.Job(tmp_path, program=kit.module(moves, data), forces="target,fx_n,fy_n,fz_n\n" + rows)
    result = job.correct("--json", "--tare", "0:0")
    assert result.code == 0
    assert "CS3041" not in kit.codes(result)
    written = [line for line in job.out.read_text().splitlines() if "MoveL" in line]
    assert [written[k] for k in (0, *back)] == [moves[k] for k in (0, *back)]
    assert all(written[k] != moves[k] for k in (1, 2, 6))
