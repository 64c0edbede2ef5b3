"""The first part where everything that its widths allow for is drawn anew between the log and the part (first_part.py says
what the parts are): `python benchmarks/first_part.py [ROBOTS] [FIRST_SEED] --clamped-anew`.

For the log of part A and for each part B the tool is clamped once: its axis is off by 0 to 10 um any way. B's batch of the
material needs 4 % more or less (1 sigma, all coefficients together) and 2 % each besides (engineering judgement); its stock
stands aside along x and y by what its file says (0.05 mm). The force sensor's gain is off by 1 % and the robot in motion gives
way by 2 % more or less than at rest, as cell.yaml says where it says nothing. Robots, load tests and noise as ever.

Off is the length of a vector, sigma its root mean square: of a vector that is scattered alike in three directions 61 and 99 %
are within 1 and 2 sigma, in one direction 68 and 95 %.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import compstiff
from compensator.correction.expected_left import CAUSES
from compensator.correction.files import Inputs, predict_files
from compensator.correction.settings import Settings
from tests.runs.milling.first_part_job import CUTTING, stock_file
from tests.runs.milling.learning_job import ErringJob
from tests.runs.milling.milling_job import rms, settings
from tests.virtual_cell import milling
from tests.virtual_cell.endmill import EndMill
from tests.virtual_cell.milled_part import PLACES, slot_and_pocket

OFF_MM, BATCH, EACH, ASIDE_MM, GAIN, MOTION = 0.010, 0.04, 0.02, 0.05, 0.01, 0.02
KINDS = {"plateau": ("slot", "straight wall", "arc"), "entry and exit": ("slot ends", "roll in and out"),
         "corner": ("sharp corner", "rolled corner")}


@dataclass(frozen=True)
class Covered:
    """Of the steps of one part: place, how far the tool is off, and what was stated there by cause [um]; of the forces, those
    of steps on plan: place, off in sigmas (n, 3), with the whole width and with less of it."""

    place: np.ndarray
    off: np.ndarray
    stated: dict[str, np.ndarray]
    force_place: np.ndarray
    force_z: dict[str, np.ndarray]
    force_width: dict[str, float]


def clamped(rng: np.random.Generator, cutter: EndMill) -> EndMill:
    """The cutter in its holder once more."""
    off, way = rng.uniform(0, OFF_MM), rng.uniform(0, 2 * np.pi)
    return replace(cutter, runout_mm=tuple(float(off * np.cos(way + 2 * np.pi * tooth / 3)) for tooth in range(3)))


def another_batch(rng: np.random.Generator, cutter: EndMill) -> EndMill:
    common = rng.normal(0, BATCH)
    shear, edge = (np.array(sizes) * np.exp(common + rng.normal(0, EACH, 3))
                   for sizes in (cutter.shear_n_mm2, cutter.edge_n_mm))
    return replace(cutter, shear_n_mm2=tuple(shear), edge_n_mm=tuple(edge))


def one(seed: int, parts: dict[str, dict[str, float]], force_off) -> dict[str, Covered]:
    """Both parts B of one robot. force_off: that of first_part.py."""
    rng = np.random.default_rng([seed, 20])
    motion, usual = 1 + MOTION * rng.normal(), EndMill()
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "a").mkdir()
        a = ErringJob(root / "a", seed, part=slot_and_pocket(), cutter=clamped(rng, usual), motion=motion)
        a.sensor = replace(a.sensor, gain=1 + GAIN * rng.normal())
        stiffness, cell = a.identify(), compstiff.read_cell(a.cell_with("cut.yaml", CUTTING))
        fitted = compstiff.cutting_coefficients(
            cell, compstiff.read_toolpath(a.program, cell), stock_file(a.part, root / "a.npz", rng.normal(0, ASIDE_MM)),
            compstiff.read_stiffness(stiffness, cell), a.log(a.first, a.planned, "a.csv"), settings())
        told, posterior = fitted.coefficients, fitted.posterior
        assert posterior is not None
        gain = (cell.force_log.form.gain_std or 0.0) ** 2 * np.outer(told.mean, told.mean)
        widths = {"as stated": told, "without the model's 3 %": replace(told, model_error=0.0),
                  "without run-out": replace(told, covariance=posterior.covariance + gain)}
        for number, coefficients in enumerate(widths.values()):
            (root / f"{number}.json").write_text(json.dumps(coefficients.as_dict()))
        for kind, sizes in parts.items():
            (root / kind).mkdir()
            b = ErringJob(root / kind, seed, part=slot_and_pocket(**sizes), motion=motion,
                          cutter=another_batch(rng, clamped(rng, usual)))
            own, stock = b.cell_with("cut.yaml", CUTTING), stock_file(b.part, root / f"{kind}.npz", rng.normal(0, ASIDE_MM))
            chosen = Settings.of(predict_force=root / "0.json", stock=stock)
            job = compstiff.correct(predict_files(Inputs(own, b.program, stiffness, None), chosen))
            commands, part = milling.read_commands(job.content.decode()), b.part
            if len(commands.position_mm) != len(part.target_mm):
                part = part.with_targets(1e3 * job.predicted.path.toolpath.position)
            after, stated = b.mill(commands, part=part), {}
            for cause in ("std", *CAUSES):
                values = np.zeros(len(part.target_mm))
                values[job.correction.targets] = 1e6 * getattr(job.left, cause)
                stated[cause] = after.steps.between(values)
            some = after.cutting & (stated["std"] > 0)
            steps = milling.steps_of(b.part, 0.5)
            z, width = {}, {}
            for number, name in enumerate(widths):
                z[name], width[name], cut = force_off(b, own, root / f"{number}.json", stock)
            found[kind] = Covered(after.steps.place[some], np.linalg.norm(after.off_um, axis=1)[some],
                                  {cause: values[some] for cause, values in stated.items()}, steps.place[cut], z, width)
    return found


def shares(z: np.ndarray) -> str:
    return f"{100 * np.mean(z <= 1):.0f}, {100 * np.mean(z <= 2):.0f} %"


def table(results: list[dict[str, Covered]]) -> None:
    """What of the steps and forces lies within 1 and 2 sigma, by place, and what makes the width."""
    for kind in results[0]:
        rows = [result[kind] for result in results]
        print(f"{kind}: steps within 1, 2 sigma; off, stated and by cause, RMS [um]; forces within 1, 2 sigma, RMS in sigmas")
        by_place = defaultdict(list)
        for name, places in (("all", PLACES), *KINDS.items()):
            numbers = [PLACES.index(place) for place in places]
            at = [np.isin(row.place, numbers) for row in rows]
            off, std = (np.concatenate([values[there] for values, there in zip(of, at, strict=True)]) for of in (
                [row.off for row in rows], [row.stated["std"] for row in rows]))
            causes = {words: rms(np.concatenate([row.stated[cause][there] for row, there in zip(rows, at, strict=True)]))
                      for cause, words in CAUSES.items()}
            by_place[name] = [f"{words} {size:.1f}" for words, size in causes.items() if size > 0.05]
            forces = []
            for width in rows[0].force_z:
                z = np.abs(np.concatenate([row.force_z[width][np.isin(row.force_place, numbers)] for row in rows]))
                forces.append(f"{width} {shares(z)} {rms(z):.2f}")
            print(f"  {name:15} {len(off):5d} steps {shares(off / std):10} off {rms(off):5.1f} stated "
                  f"{rms(std):5.1f}, medians {np.median(off):.1f} {np.median(std):.1f} "
                  f"({', '.join(by_place[name])}); forces: {'; '.join(forces)}")
        each = ", ".join(f"{100 * np.mean(row.off <= row.stated['std']):.0f}" for row in rows)
        print(f"  each robot, steps within 1 sigma: {each} %; sigma of the force, median share: " + ", ".join(
                  f"{name} {100 * np.median([row.force_width[name] for row in rows]):.1f} %" for name in rows[0].force_width))
