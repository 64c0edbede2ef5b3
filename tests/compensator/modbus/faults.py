"""Every fault point of a transfer, by phase. benchmarks/modbus.py tries all, the tests a share."""

from __future__ import annotations

from tests.compensator.modbus.proxy import Fault
from tests.compensator.modbus.tables_and_devices import BEFORE, BEGIN, COMMIT, IDENTITY, PAGES, READ_BACK

# Bytes of frames: 7 of MBAP, 1 function, then a read request 4, a write request 5 + 2 a word, a write reply 4.
READ_REQUEST, WRITE_REPLY, COMMAND_REQUEST, PAGE_REQUEST = 12, 12, 13 + 2 * 12, 13 + 2 * 123
LAST_PAGE_REQUEST = 13 + 2 * 33
HEADER_REPLY, IDENTITY_REPLY = 9 + 2 * 11, 9 + 2 * 8
CODES = (*range(1, 16), 255)


def _at(request: int, sent: int, answered: int, step: int = 1) -> list[Fault]:
    """All faults at one request whose frame has `sent` bytes and whose reply has `answered`."""
    return [
        *(Fault("reset request", request, byte) for byte in range(0, sent + 1, step)),
        *(Fault("stall request", request, byte) for byte in (0, 1, 6, 7, 11, sent - 1)),
        *_reply(request, answered, step), Fault("duplicate request", request),
        *(Fault("refuse request", request, code=code) for code in CODES),
    ]


def _reply(request: int, answered: int, step: int = 1) -> list[Fault]:
    return [
        *(Fault("reset reply", request, byte) for byte in range(0, answered, step)),
        *(Fault("stall reply", request, byte) for byte in range(0, answered, step)),
        *(Fault(kind, request) for kind in ("duplicate reply", "stale reply", "late reply", "delay reply", "foreign reply")),
        *(Fault("exception reply", request, code=code) for code in CODES),
    ]


def network_faults() -> dict[str, list[Fault]]:
    """By phase, as the proxy makes them."""
    pages = []
    for request, size, step in ((PAGES[0], PAGE_REQUEST, 7), (PAGES[1], PAGE_REQUEST, 23), (PAGES[2], LAST_PAGE_REQUEST, 5)):
        pages += _at(request, size, WRITE_REPLY, step)
    commit = [fault for fault in _at(COMMIT, COMMAND_REQUEST, WRITE_REPLY) if not fault.kind.endswith("reply")]
    return {
        "connect": [*(Fault("reset connection", times) for times in range(1, 8)), *_at(IDENTITY, READ_REQUEST, IDENTITY_REPLY),
                    *_at(BEFORE, READ_REQUEST, HEADER_REPLY)],
        "page": [*_at(BEGIN, COMMAND_REQUEST, WRITE_REPLY, 3), *pages],
        # One flipped bit of an offset on the way, or of the CRC in the header of begin or commit.
        "CRC": [*(Fault("corrupt request", request, byte) for request, size in zip(PAGES, (PAGE_REQUEST, PAGE_REQUEST, 73),
                                                                                  strict=True)
                  for byte in range(20, size, 12)),
                *(Fault("corrupt request", request, byte) for request in (BEGIN, COMMIT) for byte in range(15, 37))],
        "commit": commit,
        "reply": _reply(COMMIT, WRITE_REPLY),
        "read-back": _at(READ_BACK, READ_REQUEST, HEADER_REPLY),
    }
