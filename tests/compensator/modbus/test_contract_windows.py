"""A program in several windows, walked through with a robot that reads its offsets row by row."""

import threading
import time

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.link import Address, Link
from compensator.modbus.offset_file import Offsets, check_offsets, tables_of
from compensator.modbus.registers import Robot
from compensator.modbus.server import Loopback
from compensator.modbus.windows import push_windows
from compensator.modbus.wire import split
from identification.common.findings import Refused, Unconfirmed
from tests.compensator.modbus import tables_and_devices as kit

ROWS, WINDOW = 250, 100


def program(seed: int = 5) -> Offsets:
    um = np.random.default_rng(seed).integers(-1000, 1001, (ROWS, 3))
    return Offsets("offsets.csv", 0, 1e-6 * um, np.zeros(ROWS), np.arange(ROWS), ())


class SimulatedRobot(threading.Thread):
    """Works through the windows by the rules of docs/modbus.md: waits for the table, reads every row, says it is done."""

    def __init__(self, port: int, expected: list[list[int]]) -> None:
        super().__init__(daemon=True)
        self.port, self.expected = port, expected
        self.offsets: list[list[int]] = []

    def run(self) -> None:
        with Link(Address("127.0.0.1", self.port, 1, 5.0)) as link:
            for number, identity in enumerate(self.expected, 1):
                answer, until = link.read(at.ANSWER, at.ANSWER_REGISTERS), time.monotonic() + 60
                while [*answer[:2], answer[9]] != [*identity, number]:
                    assert time.monotonic() < until, f"window {number} never came"
                    time.sleep(0.01)
                    answer = link.read(at.ANSWER, at.ANSWER_REGISTERS)
                link.write(at.ROBOT + 3, identity)
                link.write(at.ROBOT + 1, [Robot.RUNNING])
                for row in range(answer[2]):
                    link.write(at.ROBOT, [row % 7])
                    link.write(at.ROBOT + 2, [row])
                    seen = link.read(at.ANSWER, at.ANSWER_REGISTERS)
                    assert seen[:2] == identity
                    assert seen[4] == row
                    assert seen[8] == sum(seen[4:8]) % 65536
                    self.offsets.append([word - 32768 for word in seen[5:8]])
                link.write(at.ROBOT + 5, [number])
                link.write(at.ROBOT + 1, [Robot.WINDOW_DONE])


def walk(port: int, tables, *, robot_s: float = 5.0, restart: bool = False) -> list[str]:
    with Link(Address("127.0.0.1", port, 1, 5.0)) as link:
        return push_windows(link, tables, patience_s=2.0, robot_s=robot_s, restart=restart, progress=lambda page, pages: None,
                            say=lambda text: None)


def test_one_window_is_the_simple_case():
    tables = tables_of(program(), at.WINDOW_ROWS)
    assert [(table.header.rows, table.header.window, table.header.windows) for table in tables] == [(ROWS, 1, 1)]


def test_the_robot_gets_every_offset_of_all_windows_in_order():
    offsets = program()
    tables = tables_of(offsets, WINDOW)
    cut = [(table.header.first, table.header.rows, table.header.window) for table in tables]
    assert cut == [(0, 100, 1), (100, 100, 2), (200, 50, 3)]
    device = kit.offset_device(window_rows=WINDOW)
    with Loopback(device) as server:
        robot = SimulatedRobot(server.port, [list(split(table.header.id)) for table in tables])
        robot.start()
        assert walk(server.port, tables) == ["committed"] * 3
        robot.join(60)
        assert not robot.is_alive()
    assert robot.offsets == offsets.micrometres.tolist()


def test_a_robot_that_gives_no_sign_stops_the_walk_and_a_second_push_goes_on():
    tables = tables_of(program(), WINDOW)
    device = kit.offset_device(window_rows=WINDOW)
    with Loopback(device) as server:
        with pytest.raises(Unconfirmed, match=r"CS5016.*no sign of the robot.*window 1 of 3 is active"):
            walk(server.port, tables, robot_s=0.3)
        assert device.active.header == tables[0].header
        for number in (1, 2):
            identity = split(tables[number - 1].header.id)
            # Done, but left over from an earlier run: it has not run since the commit.
            device.write(at.ROBOT, [number, Robot.WINDOW_DONE, 0, *identity, number])
            with pytest.raises(Unconfirmed, match=f"window {number} of 3 is active"):
                walk(server.port, tables, robot_s=0.3)
            device.write(at.ROBOT, [number, Robot.RUNNING, 0, *identity])
            device.write(at.ROBOT, [number, Robot.WINDOW_DONE, 0, *identity, number])
            with pytest.raises(Unconfirmed) if number == 1 else _nothing():
                assert walk(server.port, tables, robot_s=0.3)[-1] == "committed"
            assert device.active.header == tables[number].header
        assert walk(server.port, tables[:1], restart=True) == ["committed"]


def test_windows_of_equal_rows_are_told_apart():
    """All offsets zero: the windows differ only by their place in the program."""
    zero = Offsets("offsets.csv", 0, np.zeros((200, 3)), np.zeros(200), np.arange(200), ())
    ids = {table.header.id for table in tables_of(zero, WINDOW)}
    assert len(ids) == 2


class _nothing:
    def __enter__(self) -> None: ...
    def __exit__(self, *_: object) -> None: ...


@pytest.mark.parametrize("metres", [0.03277, -4e3, 1e16, -1e40])
def test_what_no_register_holds_is_refused_however_large(metres: float):
    """Beyond the integers too, where a cast makes any number of it; whatever limit the cell states."""
    offset = np.zeros((3, 3))
    offset[1, 2] = metres
    with pytest.raises(Refused) as stopped:
        check_offsets(Offsets("offsets.csv", 5, offset, np.full(3, np.nan), np.arange(2, 5), ()), np.inf)
    assert [(finding.code, finding.target) for finding in stopped.value.findings] == [("CS5004", 6)]


@pytest.mark.parametrize("rows", [65_535, 65_536])
def test_a_program_has_as_many_windows_as_a_register_counts(rows: int):
    """Of a device that takes one row at a time."""
    offsets = Offsets("offsets.csv", 0, np.zeros((rows, 3)), np.full(rows, np.nan), np.arange(rows), ())
    if rows == 65_535:
        tables = tables_of(offsets, 1)
        assert (len(tables), tables[-1].header.window, tables[-1].header.windows) == (rows, rows, rows)
        return
    with pytest.raises(Refused) as stopped:
        tables_of(offsets, 1)
    assert [(one.code, one.message) for one in stopped.value.findings] == [
        ("CS5004", "65536 windows of 1 rows: more than a register counts")]
