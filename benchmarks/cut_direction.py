"""Wrong force_log.sign and frame: how often the direction of the force against the travel tells, and how often it is wrong.

    python benchmarks/cut_direction.py [--jobs 60] [--seed 0]

The truth is the virtual cell's end mill on its part (a slot and the wall of a pocket, driven either way round), without the
yielding of the arm: teeth, depth, feed, stock on the wall, run-out and force coefficients (edge and radial parts by a factor of
two) are drawn. Each job is read with the right sign and frame, and with each wrong one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from compensator.forces.cut_direction import cut_direction, said_of_direction, travel
from compensator.forces.zero import base_from_log
from compensator.path.robot_path import RobotPath, robot_path
from compensator.rapid import read_rapid
from identification.common.arrays import Array
from identification.model.cell import read_cell
from tests.virtual_cell import milling
from tests.virtual_cell.cell import simulate
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import AIR, POCKET, SLOT, Part, slot_and_pocket, steps_of

FRAMES = ("base", "tool", "sensor")


def backwards(part: Part) -> Part:
    """The same path from its end: the wall on the other side of the tool, conventional instead of climb."""
    shifted = [np.append(value[::-1][-1:], value[::-1][:-1]) for value in (part.feature, part.place)]
    return replace(part, target_mm=part.target_mm[::-1].copy(), feature=shifted[0], place=shifted[1])


def cut(part: Part, cutter: EndMill, features: tuple[int, ...]) -> Array:
    """Mean force (N, 3) [N] on the tool at each target, work object: of the steps of the move to it, no yielding."""
    steps = steps_of(part, 1.0)
    place = steps.between(part.target_mm)
    total, count = np.zeros((len(part.target_mm), 3)), np.zeros(len(part.target_mm))
    for i, target in enumerate(steps.segment):
        count[target] += 1
        if steps.feature[i] in features:
            coverage, depth = milling.engagement(part, steps, cutter, i, place[i])
            along, left, up = cutter.mean_force(coverage, depth)
            ahead = steps.feed[i]
            total[target] += [along * ahead[0] - left * ahead[1], along * ahead[1] + left * ahead[0], up]
    return np.asarray(total / np.maximum(count, 1)[:, None])


def drawn(rng: np.random.Generator, folder: Path) -> tuple[RobotPath, Array, str]:
    """A job: its path, the force (N, 3) [N] on the tool in the base frame, and what is cut how."""
    case = simulate(3, "paper5", noise="none")
    part = slot_and_pocket(3.0, allowance_mm=float(rng.choice([0.3, 1.0, 2.5, 5.0])), wall_depth_mm=rng.uniform(2, 8))
    climb = rng.random() < 0.5
    if not climb:
        part = backwards(part)
    features = [(SLOT,), (POCKET,), (SLOT, POCKET)][int(rng.integers(3))]
    shear, edge = np.array(EndMill.shear_n_mm2), np.array(EndMill.edge_n_mm)
    cutter = EndMill(teeth=int(rng.integers(1, 5)), runout_mm=(0.0,), feed_mm_s=rng.uniform(10, 60),
                     shear_n_mm2=tuple(shear * [1, rng.uniform(0.5, 2), 1]), edge_n_mm=tuple(edge * rng.uniform(0.5, 2, 3)))
    cutter = replace(cutter, runout_mm=(rng.uniform(0, 0.015), *(cutter.teeth - 1) * (0.0,)))
    file, _ = case.write(folder)
    file.write_text(file.read_text() + milling.Sensor().cell_yaml())
    text = milling.rapid(part, milling.angles(milling.planned(part), case.plant), cutter,
                         tuple(1e3 * np.array(case.tool.tcp)), case.plant.object_m)
    path = robot_path(read_rapid(text.encode(), "part.mod").toolpath, read_cell(file))
    force = milling.BASE_FROM_OBJECT.apply(cut(part, cutter, features))
    force[part.feature == AIR] = 0.0
    assert set(np.unique(part.feature[np.any(force != 0, axis=1)])) <= set(features)
    kind = {(SLOT,): "slot", (POCKET,): f"wall, {part.allowance_mm:g} mm", (SLOT, POCKET): "slot and wall"}[features]
    return path, force, kind if features == (SLOT,) else f"{kind}, {'climb' if climb else 'conventional'}"


def read_as(path: RobotPath, force: Array, true: str, sign: float) -> dict[str, Array]:
    """The force (N, 3) as each frame would have it that is logged in the frame `true`, with `sign` wrong (-1) or not."""
    def turned(kind: str) -> Array:
        form = replace(path.cell.force_log, kind=kind)
        turn = base_from_log(path, replace(path.cell, force_log=form)).rotation
        return np.broadcast_to(np.eye(3), turn.shape) if kind == "base" else turn

    logged = sign * np.einsum("nji,nj->ni", turned(true), force)
    return {kind: np.einsum("nij,nj->ni", turned(kind), logged) for kind in FRAMES}


def main(jobs: int, seed: int) -> None:
    said: dict[str, Counter[str]] = defaultdict(Counter)
    by_kind: dict[str, Counter[str]] = defaultdict(Counter)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(jobs):
            rng = np.random.default_rng((seed, number))
            path, force, kind = drawn(rng, Path(folder))
            seen = cut_direction(path, force, np.any(force != 0, axis=1))
            assert seen is not None
            print(f"{kind}: {np.degrees(seen.angle):.0f} deg to the left of the feed, {seen.along:.0f} and {seen.left:.0f} N; "
                  f"follows {seen.follows:.2f}, turns {seen.turns:.2f}, share {seen.share:.2f}")
            for sign in (1.0, -1.0):
                for true in FRAMES:
                    for stated in FRAMES:
                        forces = read_as(path, force, true, sign)
                        found = said_of_direction(travel(path, np.any(force != 0, axis=1)), forces, stated, "log")
                        warned = "+".join(sorted(finding.code for finding in found if finding.level == "warning"))
                        untold = any(finding.code == "CS3071" for finding in found)
                        warned = warned or ("said that it is not told" if untold else "silent")
                        what = ("right" if sign > 0 else "sign") if true == stated else ("frame" if sign > 0 else "both")
                        said[what][warned] += 1
                        by_kind[f"{kind}: {what}"][warned] += 1
    for what, counts in (*said.items(), *sorted(by_kind.items())):
        print(f"{what}: {dict(counts)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    main(arguments.jobs, arguments.seed)
