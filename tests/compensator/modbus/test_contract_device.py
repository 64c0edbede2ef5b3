"""The device's rules, without a network: sequence, CRC, limit, one writer, the robot's hand on the table."""

from itertools import pairwise

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.device import LEASE_S, ROBOT_STALE_S, RefusedWrite
from compensator.modbus.registers import Command, Refusal, Result, Robot
from compensator.modbus.wire import HEADER_REGISTERS, Header, OffsetTable, split, to_registers
from tests.compensator.modbus.tables_and_devices import load, offset_device, random_table


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def begin(device, table: OffsetTable) -> None:
    device.write(at.COMMAND, [Command.BEGIN, *table.header.registers()])


def page(device, table: OffsetTable, number: int) -> None:
    device.write(at.PAGE, table.page(number))


def commit(device, table: OffsetTable) -> None:
    device.write(at.COMMAND, [Command.COMMIT, *table.header.registers()])


def refused(code: Refusal, result: Result, device, call, *arguments) -> None:
    before = device.read(at.ACTIVE, HEADER_REGISTERS)
    with pytest.raises(RefusedWrite) as caught:
        call(device, *arguments)
    assert (caught.value.code, device.read(at.RESULT, 1)) == (code, [result])
    assert device.read(at.ACTIVE, HEADER_REGISTERS) == before


def test_a_transfer_shows_only_after_its_commit():
    device, table = offset_device(), random_table(1)
    assert device.read(at.ACTIVE, HEADER_REGISTERS) == [0] * HEADER_REGISTERS
    begin(device, table)
    for number in range(3):
        page(device, table, number)
        assert device.read(at.ACTIVE, 1) == [0]
        assert device.read(at.STATUS, 5) == [1, 0, *split(table.header.id), number + 1]
    commit(device, table)
    assert device.read(at.ACTIVE, HEADER_REGISTERS) == table.header.registers()
    assert device.read(at.TABLE, 270) == table.registers.ravel().tolist()
    with pytest.raises(RefusedWrite):
        device.read(at.TABLE, 271)


def test_every_step_may_be_repeated():
    device, table = offset_device(), random_table(1)
    for number in range(3):
        begin(device, table)
        begin(device, table)
        page(device, table, number)
        page(device, table, number)
        page(device, table, 0)
    for _ in range(3):
        commit(device, table)
    assert (device.read(at.ACTIVE, HEADER_REGISTERS), device.commits) == (table.header.registers(), 1)


def test_out_of_sequence_is_refused():
    device, table = offset_device(), random_table(1)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, page, table, 0)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, commit, table)
    begin(device, table)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, page, table, 1)
    page(device, table, 0)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, commit, table)
    device.write(at.COMMAND, [Command.ABORT, *table.header.registers()])
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, page, table, 1)


def test_a_wrong_crc_is_refused_and_the_transfer_dropped():
    table = random_table(1)
    wrong = OffsetTable(Header(**{**table.header.as_dict(), "crc": table.header.crc ^ 1}), table.registers)
    device = offset_device()
    load(device, random_table(2))
    begin(device, wrong)
    for number in range(3):
        page(device, wrong, number)
    refused(Refusal.SEQUENCE, Result.CRC, device, commit, wrong)
    assert device.read(at.STATUS, 1) == [0]


@pytest.mark.parametrize(("um", "result"), [(2500, Result.OFFSET), (-2500, Result.OFFSET), (32767, Result.OFFSET),
                                            (-32768, Result.OFFSET)])
def test_the_cell_refuses_an_offset_over_its_limit_by_itself(um, result):
    registers = np.full((5, 3), 32768, np.uint16)
    registers[3, 2] = 32768 + um
    table = OffsetTable.of(registers, 0, 5, 1, 1)
    device = offset_device()
    begin(device, table)
    page(device, table, 0)
    refused(Refusal.VALUE, result, device, commit, table)
    assert device.read(at.STATUS, 1) == [0]


def test_headers_and_pages_that_make_no_sense_are_refused():
    device, table = offset_device(window_rows=100), random_table(1)
    for change in ({"id": 0}, {"rows": 0}, {"rows": 101, "total": 101}, {"first": 1}, {"window": 0}, {"window": 2}):
        header = Header(**{**table.header.as_dict(), **change})
        refused(Refusal.VALUE, Result.HEADER, device, begin, OffsetTable(header, table.registers))
    refused(Refusal.VALUE, Result.HEADER, device, lambda device: device.write(at.COMMAND, [9, *table.header.registers()]))
    refused(Refusal.VALUE, Result.HEADER, device, lambda device: device.write(at.COMMAND, [1]))
    begin(device, table)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, lambda device: device.write(at.PAGE, [*split(table.header.id + 1), 0]))
    for strange in ([1, 2, 3], [1, 2, 3, 4], [1, 2, 3, 4, 5]):      # long enough to say which transfer they are not of
        refused(Refusal.SEQUENCE, Result.SEQUENCE, device, lambda device, strange=strange: device.write(at.PAGE, strange))
    for wrong in ([], [1, 2], table.page(0)[:-1], [*split(table.header.id), 0]):
        refused(Refusal.VALUE, Result.PAGE_LENGTH, device, lambda device, wrong=wrong: device.write(at.PAGE, wrong))


@pytest.mark.parametrize("address", [0, 16, 32, 54, 64, 97, 129, 4096, 64095, 65535])
def test_what_is_not_for_writing_is_not_written(address):
    device = offset_device()
    load(device, random_table(1))
    before = device.read(at.IDENTITY, 8), device.read(at.ACTIVE, 11), device.read(at.TABLE, 270)
    with pytest.raises(RefusedWrite) as caught:
        device.write(address, [1])
    assert caught.value.code == Refusal.ADDRESS
    assert before == (device.read(at.IDENTITY, 8), device.read(at.ACTIVE, 11), device.read(at.TABLE, 270))


def test_one_writer_at_a_time_until_it_has_been_silent_for_long():
    clock = Clock()
    device, table, other = offset_device(clock=clock, lease_s=LEASE_S), random_table(1), random_table(2)
    begin(device, table)
    clock.now += 0.9 * LEASE_S
    refused(Refusal.BUSY, Result.OTHER_WRITER, device, begin, other)
    page(device, table, 0)
    clock.now += 0.9 * LEASE_S
    refused(Refusal.BUSY, Result.OTHER_WRITER, device, begin, other)
    clock.now += 0.2 * LEASE_S
    begin(device, other)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, page, table, 1)
    load(device, other)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, commit, table)


def test_no_commit_under_a_running_robot_unless_it_is_dead():
    clock = Clock()
    device, old, new = offset_device(clock=clock, lease_s=100), random_table(1), random_table(2)
    load(device, old)
    device.write(at.ROBOT, [7, Robot.RUNNING, 0, *split(old.header.id)])
    begin(device, new)
    for number in range(3):
        page(device, new, number)
    refused(Refusal.BUSY, Result.ROBOT_RUNNING, device, commit, new)
    clock.now += 0.9 * ROBOT_STALE_S
    device.write(at.ROBOT, [8])
    clock.now += 0.9 * ROBOT_STALE_S
    refused(Refusal.BUSY, Result.ROBOT_RUNNING, device, commit, new)
    clock.now += 0.2 * ROBOT_STALE_S
    commit(device, new)
    assert device.read(at.ACTIVE, 2) == list(split(new.header.id))


def test_a_window_is_finished_by_a_robot_that_runs_with_its_table():
    device, old, new = offset_device(), random_table(1), random_table(2)
    load(device, new)
    window = new.header.window
    for table, finished in ((old, 0), (new, window)):
        device.write(at.ROBOT, [7, Robot.RUNNING, 0, *split(table.header.id)])
        device.write(at.ROBOT, [8, Robot.WINDOW_DONE, 0, *split(table.header.id), window])
        assert device.read(23, 1) == [finished]


def test_the_registers_of_the_map_are_there_and_hold_what_it_says():
    """What the page of the map tells a PLC's programmer, read at its addresses."""
    device, table = offset_device(), random_table(1)
    load(device, table)
    place = {one.name: (one.address, one.count) for one in at.MAP if one.name != "heartbeat"}
    expected = {"magic": [0x4353, 0x4D42], "map version": [1], "page rows": [40], "window rows": [20000], "commits": [1],
                "state": [0], "last result": [0], "id in transfer": [0, 0], "next page": [0],
                "id": list(split(table.header.id)), "count": [table.header.rows], "row": [0],
                "window, windows": [table.header.window, table.header.windows],
                "robot state": [0], "window finished": [0], "robot heartbeat": [0], "row asked": [0], "window done": [0]}
    assert {name: device.read(*place[name]) for name in expected} == expected
    spans = sorted((one.address, one.address + one.count) for one in at.MAP)
    assert all(end <= begin for (_, end), (begin, _) in pairwise(spans))


def test_the_robot_gets_the_row_it_asks_for_and_a_sum_to_check():
    device, table = offset_device(), random_table(1)
    assert device.read(at.ANSWER + 5, 3) == [0, 0, 0]
    load(device, table)
    for row in (0, 57, 89):
        device.write(at.ROBOT + 2, [row])
        answer = device.read(at.ANSWER, at.ANSWER_REGISTERS)
        assert answer[4:8] == [row, *table.registers[row].tolist()]
        assert answer[8] == (row + int(table.registers[row].astype(int).sum())) % 65536
        assert answer[:3] == [*split(table.header.id), 90]
    device.write(at.ROBOT + 2, [90])
    assert device.read(at.ANSWER + 4, 4) == [90, 0, 0, 0]


def test_zero_offsets_are_a_table_too():
    registers = to_registers(np.zeros((41, 3), int))
    table = OffsetTable.of(registers, 0, 41, 1, 1)
    device = offset_device()
    load(device, table)
    assert device.read(at.TABLE, 123) == [32768] * 123


def test_a_page_that_comes_again_with_other_rows_ends_the_transfer():
    """Two writers with one header would mix their rows; the first must begin anew."""
    device, table, other = offset_device(), random_table(1), random_table(2)
    begin(device, table)
    page(device, table, 0)
    changed = [*table.page(0)[:3], *other.page(0)[3:]]
    refused(Refusal.SEQUENCE, Result.PAGE_CHANGED, device, lambda one: one.write(at.PAGE, changed))
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, page, table, 1)
    load(device, table)
    assert device.read(at.TABLE, 270) == table.registers.ravel().tolist()


def test_a_commit_that_was_done_already_leaves_the_cell_free_for_another_writer():
    """The active table begun and committed once more: nothing is under way then, whatever the lease."""
    device, table, other = offset_device(lease_s=60.0), random_table(1), random_table(2)
    load(device, table)
    begin(device, table)
    refused(Refusal.BUSY, Result.OTHER_WRITER, device, begin, other)
    commit(device, table)
    begin(device, other)
    assert (device.commits, device.read(at.ACTIVE, HEADER_REGISTERS)) == (1, table.header.registers())


def test_the_heartbeat_counts_up_twice_a_second_and_commits_by_one() -> None:
    """Both modulo 65536, which a PLC compares."""
    clock = Clock()
    device, tables = offset_device(clock=clock), [random_table(1), random_table(2)]
    for now, beats in ((100.0, 200), (100.49, 200), (100.5, 201), (101.0, 202), (32767.5, 65535), (32768.0, 0), (32769.5, 3)):
        clock.now = now
        assert (device.read(22, 1), device.read(67, 1)) == ([beats], [beats])
    device.commits = 65534
    for count, table in ((65535, tables[0]), (0, tables[1]), (1, tables[0])):
        load(device, table)
        assert device.read(21, 1) == [count]


@pytest.mark.parametrize(("runs", "state", "own", "window", "finished"), [
    (True, Robot.WINDOW_DONE, True, 2, 2), (False, Robot.WINDOW_DONE, True, 2, 0), (True, Robot.RUNNING, True, 2, 0),
    (True, Robot.IDLE, True, 2, 0), (True, Robot.WINDOW_DONE, False, 2, 0), (True, Robot.WINDOW_DONE, True, 1, 0),
    (True, Robot.WINDOW_DONE, True, 3, 0)])
def test_a_window_is_finished_where_all_that_the_robot_says_fits(
    runs: bool, state: Robot, own: bool, window: int, finished: int
) -> None:
    """It has run with the table since its commit, is done, and names this table and this window."""
    table, other = random_table(1, window=2, windows=3, total=300), random_table(2)
    device = offset_device()
    load(device, table)
    if runs:
        device.write(at.ROBOT, [7, Robot.RUNNING, 0, *split(table.header.id)])
    device.write(at.ROBOT, [8, state, 0, *split((table if own else other).header.id), window])
    assert device.read(at.FINISHED, 1) == [finished]
    # A restart cannot know whether it ran, and believes what the robot says now.
    device.ran = True
    assert device.read(at.FINISHED, 1) == [2 if (state, own, window) == (Robot.WINDOW_DONE, True, 2) else 0]
    device.write(at.ROBOT + 1, [Robot.WINDOW_DONE])
    load(device, other)
    assert device.read(at.FINISHED, 1) == [0]


@pytest.mark.parametrize("again", ["begin", "page", "commit"])
def test_who_asks_again_keeps_the_cell(again: str) -> None:
    """Also a commit that waits for the robot; who is silent for the lease loses it to another."""
    clock = Clock()
    device, old, table, other = offset_device(clock=clock, lease_s=5.0), random_table(3), random_table(1), random_table(2)
    load(device, old)
    begin(device, table)
    for number in range(3):
        page(device, table, number)
    clock.now += 4.0
    device.write(at.ROBOT, [int(clock.now) & 0xFFFF, Robot.RUNNING, 0, *split(old.header.id)])
    if again == "begin":
        begin(device, table)
    elif again == "page":
        page(device, table, 1)
    else:
        refused(Refusal.BUSY, Result.ROBOT_RUNNING, device, commit, table)
    clock.now += 4.9
    refused(Refusal.BUSY, Result.OTHER_WRITER, device, begin, other)
    clock.now += 0.1
    begin(device, other)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, device, commit, table)


@pytest.mark.parametrize(("address", "count", "there"), [
    (at.ROBOT, 6, True), (at.ROBOT + 5, 1, True), (at.ROBOT, 7, False), (at.ROBOT + 5, 2, False), (at.ROBOT - 1, 2, False)])
def test_the_robot_writes_its_own_registers_alone(address: int, count: int, there: bool) -> None:
    device = offset_device()
    before = device.read(at.ROBOT, 6)
    values = list(range(1, count + 1))
    if there:
        device.write(address, values)
        assert device.read(address, count) == values
    else:
        refused(Refusal.ADDRESS, Result.NONE, device, lambda device: device.write(address, values))
        assert device.read(at.ROBOT, 6) == before


def test_a_robot_whose_heartbeat_never_changed_is_not_running() -> None:
    """Registers that say so are left from before."""
    device, table = offset_device(), random_table(1)
    device.write(at.ROBOT + 1, [Robot.RUNNING])
    load(device, table)
    assert device.active is not None
    device.write(at.ROBOT, [1])
    with pytest.raises(RefusedWrite, match="ROBOT_RUNNING"):
        load(device, random_table(2))
