"""Tares in the air and in a cut, in jobs whose program has few air moves or none: what is taken, what is refused.

    python benchmarks/tares.py [--runs 400] [--seed 0]

Programs: slots, rasters with and without lifts, closed contours, spirals; with and without approach and retract, at the feed of
the cut or as one or two rapid moves. Logs by path length or target number, raw (tooth passing as large as a good part of the
force) or smoothed, with bias, drift and noise; some begin late or end early, some run on before and after the program. Each is
tried with a tare of each kind: right ones at the start, at the end, between cuts; wrong ones inside a cut, at a start or an end
that cuts. Wrong and taken without a warning makes a wrong part; right and refused stops a shop.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np

from compensator.forces.log import ForceLog
from compensator.forces.placement import place_forces
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell

SAMPLES = Path(__file__).parent.parent / "samples"
SHAPES = ("slot", "raster", "raster one way", "contour", "spiral")


@dataclass(frozen=True, eq=False)
class Job:
    """path, log; cut (N,): the target's whole stretch cuts; air (N,): none of it does; where: words for people."""

    path: RobotPath
    log: ForceLog
    cut: np.ndarray
    air: np.ndarray
    where: str


def _shape(name: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) [mm] of what is cut, and whether the move to each cuts (False: a lift between passes)."""
    step = rng.uniform(3, 8)
    if name == "slot":
        count = int(rng.integers(12, 40))
        return np.column_stack([step * np.arange(count), np.zeros(count)]), np.ones(count, dtype=bool)
    if name == "contour":
        angle = np.linspace(0, 2 * np.pi, int(rng.integers(20, 60)))
        return 60 * np.column_stack([np.cos(angle), np.sin(angle)]), np.ones(len(angle), dtype=bool)
    if name == "spiral":
        angle = np.linspace(0, 6 * np.pi, int(rng.integers(40, 70)))
        return (10 + 3 * angle)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), np.ones(len(angle), dtype=bool)
    passes, along = int(rng.integers(3, 7)), int(rng.integers(6, 12))
    points, cuts = [], []
    lifted = name == "raster one way" or rng.random() < 0.5
    for row in range(passes):
        x = step * np.arange(along)
        x = x[::-1] if row % 2 and name == "raster" else x
        points += [[a, 5.0 * row] for a in x]
        cuts += [not (lifted and row)] + [True] * (along - 1)
    return np.array(points), np.array(cuts)


def job(rng: np.random.Generator) -> Job:
    """One program with its log."""
    shape = str(rng.choice(SHAPES))
    plane, cuts = _shape(shape, rng)
    before, after = int(rng.choice([0, 2, 3, 5], p=[0.15, 0.25, 0.3, 0.3])), int(rng.choice([0, 1, 3], p=[0.25, 0.35, 0.4]))
    lead_in = np.array([plane[0] + [0, -6.0 * (before - k)] for k in range(before)]).reshape(-1, 2)
    lead_out = np.array([plane[-1] + [0, 6.0 * (k + 1)] for k in range(after)]).reshape(-1, 2)
    plane = np.concatenate([lead_in, plane, lead_out])
    cuts = np.concatenate([np.zeros(before, dtype=bool), cuts, np.zeros(after, dtype=bool)])
    if before:
        cuts[before] = False
    rapid = rng.random() < 0.3
    fast = np.zeros(len(cuts), dtype=bool)
    if rapid:
        fast[np.flatnonzero(~cuts)[:int(rng.integers(1, 3))]] = True
    quaternion = "0.02522428,-0.00054983,-0.99944426,0.02178562"
    moves = "\n".join(
        f"Move{'L' if k else 'J'} [[{1000 + x:.4f},{y:.4f},700],[{quaternion}],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"
        f"{'v200' if fast[k] else 'v20'},z0,tSpindle;" for k, (x, y) in enumerate(plane))
    toolpath = read_rapid(f"MODULE M\nPROC main()\n{moves}\nENDPROC\nENDMODULE\n".encode(), "m.mod").toolpath
    path = robot_path(toolpath, read_cell(SAMPLES / "cell.yaml"))
    return _logged(path, plane, cuts, shape, rng)


def _logged(path: RobotPath, plane: np.ndarray, cuts: np.ndarray, shape: str, rng: np.random.Generator) -> Job:
    length = path.length
    per = int(rng.choice([4, 15, 60, 200]))
    outside = rng.random() < 0.5
    margin = rng.uniform(0.02, 0.05) if outside else 0.0
    place = np.arange(-margin, length[-1] + margin, np.median(np.diff(length)) / per)
    move = np.clip(np.searchsorted(length, place), 1, len(length) - 1)
    engaged = cuts[move] & (place > 0) & (place <= length[-1])
    direction = np.diff(plane, axis=0, prepend=plane[:1] - [1, 0])
    direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-9)[:, None]
    size = np.exp(rng.uniform(np.log(30), np.log(600)))
    angle = rng.uniform(np.radians(60), np.radians(200))
    turned = np.column_stack([np.cos(angle) * direction[:, 0] - np.sin(angle) * direction[:, 1],
                              np.sin(angle) * direction[:, 0] + np.cos(angle) * direction[:, 1]])
    steady = np.interp(np.arange(len(cuts)), np.linspace(0, len(cuts), 8), rng.uniform(0.6, 1.2, 8))
    force = np.column_stack([turned, np.full(len(cuts), rng.uniform(-0.5, 0.2))]) * steady[:, None] * size
    shown = force[move] * engaged[:, None]
    raw = rng.random() < 0.6
    if raw:
        tooth = np.sin(np.arange(len(place)) * rng.uniform(0.5, 3))
        shown = shown * (1 + rng.uniform(0.3, 1.0) * tooth[:, None])
    else:
        width = max(per // 4, 1)
        shown = np.column_stack([np.convolve(column, np.ones(width) / width, mode="same") for column in shown.T])
    bias = rng.standard_normal(3) * np.exp(rng.uniform(np.log(1), np.log(80)))
    drift = rng.standard_normal(3) * rng.choice([0.0, 1.0, 3.0])
    shown = shown + bias + np.linspace(0, 1, len(place))[:, None] * drift
    shown += rng.uniform(0.5, 3) * rng.standard_normal(shown.shape)
    borders = 0.5 * (length[1:] + length[:-1])
    target = np.searchsorted(borders, place)
    whole = np.array([engaged[target == k].mean() if (target == k).any() else 0.5 for k in range(len(cuts))])
    kept = np.ones(len(place), dtype=bool)
    truncated = rng.random()
    if truncated < 0.15:
        kept = place > rng.uniform(0.05, 0.2) * length[-1]
    elif truncated < 0.3:
        kept = place < rng.uniform(0.8, 0.95) * length[-1]
    by_target = rng.random() < 0.4
    if by_target:
        kept &= (place >= 0) & (place <= length[-1])
    place, shown, target = place[kept], shown[kept], target[kept]
    load = np.column_stack([shown, np.zeros((len(shown), 3))])
    log = ForceLog("log.csv", load[:, :3], load[:, 3:], False, "target" if by_target else "path_mm",
                   target.astype(float) if by_target else place, np.arange(len(place)), np.ones(len(place)), None, None, None,
                   load, np.zeros(len(place), dtype=bool))
    where = f"{shape}, {size:.0f} N, {'raw' if raw else 'smooth'}, {per} a target, {'target' if by_target else 'path'}"
    seen = np.bincount(target, minlength=len(cuts)) > 0
    return Job(path, log, (whole > 0.99) & seen, (whole < 0.01) & seen, where)


def tares(what: Job, rng: np.random.Generator) -> dict[str, tuple[int, int]]:
    """First and last target by kind; `right:` or `wrong:`."""
    found: dict[str, tuple[int, int]] = {}
    seen = np.flatnonzero(what.cut | what.air)

    def runs(flags: np.ndarray, least: int) -> list[tuple[int, int]]:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
        return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]

    for first, last in runs(what.air, 1):
        if first == 0:
            found["right: at the start"] = (first, min(last, 2))
        elif last == len(what.air) - 1:
            found["right: at the end"] = (max(first, last - 2), last)
        else:
            found["right: between cuts"] = (first, last)
    cut = runs(what.cut, 5)
    for first, last in cut:
        if first == 0:
            found["wrong: a start that cuts"] = (0, 2)
        if last == len(what.cut) - 1:
            found["wrong: an end that cuts"] = (last - 2, last)
    if cut and len(seen):
        first, last = cut[int(rng.integers(len(cut)))]
        start = int(rng.integers(first + 1, max(last - 3, first + 2)))
        found["wrong: inside a cut"] = (start, start + 2)
    return found


def main(runs: int, seed: int, told: bool) -> None:
    counted: dict[str, Counter[str]] = {}
    for number in range(runs):
        rng = np.random.default_rng((seed, number))
        what = job(rng)
        for kind, tare in tares(what, rng).items():
            try:
                forces = place_forces(what.log, what.path, what.path.cell, tare=tare)
                codes = {finding.code for finding in forces.findings if finding.level != "note"}
                answer = "warned" if codes & {"CS3066", "CS3041"} else "taken"
            except CompstiffError as refused:
                answer = refused.findings[0].code
            counted.setdefault(kind, Counter())[answer] += 1
            if told and (kind.startswith("wrong") == (answer in ("taken", "warned"))):
                print(f"{number}: {kind} {tare} of {len(what.cut)}: {answer}; {what.where}", flush=True)
    for kind, answers in sorted(counted.items()):
        print(f"{kind:28} {sum(answers.values()):5}: " + ", ".join(f"{n} {answer}" for answer, n in answers.most_common()))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tell", action="store_true", help="each wrong answer")
    arguments = parser.parse_args()
    main(arguments.runs, arguments.seed, arguments.tell)
