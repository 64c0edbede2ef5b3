"""Ctrl-C in a push: what it says is active is what the cell's registers hold; and what a push of windows says when it stops."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import compstiff
from compensator.modbus import registers as at
from compensator.modbus.link import ExceptionReply, LinkLost
from compensator.modbus.offset_file import Offsets, tables_of
from compensator.modbus.registers import Command, Refusal
from compensator.modbus.server import Loopback
from compensator.modbus.transfer import push_table
from compensator.modbus.windows import push_windows
from compensator.modbus.wire import OffsetTable
from identification.common.findings import CompstiffError, Interrupted
from tests.compensator.modbus import tables_and_devices as kit
from tests.compensator.modbus.test_contract_settled import Scripted

WINDOW = 60
OFFSETS = Offsets("offsets.csv", 0, 1e-6 * np.random.default_rng(8).integers(-900, 900, (150, 3)), np.zeros(150),
                  np.arange(150), ())
OLDER, FOREIGN = kit.random_table(2, 50), kit.random_table(3, 50)
ONE, THREE = tables_of(OFFSETS, 500), tables_of(OFFSETS, WINDOW)
CELL: Any = SimpleNamespace(robot=SimpleNamespace(name=kit.ROBOT), max_offset=0.002)


@pytest.mark.parametrize(("windows", "before", "at_page", "meanwhile", "said"), [
    (500, None, 2, None, "old table active (read back): none"),
    (500, OLDER, 2, None, "old table active (read back)"),
    (500, OLDER, 2, ONE[0], "new table active (read back)"),
    (500, OLDER, 2, FOREIGN, f"table {FOREIGN.header.name} is active (read back)"),
    (WINDOW, OLDER, 1, None, "old table active (read back)"),
    (WINDOW, OLDER, None, None, "window 1 of 3 is active (read back)"),
    (WINDOW, THREE[1], None, None, "window 2 of 3 is active (read back)")])
def test_after_ctrl_c_the_table_that_is_active_is_named(
        windows: int, before: OffsetTable | None, at_page: int | None, meanwhile: OffsetTable | None, said: str) -> None:
    """In the middle of a table, whoever commits one then; and between two windows, also where the push began with a later
    one."""
    device = kit.offset_device(window_rows=windows)
    if before:
        kit.load(device, before)

    def progress(page: int, pages: int) -> None:
        if page == at_page:
            if meanwhile:
                kit.load(device, meanwhile)
            raise KeyboardInterrupt

    def say(text: str) -> None:
        raise KeyboardInterrupt

    with Loopback(device) as server:
        address = compstiff.Address("127.0.0.1", server.port, 1, kit.TIMEOUT_S)
        with pytest.raises(Interrupted) as raised:
            compstiff.push(CELL, OFFSETS, address, apply=True, progress=progress, say=say)
    (finding,) = raised.value.findings
    assert (finding.code, finding.message) == ("CS5018", f"interrupted; {said}")
    assert device.receiving is None


def test_ctrl_c_beside_a_cell_that_restarted_without_its_table_says_that_none_is_active() -> None:
    device = kit.offset_device()
    kit.load(device, OLDER)

    def progress(page: int, pages: int) -> None:
        kit.restart(device, device.store)
        raise KeyboardInterrupt

    with Loopback(device) as server:
        address = compstiff.Address("127.0.0.1", server.port, 1, kit.TIMEOUT_S)
        with pytest.raises(Interrupted, match=r"interrupted; no table is active \(read back\)"):
            compstiff.push(CELL, OFFSETS, address, apply=True, progress=progress)


def test_ctrl_c_with_the_cell_gone_leaves_the_state_open(tmp_path: Path) -> None:
    log, device = tmp_path / "push-log.jsonl", kit.offset_device()
    server = Loopback(device)

    def progress(page: int, pages: int) -> None:
        server.__exit__(None, None, None)
        raise KeyboardInterrupt

    address = compstiff.Address("127.0.0.1", server.__enter__().port, 1, 0.5)
    with pytest.raises(Interrupted) as raised:
        compstiff.push(CELL, OFFSETS, address, apply=True, progress=progress, log=log)
    (finding,) = raised.value.findings
    assert (finding.message, finding.hint) == ("interrupted; state unknown", "push again to settle it")
    kept = [json.loads(line) for line in log.read_text().splitlines()]
    assert [(line["result"], line.get("exit_code")) for line in kept] == [("started", None), ("interrupted", 130)]


@pytest.mark.parametrize(("reason", "code", "said"), [
    (LinkLost("timed out"), "CS5012", "the cell at cell:502 did not confirm: timed out"),
    (ExceptionReply(Refusal.BUSY), "CS5013", "the cell is busy"),
    (ExceptionReply(Refusal.VALUE), "CS5011", "the cell refused the table")])
@pytest.mark.parametrize("later", [False, True])
def test_a_later_window_that_does_not_go_names_the_one_that_is_active(
        reason: Exception, code: str, said: str, later: bool) -> None:
    """What stands in the cell then is no old table, but the first windows of the new program."""
    def write(address: int, values: list[int]) -> Exception | None:
        if address != at.COMMAND or values[0] != Command.COMMIT:
            return None
        if later and values[1:] == THREE[0].header.registers():
            link.active = THREE[0].header
            return None
        return reason

    link: Any = Scripted(OLDER.header, write, 1)      # FINISHED reads 1: the robot is done with the first window
    with pytest.raises(CompstiffError) as raised:
        push_windows(link, THREE, patience_s=0.0, robot_s=5.0, restart=False, progress=lambda page, pages: None,
                     say=lambda text: None)
    (finding,) = raised.value.findings
    state = "window 1 of 3 is active (read back)" if later else "old table active (read back)"
    assert (finding.code, finding.message.startswith(said), finding.message.rpartition("; ")[2]) == (code, True, state)


def test_only_a_busy_cell_is_asked_again_and_that_for_so_long_as_was_said() -> None:
    """One that refuses is told at once, one that stays busy after the patience."""
    def asked(refusal: Refusal, patience_s: float) -> tuple[int, float]:
        def write(address: int, values: list[int]) -> Exception | None:
            return ExceptionReply(refusal) if values[0] == Command.BEGIN else None

        link: Any = Scripted(OLDER.header, write)
        began = time.monotonic()
        with pytest.raises(CompstiffError):
            push_table(link, FOREIGN, patience_s, lambda page, pages: None)
        return link.written.count((at.COMMAND, Command.BEGIN)), time.monotonic() - began

    times, took = asked(Refusal.BUSY, 0.35)
    assert 3 <= times <= 5
    assert 0.35 <= took < 2.0
    assert asked(Refusal.VALUE, 0.35)[0] == 1
