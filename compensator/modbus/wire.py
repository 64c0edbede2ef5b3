"""What stands in a register: offset-binary micrometres, pages of rows, the header of a transfer, its CRC-32.

An offset of `um` micrometres is the register value 32768 + um, because ABB group inputs are unsigned. The values 0 (an
unconnected or cleared input) and 65535 (all bits set, a failed one) are never an offset: both ends refuse them, so an offset
component lies within +-32766 um. The RAPID receiver is rendered from the same constants.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import asdict, astuple, dataclass

import numpy as np
from numpy.typing import NDArray

Registers = NDArray[np.uint16]
Micrometres = NDArray[np.int64]

ZERO = 32768
UM_PER_MM = 1000
LARGEST_UM = 32766
NO_OFFSET = (0, 65535)
# 3 registers of id and page number and 40 rows of 3: 123, the most that one Modbus write holds.
PAGE_ROWS = 40
# Rounding three components to a micrometre lengthens an offset by at most sqrt(3)/2 um.
ROUNDING_UM = 1


def to_registers(offset_um: Micrometres) -> Registers:
    """Offsets (N, 3) [um] as registers (N, 3). Raises ValueError where one does not fit."""
    if offset_um.size and np.abs(offset_um).max() > LARGEST_UM:
        raise ValueError(f"an offset of {np.abs(offset_um).max()} um does not fit into 16 bits (+-{LARGEST_UM} um)")
    return (offset_um + ZERO).astype(np.uint16)


def to_micrometres(registers: Registers) -> Micrometres:
    """Registers (N, 3) as offsets (N, 3) [um]."""
    return registers.astype(np.int64) - ZERO


def from_bytes(content: bytes) -> Registers:
    """The bytes on the wire as registers (N, 3)."""
    return np.frombuffer(content, ">u2").astype(np.uint16).reshape(-1, 3)


def acceptable(registers: Registers, limit_um: int) -> bool:
    """Whether every row is an offset, and none longer than the limit (its rounding to a micrometre allowed)."""
    if registers.min() == NO_OFFSET[0] or registers.max() == NO_OFFSET[1]:
        return False
    offset = registers.astype(np.int64) - ZERO
    return bool(np.einsum("ij,ij->i", offset, offset).max() <= (limit_um + ROUNDING_UM) ** 2)


def crc32(registers: Registers) -> int:
    """CRC-32 (ISO 3309, as in zlib) of the rows' bytes, high byte first, row after row."""
    return zlib.crc32(registers.astype(">u2").tobytes())


@dataclass(frozen=True)
class Header:
    """What names a table: `rows` offsets with CRC-32 `crc`, for targets `first` ... of `total`; window `window` of `windows`.

    id: 32 bits made from all of that, never 0. The same rows of the same program have the same id whenever and by whomever
    they are pushed, which is why a push may be repeated.
    """

    id: int
    rows: int
    crc: int
    first: int
    total: int
    window: int
    windows: int

    @classmethod
    def of(cls, registers: Registers, first: int, total: int, window: int, windows: int) -> Header:
        """The header of a table (N, 3)."""
        crc = crc32(registers)
        text = f"compstiff table 1,{len(registers)},{first},{total},{window},{windows},".encode()
        digest = hashlib.sha256(text + registers.astype(">u2").tobytes()).digest()
        return cls(int.from_bytes(digest[:4], "big") or 1, len(registers), crc, first, total, window, windows)

    @classmethod
    def from_registers(cls, registers: list[int]) -> Header:
        """From its 11 registers."""
        return cls(joined(registers[0:2]), registers[2], joined(registers[3:5]), joined(registers[5:7]), joined(registers[7:9]),
                   *registers[9:11])

    def registers(self) -> list[int]:
        """Its 11 registers, high word first."""
        return [*split(self.id), self.rows, *split(self.crc), *split(self.first), *split(self.total), self.window, self.windows]

    @property
    def pages(self) -> int:
        """How many pages the rows take."""
        return -(-self.rows // PAGE_ROWS)

    def page_rows(self, page: int) -> int:
        """How many rows the page holds: all but the last are full."""
        return min(PAGE_ROWS, self.rows - page * PAGE_ROWS)

    @property
    def name(self) -> str:
        """The id as it is printed."""
        return f"{self.id:08x}"

    def as_dict(self) -> dict[str, int]:
        """JSON values."""
        return asdict(self)

    def __bool__(self) -> bool:
        return any(astuple(self))


HEADER_REGISTERS = 11
EMPTY = Header(0, 0, 0, 0, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class OffsetTable:
    """Offsets that are active together: their header, and what stands in the registers (rows, 3)."""

    header: Header
    registers: Registers

    @classmethod
    def of(cls, registers: Registers, first: int, total: int, window: int = 1, windows: int = 1) -> OffsetTable:
        """The table with its header."""
        return cls(Header.of(registers, first, total, window, windows), registers)

    def page(self, number: int) -> list[int]:
        """One page as it is written: id, page number from 0, its rows."""
        rows = self.registers[number * PAGE_ROWS:(number + 1) * PAGE_ROWS]
        return [*split(self.header.id), number, *rows.ravel().tolist()]


def split(value: int) -> tuple[int, int]:
    """32 bits as two registers, high word first."""
    return value >> 16, value & 0xFFFF


def joined(registers: list[int]) -> int:
    """The 32 bits of two registers, high word first."""
    return registers[0] << 16 | registers[1]
