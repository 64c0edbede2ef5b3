"""Reports in a real browser: nothing from the network, nothing wrong on the console, pictures that are there and the right
way round, controls that move together, light, dark, paper, telephone, and no serious obstacle for those who do not see."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compstiff
from compensator.correction.correct import Corrected, correct
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from identification.common.packed import packed
from identification.common.shipped import shipped
from tests.runs.reports.browser import opened
from tests.runs.reports.pages import LIKE_ANOTHER, VERDICTS

NAMES = ("correct", "predict", "budget", "identify", "diagnose", "verify", "corner", "design", "learn", "motion_identify",
         "motion_diagnose", *VERDICTS, "mistake")
AXE = Path(__file__).parent / "vendor" / "axe.min.js"
# The pixels of a canvas.
PIXELS = """canvas => {
  const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const pen = copy.getContext("2d");
  pen.drawImage(canvas, 0, 0);
  const bytes = pen.getImageData(0, 0, canvas.width, canvas.height).data;
  let text = "";
  for (let i = 0; i < bytes.length; i += 30000) text += String.fromCharCode(...bytes.subarray(i, i + 30000));
  return [canvas.width, canvas.height, btoa(text)];
}"""


# How many labels the stem of another one is drawn over.
STEMS_OVER_LABELS = """(() => {
  const boxes = name => [...document.querySelectorAll(name)].map(one => [one.getBoundingClientRect(),
                                                                        Number(getComputedStyle(one).zIndex)]);
  const stems = boxes(".stem");
  if (!stems.some(([box]) => box.height > 5)) return "no stem";
  return boxes(".tag.mark").filter(([label, layer]) => stems.some(([stem, under]) => under >= layer
    && label.left < stem.left && stem.left < label.right && label.top < stem.bottom && stem.top < label.bottom)).length;
})()"""


# A folder in which a picture of every report is kept for people to look at.
SCREENSHOTS = os.environ.get("COMPSTIFF_SCREENSHOTS", "")


def each_kind(names: Sequence[str], *more: str) -> list[Any]:
    """The names, those marked `long` that are like another one, or named in `more`."""
    return [pytest.param(name, marks=pytest.mark.long) if name in (*LIKE_ANOTHER, *more) else name for name in names]


def pixels(page: Any) -> np.ndarray:
    """(height, width, 3) of the view in space."""
    width, height, data = page.eval_on_selector(".stage canvas", PIXELS)
    return np.frombuffer(base64.b64decode(data), np.uint8).astype(float).reshape(height, width, 4)[:, :, :3]


def coloured(picture: np.ndarray) -> np.ndarray:
    """Where a picture is not grey."""
    return np.ptp(picture, axis=2) > 60


@pytest.mark.parametrize("name", each_kind(NAMES))
def test_no_request_no_complaint_no_overflow(browser: Any, folder: Path, name: str) -> None:
    """And no page is wider than its window, nor than a telephone or A4."""
    found = opened(browser, folder / f"{name}.html")
    assert found.requests == [(folder / f"{name}.html").as_uri()]
    assert found.complaints == []
    for width, media in ((1200, "screen"), (390, "screen"), (690, "print")):
        found.page.emulate_media(media=media)
        found.page.set_viewport_size({"width": width, "height": 800})
        over = found.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        if SCREENSHOTS:
            found.page.screenshot(path=Path(SCREENSHOTS) / f"{name}-{media}-{width}.png", full_page=True)
            if (width, media) == (1200, "screen"):
                found.page.emulate_media(color_scheme="dark")
                found.page.wait_for_timeout(150)
                found.page.screenshot(path=Path(SCREENSHOTS) / f"{name}-dark-{width}.png", full_page=True)
                found.page.emulate_media(color_scheme="light")
        assert over <= 0, f"{name} is {over} px too wide for {width} px, {media}"
        cut = found.page.evaluate("[...document.querySelectorAll('.stack')].filter(one => "
                                  "one.scrollWidth > one.parentElement.clientWidth).length")
        assert not cut or width > 390, f"{name}: {cut} tables of few rows, or of sentences, are cut on a telephone"
    found.page.close()


# Long: further verdicts of `diagnose`, of which one is looked at.
@pytest.mark.parametrize("name", each_kind(NAMES, "adequate", "unknown", "mistake"))
def test_no_serious_obstacle(browser: Any, folder: Path, name: str) -> None:
    """By axe-core: names of controls, order of headings, tables, contrast."""
    look_for_obstacles(browser, folder, name, "light")


@pytest.mark.parametrize("name", each_kind(("budget", "diagnose", "design", "learn"), "design", "learn"))
def test_no_serious_obstacle_in_the_dark(browser: Any, folder: Path, name: str) -> None:
    look_for_obstacles(browser, folder, name, "dark")


def look_for_obstacles(browser: Any, folder: Path, name: str, scheme: Any) -> None:
    found = opened(browser, folder / f"{name}.html", color_scheme=scheme)
    # By DevTools, since the page lets no script in.
    found.page.evaluate(AXE.read_text(encoding="utf-8"))
    done = found.page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    assert done["testEngine"]["name"] == "axe-core"
    serious = [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in done["violations"]
               if one["impact"] in ("serious", "critical")]
    assert serious == []
    found.page.close()


def test_sentences_in_tables_have_room_on_a_telephone(browser: Any, folder: Path) -> None:
    """The table is turned sideways rather than its sentences into columns of single words."""
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((folder / "diagnose.html").as_uri())
    widths = page.locator("td.words").evaluate_all("cells => cells.map(cell => cell.clientWidth)")
    assert widths
    assert min(widths) >= 200
    page.close()


@pytest.mark.parametrize("language", [
    "en-US@posix", *(pytest.param(name, marks=pytest.mark.long) for name in ("de-DE", "ar-EG"))])
def test_the_path_is_there_in_every_language(browser: Any, folder: Path, language: str) -> None:
    """One that no page can read, as a computer without a language has it (LANG=C), a comma for the decimals, other digits."""
    said = f"Object.defineProperty(Navigator.prototype, 'language', {{ get: () => '{language}' }})"
    pages = [opened(browser, folder / "correct.html", before=said, **({} if "@" in language else {"locale": language})),
             opened(browser, folder / "correct.html")]
    assert pages[0].complaints == []
    texts, places = zip(*((
        one.page.eval_on_selector_all("figure[data-view=path]", "all => all.map(one => one.innerText)"),
        one.page.eval_on_selector("figure[data-view=path] input[type=number]", "one => Number(one.value)")) for one in pages),
        strict=True)
    assert texts[0] == texts[1]
    assert places[0] == places[1] > 0
    for one in pages:
        one.page.close()


def test_the_way_round(browser: Any, folder: Path) -> None:
    """An L, 80 along x then 30 along y, seen from above: it goes right, then up, at one scale."""
    found = opened(browser, folder / "corner.html")
    found.page.get_by_role("button", name="Top").click()
    found.page.wait_for_timeout(200)
    rows, columns = np.nonzero(coloured(pixels(found.page)))
    width, height = np.ptp(columns), np.ptp(rows)
    assert width > 200, "blank, or nothing but grey"
    assert width / height == pytest.approx(80 / 30, rel=0.05)
    left = rows[columns < columns.min() + 0.5 * width]
    assert left.min() > rows.max() - 0.1 * height, "the left half is the lower edge alone"
    upper = columns[rows < rows.min() + 0.5 * height]
    assert upper.min() > columns.max() - 0.1 * width, "the upper half is the right edge alone"
    # The same in the picture for print: from the front and the right, x goes down to the right, y up to the right.
    path = found.page.eval_on_selector(".picture path.line", "one => one.getAttribute('d')")
    (x0, y0), (x1, y1), (x2, y2) = [tuple(map(float, pair)) for pair in re.findall(r"([\d.]+) ([\d.]+)", path)]
    assert x1 > x0
    assert y1 > y0
    assert x2 > x1
    assert y2 < y1
    found.page.close()


def test_picture_plot_and_line_move_together(browser: Any, folder: Path, sample: Corrected) -> None:
    """The readout is the program's own line with that number, the target's place and its value as the library gives them."""
    found = opened(browser, folder / "correct.html")
    page = found.page
    program = sample.planned.program.text.source.data.decode().splitlines()
    predicted = sample.predicted
    size, left = 1e6 * np.linalg.norm(predicted.prediction.position, axis=1), 2e6 * sample.left.std
    toolpath = predicted.path.toolpath
    most = predicted.targets[int(np.argmax(left))]
    readout, slider = page.locator(".readout"), page.get_by_label("Along the path", exact=True)

    def where() -> tuple[int, int]:
        line, target = re.findall(r"Line (\d+), target (\d+)", readout.inner_text())[0]
        assert readout.locator("code").inner_text() == program[int(line) - 1].strip()[:160]
        return int(line), int(target)

    assert where() == (toolpath.line[most], toolpath.number[most]), "it begins where most is left"
    assert page.locator(".choices label:has(:checked)").inner_text() == "Expected left"
    assert f"Expected left {left.max():.1f} µm" in readout.inner_text().replace("\n", " ")
    before = pixels(page)
    assert coloured(before).sum() > 3000, "the cut is drawn in colour"
    slider.press("End")
    last = len(toolpath) - 1
    assert where() == (toolpath.line[last], toolpath.number[last])
    x, y, z = 1e3 * predicted.path.base_from_tcp.position[last]
    assert f"{x:.2f}" in readout.inner_text().replace("\u202f", "")
    assert f"{z:.2f}" in readout.inner_text().replace("\u202f", "")
    assert y == pytest.approx(page.evaluate("document.querySelector('figure').view.place.at(-1)[1]"), abs=1e-3)
    page.get_by_label("Line", exact=True).fill("700")
    page.keyboard.press("Enter")
    assert abs(where()[0] - 700) <= 1
    # Another quantity: other colours, its own scale, its own largest place.
    page.locator(".choices label", has_text="Deviation").click()
    at = predicted.targets[int(np.argmax(size))]
    button = page.locator("button.largest")
    assert button.inner_text() == f"Largest: {size.max():.1f} µm, line {toolpath.line[at]}"
    button.click()
    assert where()[0] == toolpath.line[at]
    page.wait_for_timeout(200)
    assert (np.abs(pixels(page) - before).max(axis=2) > 40).sum() > 1000
    # A finding leads to its line.
    finding = page.locator("button.show-place").first
    line = int(re.findall(r"\d+", finding.get_attribute("aria-label"))[0])
    finding.click()
    assert where()[0] == line
    # A click on the plot goes there.
    box = page.locator(".u-over").bounding_box()
    page.mouse.click(box["x"] + 0.02 * box["width"], box["y"] + 0.5 * box["height"])
    assert where()[0] < 400
    assert found.complaints == []
    page.close()


@pytest.mark.parametrize("width", [1200, 390])
def test_labels_in_space_can_be_read(browser: Any, folder: Path, width: int) -> None:
    """Each on a ground of its own, whole, and clear of the others, from every side."""
    found = opened(browser, folder / "correct.html", width=width)
    for side in ("Oblique", "Top", "Front", "Side"):
        found.page.get_by_role("button", name=side).click()
        found.page.wait_for_timeout(150)
        stage = found.page.locator(".stage").bounding_box()
        boxes = [one.bounding_box() for one in found.page.locator(".tag.mark").all()]
        assert len(boxes) >= 2
        for place, box in enumerate(boxes):
            assert stage["x"] <= box["x"] <= stage["x"] + stage["width"] - box["width"], side
            assert stage["y"] <= box["y"] <= stage["y"] + stage["height"] - box["height"], side
            for other in boxes[:place]:
                apart = (abs(box["x"] - other["x"]) >= min(box["width"], other["width"])
                         or abs(box["y"] - other["y"]) >= box["height"])
                assert apart, f"two labels on each other, {side}"
        assert found.page.evaluate(STEMS_OVER_LABELS) == 0, side
    names = found.page.locator(".tag.mark").all_inner_texts()
    assert len(set(names)) == len(names), f"one label a line: {names}"
    below = found.page.locator(".hint").bounding_box()["y"] >= stage["y"] + stage["height"]
    assert below == (width < 640), "on a telephone the hint covers nothing"
    ground = found.page.eval_on_selector(".tag.mark", "one => getComputedStyle(one).backgroundColor")
    assert ground == "rgb(255, 255, 255)"
    found.page.close()


def test_what_is_over_the_tolerance_is_marked_each(browser: Any, folder: Path, sample: Corrected) -> None:
    """A single target among thousands is no line that anyone sees: each stretch over it has a mark, where it is most over."""
    found = opened(browser, folder / "budget.html")
    std = np.zeros(len(sample.predicted.path.toolpath))
    std[sample.predicted.targets] = 2e6 * sample.left.std
    first = np.flatnonzero(np.diff(np.r_[0, (std > 50.0).astype(int), 0]) == 1)
    assert 1 < len(first) < len(std) / 10
    marks = "document.querySelector('figure[data-view]').view.over"
    assert found.page.evaluate(f"{marks}.geometry.attributes.position.count") == len(first)
    places = np.array(found.page.evaluate(f"Array.from({marks}.geometry.attributes.position.array)")).reshape(-1, 3)
    most = 1e3 * sample.predicted.path.base_from_tcp.position[int(np.argmax(std))]
    assert np.abs(places - most).max(axis=1).min() < 0.01
    found.page.locator(".choices label", has_text="Deviation").click()
    assert found.page.evaluate(f"{marks} === null")
    found.page.close()


def test_paper_begins_with_answer_command_and_picture(browser: Any, folder: Path) -> None:
    """All three on the first sheet of A4 (269 mm high within its margins)."""
    found = opened(browser, folder / "correct.html", width=688)
    found.page.emulate_media(media="print")
    bottom = found.page.locator("figure").first.bounding_box()
    assert bottom["y"] + bottom["height"] <= 269 / 25.4 * 96
    names = found.page.locator(".picture text.mark").all_text_contents()
    assert any(name.startswith("largest, line ") for name in names)
    found.page.close()


def test_keys_turn_the_view(browser: Any, folder: Path) -> None:
    found = opened(browser, folder / "correct.html")
    before = pixels(found.page)
    found.page.locator(".stage canvas").focus()
    for _ in range(4):
        found.page.keyboard.press("ArrowRight")
    found.page.wait_for_timeout(200)
    assert (np.abs(pixels(found.page) - before).max(axis=2) > 40).sum() > 1000
    found.page.close()


def test_light_and_dark(browser: Any, folder: Path) -> None:
    """As the system is, and by the switch; the view in space follows."""
    for scheme, dark in (("dark", True), ("light", False)):
        found = opened(browser, folder / "correct.html", color_scheme=scheme)
        for _ in range(2):
            ground = found.page.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (sum(map(int, re.findall(r"\d+", ground)[:3])) < 200) == dark
            found.page.wait_for_timeout(150)
            assert (pixels(found.page)[5, 5].sum() < 300) == dark
            found.page.locator("#theme").click()
            dark = not dark
        found.page.close()


@pytest.mark.parametrize("name", ["correct", "diagnose"])
def test_on_paper(browser: Any, folder: Path, name: str) -> None:
    """Pictures in place of what moves, on white, and nothing cut: no chart is higher than a page."""
    found = opened(browser, folder / f"{name}.html", color_scheme="dark", width=690)
    found.page.emulate_media(media="print", color_scheme="dark")
    assert found.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    seen = "[...document.querySelectorAll('%s')].filter(one => one.getBoundingClientRect().height > 0)"
    assert found.page.evaluate(f"{seen % '.live, button, input'}.length") == 0
    heights = found.page.evaluate(f"{seen % 'main svg.chart, main svg.scene'}.map(one => one.getBoundingClientRect().height)")
    assert len(heights) >= 2
    assert min(heights) > 80
    assert max(heights) < 900
    assert found.page.pdf(format="A4")[:5] == b"%PDF-"
    found.page.close()


@pytest.mark.parametrize("name", each_kind(("adequate", "design", "named")))
def test_sentences_in_tables_have_room_on_paper(browser: Any, folder: Path, name: str) -> None:
    """A wide table neither squeezes its sentences into columns of single words, nor is it wider than the sheet."""
    found = opened(browser, folder / f"{name}.html", width=688)
    found.page.emulate_media(media="print")
    found.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    widths = found.page.locator("th.words, td.words").evaluate_all(
        "cells => cells.map(cell => cell.clientWidth).filter(width => width)")
    assert min(widths, default=200) >= 130
    over = found.page.locator("main table").evaluate_all(
        "all => Math.max(...all.map(one => one.getBoundingClientRect().right)) - document.documentElement.clientWidth")
    assert over <= 0
    found.page.close()


def test_paper_has_what_the_page_folds(browser: Any, folder: Path) -> None:
    """Tables and further steps are open while it is printed, and folded again."""
    found = opened(browser, folder / "correct.html")
    closed = "[...document.querySelectorAll('main details:not(.numbers)')].filter(one => !one.open).length"
    before = found.page.evaluate(closed)
    assert before > 0
    found.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert found.page.evaluate(closed) == 0
    found.page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert found.page.evaluate(closed) == before
    found.page.close()


@pytest.mark.parametrize("name", each_kind(["correct", "mistake", "named"]))
def test_a_command_is_there_without_a_click(browser: Any, folder: Path, name: str) -> None:
    found = opened(browser, folder / f"{name}.html")
    assert found.page.locator(".next > .command code").first.is_visible()
    found.page.close()


def test_the_numbers_of_a_chart(browser: Any, folder: Path) -> None:
    """Folded below it; as long as its bars are."""
    found = opened(browser, folder / "adequate.html")
    figure = found.page.locator("section", has=found.page.get_by_role("heading", name="By pose")).locator("figure")
    assert not figure.locator("table").is_visible()
    figure.locator("summary").click()
    shown = figure.locator("tbody td:nth-child(2)").all_inner_texts()
    heights = figure.locator(".wide rect").evaluate_all("all => all.map(one => Number(one.getAttribute('height')))")
    assert len(shown) == len(heights) == 20
    numbers = np.array([float(text) for text in shown])
    assert np.array(heights) / max(heights) == pytest.approx(numbers / numbers.max(), abs=2e-3)
    found.page.close()


def test_without_webgl_the_picture_stays(launch: Callable[..., Any], folder: Path) -> None:
    browser = launch("--disable-3d-apis")
    page = browser.new_page()
    page.goto((folder / "correct.html").as_uri())
    page.wait_for_timeout(300)
    assert page.locator(".picture svg").is_visible()
    assert not page.locator(".live").is_visible()
    browser.close()


def test_a_command_is_copied(browser: Any, folder: Path) -> None:
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto((folder / "predict.html").as_uri())
    page.locator("button.copy").first.click()
    page.get_by_text("Command copied").wait_for(state="attached")
    command = page.locator(".command code").first.inner_text()
    assert command.startswith("compstiff correct ")
    assert page.evaluate("navigator.clipboard.readText()") == command
    context.close()


def test_the_reports_of_one_program_agree(sample_inputs: Inputs) -> None:
    """`predict` and `correct` tell the same of the program as it was given, whatever the correction added to it."""
    planned = predict_files(replace(sample_inputs, cell=shipped("samples") / "cell.yaml"), Settings.of(tare=((0, 2),)))
    corrected = correct(planned)
    assert corrected.as_dict()["added_targets"] > 100
    texts = [compstiff.report(job).replace("\xa0", " ") for job in (planned, corrected)]
    for pattern in (r"largest; RMS (\d+)", r"(\d+ of \d+) targets of \S+ carry force",
                    r"by up to (\d+ µm \(\d+ µm RMS\)); that"):
        first, second = (re.findall(pattern, text) for text in texts)
        assert first == second != [], pattern


def test_what_makes_most_of_it_uncertain_is_said_first(folder: Path, sample: Corrected) -> None:
    """Of a program whose cut nobody stated: in the verdict, before its warnings, and as the first step."""
    left = sample.left.as_dict()
    assert left["cut"] > 0.5 * left["rms"]
    text = (folder / "correct.html").read_text(encoding="utf-8")
    order = [text.index(words) for words in ("BUT THE CUT IS NOT STATED", "nobody stated the cut", "compstiff verify")]
    assert order == sorted(order)


def test_every_verdict_of_diagnose_is_looked_at(results: dict[str, Any]) -> None:
    """The pages are of the verdicts that they are named by."""
    found = {name: results[name].verdict for name in (*VERDICTS, "mistake") if name in results}
    assert found == {name: name for name in found}
    assert {"adequate", "unknown", "mistake"} <= set(found)


def test_the_signature_calls_noise_only_what_is_noise(results: dict[str, Any]) -> None:
    """Where a cause is named and more is left than noise makes, the picture says so as the words do."""
    diagnosis = results["diagnose"]
    assert diagnosis.verdict == "named"
    assert "The scatter about it is noise." in compstiff.report(diagnosis)
    more = compstiff.report(replace(diagnosis, judgement=replace(diagnosis.judgement, law_differs=True)))
    assert "something smaller is at work beside it" in more
    assert "The scatter about it is noise." not in more


def test_what_the_tolerance_is_spent_on_ends_where_the_cut_ends(browser: Any, folder: Path, results: dict[str, Any]) -> None:
    """Not over the air between two cuts: the widest of these gaps is empty in the chart."""
    path, targets = results["budget"].corrected.predicted.path, results["budget"].corrected.predicted.targets
    length = path.length[targets]
    gap = int(np.argmax(np.diff(length)))
    found = opened(browser, folder / "budget.html")
    chart = found.page.locator("section", has=found.page.get_by_role("heading", name="What the tolerance is spent on"))
    lines = chart.locator(".wide path.line.stroke-ink, .wide path.line.stroke-s2").evaluate_all(
        "all => all.map(one => one.getAttribute('d'))")
    assert len(lines) == 2
    for line in lines:
        stretches = [np.array(re.findall(r"[-\d.]+", part), dtype=float)[::2] for part in line.split("M")[1:]]
        across = np.concatenate(stretches)
        place = across.min() + (np.array([length[gap], length[gap + 1]]) - length[0]) / np.ptp(length) * np.ptp(across)
        middle = place.mean()
        assert np.ptp(place) > 5
        assert not any(part.min() < middle < part.max() for part in stretches)
    found.page.close()


def test_the_name_of_a_column_stays_as_it_is(folder: Path) -> None:
    text = (folder / "mistake.html").read_text(encoding="utf-8")
    sentence = re.findall(r'<span class="sentence">(\w+)', text)
    assert sentence == ["dx"]


def test_numbers_arrive_as_they_were_packed(browser: Any, folder: Path) -> None:
    """Python packs, the browser unpacks: whole steps, gaps, and steps over all 32 bits."""
    found = opened(browser, folder / "corner.html")
    rng = np.random.default_rng(3)
    values = np.concatenate([rng.normal(0, 1e3, (40, 3)), [[2.1e6, -2.1e6, np.nan], [-2.1e6, 2.1e6, 0.0], [np.inf, 3e6, 1e-9]]])
    got = found.page.evaluate("async text => Array.from(await integers(text, 3))", packed(values, 1e-3))
    expected = [[-2**31 if not np.isfinite(v) or abs(v) > 2.147e6 else int(np.rint(v / 1e-3)) for v in column]
                for column in values.T]
    assert np.array(got).reshape(3, -1).tolist() == expected
    found.page.close()
