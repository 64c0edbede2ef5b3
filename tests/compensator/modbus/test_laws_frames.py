"""Frames at and beyond their bounds: the device's table stays, and a client takes no register that it did not ask for.

The long form is benchmarks/fuzz_frames.py.
"""

from __future__ import annotations

import numpy as np
import pytest

from compensator.modbus import registers as at
from compensator.modbus.device import OffsetDevice, RefusedWrite
from compensator.modbus.link import Address, Link, LinkLost
from compensator.modbus.registers import Command
from compensator.modbus.server import Loopback
from compensator.modbus.wire import ZERO, OffsetTable, to_registers
from tests.compensator.modbus import frames
from tests.compensator.modbus import tables_and_devices as kit


def asking(port: int) -> Link:
    return Link(Address("127.0.0.1", port, 1, frames.LATE_S, 0))


def test_no_frame_changes_the_table_and_each_reply_is_one() -> None:
    assert frames.to_a_device(3, 250) == []


def test_a_client_takes_the_registers_it_asked_for_or_says_why_not() -> None:
    assert frames.to_a_client(3, 60) == []


@pytest.mark.parametrize(("function", "code"), [(3, 3), (4, 3), (16, 3), (6, 2), (5, 1), (22, 1), (63, 1), (100, 1)])
def test_an_exception_names_the_function_that_was_asked(function: int, code: int) -> None:
    """A count of nothing is an illegal value, an address outside the map an illegal one, another function illegal itself."""
    pdu = {6: b"\x06\0\0\0\1", 16: b"\x10\0\x80\0\0\0"}.get(function, bytes([function, 0, 0, 0, 0]))
    pdu += b"\0\0" * (function == 22)
    with Loopback(kit.offset_device()) as server:
        reply = frames.exchanged(server.port, frames.adu(pdu, 77), frames.LATE_S)
    assert reply[:8] == frames.adu(bytes([function | 0x80, 0]), 77)[:8]
    # What pymodbus cannot read at all it calls an illegal function.
    assert reply[8] in (code, 1)


@pytest.mark.parametrize("function", [1, 2, 4, 6, 16, 23])
def test_registers_of_another_function_are_not_what_was_asked(function: int) -> None:
    def answer(sent: bytes) -> bytes:
        return frames.adu(bytes([function, 2, 0, 77]) + b"\0" * (function in (6, 16)), int.from_bytes(sent[:2], "big"))

    with frames.answering(answer) as port, asking(port) as link, pytest.raises(LinkLost):
        link.read(0, 1)


def test_an_acknowledgement_of_another_function_or_place_is_none() -> None:
    for echo in (b"\x0f\0\x60\0\2", b"\x10\0\x61\0\2", b"\x10\0\x60\0\1"):
        def answer(sent: bytes, echo: bytes = echo) -> bytes:
            return frames.adu(echo, int.from_bytes(sent[:2], "big"))

        with frames.answering(answer) as port, asking(port) as link, pytest.raises(LinkLost):
            link.write(96, [1, 2])


def test_any_sequence_of_writes_leaves_the_last_table_that_was_committed_whole() -> None:
    """Against what docs/modbus.md promises, kept beside the device: a commit is taken only of the pages as they came, all of
    them, in order, of one id, with no offset beyond the limit."""
    rng = np.random.default_rng(5)
    device = OffsetDevice(kit.offset_device().store, 1000, kit.ROBOT, clock=lambda: 0.0, lease_s=0.0)
    active: np.ndarray | None = None
    commits = 0
    for _ in range(400):
        rows = int(rng.choice([1, 39, 40, 41, 80, 81]))
        um = rng.integers(-500, 501, (rows, 3)) * (1 if rng.random() < 0.7 else 3)
        table = OffsetTable.of(to_registers(um), 0, rows)
        good = bool((np.linalg.norm(um, axis=1) <= 1001).all())
        steps = [(at.COMMAND, [Command.BEGIN, *table.header.registers()]),
                 *((at.PAGE, table.page(page)) for page in range(-(-rows // 40))),
                 (at.COMMAND, [Command.COMMIT, *table.header.registers()])]
        if rng.random() < 0.5:
            place = int(rng.integers(len(steps)))
            spoilt = list(steps[place][1])
            kind = int(rng.integers(4))
            if kind == 0 and place not in (0,):
                del steps[place]
                good &= False
            elif kind == 1:
                steps.insert(place, steps[place])       # repeated: the same table
            elif kind == 2:
                spoilt[int(rng.integers(len(spoilt)))] ^= 1 << int(rng.integers(16))
                steps[place] = (steps[place][0], spoilt)
                good = False
            else:
                steps[place] = (steps[place][0], spoilt[:int(rng.integers(len(spoilt)))])
                good = False
        for address, values in steps:
            try:
                device.write(address, [int(value) for value in values])
            except RefusedWrite:
                continue
        now = None if device.active is None else device.active.registers.astype(int) - ZERO
        if good:
            active, commits = um, commits + 1
        assert (now is None) == (active is None)
        if active is not None and now is not None:
            assert np.array_equal(now, active), (rows, good)
            assert device.read(at.TABLE, min(3 * len(active), 120)) == (active + ZERO).ravel().tolist()[:120]
    assert commits > 100


def test_every_read_is_of_registers_or_refused() -> None:
    device = kit.offset_device()
    kit.load(device, kit.random_table(1))
    for address in [*range(160), *range(4090, 4100), 4096 + 3 * kit.ROWS - 1, 4096 + 3 * kit.ROWS, 65535]:
        for count in (1, 2, 11, 16, 125):
            try:
                values = device.read(address, count)
            except RefusedWrite:
                continue
            assert len(values) == count
            assert all(0 <= value <= 65535 for value in values)


@pytest.mark.parametrize("address", [0, 47, 48, 53, 54, 96, 128, 4096, 65535])
def test_a_write_of_nothing_is_refused(address: int) -> None:
    device = kit.offset_device()
    before = list(device.robot)
    with pytest.raises(RefusedWrite):
        device.write(address, [])
    assert device.robot == before
