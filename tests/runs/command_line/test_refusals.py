"""Exit codes, messages and JSON of each error the contract names; a refusal writes nothing."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.test_placement import line
from tests.runs.command_line.user_files import IRB6660, TOOL, Job

P = line(3, 10)
T = P.text
FORCE = "target,fx_n,fy_n,fz_n\n1,60,90,-120\n"
ZERO = "target,fx_n,fy_n,fz_n\n1,0,0,0\n"
DATA = [kit.tooldata(), kit.wobjdata()]
MESSAGE = re.compile(r"^(?P<file>[^\n]*?)(:(?P<line>\d+))?(:(?P<column>\d+))?: error (?P<code>CS\d{4}): (?P<text>.+)$", re.M)


def program(second: str, data: list[str] | None = None, before: tuple[str, ...] = ()) -> str:
    return kit.module([kit.move(T[0]), *before, second, kit.move(T[2])], DATA if data is None else data)


def refused(
    job: Job, code: int, *, file: str | None = None, line: int | None = None, column: int | None = None, says: str = ""
) -> dict:
    """The run ends with `code`, in words and as JSON alike, and leaves nothing behind."""
    told = job.correct()
    assert told.code == code, told
    assert told.out == "", told
    assert "Traceback" not in told.err
    found = MESSAGE.search(told.err)
    assert found, told
    asked = kit.run(*job.arguments("--json"))
    assert asked.code == code, asked
    document = asked.json
    assert document["status"] != "ok"
    assert {"format", "version", "status", "findings", "inputs"} <= document.keys()
    errors = [f for f in document["findings"] if f["level"] == "error"]
    assert errors, document
    assert errors[0]["code"] == found["code"]
    if file is not None:
        assert Path(found["file"]).name == file, told
        assert Path(errors[0]["file"]).name == file
    if line is not None:
        assert found["line"] == str(line), told
        assert errors[0]["line"] == line
    if column is not None:
        assert found["column"] == str(column), told
    assert says.lower() in told.err.lower(), told
    job.nothing_written()
    assert kit.run("explain", found["code"]).code == 0
    return document


def nothing_corrected(job: Job, *, says: str) -> dict:
    """A program that would come out as it went in is not written: nobody may load it for a corrected one."""
    result = job.correct("--json")
    assert result.code == 3, result
    first = result.json["findings"][0]
    assert first["code"] == "CS3086"
    assert says in first["message"], result
    job.nothing_written()
    return result.json


def turned(text: str, factor: float) -> str:
    """A target whose quaternion is `factor` too long."""
    head, tail = text.split("],[", 1)
    q, rest = tail.split("],[", 1)
    return head + "],[" + ",".join(f"{float(v) * factor:.9f}" for v in q.split(",")) + "],[" + rest


# ---- the program -----------------------------------------------------------------------------------------------------------

REFUSED_PROGRAMS: dict[str, tuple[str, int, str]] = {
    "external axis": (program(kit.move(T[1].replace(kit.E, "[100,9E9,9E9,9E9,9E9,9E9]"))), 6, "eax_a"),
    "second external axis": (program(kit.move(T[1].replace(kit.E, "[9E9,-1.5,9E9,9E9,9E9,9E9]"))), 6, "eax_b"),
    "tool frame at run time": (program(kit.move(T[1]), before=("tMill.tframe:=[[0,0,1],[1,0,0,0]];",)), 7, "tMill"),
    "one number of the tool at run time": (program(kit.move(T[1]), before=("tmill.TFRAME.trans.z := 100;",)), 7, "tMill"),
    "tool in another routine": (
        program(kit.move(T[1])).replace("ENDMODULE", "PROC p()\ntMill:=tB;\nENDPROC\nENDMODULE"),
        6,
        "tMill",
    ),
    "work object at run time": (program(kit.move(T[1]), before=("wPart.oframe:=pose1;",)), 7, "wPart"),
    "stationary tool": (program(kit.move(T[1]), [kit.tooldata(held="FALSE"), kit.wobjdata()]), 6, "robhold"),
    "work object held by the robot": (program(kit.move(T[1]), [kit.tooldata(), kit.wobjdata(held="TRUE")]), 6, "robhold"),
    "moving work object": (program(kit.move(T[1]), [kit.tooldata(), kit.wobjdata(fixed="FALSE", unit="STN1")]), 6, "ufprog"),
    "unreachable": (program(kit.move("[[99999,0,0]," + T[1].split("],", 1)[1])), 6, "reach"),
}


@pytest.mark.parametrize("name", sorted(REFUSED_PROGRAMS))
def test_programs_refused_under_force(tmp_path: Path, name: str) -> None:
    text, line_, says = REFUSED_PROGRAMS[name]
    refused(Job(tmp_path, program=text, forces=FORCE), 3, file="part.mod", line=line_, says=says)


@pytest.mark.parametrize("name", sorted(REFUSED_PROGRAMS))
def test_the_same_without_force_is_no_work(tmp_path: Path, name: str) -> None:
    nothing_corrected(Job(tmp_path, program=REFUSED_PROGRAMS[name][0], forces=ZERO), says="no move has force")


@pytest.mark.parametrize("name", sorted(REFUSED_PROGRAMS))
def test_the_same_with_force_elsewhere_only(tmp_path: Path, name: str) -> None:
    """Where the doubtful move alone is in the air: the others, if they depend on nothing doubtful, are corrected."""
    job = Job(tmp_path, program=REFUSED_PROGRAMS[name][0], forces=FORCE.replace("\n1,", "\n2,"))
    result = job.correct("--json")
    local = name in ("external axis", "second external axis", "unreachable")
    assert result.code == (0 if local else 3), result
    if local:
        assert (job.out.read_text() == job.program) is False
        lines = zip(str(job.program).splitlines(), job.out.read_text().splitlines(), strict=True)
        assert [a != b for a, b in lines] == [False] * 6 + [True] + [False] * 2


@pytest.mark.parametrize(("factor", "code"), [(1.2, 1), (1.0497, 1), (0.94, 1), (0.0, 1), (1.048, 0), (0.951, 0), (1.0001, 0)])
def test_quaternions_off_the_unit(tmp_path: Path, factor: float, code: int) -> None:
    """0.1 in the sum of squares on a target that a move with force uses; elsewhere, and above 1e-5, a finding."""
    job = Job(tmp_path, program=program(kit.move(turned(T[1], factor))), forces=FORCE)
    if code:
        refused(job, 1, file="part.mod", line=6, says="quaternion")
    else:
        result = job.correct("--json")
        assert result.code == 0, result
        assert any("quaternion" in f["message"] and f["line"] == 6 for f in result.json["findings"]), result
        command, plan = (kit.targets_of(x)[1] for x in (job.out.read_text(), str(job.program)))
        distance, angle = kit.lands(command, plan, P.q[1], np.array([60, 90, -120, 0, 0, 0.0]))
        assert distance < 0.2e-6
        assert angle < 2e-7


def test_a_bad_quaternion_in_the_air_is_a_finding(tmp_path: Path) -> None:
    job = Job(tmp_path, program=program(kit.move(turned(T[1], 1.5))), forces=FORCE.replace("\n1,", "\n2,"))
    result = job.correct("--json")
    assert result.code == 0, result
    lines = zip(str(job.program).splitlines(), job.out.read_text().splitlines(), strict=True)
    assert [a != b for a, b in lines] == [False] * 6 + [True] + [False] * 2
    assert any("quaternion" in f["message"] for f in result.json["findings"])


@pytest.mark.parametrize("target", ["CRobT(\\Tool:=tMill\\WObj:=wPart)", "pRun", "pElsewhere", "pA{i}", "Offs(pRun,0,0,1)"])
def test_run_time_targets_stay_and_are_reported(tmp_path: Path, target: str) -> None:
    data = [*DATA, f"VAR robtarget pRun:={T[1]};", f"CONST robtarget pA{{2}}:=[{T[0]},{T[1]}];"]
    text = program(kit.move(target), data, before=("pRun.trans.z:=5;",))
    told = nothing_corrected(Job(tmp_path, program=text, forces=FORCE), says="1 move with force, and none can be corrected")
    assert any(f["line"] == 9 for f in told["findings"]), told


def test_corr_stays_and_is_reported(tmp_path: Path) -> None:
    text = program(kit.move(T[1]).replace("wPart;", "wPart\\Corr;"))
    told = nothing_corrected(Job(tmp_path, program=text, forces=FORCE), says="Corr")
    assert any(f["line"] == 6 for f in told["findings"]), told


def test_all_cuts_under_a_displacement(tmp_path: Path) -> None:
    text = program(kit.move(T[1]), before=("PDispOn\\ExeP:=p1,p2,tMill;",))
    nothing_corrected(Job(tmp_path, program=text, forces=FORCE), says="PDispOn")


def test_a_deviation_under_the_digits_of_the_program(tmp_path: Path) -> None:
    nothing_corrected(Job(tmp_path, program=program(kit.move(T[1])), forces=FORCE, stiffness=kit.stiffness_text(1e9 * kit.K)),
                      says="um, and every correction is too small")


# ---- limits ----------------------------------------------------------------------------------------------------------------


def at(degrees: list[float]) -> str:
    q = np.radians(degrees)
    return kit.module(
        [kit.move(kit.robtarget(kit.work_object().inv() @ kit.tcp_pose(IRB6660, q, TOOL), kit.confdata(q), digits=9))]
    )


HARD = "target,fx_n,fy_n,fz_n\n0,160,190,-220\n"


def test_over_the_offset_limit(tmp_path: Path) -> None:
    job = Job(tmp_path, kit.cell_text(extra="limits: {max_offset_mm: 0.01}\n"), P.program(), forces=FORCE)
    refused(job, 3, file="part.mod", line=6, says="0.01 mm")


def test_over_the_tilt_limit(tmp_path: Path) -> None:
    job = Job(tmp_path, kit.cell_text(extra="limits: {max_tilt_deg: 0.0001}\n"), P.program(), forces=FORCE)
    refused(job, 3, file="part.mod", line=6, says="0.0001 deg")


def test_default_limits_are_2_mm_and_half_a_degree(tmp_path: Path) -> None:
    factor = 2.0 / 0.105
    for scale, code in ((0.9, 0), (1.2, 3)):
        f = np.array([60, 90, -120]) * factor * scale
        size = np.linalg.norm(kit.deviation(IRB6660, P.q[1], TOOL.p, np.r_[f, 0, 0, 0], kit.K)) * 1e3
        assert (size < 2) == (code == 0)
        assert (
            Job(tmp_path, program=P.program(), forces=f"target,fx_n,fy_n,fz_n\n1,{f[0]},{f[1]},{f[2]}\n")
            .correct("--force")
            .code
            == code
        )


@pytest.mark.parametrize(
    ("name", "degrees", "says"),
    [
        ("joint limit as planned", [10, 85.5, 60, 20, 40, 5], "joint 2"),
        ("joint limit after correction", [10, -20, -19.9999, 20, 40, 30], "joint 3"),
        ("rod window as planned", [0, -5, 66, 10, 30, 5], "rod"),
        ("rod window after correction", [0, -5, 64.9999, 10, 30, 5], "rod"),
        ("singular wrist", [10, 10, 10, 20, 0.0001, 30], "singular"),
    ],
)
def test_out_of_the_robot_s_range(tmp_path: Path, name: str, degrees: list[float], says: str) -> None:
    job = Job(tmp_path, program=at(degrees), forces=HARD)
    refused(job, 3, file="part.mod", line=5, says=says)
    job.forces = "target,fx_n,fy_n,fz_n\n0,0,0,0\n"
    nothing_corrected(job, says="no move has force")


@pytest.mark.parametrize("degrees", [[10, 10, 10, 0.001, 40, 30], [0.0005, 10, 10, 20, 40, 80], [10, 10, 10, 20, 40, 90.0005]])
@pytest.mark.parametrize("sign", [1, -1])
def test_confdata_follows_the_quadrant(tmp_path: Path, degrees: list[float], sign: int) -> None:
    """It changes where the quadrant really does, as a finding, and only there."""
    f = np.array([160, 190, -220]) * sign
    job = Job(tmp_path, program=at(degrees), forces=f"target,fx_n,fy_n,fz_n\n0,{f[0]},{f[1]},{f[2]}\n")
    result = job.correct("--json")
    assert result.code == 0, result
    command = kit.targets_of(job.out.read_text())[0]
    q = kit.solve(IRB6660, kit.work_object() @ command @ TOOL.inv(), np.radians(degrees))
    before, after = (next(g for g in re.findall(r"\],(\[[-\d,]+\]),\[9E9", t)) for t in (str(job.program), job.out.read_text()))
    assert after == kit.confdata(q)
    assert any("confdata" in f["message"] for f in result.json["findings"]) == (before != after)


# ---- the force log ---------------------------------------------------------------------------------------------------------

HEAD = "target,fx_n,fy_n,fz_n\n"


@pytest.mark.parametrize(
    ("name", "text", "where"),
    [
        ("target beyond the program", HEAD + "0,1,2,3\n3,1,0,0\n", (3, None)),
        ("negative target", HEAD + "-1,1,0,0\n", (2, 1)),
        ("half a target", HEAD + "1.5,1,0,0\n", (2, 1)),
        ("nan", HEAD + "1,nan,0,0\n", (2, 2)),
        ("infinity", HEAD + "# c\n1,0,-inf,0\n", (3, 3)),
        ("1e999", HEAD + "1,0,0,1e999\n", (2, 4)),
        ("empty cell", HEAD + "1,,0,0\n", (2, 2)),
        ("text", HEAD + "0,1,2,3\n1,1,2,N/A\n", (3, 4)),
        ("no samples", HEAD, (None, None)),
        ("empty file", "", (None, None)),
        ("only comments", "# a\n# b\n", (None, None)),
        ("no place", "fx_n,fy_n,fz_n\n1,2,3\n", (1, None)),
        ("two of x y z", "x_mm,y_mm,fx_n,fy_n,fz_n\n1,2,1,2,3\n", (1, None)),
        ("missing column", "target,fx_n,fy_n\n1,2,3\n", (1, None)),
        ("column twice", "target,fx_n,fy_n,fz_n,fx_n\n1,2,3,4,5\n", (1, None)),
        ("a cell too many", HEAD + "1,2,3,4,5\n", (2, None)),
        ("a cell too few", HEAD + "1,2,3\n", (2, None)),
        ("nowhere near", "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n0,0,9000,1,2,3\n", (None, None)),
        ("non-finite place", "path_mm,fx_n,fy_n,fz_n\nnan,1,2,3\n", (2, 1)),
        ("non-finite moment", "target,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n1,1,2,3,0,nan,0\n", (2, 6)),
        pytest.param(
            "an enormous place",
            "target,fx_n,fy_n,fz_n\n1e30,1,2,3\n",
            (2, None),
        ),
    ],
)
def test_force_logs_refused(tmp_path: Path, name: str, text: str, where: tuple[int | None, int | None]) -> None:
    refused(Job(tmp_path, program=P.program(), forces=text), 1, file="forces.csv", line=where[0], column=where[1])


def test_absurd_forces_name_their_target(tmp_path: Path) -> None:
    refused(Job(tmp_path, program=P.program(), forces=HEAD + "1,1e8,0,0\n"), 1)


@pytest.mark.parametrize("column", ["mx_n", "Mx_nm", "mx", "moment_x"])
def test_a_column_that_is_not_read_is_reported(tmp_path: Path, column: str) -> None:
    """Nothing is silently dropped: a misspelt moment would leave its share of the deviation in the part."""
    text = f"target,fx_n,fy_n,fz_n,{column},my_nm,mz_nm\n1,60,90,-120,50,0,0\n"
    result = Job(tmp_path, program=P.program(), forces=text).correct("--json")
    assert result.code == 1 or any(column in f["message"] for f in result.json["findings"]), result


def test_payload_in_the_cell_is_used_or_reported(tmp_path: Path) -> None:
    """`mass_kg: optional; with centre_of_mass_mm, for payload removal from force logs`: 80 kg are 785 N on a sensor."""
    sensor = "force_log: {frame: sensor, sensor_position_mm: [0, 0, 0], sensor_quaternion: [1, 0, 0, 0]}\n"
    cell = kit.cell_text(extra=sensor).replace("tool: {", "tool: {mass_kg: 80, centre_of_mass_mm: [0, 0, 120], ")
    outs = []
    for index, text in enumerate((cell, kit.cell_text(extra=sensor))):
        (tmp_path / str(index)).mkdir()
        job = Job(tmp_path / str(index), text, P.program(), forces=FORCE)
        result = job.correct("--json")
        outs.append(job.out.read_text() if result.code == 0 else "")
        if index == 0:
            reported = any("mass" in f["message"] or "payload" in f["message"] for f in result.json["findings"])
    assert reported or outs[0] != outs[1]


@pytest.mark.parametrize(
    "text",
    [
        "\ufefftarget;fx_n;fy_n;fz_n\r\n1;60,0;90,0;-120,0\r\n",
        "# log of part 4711\ntarget\tfx_n\tfy_n\tfz_n\n# contact\n1\t60,0\t90\t-1,2e2\n",
        "target, fx_n, fy_n, fz_n\n1, 60, 90, -120\n\n",
        "fz_n,time_s,fy_n,target,fx_n\n-120,0.5,90,1,60\n",
        'target,"fx_n",fy_n,fz_n\n1,"60",90,-120',
    ],
)
def test_spellings_of_a_log(tmp_path: Path, text: str) -> None:
    outs = []
    for index, forces in enumerate((text, FORCE)):
        (tmp_path / str(index)).mkdir()
        job = Job(tmp_path / str(index), program=P.program(), forces=forces)
        result = job.correct()
        assert result.code == 0, result
        outs.append(job.out.read_bytes())
    assert outs[0] == outs[1]


def test_parquet_log(tmp_path: Path) -> None:
    import pandas as pd

    job = Job(tmp_path, program=P.program(), forces=FORCE)
    assert job.correct().code == 0
    good = job.out.read_bytes()
    pd.DataFrame({"target": [1], "fx_n": [60.0], "fy_n": [90.0], "fz_n": [-120.0]}).to_parquet(tmp_path / "f.parquet")
    result = kit.run(*[tmp_path / "f.parquet" if a == tmp_path / "forces.csv" else a for a in job.arguments("--force")])
    assert result.code == 0, result
    assert job.out.read_bytes() == good


# ---- stiffness.json --------------------------------------------------------------------------------------------------------


def changed(change: Callable[[dict], object], log: bool = True) -> str:
    data = json.loads(kit.stiffness_text(log=log))
    change(data)
    return json.dumps(data)


def put(path: str, value: object) -> Callable[[dict], object]:
    *where, last = [int(p) if p.isdigit() else p for p in path.split(".")]

    def change(data: dict) -> None:
        at = data
        for key in where:
            at = at[key]
        at[last] = value

    return change


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("empty", ""),
        ("not JSON", '{"format":\n "x",}'),
        ("a list", "[1, 2]"),
        ("null", "null"),
        ("NaN", kit.stiffness_text().replace("-14.5", "NaN, -14.5", 1)),
        ("format", changed(put("format", "compstiff-diagnosis"))),
        ("version", changed(put("version", 2))),
        ("no robot", changed(lambda d: d.pop("robot"))),
        ("another robot", changed(put("robot", "irb6700-200-2.60"))),
        ("another load path", changed(put("load_path", "serial"))),
        ("another robot file", changed(put("robot_sha256", "0" * 64))),
        ("an effect unknown here", changed(put("effects", [{"effect": "backlash", "joint": 1}]))),
        ("five parameters", changed(lambda d: d["parameters"].pop())),
        ("another order", changed(lambda d: d["parameters"].reverse())),
        ("log covariance not positive", changed(put("log_compliance.covariance.0.0", -1.0))),
        ("log covariance of another shape", changed(put("log_compliance.covariance", [[1.0]]))),
        ("log mean of another length", changed(put("log_compliance.mean", [-14.0]))),
        ("text for a number", changed(put("parameters.0.estimate", "two"))),
        ("covariance only, not positive", changed(put("covariance.0.0", -1.0), log=False)),
        ("covariance only, of another shape", changed(put("covariance", [[1.0]]), log=False)),
        ("covariance only, negative stiffness", changed(put("parameters.0.estimate", -1.0e6), log=False)),
        ("neither covariance", changed(lambda d: d.pop("covariance"), log=False)),
    ],
)
def test_stiffness_files_refused(tmp_path: Path, name: str, text: str) -> None:
    refused(Job(tmp_path, program=P.program(), stiffness=text, forces=FORCE), 1, file="stiffness.json")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("unit", changed(put("parameters.0.unit", "N*mm/rad"), log=False)),
        ("required covariance absent", changed(lambda d: d.pop("covariance"))),
        ("covariance of another shape beside log_compliance", changed(put("covariance", [[1.0]]))),
        ("estimate edited by hand, log_compliance left", changed(put("parameters.1.estimate", 8.0e6))),
    ],
)
def test_stiffness_files_that_contradict_the_contract(tmp_path: Path, name: str, text: str) -> None:
    refused(Job(tmp_path, program=P.program(), stiffness=text, forces=FORCE), 1, file="stiffness.json")


def test_another_tool_is_no_error_without_effects(tmp_path: Path) -> None:
    text = kit.stiffness_text(tool={"position_mm": [0, 0, 1], "quaternion": [1, 0, 0, 0]})
    assert Job(tmp_path, program=P.program(), stiffness=text, forces=FORCE).correct().code == 0


# ---- cell.yaml -------------------------------------------------------------------------------------------------------------

CELL = kit.cell_text()


@pytest.mark.parametrize(
    ("name", "text", "where", "says"),
    [
        ("empty", "", None, ""),
        ("not YAML", "robot: [", (1, 9), ""),
        ("a list", "- a\n", None, ""),
        ("no robot", CELL.split("\n", 1)[1], None, "robot"),
        ("no tool", "robot: irb6660-205-1.90\n", None, "tool"),
        ("unknown key", CELL + "force_lag: {frame: base}\n", (4, 1), "force_log"),
        ("unknown key within", CELL + "limits: {max_ofset_mm: 2}\n", (4, 10), "max_offset_mm"),
        ("frame", CELL + "force_log: {frame: tol}\n", (4, 13), "tol"),
        ("sign", CELL + "force_log: {sign: reversed}\n", (4, 13), "by_tool"),
        ("sensor without its frame", CELL + "force_log: {frame: sensor}\n", None, "sensor"),
        ("unknown robot", kit.cell_text("irb6660-205-1.9"), None, "irb6660-205-1.90"),
        (
            "quaternion",
            "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 1], quaternion: [1, 0.1, 0, 0]}\n",
            (2, None),
            "unit",
        ),
        (
            "base quaternion",
            "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 1]}\nbase_frame: {quaternion: [0.998, 0, 0, 0]}\n",
            (3, None),
            "unit",
        ),
        (
            "three of a quaternion",
            "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 1], quaternion: [1, 0, 0]}\n",
            (2, None),
            "quaternion",
        ),
        ("text", "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, a]}\n", (2, None), "position_mm"),
        ("nan", "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, .nan]}\n", (2, None), "position_mm"),
        ("limit of zero", CELL + "limits: {max_offset_mm: 0}\n", (4, None), "max_offset_mm"),
        ("a position as text", "robot: x\ntool: {position_mm: '120, 0, 250'}\n", (2, 8), "a list in square brackets"),
        ("two numbers of three", "robot: x\ntool: {position_mm: [120, 0]}\n", (2, 8), "number 3 of the list is missing"),
        ("four numbers of three", "robot: x\ntool: {position_mm: [1, 2, 3, 4]}\n", (2, 8), "must be a list of 3"),
        ("a mass with its unit", "robot: x\ntool: {position_mm: [1, 2, 3], mass_kg: 80 kg}\n", (2, 32), "without a unit"),
        ("a tool without keys", "robot: x\ntool: 5\n", (2, 1), "must have keys"),
        ("a key twice", CELL + "limits: {max_offset_mm: 1}\nlimits: {max_offset_mm: 2}\n", (5, 1), "limits"),
        ("five stiffnesses", CELL + "prior: {stiffness_nm_per_rad: [1e6, 1e6, 1e6, 1e6, 1e6]}\n", (4, None), "stiffness"),
    ],
)
def test_cells_refused(tmp_path: Path, name: str, text: str, where: tuple[int, int | None] | None, says: str) -> None:
    line_, column = where or (None, None)
    refused(Job(tmp_path, text, P.program(), forces=FORCE), 1, file="cell.yaml", line=line_, column=column, says=says)


# ---- the call --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gone", ["cell.yaml", "part.mod", "stiffness.json", "forces.csv"])
def test_missing_files(tmp_path: Path, gone: str) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    (tmp_path / gone).unlink()
    for command in ("correct", "predict"):
        told = kit.run(*job.arguments(command=command))
        assert told.code == 2, told
        assert gone in told.err
        asked = kit.run(*job.arguments("--json", command=command))
        assert asked.code == 2
        assert gone in asked.json["findings"][0]["message"]
    assert not job.out.exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["correct"],
        ["correct", "--json"],
        ["nope", "--json"],
        ["robots", "--json", "--foo"],
        ["identify", "--json", "a", "b"],
        ["predict", "--json", "a"],
        ["correct", "a", "b", "--stiffnes", "c", "--json"],
    ],
)
def test_wrong_calls(arguments: list[str]) -> None:
    result = kit.run(*arguments)
    assert result.code == 2, result
    if "--json" in arguments:
        assert result.json["findings"][0]["code"].startswith("CS")
        assert result.json["exit_code"] == 2 if "exit_code" in result.json else True
    else:
        assert result.out == ""
        assert "Usage" in result.err


def test_folders_in_place_of_files(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    (tmp_path / "folder").mkdir()
    for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv"):
        result = kit.run(*[tmp_path / "folder" if a == tmp_path / name else a for a in job.arguments("--json")])
        assert result.code in (1, 2), (name, result)
        assert result.json["findings"]


def test_other_toolpath_formats_are_named(tmp_path: Path) -> None:
    """Another machine's code is exit 1 or 2 that names what is read, not a program without moves."""
    for name, text in (("part.nc", "G1 X1 Y2 Z3 F100\n"), ("part.src", "LIN {X 1,Y 2,Z 3}\n")):
        result = Job(tmp_path, program=text, forces=FORCE, name=name).correct()
        assert result.code in (1, 2), result
        assert all(suffix in result.err for suffix in (".mod", ".apt", ".csv")), result


@pytest.mark.parametrize("value", ["0:1", "0", "a:b", "1:0", "5:9", "-1:0", "0:1:2", ":"])
def test_tare_is_checked(tmp_path: Path, value: str) -> None:
    forces = HEAD + "0,5,5,5\n0,5,5,5\n1,4,6,5\n2,65,95,-115\n"
    job = Job(tmp_path, program=P.program(), forces=forces)
    result = job.correct("--json", f"--tare={value}")
    if value == "0:1":
        assert result.code == 0
    elif value == "0":
        assert result.code in (0, 1, 2)
    else:
        assert result.code in (1, 2), result
        assert result.json["findings"]


def test_kilonewtons_under_newtons_are_noticed(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=HEAD + "0,0.05,0.09,-0.12\n1,0.06,0.09,-0.1\n2,0.05,0.08,-0.1\n")
    result = job.correct("--json")
    assert result.code == 0
    said = [finding for finding in result.json["findings"] if finding["code"] == "CS4125"]
    assert said
    assert "newtons" in said[0]["hint"]


def test_the_next_step_reads_the_log_as_this_one_did(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=HEAD + "0,4,5,6\n0,6,5,4\n1,65,95,-115\n2,5,5,5\n")
    result = job.predict("--tare", "0:0", "--scale", "1.2:0.1")
    assert result.code == 0, result
    assert f"--forces {tmp_path / 'forces.csv'} --tare 0:0 --scale 1.2:0.1 -o" in result.err


def test_the_next_step_can_be_copied_into_a_shell(tmp_path: Path) -> None:
    """A folder with a blank in its name is one word."""
    folder = tmp_path / "my part's cell"
    folder.mkdir()
    job = Job(folder, program=P.program(), forces="target,fx_n,fy_n,fz_n\n0,0,0,0\n1,60,90,-120\n")
    job.write()
    words = job.arguments("--tare", "0:0", command="predict")
    result = kit.run(*words)
    assert result.code == 0, result
    step = result.err.splitlines()[-1].removeprefix("next: ")
    call = shlex.split(step)
    assert call[:4] == ["compstiff", "correct", str(folder / "cell.yaml"), str(folder / "part.mod")]
    assert call[call.index("--tare") + 1] == "0:0"


ALONG = "x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n" + "".join(
    ",".join(f"{1e3 * x:.4f}" for x in frame.p) + ",60,90,-120\n" for frame in P.frames)


@pytest.mark.parametrize("forces", [FORCE, ALONG])
def test_a_work_object_that_is_declared_nowhere(tmp_path: Path, forces: str) -> None:
    """One finding names it, before anything that follows from it; stated in cell.yaml it is taken from there."""
    text = P.program().replace("\\WObj:=wPart", "\\WObj:=wOther")
    job = Job(tmp_path, program=text, forces=forces)
    told = refused(job, 3, file="part.mod", line=5 if forces == ALONG else 6, says="work object wOther, which neither this")
    assert sum(finding["level"] == "error" for finding in told["findings"]) == 1
    at = kit.yaml_frame(kit.USER @ kit.OBJECT)
    job.cell = kit.cell_text(extra=f"workobject: {at}\n")
    assert job.correct().code == 0


def test_a_path_out_of_reach_is_one_complaint_a_joint(tmp_path: Path) -> None:
    far = kit.Frame(kit.USER.p + np.array([0.9, 0, 0]), kit.USER.r)
    text = line(40, 3).program().replace(kit.wobjdata(), kit.wobjdata(user=far))
    forces = "target,fx_n,fy_n,fz_n\n" + "".join(f"{i},60,90,-120\n" for i in range(40))
    told = refused(Job(tmp_path, program=text, forces=forces), 3, file="part.mod")
    errors = [finding for finding in told["findings"] if finding["level"] == "error"]
    assert len(errors) <= 7
    assert sum(finding["count"] for finding in errors) >= 40


def test_one_program_takes_the_log_beside_it(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=FORCE).write()
    (tmp_path / "forces.csv").rename(tmp_path / "part.forces.csv")
    call = ["correct", tmp_path / "cell.yaml", tmp_path / "part.mod", "--stiffness", tmp_path / "stiffness.json", "-o", job.out]
    assert kit.run(*call).code == 0
    (tmp_path / "part.forces.csv").unlink()
    result = kit.run(*call, "--force")
    assert result.code == 2
    assert "part.forces.csv" in result.err


def test_tare_takes_the_bias_out(tmp_path: Path) -> None:
    job = Job(tmp_path, program=P.program(), forces=HEAD + "0,4,5,6\n0,6,5,4\n1,65,95,-115\n2,5,5,5\n")
    result = job.correct("--tare", "0:0")
    assert result.code == 0, result
    plan, command = kit.targets_of(str(job.program)), kit.targets_of(job.out.read_text())
    assert kit.lands(command[1], plan[1], P.q[1], np.array([60, 90, -120, 0, 0, 0.0]))[0] < 0.2e-6
