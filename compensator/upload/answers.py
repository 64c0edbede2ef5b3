"""What a controller answers, read: RWS 1.0 as JSON, RWS 2.0 as XHTML, both as lists of states; and its refusals."""

from __future__ import annotations

import contextlib
import json
import re
from html.parser import HTMLParser

State = dict[str, str]
# A tag is far shorter; one without an end is looked through again and again by the parser.
LONGEST_TAG = 2 << 10


class Lost(Exception):
    """No whole and sound answer."""


class Answered(Exception):
    """The controller answered that it does not do it. status: of HTTP; code: the controller's own, None where it gave none."""

    def __init__(self, status: int, code: int | None = None, message: str = "") -> None:
        self.status, self.code = status, code
        own = " ".join(part for part in (message, "" if code is None else f"({code})") if part)
        super().__init__(f"HTTP {status}{': ' if own else ''}{own}")

    @property
    def meant(self) -> bool:
        """Whether the controller itself says that it did not do it, and not something between it and here."""
        return 400 <= self.status < 500 and self.code is not None


def json_states(body: bytes) -> list[State]:
    """The states of an RWS 1.0 answer, each with its `_type` and `_title`. Raises Lost."""
    try:
        states = json.loads(body)["_embedded"]["_state"]
        return [{key: _text(value) for key, value in state.items() if isinstance(value, str | int | float)} for state in states]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as reason:
        raise Lost("an answer that is not JSON with states") from reason


def xhtml_states(body: bytes) -> list[State]:
    """The states of an RWS 2.0 answer (`li` with a class), each with its `_type` and `_title`. Raises Lost."""
    page = _page(body)
    if not page.whole:
        raise Lost("an answer that is not a whole XHTML page")
    return page.states


def refusal(status: int, body: bytes) -> Answered:
    """What an answer of 300 and above says, in whichever of the two forms; the path of the vendor's source file left out."""
    found: State = {}
    try:
        document = json.loads(body)
        status_block = document.get("status") or document["_embedded"]["status"]
        found = {"code": _text(status_block.get("code")), "msg": _text(status_block.get("msg", ""))}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        with contextlib.suppress(Lost):
            found = _page(body).status
    message = found.get("msg", "").rpartition("] ")[2].partition(" code:")[0].strip()
    code = found.get("code", "").strip()
    return Answered(status, int(code) if re.fullmatch(r"-?[0-9]{1,12}", code) else None, message[:200])


class _Page(HTMLParser):
    """States and status of an XHTML page. A parser that knows no entities but HTML's own and never fetches anything."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.states: list[State] = []
        self.status: State = {}
        self.whole = False
        self._open: State | None = None
        self._span: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = {name: value or "" for name, value in attrs}
        if tag == "li":
            self._open = {"_type": named.get("class", ""), "_title": named.get("title", "")}
            self.states.append(self._open)
        elif tag == "div" and named.get("class") == "status":
            self._open = self.status
        elif tag == "span":
            self._span = named.get("class")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        return

    def handle_endtag(self, tag: str) -> None:
        if tag in ("li", "div"):
            self._open = None
        elif tag == "span":
            self._span = None
        elif tag == "html":
            self.whole = True

    def handle_data(self, data: str) -> None:
        if self._open is not None and self._span:
            self._open[self._span] = self._open.get(self._span, "") + data


def _page(body: bytes) -> _Page:
    """Raises Lost where a tag has no end."""
    page, text = _Page(), body.decode("utf-8", errors="replace")
    for start in range(0, len(text), LONGEST_TAG):
        page.feed(text[start:start + LONGEST_TAG])
        if len(page.rawdata) > LONGEST_TAG:
            raise Lost("an answer with a tag that does not end")
    page.close()
    return page


def _text(value: object) -> str:
    return "" if value is None else str(value).strip()
