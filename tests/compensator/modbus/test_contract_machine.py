"""The cell's rules, without a network: sequence, CRC, limit, one writer, the robot's hand on the table."""

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.machine import LEASE_S, ROBOT_STALE_S, RefusedWrite
from compensator.modbus.push import Table
from compensator.modbus.registers import Command, Refusal, Result, Robot
from compensator.modbus.wire import HEADER_WORDS, Header, page_words, split, to_words
from tests.compensator.modbus.tables_and_cells import load, machine, table


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def begin(cell, one: Table) -> None:
    cell.write(at.COMMAND, [Command.BEGIN, *one.header.words()])


def page(cell, one: Table, number: int) -> None:
    cell.write(at.PAGE, page_words(one.header, one.words, number))


def commit(cell, one: Table) -> None:
    cell.write(at.COMMAND, [Command.COMMIT, *one.header.words()])


def refused(code: Refusal, result: Result, cell, call, *arguments) -> None:
    before = cell.read(at.ACTIVE, HEADER_WORDS)
    with pytest.raises(RefusedWrite) as caught:
        call(cell, *arguments)
    assert (caught.value.code, cell.read(at.RESULT, 1)) == (code, [result])
    assert cell.read(at.ACTIVE, HEADER_WORDS) == before


def test_a_transfer_shows_only_after_its_commit():
    cell, one = machine(), table(1)
    assert cell.read(at.ACTIVE, HEADER_WORDS) == [0] * HEADER_WORDS
    begin(cell, one)
    for number in range(3):
        page(cell, one, number)
        assert cell.read(at.ACTIVE, 1) == [0]
        assert cell.read(at.STATUS, 5) == [1, 0, *split(one.header.id), number + 1]
    commit(cell, one)
    assert cell.read(at.ACTIVE, HEADER_WORDS) == one.header.words()
    assert cell.read(at.TABLE, 270) == one.words.ravel().tolist()
    with pytest.raises(RefusedWrite):
        cell.read(at.TABLE, 271)


def test_every_step_may_be_repeated():
    cell, one = machine(), table(1)
    for number in range(3):
        begin(cell, one)
        begin(cell, one)
        page(cell, one, number)
        page(cell, one, number)
        page(cell, one, 0)
    for _ in range(3):
        commit(cell, one)
    assert (cell.read(at.ACTIVE, HEADER_WORDS), cell.commits) == (one.header.words(), 1)


def test_out_of_sequence_is_refused():
    cell, one = machine(), table(1)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, page, one, 0)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, commit, one)
    begin(cell, one)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, page, one, 1)
    page(cell, one, 0)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, commit, one)
    cell.write(at.COMMAND, [Command.ABORT, *one.header.words()])
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, page, one, 1)


def test_a_wrong_crc_is_refused_and_the_transfer_dropped():
    one = table(1)
    wrong = Table(Header(**{**one.header.as_dict(), "crc": one.header.crc ^ 1}), one.words)
    cell = machine()
    load(cell, table(2))
    begin(cell, wrong)
    for number in range(3):
        page(cell, wrong, number)
    refused(Refusal.SEQUENCE, Result.CRC, cell, commit, wrong)
    assert cell.read(at.STATUS, 1) == [0]


@pytest.mark.parametrize(("um", "result"), [(2500, Result.OFFSET), (-2500, Result.OFFSET), (32767, Result.OFFSET),
                                            (-32768, Result.OFFSET)])
def test_the_cell_refuses_an_offset_over_its_limit_by_itself(um, result):
    words = np.full((5, 3), 32768, np.uint16)
    words[3, 2] = 32768 + um
    one = Table(Header.of(words, 0, 5, 1, 1), words)
    cell = machine()
    begin(cell, one)
    page(cell, one, 0)
    refused(Refusal.VALUE, result, cell, commit, one)
    assert cell.read(at.STATUS, 1) == [0]


def test_headers_and_pages_that_make_no_sense_are_refused():
    cell, one = machine(window_rows=100), table(1)
    for change in ({"id": 0}, {"rows": 0}, {"rows": 101, "total": 101}, {"first": 1}, {"window": 0}, {"window": 2}):
        header = Header(**{**one.header.as_dict(), **change})
        refused(Refusal.VALUE, Result.HEADER, cell, begin, Table(header, one.words))
    refused(Refusal.VALUE, Result.HEADER, cell, lambda cell: cell.write(at.COMMAND, [9, *one.header.words()]))
    refused(Refusal.VALUE, Result.HEADER, cell, lambda cell: cell.write(at.COMMAND, [1]))
    begin(cell, one)
    for wrong in ([], [1, 2], page_words(one.header, one.words, 0)[:-1], [*split(one.header.id), 0]):
        refused(Refusal.VALUE, Result.PAGE_LENGTH, cell, lambda cell, wrong=wrong: cell.write(at.PAGE, wrong))


@pytest.mark.parametrize("address", [0, 16, 32, 54, 64, 97, 129, 4096, 64095, 65535])
def test_what_is_not_for_writing_is_not_written(address):
    cell = machine()
    load(cell, table(1))
    before = cell.read(at.IDENTITY, 8), cell.read(at.ACTIVE, 11), cell.read(at.TABLE, 270)
    with pytest.raises(RefusedWrite) as caught:
        cell.write(address, [1])
    assert caught.value.code == Refusal.ADDRESS
    assert before == (cell.read(at.IDENTITY, 8), cell.read(at.ACTIVE, 11), cell.read(at.TABLE, 270))


def test_one_writer_at_a_time_until_it_has_been_silent_for_long():
    clock = Clock()
    cell, one, other = machine(clock=clock, lease_s=LEASE_S), table(1), table(2)
    begin(cell, one)
    clock.now += 0.9 * LEASE_S
    refused(Refusal.BUSY, Result.OTHER_WRITER, cell, begin, other)
    page(cell, one, 0)
    clock.now += 0.9 * LEASE_S
    refused(Refusal.BUSY, Result.OTHER_WRITER, cell, begin, other)
    clock.now += 0.2 * LEASE_S
    begin(cell, other)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, page, one, 1)
    load(cell, other)
    refused(Refusal.SEQUENCE, Result.SEQUENCE, cell, commit, one)


def test_no_commit_under_a_running_robot_unless_it_is_dead():
    clock = Clock()
    cell, old, new = machine(clock=clock, lease_s=100), table(1), table(2)
    load(cell, old)
    cell.write(at.ROBOT, [7, Robot.RUNNING, 0, *split(old.header.id)])
    begin(cell, new)
    for number in range(3):
        page(cell, new, number)
    refused(Refusal.BUSY, Result.ROBOT_RUNNING, cell, commit, new)
    clock.now += 0.9 * ROBOT_STALE_S
    cell.write(at.ROBOT, [8])
    clock.now += 0.9 * ROBOT_STALE_S
    refused(Refusal.BUSY, Result.ROBOT_RUNNING, cell, commit, new)
    clock.now += 0.2 * ROBOT_STALE_S
    commit(cell, new)
    assert cell.read(at.ACTIVE, 2) == list(split(new.header.id))


def test_the_robot_gets_the_row_it_asks_for_and_a_sum_to_check():
    cell, one = machine(), table(1)
    assert cell.read(at.ANSWER + 5, 3) == [0, 0, 0]
    load(cell, one)
    for row in (0, 57, 89):
        cell.write(at.ROBOT + 2, [row])
        answer = cell.read(at.ANSWER, at.ANSWER_WORDS)
        assert answer[4:8] == [row, *one.words[row].tolist()]
        assert answer[8] == (row + int(one.words[row].astype(int).sum())) % 65536
        assert answer[:3] == [*split(one.header.id), 90]
    cell.write(at.ROBOT + 2, [90])
    assert cell.read(at.ANSWER + 4, 4) == [90, 0, 0, 0]


def test_zero_offsets_are_a_table_too():
    words = to_words(np.zeros((41, 3), int))
    one = Table(Header.of(words, 0, 41, 1, 1), words)
    cell = machine()
    load(cell, one)
    assert cell.read(at.TABLE, 123) == [32768] * 123
