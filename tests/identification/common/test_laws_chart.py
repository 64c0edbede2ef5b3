"""Charts put values where they belong: read back from the SVG, whatever the numbers."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.common.chart import Axis, Band, Bars, Cells, Figure, Line, Panel, Points, Rule
from identification.common.chart_numbers import chart_numbers
from identification.common.chart_svg import NARROW, WIDE, draw, extremes, legend, log_ticks, number, numbers, ticks
from identification.common.report import FILES

FINITE = st.floats(-1e9, 1e9)


def shown(panel: Panel) -> ET.Element:
    return ET.fromstring(str(draw(panel, WIDE, "label")))


def scale_of(picture: ET.Element, kind: str) -> np.ndarray:
    """Slope and offset from pixels to values, by the numbers at the marks of an axis."""
    pairs = []
    for text in picture.iter("text"):
        words = (text.text or "").replace("\u202f", "").replace("−", "-")
        if re.fullmatch(r"-?[\d.]+", words) and (text.get("text-anchor") == ("middle" if kind == "x" else "end")):
            pairs.append((float(text.get(kind)) - (0 if kind == "x" else 4), float(words)))
    pixels, values = np.array(pairs).T
    return np.polyfit(pixels, values, 1)


def test_points_stand_where_the_axes_say() -> None:
    x, y = np.array([-3.0, 10.0, 41.5]), np.array([120.0, -80.0, 7.0])
    picture = shown(Panel([Points("p", x, y, labels=list("abc"))], Axis("x [mm]"), Axis("y [um]")))
    circles = [(float(one.get("cx")), float(one.get("cy"))) for one in picture.iter("circle")]
    assert np.polyval(scale_of(picture, "x"), [cx for cx, _ in circles]) == pytest.approx(x, abs=0.1)
    assert np.polyval(scale_of(picture, "y"), [cy for _, cy in circles]) == pytest.approx(y, abs=0.5)
    assert [one[0].text for one in picture.iter("circle")] == list("abc")


def test_each_number_of_an_axis_stands_at_its_mark() -> None:
    """Of the upright axis left of where the marks begin, of the other below where they end; marks run through the chart."""
    picture = shown(Panel([Line("l", [0.0, 1.0], [-3.0, 5.0])], Axis("place [mm]"), Axis("y [um]")))

    def drawn(form: str) -> list[tuple[float, ...]]:
        found = (re.fullmatch(form, one.get("d", "")) for one in picture.iter("path"))
        return sorted(tuple(map(float, one.groups())) for one in found if one)

    number, texts = r"([-\d.]+)", [one for one in picture.iter("text") if re.fullmatch(r"[−\d.]+", one.text or "")]
    places = {anchor: sorted((float(one.get("x")), float(one.get("y"))) for one in texts if one.get("text-anchor") == anchor)
              for anchor in ("end", "middle")}
    axis, = (one.get("d", "") for one in picture.iter("path") if one.get("class") == "axis")
    left, bottom, right = map(float, re.findall(number, axis))
    across = [mark for mark in drawn(f"M{number} {number}H{number}") if mark[1] != bottom]
    upright = drawn(f"M{number} {number}V{number}")
    assert len(across) > 2
    assert len(upright) > 2
    assert [(x, end) for x, _, end in across] == [(left, right)] * len(across)
    np.testing.assert_allclose(places["end"], [(left - 6, y + 4) for _, y, _ in across], atol=0.051)
    assert {end for _, _, end in upright} == {bottom}
    assert len({top for _, top, _ in upright}) == 1
    np.testing.assert_allclose(places["middle"], [(x, bottom + 17) for x, _, _ in upright], atol=0.051)


def test_words_below_a_chart_stand_in_it_and_clear_of_each_other() -> None:
    """The marks' numbers and the axis' title, whose baselines are a line of print apart."""
    picture = shown(Panel([Line("l", [0.0, 1.0], [0.0, 1.0])], Axis("place [mm]"), Axis("y [um]")))
    height = float(picture.get("viewBox").split()[3])
    title, = (float(text.get("y")) for text in picture.iter("text") if (text.text or "").startswith("place"))
    marks = {float(text.get("y")) for text in picture.iter("text") if text.get("text-anchor") == "middle"}
    assert marks
    assert max(marks) + 14 <= title <= height - 4


def test_a_value_alone_between_gaps_is_seen() -> None:
    """As a dot; so is each of many that are all alone."""
    x, y = np.arange(9.0), np.array([1.0, 2, np.nan, 3, np.nan, np.nan, 4, np.nan, 5])
    line = next(one for one in shown(Panel([Line("l", x, y)], Axis(), Axis())).iter("path") if "line" in one.get("class"))
    assert [part.count("L") for part in line.get("d").split("M")[1:]] == [1, 0, 0, 0]
    assert line.get("d").count("h0") == 3
    assert ".line:not(.dashed) { stroke-linecap: round; }" in (FILES / "report.css").read_text()


def test_no_word_of_a_name_beside_a_chart_is_cut() -> None:
    """Names in further lines, each within the picture and clear of the next one's; on a telephone too."""
    names = ["the robot rocks on its base: floor, anchors or pedestal give way",
             "a load along one axis moves the tool in a way no spring explains", "short"]
    panel = Panel([Bars("b", [1.0, 2.0, 3.0])], Axis(), Axis(categories=names), height=100, sideways=True)
    for width in (WIDE, NARROW):
        texts = [one for one in ET.fromstring(str(draw(panel, width, "l"))).iter("text") if re.search("[a-z]", one.text or "")]
        assert " ".join(one.text for one in texts) == " ".join(names)
        heights = [float(one.get("y")) for one in texts]
        assert min(np.diff(heights)) >= 13
        assert all(7.0 * len(one.text) < float(one.get("x")) < 0.5 * width for one in texts)


def test_the_lines_of_a_name_beside_a_chart_stand_about_the_middle_of_its_bar() -> None:
    """However many there are: print stands four pixels above its baseline's middle."""
    names = ["short", "the robot rocks on its base: floor, anchors or pedestal give way"]
    picture = shown(Panel([Bars("b", [1.0, 2.0])], Axis(), Axis(categories=names), height=140, sideways=True))
    texts = [(float(one.get("y")), one.text) for one in picture.iter("text") if re.search("[a-z]", one.text or "")]
    middles = [float(one.get("y")) + float(one.get("height")) / 2 for one in picture.iter("rect")]
    assert len(texts) > 2
    assert texts[0][1] == "short"
    assert [texts[0][0] - 4, np.mean([y for y, _ in texts[1:]]) - 4] == pytest.approx(middles, abs=0.11)
    assert np.diff([y for y, _ in texts[1:]]) == pytest.approx(np.diff([y for y, _ in texts[1:]])[0], abs=0.11)


def test_bars_begin_at_zero_and_are_as_long_as_their_values() -> None:
    values = np.array([4.0, -2.0, 1.0])
    for sideways in (False, True):
        names = Axis(categories=list("abc"))
        panel = Panel([Bars("b", values)], Axis() if sideways else names, names if sideways else Axis(), sideways=sideways)
        lengths = [float(bar.get("width" if sideways else "height")) for bar in shown(panel).iter("rect")]
        assert np.array(lengths) / lengths[0] == pytest.approx(np.abs(values) / 4, abs=0.01)


def test_bars_that_stand_on_each_other_do_not_overlap() -> None:
    picture = shown(Panel([Bars("a", [1.0]), Bars("b", [3.0])], Axis(categories=["k"]), Axis(), stacked=True))
    lower, upper = [(float(bar.get("y")), float(bar.get("height"))) for bar in picture.iter("rect")]
    assert upper[0] + upper[1] == pytest.approx(lower[0], abs=0.11)
    assert upper[1] == pytest.approx(3 * lower[1], rel=0.01)


def test_a_gap_is_a_gap() -> None:
    picture = shown(Panel([Line("l", [0, 1, 2, 3, 4], [0, 1, np.nan, 1, 0])]))
    line = next(one for one in picture.iter("path") if "line" in one.get("class"))
    assert line.get("d").count("M") == 2


@given(st.lists(FINITE | st.just(float("nan")), min_size=1, max_size=6000), st.integers(1, 50))
def test_thinning_keeps_the_extremes(values: list[float], columns: int) -> None:
    array = np.array(values)
    kept = extremes(array, columns)
    assert (np.diff(kept) > 0).all()
    assert len(kept) <= max(4 * columns + 4, len(array) if len(array) <= 4 * columns else 0)
    if np.isfinite(array).any():
        assert np.nanmax(array[kept]) == np.nanmax(array)
        assert np.nanmin(array[kept]) == np.nanmin(array)


@given(st.floats(-1e12, 1e12), st.floats(1e-9, 1e12), st.integers(2, 12))
def test_ticks_are_round_and_inside(low: float, span: float, most: int) -> None:
    high = low + span
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        return
    marks = ticks(low, high, most)
    assert len(marks) <= 2 * most + 1
    if len(marks) > 2:
        steps = np.diff(marks)
        assert steps == pytest.approx(steps[0], rel=1e-3)


@pytest.mark.parametrize(("value", "words"), [
    (0.0, "0"), (-0.5, "−0.5"), (1234.0, "1234"), (12345.0, "12\u202f345"), (1e6, "10⁶"), (2.5e-7, "2.5·10⁻⁷"), (0.1 + 0.2,
                                                                                                                 "0.3")])
def test_numbers_are_the_same_in_every_country(value: float, words: str) -> None:
    assert number(value) == words


@pytest.mark.parametrize("values", [[np.nan, np.nan], [], [1e300, -1e300], [5.0, 5.0], [1e-320, 2e-320]])
def test_odd_numbers_make_a_chart_and_no_warning(values: list[float]) -> None:
    x = np.arange(len(values))
    for log in (False, True):
        text = str(draw(Panel([Line("l", x, values), Points("p", x, values, interval=(values, values)), Band("b", x, values,
                                                                                                             values),
                               Rule(1.0)], Axis(log=log), Axis(log=log)), WIDE, ""))
        assert "nan" not in text
        assert "inf" not in text
        ET.fromstring(text)


def test_a_band_ends_where_its_edges_are_not_known() -> None:
    """It had been drawn across rows that were left out."""
    x, edge = np.arange(5.0), np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    for values, areas in ((np.ones(5), 1), (edge, 2)):
        text = str(draw(Panel([Band("b", x, -values, values)], Axis(), Axis()), WIDE, ""))
        path = next(one.get("d", "") for one in ET.fromstring(text).iter() if "area" in one.get("class", ""))
        assert path.count("M") == path.count("Z") == areas


def test_the_legend_names_each_series_once() -> None:
    panel = Panel([Line("a", [0], [0]), Line("a", [0], [0]), Line("", [0], [0]), Line("b", [0], [0], legend=False), Rule(1.0,
                                                                                                                         "r"),
                   Cells([[1.0]])])
    assert [name for name, _, _ in legend(Figure("", "", [panel, panel]))] == ["a", "r"]
    assert legend(Figure("", "", [Panel(panel.series[:4], Axis(), Axis())] * 2)) == []


def test_marks_of_one_logarithmic_axis_are_of_one_kind() -> None:
    assert numbers(np.array([1e5, 1e6, 1e7]), log=True) == ["10⁵", "10⁶", "10⁷"]
    assert numbers(np.array([2e5, 1e6, 5e6]), log=True) == ["2·10⁵", "10⁶", "5·10⁶"]
    assert numbers(np.array([1.0, 10.0, 1000.0]), log=True) == ["1", "10", "1000"]
    assert numbers(np.array([0.0, 2e6]), log=False) == ["0", number(2e6)]


@given(FINITE, st.floats(1e-6, 1e6), st.integers(2, 12))
def test_an_axis_has_two_marks_at_least(low: float, size: float, most: int) -> None:
    high = low + size * max(abs(low), 1.0)
    found = ticks(low, high, most)
    assert 2 <= len(found) <= 2 * most + 1
    assert found[0] >= low - 1e-9 * max(abs(low), abs(high), 1)
    assert found[-1] <= high + 1e-9 * max(abs(low), abs(high), 1)


def test_numbers_of_bars_of_panels_side_by_side() -> None:
    names = Axis("pose", categories=["P1", "P2"])
    panels = [Panel([Bars(name, values), Rule(3.0, "limit")], names, Axis("RMS [um]"))
              for name, values in (("before", [12345.6, 2.0]), ("after", [0.12345, np.nan]))]
    assert chart_numbers(Figure("f", "", panels)) == (
        ["pose", "before [um]", "after [um]"], [["P1", number(12350.0), "0.1235"], ["P2", "2", ""]])


def test_numbers_of_panels_of_several_quantities_say_which() -> None:
    """x, y and z of one series below each other; what stands along them is the title of the last panel alone."""
    panels = [Panel([Points("plain", [3, 4], [1.0, value])], Axis("line" if name == "z" else ""), Axis(f"{name} [um]"))
              for name, value in (("x", 2.0), ("y", 5.0), ("z", 6.0))]
    assert chart_numbers(Figure("f", "", panels)) == (
        ["line", "x, plain [um]", "y, plain [um]", "z, plain [um]"], [["3", "1", "1", "1"], ["4", "2", "5", "6"]])


def test_numbers_of_marks_with_intervals() -> None:
    marks = Points("k", np.arange(2), [3.0, 4.0], interval=([1.0, 2.0], [5.0, 6.0]))
    panel = Panel([marks], Axis(categories=["k1", "k2"]), Axis("[N m/rad]", log=True))
    header, rows = chart_numbers(Figure("f", "", [panel])) or ([], [])
    assert header == ["", "k [N m/rad]", "from", "to"]
    assert rows == [["k1", "3", "1", "5"], ["k2", "4", "2", "6"]]


def test_no_numbers_of_clouds_long_lines_and_series_over_other_places() -> None:
    def of(*series: Line | Points) -> tuple[list[str], list[list[str]]] | None:
        return chart_numbers(Figure("f", "", [Panel(list(series), Axis("x"), Axis("y"))]))

    many = np.arange(101.0)
    assert of(Line("l", many, many)) is None
    _, rows = of(Line("l", many[1:], many[1:])) or ([], [])
    assert rows[-1] == ["100", "100"]
    for count in (100, 101):
        bars = Panel([Bars("b", np.ones(count))], Axis(categories=[f"c{k}" for k in range(count)]))
        assert (chart_numbers(Figure("f", "", [bars])) is None) == (count == 101)
    assert of(Points("a", [1, 2], [3, 4]), Points("b", [1, 3], [3, 4])) is None
    assert chart_numbers(Figure("f", "", [Panel([Cells(np.eye(2))], Axis(categories="ab"), Axis(categories="ab"))])) is None
    # A line through its own marks is told once, with a gap in it too; two series that happen to be equal are told as two.
    for four, said in ((4, "4"), (np.nan, "")):
        for line, marks in (("", ""), ("a", "a"), ("a", ""), ("", "a")):
            assert of(Line(line, [1, 2], [3, four]), Points(marks, [1, 2], [3, four])) == (
                ["x", line or marks or "y"], [["1", "3"], ["2", said]])
        assert of(Line("before", [1, 2], [3, four]), Points("after", [1, 2], [3, four]), Points("", [1, 2], [3, four])) == (
            ["x", "before", "after"], [["1", "3", "3"], ["2", said, said]])


@pytest.mark.parametrize(("decades", "most"), [(4, 6), (12, 4), (30, 5), (300, 8)])
def test_logarithmic_ticks_are_powers_of_ten_as_many_as_fit(decades: int, most: int) -> None:
    marks = np.log10(log_ticks(1e-3, 10.0 ** (decades - 3), most))
    np.testing.assert_allclose(marks, np.round(marks), atol=1e-9)
    assert len(set(np.round(np.diff(marks), 9))) == 1
    assert 3 <= len(marks) <= 2 * most
    assert marks[0] == -3


def test_few_decades_get_what_stands_between_them() -> None:
    np.testing.assert_allclose(log_ticks(2.0, 60.0, 6), [2, 5, 10, 20, 50])


def test_a_rule_lies_at_its_value_unless_it_stands() -> None:
    line = Line("l", [0.0, 10.0], [0.0, 100.0])
    for upright, kind, value in ((False, "y", 75.0), (True, "x", 2.5)):
        rule = Rule(value, upright=True) if upright else Rule(value)
        picture = shown(Panel([line, rule], Axis("x"), Axis("y")))
        [d] = [one.get("d") or "" for one in picture.iter("path") if "dashed" in (one.get("class") or "")]
        x, y, along = re.fullmatch(r"M([\d.]+) ([\d.]+)([HV])[\d.]+", d).groups()
        assert along == ("V" if upright else "H")
        assert np.polyval(scale_of(picture, kind), float(x if upright else y)) == pytest.approx(value, rel=0.01)


@pytest.mark.parametrize("size", [4.0, 9.0])
def test_marks_are_as_large_as_they_are_said_to_be(size: float) -> None:
    picture = shown(Panel([Points("p", [1.0, 2], [3.0, 4], labels="ab", size=size)], Axis(), Axis()))
    assert {float(one.get("r")) for one in picture.iter("circle")} == {size / 2}
    for symbol, wide in (("cross", size), ("dash", 2 * size)):
        d = next(one.get("d") for one in shown(Panel([Points("p", [1.0, 2], [3.0, 4], symbol=symbol, size=size)])).iter("path")
                 if (one.get("d") or "").count("m") >= 2)
        left, across = re.search(r"m-([\d.]+) -?[\d.]+[lh]([\d.]+)", d).groups()
        assert (2 * float(left), float(across)) == (wide, wide)


@pytest.mark.parametrize(("count", "letters"), [(3, 8), (40, 8), (40, 2), (12, 30)])
def test_of_names_below_a_chart_as_many_are_shown_as_do_not_touch(count: int, letters: int) -> None:
    """Every one, or every second, third ...: the next fewer would touch."""
    names = [f"{k}".rjust(letters, "n") for k in range(count)]
    picture = shown(Panel([Bars("b", np.ones(count))], Axis(categories=names), Axis()))
    at = {text.text: float(text.get("x")) for text in picture.iter("text") if text.get("text-anchor") == "middle"}
    every = -(-count // len(at))
    assert list(at) == names[::every]
    apart = np.diff(list(at.values()))
    assert len(apart) == 0 or apart.min() > 6.0 * letters
    assert every == 1 or apart.min() * (every - 1) / every < 8.0 * letters + 10


def line_of(picture: ET.Element) -> np.ndarray:
    """The places (n, 2) [px] of the one line."""
    [d] = [one.get("d") or "" for one in picture.iter("path") if "line" in (one.get("class") or "")]
    return np.array([[float(number) for number in place.split()] for place in re.split("[ML]", d)[1:]])


def test_a_line_leaves_the_picture_where_it_is_headed() -> None:
    """What lies up to a picture beyond the ends of an axis is where it belongs; what is further stays in numbers that draw."""
    values = np.array([-10.0, 20.0, -5.0, 14.0, 5.0])
    picture = shown(Panel([Line("l", np.arange(7.0), [*values, 1e6, -1e6])], Axis("x"), Axis("y", limits=(0.0, 10.0))))
    places = line_of(picture)
    assert np.polyval(scale_of(picture, "y"), places[:5, 1]) == pytest.approx(values, abs=0.05)
    assert np.polyval(scale_of(picture, "y"), places[5:, 1]) == pytest.approx([20, -10], abs=0.05)
    assert np.polyval(scale_of(picture, "x"), places[:, 0]) == pytest.approx(np.arange(7), abs=0.01)


@pytest.mark.parametrize("values", [[2.0, 2000.0], [4.0, 6.0], [2.0, 2.025], [6.0, 8.0]])
def test_a_logarithmic_axis_goes_on_a_seventh_beyond_what_it_shows(values: list[float]) -> None:
    picture = shown(Panel([Line("l", [0.0, 1.0], values)], Axis("x"), Axis("y", log=True)))
    marks = [(float(text.get("y")) - 4, float(text.text)) for text in picture.iter("text")
             if re.fullmatch(r"[\d.]+", text.text or "") and text.get("text-anchor") == "end"]
    fit = np.polyfit([y for y, _ in marks], np.log([value for _, value in marks]), 1)
    low, high = line_of(picture)[:, 1]
    assert np.exp(np.polyval(fit, [low, high])) == pytest.approx(values, rel=5e-3)
    bottom, = (float(one.get("d", "").split()[1].split("H")[0]) for one in picture.iter("path") if one.get("class") == "axis")
    assert np.exp(np.polyval(fit, [bottom, 26.0])) == pytest.approx(
        [values[0] / 1.15, values[1] * 1.15], rel=5e-3)


@pytest.mark.parametrize(("value", "log", "ends"), [
    (5.0, False, (0.0, 10.0)), (0.0, False, (-1.0, 1.0)), (-3.0, False, (-6.0, 0.0)), (6.0, True, (3.0, 12.0))])
def test_a_value_that_never_changes_lies_in_the_middle(value: float, log: bool, ends: tuple[float, float]) -> None:
    """Between nothing and twice of it; of zeros a unit to both sides; on a logarithmic axis from half to twice."""
    picture = shown(Panel([Line("l", [0.0, 1.0], [value, value])], Axis("x"), Axis("y", log=log)))
    bottom, = (float(one.get("d", "").split()[1].split("H")[0]) for one in picture.iter("path") if one.get("class") == "axis")
    places = line_of(picture)[:, 1]
    marks = [(float(text.get("y")) - 4, float((text.text or "").replace("−", "-"))) for text in picture.iter("text")
             if re.fullmatch(r"−?[\d.]+", text.text or "") and text.get("text-anchor") == "end"]
    fit = np.polyfit([y for y, _ in marks], [np.log(mark) if log else mark for _, mark in marks], 1)
    shows = np.polyval(fit, [bottom, places[0], 26.0])
    room = 0.0 if log else 0.04 * (ends[1] - ends[0])
    assert (np.exp(shows) if log else shows) == pytest.approx(
        [ends[0] - room, value, ends[1] + room], abs=0.02 * (ends[1] - ends[0]))


def test_the_cells_of_a_matrix_lie_side_by_side_under_their_numbers() -> None:
    """Wide as the columns are apart and high as the rows, row by row from above; half as strong as their values are large."""
    values = np.array([[1.0, -0.5, 0.25], [0.0, 2.0, -1.0]])
    panel = Panel([Cells(values)], Axis(categories="abc"), Axis(categories="uv"))
    picture = shown(panel)
    boxes = [[float(one.get(name)) for name in ("x", "y", "width", "height")] for one in picture.iter("rect")]
    x, y, wide, high = np.array(boxes).T.reshape(4, 2, 3)
    assert np.diff(x, axis=1) == pytest.approx(wide[:, 1:], abs=0.11)
    assert np.diff(y, axis=0) == pytest.approx(high[1:], abs=0.11)
    foot, = (float(one.get("d", "").split()[1].split("H")[0]) for one in picture.iter("path") if one.get("class") == "axis")
    assert (y[0, 0], y[-1, 0] + high[-1, 0]) == pytest.approx((26.0, foot), abs=0.11)
    names = {text.text: (float(text.get("x")), float(text.get("y"))) for text in picture.iter("text")}
    assert x[0] + wide[0] / 2 == pytest.approx([names[name][0] for name in "abc"], abs=0.11)
    assert y[:, 0] + high[:, 0] / 2 + 4 == pytest.approx([names[name][1] for name in "uv"], abs=0.11)
    texts = [text for text in picture.iter("text") if re.fullmatch(r"−?\d\.\d\d", text.text or "")]
    assert [text.text for text in texts] == ["1.00", "−0.50", "0.25", "0.00", "2.00", "−1.00"]
    assert [float(text.get("x")) for text in texts] == pytest.approx((x + wide / 2).ravel(), abs=0.11)
    assert [float(text.get("y")) for text in texts] == pytest.approx((y + high / 2 + 4).ravel(), abs=0.11)
    assert [(one.get("class"), float(one.get("fill-opacity"))) for one in picture.iter("rect")] == [
        ("fill-before", 0.5), ("fill-after", 0.25), ("fill-before", pytest.approx(0.125, abs=0.006)), ("fill-after", 0.0),
        ("fill-before", 0.5), ("fill-after", 0.5)]


def test_bars_beside_each_other_share_the_width_of_their_category() -> None:
    """In their order, without a gap, about the middle; the next category's are as far as the categories are apart."""
    names = ["a", "b", "c"]
    panel = Panel([Bars("one", [1.0, 2, 3]), Bars("two", [3.0, 2, 1]), Bars("three", [1.0, 1, 1])], Axis(categories=names),
                  Axis("y"))
    picture = shown(panel)
    left, wide = np.array([[float(one.get("x")), float(one.get("width"))] for one in picture.iter("rect")]).T.reshape(2, 3, 3)
    assert wide == pytest.approx(wide[0, 0])
    assert np.diff(left, axis=0) == pytest.approx(wide[0, 0], abs=0.11)
    middles = [float(text.get("x")) for text in picture.iter("text") if text.text in names]
    assert left[1] + wide[1] / 2 == pytest.approx(middles, abs=0.11)
    assert 3 * wide[0, 0] == pytest.approx(0.76 * np.diff(middles)[0], abs=0.2)
    assert [one[0].text for one in picture.iter("rect")][3:6] == ["a: two 3", "b: two 2", "c: two 1"]


@pytest.mark.parametrize("stacked", [False, True])
def test_a_bar_of_no_value_is_left_out_and_the_others_stand_where_they_do_without_it(stacked: bool) -> None:
    """On each other too: all that stood above it had been lost."""
    def heights(middle: float) -> dict[str | None, tuple[float, float]]:
        panel = Panel([Bars("one", [1.0, 2]), Bars("two", [3.0, middle]), Bars("three", [1.0, 1])], Axis(categories="ab"),
                      Axis("y", limits=(0.0, 5.0)), stacked=stacked)
        return {one[0].text: (float(one.get("y")), float(one.get("height"))) for one in shown(panel).iter("rect")}

    without, of_nothing = heights(np.nan), heights(0.0)
    assert of_nothing.pop("b: two 0")[1] == 0
    assert without == of_nothing


@pytest.mark.parametrize("width", [WIDE, NARROW])
@pytest.mark.parametrize("ends", [(0.0, 1.0), (-3.0, 40.0), (1234.0, 98765.0), (-0.02, 0.01)])
def test_marks_of_an_axis_stand_clear_of_each_other_and_leave_no_wide_gap(width: int, ends: tuple[float, float]) -> None:
    picture = ET.fromstring(str(draw(Panel([Line("l", ends, ends)], Axis("x"), Axis("y")), width, "")))
    across = [float(text.get("x")) for text in picture.iter("text") if text.get("text-anchor") == "middle"]
    upright = [float(text.get("y")) for text in picture.iter("text") if text.get("text-anchor") == "end"
               and text.get("class") is None]
    for places, room in ((across, 90), (upright, 42)):
        assert 0.95 * room <= abs(np.diff(places)).min() <= abs(np.diff(places)).max() <= 2.6 * room


def ends_of(panel: Panel) -> tuple[float, float]:
    """What the upright axis shows from its foot to its head, which is as far below the picture's top as of every other."""
    picture = shown(panel)
    foot, = (float(one.get("d", "").split()[1].split("H")[0]) for one in picture.iter("path") if one.get("class") == "axis")
    low, high = np.polyval(scale_of(picture, "y"), [foot, 26.0])
    return float(low), float(high)


@pytest.mark.parametrize(("series", "axis", "ends"), [
    ([Line("l", [0, 1], [3.0, 5.0])], Axis(), (2.92, 5.08)), ([Line("l", [0, 1], [3.0, 5.0])], Axis(from_zero=True), (0, 5.2)),
    ([Line("l", [0, 1], [-5.0, -3.0])], Axis(from_zero=True), (-5.2, 0.2)), ([Line("l", [0], [0.0])], Axis(), (-1.08, 1.08)),
    ([Points("p", [0, 1], [3.0, 5.0], interval=([1.0, 4.0], [4.0, 11.0]))], Axis(), (0.6, 11.4)),
    ([Band("b", [0, 1], [1.0, 4.0], [4.0, 11.0])], Axis(), (0.6, 11.4)),
    ([Line("l", [0, 9], [1.0, 5.0]), Rule(11.0)], Axis(), (0.6, 11.4)),
    ([Line("l", [0, 9], [1.0, 11.0]), Rule(7.0, upright=True)], Axis(), (0.6, 11.4)),
    ([Line("l", [0, 1], [np.nan, np.nan])], Axis(), (-0.04, 1.04)), ([Line("l", [], [])], Axis(), (-0.04, 1.04)),
    ([Line("l", [0, 1, 2], [1.0, 11.0, 1e250])], Axis(), (0.6, 11.4)),
    ([Line("l", [0, 1], [1.0, 5.0])], Axis(limits=(-2.0, 4.0)), (-2, 4))])
def test_an_axis_shows_all_that_is_drawn_and_a_twenty_fifth_beyond(series: list, axis: Axis, ends: tuple[float, float]) -> None:
    """At zero it ends where it shall begin there."""
    assert ends_of(Panel(series, Axis(), axis)) == pytest.approx(ends, abs=0.01 * (ends[1] - ends[0]))


@pytest.mark.parametrize(("values", "stacked", "ends"), [
    ([[1.0, 2.0], [3.0, 5.0]], False, (0, 5.2)), ([[1.0, 2.0], [3.0, 5.0]], True, (0, 7.28)),
    ([[4.0, 2.0], [np.nan, 1.0]], True, (0, 4.16)), ([[-1.0, -5.0], [-2.0, -3.0]], False, (-5.2, 0.2))])
def test_an_axis_of_bars_shows_zero_and_how_high_they_stand(
        values: list[list[float]], stacked: bool, ends: tuple[float, float]) -> None:
    panel = Panel([Bars(f"b{k}", one) for k, one in enumerate(values)], Axis(categories="ab"), Axis(), stacked=stacked)
    assert ends_of(panel) == pytest.approx(ends, abs=0.01 * (ends[1] - ends[0]))


def test_a_band_goes_out_along_its_upper_edge_and_back_along_its_lower() -> None:
    low, high = [0.0, 1.0, 0.5], [5.0, 6.0, 7.0]
    picture = shown(Panel([Band("b", [0.0, 1.0, 2.0], low, high)], Axis("x"), Axis("y")))
    [d] = [one.get("d", "") for one in picture.iter("path") if "area" in (one.get("class") or "")]
    assert d.endswith("Z")
    x, y = np.array([[float(number) for number in place.split()] for place in re.split("[ML]", d[:-1])[1:]]).T
    assert np.polyval(scale_of(picture, "x"), x) == pytest.approx([0, 1, 2, 2, 1, 0], abs=0.01)
    assert np.polyval(scale_of(picture, "y"), y) == pytest.approx([*high, *low[::-1]], abs=0.05)


@pytest.mark.parametrize(("count", "columns"), [(12, 3), (13, 3), (17, 3), (100, 7), (99, 7)])
def test_of_each_stretch_of_a_long_line_its_ends_its_least_and_its_largest_are_kept(count: int, columns: int) -> None:
    values = np.random.default_rng(count).normal(size=count)
    values[::9] = np.nan
    wanted = set(range(count))
    if count > 4 * columns:
        each, wanted = int(np.ceil(count / columns)), set()
        for first in range(0, count, each):
            part = values[first:first + each]
            wanted |= {first, first + len(part) - 1, first + int(np.nanargmin(part)), first + int(np.nanargmax(part))}
    assert extremes(values, columns).tolist() == sorted(wanted)


@pytest.mark.parametrize(("count", "labelled"), [(400, True), (401, False)])
def test_up_to_four_hundred_marks_say_what_they_are(count: int, labelled: bool) -> None:
    picture = shown(Panel([Points("p", np.arange(count), np.arange(count), labels=[f"n{k}" for k in range(count)])]))
    assert [one[0].text for one in picture.iter("circle")] == [f"n{k}" for k in range(count if labelled else 0)]
    dots = [one.get("d") for one in picture.iter("path") if "dots" in (one.get("class") or "")]
    assert [d.count("M") for d in dots if d] == ([] if labelled else [count])
