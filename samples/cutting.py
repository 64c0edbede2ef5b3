"""Milling forces at sensor rate, for the sample: a mechanistic model of a ball mill, then what a sensor makes of it.

The edge of each tooth is cut into elements over the polar angle kappa (0 at the tip, 90 deg at the equator) and on up
the shank by one step. With e_r the unit vector from the ball's centre to an element, e_k = d e_r / d kappa and e_t
against the element's speed, the force ON THE TOOL of an element in the cut is (the form of Lee and Altintas for
ball-end milling: a shear part on the chip's area, an edge part on the edge's length)

    dF = (Ktc h + Kte) b e_t - (Krc h + Kre) b e_r - (Kac h + Kae) b e_k,      b = R dkappa (or dz),
    h  = f_z (t . e_r) + (rho_j - rho_{j-1}) sin kappa,

t the feed's direction, f_z the feed a tooth, rho_j the run-out of tooth j. An element is in the cut where h > 0, where
it lies under the stock's surface (a plane, `allowance` above the finished one), outside the groove of the pass before
(a cylinder of the ball's radius, `step` aside) and where the caller says that there is stock (edges of the part).
Not modelled: curvature of the stock within the contact, deflection, chatter, rubbing behind the tip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from samples.cam import CutterPath

Array = NDArray[np.float64]
StockMask = Callable[[Array, Array, Array], NDArray[np.bool_]]
_BALL, _SHANK, _CHUNK = 24, 6, 1024         # elements a tooth; samples at once: small arrays stay in the cache


@dataclass(frozen=True)
class Process:
    """Spindle, cutter and material of a pass.

    Coefficients: Al7075-T6, cemented carbide, dry: Chinese Journal of Mechanical Engineering, doi
    10.1186/s10033-021-00536-9, table 5, the row of its reference 190. The table's unit "N mm" of the edge coefficients
    is read as N/mm. All else is made up for the sample.
    """

    spindle_rpm: float = 9000.0
    teeth: int = 3
    helix_lag_deg: float = 25.0             # from the tip to the equator
    runout_mm: tuple[float, ...] = (0.012, 0.0, 0.0)        # one tooth stands out
    shear_n_mm2: tuple[float, float, float] = (767.01, 168.8, 222.0)        # Ktc, Krc, Kac
    edge_n_mm: tuple[float, float, float] = (27.7, 26.6, 0.7)               # Kte, Kre, Kae

    def __post_init__(self) -> None:
        if self.teeth < 1 or len(self.runout_mm) != self.teeth:
            raise ValueError(f"runout_mm must have one entry a tooth ({self.teeth}); received {self.runout_mm}")

    @property
    def tooth_passing_hz(self) -> float:
        """Teeth times revolutions a second [Hz]."""
        return self.teeth * self.spindle_rpm / 60.0


@dataclass(frozen=True)
class ForceLog:
    """M samples: time_s (M,), TCP position_mm (M, 3) and force_n (M, 3) on the tool in the work object, target (M,).

    `target` is the index of the path's target that the tool moves to.
    """

    time_s: Array
    position_mm: Array
    force_n: Array
    target: NDArray[np.intp]


def everywhere(x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
    """Stock without end: no entry and no exit."""
    return np.ones(np.shape(x), dtype=bool)


def _frame(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) across the tool axis (n, 3), so that u, v, axis are right-handed (axis not along y)."""
    u = np.cross([0.0, 1.0, 0.0], axis)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(axis, u)


def _elements(radius_mm: float, shank_mm: float, shift: float) -> list[tuple[float, float, float, float]]:
    """Elements of one edge: sin and cos of kappa, height on the shank above the equator [mm], length b [mm].

    `shift` in (0, 1) places the elements differently on each tooth: together the teeth sample the edge more finely.
    """
    angle = (np.arange(_BALL) + shift) * (0.5 * np.pi / _BALL)
    ball = [(float(np.sin(k)), float(np.cos(k)), 0.0, 0.5 * np.pi * radius_mm / _BALL) for k in angle]
    rise = (np.arange(_SHANK) + shift) * (shank_mm / _SHANK)
    return ball + [(1.0, 0.0, float(r), shank_mm / _SHANK) for r in rise]


def tooth_forces(centre_mm: Array, axis: Array, feed: Array, normal: Array, side: Array, feed_a_tooth_mm: Array,
                 allowance_mm: Array, step_mm: Array, spindle_rad: Array, radius_mm: float, process: Process,
                 stock: StockMask = everywhere) -> Array:
    """Instantaneous force on the tool (n, 3) [N], in the frame of the vectors.

    centre_mm (n, 3) ball's centre; axis, feed, normal, side (n, 3) unit vectors (tip to spindle, direction of travel,
    surface to centre, towards the uncut stock); feed_a_tooth_mm, allowance_mm, step_mm (n,) [mm]; spindle_rad (n,)
    angle of the first tooth [rad]. The spindle turns clockwise seen from above (M3).
    """
    u, v = _frame(axis)
    lag, runout = np.radians(process.helix_lag_deg), np.array(process.runout_mm)
    chip_extra = runout - np.roll(runout, 1)
    (ktc, krc, kac), (kte, kre, kae) = process.shear_n_mm2, process.edge_n_mm

    def dots(w: Array) -> tuple[Array, Array, Array]:
        return np.sum(w * u, axis=1), np.sum(w * v, axis=1), np.sum(w * axis, axis=1)

    (tu, tv, ta), (nu, nv, na), (su, sv, sa) = dots(feed), dots(normal), dots(side)
    force = np.zeros_like(centre_mm)
    for tooth in range(process.teeth):
        phi = -spindle_rad - 2.0 * np.pi * tooth / process.teeth            # clockwise; the next tooth comes behind
        for sk, ck, rise, length in _elements(radius_mm, float(np.max(step_mm)), (tooth + 0.5) / process.teeth):
            dphi = lag * (1.0 - ck + rise / radius_mm)                      # the upper edge trails
            cos, sin = np.cos(phi + dphi), np.sin(phi + dphi)
            forward = sk * (cos * tu + sin * tv) - ck * ta
            chip = feed_a_tooth_mm * forward + chip_extra[tooth] * sk
            reach, drop = radius_mm * sk, rise - radius_mm * ck     # from the axis, over the centre
            height = reach * (cos * nu + sin * nv) + drop * na
            across = reach * (cos * su + sin * sv) + drop * sa + step_mm
            cut = (chip > 0.0) & (forward > 0.0) & (height < allowance_mm - radius_mm)
            cut &= across * across + height * height > radius_mm**2
            i = np.flatnonzero(cut)
            if not i.size:
                continue
            rho = cos[i, None] * u[i] + sin[i, None] * v[i]
            point = centre_mm[i] + reach * rho + drop * axis[i]
            kept = stock(point[:, 0], point[:, 1], point[:, 2])
            i, rho = i[kept], rho[kept]
            e_r, e_k = sk * rho - ck * axis[i], ck * rho + sk * axis[i]
            e_t = np.cross(axis[i], rho)                                    # against the tooth's velocity, -axis x rho
            h = chip[i, None]
            force[i] += length * ((ktc * h + kte) * e_t - (krc * h + kre) * e_r - (kac * h + kae) * e_k)
    return force


def force_log(path: CutterPath, allowance: Callable[[Array, Array], Array], process: Process | None = None,
              stock: StockMask = everywhere, rate_hz: float = 1500.0, phase_rad: float = 0.0,
              average: int = 4) -> ForceLog:
    """The force along a path as a perfect sensor logs it, at constant rate and programmed feed.

    allowance(x, y) [mm] gives the stock under the ball's centre; each sample is the mean of `average` instants spread
    evenly over its period, a simple anti-alias filter. Zero on every move that does not cut.
    """
    process = process or Process()
    ends = np.cumsum(path.duration_s)
    time = np.arange(int(ends[-1] * rate_hz) + 1) / rate_hz
    position, force = np.empty((time.size, 3)), np.zeros((time.size, 3))
    target = np.clip(np.searchsorted(ends, time, side="left"), 1, len(path) - 1)
    spread = (np.arange(average) - 0.5 * (average - 1)) / (average * rate_hz)
    omega = 2.0 * np.pi * process.spindle_rpm / 60.0
    centre = path.centre_mm
    for start in range(0, time.size, _CHUNK):
        chunk = slice(start, min(start + _CHUNK, time.size))
        i, s = _place(ends, time[chunk])
        position[chunk] = _between(path.position_mm, i, s)
        instants = np.clip(time[chunk, None] + spread, 0.0, ends[-1]).ravel()
        i, s = _place(ends, instants)
        busy = np.flatnonzero(path.cutting[i])
        if not busy.size:
            continue
        i, s, instants = i[busy], s[busy], instants[busy]
        move = path.position_mm[i] - path.position_mm[i - 1]
        feed = move / np.linalg.norm(move, axis=1, keepdims=True)
        normal, side, axis = (_unit(_between(a, i, s)) for a in (path.contact_normal, path.side, path.tool_axis))
        ball = _between(centre, i, s)
        values = np.zeros((average * (chunk.stop - chunk.start), 3))
        values[busy] = tooth_forces(
            ball, axis, feed, normal, side, path.feed_mm_s[i] / process.tooth_passing_hz,
            allowance(ball[:, 0], ball[:, 1]), path.step_mm[i], omega * instants + phase_rad, path.radius_mm,
            process, stock)
        force[chunk] = values.reshape(-1, average, 3).mean(axis=1)
    return ForceLog(time, position, force, target)


def _place(ends: Array, time: Array) -> tuple[NDArray[np.intp], Array]:
    """Target that the tool moves to at each time, from 1, and the share (n, 1) of that move already done."""
    i = np.clip(np.searchsorted(ends, time, side="left"), 1, len(ends) - 1)
    return i, ((time - ends[i - 1]) / (ends[i] - ends[i - 1]))[:, None]


def _between(rows: Array, i: NDArray[np.intp], s: Array) -> Array:
    return np.asarray((1.0 - s) * rows[i - 1] + s * rows[i], dtype=float)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True), dtype=float)


def sensor(force_n: ArrayLike, rng: np.random.Generator, bias_n: tuple[float, float, float] = (2.6, -3.4, 4.1),
           noise_std_n: float = 1.5, step_n: float = 1.0 / 32.0) -> Array:
    """What a sensor reports of forces (M, 3) [N]: bias a channel, white noise, quantisation. Made-up figures."""
    force = np.asarray(force_n, dtype=float)
    raw = force + np.asarray(bias_n) + noise_std_n * rng.standard_normal(force.shape)
    return np.asarray(step_n * np.round(raw / step_n))
