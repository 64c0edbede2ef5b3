"""Whom the password is given to: never without TLS in clear, never to a certificate that is not believed, never to a proxy."""

import hashlib
import socket
import ssl
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
import trustme

from compensator.upload import session
from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost, refusal, xhtml_states
from compensator.upload.session import Session
from tests.compensator.upload import kit
from tests.compensator.upload.emulator import Emulator, RobotController


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(session, "LEAST_INTERVAL_S", 0.0)
    monkeypatch.setattr(session, "FIRST_PAUSE_S", 0.002)


@pytest.fixture
def omnicore(tmp_path):
    controller = RobotController(2)
    with Emulator(controller, kit.server_context()) as emulator:
        yield controller, emulator.port


def fingerprint(port: int) -> str:
    shown = ssl.get_server_certificate(("127.0.0.1", port))
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(shown)).hexdigest()


def test_an_unknown_certificate_is_refused_and_its_fingerprint_shown(omnicore, tmp_path):
    controller, port = omnicore
    file = kit.write_module(tmp_path)
    refused = kit.call(kit.cell_yaml(tmp_path, port, "user: me"), file)
    assert (refused.code, refused.codes, controller.logins) == (3, ["CS6107"], [])
    assert fingerprint(port) in refused.text
    pinned = kit.call(kit.cell_yaml(tmp_path, port, f"fingerprint: '{fingerprint(port)}'"), file, "--apply")
    assert pinned.code == 0, pinned.text


@pytest.mark.parametrize("form", [str.upper, lambda text: ":".join(text[k:k + 2] for k in range(0, 64, 2))])
def test_a_fingerprint_in_any_form(omnicore, tmp_path, form):
    _, port = omnicore
    cell = kit.cell_yaml(tmp_path, port, f"fingerprint: '{form(fingerprint(port))}'")
    assert kit.call(cell, kit.write_module(tmp_path)).code == 0


@pytest.mark.parametrize("wrong", ["0" * 63, "0" * 65, "g" + "0" * 63, ""])
def test_a_fingerprint_that_is_none_is_refused_with_its_line(omnicore, tmp_path, wrong):
    _, port = omnicore
    refused = kit.call(kit.cell_yaml(tmp_path, port, f"fingerprint: '{wrong}'"), kit.write_module(tmp_path))
    assert (refused.code, refused.codes) == (1, ["CS0102"])
    assert "must be the SHA-256 of the certificate: 64 hexadecimal digits, colons allowed" in refused.text


def test_another_certificate_than_the_pinned_one_gets_nothing(omnicore, tmp_path):
    controller, port = omnicore
    wrong = fingerprint(port)[:-1] + ("0" if fingerprint(port)[-1] != "0" else "1")
    refused = kit.call(kit.cell_yaml(tmp_path, port, f"fingerprint: '{wrong}'"), kit.write_module(tmp_path), "--apply")
    assert (refused.code, refused.codes, controller.logins, controller.files) == (3, ["CS6107"], [], {})


def test_the_host_of_a_certificate_counts(tmp_path):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    kit.authority().issue_cert("another.plant").configure_cert(context)
    kit.authority().cert_pem.write_to_path(str(tmp_path / "ca.pem"))
    controller = RobotController(2)
    with Emulator(controller, context) as emulator:
        refused = kit.call(kit.cell_yaml(tmp_path, emulator.port, "ca: ca.pem"), kit.write_module(tmp_path))
    assert (refused.codes, controller.logins) == (["CS6107"], [])
    trustme.CA().cert_pem.write_to_path(str(tmp_path / "ca.pem"))
    assert kit.call(kit.cell_yaml(tmp_path, 9, "ca: cell.yaml"), kit.write_module(tmp_path)).codes == ["CS6107"]


def test_a_password_in_clear_text_is_refused(tmp_path):
    controller = RobotController(2)
    with Emulator(controller) as emulator:      # basic, without TLS
        refused = kit.call(kit.cell_yaml(tmp_path, emulator.port), kit.write_module(tmp_path), "--apply")
    assert (refused.code, refused.codes) == (3, ["CS6108"])
    assert [kind for kind in controller.logins if kind] == []


@pytest.mark.parametrize(("status", "headers"), [(200, {}), (401, {"WWW-Authenticate": "Negotiate"}), (401, {}), (404, {}),
                                                 (302, {"Location": "http://127.0.0.1:1/"})])
def test_what_speaks_no_rws_is_told_so(tmp_path, status, headers):
    seen = []

    class Other(BaseHTTPRequestHandler):
        def do_GET(self):
            seen.append(self.headers.get("Authorization"))
            self.send_response(status)
            for name, value in headers.items():
                self.send_header(name, value)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_):
            return

    with HTTPServer(("127.0.0.1", 0), Other) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        refused = kit.call(kit.cell_yaml(tmp_path, server.server_address[1]), kit.write_module(tmp_path))
        server.shutdown()
    assert (refused.code, refused.codes, set(seen)) == (3, ["CS6108"], {None})


def test_proxies_of_the_environment_are_not_used(tmp_path):
    controller, file = RobotController(1), kit.write_module(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as listener, kit.emulated(tmp_path, controller) as cell:
        listener.settimeout(0.2)
        elsewhere = f"http://127.0.0.1:{listener.getsockname()[1]}"
        done = kit.call(cell, file, environment={**kit.ENVIRONMENT, "HTTP_PROXY": elsewhere, "ALL_PROXY": elsewhere,
                                                 "http_proxy": elsewhere})
        assert done.code == 0, done.text
        with pytest.raises(TimeoutError):
            listener.accept()


def test_endless_and_packed_answers_end(tmp_path, monkeypatch):
    monkeypatch.setattr(session, "MOST_ANSWER", 10_000)
    sent, packed = [], threading.Event()

    class Endless(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(401)
            self.send_header("WWW-Authenticate", 'Digest realm="x", nonce="y"')
            if packed.is_set():
                self.send_header("Content-Encoding", "gzip")
            self.end_headers()
            try:
                for _ in range(10_000):
                    self.wfile.write(b"x" * 1000)
                    sent.append(1)
            except OSError:
                pass

        def log_message(self, *_):
            return

    for _ in range(2):
        with HTTPServer(("127.0.0.1", 0), Endless) as server:
            threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
            refused = kit.call(kit.cell_yaml(tmp_path, server.server_address[1]), kit.write_module(tmp_path), "--apply",
                               "--retries", 0)
            server.shutdown()
        assert (refused.code, refused.codes) == (4, ["CS6109"])
        packed.set()
    assert len(sent) < 20_000


@pytest.mark.parametrize(("status", "code", "meant"), [
    (399, -1, False), (400, -1, True), (404, 5, True), (499, 5, True), (500, 5, False), (503, -1, False), (404, None, False)])
def test_a_refusal_is_the_controller_s_own(status, code, meant):
    """A client's error with the controller's own code; what stands between, or a server that fails, says nothing of what was
    done."""
    assert Answered(status, code).meant is meant


@pytest.mark.parametrize(("code", "number"), [
    ("-1073445865", -1073445865), ("12", 12), ("--5", None), ("5" * 5000, None), ("", None), ("x", None), ("\u0665", None)])
def test_a_code_that_is_no_number_is_none(code, number):
    """Nor is one that is longer than any."""
    found = refusal(403, f'{{"status": {{"code": "{code}", "msg": "no"}}}}'.encode())
    assert (found.status, found.code) == (403, number)
    assert str(found) == f"HTTP 403: no{'' if number is None else f' ({number})'}"
    empty = refusal(403, b'{"status": {"code": null, "msg": null}}')
    assert (str(empty), empty.code) == ("HTTP 403", None)


@pytest.mark.parametrize("piece", ["<a b=", "<a ", "<!--", "<![CDATA[", "<!", "<?", "&", "<a b='"])
def test_a_page_that_opens_and_opens_is_over_soon(piece):
    """As large as an answer may be, the parser would look through the rest of it at every piece."""
    body = (piece * (session.MOST_ANSWER // len(piece))).encode()
    before = time.process_time()
    assert refusal(403, body).status == 403
    with pytest.raises(Lost):
        xhtml_states(body)
    assert time.process_time() - before < 3


def test_text_belongs_to_the_state_it_stands_in():
    """What stands outside of every state, or in a span of no name, belongs to none."""
    body = (b'<html><body><span class="a">out</span>between<ul><li class="one" title="t"><span class="a">in &amp; on</span>'
            b'<span>nameless</span>bare</li>bare<span class="a">out</span><li class="two"></li></ul></body></html>')
    assert xhtml_states(body) == [{"_type": "one", "_title": "t", "a": "in & on"}, {"_type": "two", "_title": ""}]


@pytest.mark.parametrize("asked", ['algorithm=FOO', 'qop="auth-int"'])
def test_a_digest_that_is_not_known_is_said(asked):
    class Odd(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(401)
            self.send_header("WWW-Authenticate", f'Digest realm="r", nonce="n", {asked}')
            self.end_headers()

        def log_message(self, *_):
            return

    with HTTPServer(("127.0.0.1", 0), Odd) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        controller = Controller("127.0.0.1", "user", "secret", tls=False, port=server.server_address[1], retries=0)
        with pytest.raises(Lost, match="digest that is not known"), Session(controller) as opened:
            opened.states("/rw/system")
        server.shutdown()
