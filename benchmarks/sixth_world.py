"""Load tests by a sixth author, blind to the others: `python benchmarks/sixth_world.py N SEED FOLDER [CAUSE]`.

Writes FOLDER/000 ... with cell.yaml, measurements.csv and truth.json; every fifth has nothing hidden. The arm is
sixth_arm.py's, trials and nuisance sixth_trial.py's, causes sixth_causes.py's (the robot) and sixth_slips.py's (instruments,
loads, people). A cause is as large as shows by 5 to 30 standard deviations beyond six springs, if it can be within its
realistic sizes; a mistake that has one size comes as it is. CAUSE `nothing` hides nothing, `quiet` has no noise either.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
import numpy as np
from sixth_arm import ROBOTS
from sixth_causes import CAUSES
from sixth_trial import Hooks, Trial, build, deflection, disturb, sigmas, typed

LEAST, MOST = 5.0, 30.0


def hide(rng: np.random.Generator, cause: str, robot: str | None) -> tuple[Trial, Hooks, str, float, float]:
    """A trial with the cause in it: trial, hooks, place, size and by how many sigma it shows."""
    best = None
    for _ in range(60):
        t = build(rng, robot)
        made = CAUSES[cause](rng, t)
        if made is None:
            continue
        place, low, high, hooks = made

        def shows(a: float, t: Trial = t, hooks: Callable[[float], Hooks] = hooks) -> float:
            h = hooks(a)
            return sigmas(t, typed(t, deflection(t, t.force, h), h))

        aim = float(np.exp(rng.uniform(np.log(LEAST), np.log(MOST))))
        size, sigma = high, shows(high)
        if low < high and sigma > aim:
            for _ in range(9):
                middle = float(np.sqrt(low * high))
                value = shows(middle)
                size, sigma = middle, value
                if abs(np.log(value / aim)) < 0.08:
                    break
                low, high = (low, middle) if value > aim else (middle, high)
        found = (t, hooks(size), place, size, sigma)
        if best is None or sigma > best[4]:
            best = found
        if sigma >= LEAST:
            return found
    if best is None:
        raise ValueError(f"no trial can have {cause}")
    return best


def _stated(rng: np.random.Generator, t: Trial) -> dict[str, object]:
    """What the cell file says of the noise: right, a bit wrong, or nothing."""

    def say(x: float) -> float | None:
        how = rng.random()
        return x if how < 0.5 else None if how > 0.8 else x * float(rng.uniform(0.7, 1.6))

    out: dict[str, object] = {}
    for key, value, repeat in (
        ("deflection_std_um", np.hypot(t.noise["sensor"], t.noise["grain"] / 3.46) * 1e6, 3),
        ("pose_offset_std_um", t.noise["seat"] * 1e6, 3),
        ("force_relative_std", float(np.hypot(t.noise["visit_force"], t.noise["row_force"])), 0),
    ):
        said = say(float(value))
        if said is not None:
            said = float(f"{said:.2g}")
            out[key] = [said] * repeat if repeat else said
    return out


def _robot_file(t: Trial, short: tuple[float, ...]) -> dict:
    d1, a2, a3, a4, d4, d6 = (round(x * 1000, 3) for x in short)
    limits = [[-180, 180], [-80, 100], [-180, 120], [-300, 300], [-125, 125], [-360, 360]]
    rows = zip(
        [0, -90, 0, -90, 90, -90], [0, a2, a3, a4, 0, 0], [d1, 0, 0, d4, 0, d6], [0, -90, 0, 0, 0, 180], limits, strict=True
    )
    return {
        "name": t.arm.name,
        "manufacturer": "Shop",
        "load_path": "serial",
        "joints": [
            {
                "alpha_deg": al,
                "a_mm": a,
                "d_mm": d,
                "offset_deg": o,
                "limits_deg": lim,
                "speed_deg_s": 110,
                "acceleration_deg_s2": 400,
            }
            for al, a, d, o, lim in rows
        ],
        "prior": {"stiffness_nm_per_rad": [2.03e6, 6.02e6, 1.91e6, 0.45e6, 0.22e6, 0.07e6], "relative_std": 3.0},
    }


def write(folder: Path, rng: np.random.Generator, cause: str, robot: str | None = None) -> dict:
    """One case; what is true of it."""
    if cause in ("nothing", "quiet"):
        t, hooks, place, size, sigma = build(rng, robot, quiet=cause == "quiet"), Hooks(), "", 0.0, 0.0
    else:
        t, hooks, place, size, sigma = hide(rng, cause, robot)
    z = deflection(t, t.actual, hooks) + disturb(rng, t)
    grain = t.noise["grain"]
    table = typed(t, np.round(z / grain) * grain, hooks)
    folder.mkdir(parents=True, exist_ok=True)
    name = t.arm.name
    if name.startswith("shop"):
        name = f"{name}.yaml"
        (folder / name).write_text(json.dumps(_robot_file(t, table.arm.lengths), indent=1), encoding="utf-8")
    cell = {
        "robot": name,
        "tool": {"position_mm": [float(round(x * 1000, 2)) for x in table.arm.tool], "quaternion": [1, 0, 0, 0]},
        "measurement": _stated(rng, t),
    }
    (folder / "cell.yaml").write_text("".join(f"{k}: {json.dumps(v)}\n" for k, v in cell.items() if v), encoding="utf-8")
    hung = t.design == "tracker_weights"
    lines = [
        "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,"
        + ("mass_kg" if hung else "fx_n,fy_n,fz_n")
        + ",dx_um,dy_um,dz_um,time_s,reference,pose"
    ]
    for q, f, r, v, s in zip(table.q, table.force, table.read * 1e6, table.visit, table.time, strict=True):
        load = [f"{-f[2] / 9.80665:.4g}"] if hung else [f"{x + 0:.5g}" for x in f]
        once = cause in ("zero_once", "sun_on_the_arm")
        lines.append(
            ",".join(
                [
                    *(f"{x:.4f}" for x in q),
                    *load,
                    *("" if np.isnan(x) else f"{x + 0:.7g}" for x in np.round(r, 2)),
                    f"{s if once else s - t.time[t.zero][v]:.0f}",
                    "0" if once else f"{v}",
                    f"P{v + 1}",
                ]
            )
        )
    (folder / "measurements.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    truth = {
        "cause": cause,
        "place": place,
        "size": size,
        "sigma": round(sigma, 1),
        "robot": t.arm.name,
        "design": t.design,
        "rows": len(table.q),
        "visits": int(t.visit[-1]) + 1,
        "stiffness": t.arm.stiffness.tolist(),
        "noise": {k: float(v) for k, v in t.noise.items()},
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return truth


def main(count: int, seed: int, folder: Path, cause: str | None = None) -> None:
    order = np.random.default_rng([seed, 999]).permutation(sorted(CAUSES))
    for i in range(count):
        name = cause or ("nothing" if i % 5 == 4 else str(order[(i - i // 5) % len(order)]))
        robot = list(ROBOTS)[i % len(ROBOTS)] if name == "quiet" else "irb6660-205-1.90" if name == "serial_angle" else None
        truth = write(folder / f"{i:03d}", np.random.default_rng([seed, i]), name, robot)
        print(
            f"{i:03d} {name:26} {truth['place']:2} size {truth['size']:<10.3g} {truth['sigma']:7.1f} sigma  "
            f"{truth['robot']:18} {truth['design']:17} {truth['rows']} rows",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4] if len(sys.argv) > 4 else None)
