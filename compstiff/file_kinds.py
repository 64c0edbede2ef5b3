"""What kind of file a file is, told by its suffix and by what stands in it: `compstiff check` reads each as its own kind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from compensator.posting.suffixes import APT_SUFFIXES, RAPID_SUFFIXES, toolpath_suffix
from identification.common.columns import DEFLECTIONS, FORCES, JOINTS, MASS
from identification.common.findings import CompstiffError, error
from identification.common.header_names import meant
from identification.common.workbook import sheet_finding
from identification.common.yaml_source import read_mapping
from identification.model.cell_file import ForceLogFile

Kind = Literal["cell", "robot", "measurements", "joint log", "toolpath", "force log", "stiffness", "learned", "diagnosis",
               "record", "result", "offsets", "measured part", "cutting", "stock"]
TABLES = (".csv", ".parquet", ".pq", ".xlsx")
FORMATS: dict[str, Kind] = {"compstiff-stiffness": "stiffness", "compstiff-learned": "learned",
                            "compstiff-diagnosis": "diagnosis", "compstiff-correction": "record", "compstiff-post": "record",
                            "compstiff-watch": "record", "compstiff-active": "record", "compstiff-cutting": "cutting"}
# A YAML file with one of these says what a program starts from.
OF_STOCK = {"box", "stl", "left_by"}
# LabVIEW's, which a folder may hold beside what was converted from it: read where it is named.
LVM = ".lvm"
# Every other suffix that may be read: what a folder's other files are is not asked.
SUFFIXES = (*RAPID_SUFFIXES, *APT_SUFFIXES, *TABLES, ".yaml", ".yml", ".json", ".mat")
LOG_NAME = ".forces."


def kind_of(file: Path, form: ForceLogFile, log_format: str | None = None) -> Kind:
    """The kind of a file. form: how the cell's logger writes, for a log without a header; log_format: as for `read_force_log`.

    Raises CompstiffError: CS0110 none of the kinds that are read, and what the readers of headers, YAML and JSON raise.
    """
    suffix = toolpath_suffix(file)
    if suffix in (*RAPID_SUFFIXES, *APT_SUFFIXES):
        return "toolpath"
    if suffix in (".yaml", ".yml"):
        keys = set(read_mapping(file))
        return "robot" if "joints" in keys else "stock" if keys & OF_STOCK else "cell"
    if suffix == ".mat":
        return "joint log"
    if suffix == ".json":
        return _of_json(file)
    if suffix in TABLES:
        return _of_table(file, form)
    if suffix == LVM or log_format is not None:
        return "force log"
    raise _unknown(file, f"'{suffix}' is no suffix that is read, expected one of {', '.join((*SUFFIXES, LVM))}")


def _of_json(file: Path) -> Kind:
    content: Any = None
    try:
        content = json.loads(file.read_bytes())
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    except json.JSONDecodeError as reason:
        raise error("CS0110", f"is not JSON: {reason.msg}", file=str(file), line=reason.lineno, column=reason.colno,
                    hint="compstiff writes this file; make it anew") from reason
    except (ValueError, RecursionError) as reason:
        raise error("CS0110", f"is not JSON: {reason}", file=str(file), hint="compstiff writes this file") from reason
    written = content.get("format") if isinstance(content, dict) else None
    if isinstance(written, str) and written.startswith("compstiff-") and "exit_code" in content:
        return "result"         # the document that `--json` prints
    if not isinstance(written, str) or written not in FORMATS:
        raise _unknown(file, f"its format is {written!r}, expected one of {', '.join(FORMATS)}")
    return FORMATS[written]


def columns_of(file: Path) -> tuple[str, ...]:
    """The names in the header of a table. Raises CompstiffError: CS0005, CS0201, CS0202, CS3020 no header."""
    return _headers(file)[0]


def _headers(file: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The names in the first row, and those just above the numbers where a logger wrote more than one row above them."""
    if file.suffix.lower() in (".parquet", ".pq"):
        from identification.common.number_blocks import parquet_names

        return parquet_names(file)[0], ()
    from identification.common.table_layout import read_layout

    layout = read_layout(file)
    return layout.names, layout.above


def _of_table(file: Path, form: ForceLogFile) -> Kind:
    if form.columns is not None and LOG_NAME in file.name.lower():
        return "force log"      # its columns stand in cell.yaml, whatever its first line says
    try:
        first, above = _headers(file)
    except CompstiffError as stopped:
        if form.columns is not None and stopped.findings[0].code == "CS3020":
            return "force log"      # no header, and no other table may have none: its reader says whether its columns are those
        raise
    header = set(first)
    # By another header, such as Fx [N]: its reader says what the columns should be called.
    names = header | {column for column, _ in map(meant, (*first, *above)) if column}
    if any(name.endswith(("_motor_deg", "_link_deg")) for name in names):
        return "joint log"
    joints = len(names & {*JOINTS})         # one name may be wrong
    if (JOINTS[0] in names or joints > len(JOINTS) / 2) and names & {*DEFLECTIONS, MASS}:
        return "measurements"
    if "ox_mm" in names:
        return "offsets"
    # A load test whose angles have names of their own: its reader says what they should be called.
    if names & {*DEFLECTIONS} and names & {MASS, FORCES[0]} and not names & {"target", "path_mm", "x_mm"}:
        return "measurements"
    if names & {*DEFLECTIONS, "dn_um", "d_um"}:
        return "measured part"
    if names & {FORCES[0], "fx_counts"}:
        return "force log"
    if {"x_mm", "y_mm", "z_mm", "q1", "q2", "q3", "q4"} <= names:
        return "toolpath"
    if LOG_NAME in file.name.lower():
        return "force log"      # by its name: its reader says what its columns should be called
    if _has_columns(file, form):
        return "force log"
    unknown = _unknown(file, f"no kind of table has these columns: {', '.join(sorted(header - {''})[:12])}",
                       "the first row that does not begin with # must name the columns, such as q1_deg or fx_n; ")
    raise CompstiffError(*unknown.findings, *sheet_finding(file))


def _has_columns(file: Path, form: ForceLogFile) -> bool:
    """Whether this table has as many columns as those that cell.yaml names for a log, above which anything may stand."""
    from identification.common.table_layout import read_layout

    if form.columns is None or file.suffix.lower() in (".parquet", ".pq"):
        return False
    try:
        read_layout(file, form.columns)
    except CompstiffError:
        return False
    return True


def _unknown(file: Path, found: str, hint: str = "") -> CompstiffError:
    return error("CS0110", found, file=str(file), hint=f"{hint}docs/formats.md of the project has the files and their columns")
