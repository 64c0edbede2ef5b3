"""A shop's job as text and tables, for descriptions.py: read from the folder that shop_jobs.py wrote, written into another.
Nothing of the program is imported.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from shop_arm import matrix, quaternion, turned_by

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
LIST = r"\[\s*" + NUMBER + r"(?:\s*,\s*" + NUMBER + r"){%d}\s*\]"
POSE = re.compile(rf"({LIST % 2})(\s*,\s*)({LIST % 3})")
TARGET = re.compile(rf"\[\s*({LIST % 2})\s*,\s*({LIST % 3})\s*,\s*({LIST % 3})\s*,\s*({LIST % 5})\s*\]")
SPARED = re.compile(r'(!.*$|"[^"]*")', re.MULTILINE)
FORCES, MOMENTS = ["fx_n", "fy_n", "fz_n"], ["mx_nm", "my_nm", "mz_nm"]
PLACES, NORMALS, DEVIATIONS = ["x_mm", "y_mm", "z_mm"], ["nx", "ny", "nz"], ["dx_um", "dy_um", "dz_um"]


@dataclass
class Job:
    """cell: of cell.yaml; modules: text by file name; log, tests: the tables; head: lines above those of the log; turned: from
    the work object's axes as they were to those now; part: what was measured of it before and after a correction, by name."""

    cell: dict[str, Any]
    modules: dict[str, str]
    log: pd.DataFrame
    tests: pd.DataFrame
    options: list[str]
    head: str = ""
    turned: np.ndarray = field(default_factory=lambda: np.eye(3))
    dialect: tuple[str, str, str] = (",", ".", "\n")
    parquet: bool = False
    crlf: bool = False
    part: dict[str, pd.DataFrame] = field(default_factory=dict)

    @property
    def moved(self) -> list[str]:
        """The log's columns by what they are."""
        return list(self.cell["force_log"].get("columns", self.log.columns))

    def vectors(self, change: Callable[[np.ndarray], np.ndarray], *groups: list[str]) -> None:
        """Changes vectors (n, 3) of the log."""
        for group in groups:
            if set(group) <= set(self.moved):
                at = [self.moved.index(name) for name in group]
                values = change(self.log.iloc[:, at].to_numpy(float))
                for k, number in enumerate(at):
                    self.log.isetitem(number, values[:, k])

    def places(self, change: Callable[[np.ndarray], np.ndarray], turned: np.ndarray) -> None:
        """Changes the part's places (n, 3), and turns normals and deviations by `turned`."""
        for table in self.part.values():
            table[PLACES] = change(table[PLACES].to_numpy())
            for group in (NORMALS, DEVIATIONS):
                if set(group) <= set(table):
                    table[group] = table[group].to_numpy() @ turned.T

    def write(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cell.yaml").write_text(yaml.safe_dump(self.cell, sort_keys=False), encoding="utf-8")
        for name, text in self.modules.items():
            (folder / name).write_bytes(text.replace("\n", "\r\n" if self.crlf else "\n").encode("latin-1"))
        sep, point, end = self.dialect
        for name, table, head in (("forces", self.log, self.head), ("measurements", self.tests, ""),
                                  *((name, table, "") for name, table in self.part.items())):
            if self.parquet:
                table.to_parquet(folder / f"{name}.parquet")
                continue
            text = table.to_csv(index=False, sep=sep, lineterminator=end,
                                float_format=lambda x: f"{x:.6f}".replace(".", point))
            (folder / f"{name}.csv").write_bytes((head.replace("\n", end) + text).encode("utf-8"))


def read(folder: Path) -> Job:
    """A job as shop_jobs.py wrote it."""
    cell = yaml.safe_load((folder / "cell.yaml").read_text(encoding="utf-8"))
    words = (folder / "commands.txt").read_text().splitlines()[1].split()
    names = words[3:words.index("--stiffness")]
    options = words[words.index("--forces") + 2:words.index("-o")]
    text, head = (folder / "forces.csv").read_text(encoding="utf-8"), ""
    if "columns" in cell["force_log"]:
        lines = text.splitlines(keepends=True)
        head, text = "".join(lines[:2]), "".join(lines[2:])
    first = text.splitlines()[0]
    sep = next(mark for mark in ";\t," if mark in first)
    log = pd.read_csv(StringIO(text), sep=sep, decimal="," if sep == ";" else ".")
    def decoded(data: bytes) -> str:
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError:
            return data.decode("latin-1")
    modules = {name: decoded((folder / name).read_bytes()).replace("\r\n", "\n") for name in names}
    return Job(cell, modules, log, pd.read_csv(folder / "measurements.csv"), options, head,
               dialect=(sep, "," if sep == ";" else ".", "\n"))


Pose = tuple[np.ndarray, np.ndarray]


def values(text: str) -> np.ndarray:
    return np.array([float(x) for x in re.findall(NUMBER, text)])


def written(numbers: np.ndarray, digits: int) -> str:
    return "[" + ",".join(f"{x:.{digits}f}" for x in numbers) + "]"


def said(pose: Pose) -> tuple[str, str]:
    return written(pose[0], 6), written(quaternion(pose[1]), 10)


def after(one: Pose, other: Pose) -> Pose:
    return one[0] + one[1] @ other[0], one[1] @ other[1]


def inverse(pose: Pose) -> Pose:
    return -pose[1].T @ pose[0], pose[1].T


def yaml_pose(entry: dict[str, Any]) -> Pose:
    return np.array(entry["position_mm"], float), matrix(np.array(entry["quaternion"], float))


def set_pose(entry: dict[str, Any], pose: Pose) -> None:
    entry["position_mm"], entry["quaternion"] = pose[0].round(7).tolist(), quaternion(pose[1]).round(12).tolist()


def each_text(job: Job, change: Callable[[str], str]) -> Job:
    job.modules = {name: change(text) for name, text in job.modules.items()}
    return job


def code_alone(change: Callable[[str], str]) -> Callable[[str], str]:
    """Of a change of text: not in comments, strings, and the header above the module."""
    def changed(text: str) -> str:
        begin = re.search(r"^\s*MODULE", text, re.MULTILINE)
        cut = begin.start() if begin else 0
        parts = SPARED.split(text[cut:])
        return text[:cut] + "".join(part if k % 2 else change(part) for k, part in enumerate(parts))
    return changed


def targets(job: Job, change: Callable[[Pose], Pose]) -> Job:
    def one(found: re.Match[str]) -> str:
        place, quat = said(change((values(found[1]), matrix(values(found[2])))))
        return f"[{place},{quat},{found[3]},{found[4]}]"
    return each_text(job, code_alone(lambda text: TARGET.sub(one, text)))


def data(job: Job, kind: str, change: Callable[[list[Pose]], list[Pose]]) -> Job:
    """The frames in a tooldata or wobjdata, which is one line."""
    def line(found: re.Match[str]) -> str:
        frames = list(POSE.finditer(found[0]))[:1 if kind == "tooldata" else 2]
        new = change([(values(m[1]), matrix(values(m[3]))) for m in frames])
        text, end = "", 0
        for m, pose in zip(frames, new, strict=True):
            text += found[0][end:m.start()] + "{},{}".format(*said(pose))
            end = m.end()
        return text + found[0][end:]
    return each_text(job, lambda text: re.sub(rf"^.*\b{kind}\b.*$", line, text, flags=re.MULTILINE))


def object_of(text: str) -> Pose:
    """Where the work object stands in the world by the wobjdata of a module."""
    line = re.search(r"^.*\bwobjdata\b.*$", text, re.MULTILINE | re.IGNORECASE)
    frames = list(POSE.finditer(line[0] if line else ""))[:2]
    user, seen = ((values(found[1]), matrix(values(found[3]))) for found in frames)
    return after(user, seen)


def measured(job: Job, offsets: pd.DataFrame, rng: np.random.Generator) -> None:
    """Gives the job a part that was measured: 1.08 of what was predicted, a set-up, and the probe's noise; after its
    correction a fifth of that. Half of them along two normals at each target. The cell states where the part is clamped."""
    some = offsets[offsets["note"].fillna("").eq("") & offsets[["ox_mm", "oy_mm", "oz_mm"]].abs().sum(axis=1).gt(0)]
    place = some[PLACES].to_numpy()
    off = rng.normal(0, 10, 3) - 1080 * some[["ox_mm", "oy_mm", "oz_mm"]].to_numpy()
    along = turned_by(rng.normal(0, 1, 3))[:2] if rng.random() < 0.5 else None
    if along is not None:
        place, off = np.repeat(place, 2, axis=0), (off @ along.T).reshape(-1, 1)
    for name, share in (("before", 1.0), ("after", 0.2)):
        read = share * off + rng.normal(0, 3, off.shape)
        table = pd.DataFrame(place, columns=PLACES)
        if along is not None:
            table[NORMALS] = np.tile(along, (len(some), 1))
        table[DEVIATIONS if along is None else ["dn_um"]] = read
        job.part[name] = table.assign(std_um=3.0)
    job.cell["workobject"] = {}
    set_pose(job.cell["workobject"], object_of(next(text for text in job.modules.values() if "wobjdata" in text)))
