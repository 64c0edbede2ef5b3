"""When a request must be over: each wait of an HTTP client is bounded by itself alone, and an answer that drips ends none."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from typing import Any

# What httpcore tells of a new connection, with the stream to it.
OPENED = ("connection.connect_tcp.complete", "connection.start_tls.complete")


class Deadline:
    """A context manager that shuts the connection of a request when its time is up; `over` says whether it was.

    The request is told of by `trace`, an HTTPX extension. Who waits for a byte then sees the end of the connection: an error,
    or the end of a body that has no stated length.
    """

    def __init__(self, seconds: float) -> None:
        self.over = False
        self._end = time.monotonic() + seconds
        self._socket: socket.socket | None = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Deadline:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def later(self, seconds: float) -> None:
        """So much time more."""
        self._end += seconds

    def trace(self, event: str, info: dict[str, Any]) -> None:
        """Takes the connection from what httpcore tells."""
        if event in OPENED:
            self._socket = info["return_value"].get_extra_info("socket")
            if self.over:
                self._shut()

    def _watch(self) -> None:
        while not self._done.wait(max(self._end - time.monotonic(), 0.0)):
            if time.monotonic() >= self._end:
                self.over = True
                self._shut()
                return

    def _shut(self) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                # Not SSLSocket's own, which would take the encryption away from the one who reads.
                socket.socket.shutdown(self._socket, socket.SHUT_RDWR)
