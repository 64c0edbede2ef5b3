"""What a report draws of a long program is true of all of it: the extremes, the corners, the ends of each cut."""

from __future__ import annotations

import base64
import json
import re
import zlib

import numpy as np
import pytest

from compensator.correction import path_view as drawing
from compensator.correction.correct import Corrected
from compensator.correction.path_view import Quantity, components, kept_targets, path_view
from identification.common.findings import Finding

MILLION = 1_000_000


def quantity(values: np.ndarray, key: str = "q") -> Quantity:
    return Quantity(key, key, "um", values, "")


def serpentine(count: int) -> np.ndarray:
    """Rows of 1000 targets over a plane, to and fro."""
    row, along = np.divmod(np.arange(count), 1000)
    return np.column_stack([np.where(row % 2, 999 - along, along) * 0.5, row * 2.0, np.zeros(count)])


def test_the_extremes_of_a_million_targets_survive() -> None:
    """Each quantity's largest, of either sign, wherever it stands; and the file stays small."""
    rng = np.random.default_rng(41)
    quantities = []
    for number in range(8):
        values = rng.normal(0, 1, MILLION)
        values[rng.random(MILLION) < 0.3] = np.nan
        values[rng.integers(MILLION)] = (-1) ** number * (9.0 + number)
        quantities.append(quantity(values))
    kept = kept_targets(serpentine(MILLION), quantities, always=[123_457])
    assert len(kept) < 40_000
    assert 123_457 in kept
    assert {0, MILLION - 1} <= set(kept.tolist())
    for number, one in enumerate(quantities):
        assert np.nanmax(np.abs(one.values[kept])) == 9.0 + number


def test_the_corners_of_a_million_targets_survive() -> None:
    """No target of the program is farther from what is drawn than a row is from the next."""
    where = serpentine(MILLION)
    kept = kept_targets(where, [quantity(np.ones(MILLION))])
    place = np.clip(np.searchsorted(kept, np.arange(MILLION), side="right") - 1, 0, len(kept) - 2)
    start, way = where[kept[place]], where[kept[place + 1]] - where[kept[place]]
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    share = np.clip(((where - start) * way).sum(axis=1) / square, 0, 1)
    off = np.linalg.norm(where - start - share[:, None] * way, axis=1)
    assert off.max() < 2.0


def test_the_ends_of_each_cut_are_drawn() -> None:
    values = np.full(MILLION, np.nan)
    values[400_000:400_010] = 1.0
    kept = set(kept_targets(serpentine(MILLION), [quantity(values)]).tolist())
    assert {399_999, 400_000, 400_009, 400_010} <= kept


def test_a_short_program_is_drawn_whole() -> None:
    where = serpentine(500)
    assert kept_targets(where, [quantity(np.ones(500))]).tolist() == list(range(500))


def test_components_are_those_of_the_deviation(sample: Corrected) -> None:
    """Along the tool, across and along the path they make up the deviation where travel and tool are square to each other;
    the travel's component is the one along the way to the target."""
    predicted = sample.predicted
    axial, across, along = (one.values[predicted.targets] for one in components(predicted, predicted.prediction.position))
    size = 1e6 * np.linalg.norm(predicted.prediction.position, axis=1)
    position = predicted.path.base_from_tcp.position
    way = position[predicted.targets] - position[predicted.targets - 1]
    tool = predicted.path.base_from_tcp.rotation[predicted.targets][:, :, 2]
    moved = np.linalg.norm(way, axis=1) > 1e-6
    way = way / np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
    expected = 1e6 * np.sum(way * predicted.prediction.position, axis=1)
    assert along[moved] == pytest.approx(expected[moved], abs=1e-6)
    square = moved & (np.abs(np.sum(way * tool, axis=1)) < 0.02)
    assert square.sum() > 20
    assert np.hypot(np.hypot(axial, across), along)[square] == pytest.approx(size[square], rel=0.02)
    # To the left, seen along the tool's axis: for a tool that points down and travel along x that is y.
    down = square & (tool[:, 2] < -0.99) & (way[:, 0] > 0.99)
    assert down.any()
    assert across[down] == pytest.approx(1e6 * predicted.prediction.position[down, 1], abs=0.15 * size[down].max())


def test_lines_and_findings_are_those_of_the_program(sample: Corrected) -> None:
    planned = sample.planned
    toolpath, source = planned.path.toolpath, planned.program.text.source
    values = np.arange(len(toolpath), dtype=float)
    findings = [Finding("CS0001", "note", "no line"), Finding("CS0002", "warning", "here", file=source.name,
                                                             line=int(toolpath.line[700])),
                Finding("CS0003", "warning", "another file", file="elsewhere.csv", line=int(toolpath.line[700])),
                Finding("CS0004", "note", "a line without target", file=source.name, line=1)]
    view = path_view("t", "c", planned.path, [quantity(values)], planned.program.text, findings)
    texts = json.loads(zlib.decompress(base64.b64decode(view.data["texts"])))
    lines = source.data.decode(source.encoding).splitlines()
    assert [texts[k] for k in (0, 700, len(values) - 1)] == [lines[toolpath.line[k] - 1].strip()[:160] for k in (
        0, 700, len(values) - 1)]
    assert [(mark["index"], mark["finding"]) for mark in view.data["marks"]] == [(700, 1)]
    assert view.marks == {1}
    assert view.data["quantities"][0]["largest"] == {"index": len(values) - 1, "value": values[-1]}


def test_of_very_many_places_those_that_matter_keep_their_line_of_the_program(
    sample: Corrected, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some are left out, so that the report stays small: not the largest, nor one that a finding names."""
    monkeypatch.setattr(drawing, "MOST_TEXTS", 1500)
    planned = sample.planned
    toolpath, source = planned.path.toolpath, planned.program.text.source
    values = np.cos(np.arange(len(toolpath)) * 0.9 / len(toolpath))
    values[1733] = 5.0
    finding = Finding("CS0002", "warning", "here", file=source.name, line=int(toolpath.line[701]))
    view = path_view("t", "c", planned.path, [quantity(values)], planned.program.text, [finding])
    texts = json.loads(zlib.decompress(base64.b64decode(view.data["texts"])))
    lines = source.data.decode(source.encoding).splitlines()
    assert len(texts) == len(toolpath) > 1500
    for place in (0, 701, 1733):
        assert texts[place] == lines[toolpath.line[place] - 1].strip()[:160] != ""
    assert 300 < sum(bool(text) for text in texts) < 1500


def test_names_of_places_beside_each_other_do_not_cover_each_other(sample: Corrected) -> None:
    """Ten warnings within a few targets, in the picture that is printed."""
    planned = sample.planned
    toolpath, name = planned.path.toolpath, planned.program.text.source.name
    findings = [Finding(f"CS{k:04d}", "warning", "here", file=name, line=int(toolpath.line[700 + k])) for k in range(10)]
    view = path_view("t", "c", planned.path, [quantity(np.arange(len(toolpath), dtype=float))], planned.program.text, findings)
    texts = re.findall(r'class="mark" x="([-\d.]+)" y="([-\d.]+)"[^>]*>([^<]+)<', str(view.picture))
    assert len(texts) == 11
    boxes = [(float(x), float(y), 6.0 * len(words) / 2) for x, y, words in texts]
    for k, (x, y, half) in enumerate(boxes):
        assert half <= x <= 920 - half
        assert 12 <= y <= 460
        assert all(abs(y - other) >= 12 or abs(x - beside) >= half + wide for beside, other, wide in boxes[:k])
