"""A proxy on loopback that does one thing wrong, once: the network between push and cell as it can be at its worst."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

REQUEST_KINDS = ("reset request", "stall request", "duplicate request", "refuse request", "corrupt request", "before request")
REPLY_KINDS = ("reset reply", "stall reply", "duplicate reply", "stale reply", "late reply", "delay reply", "exception reply",
               "foreign reply", "after reply")


@dataclass(frozen=True)
class Fault:
    """kind, at the `request`-th request (from 0) of the push; byte: where it is cut or changed; code of an exception."""

    kind: str
    request: int
    byte: int = 0
    code: int = 0


NO_FAULT = Fault("none", -1)


class Proxy:
    """Listens on a port of its own and passes Modbus/TCP frames on to `upstream`, a port of 127.0.0.1."""

    def __init__(self, upstream: int, delay_s: float) -> None:
        self.upstream, self.delay_s = upstream, delay_s
        self.fault, self.requests, self.fired = NO_FAULT, 0, False
        self.call: Callable[[], None] = lambda: None
        self.held = self.last = b""
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._open = True
        self._sockets: set[socket.socket] = set()
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def __enter__(self) -> Proxy:
        return self

    def __exit__(self, *_: object) -> None:
        self._open = False
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in list(self._sockets):
            _wake(connection)
        for thread in self._threads:
            thread.join(5)

    def arm(self, fault: Fault, call: Callable[[], None] = lambda: None) -> None:
        """The fault of the next push."""
        self.fault, self.call, self.requests, self.fired, self.held = fault, call, 0, False, b""

    def _accept(self) -> None:
        while self._open:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            if self.fault.kind == "reset connection" and self.fault.request > 0:
                self.fault, self.fired = Fault("reset connection", self.fault.request - 1), True
                _reset(client)
                continue
            try:
                server = socket.create_connection(("127.0.0.1", self.upstream), timeout=2)
            except OSError:
                _reset(client)
                continue
            pair = _Pair(self, client, server)
            self._sockets |= {client, server}
            self._threads = [thread for thread in self._threads if thread.is_alive()]
            for run in (pair.requests, pair.replies):
                self._threads.append(threading.Thread(target=run, daemon=True))
                self._threads[-1].start()


class _Pair:
    """One connection: two pumps of whole frames."""

    def __init__(self, proxy: Proxy, client: socket.socket, server: socket.socket) -> None:
        self.proxy, self.client, self.server = proxy, client, server
        self.numbers: list[int] = []
        self.stalled = False
        # Each thread closes the socket it reads from, and nobody sends meanwhile: a number that the system has given to a
        # new socket must not be used for the old one.
        self.lock = threading.Lock()

    def requests(self) -> None:
        self._requests()
        self._end()
        self._close(self.client)

    def replies(self) -> None:
        self._replies()
        self._end()
        self._close(self.server)

    def _requests(self) -> None:
        for frame in _frames(self.client):
            proxy = self.proxy
            number, proxy.requests = proxy.requests, proxy.requests + 1
            fault = proxy.fault
            self.numbers.append(number)
            if number != fault.request or fault.kind not in REQUEST_KINDS or proxy.fired or self.stalled:
                if not self.stalled:
                    self._send(self.server, frame)
                continue
            proxy.fired = True
            if fault.kind == "reset request":
                self._send(self.server, frame[:fault.byte])
                return
            elif fault.kind == "stall request":
                self._send(self.server, frame[:fault.byte])
                self.stalled = True
            elif fault.kind == "duplicate request":
                self._send(self.server, frame)
                time.sleep(0.01)
                self.numbers.append(number)
                self._send(self.server, frame)
            elif fault.kind == "refuse request":
                self.numbers.pop()
                self._send(self.client, exception(frame, fault.code))
            elif fault.kind == "corrupt request":
                self._send(self.server, frame[:fault.byte] + bytes([frame[fault.byte] ^ 1]) + frame[fault.byte + 1:])
            else:
                proxy.call()
                self._send(self.server, frame)

    def _replies(self) -> None:
        for frame in _frames(self.server):
            proxy = self.proxy
            fault = proxy.fault
            number = self.numbers.pop(0) if self.numbers else -1
            if proxy.held:
                self._send(self.client, proxy.held)
                proxy.held = b""
            if number != fault.request or fault.kind not in REPLY_KINDS or proxy.fired:
                self._send(self.client, frame)
                proxy.last = frame
                continue
            proxy.fired = True
            if fault.kind == "reset reply":
                self._send(self.client, frame[:fault.byte])
                return
            elif fault.kind == "stall reply":
                self._send(self.client, frame[:fault.byte])
            elif fault.kind == "duplicate reply":
                self._send(self.client, frame + frame)
            elif fault.kind == "stale reply":
                self._send(self.client, proxy.last + frame)
            elif fault.kind == "late reply":
                proxy.held = frame
            elif fault.kind == "delay reply":
                time.sleep(proxy.delay_s)
                self._send(self.client, frame)
            elif fault.kind == "exception reply":
                self._send(self.client, exception(frame, fault.code))
            elif fault.kind == "foreign reply":
                self._send(self.client, bytes([frame[0] ^ 0x55]) + frame[1:])
            else:
                self._send(self.client, frame)
                proxy.call()

    def _send(self, to: socket.socket, data: bytes) -> None:
        with self.lock, contextlib.suppress(OSError):
            to.sendall(data)

    def _end(self) -> None:
        """Wakes both threads; what they close then ends with a reset."""
        for connection in (self.client, self.server):
            _wake(connection)

    def _close(self, connection: socket.socket) -> None:
        with self.lock:
            self.proxy._sockets.discard(connection)
            connection.close()


def exception(frame: bytes, code: int) -> bytes:
    """The exception reply to a request, or in place of a reply."""
    return frame[:4] + struct.pack(">HBBB", 3, frame[6], frame[7] | 0x80, code)


def _frames(source: socket.socket):
    """Whole MBAP frames until the connection ends."""
    buffer = b""
    while True:
        try:
            data = source.recv(4096)
        except OSError:
            return
        if not data:
            return
        buffer += data
        while len(buffer) >= 6 and len(buffer) >= (size := 6 + int.from_bytes(buffer[4:6], "big")):
            yield buffer[:size]
            buffer = buffer[size:]


def _wake(connection: socket.socket) -> None:
    """Ends the wait of the thread that reads from it; closing it then sends a reset."""
    with contextlib.suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        connection.shutdown(socket.SHUT_RD)


def _reset(connection: socket.socket) -> None:
    _wake(connection)
    connection.close()
