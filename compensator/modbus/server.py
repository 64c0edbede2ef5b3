"""An offset device on pymodbus' server: its address, its loop, and one in a thread of this process."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import cast

from compensator.modbus import registers as at
from compensator.modbus.device import OffsetDevice, RefusedWrite
from compensator.modbus.tls import TlsFiles
from identification.common.findings import error

# pymodbus reads a single written register back, with the same function code 6.
READS, WRITES = (3, 4, 6), (6, 16)
START_S = 10.0


@dataclass(frozen=True)
class Endpoint:
    """Where a device listens. port 0: any free one; tls: certificates of the server's side, None without."""

    host: str
    port: int
    unit: int
    tls: TlsFiles | None = None


async def serve(device: OffsetDevice, endpoint: Endpoint, stop: asyncio.Event, ready: Callable[[int], None]) -> None:
    """Serves until `stop` is set; ready is called with the port. Raises CompstiffError: CS5103 it cannot listen,
    CS5105 a file of its certificates."""
    from pymodbus.constants import ExcCodes
    from pymodbus.simulator import DataType, SimData, SimDevice

    from compensator.modbus.connections import bounded_server

    async def action(
        function: int, start: int, address: int, count: int, current: list[int], new: list[int] | list[bool] | None
    ) -> ExcCodes | None:
        # Never waits: while one action waited, the next request would take over pymodbus' answer to this one.
        try:
            if new is None:
                if function not in READS:
                    return ExcCodes.ILLEGAL_FUNCTION
                current[address - start:address - start + count] = device.read(address, count)
            elif function in WRITES:
                device.write(address, cast(list[int], new))
            else:
                return ExcCodes.ILLEGAL_FUNCTION
        except RefusedWrite as refused:
            return ExcCodes(int(refused.code))
        return None

    context = endpoint.tls.context("server") if endpoint.tls else None
    quiet_pymodbus()
    _check_free(endpoint)
    registers = SimData(0, count=at.LAST_ADDRESS + 1, values=0, datatype=DataType.REGISTERS)
    simulated = SimDevice(endpoint.unit, simdata=registers, action=action)
    server = bounded_server(simulated, (endpoint.host, endpoint.port), context)
    try:
        await server.serve_forever(background=True)
    except RuntimeError as reason:
        raise _cannot_listen(endpoint, str(reason)) from reason
    try:
        ready(server.transport.sockets[0].getsockname()[1])  # type: ignore[attr-defined]
        await stop.wait()
    finally:
        await server.shutdown()  # type: ignore[no-untyped-call]
        # One round of the loop closes the sockets.
        await asyncio.sleep(0.01)


class Loopback:
    """A device in a thread of this process, on 127.0.0.1: `with Loopback(device) as server: ... server.port`."""

    def __init__(self, device: OffsetDevice, unit: int = 1, tls: TlsFiles | None = None) -> None:
        self.device, self.endpoint, self.port = device, Endpoint("127.0.0.1", 0, unit, tls), 0
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    def __enter__(self) -> Loopback:
        self._thread.start()
        if not self._ready.wait(START_S):
            raise _cannot_listen(self.endpoint, "the server did not start")
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(START_S)

    async def _run(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        await serve(self.device, self.endpoint, self._stop, self._started)

    def _started(self, port: int) -> None:
        self.port = port
        self._ready.set()


def quiet_pymodbus() -> None:
    """pymodbus logs every lost connection; what matters is said by the command itself."""
    logger = logging.getLogger("pymodbus")
    logger.setLevel(logging.CRITICAL)
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())


def _check_free(endpoint: Endpoint) -> None:
    """Binds once by itself, because pymodbus does not say why it could not."""
    try:
        family = socket.AF_INET6 if ":" in endpoint.host else socket.AF_INET
        with socket.create_server((endpoint.host, endpoint.port), family=family):
            pass
    except OSError as reason:
        raise _cannot_listen(endpoint, reason.strerror or str(reason)) from reason


def _cannot_listen(endpoint: Endpoint, why: str) -> Exception:
    return error("CS5103", f"cannot listen on {endpoint.host}:{endpoint.port}: {why}",
                 hint="give another --port, or stop what listens there")
