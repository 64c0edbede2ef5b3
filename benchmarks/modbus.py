"""The Modbus side, measured: rows a second beside bare pymodbus, and every fault point of a transfer.

    python benchmarks/modbus.py            all (about six minutes)
    python benchmarks/modbus.py rate       only the rates
    python benchmarks/modbus.py faults     only the faults

Rates: client and server are two processes on loopback. Bare pymodbus writes 123 registers, 41 rows, into a server without
any logic. Faults: a proxy does one thing wrong; after each the active table must be the old or the new one, whole, the exit
code and message must say which, and a second push must complete. Exits 1 if one fault is not survived.
"""

from __future__ import annotations

import contextlib
import errno
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from compensator.modbus.link import Address, Link
from compensator.modbus.server import Loopback
from compensator.modbus.transfer import push_table
from tests.compensator.modbus import tables_and_devices as kit
from tests.compensator.modbus.faults import network_faults
from tests.compensator.modbus.proxy import Fault, Proxy

BARE_SERVER = """
import asyncio
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice
async def main():
    device = SimDevice(1, simdata=SimData(0, values=[0] * 1000, datatype=DataType.REGISTERS))
    server = ModbusTcpServer(device, address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    print(server.transport.sockets[0].getsockname()[1], flush=True)
    await asyncio.sleep(3600)
asyncio.run(main())
"""
ROWS = 20_000
ROUNDS = 7
# Moments of a kill -9 of the cell: when a request arrives, or when its reply is out.
KILLS = {
    "connect": [("before request", kit.IDENTITY), ("after reply", kit.IDENTITY), ("before request", kit.BEFORE)],
    "page": [("before request", kit.BEGIN), *(("before request", page) for page in kit.PAGES), ("after reply", kit.PAGES[0])],
    "CRC": [("after reply", kit.PAGES[2])],
    "commit": [("before request", kit.COMMIT)] * 3,
    "reply": [("after reply", kit.COMMIT)] * 8,
    "read-back": [("before request", kit.READ_BACK), ("after reply", kit.READ_BACK)],
}


def rates() -> None:
    """Rows a second: bare writes, pages alone, a whole push with commit onto the disk and read-back."""
    from pymodbus.client import ModbusTcpClient

    bare = subprocess.Popen([sys.executable, "-c", BARE_SERVER], stdout=subprocess.PIPE, text=True)
    assert bare.stdout
    found: dict[str, list[float]] = {"bare": [], "pages": [], "memory": [], "disk": []}
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as other, kit.DeviceProcess(
        Path(folder)
    ) as disk, kit.DeviceProcess(Path(other), keeps=False) as memory:
        client = ModbusTcpClient("127.0.0.1", port=int(bare.stdout.readline()))
        client.connect()
        registers = list(range(123))
        for round_number in range(ROUNDS):
            begun = time.perf_counter()
            for _ in range(ROWS // 41):
                client.write_registers(0, registers, device_id=1)
            found["bare"].append(ROWS // 41 * 41 / (time.perf_counter() - begun))
            for name, device in (("memory", memory), ("disk", disk)):
                seconds, pages = _timed_push(device.port, kit.random_table(round_number, rows=ROWS))
                found[name].append(ROWS / seconds)
            found["pages"].append((ROWS - 40) / pages)
        client.close()
    bare.kill()
    bare.wait()
    bare.stdout.close()
    print(f"{ROWS} rows, median of {ROUNDS} rounds, alternating")
    for name, text in (("bare", "bare pymodbus, 41 rows a write"), ("pages", "pages of a push, 40 rows a write"),
                       ("memory", "whole push with commit and read-back, cell without --state"),
                       ("disk", "whole push, the cell puts the table onto the disk (fsync)")):
        share = statistics.median([rate / bare for rate, bare in zip(found[name], found["bare"], strict=True)])
        print(f"{text:60s} {statistics.median(found[name]):10.0f} rows/s  {100 * share:4.0f} % of bare")
    print(f"bare: {statistics.median(found['bare']) / 41:.0f} writes/s")


def _timed_push(port: int, table: kit.OffsetTable) -> tuple[float, float]:
    """Seconds of a whole push, and from its first page to its last."""
    pages: list[float] = []
    with Link(Address("127.0.0.1", port, 1, 10.0)) as link:
        link.read(0, 8)
        begun = time.perf_counter()
        push_table(link, table, 10.0, lambda page, count: pages.append(time.perf_counter()))
        return time.perf_counter() - begun, pages[-1] - pages[0]


def faults() -> bool:
    """Every fault; prints the table, returns whether all were survived."""
    print("phase       faults  survived  delivered  old table  state unknown  refused   seconds")
    good = True
    total = 0
    for phase, found in network_faults().items():
        begun = time.perf_counter()
        endings: Counter[str] = Counter()
        failures: list[str] = []
        with tempfile.TemporaryDirectory() as folder:
            _on_the_wire(Path(folder), found, endings, failures)
        with tempfile.TemporaryDirectory() as folder:
            _killed(Path(folder), phase, endings, failures)
        count = len(found) + len(KILLS[phase])
        if phase == "commit":
            with tempfile.TemporaryDirectory() as folder:
                count += _disk_full(Path(folder), endings, failures)
        total += count
        good &= not failures
        print(f"{phase:10s} {count:7d} {count - len(failures):9d} {endings['delivered']:10d} {endings['old']:10d} "
              f"{endings['unknown']:14d} {endings['refused']:8d} {time.perf_counter() - begun:9.1f}", flush=True)
        for line in failures:
            print(f"  NOT survived: {line}")
    print(f"{total} fault points")
    return good


def _on_the_wire(folder: Path, found: list[Fault], endings: Counter[str], failures: list[str]) -> None:
    device, old, new = kit.offset_device(folder), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    with Loopback(device) as server, Proxy(server.port, 1.5 * kit.TIMEOUT_S) as proxy:
        for fault in found:
            proxy.arm(fault)
            ending = kit.push(proxy.port, new)
            _judge(str(fault), ending, proxy.fired, folder, server.port, old, new, endings, failures)
            old, new = new, old


def _killed(folder: Path, phase: str, endings: Counter[str], failures: list[str]) -> None:
    old, new = kit.random_table(1), kit.random_table(2)
    with kit.DeviceProcess(folder) as device, Proxy(device.port, 0) as proxy:
        assert kit.push(device.port, old, timeout_s=10).code == 0

        running = threading.Event()

        def restart() -> None:
            running.clear()
            device.kill()
            device.start()
            running.set()

        for number, (kind, request) in enumerate(KILLS[phase]):
            proxy.arm(Fault(kind, request), restart)
            ending = kit.push(proxy.port, new, timeout_s=10, retries=10 if number % 2 else 1)
            assert running.wait(60)
            _judge(f"kill -9 {kind} {request}", ending, proxy.fired, device.state, device.port, old, new, endings, failures)
            old, new = new, old


def _disk_full(folder: Path, endings: Counter[str], failures: list[str]) -> int:
    """No space at the first, second ... call that touches the disk; for good, so that no repetition helps."""
    device, old, new = kit.offset_device(folder), kit.random_table(1), kit.random_table(2)
    kit.load(device, old)
    points = [(name, calls) for name in ("fsync", "replace") for calls in (0, 1)]
    with Loopback(device) as server, Proxy(server.port, 0) as proxy:
        for name, calls in points:
            proxy.arm(Fault("duplicate reply", kit.BEFORE))
            with _no_space(name, calls):
                ending = kit.push(proxy.port, new)
            _judge(f"disk full at {name} {calls}", ending, proxy.fired, folder, server.port, old, new, endings, failures)
            old, new = new, old
    return len(points)


@contextlib.contextmanager
def _no_space(name: str, calls: int) -> Iterator[None]:
    real, left = getattr(os, name), calls

    def full(*arguments: object) -> object:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*arguments)

    setattr(os, name, full)
    try:
        yield
    finally:
        setattr(os, name, real)


def _judge(
    name: str, ending: kit.Ending, fired: bool, folder: Path, port: int, old: kit.OffsetTable, new: kit.OffsetTable,
    endings: Counter[str], failures: list[str],
) -> None:
    try:
        assert fired, "the fault did not happen"
        kit.check_honest(ending, kit.rows_on_disk(folder), old, new)
        again = kit.push(port, new, timeout_s=10, retries=10)
        assert again.code == 0, again
        assert kit.rows_on_disk(folder) == kit.offsets_of(new), "second push"
    except AssertionError as reason:
        failures.append(f"{name}: {reason}; {ending}")
        kit.push(port, new, timeout_s=10, retries=10)
    endings[{0: "delivered", 3: "refused"}.get(ending.code, "old" if kit.OLD in ending.text else "unknown")] += 1


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["rate", "faults"]
    if "rate" in wanted:
        rates()
    if "faults" in wanted and not faults():
        sys.exit(1)
