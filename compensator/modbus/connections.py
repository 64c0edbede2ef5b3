"""How many connections a device holds: whoever reaches its port must not be able to use it up."""

from __future__ import annotations

import asyncio
import errno
import ssl
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from pymodbus import FramerType
from pymodbus.pdu import ExceptionResponse
from pymodbus.server import ModbusTcpServer, ModbusTlsServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.transport import ModbusProtocol

# Connections at once: a PLC, a push, a supervisor, and some that were lost without a word.
MOST = 32
# A TLS handshake takes no longer.
HANDSHAKE_S = 5.0
# What the system says where no further socket can be had.
EXHAUSTED = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class _Handler(ServerRequestHandler):
    """A connection that knows when something was last heard of it."""

    def __init__(self, owner: Any) -> None:
        # pymodbus gives its handler's constructor no types.
        super().__init__(owner, owner.trace_packet, owner.trace_pdu, owner.trace_connect)  # type: ignore[no-untyped-call]
        self.spoke, self.heard = False, time.monotonic()
        self.asked, self._decode = 0, self.framer.decode
        # pymodbus has no hook that sees a frame before it is decoded, nor types for what it sends.
        self.framer.decode = self._noted        # type: ignore[method-assign,assignment]

    def _noted(self, data: bytes) -> tuple[int, int, int, bytes]:
        used = self._decode(data)
        self.asked = used[3][0] if used[3] else 0
        return used

    def server_send(self, pdu: Any, addr: tuple[Any, ...] | None) -> None:
        """pymodbus answers what it cannot read by an exception of function 0; the specification wants the one asked."""
        if isinstance(pdu, ExceptionResponse) and pdu.function_code & 0x7F == 0:
            pdu.function_code = self.asked | 0x80
        super().server_send(pdu, addr)          # type: ignore[no-untyped-call]

    def callback_data(self, data: bytes, addr: tuple[Any, ...] | None = None) -> int:
        used = super().callback_data(data, addr)
        if used:
            self.spoke, self.heard = True, time.monotonic()
        return used


class _Bounded:
    """Beyond MOST the one that never sent a whole frame goes, the oldest first; else the one that is silent the longest."""

    active_connections: dict[str, ModbusProtocol]

    def callback_new_connection(self) -> ModbusProtocol:
        held = [one for one in self.active_connections.values() if isinstance(one, _Handler)]
        for one in sorted(held, key=lambda one: (one.spoke, one.heard))[:max(len(held) + 1 - MOST, 0)]:
            one.close()
        return _Handler(self)


class _Tcp(_Bounded, ModbusTcpServer):
    pass


class _Tls(_Bounded, ModbusTlsServer):
    pass


def bounded_server(device: Any, address: tuple[str, int], context: ssl.SSLContext | None) -> ModbusTcpServer:
    """A server that is not listening yet, in the running loop; context: of TLS, None without."""
    server: ModbusTcpServer
    if context is None:
        server = _Tcp(device, address=address)
    else:
        # The framer of plain sockets: it counts the bytes of a frame, the TLS one takes whatever arrives together.
        server = _Tls(device, address=address, sslctx=context, framer=FramerType.SOCKET)
        create: Callable[..., Any] = server.call_create
        server.call_create = partial(create, ssl_handshake_timeout=HANDSHAKE_S)
    asyncio.get_running_loop().set_exception_handler(partial(_quiet_where_exhausted, server))
    return server


def _quiet_where_exhausted(server: ModbusTcpServer, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """No trace for a socket that could not be had: those held stay, and asyncio tries again after a second, also where
    the server has ended by then and its own socket is no more."""
    reason = context.get("exception")
    exhausted = isinstance(reason, OSError) and reason.errno in EXHAUSTED
    ended = isinstance(reason, ValueError) and not server.is_active()
    if not (exhausted or ended):
        loop.default_exception_handler(context)
