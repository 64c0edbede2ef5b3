"""Broken, empty, huge and odd input: never a traceback, never exit 70, never half a result."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import Job

P = line(3, 10)
FORCE = "target,fx_n,fy_n,fz_n\n1,60,90,-120\n"
NAMES = ["cell.yaml", "part.mod", "stiffness.json", "forces.csv"]


def answered(result: kit.Run) -> None:
    """An answer of the contract: not a defect, one JSON document."""
    assert result.code in (0, 1, 2, 3), result
    assert "Traceback" not in result.err
    document = result.json
    assert document["status"] == ("ok" if result.code == 0 else document["status"])
    if result.code:
        assert document["findings"], result


GARBAGE = {
    "nothing": b"",
    "a line end": b"\n",
    "zeros": bytes(500),
    "all bytes": bytes(range(256)) * 4,
    "random": np.random.default_rng(0).bytes(2000),
    "utf-16": "robot: a, format".encode("utf-16"),
    "half a surrogate": b"\xed\xa0\x80abc",
    "open brackets": b"[" * 5000,
    "open braces": b"{" * 5000,
    "one long line": b"1" * 200_000,
    "quotes": b'"' * 999,
    "yaml bomb": b"a: &a [1,1]\nb: &b [*a,*a]\nc: [*b,*b]\n",
    "commas": b"," * 999 + b"\n" + b"," * 999,
}


DEEP, LONG = (
    "RecursionError in the YAML or JSON reader: exit 70",
    "a number of 200 000 digits: ValueError or csv.Error, exit 70",
)


@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind in sorted(GARBAGE) for name in NAMES],
)
def test_garbage(tmp_path: Path, kind: str, name: str) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    (tmp_path / name).write_bytes(GARBAGE[kind])
    result = kit.run(*job.arguments("--json"))
    answered(result)
    assert result.code == 1, result
    assert not job.out.exists()


@pytest.mark.parametrize("name", NAMES)
def test_cut_anywhere(tmp_path: Path, name: str) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE + "2,1,2,3\n" * 20).write()
    whole = (tmp_path / name).read_bytes()
    for cut in np.random.default_rng(1).integers(0, len(whole), 30):
        (tmp_path / name).write_bytes(whole[:cut])
        answered(kit.run(*job.arguments("--json", "--force")))


@pytest.mark.parametrize("name", NAMES)
def test_single_bytes_replaced(tmp_path: Path, name: str) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE + "2,1,2,3\n" * 20).write()
    whole = (tmp_path / name).read_bytes()
    rng = np.random.default_rng(2)
    for _ in range(40):
        at = int(rng.integers(0, len(whole)))
        byte = bytes([int(rng.choice(list(b'[](){},;:."!\\\n\r\t -+eE09naN#%&*\x00\xff|')))])
        (tmp_path / name).write_bytes(whole[:at] + byte + whole[at + 1 :])
        result = kit.run(*job.arguments("--json", "--force"))
        assert result.code != 70, (at, byte, whole[max(0, at - 30) : at + 30], result)
        answered(result)


@pytest.mark.parametrize(
    "number",
    [
        *(pytest.param(n) for n in ("1e308", "-1e308")),
        "1e30",
        "1e-320",
        "99999999999999999999999",
        "0.0000000000000000000000000001",
    ],
)
def test_huge_and_tiny_numbers_in_a_target(tmp_path: Path, number: str) -> None:
    moves = [kit.move(P.text[0]), kit.move(re.sub(r"\[\[[-\d.]+", f"[[{number}", P.text[1])), kit.move(P.text[2])]
    for forces in (
        FORCE,
        FORCE.replace("\n1,", "\n2,"),
        "path_mm,fx_n,fy_n,fz_n\n5,1,2,3\n",
        "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n231,387,-650,1,2,3\n",
    ):
        answered(Job(tmp_path, program=kit.module(moves), forces=forces).correct("--json", "--force"))


@pytest.mark.parametrize(
    "forces",
    [
        pytest.param("target,fx_n,fy_n,fz_n\n1,1e308,1e308,1e308\n1,1e308,1e308,1e308\n"),
        "target,fx_n,fy_n,fz_n\n1,1e200,0,0\n",
        "target,fx_n,fy_n,fz_n\n1,1e-320,0,0\n",
        pytest.param("target,fx_n,fy_n,fz_n\n99999999999999999999,1,0,0\n"),
        "path_mm,fx_n,fy_n,fz_n\n1e308,1,0,0\n",
        "path_mm,fx_n,fy_n,fz_n\n-1e308,1,0,0\n1e308,1,0,0\n",
        "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n1e308,1e308,1e308,1,2,3\n",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n\n1e308,0,0,0,0,0,1,2,3\n",
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n\n0,0,0,0,0,0,1,2,3\n",
    ],
)
def test_huge_and_tiny_numbers_in_the_log(tmp_path: Path, forces: str) -> None:
    answered(Job(tmp_path, program=P.program(), forces=forces).correct("--json"))


@pytest.mark.parametrize(
    ("k", "relative"), [(kit.K * 1e-6, 0.02), (kit.K * 1e9, 0.02), (kit.K * 1e-140, 0.02), (kit.K * 1e140, 0.02), (kit.K, 50.0)]
)
def test_absurd_stiffnesses(tmp_path: Path, k: np.ndarray, relative: float) -> None:
    for log in (True, False):
        text = kit.stiffness_text(k, relative, log=log).replace("Infinity", "1e308")
        answered(Job(tmp_path, program=P.program(), forces=FORCE, stiffness=text).correct("--json", "--force"))


@pytest.mark.parametrize(
    "program",
    [
        "",
        "\n",
        "! only a comment",
        "MODULE A\nENDMODULE\n",
        "MODULE A(SYSMODULE)\nCONST num a:=1;\nENDMODULE\n",
        "%%%\nVERSION:1\n%%%\n",
    ],
)
def test_programs_without_moves(tmp_path: Path, program: str) -> None:
    """A .sys module without moves and no force: nothing to correct. With a force log: it belongs to no target."""
    job = Job(tmp_path, program=program, forces=FORCE, name="part.sys")
    result = job.correct("--json")
    answered(result)
    assert result.code == 1, result


def test_one_named_target_used_two_thousand_times(tmp_path: Path) -> None:
    data = [kit.tooldata(), kit.wobjdata(), f"CONST robtarget pA:={P.text[1]};", f"CONST robtarget pA_1:={P.text[0]};"]
    rng = np.random.default_rng(3)
    forces = rng.uniform(-100, 100, (2000, 3))
    text = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},{a:.2f},{b:.2f},{c:.2f}\n" for i, (a, b, c) in enumerate(forces))
    job = Job(tmp_path, program=kit.module([kit.move("pA")] * 2000, data), forces=text)
    result = job.correct()
    assert result.code == 0, result
    out = job.out.read_text()
    pairs = re.findall(r"robtarget (\w+)\s*:=\s*(\[\[.*?\]\]);", out)
    declared = {name.lower(): value for name, value in pairs}
    assert len(declared) == len(pairs), "names declared twice"
    assert all(len(name) <= 32 for name in declared), "RAPID identifiers have at most 32 characters"
    used = re.findall(r"MoveL ([^,]\w*|\[\[.*?\]\]),v50", out)
    assert len(used) == 2000
    assert declared["pa_1"] == P.text[0]
    for i in (0, 1, 999, 1999):
        command = kit.targets_of(declared.get(used[i].lower(), used[i]))[0]
        assert kit.lands(command, P.frames[1], P.q[1], np.r_[forces[i], 0, 0, 0])[0] < 0.2e-6


def test_two_moves_of_equal_force_on_one_named_target(tmp_path: Path) -> None:
    data = [kit.tooldata(), kit.wobjdata(), f"CONST robtarget pA:={P.text[1]};"]
    job = Job(tmp_path, program=kit.module([kit.move("pA")] * 2, data), forces="target,fx_n,fy_n,fz_n\n0,1,2,300\n1,1,2,300\n")
    assert job.correct().code == 0
    assert job.out.read_text().count("robtarget") == 1


def test_shadowed_names(tmp_path: Path) -> None:
    """A target, tool or work object declared in a routine hides the module's; two modules each have their own."""
    t = P.text
    far = t[1].replace(t[1].split(",")[0], "[[1.0")
    text = f"""MODULE One
{kit.tooldata(held="FALSE")}
CONST robtarget pA:={far};
LOCAL {kit.wobjdata()}
PROC main()
  CONST robtarget pA:={t[1]};
  VAR tooldata tMill:=[TRUE,{kit.TOOL.rapid()},[1,[0,0,1],[1,0,0,0],0,0,0]];
  MoveL PA,v50,z1,TMILL\\wobj:=WPART;
ENDPROC
ENDMODULE
MODULE Two
LOCAL PERS wobjdata wPart:=[FALSE,TRUE,"",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
ENDMODULE
"""
    job = Job(tmp_path, program=text, forces="target,fx_n,fy_n,fz_n\n0,60,90,-120\n")
    result = job.correct()
    assert result.code == 0, result
    command = kit.targets_of(job.out.read_text().split("PROC main")[1])[0]
    assert kit.lands(command, P.frames[1], P.q[1], np.array([60, 90, -120, 0, 0, 0.0]))[0] < 0.2e-6
    assert f"CONST robtarget pA:={far};" in job.out.read_text()


def test_names_with_blanks_and_umlauts(tmp_path: Path) -> None:
    folder = tmp_path / "Süd Halle 3"
    folder.mkdir()
    job = Job(folder, program=P.program(), forces=FORCE, name="Gehäuse Teil 1.MOD")
    result = job.correct("--json")
    assert result.code == 0, result


def test_output_is_one_document_in_a_process_of_its_own(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    good = kit.spawn(*job.arguments("--json"))
    assert good.code == 0
    assert good.json["result"]["corrected"] == 1
    bad = kit.spawn(*job.arguments("--json"))
    assert bad.code == 1
    assert bad.json["findings"][0]["code"].startswith("CS")
    wrong = kit.spawn("correct", "--json", "--nonsense")
    assert wrong.code == 2
    assert wrong.json
    force = kit.spawn(*job.arguments("--force", "-q"))
    assert (force.code, force.err) == (0, "")


@pytest.mark.parametrize(
    "forces",
    [
        "target,fx_n,fy_n,fz_n\n1,1e8,0,0\n",
        pytest.param("target,fx_n,fy_n,fz_n\n1,1e300,0,0\n", marks=pytest.mark.long),
        pytest.param("target,fx_n,fy_n,fz_n\n1e30,1,2,3\n", marks=pytest.mark.long),
    ],
)
def test_no_python_warning_reaches_the_user(tmp_path: Path, forces: str) -> None:
    job = Job(tmp_path, program=P.program(), forces=forces).write()
    result = kit.spawn(*job.arguments())
    assert result.code == 1, result
    assert "Warning" not in result.err, result


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        "[]",
        "not json",
        '{"format": "compstiff-correction"}',
        pytest.param(
            '{"format": "compstiff-correction", "output": []}'
        ),
        pytest.param("[" * 5000),
    ],
)
def test_other_json_files_beside_the_program(tmp_path: Path, text: str) -> None:
    """The folder may hold anything: only a record of ours stops a correction."""
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    (tmp_path / "settings.json").write_text(text)
    result = kit.run(*job.arguments())
    assert result.code == 0, result
