"""A second milling engine, tooth by tooth in time: the truth for forces that are worked out from the stock.

It shares nothing with endmill.py but the linear-edge law. The stock is a solid of straight-edged bodies, less everything that
the cutter's circle has gone over: a point is in it or not, exactly, there is no grid. Tips go on trochoids. What a tip meets is
what the tooth before it left in the same direction (found on its own trochoid), so that the chip's thickness is not the sine of
an angle. The edge is cut into slices that trail by the helix. Forces follow the tip's velocity. Nothing is averaged but the
result, over whole revolutions. Not modelled: deflection, chatter, the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Inside = Callable[[np.ndarray, float], np.ndarray]      # points (n, 2) [mm] at a height [mm] -> (n,) bool


@dataclass(frozen=True)
class ToothedMill:
    """Millimetres, newtons. runout_mm: how much each tooth stands out; spindle clockwise seen from above."""

    radius_mm: float = 8.0
    teeth: int = 3
    helix_deg: float = 30.0
    runout_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    shear_n_mm2: tuple[float, float, float] = (767.01, 168.8, 222.0)
    edge_n_mm: tuple[float, float, float] = (27.7, 26.6, 0.7)


@dataclass(frozen=True)
class Ways:
    """Where the axis goes: corners (K, 2) [mm] at one height each leg, tip_mm (K - 1,); the legs follow each other in time."""

    corner_mm: np.ndarray
    tip_mm: np.ndarray

    @property
    def length_mm(self) -> np.ndarray:
        """Way done at each corner (K,)."""
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.corner_mm, axis=0), axis=1))])

    def axis(self, done_mm: np.ndarray) -> np.ndarray:
        """Where the axis stands (n, 2)."""
        length = self.length_mm
        return np.column_stack([np.interp(done_mm, length, column) for column in self.corner_mm.T])


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Inside:
    """The material of a block."""
    def inside(points: np.ndarray, height: float) -> np.ndarray:
        flat = np.all((points > low[:2]) & (points < high[:2]), axis=-1)
        return flat if low[2] < height < high[2] else np.zeros_like(flat)
    return inside


def mean_forces(mill: ToothedMill, ways: Ways, stock: Inside, at_mm: np.ndarray, feed_a_tooth_mm: float, *, slices: int = 12,
                instants: int = 240, revolutions: int = 1) -> np.ndarray:
    """Mean force (n, 3) [N] on the tool, x y z, over revolutions about the places at_mm (n,) of the way."""
    tops = {float(tip): _top(stock, ways, float(tip)) for tip in np.unique(ways.tip_mm)}
    return np.array([_revolution(mill, ways, stock, place, feed_a_tooth_mm, slices, instants * revolutions, revolutions, tops)
                     for place in at_mm])


def _revolution(mill: ToothedMill, ways: Ways, stock: Inside, place: float, chip: float, slices: int, instants: int,
                revolutions: int, tops: dict[float, float]) -> np.ndarray:
    a_turn = chip * mill.teeth
    turns = (np.arange(instants) + 0.5) / instants * revolutions - 0.5 * revolutions        # time in revolutions
    leg = int(np.clip(np.searchsorted(ways.length_mm, place, side="right") - 1, 0, len(ways.tip_mm) - 1))
    tip = float(ways.tip_mm[leg])
    depth = max(tops[tip] - tip, 0.0)
    if depth <= 0:
        return np.zeros(3)
    total = np.zeros(3)
    ktc, krc, kac = mill.shear_n_mm2
    kte, kre, kae = mill.edge_n_mm
    done = place + a_turn * turns
    axis = ways.axis(done)
    dz = depth / slices
    for k in range(slices):
        up = (k + 0.5) * dz
        lag = up * np.tan(np.radians(mill.helix_deg)) / mill.radius_mm
        for tooth in range(mill.teeth):
            own = mill.radius_mm + mill.runout_mm[tooth]
            angle = -2 * np.pi * turns + lag - 2 * np.pi * tooth / mill.teeth
            out = np.column_stack([np.cos(angle), np.sin(angle)])
            thick = own - _left_by_the_one_before(mill, ways, place, turns, axis, out, tooth, lag, a_turn)
            middle = axis + (own - 0.5 * thick)[:, None] * out
            cuts = (thick > 0) & stock(middle, tip + up) & ~_gone_over(mill, ways, middle, tip + up, done - chip)
            velocity = np.gradient(axis + own * out, turns, axis=0)
            against = -velocity / np.linalg.norm(velocity, axis=1)[:, None]
            flat = (ktc * thick + kte)[:, None] * against - (krc * thick + kre)[:, None] * out
            total[:2] += dz * (flat * cuts[:, None]).sum(axis=0)
            total[2] -= dz * ((kac * thick + kae) * cuts).sum()
    return total / instants


def _top(stock: Inside, ways: Ways, tip: float) -> float:
    """Height [mm] of the part's top, `tip` where none of it is above that."""
    points = _sample(ways)
    return next((float(z) for z in np.arange(40.0, tip, -0.01) if stock(points, z - 0.005).any()), tip)


def _sample(ways: Ways) -> np.ndarray:
    """Points all over the part, to find its top."""
    low, high = ways.corner_mm.min(axis=0) - 20, ways.corner_mm.max(axis=0) + 20
    x, y = np.meshgrid(np.linspace(low[0], high[0], 25), np.linspace(low[1], high[1], 25))
    return np.column_stack([x.ravel(), y.ravel()])


def _left_by_the_one_before(mill: ToothedMill, ways: Ways, place: float, turns: np.ndarray, axis: np.ndarray, out: np.ndarray,
                            tooth: int, lag: float, a_turn: float) -> np.ndarray:
    """How far from the axis (n,) [mm] the tooth before passed in the directions out (n, 2): its tip's own path is followed."""
    before = (tooth + 1) % mill.teeth       # they follow each other clockwise
    own = mill.radius_mm + mill.runout_mm[before]
    when = turns - 1 / mill.teeth
    for _ in range(4):
        angle = -2 * np.pi * when + lag - 2 * np.pi * before / mill.teeth
        tip = ways.axis(place + a_turn * when) + own * np.column_stack([np.cos(angle), np.sin(angle)])
        seen = tip - axis
        # The direction in which it is seen, against the one that is asked for: it turns clockwise, once a revolution.
        off = np.arctan2(out[:, 0] * seen[:, 1] - out[:, 1] * seen[:, 0], np.einsum("ni,ni->n", out, seen))
        when = when + off / (2 * np.pi)
    return np.asarray(np.einsum("ni,ni->n", tip - axis, out))


def _gone_over(mill: ToothedMill, ways: Ways, points: np.ndarray, height: float, done: np.ndarray) -> np.ndarray:
    """Points (n, 2) that the cutter's circle went over at or under this height before the way `done` (n,) [mm]."""
    gone = np.zeros(len(points), dtype=bool)
    for leg, tip in enumerate(ways.tip_mm):
        if tip >= height:
            continue
        first, last = ways.corner_mm[leg], ways.corner_mm[leg + 1]
        size = float(np.linalg.norm(last - first))
        along = (last - first) / size
        reached = np.clip(done - ways.length_mm[leg], 0.0, size)
        begun = done > ways.length_mm[leg]
        share = np.clip((points - first) @ along, 0.0, reached)
        away = np.linalg.norm(points - first - share[:, None] * along, axis=1)
        gone |= begun & (away < mill.radius_mm - 1e-9)
    return gone
