"""A controller, or what stands in its place, that answers a little at a time: every request ends when its time is up."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterable, Iterator

import pytest

from compensator.upload import session
from compensator.upload.address import Controller
from compensator.upload.answers import Lost
from compensator.upload.session import Session
from identification.common.findings import Refused
from tests.compensator.upload import kit

TIMEOUT_S = 0.5
HEAD = b"HTTP/1.1 200 OK\r\n"


def bytes_of(text: bytes) -> Iterator[bytes]:
    return (text[k:k + 1] for k in range(len(text)))


ANSWERS: dict[str, Callable[[], Iterable[bytes]]] = {
    "header by header": lambda: itertools.chain([HEAD], (b"X-%d: 1\r\n" % k for k in itertools.count())),
    "a header byte by byte": lambda: itertools.chain([HEAD + b"X: "], itertools.repeat(b"x")),
    "the status byte by byte": lambda: itertools.chain([b"HTTP/1.1 200 "], itertools.repeat(b"K")),
    "go on, go on": lambda: itertools.repeat(b"HTTP/1.1 100 Continue\r\n\r\n"),
    "a body byte by byte": lambda: itertools.chain([HEAD + b"Content-Length: 100000\r\n\r\n"], itertools.repeat(b"x")),
    "a body in chunks of a byte": lambda: itertools.chain(
        [HEAD + b"Transfer-Encoding: chunked\r\n\r\n"], itertools.repeat(b"1\r\nx\r\n")),
    "a body to the end of the connection": lambda: itertools.chain([HEAD + b"\r\n"], itertools.repeat(b"x")),
    "a trailer without an end": lambda: itertools.chain(
        [HEAD + b"Transfer-Encoding: chunked\r\n\r\n0\r\nX: "], itertools.repeat(b"x")),
}


@contextlib.contextmanager
def serving(parts: Iterable[bytes], tls: ssl.SSLContext | None = None) -> Iterator[int]:
    """The port of a server that takes whatever comes and answers one part after the other, ten a second."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = listener.accept()
                with contextlib.suppress(OSError), tls.wrap_socket(client, server_side=True) if tls else client as client:
                    client.recv(1 << 16)
                    for part in parts:
                        client.sendall(part)
                        time.sleep(0.1)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        with contextlib.suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


@pytest.mark.parametrize("answer", ANSWERS.values(), ids=ANSWERS)
def test_an_answer_that_only_drips_is_lost_when_its_time_is_up(answer: Callable[[], Iterable[bytes]]) -> None:
    with serving(answer()) as port:
        controller = Controller("127.0.0.1", "user", "secret", tls=False, port=port, timeout_s=TIMEOUT_S, retries=0)
        before = time.monotonic()
        with pytest.raises(Lost, match="end|timed out"), Session(controller):
            pass
        assert time.monotonic() - before < 10 * TIMEOUT_S


def test_over_tls_too() -> None:
    with serving(ANSWERS["a header byte by byte"](), kit.server_context()) as port:
        shown = ssl.PEM_cert_to_DER_cert(ssl.get_server_certificate(("127.0.0.1", port)))
        controller = Controller("127.0.0.1", "user", "secret", port=port, timeout_s=TIMEOUT_S, retries=0,
                                fingerprint=hashlib.sha256(shown).hexdigest())
        with pytest.raises(Lost, match="end"), Session(controller):
            pass


def test_a_file_may_take_as_long_as_its_size_asks_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three times the time for an answer, at twice the least rate."""
    monkeypatch.setattr(session, "LEAST_RATE", 1000)
    parts = [HEAD + b"Content-Length: 3000\r\n\r\n", *[b"x" * 200] * 15]
    with serving(parts) as port:
        controller = Controller("127.0.0.1", "user", "secret", tls=False, port=port, timeout_s=TIMEOUT_S, retries=0)
        with pytest.raises(Refused, match="asks for no password"), Session(controller):
            pass
