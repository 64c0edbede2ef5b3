"""What the tests of `verify` share: tables of readings, the command, and the passes of one path."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from compstiff.cli.main import compstiff
from tests.support import write_cell

SIGMAS = "target,dx_um,dy_um,dz_um,sx_um,sy_um,sz_um"


def remembering(rng: np.random.Generator, count: int, phi: float, size: float = 1.0) -> np.ndarray:
    """A first-order autoregression (count, 3) of standard deviation `size`, from its stationary state."""
    start = rng.normal(size=(1, 3))
    rest = lfilter([np.sqrt(1 - phi**2)], [1, -phi], rng.normal(size=(count - 1, 3)), axis=0, zi=phi * start)[0]
    return size * np.concatenate([start, rest])


def csv(folder: Path, name: str, header: str, rows: np.ndarray) -> Path:
    path = folder / name
    text = "\n".join(",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) for row in rows)
    path.write_text(f"{header}\n{text}\n")
    return path


def verify(*arguments: object) -> Result:
    return CliRunner().invoke(compstiff, ["verify", *map(str, arguments)])


# What a vector's components become along axes that are turned by 25 degrees about z.
TURNED = Rotation.from_euler("z", 25, degrees=True).as_matrix()


def passes_in(folder: Path) -> dict[str, Path]:
    """A path of 600 targets: predicted 100 um RMS, measured 1.25 times that before and a fifth of it after; the work object of
    the cell is turned against the base."""
    rng = np.random.default_rng(11)
    half = np.sqrt(0.5)
    cell = write_cell(folder, "robot: irb6660-205-1.90\ntool: {position_mm: [120, 0, 250]}\n"
                      f"workobject: {{position_mm: [900, 0, 400], quaternion: [{half}, 0, 0, {half}]}}\n")
    targets = np.arange(600)
    place = np.column_stack([0.5 * targets, np.zeros(600), np.zeros(600)])
    base = remembering(rng, 600, 0.9, 100.0)
    # A quarter turn about z: the work object's x axis is the base's y, its y the base's -x.
    turned = np.column_stack([base[:, 1], -base[:, 0], base[:, 2]])
    before, after = (factor * base + remembering(rng, 600, 0.7, 5.0) for factor in (1.25, 0.2))
    in_object = 1.25 * turned + remembering(rng, 600, 0.7, 5.0)
    normal = np.column_stack([np.cos(targets / 40), np.sin(targets / 40), np.zeros(600)])
    along = np.sum(normal * before, axis=1)
    header = "target,dx_um,dy_um,dz_um"
    return {
        "cell": cell,
        "before": csv(folder, "before.csv", header, np.column_stack([targets, before])),
        "after": csv(folder, "after.csv", header, np.column_stack([targets, after])),
        "places": csv(folder, "places.csv", "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um", np.column_stack([place + 0.1, in_object])),
        "normal": csv(folder, "normal.csv", "target,dn_um,nx,ny,nz", np.column_stack([targets, along, normal])),
        "shifted": csv(folder, "shifted.csv", header, np.column_stack([targets, before + np.array([0, 0, 400])])),
        "turned": csv(folder, "turned.csv", header, np.column_stack([targets, before @ TURNED])),
        "mirrored": csv(folder, "mirrored.csv", header, np.column_stack([targets, before * [-1, 1, 1]])),
        "predicted": csv(folder, "deviation.csv", "target,x_mm,y_mm,z_mm,dx_um,dy_um,dz_um",
                         np.column_stack([targets, place, base])),
    }


def of_code(result: Result, code: str) -> list[dict[str, str]]:
    return [finding for finding in json.loads(result.stdout)["findings"] if finding["code"] == code]
