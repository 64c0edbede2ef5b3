"""The register map, version 1: the one place where an address stands. docs/modbus.md prints it, a test compares the two."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from compensator.modbus.wire import HEADER_REGISTERS, PAGE_ROWS

MAGIC = (0x4353, 0x4D42)            # "CSMB"
MAP_VERSION = 1

IDENTITY, STATUS, ACTIVE, ROBOT, ANSWER, COMMAND, PAGE, TABLE = 0, 16, 32, 48, 64, 96, 128, 4096
RESULT, FINISHED = STATUS + 1, STATUS + 7
IDENTITY_REGISTERS, ROBOT_REGISTERS, ANSWER_REGISTERS = 8, 6, 11
COMMAND_REGISTERS = 1 + HEADER_REGISTERS
PAGE_REGISTERS = 3 + 3 * PAGE_ROWS
# A table must be readable at 65 536 addresses, three a row, above the other registers: 20 480 rows at most, of which
# 20 000 are used. It is also above what a RAPID module of one program part holds (2 500 to 5 000 moves).
WINDOW_ROWS = 20_000
LAST_ADDRESS = TABLE + 3 * WINDOW_ROWS - 1


class Command(IntEnum):
    """First register of a command."""

    BEGIN = 1
    COMMIT = 2
    ABORT = 3


class State(IntEnum):
    """Of a transfer."""

    IDLE = 0
    RECEIVING = 1


class Robot(IntEnum):
    """What the robot says of itself."""

    IDLE = 0
    RUNNING = 1
    WINDOW_DONE = 2


class Result(IntEnum):
    """Why the device refused last; docs/modbus.md."""

    NONE = 0
    HEADER = 1
    SEQUENCE = 2
    PAGE_LENGTH = 3
    OFFSET = 4
    CRC = 5
    STORAGE = 6
    OTHER_WRITER = 7
    ROBOT_RUNNING = 8
    PAGE_CHANGED = 9


class Refusal(IntEnum):
    """Modbus exception codes as this map uses them."""

    FUNCTION = 1
    ADDRESS = 2
    VALUE = 3
    FAILURE = 4
    BUSY = 6
    SEQUENCE = 7


@dataclass(frozen=True)
class Register:
    """One entry of the map: `count` registers from `address`; access "r" or "rw" or "w"."""

    address: int
    count: int
    access: str
    name: str
    meaning: str


MAP = (
    Register(0, 2, "r", "magic", "0x4353 0x4D42, \"CSMB\": this is a compstiff cell"),
    Register(2, 1, "r", "map version", "1; a client refuses another"),
    Register(3, 1, "r", "page rows", "rows of a full page: 40"),
    Register(4, 1, "r", "window rows", "most rows of one table: 20 000 in the embedded cell, a PLC may state fewer"),
    Register(5, 1, "r", "limit", "longest offset the cell accepts [um], its limits.max_offset_mm"),
    Register(6, 2, "r", "robot", "CRC-32 of the robot's name in cell.yaml (UTF-8): a client refuses another robot"),
    Register(16, 1, "r", "state", "0 idle, 1 receiving"),
    Register(17, 1, "r", "last result", "why a write was refused last, 0 none (below)"),
    Register(18, 2, "r", "id in transfer", "0 where none is received"),
    Register(20, 1, "r", "next page", "the page that is expected"),
    Register(21, 1, "r", "commits", "commits since the start, modulo 65536"),
    Register(22, 1, "r", "heartbeat", "counts up twice a second"),
    Register(23, 1, "r", "window finished", "the active window once the robot has run it since its commit and is done, else 0"),
    Register(32, 11, "r", "active table", "header of the active table, all 0 where there is none"),
    Register(48, 1, "rw", "robot heartbeat", "the robot changes it at least every second"),
    Register(49, 1, "rw", "robot state", "0 idle, 1 running with the active table, 2 window done"),
    Register(50, 1, "rw", "row asked", "the row the robot wants, from 0"),
    Register(51, 2, "rw", "robot's id", "the table the robot runs with"),
    Register(53, 1, "rw", "window done", "the window of that table which the robot has finished"),
    Register(64, 2, "r", "id", "of the active table"),
    Register(66, 1, "r", "count", "its rows"),
    Register(67, 1, "r", "heartbeat", "as register 22"),
    Register(68, 1, "r", "row", "the row asked, echoed"),
    Register(69, 3, "r", "offset x y z", "of that row, offset-binary micrometres; 0 where there is no such row"),
    Register(72, 1, "r", "check", "(row + x + y + z) modulo 65536: a reader sees a torn update"),
    Register(73, 2, "r", "window, windows", "of the active table"),
    Register(96, COMMAND_REGISTERS, "w", "command", "1 begin, 2 commit, 3 abort, then the header; in one write"),
    Register(128, PAGE_REGISTERS, "w", "page", "id (2), page number from 0, up to 40 rows of x y z; in one write"),
    Register(4096, 3 * WINDOW_ROWS, "r", "table", "the active table's offsets x y z, row after row; none beyond its rows"),
)
