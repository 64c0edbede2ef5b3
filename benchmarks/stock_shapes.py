"""Toolpaths of shops, with the stock they start from: what stock_jobs.py puts into RAPID. Nothing of the program is imported.

Each shape is made as a climb cut for a clockwise spindle (material on the right of the feed); conventional is its mirror image
in y. Millimetres in the work object, z up, the nominal top of the blank at 0, the tip of the tool.
"""

import math

import numpy as np
from stock_cut import Stock

SAFE, NEAR = 40.0, 3.0


class Way:
    """Steps as shop_posts.py takes them; moves in the air stand at z above the stock, or beside it."""

    def __init__(self) -> None:
        self.steps: list[dict] = []
        self.layer = 0
        self.share = 1.0        # of the cutting feed

    def add(self, kind: str, p: tuple[float, ...], cut: bool, via: np.ndarray | None = None) -> None:
        self.steps.append({"kind": kind, "place": np.array(p, float), "via": via, "cut": cut, "layer": self.layer,
                           "tilt": (0.0, 0.0), "share": self.share})

    def fly(self, x: float, y: float, z: float) -> None:
        self.add("L" if self.steps else "J", (x, y, z), False)

    def down(self, x: float, y: float, z: float) -> None:
        """From safe height to z, in the air all the way."""
        self.fly(x, y, SAFE)
        self.fly(x, y, max(z, 0) + NEAR)
        if z < NEAR:
            self.fly(x, y, z)

    def up(self) -> None:
        x, y, _ = self.steps[-1]["place"]
        self.fly(float(x), float(y), SAFE)

    def cut(self, x: float, y: float, z: float) -> None:
        self.add("L", (x, y, z), True)

    def arc(self, via: tuple[float, ...], to: tuple[float, ...]) -> None:
        self.add("C", to, True, np.array(via, float))

    def quarter(self, centre: tuple[float, float], to: tuple[float, float], z: float) -> None:
        """A short arc about the centre, less than half a turn, from where the tool stands."""
        c, a, b = np.array(centre), self.steps[-1]["place"][:2], np.array(to)
        middle = (a - c) + (b - c)
        via = c + middle / np.linalg.norm(middle) * np.linalg.norm(b - c)
        self.arc((*via, z), (*to, z))


def box(x0: float, y0: float, x1: float, y1: float, top: float = 0.0) -> Stock:
    return Stock([[x0, y0, x1, y1, top]])


def facing(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    w, h, r, step = rng.uniform(50, 90), rng.uniform(35, 60), d / 2, 0.6 * d
    t, to_and_fro = Way(), rng.random() < 0.4
    for n in range(levels):
        z, y, k = -ap * (n + 1), h + r - step, 0
        t.layer = n
        t.down(-r - 4, y, z)
        while True:
            ahead = not to_and_fro or k % 2 == 0
            t.cut(w + r + 2 if ahead else -r - 2, y, z)
            if y - r <= 0:
                break
            y, k = y - step, k + 1
            if to_and_fro:
                t.cut(float(t.steps[-1]["place"][0]), y, z)
            else:
                t.fly(w + r + 2, y + step, NEAR + 2)
                t.fly(-r - 4, y, NEAR + 2)
                t.fly(-r - 4, y, z)
        t.up()
    return t, box(0, 0, w, h)


def slot(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    long, bend, r, t = rng.uniform(30, 60), rng.random() < 0.6, d / 2, Way()
    rb, tail = rng.uniform(d, 2 * d), rng.uniform(10, 25)
    for n in range(levels):
        z = -ap * (n + 1)
        t.layer = n
        t.down(-r - 5, 0, z)
        t.cut(long, 0, z)
        if bend:
            t.quarter((long, rb), (long + rb, rb), z)
            t.cut(long + rb, rb + tail, z)
        t.up()
    return t, box(0, -2 * d, long + (rb + 1.5 * d if bend else 2 * d), rb + tail + 1.5 * d if bend else 2 * d)


def wall(rng: np.random.Generator, d: float, ap: float, levels: int, ae: float) -> tuple[Way, Stock]:
    """A boss with rounded corners, its sides finished in steps down."""
    w, h, rr, r, t = rng.uniform(35, 70), rng.uniform(30, 50), rng.uniform(2, 8), d / 2, Way()
    m, lead = h / 2, 5.0
    for n in range(levels):
        z = -ap * (n + 1)
        t.layer = n
        t.down(-r - lead, m - lead, z)
        t.quarter((-r - lead, m), (-r, m), z)
        t.cut(-r, h - rr, z)
        t.quarter((rr, h - rr), (rr, h + r), z)
        t.cut(w - rr, h + r, z)
        t.quarter((w - rr, h - rr), (w + r, h - rr), z)
        t.cut(w + r, rr, z)
        t.quarter((w - rr, rr), (w - rr, -r), z)
        t.cut(rr, -r, z)
        t.quarter((rr, rr), (-r, rr), z)
        t.cut(-r, m, z)
        t.quarter((-r - lead, m), (-r - lead, m + lead), z)
        t.up()
    return t, box(-ae, -ae, w + ae, h + ae)


def polygon(rng: np.random.Generator, d: float, ap: float, levels: int, ae: float) -> tuple[Way, Stock]:
    """The sides of a prism with five or six corners; its blank is the same with an allowance."""
    n, r, t = int(rng.integers(5, 7)), d / 2, Way()
    angle = np.sort((np.arange(n) + rng.uniform(-0.2, 0.2, n)) * 2 * np.pi / n)
    p = np.stack([rng.uniform(28, 42) * np.cos(angle), rng.uniform(24, 34) * np.sin(angle)], 1)[::-1]   # clockwise
    side = np.roll(p, -1, 0) - p
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    out = np.stack([-side[:, 1], side[:, 0]], 1)                      # left of a clockwise way
    def corner(k: int, off: float) -> np.ndarray:
        a, b = out[k - 1], out[k % n]
        return p[k % n] + off * (a + b) / (1 + a @ b)
    blank = np.array([corner(k, ae) for k in range(n)])[::-1]
    start, lead = (p[0] + p[1]) / 2 + r * out[0], 5.0
    for level in range(levels):
        z = -ap * (level + 1)
        t.layer = level
        centre = start + lead * out[0]
        t.down(*(centre - lead * side[0]), z)
        t.quarter(tuple(centre), tuple(start), z)
        for k in range(1, n + 1):
            t.cut(*(p[k % n] + r * out[k - 1]), z)
            t.quarter(tuple(p[k % n]), tuple(p[k % n] + r * out[k % n]), z)
        t.cut(*start, z)
        t.quarter(tuple(centre), tuple(centre + lead * side[0]), z)
        t.up()
    return t, Stock(polygon=np.round(blank, 4).tolist(), polygon_top=0.0)


def helix(t: Way, r: float, top: float, bottom: float, slope: float = 0.038) -> None:
    turns = math.ceil((top - bottom) / (2 * np.pi * r * slope))
    count = 16 * turns
    for k in range(1, count + 1):
        a = 2 * np.pi * k / 16
        t.cut(r * np.cos(a), r * np.sin(a), top + (bottom - top) * k / count)
    for k in range(1, 17):                                             # once round on the level
        t.cut(r * np.cos(2 * np.pi * k / 16), r * np.sin(2 * np.pi * k / 16), bottom)


def pocket(rng: np.random.Generator, d: float, ap: float, levels: int, size: tuple[float, float] | None = None,
           sharp: bool | None = None) -> tuple[Way, Stock]:
    """From the middle outwards, contour by contour, after a helix down."""
    r, t = d / 2, Way()
    w, h = size if size else (rng.uniform(2.6, 5) * d, rng.uniform(2.3, 3.2) * d)
    step, rh = rng.uniform(0.4, 0.6) * d, 0.3 * d
    cr = 0.0 if (rng.random() < 0.5 if sharp is None else sharp) else rng.uniform(1, 4)
    rings = int((min(w, h) / 2 - r) / step)
    t.down(rh, 0, 0.5)
    for n in range(levels):
        z = -ap * (n + 1)
        if n:
            t.fly(float(t.steps[-1]["place"][0]) - 0.5, 0, z + ap + 1)
            t.fly(rh, 0, z + ap + 1)
        helix(t, rh, 0.5 if n == 0 else z + ap + 0.2, z)
        for k in range(rings, -1, -1):
            a, b = w / 2 - r - k * step, h / 2 - r - k * step
            c = cr if b > cr + 1 and k == 0 else 0
            b = max(b, 0.2)
            t.cut(a, 0, z)
            for (x, y), ((x0, y0), (x1, y1), mid) in zip(
                    ((a, b), (-a, b), (-a, -b), (a, -b)),
                    (((a, b - c), (a - c, b), (a - c, b - c)), ((-a + c, b), (-a, b - c), (-a + c, b - c)),
                     ((-a, -b + c), (-a + c, -b), (-a + c, -b + c)), ((a - c, -b), (a, -b + c), (a - c, -b + c))), strict=True):
                if c:
                    t.cut(x0, y0, z)
                    t.quarter(mid, (x1, y1), z)
                else:
                    t.cut(x, y, z)
            t.cut(a, 0, z)
    t.fly(float(t.steps[-1]["place"][0]) - 0.5, 0, z + 0.5)
    t.up()
    return t, box(-w / 2 - 10, -h / 2 - 10, w / 2 + 10, h / 2 + 10)


def ramp(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    """A closed slot, down to and fro by some two degrees."""
    long, t, top, slope = rng.uniform(25, 45), Way(), 0.3, rng.uniform(0.025, 0.045)
    t.down(0, 0, top)
    x, z = 0.0, top
    for n in range(levels):
        floor = -ap * (n + 1)
        while z > floor + 1e-9:
            z = max(floor, z - long * slope)
            x = long - x
            t.cut(x, 0, z)
        x = long - x
        t.cut(x, 0, z)
    t.up()
    return t, box(-d, -d, long + d, d)


def trochoid(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    r, rt, step, long, t = d / 2, rng.uniform(0.25, 0.4) * d, rng.uniform(0.1, 0.15) * d, rng.uniform(14, 22), Way()
    x = -r - rt - 1.0
    t.down(x, -rt, -ap)
    while x < long:
        t.arc((x + rt, 0, -ap), (x, rt, -ap))
        t.arc((x - rt, 0, -ap), (x, -rt, -ap))
        x += step
        t.cut(x, -rt, -ap)
    t.up()
    return t, box(0, -rt - 1.6 * d, long + 2 * d, rt + 1.6 * d)


def shoulder(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    """Passes beside each other into a block, each of another width, a slot at times: what a shop has a log of."""
    w, r, t = rng.uniform(50, 90), d / 2, Way()
    h = 60.0
    for n in range(levels):
        z, y = -ap * (n + 1), h + r
        t.layer = n
        for k, share in enumerate(rng.permutation([0.1, 0.25, 0.4, 0.6])):
            y -= share * d
            t.share = float(rng.choice([1.0, 0.6]))
            t.down(-r - 4, y, z)
            t.cut(w + r + 2, y, z)
            t.up()
            if k == 3 and rng.random() < 0.7:
                t.down(-r - 4, y - 1.3 * d, z)
                t.cut(w + r + 2, y - 1.3 * d, z)
                t.up()
    return t, box(0, 0, w, h)


def rest(rng: np.random.Generator, d: float, ap: float, levels: int, size: tuple[float, float]) -> Way:
    """The contour of a pocket that a larger cutter was in before: its corners, and the allowance of its walls."""
    r, t = d / 2, Way()
    a, b, lead = size[0] / 2 - r, size[1] / 2 - r, 3.0
    for n in range(levels):
        z = -ap * (n + 1)
        t.layer = n
        t.fly(a - lead - 1, -lead, SAFE)
        t.fly(a - lead - 1, -lead, NEAR)
        t.fly(a - lead - 1, -lead, z + 0.3)
        t.fly(a - lead, -lead, z + 0.3)
        t.cut(a - lead, -lead, z)
        t.quarter((a - lead, 0), (a, 0), z)
        for x, y in ((a, b), (-a, b), (-a, -b), (a, -b)):
            t.cut(x, y, z)
        t.cut(a, 0, z)
        t.quarter((a - lead, 0), (a - lead, lead), z)
        t.up()
    return t


def skin(rng: np.random.Generator) -> tuple:
    """A smooth surface and its gradient: functions of x, y."""
    kind = str(rng.choice(["dome", "waves", "saddle"]))
    a, lx, ly = rng.uniform(0.3, 1.0), rng.uniform(25, 45), rng.uniform(25, 45)
    steep = rng.uniform(1.5, 5.0)
    def z(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        if kind == "dome":
            return -steep * (((x - 20) / 22) ** 2 + ((y - 14) / 22) ** 2)
        if kind == "waves":
            return steep / 2 * (np.sin(2 * np.pi * x / lx) + a * np.cos(2 * np.pi * y / ly)) - steep
        return steep * ((x - 20) / 22) ** 2 - a * steep * ((y - 14) / 22) ** 2 - steep
    return kind, z


def rows(rng: np.random.Generator, d: float, allowance: float, shell: bool) -> tuple[Way, Stock]:
    """A free form finished by a ball in rows along x; the blank has the form with an allowance, or is a shallow block."""
    _, z = skin(rng)
    w, h, r, t = 40.0, rng.uniform(10, 22), d / 2, Way()
    if not shell:                                                      # the form lies within some tenths under a level top
        deep, steep = z, float(np.ptp(z(*np.meshgrid(np.linspace(0, w, 40), np.linspace(0, h, 40)))))
        high = float(np.max(deep(*np.meshgrid(np.linspace(0, w, 40), np.linspace(0, h, 40)))))
        def z(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return -allowance + (deep(x, y) - high) * min(1.0, 1.0 / steep)
    step, pitch, e = rng.uniform(0.35, 0.8), rng.uniform(0.8, 2.0), 1e-4
    to_and_fro, y, k = rng.random() < 0.6, float(h), 0
    x = np.arange(-r - 3, w + r + 3 + pitch, pitch)
    t.fly(float(x[0]), y, SAFE)
    while y >= 0:
        yy = np.full_like(x, y)
        slope = np.stack([(z(x + e, yy) - z(x - e, yy)) / (2 * e), (z(x, yy + e) - z(x, yy - e)) / (2 * e)], 1)
        n = np.column_stack([-slope, np.ones(len(x))])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        tip = np.column_stack([x, yy, z(x, yy)]) + r * (n - [0, 0, 1])
        row = tip if not to_and_fro or k % 2 == 0 else tip[::-1]
        if not to_and_fro:
            t.layer = k
        if k == 0 or not to_and_fro:
            high = float(max(row[0][2], row[-1][2], 0)) + r + 6
            t.fly(*row[0][:2], high if k else SAFE)
            t.fly(*row[0][:2], row[0][2] + 2)
            t.fly(*row[0])
        else:
            t.cut(*row[0])
        for p in row[1:]:
            t.cut(*p)
        if not to_and_fro:
            t.fly(*row[-1][:2], high)
        y, k = y - step, k + 1
    t.up()
    for s in t.steps:
        s["layer"] = 0                                                 # one procedure
    if not shell:
        return t, box(0, 0, w, h)
    gx, gy = np.meshgrid(np.arange(0, w + 1e-9, 2.0), np.arange(0, h + 1e-9, 2.0))
    net = np.round(z(gx, gy) + allowance, 4)
    return t, Stock(net=net.tolist(), net_at=(0.0, 0.0), net_cell=2.0)


def grooves(rng: np.random.Generator, d: float, ap: float, levels: int) -> tuple[Way, Stock]:
    """A ball through a block: grooves, and passes beside them."""
    w, r, t = rng.uniform(45, 70), d / 2, Way()
    y = 3 * d
    for n in range(int(rng.integers(4, 7))):
        z = -ap * float(rng.uniform(0.5, 1.0))
        y -= float(rng.choice([0.12, 0.3, 0.6, 1.1])) * d
        t.layer = n
        t.share = float(rng.choice([1.0, 0.7]))
        t.down(-r - 4, y, z)
        t.cut(w + r + 2, y, z)
        t.up()
    return t, box(0, y - 2 * d, w, 4 * d)


def mirrored(t: Way, s: Stock | None) -> None:
    """In y, so that climb becomes conventional."""
    for p in t.steps:
        p["place"] = p["place"] * [1, -1, 1]
        if p["via"] is not None:
            p["via"] = p["via"] * [1, -1, 1]
    if s is None:
        return
    s.boxes = [[a, -d, c, -b, z] for a, b, c, d, z in s.boxes]
    s.polygon = [[x, -y] for x, y in s.polygon][::-1]
    if s.net:
        s.net_at = (s.net_at[0], -(s.net_at[1] + (len(s.net) - 1) * s.net_cell))
        s.net = s.net[::-1]


def split(t: Way, most: float) -> None:
    """Straight cutting moves as posts for robots write them: none longer than `most`."""
    out = t.steps[:1]
    for s in t.steps[1:]:
        a, b = out[-1]["place"], s["place"]
        n = math.ceil(float(np.linalg.norm(b - a)) / most) if s["cut"] and s["kind"] == "L" else 1
        out += [s | {"place": a + (b - a) * k / n} for k in range(1, n)] + [s]
    t.steps = out
