"""What a session asks, how often and how fast, without a controller: requests that are answered here."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import httpx
import pytest

from compensator.upload import session as module
from compensator.upload.address import Controller
from compensator.upload.answers import Answered, Lost, json_states, refusal, xhtml_states
from compensator.upload.dialects import RWS_2
from compensator.upload.session import MOST_ANSWER, MOST_BYTES, Session


def given(status: int, body: bytes = b"given", headers: list[tuple[str, str]] | None = None) -> httpx.Response:
    """An answer that is still to be read."""
    return httpx.Response(status, headers=headers, stream=httpx.ByteStream(body))


class Asked(Session):
    """A session whose requests are answered by `answer`; at: when each was sent, by a clock that only waiting moves on [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, answer: Callable[[int], httpx.Response], retries: int = 3) -> None:
        super().__init__(Controller("192.0.2.1", "user", "secret", tls=False, retries=retries))
        self.requests: list[httpx.Request] = []
        self.at: list[float] = []
        self.now = 1000.0

        def sleep(seconds: float) -> None:
            self.now += seconds

        def handle(request: httpx.Request) -> httpx.Response:
            self.requests.append(request)
            self.at.append(self.now)
            return answer(len(self.requests))

        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now, sleep=sleep))
        self._client = httpx.Client(base_url=self.controller.url, transport=httpx.MockTransport(handle))

    @property
    def pauses(self) -> list[float]:
        return [round(after - before, 9) for before, after in zip(self.at, self.at[1:], strict=False)]


def busy(until: int, status: int = 503) -> Callable[[int], httpx.Response]:
    """Refuses the first requests, then gives."""
    return lambda count: given(status if count < until else 200)


@pytest.mark.parametrize("status", [500, 502, 503, 504])
@pytest.mark.parametrize("retries", [0, 3])
def test_a_busy_controller_is_asked_again_after_ever_longer_pauses(
    monkeypatch: pytest.MonkeyPatch, status: int, retries: int
) -> None:
    """As often as the controller's retries say, and no more; then it is what it was the last time."""
    asked = Asked(monkeypatch, busy(1 + retries, status), retries)
    assert asked.download("/a") == b"given"
    assert asked.pauses == [0.2, 0.4, 0.8][:retries]
    asked = Asked(monkeypatch, busy(2 + retries, status), retries)
    with pytest.raises(Answered) as caught:
        asked.download("/a")
    assert (caught.value.status, len(asked.requests)) == (status, 1 + retries)


@pytest.mark.parametrize(("call", "times"), [
    (lambda asked: asked.post("/a", {"b": "c"}), 1), (lambda asked: asked.post("/a", {"b": "c"}, repeat=True), 3),
    (lambda asked: asked.send("/a", b"text"), 3), (lambda asked: asked.delete("/a"), 3), (lambda asked: asked.states("/a"), 3)])
def test_only_what_does_no_harm_twice_is_repeated(
    monkeypatch: pytest.MonkeyPatch, call: Callable[[Session], object], times: int
) -> None:
    asked = Asked(monkeypatch, busy(9), retries=2)
    with pytest.raises(Answered):
        call(asked)
    assert len(asked.requests) == times


@pytest.mark.parametrize("status", [400, 401, 403, 404, 409, 501, 505])
def test_what_is_refused_is_not_asked_again(monkeypatch: pytest.MonkeyPatch, status: int) -> None:
    asked = Asked(monkeypatch, busy(9, status))
    with pytest.raises(Answered):
        asked.download("/a")
    assert len(asked.requests) == 1
    if status == 404:
        asked.delete("/a")      # it is not there
    else:
        with pytest.raises(Answered):
            asked.delete("/a")


def test_no_more_than_twenty_requests_a_second_are_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """To more a controller answers that it is busy; nor does it take needlessly long."""
    asked = Asked(monkeypatch, busy(0))
    for _ in range(20):
        asked.download("/a")
    assert all(1 / 20 <= pause <= 1 / 10 for pause in asked.pauses)
    asked.now += 5.0
    asked.download("/a")
    assert asked.pauses[-1] == 5.0, "who has waited already waits no more"


def test_cookies_go_with_every_further_request_whatever_they_are_for(monkeypatch: pytest.MonkeyPatch) -> None:
    cookies = [("Set-Cookie", "-http-session-=12::http.session::ab; path=/rw; domain=other"), ("Set-Cookie", "ABBCX = 7"),
               ("Set-Cookie", "novalue"), ("Set-Cookie", "=none")]
    asked = Asked(monkeypatch, lambda count: given(200, headers=cookies if count == 1 else []))
    assert asked.logged_out
    for _ in range(2):
        asked.download("/a")
    asked.__exit__()
    assert [request.headers.get("Cookie") for request in asked.requests] == [
        None, *2 * ["-http-session-=12::http.session::ab; ABBCX=7"]]
    assert (asked.requests[-1].url.path, asked.logged_out) == ("/logout", True)


def test_a_session_without_a_cookie_needs_no_logout(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = Asked(monkeypatch, busy(0))
    asked.download("/a")
    asked.__exit__()
    assert len(asked.requests) == 1


def test_each_request_has_the_types_and_the_bound_of_its_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    """A form as a form, a file as a file; of an answer as much as a file may be, of others far less."""
    asked = Asked(monkeypatch, busy(0))
    asked.dialect = RWS_2
    asked.download("/a")
    asked.send("/b", b"MODULE")
    asked.post("/c", {"module": "a b", "replace": "true"})
    asked.delete("/d")
    assert [(one.method, one.url.path, one.content, one.extensions["most_bytes"]) for one in asked.requests] == [
        ("GET", "/a", b"", MOST_BYTES), ("PUT", "/b", b"MODULE", MOST_ANSWER),
        ("POST", "/c", b"module=a+b&replace=true", MOST_ANSWER), ("DELETE", "/d", b"", MOST_ANSWER)]
    assert [one.headers.get("Content-Type") for one in asked.requests] == [
        None, RWS_2.file_type, RWS_2.form_type, RWS_2.form_type]
    assert {one.headers["Accept"] for one in asked.requests} == {RWS_2.accept}


@pytest.mark.parametrize(("sound", "found"), [(1, True), (3, True), (4, False)])
def test_half_a_list_is_asked_for_again(monkeypatch: pytest.MonkeyPatch, sound: int, found: bool) -> None:
    whole = b'{"_embedded": {"_state": [{"_type": "a", "_title": "b", "c": "d"}]}}'
    asked = Asked(monkeypatch, lambda count: given(200, whole if count >= sound else whole[:20]), retries=2)
    if found:
        assert asked.states("/a?b=c") == [{"_type": "a", "_title": "b", "c": "d"}]
    else:
        with pytest.raises(Lost):
            asked.states("/a")
    assert len(asked.requests) == min(sound, 3)
    assert {request.url.query for request in asked.requests} == {b"b=c&json=1" if found else b"json=1"}


@pytest.mark.parametrize("status", [300, 301, 304])
def test_nothing_but_an_answer_below_300_is_one(monkeypatch: pytest.MonkeyPatch, status: int) -> None:
    with pytest.raises(Answered):
        Asked(monkeypatch, busy(9, status)).download("/a")
    assert Asked(monkeypatch, lambda count: given(299, b"x")).download("/a") == b"x"


SAID = "rws_resource_rapid.cpp[593] Module is in use code:-1073442809 icode:-1"


@pytest.mark.parametrize("body", [
    f'{{"_embedded": {{"status": {{"code": -1073442809, "msg": "{SAID}"}}}}}}',
    f'{{"status": {{"code": "-1073442809", "msg": "{SAID}"}}}}',
    f'<html><div class="status"><span class="code">-1073442809</span><span class="msg">{SAID}</span></div></html>'])
def test_a_refusal_is_told_in_the_controller_s_words(body: str) -> None:
    """In either form, without the source file of its maker."""
    answer = refusal(403, body.encode())
    assert (str(answer), answer.status, answer.code) == ("HTTP 403: Module is in use (-1073442809)", 403, -1073442809)
    assert str(refusal(500, body.replace(SAID, 300 * "x").encode())) == f"HTTP 500: {200 * 'x'} (-1073442809)"
    assert str(refusal(404, b"<p>none</p>")) == str(refusal(404, b'{"a": 1}')) == "HTTP 404"


def test_states_are_their_words_and_numbers() -> None:
    """What has parts of its own is none of them."""
    states = ('[{"_type": "a", "_title": "b", "size": 17, "share": 0.5, "none": null, "parts": {"x": 1}, "list": [1]}, '
              '{"name": " T_ROB1 "}]')
    assert json_states(f'{{"_embedded": {{"_state": {states}}}}}'.encode()) == [
        {"_type": "a", "_title": "b", "size": "17", "share": "0.5"}, {"name": "T_ROB1"}]
    page = ('<html><body><ul><li class="a" title="b"><span class="size">17</span><span>no name</span></li>'
            '<li class="c"><span class="name">T_<b>ROB1</b></span></li></ul><span class="out">x</span></body></html>')
    assert xhtml_states(page.encode()) == [{"_type": "a", "_title": "b", "size": "17"}, {"_type": "c", "_title": "",
                                                                                       "name": "T_ROB1"}]
    for half in ("", "{}", '{"_embedded": {}}', '{"_embedded": {"_state": [1]}}'):
        with pytest.raises(Lost):
            json_states(half.encode())
    with pytest.raises(Lost):
        xhtml_states(page.removesuffix("</html>").encode())


@pytest.mark.parametrize(("length", "read"), [(1900, True), (4100, False)])
def test_a_tag_of_over_two_kilobytes_is_none_of_a_controller_s(length: int, read: bool) -> None:
    """Where it stands in the page is no matter."""
    for before in (0, 1500, 3000):
        page = f'<html><!--{"x" * before}--><ul><li class="a" title="{"t" * length}"><span class="b">c</span></li></ul></html>'
        if read:
            assert xhtml_states(page.encode()) == [{"_type": "a", "_title": "t" * length, "b": "c"}]
            continue
        with pytest.raises(Lost, match="a tag that does not end"):
            xhtml_states(page.encode())
