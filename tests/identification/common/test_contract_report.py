"""What comes from files stays text in a report, wherever it stands."""

from __future__ import annotations

import json
from html.parser import HTMLParser

from identification.common.findings import Finding
from identification.common.report import Figure, ReportTable, render

HOSTILE = "<!--<script></script><img src=x onerror=alert(1)>' \" </title>"


class Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.handlers: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.handlers += [name for name, _ in attrs if name.startswith("on")]

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def page_of(words: str) -> tuple[str, Page]:
    figure = Figure(words, words, [{"x": [1, 2], "name": words}], {"title": {"text": words}})
    table = ReportTable(words, [words, "b"], [[words, "1"]])
    text = render(words, [words], [table], [figure], [Finding("CS0001", "warning", words, file=words, hint=words)],
                  {"name": words, words: 1})
    page = Page()
    page.feed(text)
    return text, page


def test_nothing_from_a_file_becomes_markup() -> None:
    """The same elements whatever the words, no handler, and the embedded result is what went in."""
    text, page = page_of(HOSTILE)
    _, plain = page_of("words")
    assert page.tags == plain.tags
    assert not page.handlers
    # A script element that holds `<!--<script` does not end where it says: a browser would take the rest of the page into it.
    assert "<!--<script" not in text
    results = [json.loads(part) for part in page.text if part.strip().startswith('{"name"')]
    assert results == [{"name": HOSTILE, HOSTILE: 1}]
