"""What a push says that it would change: of the table that is active, target by target, and of limits."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from compensator.modbus.link import Address
from compensator.modbus.offset_file import Offsets
from compensator.modbus.push import PushResult
from compensator.modbus.server import Loopback
from compensator.modbus.wire import EMPTY, OffsetTable, to_registers
from compstiff.cli.push import push
from tests.compensator.modbus import tables_and_devices as kit

CELL = Address("127.0.0.1", 502, 1)


def result(um: np.ndarray, first: int, tables: list[OffsetTable], active: OffsetTable | None) -> PushResult:
    count = len(um)
    offsets = Offsets("offsets.csv", first, 1e-6 * um, np.full(count, np.nan), np.arange(count), ())
    return PushResult(offsets, CELL, 2e-3, tables, active, ())


@pytest.mark.parametrize("seed", range(30))
def test_the_difference_is_that_of_each_target(seed: int) -> None:
    """By dictionaries from targets to offsets, of tables that begin and end at other targets, or have none in common."""
    rng = np.random.default_rng((5002, seed))
    first, rows, its_first, its_rows = (int(n) for n in rng.integers([0, 1, 0, 1], [40, 60, 90, 60]))
    um = rng.integers(-900, 900, (rows, 3))
    its = rng.integers(-900, 900, (its_rows, 3))
    alike = dict(zip(range(first, first + rows), um.tolist(), strict=True))
    for k in range(its_rows):
        if its_first + k in alike and rng.random() < 0.5:
            its[k] = alike[its_first + k]
    new = OffsetTable.of(to_registers(um), first, first + rows)
    old = OffsetTable.of(to_registers(its), its_first, its_first + its_rows)
    there = dict(zip(range(its_first, its_first + its_rows), its.tolist(), strict=True))
    both = sorted(alike.keys() & there.keys())
    by = [float(np.linalg.norm(np.subtract(alike[target], there[target]))) for target in both]
    found = result(um, first, [new], old)
    assert found.difference == {
        "same": False, "rows_in_both": len(both), "rows_changed": sum(size > 0 for size in by),
        "rows_only_new": len(alike.keys() - there.keys()), "rows_only_active": len(there.keys() - alike.keys()),
        "largest_change_mm": pytest.approx(1e-3 * max(by, default=0.0), abs=1e-6)}
    count = len(alike.keys() - there.keys())
    assert found.lines()[3] == (
        f"active table: {old.header.name}, {its_rows} rows: {sum(size > 0 for size in by)} of {len(both)} common rows differ, "
        f"by up to {1e-3 * max(by, default=0.0):.3f} mm; {count} row{'s' * (count != 1)} new, "
        f"{len(there.keys() - alike.keys())} go")


def test_of_several_windows_the_active_one_is_compared_with_itself() -> None:
    """And another program's with the first; of no table all is new, and of a cell that was not asked nothing is said."""
    um = np.arange(300).reshape(100, 3)
    registers = to_registers(um)
    tables = [OffsetTable.of(registers[40 * k:40 * k + 40], 5 + 40 * k, 105, k + 1, 3) for k in range(3)]
    for number, table in enumerate(tables):
        found = result(um, 5, tables, table)
        assert found.difference == {"same": True, "rows_in_both": 20 if number == 2 else 40, "rows_changed": 0,
                                    "rows_only_new": 0, "rows_only_active": 0, "largest_change_mm": 0.0}
        assert found.lines()[3].endswith(f"{20 if number == 2 else 40} rows: this one, nothing differs")
    other = OffsetTable.of(to_registers(um[:40] + 1), 45, 105, 2, 3)
    assert result(um, 5, tables, other).difference == {
        "same": False, "rows_in_both": 0, "rows_changed": 0, "rows_only_new": 40, "rows_only_active": 40,
        "largest_change_mm": 0.0}
    none = result(um, 5, tables, OffsetTable(EMPTY, np.empty((0, 3), np.uint16)))
    assert (none.difference or {})["rows_only_new"] == 40
    size = 1e-3 * np.sqrt(297**2 + 298**2 + 299**2)
    assert none.lines()[1:4] == ["rows: 100, targets 5 to 104, 3 pages, 3 windows",
                                 f"largest offset: {size:.4f} mm at target 104, limit 2 mm; sent in whole micrometres",
                                 "active table: none"]
    unasked = result(um, 5, tables[:1], None)
    assert unasked.difference is None
    assert unasked.lines()[1].endswith(f" 1 page, table {tables[0].header.name}")
    assert unasked.lines()[3:] == ["dry run: nothing was sent"]


def test_the_numbers_of_a_push_are_those_of_its_offsets() -> None:
    um = np.array([[0, 0, 0], [30, 40, 0], [-1200, 0, 500], [0, 7, 0]])
    told = result(um, 8, [OffsetTable.of(to_registers(um), 8, 12)], None)
    told.offsets.turn[1:3] = np.radians([0.02, 0.05])
    document = told.as_dict()
    assert document["target"] == {"host": "127.0.0.1", "port": 502, "unit": 1, "tls": False}
    expected = {"rows": 4, "first_target": 8, "largest_offset_mm": 1.3, "largest_at_target": 10, "limit_mm": 2.0}
    assert {name: document[name] for name in expected} == expected
    assert document["turn_not_sent_deg"] == pytest.approx(0.05)
    assert (document["active_before"], document["difference"], document["applied"], document["results"]) == (
        None, None, False, [])


@pytest.mark.parametrize(("mm", "refused"), [(2.0, False), (2.001, False), (2.0011, True), (3.0, True)])
def test_a_cell_with_a_lower_limit_than_cell_yaml_is_told_before_anything_is_sent(
    tmp_path: Path, mm: float, refused: bool
) -> None:
    """Its 2 mm, and a micrometre for the rounding; stated are 5."""
    file, cell = tmp_path / "offsets.csv", tmp_path / "cell.yaml"
    file.write_text(f"target,ox_mm,oy_mm,oz_mm\n3,0,0.1,0\n4,0,{-mm},0\n")
    with Loopback(kit.offset_device()) as server:
        cell.write_text(f"robot: {kit.ROBOT}\ntool: {{position_mm: [120, 0, 250]}}\nmodbus: {{port: {server.port}}}\n"
                        "limits: {max_offset_mm: 5}\n")
        done = CliRunner().invoke(push, [str(cell), str(file), "--json"])
    told = [one for one in json.loads(done.stdout)["findings"] if one["level"] == "error"]
    assert (done.exit_code, [one["code"] for one in told]) == ((3, ["CS5011"]) if refused else (0, []))
    assert all(one["message"] == f"the largest offset, {np.ceil(1e3 * mm - 1e-9) / 1e3:.3f} mm at target 4, is over the cell's "
               "own limit, 2.000 mm" for one in told)
