"""What comes from files stays text in a report, wherever it stands; and a report keeps what it promises without a browser."""

from __future__ import annotations

import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from identification.common import report
from identification.common.chart import Axis, Bars, Figure, Line, Panel, Points, Rule
from identification.common.findings import Finding
from identification.common.report import Key, Page, ReportTable, Step, Verdict, embedded, render
from identification.common.scene import SpaceLine, scene

HOSTILE = "<!--<script></script><img src=x onerror=alert(1)>' \" </title></svg>"
VENDOR = Path(report.FILES) / "vendor"


class Markup(HTMLParser):
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


def page_of(words: str) -> tuple[str, Markup]:
    """These words in every place that takes words."""
    panel = Panel([Points(words, [1, 2], [3, 4], labels=[words, words]), Line(words, [1, 2], [1, 2]), Rule(2.0, words)],
                  Axis(words), Axis(words), words=words)
    bars = Panel([Bars(words, [1.0, 2.0])], Axis(words), Axis(categories=[words, f"{words} 2"]), sideways=True)
    view = scene(words, words, [SpaceLine(np.eye(3), "before", dots=3)])
    findings = [Finding("CS0001", "warning", words, file=words, line=3, hint=words)]
    text = render(Page(words, Verdict("good", words, words), [Key(words, words, words, words)], [Step(words, words)] * 2,
                       [words],
                       [ReportTable(words, [words, "b"], [[words, "1"]] * 2),
                        ReportTable(words, [words] * 3, [[words] * 3] * 40)],
                       [view, Figure(words, words, [panel, bars])], [Figure(words, words, [panel], beside=True)], findings,
                       {"name": words, words: 1}))
    page = Markup()
    page.feed(text)
    return text, page


def test_nothing_from_a_file_becomes_markup() -> None:
    """The same elements whatever the words, no handler, and the embedded result is what went in."""
    text, page = page_of(HOSTILE)
    _, plain = page_of(re.sub(r"\S", "w", HOSTILE))
    assert page.tags == plain.tags
    assert not page.handlers
    # A script element that holds `<!--<script` does not end where it says: a browser would take the rest of the page into it.
    assert "<!--<script" not in text
    results = [json.loads(part) for part in page.text if part.strip().startswith('{"name"')]
    assert results == [{"name": HOSTILE, HOSTILE: 1}]


@pytest.mark.parametrize(("columns", "rows", "cell", "stacked"), [
    (5, 3, "1", True), (5, 30, "1", False), (3, 3, "1", False), (2, 30, "one more pass, and its log beside the program", True),
    (5, 8, "1", True), (5, 9, "1", False), (4, 8, "1", False), (2, 30, "w" * 40, False), (2, 30, "w" * 41, True)])
def test_a_telephone_stacks_what_it_cannot_hold(columns: int, rows: int, cell: str, stacked: bool) -> None:
    """Each cell under the name of its column; a long table of numbers stays one."""
    table = ReportTable("t", [f"column {k}" for k in range(columns)], [["row", *[cell] * (columns - 1)]] * rows)
    text = render(Page("p", Verdict("good", "G", "s"), [], [], [], [table], [], [], [], {}))
    assert (text.count('data-label="column 1"') == rows) == stacked
    assert ('role="table"' in text) == stacked


@pytest.mark.parametrize(("rows", "folded"), [(12, False), (13, True)])
def test_a_table_of_over_a_dozen_rows_is_folded(rows: int, folded: bool) -> None:
    table = ReportTable("The table", ["a", "b"], [["1", "2"]] * rows)
    text = render(Page("p", Verdict("good", "G", "s"), [], [], [], [table], [], [], [], {}))
    assert ("<details><summary><h2>The table</h2> (13 rows)</summary>" in text) == folded


def test_the_answer_stands_before_everything_else_in_words_and_sign() -> None:
    text = render(Page("part.mod", Verdict("bad", "NOT ACCEPTED", "3 of 9 exceed it."), [Key("largest", "0.34", "mm")],
                       [Step("Do this:", "compstiff verify a b")], ["a sentence"], [], [], [],
                       [Finding("CS0001", "note", "n"), Finding("CS0002", "error", "e"), Finding("CS0002", "error", "e")], {}))
    order = [text.index(words) for words in ("NOT ACCEPTED", "3 of 9", "0.34", "1 error", "compstiff verify a b", "a sentence",
                                             'id="findings"', "CS0002", "CS0001")]
    assert order == sorted(order), "verdict, figures, findings by level, the command, then the rest; the worst finding first"
    assert re.search(r'<svg class="sign"[^>]*><path d="M[^"]+"/></svg>', text[:order[0]])
    words = ["3.1 -> 0.4 um"]
    arrow = render(Page("p", Verdict("good", "W", "s"), [Key("rms", "3.1 → 0.4", "um")], [], words, [], [], [], [], {}))
    assert "→" not in arrow
    drawn = r'<svg class="arrow" role="img" aria-label="to"[^>]*><path d="[^"]+"/></svg>'
    assert len(re.findall(rf"3\.1\s{drawn}\s0\.4", arrow)) == 2
    assert len({Verdict(level, "w", "s").sign for level in ("good", "caution", "bad", "open")}) == 4


def test_no_option_is_torn_at_its_hyphens() -> None:
    """In a command and in a sentence; the text stays what it was, so that it is copied whole."""
    command, words = "compstiff identify my-cell/a-b.csv -o s.json --tolerance-um 5", "see --tolerance-um, a -b and x--y"
    text = render(Page("t", Verdict("open", "w", "s"), [], [Step(words, command)], [words], [], [], [], [], {}))
    for option, times in (("-o", 1), ("--tolerance-um", 3), ("-b", 2)):
        assert text.count(f'<span class="option">{option}</span>') == times
    assert text.count('class="option"') == 6
    page = Markup()
    page.feed(text)
    assert command in "".join(page.text)
    css = (Path(report.FILES) / "report.css").read_text()
    assert ".option { white-space: nowrap; }" in css


def test_a_page_without_views_carries_no_library() -> None:
    bars = Figure("f", "", [Panel([Bars("b", [1.0])])])
    text = render(Page("t", Verdict("open", "w", "s"), [], [], [], [], [], [bars], [], {}))
    assert len(text) < 60_000
    assert "THREE" not in text


def test_no_address_is_opened() -> None:
    """No src, no link but within the page, and a policy under which a browser would load nothing."""
    text, _ = page_of("words")
    assert re.findall(r'\bsrc\s*=\s*"', text.split("<script>")[0]) == []
    assert set(re.findall(r'href="([^"]*)"', text)) == {"#findings"}
    assert "default-src 'none'" in text


@pytest.mark.parametrize("line", (VENDOR / "SHA256SUMS").read_text().splitlines())
def test_the_libraries_are_those_that_are_named(line: str) -> None:
    total, name = line.split()
    assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == total
    assert f"`{name}`" in (VENDOR / "README.md").read_text()


def test_arrays_of_a_result_are_lists_in_its_page() -> None:
    """Whatever they hold, and however deep they stand."""
    found = json.loads(embedded({"a": [np.array([[1.5, np.nan], [np.inf, -2.0]])], "n": np.arange(3)}))
    assert found == {"a": [[[1.5, None], [None, -2.0]]], "n": [0, 1, 2]}
