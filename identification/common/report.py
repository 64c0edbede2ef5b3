"""The report frame both packages use: one HTML file that opens offline, its answer first."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from markupsafe import Markup, escape

from identification.common.chart import Figure
from identification.common.chart_numbers import chart_numbers
from identification.common.chart_svg import drawn, legend
from identification.common.findings import Finding, fold
from identification.common.findings import Level as FindingLevel
from identification.common.typeset import typeset

FILES = Path(__file__).parent / "report_files"
ORDER: tuple[FindingLevel, ...] = ("error", "warning", "note")
# An option of a command keeps its hyphens in one line.
OPTION = re.compile(r"(?<![\w-])(--?[a-z][a-z-]*)(?![\w-])")
# A table of more rows is folded.
FOLDED = 12
# A cell of more characters holds words and may break; a telephone stacks the rows of a wide table of no more of them.
WORDS, FEW_ROWS = 40, 8
# Drawn: not every font has such characters. The signs are strokes in a square of 24.
ARROW = '<svg class="arrow" role="img" aria-label="to" viewBox="0 0 22 12"><path d="M1 6h19M15 1l5 5-5 5"/></svg>'
SIGNS = {"good": "M4 13l5.5 5.5L20 6", "caution": "M12 3v12M12 19v2", "bad": "M5 5l14 14M19 5L5 19", "open": "M12 9v12M12 3v2"}
SIGN_OF: dict[FindingLevel, str] = {"error": SIGNS["bad"], "warning": SIGNS["caution"], "note": SIGNS["open"]}
Level = Literal["good", "caution", "bad", "open"]


@dataclass(frozen=True)
class Verdict:
    """The answer: level gives colour and sign, word says the same to those who see neither, then one sentence."""

    level: Level
    word: str
    sentence: str

    @property
    def sign(self) -> str:
        """Strokes beside the colour, for those who do not see it."""
        return SIGNS[self.level]


@dataclass(frozen=True)
class Key:
    """A figure that matters, as it is shown; note: what it is compared with."""

    label: str
    value: str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True)
class Step:
    """What to do next; command: to copy, "" where none does it."""

    words: str
    command: str = ""


@dataclass(frozen=True)
class ReportTable:
    """A real HTML table; `numbers` are the columns set right-aligned."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: Sequence[int] = field(default=())

    @property
    def stacked(self) -> bool:
        """Whether a telephone shows each row as a block, its cells under each other: where no screen so narrow holds a row, and
        there are few of them or they have sentences."""
        wide = len(self.header)
        if any(len(cell) > WORDS for row in self.rows for cell in row[wide < 4:]):      # of three columns the first may break
            return True
        return wide > 4 and len(self.rows) <= FEW_ROWS


@dataclass(frozen=True)
class View:
    """Something in space. kind: what draws it in a browser that can ("scene", "path", "" for the picture alone), from data
    (JSON values); picture: the same as SVG, for print and for other browsers. marks: the findings (places in the folded
    findings of the page) that it can show."""

    title: str
    caption: str
    kind: Literal["scene", "path", ""]
    data: dict[str, Any]
    picture: Markup
    marks: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Page:
    """A report. first: drawn above the words and tables; others: below them. result: what `--json` shows, embedded."""

    title: str
    verdict: Verdict
    keys: Sequence[Key]
    steps: Sequence[Step]
    words: Sequence[str]
    tables: Sequence[ReportTable]
    first: Sequence[Figure | View]
    others: Sequence[Figure | View]
    findings: Sequence[Finding]
    result: dict[str, Any]


def _marked(text: str) -> Markup:
    """The text typeset and escaped, its arrows drawn, its options unbroken."""
    return _unbroken(typeset(text)).replace("→", Markup(ARROW))


def _unbroken(text: str) -> Markup:
    """The text escaped, each option of a command in one piece."""
    return Markup(OPTION.sub(r'<span class="option">\1</span>', str(escape(text))))


def render(page: Page) -> str:
    """The page as HTML; everything in it is escaped, the JSON result holds no `<`. A file's name may hold what is no UTF-8: it
    stands as it would in Python."""
    import jinja2

    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    environment.filters |= {"typeset": _marked, "plain": typeset, "unbroken": _unbroken}
    # The worst first; each keeps its place among the folded, by which views know it.
    findings = sorted(enumerate(fold(tuple(page.findings))), key=lambda item: ORDER.index(item[1].level))
    items = (*page.first, *page.others)
    shown = [_shown(item, number) for number, item in enumerate(items)]
    kinds = {item.kind for item in items if isinstance(item, View)} - {""}
    scripts, styles, made_with = [], [_file("report.css")], ""
    if kinds:
        scripts, made_with = [_file("vendor/three.min.js"), _file("scene.js")], "three.js"
    if "path" in kinds:
        scripts += [_file("vendor/uPlot.iife.min.js"), _file("path_view.js")]
        styles.append(_file("vendor/uPlot.min.css"))
        made_with += " and uPlot"
    text: str = environment.from_string(_file("report.html.j2")).render(
        page=page, first=shown[:len(page.first)], others=shown[len(page.first):], folded=FOLDED, words=WORDS,
        findings=findings, signs=SIGN_OF, levels=_levels(page.findings), placed=frozenset().union(*(
            item.marks for item in items if isinstance(item, View))), result=embedded(page.result), styles="\n".join(styles),
        script=_file("report.js"), scripts=scripts, made_with=made_with, version=version("compstiff"))
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def count_words(findings: Sequence[Finding], *levels: str) -> str:
    """The findings of these levels in words: "2 warnings"; "" for none."""
    return ", ".join(_levels([finding for finding in findings if finding.level in levels]))


def embedded(content: Any) -> str:
    """JSON that may stand inside a script element, whatever it holds: no `<` is left in it; NaN becomes null."""
    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: plain(item) for key, item in value.items()}
        if isinstance(value, np.ndarray):
            return plain(value.tolist())
        if isinstance(value, list | tuple):
            return [plain(item) for item in value]
        if isinstance(value, float | np.floating):
            return float(value) if np.isfinite(value) else None
        return value.item() if isinstance(value, np.generic) else value

    return json.dumps(plain(content), allow_nan=False).replace("<", "\\u003c")


def _levels(findings: Sequence[Finding]) -> list[str]:
    """"1 error", "2 warnings", the worst first."""
    counts = Counter(finding.level for finding in fold(tuple(findings)))
    return [f"{counts[level]} {level}{'s' if counts[level] > 1 else ''}" for level in ORDER if counts[level]]


def _shown(item: Figure | View, number: int) -> dict[str, Any]:
    """What the template needs of it."""
    same = {"title": item.title, "caption": item.caption, "number": number}
    if isinstance(item, Figure):
        return same | {"view": "", "legend": legend(item), "panels": drawn(item), "beside": item.beside,
                       "numbers": chart_numbers(item)}
    return same | {"view": item.kind, "legend": (), "panels": (), "numbers": None, "beside": False, "picture": item.picture,
                   "data": embedded(item.data | {"title": item.title})}


def _file(name: str) -> str:
    return (FILES / name).read_text(encoding="utf-8")
