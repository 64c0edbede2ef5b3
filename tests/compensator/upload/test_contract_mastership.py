"""Mastership is given back whatever happens, and what is no sound answer is lost; a session with answers written here."""

from __future__ import annotations

import json
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import httpx
import pytest

from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost
from compensator.upload.bounded import MOST, Bounded
from compensator.upload.dialects import RWS_1, RWS_2, Dialect
from compensator.upload.remote import MastershipRefused, Remote
from compensator.upload.session import Reply, Session

OWN, BETWEEN, SERVER = Answered(403, -1073445859, "held by another"), Answered(403), Answered(500)
LOST = Lost("timed out")


class Master:
    """A session that answers the request and each release in turn with what is written here; None is done."""

    dialect = RWS_1

    def __init__(self, request: Exception | None, *releases: Exception | None) -> None:
        self.controller, self.answers, self.asked = SimpleNamespace(retries=2), [request, *releases], 0

    def post(self, path: str, form: dict[str, str], *, repeat: bool = False) -> None:
        assert ("release" in path, repeat) == (self.asked > 0, self.asked > 0)
        answer = self.answers[self.asked]
        self.asked += 1
        if answer is not None:
            raise answer


@pytest.mark.parametrize(("request_", "inside", "releases", "raised", "released"), [
    (None, None, [None], None, True),
    (None, OWN, [None], Answered, True),
    (None, LOST, [None], Lost, True),
    (None, None, [LOST], None, False),                          # whether it was given back, nobody said
    (None, None, [BETWEEN, SERVER, BETWEEN], None, False),      # asked as often as may be, never by the controller itself
    (None, None, [SERVER, OWN], None, True),                    # nothing to give back, says the controller
    (OWN, None, [], MastershipRefused, True),                   # never had
    (BETWEEN, None, [None], MastershipRefused, True),
    (BETWEEN, None, [LOST], MastershipRefused, False),
    (SERVER, None, [None], Answered, True),
    (LOST, None, [None], Lost, True),
    (LOST, None, [LOST], Lost, False)])
def test_mastership_is_given_back_unless_the_controller_says_that_there_is_none(
        request_: Exception | None, inside: Exception | None, releases: list[Exception | None], raised: type | None,
        released: bool) -> None:
    session: Any = Master(request_, *releases)
    remote = Remote(session)
    entered, stopped = False, None
    try:
        with remote.mastership():
            entered = True
            if inside:
                raise inside
    except (Lost, Answered) as reason:
        stopped = type(reason)
    assert (entered, stopped, remote.released) == (request_ is None, raised, released)
    assert session.asked == 1 + len(releases)


class Answering(Session):
    """Answers with these bodies, in turn."""

    def __init__(self, dialect: Dialect, *bodies: bytes) -> None:
        super().__init__(Controller("127.0.0.1", "user", "secret", tls=False, retries=len(bodies) - 1))
        self.dialect, self.bodies = dialect, list(bodies)

    def _once(self, *_: Any) -> Reply:
        return Reply(200, self.bodies.pop(0))


def state(**values: str) -> dict[str, bytes]:
    return {"1": json.dumps({"_embedded": {"_state": [values]}}).encode(),
            "2": ("<html><ul><li class='sys'>" + "".join(
                f"<span class='{name}'>{value}</span>" for name, value in values.items()) + "</li></ul></html>").encode()}


@pytest.mark.parametrize(("number", "dialect"), [("1", RWS_1), ("2", RWS_2)])
def test_half_an_answer_is_asked_for_again_and_then_lost(number: str, dialect: Dialect) -> None:
    whole = state(rwversion="7.10", name="cell")[number]
    half = whole[:len(whole) // 2]
    said = {"1": "an answer that is not JSON with states", "2": "an answer that is not a whole XHTML page"}[number]
    with pytest.raises(Lost, match=said):
        Answering(dialect, half, half).states("/rw/system")
    again = Remote(Answering(dialect, half, whole)).system()
    assert (again.name, again.version) == ("cell", "7.10")
    with pytest.raises(Lost, match="an answer without rwversion"):
        Remote(Answering(dialect, state(name="cell")[number])).system()


def test_a_file_that_is_not_there_is_none_and_one_that_may_not_be_read_is_told() -> None:
    def answering(status: int) -> Any:
        def download(path: str) -> bytes:
            raise Answered(status, -1)

        return SimpleNamespace(dialect=RWS_1, download=download)

    assert Remote(answering(404)).read("$HOME/part.mod") is None
    with pytest.raises(Answered, match="HTTP 403"):
        Remote(answering(403)).read("$HOME/part.mod")


@pytest.mark.parametrize(("status", "code", "meant"), [
    (400, -1, True), (399, -1, False), (499, -1, True), (500, -1, False), (400, None, False), (404, 0, True)])
def test_a_controller_means_what_it_refuses_with_a_code_of_its_own(status: int, code: int | None, meant: bool) -> None:
    """Of the statuses that are the caller's fault, and the only ones by which mastership is refused."""
    assert Answered(status, code).meant == meant
    session: Any = Master(Answered(status, code), *[None] * (not meant))
    with pytest.raises(Answered) as stopped, Remote(session).mastership():
        pass
    assert isinstance(stopped.value, MastershipRefused) == (400 <= status < 500)


class Scripted(httpx.BaseTransport, httpx.SyncByteStream):
    """Answers with these parts."""

    def __init__(self, *parts: bytes, **headers: str) -> None:
        self.parts, self.headers, self.closed = parts, headers, False

    def __iter__(self) -> Iterator[bytes]:
        yield from self.parts

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        return httpx.Response(200, headers=self.headers, stream=self)

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize(("parts", "headers", "lost"), [
    ((b"12345", b"", b"67890"), {}, ""), ((b"12345", b"67890", b"x"), {}, "an answer of over 10 bytes"),
    ((b"1" * 11,), {}, "an answer of over 10 bytes"), ((), {}, ""), ((b"1",), {"Content-Encoding": "Identity"}, ""),
    ((b"1",), {"Content-Encoding": "gzip"}, "an answer in an encoding that was not asked for")])
def test_an_answer_is_as_large_as_asked_for_at_most_in_however_many_parts(
        parts: tuple[bytes, ...], headers: dict[str, str], lost: str) -> None:
    answering = Scripted(*parts, **headers)
    asked = httpx.Request("GET", "http://127.0.0.1/", extensions={MOST: 10})

    def read() -> bytes:
        return b"".join(Bounded(answering).handle_request(asked).iter_raw())

    if not lost:
        assert read() == b"".join(parts)
        return
    with pytest.raises(Lost, match=lost):
        read()
    assert answering.closed or "over" in lost

