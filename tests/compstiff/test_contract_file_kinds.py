"""A file's kind by its suffix, its name and its header, as docs/formats.md has them."""

from __future__ import annotations

import re
from pathlib import Path

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
