"""Does `accuracy` in cell.yaml say what the robot's own error leaves on a part that it probed?

    OMP_NUM_THREADS=1 python benchmarks/stated_accuracy.py [ROBOTS] [FIRST_SEED]

Errors of the unloaded robot are those of tests/virtual_cell/astray.py, sums of plane waves, which have not the form of the
process that the program takes them for. Of each robot the RMS distance over a cube of 0.5 m is stated (position_um), and the
length by its waves' root mean square wave number, sqrt(5) / k: the length at which the process is as steep. Flat parts of
several sizes, the tool upright on a grid, stand anywhere in that cube; each is probed, exactly, at so many places spread over
it, and the shift and turn that fit these best are taken off, as a work object has it. Left: RMS distance over robots and
places, beside what is stated; within 1 and 2 sigma.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from compensator.correction.unloaded_robot import beside_a_rigid_motion
from tests.virtual_cell.arm_model import Tool
from tests.virtual_cell.astray import drawn
from tests.virtual_cell.inverse import inverse

SIZES_MM, PROBED = (100.0, 200.0, 400.0), (4, 9, 81)
DOWN = np.diag([-1.0, 1.0, -1.0])
MIDDLE = np.array([1.4, 0.0, 0.9])


def left_of(error: np.ndarray, place: np.ndarray, probed: np.ndarray) -> np.ndarray:
    """What a shift and a small turn, fitted at the places probed, leave of errors (n, 3) at places (n, 3)."""
    motions = np.concatenate([np.broadcast_to(np.eye(3), (len(place), 3, 3)),
                              np.cross(np.eye(3), place[:, None] - place.mean(axis=0)).swapaxes(1, 2)], axis=2)
    fitted = np.linalg.lstsq(motions[probed].reshape(-1, 6), error[probed].ravel(), rcond=None)[0]
    return np.asarray(error - motions @ fitted)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int, nargs="?", default=200)
    parser.add_argument("first_seed", type=int, nargs="?", default=1000)
    options = parser.parse_args()
    print("| part, probed at | left, stated [um] RMS | within 1, 2 sigma | worst robot within 2 |\n|---|---|---|---|")
    for size in SIZES_MM:
        grid = np.stack(np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 9)]), axis=-1).reshape(-1, 2)
        plane = np.column_stack([1e-3 * size * grid, np.zeros(len(grid))])
        off: dict[int, list[np.ndarray]] = {many: [] for many in PROBED}
        std = []
        for seed in range(options.first_seed, options.first_seed + options.robots):
            rng = np.random.default_rng([seed, int(size)])
            error = drawn(seed, growth_mm=0.0)
            nothing = np.zeros(4000)
            cube = np.linalg.norm(error.displacement_mm(rng.uniform(-250.0, 250.0, (4000, 3)), nothing), axis=1)
            length = np.sqrt(5) / np.sqrt(np.mean(np.sum(error.waves**2, axis=1) * np.sum(error.vectors**2, axis=1))
                                          / np.mean(np.sum(error.vectors**2, axis=1)))
            place = plane + rng.uniform(-0.25, 0.25, 3) * (1 - 1e-3 * size / 0.5)
            theta = inverse(MIDDLE + place, np.repeat(DOWN[None], len(place), axis=0), Tool())[:, 0]
            assert np.isfinite(theta).all()
            mean_square = np.mean(cube**2) / 3
            stated = mean_square * np.trace(beside_a_rigid_motion(MIDDLE + place, theta, length), axis1=1, axis2=2)
            std.append(1e3 * np.sqrt(stated))
            moved = 1e3 * error.displacement_mm(1e3 * place, np.zeros(len(place)))
            for many in PROBED:
                probed = {4: np.flatnonzero(np.abs(grid).min(axis=1) == 0.5),
                          9: np.flatnonzero(np.isin(np.abs(grid), (0.0, 0.5)).all(axis=1)), 81: np.arange(81)}[many]
                off[many].append(np.linalg.norm(left_of(moved, place, probed), axis=1))
        sigma = np.array(std)
        for many, each in off.items():
            ratio = np.array(each) / sigma
            inside = 100 * np.mean(ratio <= 2, axis=1)
            left, said = np.sqrt(np.mean(np.square(each))), np.sqrt(np.mean(sigma**2))
            print(f"| {size:.0f} mm, {many} places | {left:.1f}, {said:.1f} | {100 * np.mean(ratio <= 1):.1f}, "
                  f"{inside.mean():.1f} % | {inside.min():.0f} % |", flush=True)


if __name__ == "__main__":
    main()
