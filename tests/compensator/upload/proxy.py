"""A proxy for whole HTTP requests that does one thing wrong, once, as the one for Modbus frames does (modbus/proxy.py)."""

from __future__ import annotations

import contextlib
import socket
import ssl
import struct
import threading
import time

from tests.compensator.modbus.proxy import NO_FAULT, Fault

CODES = (400, 401, 403, 404, 409, 500, 503)
HOLD_S = 5.0


class HttpProxy:
    """Listens on a port of its own, with TLS if told, and passes requests on to `upstream`, a port of 127.0.0.1 without it.

    sizes: bytes of each request and its reply since `arm`. late: requests that were held back until the client had gone."""

    def __init__(self, upstream: int, tls: ssl.SSLContext | None = None) -> None:
        self.upstream, self.tls = upstream, tls
        self.fault, self.fired, self.sizes = NO_FAULT, False, []
        self.late: list[threading.Thread] = []
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def __enter__(self) -> HttpProxy:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join(5)

    def arm(self, fault: Fault) -> None:
        """The fault of the next run."""
        self.settle()
        self.fault, self.fired, self.sizes = fault, False, []

    def settle(self) -> None:
        """Waits until what was held back has arrived."""
        for thread in self.late:
            thread.join(HOLD_S)
        self.late = []

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError):
            client.settimeout(HOLD_S)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self.tls:
                client = self.tls.wrap_socket(client, server_side=True)
            while request := _message(client):
                with self._lock:
                    number = len(self.sizes)
                    self.sizes.append([len(request), 0])
                    hit = number == self.fault.request and not self.fired
                    self.fired |= hit
                if not (self._wrong if hit else self._right)(client, request, number):
                    break
        client.close()

    def _right(self, client: socket.socket, request: bytes, number: int) -> bool:
        reply = self._ask(request)
        self.sizes[number][1] = len(reply)
        client.sendall(reply)
        return True

    def _wrong(self, client: socket.socket, request: bytes, number: int) -> bool:
        fault = self.fault
        if fault.kind == "reset request":
            self._ask(request[:fault.byte])
            return _reset(client)
        if fault.kind == "stall request":
            self._ask(request[:fault.byte])
            return _gone(client)
        if fault.kind == "late request":
            _gone(client)
            thread = threading.Thread(target=self._later, args=(request, fault.byte), daemon=True)
            thread.start()
            self.late.append(thread)
            return False
        if fault.kind == "refuse request":
            client.sendall(_status(fault.code))
            return True
        if fault.kind == "corrupt request":
            request = _flipped(request, fault.byte)
        reply = self._ask(request)
        if fault.kind == "duplicate request":
            self._ask(request)
        elif fault.kind == "reset reply":
            client.sendall(reply[:fault.byte])
            return _reset(client)
        elif fault.kind == "stall reply":
            client.sendall(reply[:fault.byte])
            return _gone(client)
        elif fault.kind == "exception reply":
            reply = _status(fault.code)
        elif fault.kind == "corrupt reply":
            reply = _flipped(reply, fault.byte)
        client.sendall(reply)
        return True

    def _later(self, request: bytes, after_ms: int) -> None:
        time.sleep(1e-3 * after_ms)
        self._ask(request)

    def _ask(self, request: bytes) -> bytes:
        """The controller's reply, b"" where it does not answer what came."""
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.upstream), timeout=HOLD_S) as server:
            server.sendall(request)
            server.shutdown(socket.SHUT_WR)
            return _message(server)
        return b""


def faults(sizes: list[list[int]]) -> list[Fault]:
    """Every fault at every request of a run whose requests and replies have these sizes."""
    found = []
    for number, (sent, answered) in enumerate(sizes):
        found += [Fault(kind, number, byte) for kind in ("reset request", "stall request")
                  for byte in (0, 10, sent // 2, sent - 1, sent)]
        found += [Fault(kind, number, byte) for kind in ("reset reply", "stall reply")
                  for byte in (0, 10, answered // 2, answered - 1)]
        found += [Fault("late request", number, after_ms) for after_ms in (0, 20, 60)]
        found += [Fault("duplicate request", number), Fault("corrupt request", number, -2), Fault("corrupt reply", number, -2)]
        found += [Fault(kind, number, code=code) for kind in ("refuse request", "exception reply") for code in CODES]
    return found


def _message(source: socket.socket) -> bytes:
    """One whole HTTP message; what came of it where the connection ends before."""
    data = b""
    while b"\r\n\r\n" not in data:
        part = source.recv(1 << 16)
        if not part:
            return data
        data += part
    head = data.partition(b"\r\n\r\n")[0]
    lengths = [int(line.partition(b":")[2]) for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
    whole = len(head) + 4 + (lengths[0] if lengths else 0)
    while len(data) < whole:
        part = source.recv(1 << 16)
        if not part:
            return data
        data += part
    return data


def _status(code: int) -> bytes:
    more = b'WWW-Authenticate: Digest realm="x", nonce="y", qop="auth"\r\n' if code == 401 else b""
    return b"HTTP/1.1 %d x\r\nContent-Length: 0\r\n%s\r\n" % (code, more)


def _flipped(message: bytes, byte: int) -> bytes:
    """One bit of the body changed; a message without one as it is."""
    if message.endswith(b"\r\n\r\n"):
        return message
    return message[:byte] + bytes([message[byte] ^ 1]) + message[byte + 1:]


def _gone(client: socket.socket) -> bool:
    """Waits until the client gives up."""
    with contextlib.suppress(OSError):
        while client.recv(1 << 16):
            pass
    return False


def _reset(client: socket.socket) -> bool:
    with contextlib.suppress(OSError):
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.close()
    return False
