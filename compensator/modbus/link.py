"""One Modbus connection that is made anew whenever anything is odd: bounded time, bounded repetitions.

Every request of the register map may be repeated, so after a lost connection, a late, torn or foreign reply the link opens
a fresh connection and asks again. No two requests are ever under way, and an old connection's bytes cannot reach a new one.
"""

from __future__ import annotations

import socket
import ssl
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from compensator.modbus.registers import Refusal
from compensator.modbus.server import quiet_pymodbus

if TYPE_CHECKING:
    from pymodbus.client import ModbusTcpClient
    from pymodbus.pdu import ModbusPDU

MOST_READ = 125
READ, WRITE = 3, 16
FIRST_PAUSE_S = 0.1
# What the procedure has to decide on; every other exception reply is asked again like a lost reply.
MEANT = (Refusal.VALUE, Refusal.BUSY, Refusal.SEQUENCE)
NAMES = {1: "illegal function", 2: "illegal address", 3: "illegal value", 4: "device failure", 5: "acknowledge", 6: "busy",
         7: "out of sequence", 8: "memory parity error", 10: "gateway path unavailable", 11: "gateway target no response"}


@dataclass(frozen=True)
class Address:
    """Where the device listens. timeout_s bounds the connection and every reply, retries how often a request is repeated.

    >>> compstiff.Address("127.0.0.1", 1502, unit=1).port
    1502
    """

    host: str
    port: int
    unit: int
    timeout_s: float = 2.0
    retries: int = 4
    tls: ssl.SSLContext | None = None

    def __str__(self) -> str:
        return f"{self.host}:{self.port} unit {self.unit}{' (TLS)' if self.tls else ''}"


class LinkLost(Exception):
    """No sound reply, however often it was asked."""


class ExceptionReply(Exception):
    """The device answered by a Modbus exception."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"exception reply {code} ({NAMES.get(code, 'unknown')})")


class Link:
    """Reads and writes registers; a context manager that closes the connection."""

    def __init__(self, address: Address) -> None:
        quiet_pymodbus()
        self.address = address
        self._client: ModbusTcpClient | None = None
        self._type = _client_type()
        self._transactions = 0

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection; the next request opens another."""
        if self._client is not None:
            self._transactions = self._client.transaction.next_tid
            self._client.close()  # type: ignore[no-untyped-call]
            self._client = None

    def read(self, address: int, count: int) -> list[int]:
        """The values of `count` registers, in as many requests as it takes. Raises LinkLost, ExceptionReply."""
        values: list[int] = []
        while len(values) < count:
            values += self._read_once(address + len(values), min(MOST_READ, count - len(values)))
        return values

    def _read_once(self, address: int, count: int) -> list[int]:
        reply = self._ask(READ, lambda client: client.read_holding_registers(address, count=count, device_id=self.address.unit),
                          lambda reply: len(reply.registers) == count)
        return list(reply.registers)

    def write(self, address: int, values: list[int]) -> None:
        """One write of up to 123 registers. Raises LinkLost, ExceptionReply."""
        self._ask(WRITE, lambda client: client.write_registers(address, values, device_id=self.address.unit),
                  lambda reply: (reply.address, reply.count) == (address, len(values)))

    def _ask(self, function: int, request: Callable[[ModbusTcpClient], Any], sound: Callable[[Any], bool]) -> Any:
        """The reply of the first attempt that has a sound one. function: code of the request, which a reply repeats."""
        from pymodbus.exceptions import ModbusException

        failure: Exception = LinkLost("not tried")
        for attempt in range(self.address.retries + 1):
            if attempt:
                time.sleep(FIRST_PAUSE_S * 2 ** (attempt - 1))
            try:
                reply: ModbusPDU = request(self._connected())
            except (ModbusException, OSError, struct.error, IndexError) as reason:
                failure = LinkLost(_reason(reason))
                self.close()
                continue
            # pymodbus compares the transaction and the unit, and lets a reply of any other function through.
            if reply.function_code & 0x7F != function:
                failure = LinkLost("a reply that does not belong to the request")
                self.close()
            elif reply.isError():
                failure = ExceptionReply(reply.exception_code)
                if reply.exception_code in MEANT:
                    raise failure
            elif sound(reply):
                return reply
            else:
                failure = LinkLost("a reply that does not belong to the request")
                self.close()
        raise failure

    def _connected(self) -> ModbusTcpClient:
        if self._client is None:
            client = self._type(self.address)
            if not client.connect():
                raise OSError(client.failure or "no connection")
            # Transaction numbers go on, so that not even a gateway's late reply fits a request of the new connection.
            client.transaction.next_tid = self._transactions
            self._client = client
        return self._client


def _client_type() -> Any:
    """pymodbus' client, connecting in a way that checks the host's certificate and says why it failed."""
    from pymodbus.client import ModbusTcpClient

    class Client(ModbusTcpClient):
        def __init__(self, address: Address) -> None:
            super().__init__(address.host, port=address.port, timeout=address.timeout_s, retries=0)
            self.wanted, self.failure = address, ""

        def connect(self) -> bool:
            if self.socket:
                return True
            wanted = self.wanted
            try:
                plain = socket.create_connection((wanted.host, wanted.port), timeout=wanted.timeout_s)
            except OSError as reason:
                self.failure = _reason(reason)
                return False
            try:
                plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.socket = wanted.tls.wrap_socket(plain, server_hostname=wanted.host) if wanted.tls else plain
            except (OSError, ValueError) as reason:
                self.failure = _reason(reason)
                plain.close()
            return self.socket is not None

    return Client


def _reason(reason: Exception) -> str:
    """Why, in the words of the system where it has some."""
    if isinstance(reason, TimeoutError):
        return "timed out"
    if isinstance(reason, OSError):
        return reason.strerror or str(reason)
    text = str(reason)
    return "no reply" if "No response" in text or "unexpectedly closed" in text else text
