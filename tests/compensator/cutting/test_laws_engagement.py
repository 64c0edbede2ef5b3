"""The engagement and its force against the engine tooth by tooth, geometry and conservation of volume."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compensator.cutting.cut import _sideways
from compensator.cutting.cutter import Cutter
from compensator.cutting.removal import mill_through
from tests.compensator.cutting.milled import FLAT, MILL, block, force_of, milled, track_along
from tests.virtual_cell.tooth_by_tooth import Ways, box, mean_forces

LOW, HIGH = (-60.0, -40.0, -20.0), (60.0, 40.0, 0.0)
SOLID = box(LOW, HIGH)


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1))))


@pytest.mark.parametrize("y", [47.7, 46.0, 40.0, 0.0, -40.0, -46.0, -47.5], ids=lambda y: f"y {y:g}")
@pytest.mark.parametrize("chip", [0.04, 0.12])
def test_the_plateau_is_that_of_the_teeth(y: float, chip: float) -> None:
    """Climb milling 0.3 mm to half wide, a slot, conventional milling: within 5 % and 3 degrees."""
    corner = np.array([[-80.0, y, -4.0], [80.0, y, -4.0]])
    track, _, force = milled(block(LOW, HIGH, (-4.0,)), corner, chip)
    truth = mean_forces(MILL, Ways(corner[:, :2], np.array([-4.0])), SOLID, np.array([80.0]), chip)[0]
    own = force[np.argmin(np.abs(track.place - 0.08))]
    assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(truth), rel=0.05)
    assert angle_deg(own, truth) < 3


@pytest.mark.parametrize("turned_deg", [0.0, 33.0])
def test_entry_corner_and_exit(turned_deg: float) -> None:
    """Into the block, round a corner in it, and out of it at an angle: within 15 % of the plateau at every place, and the
    plateaus within 5 %. The grid does not know the direction of the path."""
    turn = np.radians(turned_deg)
    end = [10.0 + 70 * np.cos(0.9 + turn), 20.0 + 70 * np.sin(0.9 + turn), -3.0]
    corner = np.array([[-80.0, 20.0, -3.0], [10.0, 20.0, -3.0], end])
    track, _, force = milled(block(LOW, HIGH, (-3.0,)), corner)
    some = np.arange(2, len(track), 9)
    truth = mean_forces(MILL, Ways(corner[:, :2], np.array([-3.0, -3.0])), SOLID, 1e3 * track.place[some], 0.1, slices=6,
                        instants=180)
    off = np.linalg.norm(force[some] - truth, axis=1)
    plateau = np.linalg.norm(truth, axis=1).max()
    # Within a step of the corner the mean over a revolution sees both directions.
    near = np.abs(1e3 * track.place[some] - 90.0) < 1.0
    assert plateau > 100
    assert off[~near].max() < 0.15 * plateau
    assert np.median(off) < 0.02 * plateau


def test_a_pass_beside_and_under_another() -> None:
    """Four passes: two beside each other, then the same deeper. Where the wall above was cut already nothing is cut again."""
    legs = [[-80.0, 44.0, -2.0], [80.0, 44.0, -2.0], [80.0, 41.0, -2.0], [-80.0, 41.0, -2.0], [-80.0, 41.0, 10.0],
            [-80.0, 44.0, 10.0], [-80.0, 44.0, -5.0], [80.0, 44.0, -5.0], [80.0, 41.0, -5.0], [-80.0, 41.0, -5.0]]
    corner = np.array(legs)
    track, engaged, force = milled(block(LOW, HIGH, (-2.0, -5.0)), corner)
    tips = np.array([-2.0, -2.0, -2.0, 10.0, 10.0, -5.0, -5.0, -5.0, -5.0])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corner, axis=0), axis=1))])
    for leg in (0, 2, 6, 8):
        middle = 0.5 * (length[leg] + length[leg + 1])
        own = force[np.argmin(np.abs(1e3 * track.place - middle))]
        # The engine knows ways in the plane alone: moves along the axis are left out of it.
        ways = Ways(np.delete(corner, [4, 6], axis=0)[:, :2], np.delete(tips, [3, 5]))
        away = middle - (12.0 if leg > 3 else 0.0) - (15.0 if leg > 5 else 0.0)
        truth = mean_forces(MILL, ways, SOLID, np.array([away]), 0.1)[0]
        assert own == pytest.approx(truth, abs=0.04 * np.linalg.norm(truth)), leg
    deep = engaged.depth[np.argmin(np.abs(1e3 * track.place - 0.5 * (length[8] + length[9])))]
    assert deep == pytest.approx(3e-3, rel=1e-6)


def test_a_spring_pass_cuts_nothing() -> None:
    """The wall that the cutter itself left is where it went, to the film that counts as none."""
    stock = block(LOW, HIGH, (-4.0,))
    for corner in ([[-80.0, 45.0, -4.0], [80.0, 45.0, -4.0]], [[80.0, 45.0, -4.0], [-80.0, 45.0, -4.0]],
                   [[-80.0, 45.0, -4.0], [80.0, 45.0, -4.0]]):
        track = track_along(np.array(corner))
        engaged, stock = mill_through(stock, track, FLAT)
    assert not engaged.cuts.any()
    assert not force_of(track, engaged).any()


@pytest.mark.parametrize("cutter", [FLAT, Cutter(8e-3, 3, 2e-3), Cutter(8e-3, 3, 8e-3)], ids=["flat", "bull", "ball"])
def test_what_is_taken_away_is_what_the_chips_are(cutter: Cutter) -> None:
    """Width times depth times way is the volume that is gone, of every kind of cutter, along a way with corners."""
    levels = tuple(-5.0 + 8.0 * (1 - np.cos(np.linspace(0, np.pi / 2, 17)))) if cutter.corner else ()
    stock = block(LOW, HIGH, (-5.0, *[level for level in levels if level < 0]))
    before = stock.volume
    corner = np.array([[-80.0, -10.0, -5.0], [20.0, -10.0, -5.0], [40.0, 15.0, -5.0], [-80.0, 20.0, -5.0]])
    track = track_along(corner)
    engaged, left = mill_through(stock, track, cutter)
    assert left.volume < before == stock.volume
    assert float(engaged.width * engaged.depth @ track.length) == pytest.approx(before - left.volume, rel=0.01)


def test_up_and_down_milling_are_told_apart() -> None:
    _, climb, _ = milled(block(LOW, HIGH, (-4.0,)), np.array([[-80.0, 46.0, -4.0], [80.0, 46.0, -4.0]]))
    _, conventional, _ = milled(block(LOW, HIGH, (-4.0,)), np.array([[-80.0, -46.0, -4.0], [80.0, -46.0, -4.0]]))
    reach = np.degrees(np.arccos(1 - 2.0 / 8.0))
    assert np.degrees([climb.low[160], climb.high[160]]) == pytest.approx([-90, -90 + reach], abs=0.5)
    assert np.degrees([conventional.low[160], conventional.high[160]]) == pytest.approx([90 - reach, 90], abs=0.5)
    assert climb.width[160] == pytest.approx(2e-3, rel=0.02)


def test_the_grid_does_not_matter() -> None:
    """At 0.5 mm the force is that at 0.1 mm, to a few per cent in the middle of the cut."""
    corner = np.array([[-80.0, 47.0, -4.0], [80.0, 47.0, -4.0]])
    coarse, fine = (milled(block(LOW, HIGH, (-4.0,), cell), corner)[2][160] for cell in (0.5, 0.1))
    assert coarse == pytest.approx(fine, abs=0.03 * np.linalg.norm(fine))


@pytest.mark.parametrize("kind", ["joint", "tilted", "no feed", "plunge", "box"])
def test_what_is_not_known_is_said(kind: str) -> None:
    stock = block(LOW, HIGH, (-4.0,))
    corner = np.array([[-80.0, 0.0, -4.0], [80.0, 0.0, -4.0]])
    if kind == "plunge":
        corner = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, -4.0]])
    track = track_along(corner)
    count = len(track)
    changed = {"joint": {"joint": np.ones(count, dtype=bool)},
               "tilted": {"axis": np.tile([0.0, np.sin(0.03), np.cos(0.03)], (count, 1))},
               "no feed": {"chip": np.full(count, np.nan)}}.get(kind, {})
    if kind == "box":
        stock = replace(stock, unknown=1e-3 * np.array([[[-10.0, -10, -10], [10.0, 10, 10]]]))
    engaged, _ = mill_through(stock, replace(track, **changed), FLAT)
    if kind == "box":
        where = np.abs(1e3 * track.start[:, 0]) < 17
        assert engaged.unknown[where].all()
        assert not engaged.unknown[np.abs(1e3 * track.start[:, 0]) > 20].any()
    else:
        assert (engaged.unknown | ~engaged.cuts).all()
        assert engaged.unknown.sum() > 3


def test_the_ball_has_the_force_of_a_stack_of_discs() -> None:
    """A ball's slot by summing over slices with an integral of its own: another way to the same number."""
    ball, depth, chip = Cutter(8e-3, 3, 8e-3), 3.0, 0.1
    levels = tuple(np.linspace(-depth, 0, 61)[1:-1])
    _, _, force = milled(block(LOW, HIGH, levels), np.array([[-80.0, 0.0, -depth], [80.0, 0.0, -depth]]), chip, ball)
    ktc, krc, kac = MILL.shear_n_mm2
    kte, kre, kae = MILL.edge_n_mm
    total = np.zeros(3)
    kappa = np.linspace(0, np.arccos(1 - depth / 8.0), 4001)
    kappa = 0.5 * (kappa[1:] + kappa[:-1])
    width = 8.0 * np.arccos(1 - depth / 8.0) / 4000
    for phi in np.radians(np.arange(-89.5, 90, 1.0)):
        normal = np.stack([np.sin(kappa) * np.cos(phi), np.sin(kappa) * np.sin(phi), -np.cos(kappa)])
        upward = np.stack([np.cos(kappa) * np.cos(phi), np.cos(kappa) * np.sin(phi), np.sin(kappa)])
        against = np.array([-np.sin(phi), np.cos(phi), 0.0])
        h = chip * np.cos(phi) * np.sin(kappa)
        share = np.radians(1.0) * 3 / (2 * np.pi) * width
        total += share * (against * (ktc * h + kte).sum() - normal @ (krc * h + kre) - upward @ (kac * h + kae))
    assert force[160] == pytest.approx(total, abs=0.02 * np.linalg.norm(total))


def test_forces_are_linear_in_the_coefficients() -> None:
    track, engaged, force = milled(block(LOW, HIGH, (-4.0,)), np.array([[-80.0, 45.0, -4.0], [80.0, 45.0, -4.0]]))
    parts = [force_of(track, engaged, row) for row in np.eye(6)]
    rng = np.random.default_rng(5)
    mixed = rng.normal(size=6)
    assert force_of(track, engaged, mixed) == pytest.approx(np.einsum("k,ksi->si", mixed, np.array(parts)), abs=1e-12)
    assert np.isfinite(force).all()


def test_beside_the_stock_a_way_cuts_no_layer() -> None:
    """Ways over the stock, and as far beside it as the tool reaches, go sideways in it; such as lie farther off along either
    axis, and those straight up or down, do not."""
    bounds, reach = 1e-3 * np.array([[0.0, 0, -20], [100, 50, 0]]), 10e-3

    def one(start: Any, end: Any, z: tuple[float, float] = (-2, -2)) -> bool:
        track: Any = SimpleNamespace(start=1e-3 * np.array([[*start, z[0]]]), end=1e-3 * np.array([[*end, z[1]]]))
        return bool(_sideways(track, bounds, reach)[0])

    assert one((10, 10), (20, 10))
    assert one((10, 10), (10, 20), (-2, -5))
    assert one((-30, 25), (130, 25))
    assert not one((10, 10), (10, 10), (0, -5))
    for axis, near, far in ((0, (-9, 25), (-11, 25)), (0, (109, 25), (111, 25)), (1, (50, -9), (50, -11)),
                            (1, (50, 59), (50, 61))):
        along = np.roll([0.0, 1.0], axis)
        assert one(near, near + along)
        assert not one(far, far + along)
