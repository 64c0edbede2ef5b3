"""Frames that are spoilt in their bounds, to a device and to a client, and what must be true of what comes of them.

What a frame is: "Modbus Application Protocol Specification" V1.1b3, sections 6.3, 6.4, 6.6, 6.12 and 7, and "Modbus Messaging
on TCP/IP Implementation Guide" V1.0b, section 3.1.3. Written from them, without the program's code.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

MOST_READ, MOST_WRITTEN = 125, 123
COUNTS = (0, 1, 2, 3, 6, 8, 11, 12, 40, 122, 123, 124, 125, 126, 127, 128, 255, 256, 32767, 32768, 65535)
ADDRESSES = (0, 7, 8, 16, 23, 24, 32, 48, 53, 54, 64, 74, 75, 96, 107, 128, 250, 4095, 4096, 4365, 4366, 64095, 64096, 65535)
LENGTHS = (0, 1, 2, 3, 253, 254, 255, 256, 258, 1000, 65535)
LATE_S = 20.0           # on a machine with much else to do
# Read exception status, diagnostics, counter, log, identity, FIFO: pymodbus answers them by itself, and no register is in them.
OF_THE_LINE = (7, 8, 11, 12, 17, 24)


@dataclass(frozen=True)
class Spoilt:
    """Bytes for the device. whole: a frame that is sound in itself, for the device's unit; else nothing may come of it but an
    exception reply."""

    data: bytes
    whole: bool


def adu(pdu: bytes, transaction: int = 1, unit: int = 1, length: int | None = None, protocol: int = 0) -> bytes:
    """Header (transaction, protocol, length, unit) and PDU."""
    return struct.pack(">HHHB", transaction, protocol, len(pdu) + 1 if length is None else length, unit) + pdu


def request(rng: np.random.Generator, values: list[int]) -> Spoilt:
    """A request whose function, address, count, byte count, payload or header is at or beyond a bound. values: registers of a
    write that means something."""
    address = int(rng.choice(ADDRESSES)) if rng.random() < 0.7 else int(rng.integers(65536))
    count = int(rng.choice(COUNTS)) if rng.random() < 0.8 else int(rng.integers(65536))
    kind = rng.random()
    if kind < 0.35:
        pdu = struct.pack(">BHH", int(rng.choice([3, 4])), address, count)
        good = 1 <= count <= MOST_READ and address + count <= 65536
    elif kind < 0.45:
        pdu, good = struct.pack(">BHH", 6, address, int(rng.choice([0, 1, 2, 65535]))), True
    elif kind < 0.9:
        payload = np.array(values[:count] if rng.random() < 0.5 else rng.integers(0, 65536, min(count, 127)), ">u2").tobytes()
        if rng.random() < 0.3:
            payload = payload[:int(rng.integers(len(payload) + 1))] + rng.bytes(int(rng.integers(3)))
        said = len(payload) & 0xFF if rng.random() < 0.6 else int(rng.choice([0, 1, 2, 3, 254, 255, 2 * count & 0xFF]))
        pdu = struct.pack(">BHHB", 16, address, count, said) + payload
        good = 1 <= count <= MOST_WRITTEN and said == 2 * count == len(payload) and address + count <= 65536
    else:
        pdu = bytes([int(rng.integers(256))]) + rng.bytes(int(rng.integers(0, 250)))
        good = False
    unit, protocol, length = 1, 0, None
    if rng.random() < 0.2:
        unit, protocol, length = [(int(rng.choice([0, 2, 255])), 0, None), (1, int(rng.choice([1, 65535])), None),
                                  (1, 0, int(rng.choice(LENGTHS)))][int(rng.integers(3))]
        good = False
    return Spoilt(adu(pdu, int(rng.integers(65536)), unit, length, protocol)[:260], good and len(pdu) <= 253)


def wrong_reply(sent: Spoilt, reply: bytes) -> str:
    """What is wrong with a reply to one request as the specification has replies; empty where nothing is."""
    if not reply:
        return "no reply to a sound request" if sent.whole else ""
    if len(reply) < 9:
        return f"a torn reply {reply.hex()}"
    data, function = sent.data, reply[7]
    if reply[:4] != data[:2] + b"\0\0" or int.from_bytes(reply[4:6], "big") != len(reply) - 6 or reply[6] != data[6]:
        return f"a header that is none: {reply[:8].hex()}"
    asked = data[7]
    # Of a function that is none, 0x80 to 0xff, it is the same byte.
    if function == asked | 0x80:
        return "" if len(reply) == 9 and reply[8] in range(1, 12) else f"an exception reply that is none: {reply.hex()}"
    if function != asked:
        return f"function {function}, asked {asked}"
    if function in OF_THE_LINE:
        return ""
    if not sent.whole:
        return f"taken: {data[:20].hex()}"
    if function in (3, 4):
        good = reply[8] == 2 * int.from_bytes(data[10:12], "big") == len(reply) - 9
    else:
        good = reply[8:] == data[8:12]
    return "" if good else f"reply {reply[:20].hex()} to {data[:20].hex()}"


def exchanged(port: int, data: bytes, patience_s: float) -> bytes:
    """What came back on a connection of its own within the time, until the other end is silent for a moment after a reply."""
    with socket.create_connection(("127.0.0.1", port), timeout=LATE_S) as connection:
        connection.sendall(data)
        connection.settimeout(patience_s)
        reply = b""
        with contextlib.suppress(TimeoutError, ConnectionError):
            while chunk := connection.recv(4096):
                reply += chunk
                if len(reply) >= 6 and len(reply) >= 6 + int.from_bytes(reply[4:6], "big"):
                    break
        return reply


@contextlib.contextmanager
def answering(answer: Callable[[bytes], bytes]) -> Iterator[int]:
    """A device that answers a request with bytes of the caller's and closes the connection; its port."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(0.05)
        over = threading.Event()

        def serve() -> None:
            while not over.is_set():
                with contextlib.suppress(TimeoutError, OSError):
                    connection, _ = listening.accept()
                    with connection:
                        connection.settimeout(LATE_S)
                        if data := connection.recv(4096):
                            connection.sendall(answer(data))

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield int(listening.getsockname()[1])
        finally:
            over.set()
    thread.join(LATE_S)


def reply_to_read(rng: np.random.Generator, sent: bytes, values: list[int]) -> tuple[bytes, bool]:
    """A reply to a request for registers, and whether it is sound: then it says `values`."""
    transaction, unit = int.from_bytes(sent[:2], "big"), sent[6]
    payload = struct.pack(f">{len(values)}H", *values)
    kind = int(rng.integers(10))
    if kind == 0:
        return adu(bytes([3, len(payload)]) + payload, transaction, unit), True
    if kind == 1:       # a byte count that is not the payload's
        said = int(rng.choice([0, 1, len(payload) - 2, len(payload) - 1, len(payload) + 1, len(payload) + 2, 255])) & 0xFF
        return adu(bytes([3, said]) + payload, transaction, unit), said == len(payload)
    if kind == 2:       # registers too many or too few, counted rightly
        other = payload[:-2] if rng.random() < 0.5 else payload + payload[:2]
        return adu(bytes([3, len(other) & 0xFF]) + other, transaction, unit), False
    if kind == 3:       # of another function
        function = int(rng.choice([f for f in range(1, 128) if f != 3]))
        return adu(bytes([function, len(payload)]) + payload, transaction, unit), False
    if kind == 4:       # of another request, unit or protocol
        other = [(transaction ^ 1, unit, 0), (transaction, unit ^ 3, 0), (transaction, unit, 1)][int(rng.integers(3))]
        return adu(bytes([3, len(payload)]) + payload, other[0], other[1], protocol=other[2]), False
    if kind == 5:       # a length that is not the frame's
        length = int(rng.choice([n for n in LENGTHS if n != len(payload) + 3]))
        return adu(bytes([3, len(payload)]) + payload, transaction, unit, length), False
    if kind == 6:       # torn
        whole = adu(bytes([3, len(payload)]) + payload, transaction, unit)
        return whole[:int(rng.integers(len(whole)))], False
    if kind == 7:       # an exception, with and without a code
        return adu(bytes([0x83]) + rng.bytes(int(rng.integers(0, 3))), transaction, unit), False
    if kind == 8:
        return rng.bytes(int(rng.integers(1, 300))), False
    return adu(rng.bytes(int(rng.integers(1, 250))), transaction, unit), False


# ---- both ends -------------------------------------------------------------------------------------------------------------


def to_a_device(seed: int, count: int, patience_s: float = 0.01) -> list[str]:
    """What is wrong after `count` frames to an embedded device that holds a table, each on a connection of its own and followed
    by a sound question. patience_s: how long a reply is waited for that need not come."""
    from compensator.modbus.server import Loopback
    from tests.compensator.modbus import tables_and_devices as kit

    rng = np.random.default_rng(seed)
    device, table, other = kit.offset_device(), kit.random_table(1), kit.random_table(2)
    kit.load(device, table)
    writes = ([1, *other.header.registers()], [2, *other.header.registers()], other.page(0))
    said = []
    with Loopback(device) as server:
        for number in range(count):
            sent = request(rng, writes[number % 3])
            wrong = wrong_reply(sent, exchanged(server.port, sent.data, LATE_S if sent.whole else patience_s))
            if exchanged(server.port, adu(bytes([3, 0, 0, 0, 2]), 9), LATE_S) != adu(bytes([3, 4]) + b"CSMB", 9):
                wrong = wrong or "a sound question after it has no answer"
            if device.active is None or (device.active.registers != table.registers).any():
                wrong = wrong or "the table has changed"
            said += [f"seed {seed}, frame {number}, {sent.data[:24].hex()}: {wrong}"] * bool(wrong)
    return said


def to_a_client(seed: int, count: int) -> list[str]:
    """What is wrong with what a client makes of `count` replies: the registers that a sound one says, or why not."""
    from compensator.modbus.link import Address, ExceptionReply, Link, LinkLost

    rng = np.random.default_rng(seed)
    said = []
    for number in range(count):
        wanted = rng.integers(0, 65536, int(rng.choice([1, 2, 11, 40, 124, 125]))).tolist()
        sound: list[bool] = []

        def answer(sent: bytes, wanted: list[int] = wanted, sound: list[bool] = sound) -> bytes:
            reply, good = reply_to_read(rng, sent, wanted)
            sound.append(good)
            return reply

        with answering(answer) as port, Link(Address("127.0.0.1", port, 1, LATE_S, 0)) as link:
            try:
                wrong = "" if link.read(0, len(wanted)) == wanted and sound == [True] else "took what was not said"
            except (LinkLost, ExceptionReply):
                wrong = "refused a sound reply" if sound == [True] else ""
            except Exception as defect:
                wrong = repr(defect)
        said += [f"seed {seed}, reply {number}: {wrong}"] * bool(wrong)
    return said
