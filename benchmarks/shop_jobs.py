"""Whole jobs as shops have them: an arm, a part, a post's RAPID, a force log in one of eight forms, a cell file, load tests.

    python benchmarks/shop_jobs.py N SEED FOLDER [--trivial]

writes N job folders; `truth.json` in each has what no user knows, for shop_judge.py alone. Nothing of the program is imported.
A force belongs to a place of the planned path and follows the depth: a tool that stands aside towards the stock cuts more.
"""

import itertools
import json
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from shop_arm import DRAWINGS, STIFFNESS, quaternion, turn, turned_by
from shop_path import Along, Path, Plan, World, target_numbers
from shop_posts import STYLES, Program, write

LOGS = ("target", "ahead", "path", "place", "place_own", "time", "joints", "sensor")
G = 9.80665


def toolpath(rng: np.random.Generator, shape: str, climb: bool) -> list[dict]:
    """Steps without orientation: kind, place, via, cut, layer, tilt (two small angles of the tool).

    Passes lie beside each other so that the stock is on the right of a climb cut, on the left of a conventional one.
    """
    steps: list[dict] = []

    def add(kind: str, x: float, y: float, z: float, cut: bool, layer: int, via: object = None,
            tilt: tuple[float, float] = (0.0, 0.0)) -> None:
        steps.append({"kind": kind, "place": np.array([x, y, z], float), "via": via, "cut": cut, "layer": layer, "tilt": tilt})
    layers = int(rng.integers(2, 5))
    w, h = rng.uniform(80, 220), rng.uniform(60, 160)
    for n in range(layers):
        z = -2.0 * n
        if shape == "passes":                                          # one way, with retracts, moves of unequal length
            xs = np.sort(np.concatenate([[0, w], rng.uniform(5, w - 5, int(rng.integers(1, 12)))]))
            y = -8.0 * n * (1 if climb else -1)
            add("J" if n == 0 else "L", -15, y, 40, False, n)
            add("L", -15, y, z, False, n)
            add("L", -6, y, z, False, n)
            for x in xs:
                add("L", x, y, z, True, n)
            add("L", w + 8, y, z, True, n)
            add("L", w + 8, y, 40, False, n)
        elif shape == "pocket":                                        # an outer contour with arcs at its corners
            r = 10.0
            inner = r if climb else -r                                 # in and out by a quarter of a circle
            add("J" if n == 0 else "L", w / 2 - r, inner + np.sign(inner), 40, False, n)
            add("L", w / 2 - r, inner + np.sign(inner), z, False, n)
            add("L", w / 2 - r, inner, z, False, n)
            add("C", w / 2, 0, z, True, n, np.array([w / 2 - r * np.sqrt(0.5), inner * (1 - np.sqrt(0.5)), z]))
            corners = [((w, h), (1, 0), (0, 1), (w - r, 0)), ((w, h), (0, 1), (-1, 0), (w, h - r)),
                       ((0, h), (-1, 0), (0, -1), (r, h)), ((0, 0), (0, -1), (1, 0), (0, r))]
            for (_cx, _cy), d, e, (x, y) in corners:
                add("L", x, y, z, True, n)
                c = np.array([x, y]) + r * np.array(e)
                mid = c + r * (np.array(d) - np.array(e)) / np.sqrt(2)
                end = c + r * np.array(d)
                add("C", end[0], end[1], z, True, n, np.array([mid[0], mid[1], z]))
            add("L", w / 2, 0, z, True, n)
            add("C", w / 2 + r, inner, z, True, n, np.array([w / 2 + r * np.sqrt(0.5), inner * (1 - np.sqrt(0.5)), z]))
            add("L", w / 2 + r, inner, 40, False, n)
        elif shape == "surface":                                       # close points on a curved skin, the tool leaning along
            y, count = -6.0 * n * (1 if climb else -1), int(rng.integers(20, 70))
            xs = np.linspace(0, w, count)
            add("J" if n == 0 else "L", -12, y, 40, False, n)
            add("L", -12, y, 5, False, n)
            for i, x in enumerate(xs):
                u = x / w * np.pi
                add("L", x, y + 4 * np.sin(2 * u), 12 * np.sin(u) - 2, i > 0, n, None, (0.12 * np.cos(u), 0.05 * np.sin(2 * u)))
            add("L", w + 3, y, 5, True, n)
            add("L", w + 15, y, 40, False, n)
        else:                                                          # trimming an edge: long moves that turn, to and fro
            add("J" if n == 0 else "L", -25, -10, 40, False, n)
            add("L", -25, -10, z, False, n)
            heading = np.deg2rad([5, 25, 45, 65, 50, 30, 15])
            legs = h / 2 * np.stack([np.cos(heading), np.sin(heading)], 1)
            points = np.concatenate([[[0, 0]], np.cumsum(legs, axis=0)])
            for i, (x, y) in enumerate(points):
                add("L", x, y, z, i > 0, n, None, (0.08 * i / 6, -0.05 * i / 6))
            add("L", x + 12, y + 3, z, False, n)
            add("L", x + 12, y + 3, 40, False, n)
    return steps


def push_of(rng: np.random.Generator, climb: bool, ratio: float) -> tuple[list[float], float]:
    """Unit force on a clockwise end mill along feed, right, tip, from a turn's mean; and the side of the stock (right +1)."""
    width = np.arccos(1 - 2 * ratio)
    phi = np.linspace(np.pi - width, np.pi, 400) if climb else np.linspace(0, width, 400)
    chip, kr = np.sin(phi), rng.uniform(0.3, 0.5)
    along = np.mean(chip * (-np.cos(phi) - kr * np.sin(phi)))
    left = np.mean(chip * (np.sin(phi) - kr * np.cos(phi)))
    f = np.array([along, -left, 0.2 * np.hypot(along, left)])
    return list(f / np.linalg.norm(f)), 1.0 if climb else -1.0


def place_job(rng: np.random.Generator, truth: dict, steps: list[dict]) -> None:
    """Frames, tool and branch so that all steps are reached in an ordinary posture; orientation and conf of the steps."""
    name = truth["robot"]
    d1, a2, a3, _, d4, _ = DRAWINGS[name][0]
    lean = float(rng.choice([0, 30, 45]))
    mount = turn(1, np.deg2rad(lean)) @ turn(2, rng.uniform(-0.5, 0.5))
    truth["tool"] = {"place": np.round([rng.uniform(60, 160), rng.uniform(-40, 40), rng.uniform(200, 330)], 2).tolist(),
                     "quat": np.round(quaternion(mount), 8).tolist()}
    centre = np.mean([s["place"] for s in steps], 0)
    for _ in range(400):
        side = rng.uniform(-0.7, 0.7)
        reach = a2 + rng.uniform(0.45, 0.7) * (a3 + d4)
        wanted = np.array([reach * np.cos(side), reach * np.sin(side), rng.uniform(0.5, 0.95) * d1])
        lay = turn(2, rng.uniform(-3, 3)) @ turned_by(rng.normal(0, 0.08, 3))
        base = turn(2, rng.choice([0, np.pi / 2, np.pi, 0.3])) if rng.random() < 0.5 else np.eye(3)
        base_at = np.zeros(3) if np.allclose(base, np.eye(3)) else np.round(rng.uniform(-800, 800, 3), 1)
        u_turn = turn(2, rng.uniform(-1, 1)) if rng.random() < 0.6 else np.eye(3)
        u_at = np.round(rng.uniform(-600, 600, 3), 1) if rng.random() < 0.6 else np.zeros(3)
        def frame(at: np.ndarray, r: np.ndarray) -> dict:
            return {"place": np.round(at, 4).tolist(), "quat": np.round(quaternion(r), 8).tolist()}
        corner = base_at + base @ (wanted - lay @ centre)
        truth |= {"base": frame(base_at, base), "uframe": frame(u_at, u_turn),
                  "oframe": frame(u_turn.T @ (corner - u_at), u_turn.T @ base @ lay),
                  "start_deg": [float(np.rad2deg(side)), 25, 40 if DRAWINGS[name][1] else 20, 0, 45,
                                float(rng.uniform(-150, 150))]}
        world = World(truth)
        spin = turn(2, rng.uniform(-np.pi, np.pi))
        rot = [turned_by(np.array([t["tilt"][0], t["tilt"][1], 0.0])) @ turn(0, np.pi) @ spin for t in steps]
        try:
            q = np.rad2deg(world.angles(np.array([s["place"] for s in steps]), np.array(rot)))
        except (ValueError, np.linalg.LinAlgError):
            continue
        low, high = [-150, -30, -18, -110, 18, -300], [150, 75, 65, 110, 105, 300]
        if (q > low).all() and (q < high).all() and np.abs(q[:, 2] - q[:, 1] * DRAWINGS[name][1]).max() < 65:
            break
    else:
        raise ValueError("no place found for the job")
    for s, r, joints in zip(steps, rot, q, strict=True):
        quat = quaternion(r)
        s["quat"] = np.round(quat, 8)
        s["conf"] = (*(int(np.floor(joints[k] / 90)) for k in (0, 3, 5)), 0)
        if s["via"] is not None:
            s["via"] = (s["via"], s["quat"])
    truth["start_deg"] = q.mean(0).tolist()


def load_tests(rng: np.random.Generator, truth: dict, perfect: bool) -> str:
    """measurements.csv: cycles of loads along each axis of the base at poses around the job's, the last three to validate."""
    arm = World(truth).arm
    rows = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,fx_n,fy_n,fz_n,dx_um,dy_um,dz_um,time_s,dwell_s,pose,purpose"]
    spread, clock = np.array([40, 18, 15, 70, 30, 90.0]), 0.0
    sigma = 0.0 if perfect else truth["gauge_um"]
    for n in range(15):
        q = np.round(np.clip(np.array(truth["start_deg"]) + rng.uniform(-1, 1, 6) * spread, [-150, -25, -15, -150, -95, -300],
                             [150, 70, 60, 150, 95, 300]), 3)
        if DRAWINGS[truth["robot"]][1]:
            q[2] = np.clip(q[2], q[1] - 65, q[1] + 65)
        seat = rng.normal(0, 3, 3) * (not perfect)
        size = truth["test_n"]
        for axis in range(3):
            for share in (0, 0.5, 1, 0.5, -0.5, -1, -0.5):
                force = np.zeros((1, 3))
                force[0, axis] = share * size
                true = force * (1 + (0 if perfect else 0.005) * rng.normal(0, 1, 3))
                rad = np.deg2rad(q)[None]
                d = 1000 * (arm.loaded(rad, true) - arm.loaded(rad, 0 * true))[0] + rng.normal(0, 1, 3) * sigma
                d += seat if share else 0
                clock += 20
                numbers = [*(f"{v:.3f}" for v in q), *(f"{v:g}" for v in force[0]), *(f"{v:.2f}" for v in d), f"{clock:g}"]
                rows.append(",".join([*numbers, "10", f"P{n}", "validate" if n >= 12 else "identify"]))
    return "\n".join(rows) + "\n"


def logged(rng: np.random.Generator, truth: dict, world: World, driven: list[dict], path: Path, plan: Plan) -> tuple[str, dict]:
    """The force log's text, and what cell.yaml says of it, by truth['log']."""
    perfect = truth["trivial"]
    q = world.angles(path.place, path.rot)
    _, force, _ = world.under_cut(q, Along(plan, path.s))
    rate, form = truth["rate_hz"], truth["log"]
    before, after = (3.0, 2.0) if form == "time" else (0.0, truth["late_end_s"])
    t = np.arange(-before, path.time[-1] + after, 1 / rate)
    def at(v: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(t, path.time, c) for c in v.T], 1)
    f, place, joints = at(force), at(path.place), at(np.rad2deg(q))
    near = np.searchsorted(path.time, t).clip(0, len(path.s) - 1)
    rot = path.rot[near]
    f *= 1 + (0 if perfect else truth["ripple"]) * np.sin(2 * np.pi * truth["rpm"] / 60 * 3 * t)[:, None]
    base = f @ world.turn.T
    moment = np.zeros_like(base)
    tool_r, flange = world.turn @ rot, world.turn @ rot @ world.arm.tool[1].T
    frame, cell, out = truth["frame"], {"frame": truth["frame"], "sign": truth["sign"]}, base
    if frame == "sensor":
        mount, origin = turn(2, np.deg2rad(truth["sensor_deg"])), np.array([0, 0, truth["sensor_up"]])
        sensor = flange @ mount
        lever = np.einsum("nij,j->ni", flange, world.arm.tool[0] - origin) / 1000
        com = np.einsum("nij,j->ni", flange, np.array(truth["centre_mm"]) - origin) / 1000
        weight = truth["mass_kg"] * G * np.broadcast_to(world.down, base.shape)
        total, moment = base + weight, np.cross(lever, base) + np.cross(com, weight)
        out, moment = (np.einsum("nji,nj->ni", sensor, v) for v in (total, moment))
        cell |= {"sensor_quaternion": np.round(quaternion(mount), 8).tolist(), "sensor_position_mm": origin.tolist()}
    elif frame == "tool":
        out = np.einsum("nji,nj->ni", tool_r, base)
        cell["weight"] = "removed"
    if truth["sign"] == "by_tool":
        out, moment = -out, -moment
    if not perfect:
        out = out + np.array(truth["bias_n"]) + rng.normal(0, 1.5, out.shape) + np.outer(t / t[-1], truth["drift_n"])
        moment = moment + rng.normal(0, 0.1, moment.shape)
    if form in ("target", "ahead"):
        number = target_numbers(driven, path, np.interp(t, path.time, path.raw), form)
        cell["target"] = "nearest" if form == "target" else "ahead"
        return table(["time_s", "target", "fx_n", "fy_n", "fz_n"], [t, number, *out.T], ",", "."), cell
    if form == "path":
        return table(["time_s", "fz_n", "fx_n", "fy_n", "path_mm"],
                     [t, out[:, 2], out[:, 0], out[:, 1], np.interp(t, path.time, path.raw)], ";", ","), cell
    if form == "place":
        return table(["time_s", "x_mm", "y_mm", "z_mm", "fx_n", "fy_n", "fz_n"], [t, *place.T, *out.T], "\t", "."), cell
    if form == "place_own":
        cell |= {"columns": ["time_ms", "fx_counts", "fy_counts", "fz_counts", "-", "x_mm", "y_mm", "z_mm"],
                 "counts_per_n": 1000}
        columns = [1000 * t, *np.round(1000 * out.T), 0 * t, *place.T]
        text = table(["t", "F1", "F2", "F3", "state", "X", "Y", "Z"], columns, ";", ",")
        return "Logger v3.1; Kanal 1-3 Kräfte\nKunde: Müller\n" + text, cell
    if form == "time":
        return table(["time_s", "fx_n", "fy_n", "fz_n"], [t + before, *out.T], ",", "."), cell
    if form == "joints":
        names = [f"q{k}_deg" for k in range(1, 7)]
        return table(["time_s", *names, "fx_n", "fy_n", "fz_n"], [t, *joints.T, *out.T], ",", "."), cell
    return table(["time_s", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm", "x_mm", "y_mm", "z_mm"],
                 [t, *out.T, *moment.T, *place.T], ",", "."), cell


def table(names: list[str], columns: list, sep: str, point: str) -> str:
    digits = [0 if n in ("target", "state", "F1", "F2", "F3") else 5 if n.endswith("_deg") else 4 for n in names]
    form = sep.join(f"{{:.{d}f}}" for d in digits)
    return "\n".join([sep.join(names), *(form.format(*r).replace(".", point) for r in zip(*columns, strict=True))]) + "\n"


def draw(rng: np.random.Generator, n: int, trivial: bool) -> tuple[dict, str]:
    """What is true of job n but for its place, and the post's style."""
    style = STYLES[n % len(STYLES)] if not trivial else "inline"
    usable = [x for x in LOGS if style not in ("array", "routine") or x not in ("target", "ahead")]
    log = "place" if trivial else str(rng.choice(usable))
    robot = str(rng.choice(list(STIFFNESS)))
    climb, ratio = bool(rng.random() < 0.75), float(rng.uniform(0.1, 0.35))
    push, side = push_of(rng, climb, ratio)
    further = str(rng.choice(["none", "none", "soft", "tilt"])) if not trivial else "none"
    sensor = log == "sensor"
    noisy = not trivial
    truth = {
        "style": style, "log": log, "robot": robot, "trivial": trivial, "further": further,
        "stiffness": (np.array(STIFFNESS[robot]) * np.exp(rng.normal(0, 0.2, 6))).round(0).tolist(),
        "soft": float(rng.uniform(0.03, 0.07)) if further == "soft" else 0.0,
        "tilt": float(rng.uniform(0.5e-9, 1.2e-9)) if further == "tilt" else 0.0,
        "shape": "pocket" if style == "arcs" else ["passes", "surface"][n % 2] if trivial
        else str(rng.choice(["passes", "pocket", "surface", "trim"])),
        "newton": float(rng.uniform(90, 320)) * (0.6 if robot.startswith("irb46") else 1),
        "push": push, "side": side, "climb": climb,
        "depth_mm": round(16 * ratio, 2), "follows": float(rng.uniform(0.6, 0.9)) * noisy, "ramp_mm": float(rng.uniform(3, 8)),
        "wave": float(rng.uniform(0.02, 0.15)), "wave_mm": float(rng.uniform(10, 40)), "ripple": float(rng.uniform(0.1, 0.4)),
        "rpm": int(rng.choice([6000, 9000, 12000, 18000])),
        "rate_hz": float(rng.choice([10, 50, 100, 250, 1000])) if noisy else 200.0,
        "frame": "sensor" if sensor else str(rng.choice(["base", "tool"])) if noisy else "base",
        "sign": "by_tool" if noisy and not sensor and rng.random() < 0.3 else "on_tool",
        "bias_n": rng.normal(0, 15, 3).round(1).tolist(),
        "drift_n": (rng.normal(0, 2, 3) * (rng.random() < 0.5)).round(2).tolist(),
        "late_end_s": float(rng.choice([-0.1, 0.0, 1.5])) if noisy else 0.0, "gauge_um": float(rng.choice([2, 4])),
        "test_n": float(rng.choice([200, 300, 400])), "mass_kg": round(float(rng.uniform(12, 35)), 1),
        "centre_mm": rng.uniform([-10, -10, 90], [40, 10, 160]).round(0).tolist(),
        "table": float(rng.choice([0, 30])) if noisy and rng.random() < 0.25 else None,
        "sensor_deg": float(rng.choice([0, 30, 45, 90])), "sensor_up": float(rng.choice([20, 45, 60])),
        "knows_depth": str(rng.choice(["option", "cell", "no"])),
        "home": noisy and log not in ("time", "path") and bool(rng.random() < 0.4)}
    if log in ("time", "joints", "place", "place_own", "sensor"):
        truth["rate_hz"] = max(truth["rate_hz"], 50.0)
    return truth, style


def cell_text(truth: dict, force: dict) -> str:
    """cell.yaml as the integrator writes it."""
    tool, base = truth["tool"], truth["base"]
    lines = [f"robot: {truth['robot']}", "tool:", f"  position_mm: {tool['place']}", f"  quaternion: {tool['quat']}",
             f"  mass_kg: {truth['mass_kg']}", f"  centre_of_mass_mm: {truth['centre_mm']}",
             "base_frame:", f"  position_mm: {base['place']}", f"  quaternion: {base['quat']}",
             "measurement:", f"  deflection_std_um: {[truth['gauge_um']] * 3}", "  force_relative_std: 0.005",
             "  pose_offset_std_um: [3, 3, 3]", "force_log:"]
    force = force | ({"spindle_rpm": truth["rpm"]} if not truth["trivial"] else {})
    lines += [f"  {k}: {json.dumps(v)}" for k, v in force.items()]
    if truth["knows_depth"] == "cell" and not truth["trivial"]:
        newton_mm = truth["newton"] * abs(truth["push"][1]) * truth["follows"] / truth["depth_mm"]
        lines += ["cutting:", f"  stiffness_n_per_mm: {newton_mm:.1f}", f"  std_n_per_mm: {0.3 * newton_mm:.1f}"]
    if truth["table"] is not None:
        lines += ["mechanical_units:", "  - {name: STN1, carries: workobject, axes: [{eax: b}]}"]
    return "\n".join(lines) + "\n"


def make(seed: int, n: int, folder: pathlib.Path, trivial: bool = False) -> None:
    """Write job n of a seed."""
    rng = np.random.default_rng([seed, n])
    truth, style = draw(rng, n, trivial)
    steps = toolpath(rng, truth["shape"], truth["climb"])
    place_job(rng, truth, steps)
    feeds = (float(rng.choice([150, 250])), float(rng.choice([15, 25, 40, 60])))
    zone = str(rng.choice(["fine", "z0", "z0", "z1", "zFein"])) if truth["shape"] != "surface" else "z0"
    for s in steps:
        s["place"] = np.round(s["place"], 4)
        s["feed"], s["zone"] = (feeds[1], zone) if s["cut"] else (feeds[0], str(rng.choice(["fine", "z1", "z5", "z10"])))
    for s, then in itertools.pairwise(steps):
        if s["cut"] != then["cut"]:
            s["zone"] = "fine"
    truth["cut"] = [s["cut"] for s in steps]
    if truth["home"]:
        home = [truth["start_deg"][0] // 2, 0, 10, 0, 45, 0]
        steps.insert(0, {"kind": "A", "joints_deg": home, "feed": feeds[0], "zone": "fine", "cut": False, "layer": 0})
    job = truth | {"steps": steps, "title": "Gesenk Nr. 7, Schlichten mit Fräser D16 (côté A)"}
    files = write(style, job, rng)
    program = Program(files)
    cartesian = [m for m in program.driven if m["kind"] != "AbsJ"]
    world = World(truth)
    path = Path(cartesian)
    plan = Plan(path, cartesian, truth)
    text, force = logged(rng, truth, world, cartesian, path, plan)
    folder.mkdir(parents=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    truth["files"], truth["targets"] = list(files), program.targets
    first = int(truth["home"] and style != "procs")
    truth["tare"] = None if trivial else f"{first}:{first + 1}"
    (folder / "forces.csv").write_text(text, encoding="utf-8")
    (folder / "cell.yaml").write_text(cell_text(truth, force), encoding="utf-8")
    (folder / "measurements.csv").write_text(load_tests(rng, truth, trivial), encoding="utf-8")
    options = [*(["--tare", truth["tare"]] if truth["tare"] else []),
               *(["--depth-of-cut", f"{truth['depth_mm']:g}"] if truth["knows_depth"] == "option" and not trivial else [])]
    out = "out.mod" if len(files) == 1 else "out/"
    (folder / "commands.txt").write_text("compstiff identify cell.yaml measurements.csv -o stiffness.json\n" + " ".join(
        ["compstiff correct cell.yaml", *files, "--stiffness stiffness.json --forces forces.csv", *options, "-o", out,
         "--offsets", "offsets.csv"]) + "\n")
    (folder / "truth.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    count, seed, where = int(sys.argv[1]), int(sys.argv[2]), pathlib.Path(sys.argv[3])
    for number in range(count):
        make(seed, number, where / f"job{number:02d}", "--trivial" in sys.argv)
    print(f"{count} jobs in {where}, seed {seed}")
