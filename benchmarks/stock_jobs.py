"""First parts as shops have them: a program B that was never run, its stock, the log of another program A of the same cutter.

    python benchmarks/stock_jobs.py N SEED FOLDER

writes N job folders: robot, load tests, cell.yaml, A with stock and force log, B with its stock (a block, an STL, or what an
earlier program C left) and, for comparison, a log of its own first pass, `commands.txt` as the documentation has it,
`truth.json` for stock_judge.py alone. In a third of the jobs one thing is not as the files say, as shops have it. Nothing of
the program is imported; forces are those of stock_cut.py at the place where the yielding tool stands.
"""

import itertools
import json
import math
import pathlib
import struct
import sys
from dataclasses import asdict

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import stock_shapes as shapes
from shop_arm import STIFFNESS, turned_by
from shop_jobs import load_tests, place_job, table
from shop_path import Path, World, target_numbers
from shop_posts import Program, write
from stock_cut import Cut, Cutter, Stock, drive

MATERIALS = {  # k t r a [N/mm^2], edges t r a [N/mm] (Altintas 2012; steel: Gradisek 2004); m/min, chip of a 12 mm cutter [mm]
    "aluminium": ((796, 169, 222), (27.7, 30.8, 1.4), (200, 420), (0.05, 0.12)),
    "steel": ((1900, 620, 430), (35, 45, 4), (90, 160), (0.03, 0.08)),
    "titanium": ((1825, 770, 735), (29.7, 55.7, 1.8), (45, 70), (0.035, 0.07)),
}
SHAPES = ("pocket", "slot", "wall", "facing", "trochoid", "ramp", "rows", "rest", "polygon", "rows_shell")
HIDDEN = ("aside", "worn", "reground", "override", "thick", "batch")
STYLES = ("inline", "const", "offs", "procs", "array", "routine", "arcs", "modules")


def stock_of(d: dict) -> Stock:
    return Stock(**(d | {"net_at": tuple(d["net_at"])}))


def cutter_of(d: dict) -> Cutter:
    return Cutter(**(d | {"k": tuple(d["k"]), "e": tuple(d["e"])}))


def milled(world: World, path: Path, cutter: Cutter, stock: Stock, rpm: float, earlier: np.ndarray | None = None) -> Cut:
    """The true pass: the arm yields (in motion by its factor), the cut follows, and what is left is left."""
    q = world.angles(path.place, path.rot)
    more, n = world.t["motion"], len(q)
    at = np.zeros((n, 3))
    rest = world.tcp(q, at)
    for _ in range(2 if world.t["soft"] else 1):
        here = world.tcp(q, at)
        give = np.stack([(world.tcp(q, at + 100 * e) - here) / 100 for e in np.eye(3)], 2) * more
        cut = drive(rest, speeds(path), rpm, cutter, stock, give, (here - rest) * more, at, earlier)
        at = cut.force
    return cut


def fine(path_of: list[dict], cutter: Cutter) -> Path:
    return Path(path_of, 0.4 if cutter.corner > 0.49 * cutter.diameter else 0.25)


def speeds(path: Path) -> np.ndarray:
    """Of each point the feed of the step that leads to it."""
    return np.concatenate([path.feed[:1], path.feed[:-1]])


# ---- what is drawn --------------------------------------------------------------------------


def tool_of(rng: np.random.Generator, material: str, ball: bool, least: float = 6) -> tuple[Cutter, float, float]:
    """A cutter with its true edges, spindle speed and chip."""
    k, e, speed, chip = MATERIALS[material]
    d = float(rng.choice([x for x in ((6, 8, 10, 12) if ball else (6, 8, 10, 12, 16, 20)) if x >= least]))
    teeth = 2 if ball else int(rng.choice([2, 3, 4]))
    wide = rng.uniform(0.7, 1.3, 2)
    corner = d / 2 if ball else float(rng.choice([0, 0, 0.5, 1, 2])) * (d > 6)
    rpm = min(18000.0, round(rng.uniform(*speed) * 1000 / (math.pi * d) / 50) * 50.0)
    fz = float(rng.uniform(*chip)) * math.sqrt(d / 12)
    world = str(rng.choice(["plain", "plain", "size", "runout"]))
    return Cutter(d, teeth, tuple(float(v * wide[0] * rng.uniform(0.9, 1.1)) for v in k),
                  tuple(float(v * wide[1] * rng.uniform(0.9, 1.1)) for v in e), corner,
                  flute=3 * d, helix=float(rng.uniform(0.4, 0.7)),
                  out=float(rng.uniform(0.004, 0.012)) if world == "runout" else 0.0, phase=float(rng.uniform(0, 6)),
                  power=float(rng.uniform(0.08, 0.2)) if world == "size" else 0.0, chip0=round(0.6 * fz, 4)), rpm, fz


def depth_of(cutter: Cutter, fz: float, newton: float, ae: float) -> float:
    """An axial depth whose mean force is about `newton` at a width ae."""
    (kt, kr, _), (et, er, _) = cutter.k, cutter.e
    slot = cutter.teeth / 4 * math.hypot(kt * fz + 1.27 * et, kr * fz + 1.27 * er)
    share = (ae / cutter.diameter) ** 0.7
    most = cutter.diameter * (0.8 if ae < 0.3 * cutter.diameter else 0.5)
    return round(float(np.clip(newton / (slot * share), 0.4, most)), 1)


def shape_of(rng: np.random.Generator, name: str, c: Cutter, fz: float, newton: float) -> tuple[shapes.Way, Stock, dict]:
    """Steps, stock, and depth, width and levels."""
    d, levels = c.diameter, int(rng.integers(1, 4))
    ae = {"facing": 0.6 * d, "wall": float(rng.uniform(0.3, 1.2)), "polygon": float(rng.uniform(0.3, 1.2)),
          "trochoid": 0.25 * d, "shoulder": 0.5 * d, "pocket": 0.8 * d}.get(name, d)
    ap = depth_of(c, fz, newton, ae)
    told = {"ap": ap, "ae": round(ae, 3), "levels": levels}
    if name in ("wall", "polygon"):
        levels = told["levels"] = max(1, min(levels, int(2 * d / ap)))
        return *getattr(shapes, name)(rng, d, ap, levels, round(ae, 3)), told
    if name in ("rows", "rows_shell"):
        allowance = round(float(rng.uniform(0.3, 0.8)), 2)
        return *shapes.rows(rng, d, allowance, name == "rows_shell"), told | {"ap": allowance}
    if name == "grooves":
        return *shapes.grooves(rng, d, min(ap, 0.35 * d), levels), told
    levels = told["levels"] = min(levels, 2)
    return *getattr(shapes, name)(rng, d, ap, levels), told


def dress(steps: list[dict], feed: float, air: float, rng: np.random.Generator, style: str) -> None:
    zone = str(rng.choice(["z0", "z0", "zFein", "fine"])) if len(steps) < 200 else "z0"
    for s in steps:
        s["place"] = np.round(s["place"], 4)
        if style in ("routine", "array"):                              # one feed for all
            s["share"] = 1.0
        s["feed"] = round(feed * s.pop("share"), 1) if s["cut"] else air
        s["zone"] = zone if s["cut"] else str(rng.choice(["fine", "z1", "z5"]))
    for s, then in itertools.pairwise(steps):
        if s["cut"] != then["cut"] or (not s["cut"] and then["place"][2] < 1):
            s["zone"] = "fine"


# ---- files ----------------------------------------------------------------------------------


def log_of(rng: np.random.Generator, truth: dict, world: World, driven: list[dict], path: Path, cut: Cut, rpm: float,
           teeth: int) -> tuple[str, dict]:
    """The force log of a pass, and what cell.yaml says of it."""
    log = truth["log"]
    t = np.arange(0, path.time[-1] + log["late_end_s"], 1 / log["rate_hz"])
    def at(v: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(t, path.time, c) for c in v.T], 1)
    f, place = at(cut.force), at(path.place)
    turn = 2 * np.pi * rpm / 60 * t
    f *= (1 + log["ripple"] * np.sin(teeth * turn) + log["once"] * np.sin(turn + 1))[:, None]
    base = f @ world.turn.T
    base = (1 + log["gain"]) * base @ turned_by(np.deg2rad(np.array(log["turned_deg"]))).T
    cell = {"frame": log["frame"], "sign": log["sign"], "gain_std": 0.01, "mounting_std_deg": 0.5}
    if log["frame"] == "tool":
        rot = world.turn @ path.rot[np.searchsorted(path.time, t).clip(0, len(path.s) - 1)]
        base = np.einsum("nji,nj->ni", rot, base)
        cell["weight"] = "removed"
    out = (-base if log["sign"] == "by_tool" else base) + np.array(log["bias_n"]) + rng.normal(0, log["noise_n"], base.shape)
    if log["form"] == "target":
        number = target_numbers(driven, path, np.interp(t, path.time, path.raw), "target")
        return table(["time_s", "target", "fx_n", "fy_n", "fz_n"], [t, number, *out.T], ",", "."), cell | {"target": "nearest"}
    if log["form"] == "place":
        return table(["time_s", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n"], [t, *place.T, *out.T], ";", ","), cell
    cell |= {"columns": ["time_ms", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n"]}
    return "Logger v3.1; Kanal 1-3 Kräfte\n" + table(
        ["t [ms]", "X", "Y", "Z", "F1", "F2", "F3"], [1000 * t, *place.T, *out.T], ";", "."), cell


def stl(stock: Stock, binary: bool, scale: float, bottom: float) -> bytes:
    """A closed body: a prism, or a net of heights on a level floor; scale turns millimetres into the file's unit."""
    faces: list[list[tuple[float, float, float]]] = []
    if stock.polygon:
        p, top = stock.polygon, stock.polygon_top
        for k in range(1, len(p) - 1):
            faces.append([(*p[0], top), (*p[k], top), (*p[k + 1], top)])
            faces.append([(*p[0], bottom), (*p[k + 1], bottom), (*p[k], bottom)])
        for a, b in zip(p, [*p[1:], p[0]], strict=True):
            faces += [[(*a, bottom), (*b, bottom), (*b, top)], [(*a, bottom), (*b, top), (*a, top)]]
    else:
        (x0, y0), c, net = stock.net_at, stock.net_cell, stock.net
        ny, nx = len(net), len(net[0])
        def up(i: int, j: int) -> tuple[float, float, float]:
            return x0 + i * c, y0 + j * c, net[j][i]
        def low(i: int, j: int) -> tuple[float, float, float]:
            return x0 + i * c, y0 + j * c, bottom
        for j, i in itertools.product(range(ny - 1), range(nx - 1)):
            faces += [[up(i, j), up(i + 1, j), up(i + 1, j + 1)], [up(i, j), up(i + 1, j + 1), up(i, j + 1)],
                      [low(i, j), low(i + 1, j + 1), low(i + 1, j)], [low(i, j), low(i, j + 1), low(i + 1, j + 1)]]
        edge = [(i, 0) for i in range(nx)] + [(nx - 1, j) for j in range(1, ny)]
        edge += [(i, ny - 1) for i in range(nx - 2, -1, -1)] + [(0, j) for j in range(ny - 2, 0, -1)]
        for a, b in zip(edge, [*edge[1:], edge[0]], strict=True):
            faces += [[low(*a), low(*b), up(*b)], [low(*a), up(*b), up(*a)]]
    f = np.array(faces) * scale
    normal = np.cross(f[:, 1] - f[:, 0], f[:, 2] - f[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    if binary:
        rows = b"".join(struct.pack("<12fH", *n, *v.ravel(), 0) for n, v in zip(normal, f, strict=True))
        return b"blank".ljust(80, b" ") + struct.pack("<I", len(f)) + rows
    lines = ["solid blank"]
    for n, v in zip(normal, f, strict=True):
        lines += [f"facet normal {n[0]:.6e} {n[1]:.6e} {n[2]:.6e}", " outer loop",
                  *(f"  vertex {x:.7e} {y:.7e} {z:.7e}" for x, y, z in v), " endloop", "endfacet"]
    return "\n".join([*lines, "endsolid blank", ""]).encode()


def stock_files(rng: np.random.Generator, name: str, stock: Stock, folder: pathlib.Path, std: float, bottom: float) -> None:
    """stock.yaml of a program as the shop states it, with the STL where the blank is no block."""
    end = f"position_std_mm: {std}\n"
    if stock.boxes:
        a, b, c, d, top = stock.boxes[0]
        text = f"box: {{from_mm: [{a:.4f}, {b:.4f}, {bottom:g}], to_mm: [{c:.4f}, {d:.4f}, {top:.4f}]}}\n"
    else:
        inch = rng.random() < 0.25
        (folder / f"{name}.stl").write_bytes(stl(stock, rng.random() < 0.6, 1 / 25.4 if inch else 1.0, bottom))
        text = f"stl: {name}.stl\nunits: {'inch' if inch else 'mm'}\n"
    (folder / f"{name}.stock.yaml").write_text(text + end)


def cell_text(truth: dict, force: dict, cutter: dict) -> str:
    tool, base = truth["tool"], truth["base"]
    lines = [f"robot: {truth['robot']}", "tool:", f"  position_mm: {tool['place']}", f"  quaternion: {tool['quat']}",
             f"  mass_kg: {truth['mass_kg']}", f"  centre_of_mass_mm: {truth['centre_mm']}",
             "base_frame:", f"  position_mm: {base['place']}", f"  quaternion: {base['quat']}",
             "measurement:", f"  deflection_std_um: {[truth['gauge_um']] * 3}", "  force_relative_std: 0.005",
             "  pose_offset_std_um: [3, 3, 3]", "force_log:", *(f"  {k}: {json.dumps(v)}" for k, v in force.items()),
             f"  spindle_rpm: {cutter['rpm']:g}", "cutting:", f"  material: {truth['material']}",
             f"  tool_diameter_mm: {cutter['diameter']:g}", f"  teeth: {cutter['teeth']}",
             f"  corner_radius_mm: {cutter['corner']:g}", f"  flute_mm: {cutter['flute']:g}"]
    return "\n".join(lines) + "\n"


def make(seed: int, n: int, folder: pathlib.Path) -> None:
    """Write job n of a seed."""
    rng = np.random.default_rng([seed, n])
    shape = SHAPES[(n + seed) % len(SHAPES)]
    ball, material = shape.startswith("rows"), str(rng.choice(list(MATERIALS)))
    robot = str(rng.choice(list(STIFFNESS)))
    newton = float(rng.uniform(80, 280)) * (0.6 if robot.startswith("irb46") else 1)
    cutter, rpm, fz = tool_of(rng, material, ball)
    if shape == "rest" and cutter.diameter > 10:
        cutter.diameter, cutter.flute = 8.0, 24.0
    further = str(rng.choice(["none", "none", "none", "none", "tilt"]))
    form = str(rng.choice(["target", "place", "own"]))
    styles = {"A": str(rng.choice([s for s in STYLES[:-1] if form != "target" or s not in ("array", "routine")])),
              "B": str(rng.choice(STYLES if shape not in ("trochoid", "rest") else ("inline", "const", "offs", "arcs"))),
              "C": "inline"}
    truth: dict = {
        "shape": shape, "material": material, "robot": robot, "further": further, "styles": styles,
        "stiffness": (np.array(STIFFNESS[robot]) * np.exp(rng.normal(0, 0.2, 6))).round(0).tolist(), "soft": 0.0,
        "tilt": float(rng.uniform(0.5e-9, 1.2e-9)) if further == "tilt" else 0.0, "motion": float(1 + rng.normal(0, 0.02)),
        "gauge_um": float(rng.choice([2, 4])), "test_n": float(rng.choice([200, 300, 400])),
        "mass_kg": round(float(rng.uniform(12, 35)), 1),
        "centre_mm": rng.uniform([-10, -10, 90], [40, 10, 160]).round(0).tolist(),
        "log": {"form": form, "rate_hz": float(rng.choice([50, 100, 250, 1000])), "frame": str(rng.choice(["base", "tool"])),
                "sign": str(rng.choice(["on_tool", "on_tool", "by_tool"])), "bias_n": rng.normal(0, 15, 3).round(1).tolist(),
                "noise_n": float(rng.uniform(1, 3)), "ripple": float(rng.uniform(0.1, 0.4)),
                "once": float(rng.uniform(0, 0.15)),
                "late_end_s": float(rng.choice([0.0, 1.5])), "gain": float(rng.normal(0, 0.01)),
                "turned_deg": rng.normal(0, 0.5, 3).tolist()},
        "climb": {"A": bool(rng.random() < 0.6), "B": bool(rng.random() < 0.75), "C": True},
        "hidden": str(rng.choice(HIDDEN)) if rng.random() < 0.36 else "none"}
    hidden = truth["hidden"]
    # the shapes, and the stocks as stated
    told = {}
    ways, stocks = {}, {}
    if ball:
        other = str(rng.choice(["grooves", "grooves", "rows"]))
    else:
        other = str(rng.choice([s for s in ("shoulder", "shoulder", "facing", "slot", "wall", "pocket") if s != shape]))
    truth["shape_a"] = other
    ways["A"], stocks["A"], told["A"] = shape_of(rng, other, cutter, fz, newton)
    cutters, rpms, chips = {"A": cutter, "B": cutter}, {"A": rpm, "B": rpm}, {"A": fz, "B": fz * float(rng.uniform(0.75, 1.2))}
    if shape == "rest":
        cutters["C"], rpms["C"], chips["C"] = tool_of(rng, material, False, 1.5 * cutter.diameter)
        cutters["C"].corner = cutter.corner = 0.0
        dc, allow = cutters["C"].diameter, round(float(rng.uniform(0.2, 0.5)), 2)
        size = (round(float(rng.uniform(2.6, 3.6)) * dc, 1), round(float(rng.uniform(2.3, 2.8)) * dc, 1))
        deep = depth_of(cutters["C"], chips["C"], newton, 0.8 * dc)
        ways["C"], stocks["C"] = shapes.pocket(rng, dc, deep, 1, (size[0] - 2 * allow, size[1] - 2 * allow), sharp=True)
        levels = max(1, math.ceil(deep / max(depth_of(cutter, chips["B"], newton / 2, 0.3 * cutter.diameter), 0.5)))
        told["C"] = {"ap": deep, "ae": 0.8 * dc, "levels": 1}
        told["B"] = {"ap": (deep - 0.1) / levels, "ae": allow, "levels": levels}
        ways["B"] = shapes.rest(rng, cutter.diameter, (deep - 0.1) / levels, levels, size)
        truth["climb"]["B"] = True
    else:
        ways["B"], stocks["B"], told["B"] = shape_of(rng, shape, cutter, chips["B"], newton)
    keys = [k for k in ("A", "C", "B") if k in ways]
    for k in keys:
        if not truth["climb"][k]:
            shapes.mirrored(ways[k], stocks.get(k))
        if styles[k] in ("array", "routine") and any(s["kind"] == "C" and s["cut"] for s in ways[k].steps) and form == "target":
            styles[k] = "inline"
    truth["split"] = {"A": float(rng.choice([0, 2, 2, 3, 3])), "B": float(rng.choice([0, 0, 2, 4])), "C": 3.0}
    for k in keys:
        if truth["split"][k] and not (ball and k == "B"):
            shapes.split(ways[k], truth["split"][k])
    every = [s for k in keys for s in ways[k].steps]
    truth["soft"] = 0.0
    place_job(rng, truth, every)
    air = float(rng.choice([100, 150]))
    for k in keys:
        dress(ways[k].steps, max(1.0, chips[k] * cutters[k].teeth * rpms[k] / 60), air, rng, styles[k])
    world = World(truth)
    # what is true: where stocks stand, the cutter, the spindle
    std = float(rng.choice([0.05, 0.1]))
    real_stock = {k: s.moved(rng.normal(0, 0.7 * std, 3)) for k, s in stocks.items()}
    real = {k: Cutter(**asdict(c)) for k, c in cutters.items()}
    real_rpm = dict(rpms)
    if hidden == "aside" and "B" in stocks:
        side = np.zeros(3)
        side[int(rng.integers(2))] = float(rng.choice([-0.3, 0.3]))
        real_stock["B"] = real_stock["B"].moved(side)
    elif hidden == "worn":
        real["B"].e = tuple(1.5 * v for v in real["B"].e)
    elif hidden == "reground":
        for k in ("A", "B"):
            real[k].diameter -= 0.2
            real[k].corner -= 0.1 if ball else 0.0
    elif hidden == "override":
        real_rpm["B"] *= 0.8
    elif hidden == "thick":
        stocks["A"] = stocks["A"].moved(np.array([0, 0, 1.0]))
    elif hidden == "batch":
        real["B"].k = tuple(1.15 * v for v in real["B"].k)
    else:
        truth["hidden"] = hidden = "none"
    folder.mkdir(parents=True)
    truth |= {"told": told, "files": {}, "rpm": rpms, "real_rpm": real_rpm,
              "real_cutter": {k: asdict(c) for k, c in real.items()},
              "real_stock": {k: asdict(s) for k, s in real_stock.items()}, "stock_std": std, "targets": {}, "air": air}
    commands = ["compstiff identify cell.yaml measurements.csv -o stiffness.json"]
    earlier = None
    for k in keys:
        name = f"part_{k.lower()}"
        job = truth | {"steps": ways[k].steps, "title": f"Programm {k}: {truth['shape'] if k == 'B' else k}, Fräser "
                       f"D{cutters[k].diameter:g} (côté A)"}
        files = write(styles[k], job, rng)
        if len(files) == 1:
            files = {f"{name}.mod": next(iter(files.values()))}
        for f, data in files.items():
            (folder / f).write_bytes(data)
        truth["files"][k], program = list(files), Program(files)
        truth["targets"][k] = program.targets
        driven = [m for m in program.driven if m["kind"] != "AbsJ"]
        if k in stocks:
            low = min(float(s["place"][2]) for s in ways[k].steps)
            stock_files(rng, name, stocks[k], folder, std, math.floor(low) - 10.0)
        cell = {x: getattr(cutters[k], x) for x in ("diameter", "corner", "teeth", "flute")} | {"rpm": rpms[k]}
        if k == "B":                                                   # a log of its own pass, for the judge's comparison
            path = fine(driven, real[k])
            cut = milled(world, path, real[k], real_stock.get(k, real_stock.get("C")), real_rpm[k], earlier)
            form = "place" if styles[k] in ("array", "routine") and form == "target" else form
            text, force = log_of(np.random.default_rng([seed, n, 1]), truth | {"log": truth["log"] | {"form": form}}, world,
                                 driven, path, cut, real_rpm[k], cutters[k].teeth)
            (folder / f"{name}.forces.csv").write_text(text, encoding="utf-8")
            (folder / "cell_b.yaml").write_text(cell_text(truth, force, cell), encoding="utf-8")
            continue
        path = fine(driven, real[k])
        cut = milled(world, path, real[k], real_stock[k], real_rpm[k])
        text, force = log_of(rng, truth, world, driven, path, cut, real_rpm[k], cutters[k].teeth)
        (folder / f"{name}.forces.csv").write_text(text, encoding="utf-8")
        cell_name = "cell.yaml" if k == "A" else "cell_c.yaml"
        (folder / cell_name).write_text(cell_text(truth, force, cell), encoding="utf-8")
        truth.setdefault("mean_n", {})[k] = float(np.linalg.norm(cut.force[cut.area > 0], axis=1).mean())
        if k == "C":
            earlier = cut.ways
            np.save(folder / "truth_left.npy", earlier)
        commands.append(f"compstiff cutting {cell_name} {name}.mod --stock {name}.stock.yaml --stiffness stiffness.json "
                        f"--forces {name}.forces.csv --tare 0:1 -o "
                        f"{'cutting.json' if k == 'A' else 'cutting_c.json --leaves left.npz'}")
    stock = "part_b.stock.yaml" if "B" in stocks else "left.npz"
    tail = f"--stiffness stiffness.json --predict-force cutting.json --stock {stock}"
    b, last = "part_b.mod", "-o out.mod"
    if len(truth["files"]["B"]) > 1:
        b, last = "job.mod", "--modules -o out/" + truth["files"]["B"][0]
        commands.append(f"compstiff post cell.yaml {' '.join(truth['files']['B'])} -o job.mod")
    commands += [f"compstiff predict cell.yaml {b} {tail} -o deviation.csv",
                 f"compstiff correct cell.yaml {b} {tail} {last} --offsets offsets.csv"]
    (folder / "measurements.csv").write_text(load_tests(rng, truth, False), encoding="utf-8")
    (folder / "commands.txt").write_text("\n".join(commands) + "\n")
    (folder / "truth.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    count, seed, where = int(sys.argv[1]), int(sys.argv[2]), pathlib.Path(sys.argv[3])
    for number in range(count):
        make(seed, number, where / f"job{number:02d}")
    print(f"{count} jobs in {where}, seed {seed}")
