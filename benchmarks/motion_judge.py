"""Asks the program about the motion judge's records: `python benchmarks/motion_judge.py FOLDER [FIRST LAST] [--again]`.

RIGHT was written from docs/effects.md and the words of the answers. The joint with the hidden cause and those with none are
counted apart. A wrong name that fits the record as well as the truth (motion_alike) had an excuse: `alike`. `--again` counts
the answers that lie in the folder.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks.motion_alike import apart
from benchmarks.motion_drive import Array

# One name of each tuple is wanted; without any, nothing is to be said; `None`: no name is right.
RIGHT: dict[str, tuple[str, ...] | None] = {
    "late_link": ("channel_delay(link)",), "late_motor": ("channel_delay(link)",), "late_torque": ("channel_delay(torque)",),
    "filtered_torque": ("channel_delay(torque)",), "friction": ("joint_friction",), "stribeck": ("joint_friction",),
    "backlash": ("backlash",), "soft_zone": ("soft_zone",), "stages": ("soft_zone",), "maxwell_slip": ("hysteresis",),
    "bouc_wen": ("hysteresis",), "motor_inertia": ("motor_inertia",), "ripple_motor_turn": ("transmission_error",),
    "ripple_multiple": ("transmission_error",), "ripple_odd": ("transmission_error",), "eccentric": ("transmission_error",),
    "wrong_ratio": ("transmission_error",), "zero_shift": (), "load_friction": (), "torque_gain": (), "torque_zero": (),
    "clock_jump": ("lost_samples",), "link_slips": ("encoder_slip",), "crosstalk": ("torque_crosstalk",),
    "warming": None, "zero_walks": None,
    # The torque's scale rises with the torque: the same column as a spring that does.
    "torque_saturates": None, "torque_side": None, "torque_ripple": None}
MEANT = {"torque_saturates": "soft_zone", "torque_ripple": "transmission_error"}       # the name with the very same columns
# What moves the link as the motor lags behind also makes the torque lag: beside the first name the second is no mistake.
BESIDE = {"late_motor": ("channel_delay(torque)",)}
# Every simulated gear is damped a little: where that shows, these two names have one column.
DAMPED = {"gear_damping", "channel_delay(torque)"}
BENT = {"soft_zone", "stages", "maxwell_slip", "bouc_wen", "backlash", "warming", "torque_saturates", "torque_side"}


def name_of(cause: dict[str, Any]) -> str:
    return str(cause["effect"]) + (f"({cause['channel']})" if cause.get("channel") else "")


def of_joint(causes: list[dict[str, Any]], joint: int) -> dict[str, dict[str, Any]]:
    return {name_of(c): c for c in causes if c.get("joint") in (joint, None)
            and (not c.get("by_joint") or str(joint) in {str(k) for k in c["by_joint"]})}


def answer(folder: Path, again: bool) -> tuple[dict[str, Any] | None, str, float]:
    """The diagnosis, what went wrong (empty), seconds."""
    truth = json.loads((folder / "truth.json").read_text())
    more = [f"--{truth['second']}", "record2.csv"] if truth["second"] else []
    begun = time.perf_counter()
    if not again:
        (folder / "diagnosis.json").unlink(missing_ok=True)
        files = ["cell.yaml", "record1.csv", *more, "-o", "diagnosis.json"]
        call = [sys.executable, "-m", "compstiff", "diagnose", *files, "--force"]
        run = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
        (folder / "said.txt").write_text(f"exit {run.returncode}\n{run.stdout}\n{run.stderr}")
    said = (folder / "said.txt").read_text()
    trouble = "".join(line for line in said.splitlines() if "Traceback" in line or "Warning:" in line)
    if not said.startswith("exit 0"):
        trouble += said[:300]
    path = folder / "diagnosis.json"
    return (json.loads(path.read_text()) if path.exists() else None), trouble, time.perf_counter() - begun


def record(folder: Path, joint: int) -> tuple[Array, Array, Array, float]:
    """Motor and link angle [rad], torque [Nm], rate [Hz] of the first record."""
    with (folder / "record1.csv").open() as lines:
        header = lines.readline().strip().split(",")
    wanted = [header.index(f"q{joint}_{what}") for what in ("motor_deg", "link_deg", "torque_nm")]
    table = np.loadtxt(folder / "record1.csv", delimiter=",", skiprows=1, usecols=[0, *wanted])
    return np.radians(table[:, 1]), np.radians(table[:, 2]), table[:, 3], float(1 / np.median(np.diff(table[:, 0])))


def lines_of(said: dict[str, Any], truth: dict[str, Any]) -> list[float]:
    """Cycles a turn of the lines that were answered, and of the motor's turn."""
    lines = (said.get("transmission_error") or {}).get("lines") or []
    return [float(line["cycles_per_turn"]) for line in lines] + truth.get("lines", []) + [truth["ratio"][str(said["joint"])]]


def graded(folder: Path, truth: dict[str, Any], said: dict[str, Any], told: dict[str, Any], joint: int) -> str:
    """What the answer about this joint is worth: the word it is counted under."""
    here = joint == truth["joint"] or truth["everywhere"]
    kinds = truth["kinds"] if here else []
    wanted = [RIGHT[kind] for kind in kinds]
    names = set(of_joint(told["causes"], joint)) if said["verdict"] == "named" else set()
    listed = {n for n, c in of_joint(told["alternatives"], joint).items() if c.get("probability", 1) >= 0.02} | names
    free = {n for kind in kinds for n in BESIDE.get(kind, ())}
    quiet = not any(w is None or w for w in wanted)
    strange = any(w is None for w in wanted)
    if said["verdict"] == "adequate":
        return "right (nothing)" if quiet else "not noticed"
    if said["verdict"] == "unknown":
        return "unknown on nothing" if quiet else ("right (unknown)" if strange else "unknown")
    likely = {n for n, c in of_joint(told["alternatives"], joint).items() if c.get("probability", 1) >= 0.2}
    if quiet and not names and "gear_damping" in likely and likely <= DAMPED:
        return "the damping that is there"
    meant = [next(iter(w)) for w in wanted if w] + [MEANT[kind] for kind in kinds if kind in MEANT]
    if names:
        wrong = names - {n for w in wanted if w for n in w} - free
        covered = all(w and names & set(w) for w in wanted)
        if not wrong and not quiet and not strange:
            return "right" if covered else "right in part"
        motor, link, torque, rate = record(folder, joint)
        if quiet or (strange and not meant):
            return "WRONG: alarm on nothing" if quiet else "WRONG: a name where none is right"
        right = sorted(set(meant) | (names - wrong))
        return "WRONG" if apart(motor, link, torque, rate, sorted(names), right, lines_of(said, truth)) else "alike"
    if quiet:
        return "set on nothing"
    if strange:
        return "set, none is right" if not set(meant) & listed else "alike"
    return "in the set" if all(set(w or ()) & listed for w in wanted) else "set without the truth"


def parameters(truth: dict[str, Any], told: dict[str, Any], joint: int) -> list[tuple[str, float, float]]:
    """Name, deviation from the truth in stated standard deviations, relative deviation."""
    causes, found = of_joint(told["causes"], joint), []
    for kind, size in zip(truth["kinds"], truth["sizes"], strict=True):
        values = {"late_link": size, "late_motor": -size, "late_torque": size,
                  "backlash": size, "motor_inertia": size * truth["inertia"], "friction": size * truth["peak_nm"][0]}
        for name in RIGHT[kind] or ():
            if kind in values and name in causes:
                key, value = next(iter(causes[name]["parameters"].items()))
                off = value["estimate"] - values[kind]
                if value.get("std"):
                    found.append((f"{kind}.{key}", off / value["std"], off / values[kind]))
    return found


def stiffness(truth: dict[str, Any], said: dict[str, Any], joint: int) -> tuple[bool, float, float, str] | None:
    """Whether the interval holds the truth, its half width (share), the deviation (share), its grade; None: no true k."""
    here = truth["kinds"] if joint == truth["joint"] or truth["everywhere"] else []
    if set(here) & BENT or not (said.get("stiffness") or {}).get("interval_95"):
        return None
    gain = 1 + (truth["sizes"][0] if here == ["torque_gain"] else 0.0)
    k, (low, high) = truth["stiffness"][str(joint)] * gain, said["stiffness"]["interval_95"]
    low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
    return low <= k <= high, (high - low) / 2 / k, said["stiffness"]["stiffness_nm_per_rad"] / k - 1, said["stiffness"]["grade"]


def main() -> None:
    again = "--again" in sys.argv
    arguments = [a for a in sys.argv[1:] if a != "--again"]
    folders = sorted(Path(arguments[0]).glob("case*"))
    if len(arguments) > 1:
        folders = folders[int(arguments[1]):int(arguments[2])]
    hidden: Counter[str] = Counter()
    clear: Counter[str] = Counter()
    plain: Counter[str] = Counter()
    springs: Counter[str] = Counter()
    parts: list[tuple[str, float, float]] = []
    for folder in folders:
        truth = json.loads((folder / "truth.json").read_text())
        told, trouble, seconds = answer(folder, again)
        about = f"{folder.name} {'+'.join(truth['kinds']) or 'nothing'} in {'all' if truth['everywhere'] else truth['joint']}"
        if truth["kinds"]:
            about += f" {truth['sigmas'][0]:.0f} sigma, {truth['of_noise'][0]:.2f} of noise"
        if told is None:
            (hidden if truth["kinds"] else plain)["no answer"] += 1
            print(f"{about}: NO ANSWER {trouble}", flush=True)
            continue
        for said in told["joints"]:
            joint = said["joint"]
            word = graded(folder, truth, said, told, joint)
            named = {n: c.get("probability") for n, c in of_joint(told["causes"], joint).items()}
            named = named if said["verdict"] == "named" else {}
            listed = {n: round(c.get("probability", 1), 2) for n, c in of_joint(told["alternatives"], joint).items()}
            here = bool(truth["kinds"]) and (joint == truth["joint"] or truth["everywhere"])
            (hidden if here else plain)[word] += 1
            if here and truth["of_noise"][0] > 0.5:
                clear[word] += 1
            k = stiffness(truth, said, joint)
            spring = ""
            if k is not None:
                springs[f"{k[3]}: {'holds' if k[0] else 'MISSES'}"] += 1
                spring = f"; k {'ok' if k[0] else 'MISSES'} {k[2]:+.1%} (+- {k[1]:.1%}) {k[3]}"
            new = parameters(truth, told, joint) if here else []
            parts += new
            values = " ".join(f"{n} {z:+.1f}s {r:+.0%}" for n, z, r in new)
            trouble = f" TROUBLE {trouble}" if trouble else ""
            print(f"{about} / joint {joint}: {word}; {said['verdict']} {named or listed} {values}{spring}{trouble}"
                  f" ({seconds:.0f} s)", flush=True)
    for title, counts in (("joints with the cause", hidden), ("of these over half the noise", clear),
                          ("joints with nothing", plain), ("stiffness intervals", springs)):
        print(f"{title}: {sum(counts.values())}: " + ", ".join(f"{word} {n}" for word, n in counts.most_common()))
    inside = sum(abs(z) < 2 for _, z, _ in parts)
    print(f"parameters within 2 sigma: {inside} of {len(parts)}; outside: "
          + ", ".join(f"{n} {z:+.1f}s {r:+.0%}" for n, z, r in parts if abs(z) >= 2))


if __name__ == "__main__":
    main()
