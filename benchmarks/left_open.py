"""What an ambiguous answer is worth on the way to a part: `python benchmarks/left_open.py FOLDER`, after fifth_judge.py.

Of each load test in the folder that was left open the same arm, with what is hidden in its structure and its gears, is loaded
at fresh poses; the file of `diagnose --extended` predicts what it does there, and six springs fitted to the same table do.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from benchmarks.fifth_trial import Hidden, deflections, trial
from benchmarks.fifth_world import case, deck
from compstiff import fit_stiffness, read_cell, read_measurements, read_stiffness


def main(folder: Path) -> None:
    table = []
    for at in sorted(one for one in folder.iterdir() if (one / "diagnosis.json").exists()):
        if json.loads((at / "diagnosis.json").read_text(encoding="utf-8"))["verdict"] != "ambiguous":
            continue
        truth = json.loads((at / "truth.json").read_text(encoding="utf-8"))
        if truth["cause"] == "nothing":
            continue
        seed, number = truth["seed"]
        cause = list(deck(number + 1, np.random.default_rng(seed)))[number]
        one, _, size, _, made_with = case(cause, np.random.default_rng([seed, number]))
        fresh = trial(one.robot, "three loads", one.instrument, np.random.default_rng([seed, number, 1]))
        fresh = replace(fresh, arm=one.arm, stiffness=one.stiffness, force=0.5 * fresh.force)
        hidden = cause.make(np.random.default_rng(made_with), fresh, size)
        moved = deflections(fresh, Hidden(gear=hidden.gear, seats=hidden.seats), np.random.default_rng(0))
        loaded = fresh.amount[:, 0] > 0
        wrench = np.concatenate([fresh.force, np.zeros_like(fresh.force)], axis=1)[loaded]
        cell = read_cell(at / "cell.yaml")
        models = {"open": read_stiffness(at / "stiffness.json", cell),
                  "springs": fit_stiffness(cell, read_measurements(at / "measurements.csv", cell)).model}
        told = {}
        for name, model in models.items():
            position, _, covariance = model.predict(fresh.shown[loaded], wrench, dwell=np.full(loaded.sum(), 20.0))
            off, sigma = position - moved[loaded], np.sqrt(np.einsum("nii->ni", covariance[:, :3, :3]))
            told[name] = (1e6 * np.sqrt(np.median(np.sum(off**2, axis=1))), np.mean(np.abs(off) < 2 * sigma),
                          1e6 * np.sqrt(np.median(np.sum(sigma**2, axis=1))))
        table.append([*told["springs"], *told["open"]])
        print(f"{at.name} {cause.name:17}" + "".join(
            f"  {name}: off {off:6.1f} um, 2 sigma hold {100 * held:3.0f} %, sigma {sigma:5.1f} um" for name, (off, held, sigma)
            in told.items()), flush=True)
    median = np.median(table, axis=0)
    print(f"{len(table)} left open; medians, springs: {median[0]:.1f} um, {100 * np.mean(table, axis=0)[1]:.0f} % held, sigma "
          f"{median[2]:.1f}; open: {median[3]:.1f} um, {100 * np.mean(table, axis=0)[4]:.0f} % held, sigma {median[5]:.1f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
