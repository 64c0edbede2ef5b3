"""What does `compstiff diagnose` say of load tests by a simulator whose author did not know what the others hide?

    OMP_NUM_THREADS=1 python benchmarks/blind_world.py [CASES] [FIRST_SEED] [--keep FOLDER]

One cause a case moves the tool by 5 to 30 % of the RMS deflection; every sixth case hides nothing. No seed is skipped.

Shared with the program: the robot files and docs/formats.md, nothing else. Chain, statics, poses and loads are blind_arm.py's,
laws this file's: finite motions of a chain with flexes between its frames, at rest under the loads and its own weight (8 times
the payload, which no file states). Each visit begins with an unloaded reading, which the memory of friction and creep sees.
Some laws the dictionary has not (F^(2/3), a tracker moved, skewed waves): `unknown` or a set is right for these. Noise
1 to 15 um, a third of it Student 4, re-seating to 4 um, force to 0.8 %; cell.yaml states all of it or the sensor's alone.

Judged: right, twin (a name that load tests hardly tell from it), in set (ambiguous, with the truth), set without, unknown,
adequate, WRONG, and more (a true name and one that is no twin; a `bad_visit` counts), alarm. `sigma`: the norm, under the true
noise, of what six springs leave of the hidden part.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.blind_arm import PLANS, ROBOTS, ROOT, UNIT, Arm, X, Y, by, load_test, readings, size, turn, within

FLAT = np.array([1, 1, 0])


def causes(arm, rows, r):
    """What may be hidden in this load test, drawn with r: title -> (right names, twins, hooks)."""
    k, q, visit, time, top = arm.k, rows["q"], rows["visit"], rows["time"], np.abs(rows["torque"]).max(0)
    able = [i for i in range(6) if (top / k)[i] > 0.15 * (top / k).max()]
    j, free, tilt = (int(r.choice(x)) for x in (able, [i for i in able if i in (0, 3, 4, 5)] or [0], [2, 3]))
    (a, b), u, hand, row = r.permutation(3)[:2], r.normal(size=3), int(r.choice([1, 2, 3, 4])), int(len(q) * r.uniform(.3, .7))
    share, phase, an, wait = r.uniform(.15, .4), r.uniform(0, 6.28), r.uniform(.5, 1.6), r.uniform(15, 90)
    u /= size(u)
    centre, wide, turned = r.choice(q[:, j]), max(.35 * q[:, j].std(), .2), turn(u * .1) - np.eye(3)
    late = (np.arange(len(q)) >= row)[:, None]
    axis, cross, low, only = np.outer(UNIT[a], UNIT[a]), np.outer(UNIT[a], UNIT[b]), share * top[j], np.eye(6)[j]
    plays = share * top * np.array([[.15], [.5], [1]])

    def gear(i, extra):
        return law(lambda c, s: {"twist": c["twist"] + s * np.outer(extra(c, c["gear"][:, i]) / k[i], np.eye(6)[i])})

    def law(change):
        return {"law": lambda c, s: c.update(change(c, s))}

    def flex(e, m):
        return law(lambda c, s: {"w": c["w"] + np.eye(8)[e][:, None, None] * 1e-6 * s * c["local"](e)[1] * m})

    def force(m):
        return {"force": lambda f, flange, s: f + s * f @ m.T}

    def read(m):
        return {"read": lambda d, s: d + s * d @ m.T}

    def shift(g):
        return {"read": lambda d, s: d + 1e-4 * s * g}

    def push(m):
        return shift(1e-3 * rows["force"] @ m.T)

    def couple(one, two):
        return law(lambda c, s: {"twist": c["twist"] + min(s, .7) / np.sqrt(k[one] * k[two]) * (
            np.outer(c["torque"][:, two], np.eye(6)[one]) + np.outer(c["torque"][:, one], np.eye(6)[two]))})

    def beam(e, along):
        def bend(c, s):
            pull, moment = c["local"](e)
            side = np.cross(along, pull)
            c["w"][e] += 1e-6 * s * (moment - along * (moment @ along)[:, None] / (along @ along) + side / 2)
            c["t"][e] += 1e-6 * s * (np.cross(moment, along) / 2 + np.cross(side, along) / 3)
        return {"law": bend}

    def memory(start, step):
        """A state that each row takes on from the row before; start at each visit's first."""
        def hold(c, s):
            state = None
            for i in range(len(c["q"])):
                fresh = i == 0 or c["visit"][i] != c["visit"][i - 1]
                state = start(c, i) if fresh else step(c, i, state)
                c["twist"][i] += s * state.reshape(-1, 6).mean(0) / k
        return {"law": hold}

    loop = memory(lambda c, i: np.tile(c["gear"][i] * only, (3, 1)),
                  lambda c, i, old: np.clip(old, (c["gear"][i] - plays) * only, (c["gear"][i] + plays) * only))
    kelvin = memory(lambda c, i: c["weight"][i], lambda c, i, old: c["torque"][i] + (old - c["torque"][i]) * np.exp(
        (c["time"][i - 1] - c["time"][i]) / wait))
    beams = "link_bending[2] link_bending[3] bearing_tilt[2] bearing_tilt[3]"
    stands = "stand_compliance base_shift spindle_compliance"
    gains, tools = "force_axis_gain deflection_sensor_gain", "spindle_compliance force_sensor_compliance bearing_tilt[5]"
    gauges, forces = "deflection_sensor_crosstalk deflection_sensor_rotation", "force_crosstalk force_misalignment side_load"
    uneven = f"uneven_gear[{j + 1}]" + " gravity_compensator[2]" * (j == 1)
    soft, free_play = f"soft_zone[{j + 1}]", f"backlash[{free + 1}]"
    found = {
        "bearing 1 tilts": ("bearing_tilt[1]", "base_rocking", flex(1, FLAT)),
        "bearing 2 or 3 tilts": (f"bearing_tilt[{tilt}]", beams, flex(tilt, FLAT)),
        "lower arm bends": ("link_bending[2]", beams, beam(2, abs(arm.a[2]) * X)),
        "lower arm twists": ("link_bending[2] bearing_tilt[2]", beams, flex(2, X)),
        "forearm bends": ("link_bending[3]", beams, beam(3, arm.d[3] * Y)),
        "floor plate rocks": ("base_rocking", "bearing_tilt[1]", flex(0, np.array([1, an, .1]))),
        "base slides": ("base_shift", stands, law(lambda c, s: {"extra": 1e-7 * s * c["force"] * [1, an, .2]})),
        "gear worn at some angles": (uneven, "", gear(j, lambda c, x: x * np.exp(-.5 * ((c["q"][:, j] - centre) / wide) ** 2))),
        "gear waves, skewed": (uneven, "", gear(j, lambda c, x: x / (1.4 + np.cos(c["q"][:, j] + phase)))),
        "spring beside gear 2": ("gravity_compensator[2]", "uneven_gear[2]", gear(
            1, lambda c, x: -x * np.sin(c["q"][:, 1] - phase) ** 2)),
        "softer one way": (f"one_sided[{free + 1}]", f"{soft} {free_play}", gear(
            free, lambda c, x: np.maximum(x - c["weight"][:, free], 0))),
        "soft near zero": (soft, f"backlash[{j + 1}]", gear(j, lambda c, x: low * np.arctan(x / low))),
        "softens": (f"soft_beyond[{free + 1}]", "", gear(free, lambda c, x: x * (x / top[free]) ** 2)),
        "play": (free_play, f"soft_zone[{free + 1}]", gear(free, lambda c, x: top[free] * np.tanh(x / (.02 * top[free])))),
        "friction": (f"hysteresis[{j + 1}]", f"backlash[{j + 1}]", loop),
        "axes 2 and 3 coupled": ("parallelogram" * arm.rod, "link_bending[2]", couple(1, 2)),
        "wrist coupled": ("wrist_coupling", "", couple(*[(4, 5), (3, 4), (3, 5)][r.integers(3)])),
        "creep": ("creep", "", kelvin),
        "warms": ("softening", "", law(
            lambda c, s: {"twist": c["twist"] * (1 - s * np.expm1(-c["time"] / 1e3))[:, None]})),
        "spindle": ("spindle_compliance", tools, law(
            lambda c, s: {"extra": 1e-7 * s * within(c["flange"], np.diag(FLAT), c["force"])})),
        "force sensor tilts": ("force_sensor_compliance", tools, flex(7, FLAT)),
        "load cell's gain": ("force_axis_gain", gains, force(-axis)), "cross-talk": ("force_crosstalk", forces, force(cross)),
        "load turned": ("force_misalignment", forces, force(turned)),
        "load cell turned in the flange": ("force_misalignment", forces, {
            "force": lambda f, to, s: f + s * within(to, turned, f)}),
        "not zeroed": ("force_offset", gains, {"force": lambda f, to, s: f + 50 * s * u * (size(f) > 1)}),
        "load beside the TCP": ("tool_point tcp", "", {"lever": lambda to, s: s * by(to, u) * .1}),
        "load beside, in the cell": ("tool_point hook_offset", "tcp", {"lever": lambda to, s: s * u * .1}),
        "gauge's gain": ("deflection_sensor_gain", gains, read(axis)),
        "gauges turned": ("deflection_sensor_rotation", gauges, read(turned)),
        "gauge not square": ("deflection_sensor_crosstalk", gauges, read(cross)),
        "round target": ("target_curvature", "", {
            "read": lambda d, s: d + 10 * s * np.outer((d ** 2).sum(1) - d[:, a] ** 2, UNIT[a])}),
        "stand": ("stand_compliance", stands, push(np.diag(r.uniform(.3, 1, 3)))),
        "stand leans": ("stand_compliance", f"{gauges} {stands}", push(np.outer(u, UNIT[a]))),
        "Hertz": ("", stands, shift(.01 * rows["force"] / size(rows["force"]) ** (1 / 3))),
        "drift": ("drift", "", shift(-np.expm1(-time / time.max())[:, None] * u)),
        "bump": ("sensor_step", "", shift(late * u)),
        "tracker moved": ("", "two_robots", {"read": lambda d, s: d + s * late * (d @ turned.T)}),
        "encoder jumps": (f"encoder_zero[{hand}]", "sensor_step", shift(
            arm.jacobian(q)[:, :, hand - 1] * (visit >= visit[row])[:, None])),
        "joint's zero": (f"joint_zero[{hand + 1}]", "tcp", {"angles": lambda s: .05 * s * np.eye(6)[hand]}),
        "wrong pose": ("bad_visit", "sensor_step", {
            "angles": lambda s: .1 * s * np.outer(visit == visit[row], np.eye(6)[hand])}),
    }
    return {title: (set(right.split()), set(twins.split()), hooks) for title, (right, twins, hooks) in found.items()}


def noise(arm, rows, r):
    """Errors (n, 3) [m], and their sizes: sensor, re-seating [m], share of the load."""
    sensor, seat, share = np.exp(r.uniform(0, np.log(15))) * 1e-6, r.uniform(0, 4e-6), r.uniform(0, .008)
    shape = rows["force"].shape
    own = r.standard_t(4, shape) / np.sqrt(2) if r.random() < 1 / 3 else r.normal(size=shape)
    torque = rows["torque"] * share * r.normal(size=(len(own), 1))
    seated = r.normal(size=(rows["visit"].max() + 1, 3))[rows["visit"]]
    return sensor * own + seat * seated + by(arm.jacobian(rows["q"]), torque / arm.k), (sensor, seat, share)


def left_over(arm, rows, hidden, sizes):
    """The norm, in sigmas, of what springs within a factor of two leave of the hidden part."""
    springs = arm.jacobian(rows["q"]) * (rows["torque"] / arm.k)[:, None]
    sensor, seat, share = sizes
    parts, ways = [], []
    for visit in range(rows["visit"].max() + 1):
        mine = rows["visit"] == visit
        plain = share * springs[mine].sum(-1).ravel()
        alike = np.kron(np.ones((mine.sum(), mine.sum())), np.eye(3))
        half = np.linalg.cholesky(sensor ** 2 * np.eye(len(plain)) + seat ** 2 * alike + np.diag(plain ** 2))
        parts.append(np.linalg.solve(half, hidden[mine].ravel()))
        ways.append(np.linalg.solve(half, springs[mine].reshape(-1, 6)))
    target, way = np.concatenate([*parts, np.zeros(6)]), np.concatenate([*ways, np.eye(6)])
    return float(np.linalg.norm(target - way @ np.linalg.lstsq(way, target, rcond=None)[0]))


def hide(seed):
    """Case `seed`: arm, rows, title, (right, twins), readings [m], sizes of the noise, sigma of the hidden part."""
    r = np.random.default_rng(seed)
    arm = Arm(str(r.choice(ROBOTS)), r)
    rows = load_test(arm, str(r.choice(list(PLANS))), r)
    every = causes(arm, rows, r)
    title, share = str(r.choice(list(every))), float(r.uniform(.05, .3))
    right, twins, hooks = every[title]
    plain, s = readings(arm, rows, {}, 0), 0.1
    if seed % 6 == 0:
        title, right, twins, hidden = "nothing", set(), set(), 0 * plain
    else:
        for _ in range(6):
            hidden = readings(arm, rows, hooks, s) - plain
            s *= np.clip(share * np.sqrt((plain ** 2).sum() / max((hidden ** 2).sum(), 1e-30)), 1e-3, 1e3)
    error, sizes = noise(arm, rows, r)
    return arm, rows, title, (right, twins), plain + hidden + error, sizes, left_over(arm, rows, hidden, sizes), r


def write(folder, arm, rows, read, sizes, r):
    stated = {"deflection_std_um": [round(sizes[0] * 1e6, 2)] * 3}
    if r.random() < 0.5:
        stated |= {"pose_offset_std_um": [round(sizes[1] * 1e6, 2)] * 3, "force_relative_std": round(sizes[2], 4)}
    cell = {"robot": arm.name, "tool": {"position_mm": [float(x) for x in arm.tool * 1e3]}, "measurement": stated}
    (folder / "cell.yaml").write_text(json.dumps(cell))
    with (folder / "loads.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow([*(f"q{i}_deg" for i in range(1, 7)), *(f"f{a}_n" for a in "xyz"), *(f"d{a}_um" for a in "xyz"),
                        "time_s", "dwell_s", "pose"])
        for v, q, f, d, t in zip(rows["visit"], np.degrees(rows["q"]), rows["force"], read * 1e6, rows["time"], strict=True):
            table.writerow([*q.round(4), *f, *d.round(1), round(t, 1), 10, f"P{v + 1}"])


def judged(answer, right, twins):
    """The outcome of one answer of `diagnose --json`, and what was said."""
    result, verdict = answer["result"] or {}, (answer["result"] or {"verdict": "refused"})["verdict"]
    said, others = ([cause["effect"] + (f"[{cause['joint']}]" if cause.get("joint") else "") for cause in result.get(key, [])]
                    for key in ("causes", "alternatives"))
    said += [mistake["mistake"] for mistake in result.get("mistakes", [])]
    others = others if verdict == "ambiguous" else []
    told = f"{verdict} {' '.join(said)} {' '.join(others)}"
    if verdict in ("named", "mistake"):
        more = "and more" if set(said) - right - twins else "right"
        return more if right & set(said) else "twin" if twins & set(said) else "WRONG", told
    if verdict == "ambiguous":
        return "in set" if right & {*said, *others} or not right else "set without", told
    return verdict, told


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=int, nargs="?", default=60)
    parser.add_argument("first", type=int, nargs="?", default=1)
    parser.add_argument("--keep", type=Path, help="folder that keeps every case's files")
    options = parser.parse_args()
    counts, fair = defaultdict(Counter), Counter()
    run = [sys.executable, "-m", "compstiff", "diagnose", "cell.yaml", "loads.csv", "-o", "diagnosis.json", "--force", "--json"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    for seed in range(options.first, options.first + options.cases):
        arm, rows, title, names, read, sizes, sigma, r = hide(seed)
        with tempfile.TemporaryDirectory() as temporary:
            folder = (options.keep or Path(temporary)) / str(seed)
            folder.mkdir(parents=True, exist_ok=True)
            write(folder, arm, rows, read, sizes, r)
            done = subprocess.run(run, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        outcome, told = judged(json.loads(done.stdout), *names)
        if title == "nothing":
            outcome = "right" if outcome == "adequate" else "alarm"
        elif not names[0]:
            outcome = "right" if outcome in ("unknown", "in set") else outcome
        counts[title][outcome] += 1
        fair[outcome] += sigma > 12 or title == "nothing"
        print(f"{seed:5d} {rows['kind']:7s} {arm.name[:9]:9s} {title:30s} {sigma:6.0f} sigma {outcome:12s} {told}", flush=True)
    print("\nby cause:", *(f"  {title}: {dict(count)}" for title, count in sorted(counts.items())), sep="\n")
    print("all:", dict(sum(counts.values(), Counter())), " over 12 sigma, and nothing hidden:", dict(fair))


if __name__ == "__main__":
    main()
