"""What an end mill meets in a stock, and what that pushes it with: brute force, in stock_cut.c, which is compiled here.

    python benchmarks/stock_cut.py

holds the engine against what can be worked out by hand. At each step (a fraction of a millimetre) each point of the cutter's
surface is asked whether it stands in material: inside the stock, and not where the cutter, or an earlier one, has been. Flat
and bull-nose cutters ask the ways themselves, a ball a net of heights. All teeth pass all engaged bits of a revolution; the
edge's force is Altintas' linear law, if wanted with a size effect and teeth that stand out unequally. The tool yields by a
given compliance, and cuts where it then stands. Nothing of the program is imported. Millimetres, newton, seconds; z is up.
"""

import ctypes
import math
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

ANGLES = 20000


class _Cutter(ctypes.Structure):
    _fields_ = [(n, ctypes.c_double) for n in ("radius", "corner", "flute", "helix", "out", "phase", "kt", "kr", "ka",
                                               "et", "er", "ea", "power", "chip0")] + [("teeth", ctypes.c_int)]


_DOUBLES = ctypes.POINTER(ctypes.c_double)


class _Stock(ctypes.Structure):
    _fields_ = [("boxes", _DOUBLES), ("corners", _DOUBLES), ("net", _DOUBLES), ("polygon_top", ctypes.c_double),
                ("net_x", ctypes.c_double), ("net_y", ctypes.c_double), ("net_cell", ctypes.c_double),
                *((n, ctypes.c_int) for n in ("n_boxes", "n_corners", "nx", "ny"))]


@dataclass
class Cutter:
    """Diameter and corner [mm], edges in N/mm^2 and N/mm: t along the speed, r the normal, a the edge; helix [rad]."""

    diameter: float
    teeth: int
    k: tuple[float, float, float]
    e: tuple[float, float, float]
    corner: float = 0.0
    flute: float = 60.0
    helix: float = 0.5
    out: float = 0.0        # how far the axis is aside [mm]
    phase: float = 0.0
    power: float = 0.0      # a chip's specific force goes with its thickness to minus this
    chip0: float = 0.05     # where it is k


@dataclass
class Stock:
    """Boxes (n, 5): x0 y0 x1 y1 top; a convex polygon (n, 2), counterclockwise, with its top; a net of heights (ny, nx)."""

    boxes: list[list[float]] = field(default_factory=list)
    polygon: list[list[float]] = field(default_factory=list)
    polygon_top: float = 0.0
    net: list[list[float]] = field(default_factory=list)
    net_at: tuple[float, float] = (0.0, 0.0)
    net_cell: float = 1.0

    def moved(self, shift: np.ndarray) -> "Stock":
        """The same stock, set aside by `shift` (3,) [mm]."""
        x, y, z = shift
        return Stock([[a + x, b + y, c + x, d + y, t + z] for a, b, c, d, t in self.boxes],
                     [[a + x, b + y] for a, b in self.polygon], self.polygon_top + z,
                     [[h + z for h in row] for row in self.net], (self.net_at[0] + x, self.net_at[1] + y), self.net_cell)


@dataclass
class Cut:
    """Of each step the mean force on the tool (n, 3), where the tool stood (n, 3), the chip's cross-section [mm^2], depth."""

    force: np.ndarray
    place: np.ndarray
    area: np.ndarray
    depth: np.ndarray
    ways: np.ndarray        # (n - 1, 8): from, to, radius, corner; what a later cutter finds taken


_LIBRARY: list[ctypes.CDLL] = []


def library() -> ctypes.CDLL:
    """stock_cut.c, compiled once a process."""
    if not _LIBRARY:
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / "stock_cut.so"
            source = Path(__file__).with_suffix(".c")
            options = ["-O3", "-march=native", "-ffast-math", "-shared", "-fPIC"]
            subprocess.run(["cc", *options, str(source), "-o", str(made), "-lm"], check=True)
            _LIBRARY.append(ctypes.CDLL(str(made)))
    return _LIBRARY[0]


def pointer(a: np.ndarray) -> object:
    return a.ctypes.data_as(_DOUBLES)


def drive(place: np.ndarray, speed: np.ndarray, rpm: float, cutter: Cutter, stock: Stock, give: np.ndarray | None = None,
          give0: np.ndarray | None = None, at0: np.ndarray | None = None, earlier: np.ndarray | None = None,
          cell: float = 0.1) -> Cut:
    """Go through places (n, 3) at speeds (n,) [mm/s]; the tool stands aside by give0 + give (F - at0), (n, 3), (n, 3, 3)."""
    n = len(place)
    step = np.diff(place, axis=0, prepend=place[:1] - (place[1:2] - place[:1]))
    way = step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    def flat(a: np.ndarray | None, *shape: int) -> np.ndarray:
        return np.zeros(shape) if a is None else np.ascontiguousarray(a, float).reshape(shape)
    place, way, speed = flat(place, n, 3), flat(way, n, 3), flat(speed, n)
    give, give0, at0 = flat(give, n, 9), flat(give0, n, 3), flat(at0, n, 3)
    before = flat(earlier, len(earlier) if earlier is not None else 0, 8)
    c = _Cutter(cutter.diameter / 2, cutter.corner, cutter.flute, cutter.helix, cutter.out, cutter.phase, *cutter.k, *cutter.e,
                cutter.power, cutter.chip0, cutter.teeth)
    boxes, corners, net = (np.ascontiguousarray(v, float) for v in (stock.boxes, stock.polygon, stock.net))
    s = _Stock(pointer(boxes), pointer(corners), pointer(net), stock.polygon_top, *stock.net_at, stock.net_cell,
               len(boxes), len(corners), net.shape[1] if net.size else 0, len(net) if net.size else 0)
    force, out, seen = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 2))
    failed = library().drive(
        ctypes.c_int(n), *map(pointer, (place, way, speed, give, give0, at0)), ctypes.c_double(rpm), ctypes.byref(c),
        ctypes.byref(s), ctypes.c_int(len(before)), pointer(before), ctypes.c_double(cell), *map(pointer, (force, out, seen)))
    if failed:
        raise MemoryError("stock_cut")
    ways = np.column_stack([out[:-1], out[1:], np.full((n - 1, 2), [cutter.diameter / 2, cutter.corner])])
    return Cut(force, out, seen[:, 0], seen[:, 1], ways)


# ---- by hand --------------------------------------------------------------------------------


def line(a: tuple[float, ...], b: tuple[float, ...], step: float = 0.25) -> np.ndarray:
    n = int(np.ceil(math.dist(a, b) / step))
    return np.array(a) + np.linspace(0, 1, n + 1)[:, None] * (np.array(b) - np.array(a))


def turned(cutter: Cutter, feed: float, depth: float, start: float, stop: float) -> np.ndarray:
    """Mean force (along feed, to the left, up) of helical teeth that turn in small steps, angles from the left by Altintas."""
    theta, total = np.linspace(0, 2 * np.pi, 3600, endpoint=False), np.zeros(3)
    layers = 60
    for n in range(layers):
        z = (n + 0.5) * depth / layers
        for j in range(cutter.teeth):
            phi = (theta - 2 * np.pi * j / cutter.teeth - z * np.tan(cutter.helix) / (cutter.diameter / 2)) % (2 * np.pi)
            chip = feed * np.sin(phi)
            cuts = (phi >= start) & (phi <= stop)
            t, r, a = (np.where(cuts, k * chip + e, 0) * depth / layers for k, e in zip(cutter.k, cutter.e, strict=True))
            # the tooth goes from the left (phi 0) over the front; it is pushed against its way, inwards and down
            total += [(-t * np.cos(phi) - r * np.sin(phi)).mean(), (t * np.sin(phi) - r * np.cos(phi)).mean(), -a.mean()]
    return total


def check() -> None:
    """Full slot, side cut, ball slot, removed volume; prints what the engine has and what is right."""
    cutter = Cutter(10, 3, (800, 170, 220), (28, 31, 1.5))
    feed, depth, rpm = 0.08, 2.0, 6000.0
    speed = feed * 3 * rpm / 60
    block = Stock([[-30, -30, 30, 30, 0]])
    path = line((-40, 0, -depth), (40, 0, -depth))
    cut = drive(path, np.full(len(path), speed), rpm, cutter, block)
    k = np.argmin(np.abs(path[:, 0]))
    n, (kt, kr, ka), (et, er, ea) = cutter.teeth, cutter.k, cutter.e
    hand = np.array([-n * depth * (kr * feed / 4 + er / np.pi), n * depth * (kt * feed / 4 + et / np.pi),
                     -n * depth * (ka * feed / np.pi + ea / 2)])
    print("slot, force        ", np.round(cut.force[k], 3), "by hand", np.round(hand, 3))
    ahead = cut.area * np.gradient(path[:, 0])
    print("slot, volume       ", round(float(ahead.sum()), 2), "by hand", 60 * 10 * depth)
    for name, y in (("climb", 8.0 + 25), ("conventional", -8.0 - 25)):    # along +x: climb has the stock on the right
        path = line((-40, y, -depth), (40, y, -depth))
        cut = drive(path, np.full(len(path), speed), rpm, cutter, block)
        wide = np.arccos(1 - 2 * 2 / 10)
        span = (np.pi - wide, np.pi) if name == "climb" else (0, wide)
        print(f"side, {name:13}", np.round(cut.force[np.argmin(np.abs(path[:, 0]))], 3), "turning teeth", np.round(
            turned(cutter, feed, depth, *span), 3), "volume", round(float((cut.area * 0.25).sum()), 1), "by hand", 240)
    ball = Cutter(10, 2, (800, 170, 220), (28, 31, 1.5), corner=5)
    path = line((-40, 0, -2), (40, 0, -2))
    cut = drive(path, np.full(len(path), feed * 2 * rpm / 60), rpm, ball, block)
    segment = 25 * np.arccos(3 / 5) - 3 * 4
    print("ball slot, volume  ", round(float((cut.area * 0.25).sum()), 1), "by hand", round(60 * float(segment), 1))
    k1 = np.arccos(3 / 5)                                              # all of the front below the surface
    width = 5 * k1
    q = np.linspace(0, k1, ANGLES)
    hand = np.array([0, 2 * (800 * feed / 4 * 5 * np.trapezoid(np.sin(q), q) + 28 / np.pi * width),
                     2 * (170 * feed / np.pi * 5 * np.trapezoid(np.sin(q) * np.cos(q), q) + 31 / 2 * 5 * np.sin(k1)
                          - 220 * feed / np.pi * 5 * np.trapezoid(np.sin(q) ** 2, q) - 1.5 / 2 * 5 * (1 - np.cos(k1)))])
    print("ball slot, force   ", np.round(cut.force[np.argmin(np.abs(path[:, 0]))], 2), "by hand (y, z)", np.round(hand[1:], 2))
    give = np.broadcast_to(np.eye(3) * 2e-3, (len(path), 3, 3))
    path = line((-40, 33, -depth), (40, 33, -depth))
    soft = drive(path, np.full(len(path), speed), rpm, cutter, block, give[:len(path)])
    k = np.argmin(np.abs(path[:, 0]))
    again = drive(soft.place[k - 3:k + 1], np.full(4, speed), rpm, cutter, block)
    print("yields             ", np.round(soft.force[k], 2), "force at that place", np.round(again.force[-1], 2), "aside",
          np.round(soft.place[k] - path[k], 4))
    up = np.array([0, 0, 30.0])
    spring = drive(np.vstack([path, path + up, path[::-1] + up, path]), np.full(4 * len(path), speed), rpm, cutter,
                   block, np.broadcast_to(np.eye(3) * 2e-3, (4 * len(path), 3, 3)))
    print("spring pass, share ", np.round(np.linalg.norm(spring.force[3 * len(path) + k] / np.linalg.norm(spring.force[k])), 3))
    run_out = Cutter(10, 3, (800, 170, 220), (28, 31, 1.5), out=0.012)
    print("run-out 12 um      ", np.round(drive(path, np.full(len(path), speed), rpm, run_out, block).force[k], 2), "without",
          np.round(drive(path, np.full(len(path), speed), rpm, cutter, block).force[k], 2))


if __name__ == "__main__":
    np.set_printoptions(suppress=True)
    sys.exit(check())
