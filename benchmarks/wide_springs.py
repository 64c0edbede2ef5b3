"""Springs known to a factor: how many targets get worse, and how far off they are, beside what `correct` says.

    OMP_NUM_THREADS=1 python benchmarks/wide_springs.py [DRAWS]

The sample's program and log, corrected with the literature's springs, each known to so much (standard deviation of ln c). So
many robots are drawn, springs log-normal by as much about the literature's, all else as the program takes it, and pushed by
the logged forces. Expected: the sum of the probabilities, without those that springs known to a thousandth have, which come
from other causes. Left: RMS of the distance from plan, beside the RMS of `model` in left_um.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import compstiff
from compensator.correction.correct import Corrected
from identification.model.compliance import loaded_pose
from identification.model.stiffness import IdentifiedModel

SAMPLES = Path(__file__).parents[1] / "samples"
KNOWN, EVERY = (0.1, 0.2, 0.35, 0.5, 0.8), 5


def corrected(known: float) -> Corrected:
    cell = compstiff.read_cell(SAMPLES / "cell.yaml")
    model = IdentifiedModel(cell.robot, cell.flange_from_tcp, -np.log(cell.robot.prior.stiffness), known**2 * np.eye(6))
    settings = compstiff.Settings.of(tare=((0, 2),), keep_targets=True)
    return compstiff.correct(compstiff.predict(cell, compstiff.read_toolpath(SAMPLES / "insert.mod", cell), model,
                                               SAMPLES / "insert.forces.parquet", settings))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("draws", type=int, nargs="?", default=2000)
    draws = parser.parse_args().draws
    other = corrected(0.001).worse[::EVERY].sum()
    print("| known to | targets | worse: expected, are | off [um]: stated, are | within 2 sigma |\n|---|---|---|---|---|")
    for known in KNOWN:
        job = corrected(known)
        predicted, correction = job.predicted, job.correction
        looked = np.arange(0, len(correction.targets), EVERY)
        targets = correction.targets[looked]
        wrench, tool = predicted.forces.wrench[targets], predicted.cell.flange_from_tcp
        plan, robot = predicted.path.base_from_tcp.position[targets], predicted.model.robot
        # To first order in compliance, each spring by itself: an arm whose other springs are rigid.
        alone = []
        for compliance in np.diag(np.exp(predicted.model.mean[:6])):
            alone.append(loaded_pose(robot, predicted.path.theta[targets], tool, wrench, compliance).position - plan)
        by_spring = np.array(alone)
        turned = predicted.path.base_from_object[targets].rotation
        offset = np.einsum("nij,nj->ni", turned, correction.offset[looked])
        rng, worse, square, held = np.random.default_rng(1), 0.0, 0.0, 0.0
        for factors in np.exp(known * rng.standard_normal((draws, 6))):
            yielded = np.einsum("i,inr->nr", factors, by_spring)
            before, after = np.linalg.norm(yielded, axis=1), np.linalg.norm(yielded + offset, axis=1)
            worse += float((after > before).sum()) / draws
            square += float(np.mean(after**2)) / draws
            held += float(np.mean(after <= 2 * job.left.std[looked])) / draws
        expected, model = job.worse[looked].sum() - other, np.sqrt(np.mean(job.left.model[looked] ** 2))
        print(f"| {known:g} | {len(looked)} | {expected:.1f}, {worse:.1f} | {1e6 * model:.1f}, {1e6 * np.sqrt(square):.1f} | "
              f"{100 * held:.1f} % |", flush=True)


if __name__ == "__main__":
    main()
