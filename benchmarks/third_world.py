"""A third judge's load tests, by an author who knew neither the dictionary of `diagnose` nor the other simulators.

    python benchmarks/third_world.py CASES SEED [FOLDER] [--only CAUSE[+CAUSE][,...]]

Each case is a folder with cell.yaml, measurements.csv and truth.json, put through `compstiff diagnose` as a user would. Of
twenty, eight hide one thing of gears, structure, loads or gauges, five a mistake of people, five nothing, two a pair. Six kinds
of rig, eight built-in robots, sizes in three steps. The numbers of noise, weight and size are engineering judgement.

Judged: right, or one of two; a set with or without the truth; unknown; a wrong name, half wrong (beside a right one); a false
alarm; missed, or not visible (under 9 sigma of what six springs and the seats leave); refused; a bad visit, right or wrong.
Of a mistake any that is named counts as right: its sentence is for a person to read.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from argparse import ArgumentParser
from collections import Counter
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
import numpy as np

from benchmarks import third_causes, third_rig
from benchmarks.third_gears import Rng
from benchmarks.third_nothing import NOTHING, few
from benchmarks.third_sight import visible
from benchmarks.third_slips import MISTAKES
from benchmarks.third_trial import KINDS, Diverged, Trial

PHYSICS = {**third_causes.CAUSES, **third_rig.CAUSES}
ALL = {**PHYSICS, **MISTAKES, **NOTHING}
SIZES = (1.0, 0.45, 0.2)
# Sigmas from which on something is visible.
SEEN = 9.0
HUNG = 0.08
Answer = dict[str, Any]


def made(seed: int, causes: list[str]) -> tuple[Trial, Trial, list[str], list[set[str]], float]:
    """A trial with these hidden, the same with nothing, what is hidden in words, the names that are right, and the size."""
    rng = np.random.default_rng(seed)
    kind, robot = str(rng.choice(KINDS)), None
    if causes[0] == "pulley" and kind != "weights":
        kind = "turnbuckle"
    if causes[0] in ("rod_side", "manometer", "seal", "seal_sticks"):
        kind = "hydraulic"
    if causes[0] == "rod_bearing":
        robot = str(rng.choice(["irb6660-205-1.90", "irb4400-60"]))
    hung = causes[0] == "gantry" or bool(rng.random() < HUNG)
    size = float(rng.choice(SIZES))
    trial, plain = (Trial(kind, seed, robot, hung) for _ in range(2))
    told, right = [], []
    for name in causes:
        words, names = ALL[name](trial, size)
        told.append(f"{name}: {words}")
        right.append(names)
    if causes[0] == "few":
        few(plain, size)
    return trial, plain, told, right, size


def matches(name: str, right: set[str]) -> bool:
    """An effect without a joint is right at any, unless one is right at a certain joint."""
    bare = name.split("[")[0]
    return name in right or (bare in right and not any(one.startswith(f"{bare}[") for one in right))


def labels(found: list[Answer]) -> list[str]:
    return [one["effect"] + (f"[{one['joint']}]" if one.get("joint") else "") for one in found]


def judged(causes: list[str], right: list[set[str]], sigmas: float, answer: Answer) -> tuple[str, str]:
    """What an answer is worth, and what it says in short."""
    verdict, named = answer["verdict"], labels(answer["causes"])
    others = labels([cause for one in answer["alternatives"] or [] for cause in (one.get("causes") or [one])])
    slips, misfit = [one["mistake"] for one in answer["mistakes"]], answer["misfit"]
    bad = [str(one["pose"]) for one in answer["visits"]["bad"]] if answer.get("visits") else []
    truth = set().union(*right)
    said = {"adequate": "", "named": ", ".join(named), "unknown": f"nearest {', '.join(others[:4])}",
            "ambiguous": ", ".join([*others, *(f"*{slip}" for slip in slips)]), "mistake": ", ".join(slips)}[verdict]
    said = f"{verdict} {said} p={misfit['p_value']:.3g} rms {misfit['rms_um']:.1f}/{misfit['expected_rms_um']:.1f}"
    if bad:
        said += f" bad visits {','.join(bad)}"
        if "bad_visit" not in named and verdict in ("unknown", "ambiguous", "adequate"):
            return f"{verdict} + {'bad visit' if 'bad_visit' in truth else 'wrong bad visit'}", said
    if all(cause in NOTHING for cause in causes):
        return ("right, quiet" if verdict == "adequate" else "false alarm"), said
    if verdict == "adequate":
        return ("missed" if sigmas > SEEN else "not visible"), said
    if verdict == "unknown":
        return verdict, said
    if verdict == "mistake":
        return ("right" if "*" in truth else "wrong mistake"), said
    if verdict == "named":
        if not all(matches(name, truth) for name in named):
            return ("half wrong" if any(matches(name, truth) for name in named) else "wrong"), said
        whole = all(any(matches(name, one) for name in named) for one in right)
        return ("right" if whole else "right, one of two"), said
    hit = any(matches(name, truth) for name in others) or ("*" in truth and slips)
    return ("set with the truth" if hit else "set without the truth"), said


def diagnosed(folder: Path) -> tuple[Answer | None, int, str]:
    """What the program answers, as a user calls it, its exit code, and the first line of what it says where it does not."""
    command = [sys.executable, "-m", "compstiff", "diagnose", "cell.yaml", "measurements.csv", "-o", "diagnosis.json",
               "--force", "--extended", "extended.json"]
    done = subprocess.run(command, cwd=folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
                          check=False)
    (folder / "said.txt").write_text(f"exit {done.returncode}\n{done.stdout}{done.stderr}")
    written = folder / "diagnosis.json"
    answer = json.loads(written.read_text()) if done.returncode in (0, 3) and written.exists() else None
    return answer, done.returncode, next(iter(done.stderr.strip().splitlines()), "")


def intervals(folder: Path, stiffness: list[float], answer: Answer | None) -> list[bool]:
    """Which 95 % intervals hold the true stiffnesses, where the program stands by them."""
    written = folder / "extended.json"
    if answer is None or answer["verdict"] not in ("adequate", "named") or not written.exists():
        return []
    springs = json.loads(written.read_text())["parameters"][:6]
    return [low <= true <= high for (low, high), true in zip((one["interval_95"] for one in springs), stiffness, strict=True)]


def case(number: int, seed: int, causes: list[str], root: Path) -> tuple[str, list[bool]]:
    """One case: made, diagnosed, judged; and which of its intervals hold."""
    trial, plain, told, right, size = made(seed, causes)
    sigmas, rms = visible(trial, plain)
    folder = root / f"{number:03d}-{'+'.join(causes)}"
    folder.mkdir(parents=True)
    trial.write(folder, seed + 1)
    start = time.monotonic()
    answer, code, first = diagnosed(folder)
    took = time.monotonic() - start
    mark, said = judged(causes, right, sigmas, answer) if answer else ("refused" if code == 1 else f"exit {code}", first)
    held = intervals(folder, trial.stiffness.tolist(), answer)
    truth = {"seed": seed, "causes": causes, "size": size, "kind": trial.kind, "robot": trial.arm.name, "hidden": told,
             "right": [sorted(names) for names in right], "sigmas": sigmas, "rms_um": rms, "mark": mark,
             "stiffness_nm_per_rad": trial.stiffness.tolist()}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    print(f"{number:03d} {trial.arm.name} {trial.kind} {trial.visits} poses x{size:g} | {'; '.join(told)} | "
          f"{sigmas:.0f} sigma, {rms:.0f} um | {mark} | {said} | k in {sum(held)}/{len(held)}, {took:.0f} s", flush=True)
    return mark, held


def deck(rng: Rng, count: int) -> list[list[str]]:
    """What is hidden in so many cases: each of a kind comes once before any comes again."""
    kinds = {"physics": list(PHYSICS), "mistakes": list(MISTAKES), "nothing": list(NOTHING)}
    left = {kind: rng.permutation(names).tolist() for kind, names in kinds.items()}

    def drawn(kind: str) -> str:
        left[kind] = left[kind] or rng.permutation(kinds[kind]).tolist()
        return str(left[kind].pop())

    found = []
    for number in range(count):
        place = number % 20
        if place in (1, 5, 10, 15, 18):
            found.append([drawn("mistakes")])
        elif place in (3, 8, 11, 16, 19):
            found.append([drawn("nothing")])
        else:
            found.append([drawn("physics")])
            if place in (6, 13):
                found[-1].append(str(rng.choice(kinds["physics" if place == 6 else "mistakes"])))
    return found


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("cases", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--only", help="hides these, in turn")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="third_"))
    cases = deck(np.random.default_rng(given.seed), given.cases)
    if given.only:
        cases = [each.split("+") for each in given.only.split(",")] * given.cases
    marks, held = Counter[str](), []
    for number, causes in enumerate(cases):
        try:
            mark, inside = case(number, given.seed * 1000 + number, causes, folder)
        except Diverged as stopped:
            mark, inside = "not made", []
            print(f"{number:03d} {'+'.join(causes)}: not made, {stopped}", flush=True)
        marks[mark] += 1
        held += inside
    print("\n".join(f"{count:5} {mark}" for mark, count in marks.most_common()))
    print(f"intervals: {sum(held)} of {len(held)}; in {folder}")


if __name__ == "__main__":
    main()
