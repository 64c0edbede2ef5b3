"""What a report draws of a long program is true of all of it: the extremes, the corners, the ends of each cut."""

from __future__ import annotations

import base64
import itertools
import json
import re
import zlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.correction import path_view as drawing
from compensator.correction.correct import Corrected
from compensator.correction.path_view import Quantity, components, kept_targets, path_view
from identification.common.findings import Finding
from identification.common.report import View

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


# ---- small numbers, worked out by hand --------------------------------------------------------------------------------------

@pytest.mark.parametrize(("values", "largest", "limit"), [
    ([1.0, -7.0, np.nan, 3.0], 1, 7.0), ([np.nan, np.nan], None, 1.0), ([np.nan, 0.0], 1, 1.0), ([np.inf, 2.0, -2.5], 2, 2.5)])
def test_colours_end_at_the_largest_size(values: list[float], largest: int | None, limit: float) -> None:
    one = quantity(np.array(values))
    assert (one.largest, one.limit) == (largest, limit)


@pytest.mark.parametrize(("digits", "step"), [(0, 0.01), (1, 1e-3), (3, 1e-5)])
def test_values_are_kept_to_a_hundredth_of_what_is_shown(digits: int, step: float) -> None:
    assert Quantity("q", "q", "um", np.zeros(1), "", digits=digits).step == pytest.approx(step)


def unpacked(text: str, step: float, columns: int) -> np.ndarray:
    """As report.js does it."""
    data = np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=np.uint8)
    words = np.ascontiguousarray(data.reshape(4, -1).T).view("<u4").reshape(columns, -1).astype(np.int64)
    steps = (np.cumsum(words, axis=1) + 2**31) % 2**32 - 2**31
    return np.where(steps == -2**31, np.nan, steps * step).T.squeeze()


class Lines:
    """Targets, each on a line of its own, the first on line 3."""

    def __init__(self, count: int) -> None:
        self.number, self.line = np.arange(count), np.arange(count) + 3

    def __len__(self) -> int:
        return len(self.line)


def drawn(position_mm: np.ndarray, values: np.ndarray, findings: list[Finding], **more: Any) -> View:
    count = len(position_mm)
    steps = np.linalg.norm(np.diff(position_mm, axis=0), axis=1)
    path: Any = SimpleNamespace(toolpath=Lines(count), rest_from_tcp=SimpleNamespace(position=1e-3 * position_mm),
                                known=np.isfinite(position_mm).all(axis=1),
                                length=1e-3 * np.concatenate([[0], np.cumsum(np.nan_to_num(steps))]))
    words = [f"MoveL p{k};{'x' * (k == 1) * 200}" for k in range(count)]
    data = ("MODULE M\nPROC main()\n" + "\n".join(words)).encode()
    ends = np.array([k + 1 for k, one in enumerate(data) if one == 10])
    source = SimpleNamespace(name="p.mod", data=data, start=0, ends=ends,
                             text=lambda start, end: data[start:end].decode())
    text: Any = SimpleNamespace(source=source)
    return path_view("Title", "Caption.", path, [Quantity("q", "Name", "um", values, "words", **more)], text, findings)


def test_what_a_browser_gets_is_the_path_with_its_numbers() -> None:
    """Positions and lengths to a micrometre, values to a hundredth of what is shown, lines that are not too long, and marks."""
    position = np.array([[0.0, 0, 5], [0, 3, 5], [4, 3, 5], [np.nan, 0, 0], [4, 0, 5.0005]])
    values = np.array([np.nan, 1.25, -8.5, np.nan, 0.001])
    findings = [Finding("CS0001", "note", "a", "p.mod", 4), Finding("CS0002", "warning", "b", "p.mod", 5),
                Finding("CS0003", "warning", "c", "p.mod", 2), Finding("CS0004", "warning", "d", "p.mod", 9)]
    view = drawn(position, values, findings, tolerance=3.0)
    data = view.data
    known = np.where(np.isfinite(position).all(axis=1)[:, None], np.round(position * 1e3) / 1e3, np.nan)
    np.testing.assert_allclose(unpacked(data["position"], 1e-3, 3), known, atol=1e-9)
    assert unpacked(data["length"], 1e-3, 1).tolist() == pytest.approx([0, 3, 7, 7, 7])
    assert (data["step_mm"], data["start"]) == (1e-3, 2)
    assert unpacked(data["line"], 1, 1).tolist() == [3, 4, 5, 6, 7]
    assert unpacked(data["target"], 1, 1).tolist() == [0, 1, 2, 3, 4]
    one = data["quantities"][0]
    np.testing.assert_allclose(unpacked(one["values"], one["step"], 1), values, atol=1e-9)
    assert {key: one[key] for key in ("limit", "unit", "largest", "tolerance", "step")} == {
        "limit": 8.5, "unit": "µm", "largest": {"index": 2, "value": -8.5}, "tolerance": 3.0, "step": pytest.approx(1e-3)}
    assert [(mark["index"], mark["line"], mark["level"], mark["finding"]) for mark in data["marks"]] == [
        (1, 4, "note", 0), (2, 5, "warning", 1)]
    assert view.marks == {0, 1}
    texts = json.loads(zlib.decompress(base64.b64decode(data["texts"])))
    assert texts == ["MoveL p0;", "MoveL p1;" + "x" * 150 + "…", "MoveL p2;", "MoveL p3;", "MoveL p4;"]
    assert view.caption == "Caption."
    # In print what warns and the largest have their line; a place has one name.
    assert re.findall(r'class="mark"[^>]*>([^<]+)<', str(view.picture)) == ["largest, line 5"]
    assert "Name: 0 to 8.5 µm; grey: no force" in str(view.picture)


def test_the_picture_has_the_colour_of_what_each_move_ends_in() -> None:
    """Moves without force are grey and thin; the largest has the last of twelve colours, a twenty-fourth of it the first."""
    position = np.array([[0.0, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [40, 0, 0]])
    shown = str(drawn(position, np.array([np.nan, np.nan, 12.0, -6.1, 0.5]), []).picture)
    lines = dict(re.findall(r'class="line stroke-([\w-]+)" stroke-width="([\d.]+)"', shown))
    assert lines == {"air": "0.7", "heat-11": "2.4", "heat-6": "2.4", "heat-0": "2.4"}
    ends = {name: re.findall(r"[\d.-]+", d) for name, d in re.findall(r'class="line stroke-([\w-]+)"[^>]* d="([^"]+)"', shown)}
    assert [len(one) for one in ends.values()] == [4] * 4
    for one, other in itertools.pairwise(["air", "heat-11", "heat-6", "heat-0"]):
        assert ends[one][2:] == ends[other][:2]
    assert shown.count('class="fill-heat-') == 12
    assert [re.search(rf'fill-heat-{k}" x="([\d.]+)"', shown)[1] for k in (0, 1, 11)] == ["20", "35", "185"]


def test_moves_that_meet_are_one_line() -> None:
    """Every segment is there once, in order, and no gap within a run."""
    gap = np.nan
    x = np.array([0.0, 1, gap, 1, 2, gap, 5, 6, gap, 6, 7, gap, 7, 9, gap])
    y = np.array([0.0, 0, gap, 0, 1, gap, 1, 1, gap, 2, 1, gap, 1, 1, gap])
    joined = drawing._joined(x, y)
    np.testing.assert_array_equal(joined[0], [0, 1, 2, gap, 5, 6, gap, 6, 7, 9, gap])
    np.testing.assert_array_equal(joined[1], [0, 0, 1, gap, 1, 1, gap, 2, 1, 1, gap])


@pytest.mark.parametrize(("count", "stretches"), [(10, 3), (12, 4), (13, 4), (7, 7), (5, 1)])
def test_of_each_stretch_the_largest_is_kept(count: int, stretches: int) -> None:
    """By going through them."""
    rng = np.random.default_rng(count)
    values = rng.normal(size=count)
    values[rng.integers(count)] = np.nan
    each = -(-count // stretches)
    parts = [np.arange(k, min(k + each, count)) for k in range(0, count, each)]
    largest = [part[np.nanargmax(np.abs(values[part]))] for part in parts if np.isfinite(values[part]).any()]
    assert drawing._largest(values, stretches).tolist() == largest


def test_a_corner_is_what_is_farthest_from_the_line_of_its_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drawing, "STRETCHES", 3)
    rng = np.random.default_rng(5)
    where, kept = 0.01 * rng.normal(size=(14, 3)), {0, 5, 10}
    where[7] = np.nan           # of unknown place
    for first, last in ((0, 5), (5, 10), (10, 13)):
        way = (where[last] - where[first]) / np.linalg.norm(where[last] - where[first])
        off = {k: np.linalg.norm(np.cross(where[k] - where[first], way)) for k in range(first, last + (last == 13)) if k != 7}
        kept.add(max(off, key=lambda k: off[k]))
    assert drawing._corners(where).tolist() == sorted(kept)
    # All of a few are drawn; and the ends of no more runs than there are stretches.
    assert drawing.kept_targets(where[:9], [quantity(np.ones(9))]).tolist() == list(range(9))
    assert len(drawing.kept_targets(where[:10], [quantity(np.ones(10))])) < 10


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_across_is_to_the_left_of_the_travel_seen_along_the_tool(turn: float) -> None:
    """Of a tool that looks down, by hand; along the last way there was where there is none, or else the first that comes."""
    c, s = np.cos(turn), np.sin(turn)
    down = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    tilted = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ down
    steps = np.array([[0, 0, 0], [0, 0, 0], [2e-3, 0, 0], [0, 0, 0], [0, 3e-3, 0]])
    deviation = 1e-6 * np.array([[3.0, 5, 7], [1, 2, 4]])
    job: Any = SimpleNamespace(targets=np.array([1, 3]), path=SimpleNamespace(
        base_from_tcp=SimpleNamespace(rotation=np.tile(tilted, (5, 1, 1))), steps=steps, toolpath=Lines(5)))
    axial, across, along = (one.values for one in components(job, deviation))
    for values in (axial, across, along):
        assert np.isnan(values[[0, 2, 4]]).all()
    np.testing.assert_allclose(axial[[1, 3]], [3 * -s - 7 * c, 1 * -s - 4 * c])
    np.testing.assert_allclose(along[[1, 3]], [3, 1])
    np.testing.assert_allclose(across[[1, 3]], [5, 2])
    job.path.steps = 0 * steps
    assert np.isnan(components(job, deviation)[2].values).all()
