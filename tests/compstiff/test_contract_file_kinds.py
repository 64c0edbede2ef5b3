"""A file's kind by its suffix, its name and its header, as docs/formats.md has them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from compstiff.file_kinds import kind_of
from identification.common.findings import CompstiffError
from identification.model.cell_file import ForceLogFile

ANGLES = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
HEADERS = {
    "test.csv": (f"{ANGLES},fx_n,fy_n,fz_n,dx_um,dy_um,dz_um", "measurements"),
    "weights.csv": (f"{ANGLES},mass_kg,dx_um,dy_um,dz_um", "measurements"),
    "named.csv": ("A1,A2,A3,A4,A5,A6,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um", "measurements"),
    "motor.csv": ("time_s,q1_motor_deg,tau1_nm,dx_um", "joint log"), "link.csv": ("time_s,q1_link_deg,tau1_nm", "joint log"),
    "offsets.csv": ("target,x_mm,y_mm,z_mm,ox_mm,oy_mm,oz_mm", "offsets"),
    "readings.csv": ("dx_um,dy_um,dz_um", "measured part"),
    "part.csv": ("target,dx_um,dy_um,dz_um", "measured part"), "wall.csv": ("x_mm,y_mm,z_mm,dn_um", "measured part"),
    "log.csv": ("time_s,fx_n,fy_n,fz_n", "force log"), "raw.csv": ("target,fx_counts,fy_counts,fz_counts", "force log"),
    "path.csv": ("x_mm,y_mm,z_mm,q1,q2,q3,q4,feed_mm_s", "toolpath"), "part.forces.csv": ("a,b,c", "force log"),
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_table_is_told_by_its_header(tmp_path: Path, name: str) -> None:
    header, kind = HEADERS[name]
    (tmp_path / name).write_text(f"{header}\n{','.join('1' * (header.count(',') + 1))}\n")
    assert kind_of(tmp_path / name, ForceLogFile()) == kind


def test_a_table_of_no_kind_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.csv").write_text("a,b,c\n1,2,3\n")
    with pytest.raises(CompstiffError) as caught:
        kind_of(tmp_path / "other.csv", ForceLogFile())
    assert caught.value.findings[0].code == "CS0110"


def test_a_suffix_that_is_not_read_is_told_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "log.tdms").write_text("")
    with pytest.raises(CompstiffError) as caught:
        kind_of(tmp_path / "log.tdms", ForceLogFile())
    (said,) = caught.value.findings
    told = re.fullmatch(r"'\.tdms' is no suffix that is read, expected one of (.+)", said.message)
    assert said.code == "CS0110"
    assert told
    suffixes = told[1].split(", ")
    assert {".csv", ".xlsx", ".parquet", ".pq", ".mod", ".apt", ".yaml", ".yml", ".json", ".mat", ".lvm"} <= {*suffixes}
    assert len(suffixes) == len({*suffixes})
    by_suffix = {".lvm": "force log", ".mat": "joint log", ".mod": "toolpath", ".apt": "toolpath"}
    assert {suffix: kind_of(tmp_path / f"a{suffix}", ForceLogFile()) for suffix in by_suffix} == by_suffix


@pytest.mark.parametrize(("name", "content", "kind"), [
    ("part.MOD", "", "toolpath"), ("part.cls", "", "toolpath"), ("arm.yaml", "joints: []\n", "robot"),
    ("log.lvm", "", "force log"),
    ("block.yaml", "box: {}\n", "stock"), ("cell.yml", "robot: a\n", "cell"), ("arm.mat", "", "joint log")])
def test_other_files_are_told_by_suffix_and_keys(tmp_path: Path, name: str, content: str, kind: str) -> None:
    (tmp_path / name).write_text(content)
    assert kind_of(tmp_path / name, ForceLogFile()) == kind


def table(folder: Path, name: str, header: str) -> Path:
    (folder / name).write_text(f"{header}\n{','.join('1' * (header.count(',') + 1))}\n")
    return folder / name


@pytest.mark.parametrize(("header", "kind"), [
    ("q1_deg,dx_um", "measurements"), ("q1_deg,mass_kg", "measurements"), ("q2_deg,q3_deg,q4_deg,q5_deg,dz_um", "measurements"),
    ("q2_deg,q3_deg,q4_deg,dx_um", "measured part"), (f"{ANGLES},fx_n", "force log"), ("ox_mm,dx_um,fx_n", "offsets"),
    ("a,b,mass_kg,dx_um", "measurements"), ("a,b,fx_n,dx_um", "measurements"), ("target,fx_n,dx_um", "measured part"),
    ("path_mm,mass_kg,dx_um", "measured part"), ("x_mm,mass_kg,dx_um", "measured part"), ("x_mm,d_um", "measured part"),
    ("target,dn_um,fx_n", "measured part"), ("time_s,fx_n", "force log"), ("time_s,fx_counts", "force log"),
    ("x_mm,y_mm,z_mm,q1,q2,q3,q4", "toolpath"), ("x_mm,y_mm,z_mm,q1,q2,q3", ""), ("time_s,fy_n,fz_n", ""),
    ("mass_kg,q2_deg", "")])
def test_what_a_header_must_have_at_least(tmp_path: Path, header: str, kind: str) -> None:
    """One column more or less makes it another kind, or none."""
    if kind:
        assert kind_of(table(tmp_path, "t.csv", header), ForceLogFile()) == kind
        return
    with pytest.raises(CompstiffError) as caught:
        kind_of(table(tmp_path, "t.csv", header), ForceLogFile())
    assert [one.code for one in caught.value.findings] == ["CS0110"]
    assert kind_of(table(tmp_path, "t.FORCES.csv", header), ForceLogFile()) == "force log"


def test_a_table_of_no_kind_is_told_by_its_first_twelve_columns(tmp_path: Path) -> None:
    names = [f"c{k:02}" for k in range(14)]
    with pytest.raises(CompstiffError) as caught:
        kind_of(table(tmp_path, "t.csv", ",".join([*names[::-1], ""])), ForceLogFile())
    assert caught.value.findings[0].message == f"no kind of table has these columns: {', '.join(names[:12])}"


LOGGED = ("time_s", "fx_n", "fy_n")


@pytest.mark.parametrize(("name", "header", "kind"), [
    ("a.forces.csv", f"{ANGLES},dx_um", "force log"), ("a.csv", f"{ANGLES},dx_um", "measurements"),
    ("a.csv", "a,b,c", "force log"), ("a.csv", "a,b,c,d", ""), ("a.csv", "1,2,3", "force log"),
    ("a.csv", "1,2,3,4", "force log")])
def test_a_logger_s_columns_stand_in_the_cell(tmp_path: Path, name: str, header: str, kind: str) -> None:
    """By the name of a log whatever its first line says; where that is numbers; and where no kind has these columns and there
    are as many."""
    form = ForceLogFile(columns=LOGGED)
    if kind:
        assert kind_of(table(tmp_path, name, header), form) == kind
    else:
        with pytest.raises(CompstiffError):
            kind_of(table(tmp_path, name, header), form)


def test_a_binary_table_has_names_of_its_own(tmp_path: Path) -> None:
    """It is no log by how many columns it has."""
    pd.DataFrame({"time_s": [1.0], "fx_n": [2.0]}).to_parquet(tmp_path / "log.pq")
    assert kind_of(tmp_path / "log.pq", ForceLogFile()) == "force log"
    pd.DataFrame({"a": [1.0], "b": [2.0], "c": [3.0]}).to_parquet(tmp_path / "t.PARQUET")
    with pytest.raises(CompstiffError, match="CS0110"):
        kind_of(tmp_path / "t.PARQUET", ForceLogFile(columns=LOGGED))


@pytest.mark.parametrize(("content", "kind"), [
    ({"format": "compstiff-stiffness"}, "stiffness"), ({"format": "compstiff-learned"}, "learned"),
    ({"format": "compstiff-diagnosis"}, "diagnosis"), ({"format": "compstiff-correction"}, "record"),
    ({"format": "compstiff-post"}, "record"), ({"format": "compstiff-watch"}, "record"),
    ({"format": "compstiff-active"}, "record"), ({"format": "compstiff-cutting"}, "cutting"),
    ({"format": "compstiff-identify", "exit_code": 1}, "result"), ({"format": "compstiff-cutting", "exit_code": 0}, "result"),
    ({"format": "other", "exit_code": 0}, ""), ({"format": "compstiff-other"}, ""), ({"format": 3, "exit_code": 0}, ""),
    ({}, ""), (["compstiff-stiffness"], "")])
def test_a_json_file_is_told_by_its_format(tmp_path: Path, content: object, kind: str) -> None:
    (tmp_path / "a.json").write_text(json.dumps(content))
    if kind:
        assert kind_of(tmp_path / "a.json", ForceLogFile()) == kind
        return
    written = content.get("format") if isinstance(content, dict) else None
    with pytest.raises(CompstiffError) as caught:
        kind_of(tmp_path / "a.json", ForceLogFile())
    assert caught.value.findings[0].message.startswith(f"its format is {written!r}, expected one of compstiff-stiffness, ")


def test_a_json_file_that_is_none_is_told_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"format":\n  x}')
    with pytest.raises(CompstiffError) as caught:
        kind_of(tmp_path / "a.json", ForceLogFile())
    told, = caught.value.findings
    assert (told.code, told.line, told.column) == ("CS0110", 2, 3)
    with pytest.raises(CompstiffError, match="CS0005"):
        kind_of(tmp_path / "b.json", ForceLogFile())


def test_a_table_without_header_is_asked_what_its_columns_are(tmp_path: Path) -> None:
    with pytest.raises(CompstiffError, match="CS3020.*cell.yaml does not say what they are"):
        kind_of(table(tmp_path, "a.csv", "1,2,3"), ForceLogFile())


@pytest.mark.parametrize(("name", "log_format", "known"), [
    ("a.txt", None, False), ("a.txt", "lvm", True), ("a.lvm", None, True)])
def test_a_suffix_that_is_not_read_is_a_log_s_where_its_format_is_named(
    tmp_path: Path, name: str, log_format: str | None, known: bool
) -> None:
    if known:
        assert kind_of(tmp_path / name, ForceLogFile(), log_format) == "force log"
    else:
        with pytest.raises(CompstiffError, match=r"CS0110.*'.txt' is no suffix that is read"):
            kind_of(tmp_path / name, ForceLogFile(), log_format)
