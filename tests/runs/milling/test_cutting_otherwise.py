"""The same pass written otherwise teaches `cutting` the same coefficients (sensor turned, other sign, clock, units, axes), and
these tell the same deviation of the program in other axes."""

from __future__ import annotations

import json
import re

import numpy as np
import pandas as pd
import pytest

from tests.runs.command_line import user_files as kit
from tests.runs.milling.first_part_job import CUTTING, stock_file
from tests.runs.milling.milling_job import MillingJob
from tests.virtual_cell.milled_part import slot_and_pocket

FORCE = ["fx_n", "fy_n", "fz_n"]


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> MillingJob:
    made = MillingJob(tmp_path_factory.mktemp("part"), 47452, part=slot_and_pocket(2.0))
    made.springs("springs.json", made.case.stiffness)
    made.cell_with("cut.yaml", CUTTING)
    made.log(made.first, made.planned, "log.csv")
    stock_file(made.part, made.folder / "stock.npz")
    return made


def learned(job: MillingJob, *names: str) -> dict:
    cell_file, module, of, forces = (job.folder / name for name in names)
    output = job.folder / "cutting.json"
    done = kit.run("cutting", cell_file, module, "--stock", of, "--stiffness", job.folder / "springs.json", "--forces", forces,
                   "--tare", "0:2", "-o", output, "--force", "--json")
    assert done.code == 0, done
    return json.loads(output.read_text()) | {"codes": sorted(one["code"] for one in done.json["findings"])}


def predicted(job: MillingJob, *names: str) -> np.ndarray:
    """dx dy dz sx sy sz (N, 6) [um] of the program by these files, of the coefficients that were written last."""
    cell_file, module, of, _ = (job.folder / name for name in names)
    output = job.folder / "deviation.csv"
    done = kit.run("predict", cell_file, module, "--stock", of, "--stiffness", job.folder / "springs.json", "--predict-force",
                   job.folder / "cutting.json", "-o", output, "--force", "--json")
    assert done.code == 0, done
    return pd.read_csv(output)[[f"{kind}{axis}_um" for kind in "ds" for axis in "xyz"]].to_numpy()


@pytest.fixture(scope="module")
def plain(job: MillingJob) -> dict:
    names = ("cut.yaml", "part.mod", "stock.npz", "log.csv")
    return learned(job, *names) | {"predicted": predicted(job, *names)}


def quaternion_of(cell: str) -> kit.Rotation:
    w, *xyz = map(float, re.findall(r"sensor_quaternion: \[(.*)\]", cell)[0].split(","))
    return kit.Rotation.from_quat([*xyz, w])


TURN, AWAY = kit.Rotation.from_euler("zyx", [-70, 25, 110], degrees=True), np.array([30.0, -45.0, 12.0])
PLACE = ["x_mm", "y_mm", "z_mm"]


@pytest.mark.parametrize("how", [
    "reaction of a turned sensor", "another dialect", "rate and counts in the cell", "robot's base elsewhere",
    "work object elsewhere", "object frame for user frame"])
def test_the_coefficients_hang_on_nothing_but_the_cut(job: MillingJob, plain: dict, how: str) -> None:
    folder = job.folder
    cell, table, module = (folder / "cut.yaml").read_text(), pd.read_csv(folder / "log.csv"), job.program.read_text()
    with np.load(folder / "stock.npz") as whole:
        stock = dict(whole)
    csv = {"sep": ",", "decimal": "."}
    found = re.search(r"(\[\[0,0,0\],\[1,0,0,0\]\]),(\[(\[[^\]]*\]),(\[[^\]]*\])\])\];", module)
    assert found
    both, user, frame, *parts = found[0], *found.groups()
    position, quaternion = map(json.loads, parts)
    turn = kit.Rotation.from_quat(np.roll(quaternion, -1))
    if how == "reaction of a turned sensor":
        table[FORCE] = -TURN.inv().apply(table[FORCE])
        turned = (-kit.quaternion(quaternion_of(cell) * TURN)).tolist()
        cell = re.sub("sensor_quaternion: .*", f"sensor_quaternion: {turned}", cell).replace("on_tool", "by_tool")
    elif how == "another dialect":
        table = table.assign(time_ms=1e3 * (table.pop("time_s") + 86_400))
        table = table[table.columns[::-1]]
        csv = {"sep": ";", "decimal": ","}
    elif how == "rate and counts in the cell":
        table[FORCE] *= 1e-3
        table = table.drop(columns="time_s").rename(columns={name: name.replace("_n", "_counts") for name in FORCE})
        cell = cell.replace("sign:", f"rate_hz: {job.sensor.rate_hz:g}\n  counts_per_n: 0.001\n  sign:")
    elif how == "object frame for user frame":
        module = module.replace(both, f"{frame},{user}];")
    elif how == "work object elsewhere":
        module = module.replace(frame, f"[{(position + turn.apply(AWAY)).tolist()},{quaternion}]")
        module = re.sub(r"(Move[JL] \[)(\[[^\]]*\])",
                        lambda move: move[1] + str((np.array(json.loads(move[2])) - AWAY).tolist()), module)
        table[PLACE] -= AWAY
        stock["origin_mm"], stock["height_mm"] = stock["origin_mm"] - AWAY[:2], stock["height_mm"] - AWAY[2]
    else:
        base = kit.Rotation.from_euler("z", 35, degrees=True)
        place = (base.apply(position) + np.array([500, -700, 0])).tolist()
        module = module.replace(frame, f"[{place},{kit.quaternion(base * turn).tolist()}]")
        cell += f"base_frame: {{position_mm: [500, -700, 0], quaternion: {kit.quaternion(base).tolist()}}}\n"
    (folder / "other.yaml").write_text(cell)
    (folder / "other.mod").write_text(module)
    table.to_csv(folder / "other.csv", index=False, **csv)
    np.savez(folder / "other.npz", **stock)
    names = ("other.yaml", "other.mod", "other.npz", "other.csv")
    other = learned(job, *names)
    # Positions with four decimals and quaternions with eight place an odd sample beside another target.
    assert np.allclose(other["mean"], plain["mean"], rtol=2e-3, atol=2e-2), np.array(other["mean"]) / plain["mean"]
    assert other["codes"] == plain["codes"]
    for one, two in zip(other["covariance"], plain["covariance"], strict=True):
        assert np.allclose(one, two, rtol=1e-2, atol=1e-3)
    if how.endswith(("elsewhere", "frame")):
        # The cutter's edge stands on cells of the stock here: which of them it takes is a matter of the last digit.
        off = np.abs(predicted(job, *names) - plain["predicted"])
        assert (off <= 0.5 + 0.2 * np.tile(plain["predicted"][:, 3:], 2)).all(), off.max(axis=0)
