"""A blank from an STL: that of a box is the box, and round, hollow and slanted blanks have the force that a sum over the edge
gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensator.cutting.stock_file import read_stock
from tests.compensator.cutting.milled import MILL, milled
from tests.compensator.cutting.solids import (
    Predicate,
    ascii_stl,
    binary,
    box_faces,
    circle,
    prism,
    stock_of,
    summed_force,
    tube,
)
from tests.support import long

LOW, HIGH = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0)
# The hole, and a slab whose sides lean: its top stands 20 mm further in x than its foot.
HOLE, LEAN = 12.0, 20.0


def in_box(points: np.ndarray) -> np.ndarray:
    return np.asarray(((points > LOW) & (points < HIGH)).all(axis=-1))


def leaning(points: np.ndarray) -> np.ndarray:
    moved = points - np.stack([LEAN * (points[..., 2] + 20) / 20, *(np.zeros(points.shape[:-1]),) * 2], axis=-1)
    return in_box(moved)


def round_bar(points: np.ndarray) -> np.ndarray:
    return np.asarray((np.hypot(points[..., 0], points[..., 1]) < 30) & (points[..., 2] < 0))


def lying(points: np.ndarray) -> np.ndarray:
    """A bar along x, its crown at z 0."""
    return np.asarray((np.hypot(points[..., 1], points[..., 2] + 25) < 25) & (np.abs(points[..., 0]) < 60))


def hollow(points: np.ndarray) -> np.ndarray:
    return in_box(points) & (np.hypot(points[..., 0], points[..., 1]) > HOLE)


SQUARE = np.array([[-60.0, -40.0], [60.0, -40.0], [60.0, 40.0], [-60.0, 40.0]])


def of_corners(count: int) -> np.ndarray:
    """The rectangle with as many corners as the circle, in even angles, its own four among them."""
    angle = np.unique(np.concatenate([np.linspace(0, 2 * np.pi, count - 3)[:-1], np.arctan2(*SQUARE.T[::-1]) % (2 * np.pi)]))
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.array([60.0, 40.0]) / np.maximum(np.abs(way), 1e-12)
    return np.asarray(way * reach.min(axis=1)[:, None])


def along_x(faces: np.ndarray) -> np.ndarray:
    """Turned so that z is x: (x, y, z) -> (z, x, y)."""
    return faces[..., [2, 0, 1]]


def blanks() -> dict[str, tuple[np.ndarray, Predicate]]:
    outer = of_corners(400)
    angle = np.arctan2(*outer.T[::-1])
    hole = HOLE * np.column_stack([np.cos(angle), np.sin(angle)])
    return {"round": (prism(circle(30.0), -20.0, 0.0), round_bar), "hole": (tube(outer, hole, -20.0, 0.0), hollow),
            "leaning": (prism(SQUARE, -20.0, 0.0, (LEAN, 0.0)), leaning),
            "lying": (along_x(prism(circle(25.0), -60.0, 60.0)) - [0.0, 0.0, 25.0], lying)}


@pytest.mark.parametrize("form", ["binary", "ascii", "inch"])
@pytest.mark.parametrize("y", [46.0, 0.0, -47.0])
def test_the_stl_of_a_box_is_the_box(tmp_path: Path, form: str, y: float) -> None:
    """The same layers, volume, engagement and force, in and out at the ends included."""
    faces = box_faces(LOW, HIGH)
    file = stock_of(tmp_path, ascii_stl(faces) if form == "ascii" else binary(faces / (25.4 if form == "inch" else 1)),
                    "units: inch\n" if form == "inch" else "units: mm\n")
    plain = tmp_path / "box.yaml"
    plain.write_text(f"box: {{from_mm: {list(LOW)}, to_mm: {list(HIGH)}}}\n")
    tips, corner = np.array([-4e-3, -9e-3]), np.array([[-80.0, y, -4.0], [20.0, y, -4.0], [80.0, y - 9, -4.0]])
    ours, box = (read_stock(one).stock(tips, 0.0) for one in (file, plain))
    assert 1e3 * ours.height == pytest.approx(1e3 * box.height, abs=1e-5)
    assert ours.volume == pytest.approx(box.volume, rel=1e-4)
    (_, own, force), (_, expected, truth) = milled(ours, corner), milled(box, corner)
    assert np.abs(truth).max() > 50
    assert force == pytest.approx(truth, abs=2e-3 * np.abs(truth).max())
    assert np.array_equal(own.cuts, expected.cuts)
    assert ours.volume == pytest.approx(box.volume, rel=1e-4)


@pytest.mark.parametrize(("kind", "turned_deg"), [
    ("round", 27.0), long("round", 0.0),
    ("hole", 0.0), long("hole", 27.0), long("leaning", 0.0), long("leaning", 27.0), ("lying", 0.0),
    long("lying", 27.0)])
def test_the_force_is_that_of_a_sum_over_the_edge(tmp_path: Path, kind: str, turned_deg: float) -> None:
    """Across the blank, 4 mm deep, off its middle: entry, plateau, hole and exit."""
    faces, inside = blanks()[kind]
    blank = read_stock(stock_of(tmp_path, binary(faces)))
    heading = np.radians(turned_deg)
    along = np.array([np.cos(heading), np.sin(heading)])
    begin, tip = np.array([0.0, 9.0]) - 85 * along, -4.0
    corner = np.array([[*begin, tip], [*(begin + 190 * along), tip]])
    track, engaged, force = milled(blank.stock(np.array([1e-3 * tip]), 0.0), corner)
    some = np.arange(3, len(track), 6)
    place = begin + 1e3 * track.place[some, None] * along
    truth = np.array([summed_force(inside, np.array([*one, tip]), heading, 8.0, MILL.teeth, 0.0, 0.1, MILL.shear_n_mm2,
                                   MILL.edge_n_mm) for one in place])
    most = np.linalg.norm(truth, axis=1).max()
    off = np.linalg.norm(force[some] - truth, axis=1)
    assert most > 100
    assert (np.linalg.norm(truth, axis=1) < 0.2 * most).any()
    # A rim that touches an edge along its whole breadth changes at once: within a step there.
    assert np.median(off) < 0.005 * most
    assert off.max() < 0.06 * most
    assert engaged.depth.max() == pytest.approx(4e-3, rel=0.02)


# Long: the volume of each solid is that of its grid below.
@pytest.mark.long
def test_slices_hold_the_volume_of_the_solid(tmp_path: Path) -> None:
    """By the divergence theorem over the triangles, which the test wrote itself."""
    for kind, (faces, _) in blanks().items():
        truth = np.einsum("ti,ti->t", faces[:, 0], np.cross(faces[:, 1], faces[:, 2])).sum() / 6
        stock = read_stock(stock_of(tmp_path, binary(faces), "units: mm\nresolution_mm: 0.7\n")).stock(
            np.array([-49.9e-3]), 0.0)
        assert 1e9 * stock.volume == pytest.approx(truth, rel=0.004), kind


# Long: finer grids of the solids that take longest.
@pytest.mark.parametrize(("kind", "resolution"), [
    *((kind, resolution) for kind in ("round", "hole") for resolution in (0.7, 1.0, 1.25, 2.0)),
    *(case for kind in ("leaning", "lying") for case in (long(kind, 0.7), long(kind, 1.0), (kind, 1.25), (kind, 2.0)))])
def test_a_sound_solid_is_cut_where_rows_of_the_grid_meet_its_corners(tmp_path: Path, kind: str, resolution: float) -> None:
    """Rows at 1 mm pass through corners of a casting, at which two edges end that were cut from two triangles."""
    faces, _ = blanks()[kind]
    file = stock_of(tmp_path, binary(faces), f"units: mm\nresolution_mm: {resolution}\n")
    stock = read_stock(file).stock(np.array([-49.9e-3]), 0.0)
    holds = abs(np.sum(np.linalg.det(faces))) / 6e9
    assert stock.volume == pytest.approx(holds, rel=0.02)


def test_distances_are_those_to_the_nearest_edge(tmp_path: Path) -> None:
    """Every point of a round bar's grid: to a micrometre near the edge, to half a cell far from it."""
    faces, _ = blanks()["round"]
    stock = read_stock(stock_of(tmp_path, binary(faces), "units: mm\nresolution_mm: 0.5\n")).stock(np.array([-4e-3]), 0.0)
    y, x = np.indices(stock.inside.shape[1:])
    away = 30.0 - np.hypot(*(1e3 * (stock.origin[k] + stock.cell * v) for k, v in enumerate((x, y))))
    off, near = np.abs(1e3 * stock.inside[0] - away), np.abs(away) < 2.0
    assert near.sum() > 1000
    assert off[near].max() < 1e-3
    assert off.max() < 0.25
