"""The embedded cell on pymodbus' server."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
import threading
from collections.abc import Callable
from types import TracebackType
from typing import cast

from compensator.modbus import registers as at
from compensator.modbus.machine import CellMachine, RefusedWrite
from identification.common.findings import error

# pymodbus reads a single written register back, with the same function code 6.
READS, WRITES = (3, 4, 6), (6, 16)
START_S = 10.0


async def serve(
    machine: CellMachine, host: str, port: int, unit: int, tls: ssl.SSLContext | None, stop: asyncio.Event,
    ready: Callable[[int], None],
) -> None:
    """Serves until `stop` is set; ready is called with the port. Raises CompstiffError (CS5103) where it cannot listen."""
    from pymodbus import FramerType
    from pymodbus.constants import ExcCodes
    from pymodbus.server import ModbusTcpServer, ModbusTlsServer
    from pymodbus.simulator import DataType, SimData, SimDevice

    async def action(
        function: int, start: int, address: int, count: int, current: list[int], new: list[int] | list[bool] | None
    ) -> ExcCodes | None:
        # Never waits: while one action waited, the next request would take over pymodbus' answer to this one.
        try:
            if new is None:
                if function not in READS:
                    return ExcCodes.ILLEGAL_FUNCTION
                current[address - start:address - start + count] = machine.read(address, count)
            elif function in WRITES:
                machine.write(address, cast(list[int], new))
            else:
                return ExcCodes.ILLEGAL_FUNCTION
        except RefusedWrite as refused:
            return ExcCodes(int(refused.code))
        return None

    quiet_pymodbus()
    _check_free(host, port)
    registers = SimData(0, values=[0] * (at.LAST_ADDRESS + 1), datatype=DataType.REGISTERS)
    device = SimDevice(unit, simdata=registers, action=action)
    if tls is None:
        server = ModbusTcpServer(device, address=(host, port))
    else:
        # The framer of plain sockets: it counts the bytes of a frame, the TLS one takes whatever arrives together.
        server = ModbusTlsServer(device, address=(host, port), sslctx=tls, framer=FramerType.SOCKET)
    try:
        await server.serve_forever(background=True)
    except RuntimeError as reason:
        raise _cannot_listen(host, port, str(reason)) from reason
    try:
        ready(server.transport.sockets[0].getsockname()[1])  # type: ignore[attr-defined]
        await stop.wait()
    finally:
        await server.shutdown()  # type: ignore[no-untyped-call]
        # One round of the loop closes the sockets.
        await asyncio.sleep(0.01)


class Loopback:
    """A cell in a thread of this process, on 127.0.0.1: `with Loopback(machine) as cell: ... cell.port`."""

    def __init__(self, machine: CellMachine, unit: int = 1, tls: ssl.SSLContext | None = None, port: int = 0) -> None:
        self.machine, self.unit, self.tls, self.port = machine, unit, tls, port
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    def __enter__(self) -> Loopback:
        self._thread.start()
        if not self._ready.wait(START_S):
            raise _cannot_listen("127.0.0.1", self.port, "the server did not start")
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(START_S)

    async def _run(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        await serve(self.machine, "127.0.0.1", self.port, self.unit, self.tls, self._stop, self._started)

    def _started(self, port: int) -> None:
        self.port = port
        self._ready.set()


def quiet_pymodbus() -> None:
    """pymodbus logs every lost connection; what matters is said by the command itself."""
    logger = logging.getLogger("pymodbus")
    logger.setLevel(logging.CRITICAL)
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())


def _check_free(host: str, port: int) -> None:
    """Binds once by itself, because pymodbus does not say why it could not."""
    try:
        with socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET):
            pass
    except OSError as reason:
        raise _cannot_listen(host, port, reason.strerror or str(reason)) from reason


def _cannot_listen(host: str, port: int, why: str) -> Exception:
    return error("CS5103", f"cannot listen on {host}:{port}: {why}", hint="give another --port, or stop what listens there")
