"""What a push says of a cell that answers otherwise than it should: a link with answers written here in place of a network."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from compensator.modbus import link as link_module
from compensator.modbus import registers as at
from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost
from compensator.modbus.registers import Command, Refusal, Result
from compensator.modbus.transfer import identify, push_table, read_table
from compensator.modbus.windows import push_windows
from compensator.modbus.wire import EMPTY, HEADER_REGISTERS, PAGE_ROWS, Header, OffsetTable
from identification.common.findings import CompstiffError, Refused, Unconfirmed
from tests.compensator.modbus import tables_and_devices as kit
from tests.support import free_port

OURS, OLDER, FOREIGN = (kit.random_table(seed) for seed in (1, 2, 3))


class Scripted:
    """A link to a cell. active: the header that it reads back; write: what a write does, raised where it is an exception."""

    address = "cell:502"

    def __init__(self, active: Header, write: Callable[[int, list[int]], Exception | None], result: int = 0) -> None:
        self.active, self.done, self.result, self.lost = active, write, result, False
        self.written: list[tuple[int, int]] = []

    def read(self, address: int, count: int) -> list[int]:
        if self.lost:
            raise LinkLost("the network is down")
        if address == at.ACTIVE:
            assert count == HEADER_REGISTERS
            return self.active.registers()
        return [self.result] * count

    def write(self, address: int, values: list[int]) -> None:
        self.written.append((address, values[0]))
        if self.lost:
            raise LinkLost("the network is down")
        if (reason := self.done(address, values)) is not None:
            raise reason


def push(link: Any) -> str:
    return push_table(link, OURS, 0.0, lambda page, pages: None)


def stopped(link: Any) -> tuple[int, str, str]:
    with pytest.raises(CompstiffError) as raised:
        push(link)
    (finding,) = raised.value.findings
    return raised.value.exit_code, finding.code, finding.message


def is_commit(address: int, values: list[int]) -> bool:
    return address == at.COMMAND and values[0] == Command.COMMIT


@pytest.mark.parametrize("before", [OLDER.header, EMPTY])
def test_a_cell_that_always_loses_its_place_is_given_up_and_the_transfer_withdrawn(before: Header) -> None:
    """After five times, as docs/modbus.md has it."""
    link = Scripted(before, lambda address, values: ExceptionReply(Refusal.SEQUENCE)
                    if address == at.COMMAND and values[0] == Command.BEGIN else None)
    code, finding, message = stopped(link)
    assert (code, finding) == (4, "CS5012")
    assert "the transfer lost its place 5 times" in message
    assert message.endswith("old table active (read back)" + ("" if before else ": none"))
    assert link.written == [(at.COMMAND, Command.BEGIN)] * 5 + [(at.COMMAND, Command.ABORT)]


@pytest.mark.parametrize(("at_commit", "windows", "said"), [
    (False, 1, "(no commit was sent, so this call changed nothing)"), (True, 1, "(a commit was sent)"),
    (False, 2, "(no commit of window 2 of 2 was sent)"), (True, 2, "(a commit was sent)")])
def test_a_cell_that_is_lost_for_good_leaves_it_open_what_is_active(at_commit: bool, windows: int, said: str) -> None:
    """With one window nothing was changed before its commit; with several, those before it were."""
    table = OURS if windows == 1 else kit.random_table(1, 90, 2, 2, 90, 180)

    def write(address: int, values: list[int]) -> Exception | None:
        link.lost = is_commit(address, values) if at_commit else address == at.PAGE
        return LinkLost("timed out") if link.lost else None

    link: Any = Scripted(OLDER.header, write)
    with pytest.raises(Unconfirmed) as raised:
        push_table(link, table, 0.0, lambda page, pages: None)
    (finding,) = raised.value.findings
    assert (finding.code, finding.hint) == ("CS5012", "pushing again is safe and settles it")
    assert finding.message == f"the cell at cell:502 is not reachable or did not confirm: timed out; state unknown {said}"


@pytest.mark.parametrize(("after", "code"), [(OURS.header, ""), (OLDER.header, "CS5012"), (FOREIGN.header, "CS5014"),
                                             (EMPTY, "CS5014")])
def test_after_a_lost_reply_what_is_read_back_is_the_answer(after: Header, code: str) -> None:
    def write(address: int, values: list[int]) -> Exception | None:
        if not is_commit(address, values):
            return None
        link.active = after
        return LinkLost("timed out")

    link: Any = Scripted(OLDER.header, write)
    if not code:
        assert push(link) == "committed, the reply was lost"
        return
    exit_code, found, message = stopped(link)
    assert (exit_code, found) == (3 if code == "CS5014" else 4, code)
    assert (OLDER.header.name in message, FOREIGN.header.name in message) == (False, after == FOREIGN.header)
    assert ("no table is active" in message) == (after == EMPTY)


@pytest.mark.parametrize(("refusal", "result", "code", "said"), [
    (Refusal.VALUE, Result.OFFSET, "CS5011", "the cell refused the table: an offset over its limit; old table active"),
    (Refusal.BUSY, Result.OTHER_WRITER, "CS5013", "the cell is busy: another writer's transfer is under way; old table"),
    (Refusal.BUSY, Result.ROBOT_RUNNING, "CS5013", "the cell is busy: the robot is running with the active table; old"),
    (Refusal.FAILURE, Result.STORAGE, "CS5012", "its state directory cannot be written; old table active")])
def test_what_the_cell_refuses_is_said_with_its_reason(refusal: int, result: int, code: str, said: str) -> None:
    link = Scripted(OLDER.header, lambda address, values: ExceptionReply(refusal) if is_commit(address, values) else None,
                    int(result))
    exit_code, found, message = stopped(link)
    assert (exit_code, found, said in message) == (3 if code == "CS5011" else 4, code, True), message


@pytest.mark.parametrize(("refusal", "patience_s", "most"), [(Refusal.VALUE, 60.0, 1), (Refusal.BUSY, 0.0, 2)])
def test_a_refused_write_is_not_sent_again_and_a_busy_cell_is_asked_no_longer_than_patience_says(
        refusal: int, patience_s: float, most: int) -> None:
    asked: list[int] = []

    def write(address: int, values: list[int]) -> Exception | None:
        if address != at.PAGE:
            return None
        asked.append(address)
        assert len(asked) <= most, "asked again"
        return ExceptionReply(refusal)

    link: Any = Scripted(OLDER.header, write)
    with pytest.raises(CompstiffError):
        push_table(link, OURS, patience_s, lambda page, pages: None)


@pytest.mark.parametrize(("changed", "said"), [
    ({}, ""), ({0: 1}, "registers 0 and 1 are 1 and"), ({2: at.MAP_VERSION + 1}, f"version {at.MAP_VERSION + 1}"),
    ({3: PAGE_ROWS - 1}, f"pages of {PAGE_ROWS - 1} and windows of 500 rows"), ({4: 0}, f"{PAGE_ROWS} and windows of 0"),
    ({7: 0}, "not the cell of the robot irb")])
def test_what_is_not_this_cell_is_told_by_its_first_registers(changed: dict[int, int], said: str) -> None:
    crc = zlib.crc32(kit.ROBOT.encode())
    words = [*at.MAGIC, at.MAP_VERSION, PAGE_ROWS, 500, 2000, crc >> 16, crc & 0xFFFF]
    for place, value in changed.items():
        words[place] = value
    link: Any = type("Answers", (), {"address": "cell:502", "read": lambda self, address, count: words})()
    if not said:
        assert (identify(link, kit.ROBOT).window_rows, identify(link, kit.ROBOT).limit_um) == (500, 2000)
        return
    with pytest.raises(Refused) as raised:
        identify(link, kit.ROBOT)
    assert [(one.code, said in one.message) for one in raised.value.findings] == [("CS5010", True)]


@pytest.mark.parametrize(("code", "other_device"), [(Refusal.FUNCTION, True), (Refusal.ADDRESS, True), (Refusal.BUSY, False)])
def test_a_device_without_these_registers_is_another_and_a_busy_one_is_not(code: int, other_device: bool) -> None:
    def read(self: object, address: int, count: int) -> list[int]:
        raise ExceptionReply(code)

    link: Any = type("Refuses", (), {"address": "cell:502", "read": read})()
    with pytest.raises(Refused if other_device else ExceptionReply) as raised:
        identify(link, kit.ROBOT)
    assert not other_device or [one.code for one in raised.value.findings] == ["CS5010"]


@pytest.mark.parametrize("changes", [4, 5])
def test_a_table_that_another_one_replaces_at_every_read_is_given_up_after_five(changes: int) -> None:
    """Rows of one table under the header of another are never handed out; then there is none."""
    headers = [kit.random_table(seed).header for seed in range(changes + 1)]
    asked: list[int] = []

    def read(self: object, address: int, count: int) -> list[int]:
        if address != at.ACTIVE:
            return OURS.registers.ravel().tolist()
        asked.append(address)
        return headers[min(len(asked) // 2, changes)].registers()

    found = read_table(cast(Link, type("Changing", (), {"read": read})()))
    if changes == 4:
        assert (found.header, found.registers.tolist()) == (headers[-1], OURS.registers.tolist())
    else:
        assert (found.header, len(found.registers)) == (EMPTY, 0)


def test_who_does_not_answer_is_asked_again_after_ever_longer_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """As often as the cell's retries say."""
    waited: list[float] = []
    monkeypatch.setattr(link_module.time, "sleep", waited.append)
    with Link(Address("127.0.0.1", free_port(), 1, 1.0, 3)) as link, pytest.raises(LinkLost):
        link.read(at.ACTIVE, 1)
    assert waited == pytest.approx(link_module.FIRST_PAUSE_S * np.array([1, 2, 4]))


@pytest.mark.parametrize(("lost", "code", "said"), [
    (True, "CS5016", "the cell was lost while the robot worked on window 1 of 2, which was active: the network is down"),
    (False, "CS5014", "neither this one nor the one before")])
def test_what_happens_while_the_robot_works_on_a_window_stops_the_walk(lost: bool, code: str, said: str) -> None:
    """The cell goes, or somebody else pushes: the next window is not sent."""
    windows: list[OffsetTable] = [kit.random_table(1, 90, 1, 2, 0, 180), kit.random_table(4, 90, 2, 2, 90, 180)]
    link: Any = Scripted(windows[0].header, lambda address, values: None)
    told: list[str] = []

    def say(text: str) -> None:
        told.append(text)
        link.lost = lost
        link.active = FOREIGN.header

    with pytest.raises(CompstiffError) as raised:
        push_windows(link, windows, patience_s=0.0, robot_s=5.0, restart=False, progress=lambda page, pages: None, say=say)
    (finding,) = raised.value.findings
    assert (finding.code, said in finding.message) == (code, True), finding.message
    assert told == ["window 1 of 2: targets 0 to 89, already active"]
    assert link.written == []
