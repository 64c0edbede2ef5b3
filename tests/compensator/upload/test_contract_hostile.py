"""What stands in a controller's place after the first challenge: answers without an end, packed ones, and sent elsewhere."""

import contextlib
import gzip
import socket
import threading
import tracemalloc
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost
from compensator.upload.session import Session


class Digest(BaseHTTPRequestHandler):
    """Asks for a digest. `greeted`: what a login gets; `challenged`: the second challenge, which HTTPX reads by itself."""

    asked = 0

    def do_GET(self):
        type(self).asked += 1
        if self.headers.get("Authorization"):
            self.greeted()
        elif self.asked > 1:
            self.challenged()
        else:
            self.challenge(("Content-Length", "0"))

    def challenge(self, *more):
        self.send_response(401)
        for name, value in (("WWW-Authenticate", 'Digest realm="x", nonce="y", qop="auth"'), *more):
            self.send_header(name, value)
        self.end_headers()

    def challenged(self):
        self.challenge(("Content-Length", "0"))

    def log_message(self, *_):
        return


@contextlib.contextmanager
def session_with(handler, timeout_s=20.0):
    """A session that got past the first challenge."""
    with HTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        port = server.server_address[1]
        with Session(Controller("127.0.0.1", "me", "secret", tls=False, port=port, timeout_s=timeout_s, retries=0)) as opened:
            yield opened
        server.shutdown()


@pytest.mark.parametrize("packed", [False, True])
def test_a_digest_challenge_without_an_end_is_not_taken_into_memory(packed):
    """Its body is read by HTTPX itself, unpacked too: a quarter of a MiB of gzip that holds a quarter of a GiB."""
    taken = []
    zeros = gzip.compress(bytes(256 << 20))

    class Endless(Digest):
        def challenged(self):
            self.challenge(*([("Content-Encoding", "gzip"), ("Content-Length", str(len(zeros)))] if packed else []))
            with contextlib.suppress(OSError):
                if packed:
                    self.wfile.write(zeros)
                for _ in range(0 if packed else 64):
                    self.wfile.write(bytes(1 << 20))
                    taken.append(1)

    tracemalloc.start()
    try:
        with session_with(Endless) as opened, pytest.raises(Lost, match="encoding" if packed else "over 4194304 bytes"):
            opened.states("/rw/system")
        assert tracemalloc.get_traced_memory()[1] < 32 << 20
    finally:
        tracemalloc.stop()
    assert len(taken) < 32


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
def test_a_controller_that_sends_elsewhere_is_not_followed(status):
    """Neither the login nor the module goes to where a redirect points, whatever is asked."""
    with socket.create_server(("127.0.0.1", 0)) as elsewhere:
        elsewhere.setblocking(False)

        class Hostile(Digest):
            def greeted(self):
                self.send_response(status)
                self.send_header("Location", f"http://127.0.0.1:{elsewhere.getsockname()[1]}/")
                self.send_header("Content-Length", "0")
                self.end_headers()

            def do_PUT(self):
                self.rfile.read(int(self.headers.get("Content-Length", 0)))
                self.greeted() if self.headers.get("Authorization") else self.challenge(("Content-Length", "0"))

        with session_with(Hostile) as opened:
            for ask in (lambda: opened.states("/rw/system"), lambda: opened.download("/fileservice/x"),
                        lambda: opened.send("/fileservice/x", b"MODULE x")):
                with pytest.raises(Answered, match=f"HTTP {status}"):
                    ask()
        # Whoever connected before the answer came stands in the queue.
        with pytest.raises(BlockingIOError):
            elsewhere.accept()


def test_nothing_of_the_environment_decides_whom_is_asked(monkeypatch, tmp_path):
    """Neither a proxy nor certificates or names that it states, of which there are none."""
    class Greeting(Digest):
        def greeted(self):
            self.send_response(200)
            body = b'{"_embedded": {"_state": [{"_type": "sys", "name": "here"}]}}'
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    for name in ("HTTP_PROXY", "http_proxy", "ALL_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    for name in ("NO_PROXY", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR", "NETRC"):
        monkeypatch.setenv(name, str(tmp_path / "none"))
    with session_with(Greeting) as opened:
        assert opened.states("/rw/system")[0]["name"] == "here"
