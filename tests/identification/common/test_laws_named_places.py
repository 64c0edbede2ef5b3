"""Names in the picture of a path: none stands on another, nor on another's dot."""

from __future__ import annotations

import re

import numpy as np
import pytest

from identification.common.scene import EDGE, HEIGHT, WIDTH, Projection, SpaceLine, named_places, picture, scene

# A letter of the picture's font is about so wide, a name so high [px], a dot has this radius.
WIDE, HIGH, RADIUS = 6.0, 11.0, 4.0


@pytest.mark.parametrize("seed", range(20))
def test_no_name_covers_a_dot_or_a_name(seed: int) -> None:
    """Dots that crowd, as those of lines next to each other in the program do."""
    rng = np.random.default_rng(seed)
    x, y = 400 + rng.normal(0, 40, 6), 230 + rng.normal(0, 12, 6)
    names = [f"line {rng.integers(10, 4000)}" for _ in range(5)] + ["largest, line 725"]
    drawn = "".join(map(str, named_places(x, y, names)))
    signs = [(float(across), float(foot), 0.5 * WIDE * len(name)) for across, foot, name in re.findall(
        r'<text class="mark" x="([-\d.]+)" y="([-\d.]+)" text-anchor="middle">([^<]*)<', drawn)]
    assert len(signs) == len(names)
    for number, (across, foot, half) in enumerate(signs):
        on = (np.abs(x - across) < half + RADIUS) & (y > foot - HIGH - RADIUS) & (y < foot + RADIUS)
        assert not on.any(), names[number]
        for other, below, wide in signs[:number]:
            assert abs(foot - below) >= HIGH or abs(across - other) >= half + wide


@pytest.mark.parametrize("seed", range(5))
def test_a_picture_holds_all_of_its_points_as_large_as_they_fit(seed: int) -> None:
    """Seen from the right, the front and above, by lengths and angles of its own: two edges are reached, opposite ones."""
    points = np.random.default_rng(seed).normal([5, -7, 100], [3, 2, 1], (50, 3))
    x, y = Projection.fitting(np.concatenate([points, [[np.nan, 0, 0]]]))(points)
    room = [min(x.min(), WIDTH - x.max()), min(y.min(), HEIGHT - y.max())]
    assert min(room) == pytest.approx(EDGE)
    assert (x.min() + x.max(), y.min() + y.max()) == pytest.approx((WIDTH, HEIGHT))
    # Up to one scale the differences are those along two directions at right angles to each other and to the look.
    towards = np.array([0.62, -0.68, 0.5]) / np.linalg.norm([0.62, -0.68, 0.5])
    across = np.array([0.68, 0.62, 0]) / np.hypot(0.68, 0.62)
    flat = (points - points[0]) @ np.column_stack([across, np.cross(towards, across)])
    seen = np.column_stack([x - x[0], y[0] - y])
    scale = np.sum(flat * seen) / np.sum(flat**2)
    np.testing.assert_allclose(seen, scale * flat, atol=1e-9 * scale)


@pytest.mark.parametrize(("x", "y", "names", "stand", "joined"), [
    ([400], [200], ["a"], [(400, 191)], []),
    # Twice at one place: the second name a row higher, half rows being too little, with a line down to its dot.
    ([400, 400], [200, 200], ["a", "b"], [(400, 191), (400, 176)], ["M400.0 200.0L400.0 179.0"]),
    # Names of one letter are 3.4 px to either side: 6.8 apart they stand beside each other; 8.4 from a dot, too.
    ([400, 406.8], [200, 200], ["a", "b"], [(400, 191), (406.8, 191)], []),
    ([400, 406.7], [200, 200], ["a", "b"], [(400, 191), (406.7, 176)], ["M406.7 200.0L406.7 179.0"]),
    ([400, 408.5], [200, 185], ["a", "b"], [(400, 191), (408.5, 176)], []),
    ([400, 408.3], [200, 185], ["a", "b"], [(400, 176), (408.3, 176)], ["M400.0 200.0L400.0 179.0"]),
    # Another dot from a row above the name's foot to five px below it is in the way; at these themselves it is not.
    ([400, 405], [200, 176], ["a", "b"], [(400, 191), (405, 167)], []),
    ([400, 405], [200, 196], ["a", "b"], [(400, 191), (405, 172)], ["M405.0 196.0L405.0 175.0"]),
    # At the edges: two px from them; at the top below the dot; where there is a row's room above, there.
    ([3], [200], ["abcd"], [(15.6, 191)], []), ([919], [200], ["abcd"], [(904.4, 191)], []),
    ([400], [23], ["a"], [(400, 47)], []), ([400], [24], ["a"], [(400, 15)], []),
    # What is nowhere has no name, and its place is in nobody's way.
    ([np.nan, 400], [np.nan, 200], ["a", "b"], [(400, 191)], [])])
def test_names_stand_where_there_is_room(
    x: list[float], y: list[float], names: list[str], stand: list[tuple[float, float]], joined: list[str],
) -> None:
    drawn = "".join(map(str, named_places(np.array(x, dtype=float), np.array(y, dtype=float), names)))
    places = re.findall(r'<text class="mark" x="([-\d.]+)" y="([-\d.]+)"', drawn)
    assert [(float(across), float(foot)) for across, foot in places] == stand
    assert re.findall(r'stroke-width="0.7" d="([^"]*)"', drawn) == joined
    shown = [(a, b) for a, b in zip(x, y, strict=True) if np.isfinite(a)]
    assert re.findall(r'stroke-width="8" d="M([-\d.]+) ([-\d.]+)h0"', drawn) == [(f"{a:.1f}", f"{b:.1f}") for a, b in shown]


def test_a_scene_is_its_lines_and_marks_as_data_and_as_picture() -> None:
    """Of lines that have a width the line, of those that have dots a dot at each point; in metres, to five digits."""
    edge, marks = np.array([[0, 0, 0], [1, 2, 3.0000049]]), np.array([[1, 0, 0], [0, 1, 0.0]])
    view = scene("Arm", "seen", [SpaceLine(edge, "before", 2.5), SpaceLine(marks, "after", 0.0, 6.0)])
    assert (view.title, view.caption, view.kind) == ("Arm", "seen", "scene")
    assert view.data == {"lines": [
        {"points": [[0, 0, 0], [1, 2, 3]], "colour": "before", "width": 2.5, "dots": 0.0},
        {"points": [[1, 0, 0], [0, 1, 0]], "colour": "after", "width": 0.0, "dots": 6.0}]}
    x, y = Projection.fitting(np.concatenate([edge, marks]))(marks)
    drawn = str(view.picture)
    assert f'<path class="dots stroke-after" stroke-width="6" d="M{x[0]:.1f} {y[0]:.1f}h0M{x[1]:.1f} {y[1]:.1f}h0"/>' in drawn
    assert 'class="line stroke-before" stroke-width="2.5"' in drawn
    assert drawn.count('class="line ') == drawn.count("dots ") == 1
    # Alone, a point stands in the middle; and without any there is a picture all the same.
    assert Projection.fitting(marks[:1])(marks[:1]) == (pytest.approx([WIDTH / 2]), pytest.approx([HEIGHT / 2]))
    assert "<svg" in str(scene("none", "", []).picture)
    assert "<svg" in str(scene("not known", "", [SpaceLine(np.full((2, 3), np.nan), "before")]).picture)


def test_the_axes_in_the_corner_point_as_those_of_the_points_do() -> None:
    """34 px of each, as the picture shortens it, and its name a third further on."""
    project = Projection.fitting(np.random.default_rng(1).normal(size=(20, 3)))
    drawn = str(picture([], project, "label"))
    number = r"([-\d.]+)"
    arrows = re.findall(f'd="M{number} {number}l{number} {number}"/><text x="{number}" y="{number}"[^>]*>(.)<', drawn)
    assert [arrow[-1] for arrow in arrows] == ["x", "y", "z"]
    for axis, (x, y, right, down, at, below, _) in zip(np.eye(3), arrows, strict=True):
        tips = project(np.array([np.zeros(3), axis]))
        shown = 34 * np.array([np.diff(tips[0])[0], np.diff(tips[1])[0]]) / project.scale
        assert (float(x), float(y)) == (WIDTH - 60, HEIGHT - 55)
        assert (float(right), float(down)) == pytest.approx(tuple(shown), abs=0.051)
        assert (float(at), float(below)) == pytest.approx((WIDTH - 60 + 1.3 * shown[0], HEIGHT - 51 + 1.3 * shown[1]),
                                                          abs=0.051)
