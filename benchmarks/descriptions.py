"""Ways of writing a shop's job anew that change nothing: for described_otherwise.py, which says what is tried.

A job is read from the folder that shop_jobs.py wrote, and written into another. CORRECT: ways of which the offsets must be the
same; IDENTIFY: of which the stiffnesses must be, the program being another's. Nothing of the program is imported.
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
from shop_arm import matrix, quaternion, turn, turned_by

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
LIST = r"\[\s*" + NUMBER + r"(?:\s*,\s*" + NUMBER + r"){%d}\s*\]"
POSE = re.compile(rf"({LIST % 2})(\s*,\s*)({LIST % 3})")
TARGET = re.compile(rf"\[\s*({LIST % 2})\s*,\s*({LIST % 3})\s*,\s*({LIST % 3})\s*,\s*({LIST % 5})\s*\]")
SPARED = re.compile(r'(!.*$|"[^"]*")', re.MULTILINE)
FORCES, MOMENTS = ["fx_n", "fy_n", "fz_n"], ["mx_nm", "my_nm", "mz_nm"]


@dataclass
class Job:
    """cell: of cell.yaml; modules: text by file name; log, tests: the tables; head: lines above those of the log; turned: from
    the work object's axes as they were to those now."""

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

    def write(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "cell.yaml").write_text(yaml.safe_dump(self.cell, sort_keys=False), encoding="utf-8")
        for name, text in self.modules.items():
            (folder / name).write_bytes(text.replace("\n", "\r\n" if self.crlf else "\n").encode("latin-1"))
        sep, point, end = self.dialect
        for name, table, head in (("forces", self.log, self.head), ("measurements", self.tests, "")):
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


# ---- the same, described otherwise --------------------------------------------------------------

Change = Callable[[Job, np.random.Generator], Job]
CORRECT: dict[str, Change] = {}
IDENTIFY: dict[str, Change] = {}


def of(table: dict[str, Change]) -> Callable[[Change], Change]:
    def named(change: Change) -> Change:
        table[change.__name__] = change
        return change
    return named


@of(CORRECT)
def nothing(job: Job, rng: np.random.Generator) -> Job:
    """Numbers as this script writes them."""
    return job


@of(CORRECT)
def letters(job: Job, rng: np.random.Generator) -> Job:
    """RAPID knows no small and capital letters."""
    up = bool(rng.random() < 0.5)
    return each_text(job, code_alone(str.upper if up else str.lower))


@of(CORRECT)
def lines(job: Job, rng: np.random.Generator) -> Job:
    """Statements over several lines, several on one, comments between, other line ends."""
    job.crlf = bool(rng.random() < 0.5)
    job = each_text(job, code_alone(lambda text: re.sub(r",(?=\s*(?:v|z|fine|\[))", ",\n  ", text)))
    return each_text(job, lambda text: text.replace("ENDPROC", "  ! and so on; MoveL p9,v5,z0,tool0;\n\nENDPROC"))


@of(CORRECT)
def notation(job: Job, rng: np.random.Generator) -> Job:
    """Numbers with exponents and further zeros."""
    def one(found: re.Match[str]) -> str:
        text = found[0]
        if re.fullmatch(r"-?\d+\.\d+", text):
            mantissa, exponent = f"{float(text):.12e}".split("e")
            return f"{mantissa}E{int(exponent):+03d}" if rng.random() < 0.5 else text + "0"
        return text
    return each_text(job, code_alone(lambda text: re.sub(r"(?<![\w.])-?\d+\.\d+(?![\w.])", one, text)))


@of(CORRECT)
def signs_of_quaternions(job: Job, rng: np.random.Generator) -> Job:
    """q and -q are one orientation."""
    def one(found: re.Match[str]) -> str:
        return f"{found[1]},{written(-values(found[3]), 10)}"
    job = each_text(job, code_alone(lambda text: POSE.sub(one, text)))
    for entry in (job.cell["tool"], job.cell["base_frame"]):
        entry["quaternion"] = [-x for x in entry["quaternion"]]
    if "sensor_quaternion" in job.cell["force_log"]:
        job.cell["force_log"]["sensor_quaternion"] = [-x for x in job.cell["force_log"]["sensor_quaternion"]]
    return job


@of(CORRECT)
def names(job: Job, rng: np.random.Generator) -> Job:
    """Tool, work object and targets by other names."""
    def change(text: str) -> str:
        for old, new in ((r"\btMill\b", "Fraeser_16"), (r"\bwPart\b", "wobj_Stueck"), (r"\bp(\d+|L\d+_\d+)\b", r"tgt_\1")):
            text = re.sub(old, new, text)
        return text
    return each_text(job, code_alone(change))


@of(CORRECT)
def scope(job: Job, rng: np.random.Generator) -> Job:
    """Targets as constants, persistent data or those of the module alone."""
    lead = str(rng.choice(["CONST", "PERS", "LOCAL CONST", "LOCAL PERS", "TASK PERS"]))
    return each_text(job, lambda text: re.sub(r"\b(?:LOCAL )?(?:CONST|PERS) robtarget (?!\w+\{)", f"{lead} robtarget ", text))


@of(CORRECT)
def frames_of_object(job: Job, rng: np.random.Generator) -> Job:
    """Another user frame with the object's frame seen from it."""
    other = rng.uniform(-500, 500, 3), turned_by(rng.normal(0, 1, 3))
    return data(job, "wobjdata", lambda frames: [other, after(inverse(other), after(*frames))])


@of(CORRECT)
def work_object(job: Job, rng: np.random.Generator) -> Job:
    """Another zero and other axes of the work object; targets, shifts and logged places as seen from there."""
    new = rng.uniform(-300, 300, 3), turned_by(rng.normal(0, 1, 3))
    job = data(job, "wobjdata", lambda frames: [frames[0], after(frames[1], new)])
    job = targets(job, lambda pose: after(inverse(new), pose))
    turned = new[1].T

    def shift(found: re.Match[str]) -> str:
        numbers = turned @ values(found[2])
        return f"Offs({found[1]},{','.join(f'{x:.6f}' for x in numbers)})"
    job = each_text(job, code_alone(lambda text: re.sub(rf"Offs\((\w+),((?:{NUMBER},?){{3}})\)", shift, text)))
    job.vectors(lambda place: (place - new[0]) @ new[1], ["x_mm", "y_mm", "z_mm"])
    job.turned = turned
    return job


@of(CORRECT)
def world(job: Job, rng: np.random.Generator) -> Job:
    """Robot and work object put elsewhere in the world together, upright as they were."""
    moved = rng.uniform(-900, 900, 3), turn(2, rng.uniform(-3, 3))
    set_pose(job.cell["base_frame"], after(moved, yaml_pose(job.cell["base_frame"])))
    return data(job, "wobjdata", lambda frames: [after(moved, frames[0]), frames[1]])


@of(CORRECT)
def spin_of_tool(job: Job, rng: np.random.Generator) -> Job:
    """The tool's axes turned about its own; targets with them."""
    spin = np.zeros(3), turn(2, rng.uniform(-3, 3))
    job = data(targets(job, lambda pose: after(pose, spin)), "tooldata", lambda frames: [after(frames[0], spin)])
    set_pose(job.cell["tool"], after(yaml_pose(job.cell["tool"]), spin))
    if job.cell["force_log"]["frame"] == "tool":
        job.vectors(lambda force: force @ spin[1], counted_or(job, FORCES))
    return job


def counted_or(job: Job, names: list[str]) -> list[str]:
    return [name.replace("_n", "_counts") for name in names] if "fx_counts" in job.moved else names


@of(CORRECT)
def sign_of_forces(job: Job, rng: np.random.Generator) -> Job:
    """What the tool feels, or what it does."""
    log = job.cell["force_log"]
    log["sign"] = {"on_tool": "by_tool", "by_tool": "on_tool"}[log["sign"]]
    job.vectors(lambda force: -force, counted_or(job, FORCES), MOMENTS)
    return job


@of(CORRECT)
def mount_of_sensor(job: Job, rng: np.random.Generator) -> Job:
    """The sensor's axes turned, and its moments about another point."""
    log = job.cell["force_log"]
    if log["frame"] != "sensor":
        return job
    about, axes = rng.uniform(-30, 30, 3), turned_by(rng.normal(0, 1, 3))
    at, was = np.array(log["sensor_position_mm"], float), matrix(np.array(log["sensor_quaternion"], float))
    force = job.log[FORCES].to_numpy()
    job.vectors(lambda moment: moment - np.cross(about / 1000, force), MOMENTS)
    job.vectors(lambda vector: vector @ axes, FORCES, MOMENTS)
    log["sensor_position_mm"] = (at + was @ about).round(7).tolist()
    log["sensor_quaternion"] = quaternion(was @ axes).round(12).tolist()
    return job


@of(CORRECT)
def zero_of_sensor(job: Job, rng: np.random.Generator) -> Job:
    """Another bias, which the tare takes off."""
    bias = rng.normal(0, 15, 3) * (1000 if "fx_counts" in job.moved else 1)
    if "--tare" in job.options:
        job.vectors(lambda force: force + bias, counted_or(job, FORCES))
    return job


@of(CORRECT)
def dialect(job: Job, rng: np.random.Generator) -> Job:
    """Tables with other separators, decimal signs and line ends."""
    choices = [(",", ".", "\r\n"), (";", ",", "\n"), ("\t", ".", "\r\n"), (";", ".", "\n"), ("\t", ",", "\n")]
    job.dialect = choices[int(rng.integers(len(choices)))]
    return job


@of(CORRECT)
def columns(job: Job, rng: np.random.Generator) -> Job:
    """Columns in another order, and one more that means nothing."""
    order = rng.permutation(len(job.moved))
    if "columns" in job.cell["force_log"]:
        job.cell["force_log"]["columns"] = [job.moved[k] for k in order]
    job.log = job.log.iloc[:, order]
    job.tests = job.tests.iloc[:, rng.permutation(job.tests.shape[1])]
    return job


@of(CORRECT)
def parquet(job: Job, rng: np.random.Generator) -> Job:
    """Tables as Parquet, where the header names the columns."""
    job.parquet = "columns" not in job.cell["force_log"]
    return job


@of(CORRECT)
def clock(job: Job, rng: np.random.Generator) -> Job:
    """The log's clock began at another time."""
    name = next(name for name in job.moved if name.startswith("time"))
    at = job.moved.index(name)
    job.log.isetitem(at, job.log.iloc[:, at] + (1e6 if name == "time_ms" else 1e3))
    return job


@of(CORRECT)
def milliseconds(job: Job, rng: np.random.Generator) -> Job:
    """The log's time in milliseconds."""
    if "time_s" in job.log.columns and "columns" not in job.cell["force_log"]:
        job.log["time_s"] *= 1000
        job.log = job.log.rename(columns={"time_s": "time_ms"})
    return job


@of(IDENTIFY)
def poses_by_name(job: Job, rng: np.random.Generator) -> Job:
    """Poses have other labels."""
    job.tests["pose"] = [f"Pose {name[1:]} ({name})" for name in job.tests["pose"]]
    return job


@of(IDENTIFY)
def arm_about_axis_1(job: Job, rng: np.random.Generator) -> Job:
    """The whole arm, with its loads and gauges, turned about axis 1, in the middle of where it may stand."""
    angle = float(rng.uniform(-25, 25))
    turned = turn(2, np.deg2rad(angle))
    job.tests["q1_deg"] = job.tests["q1_deg"] + angle
    for group in (FORCES, ["dx_um", "dy_um", "dz_um"]):
        job.tests[group] = job.tests[group].to_numpy() @ turned.T
    return job


@of(IDENTIFY)
def flange(job: Job, rng: np.random.Generator) -> Job:
    """The tool bolted on turned, and axis 6 turned back."""
    angle = float(rng.uniform(-40, 40))
    back = turn(2, np.deg2rad(-angle))
    job.tests["q6_deg"] = job.tests["q6_deg"] + angle
    set_pose(job.cell["tool"], after((np.zeros(3), back), yaml_pose(job.cell["tool"])))
    job.cell["tool"]["centre_of_mass_mm"] = (back @ np.array(job.cell["tool"]["centre_of_mass_mm"])).tolist()
    return job


@of(IDENTIFY)
def mirrored(job: Job, rng: np.random.Generator) -> Job:
    """The arm and its loads in a mirror that has no left and right."""
    for name in ("q1_deg", "q4_deg", "q6_deg", "fy_n", "dy_um"):
        job.tests[name] = -job.tests[name]
    at, rotation = yaml_pose(job.cell["tool"])
    mirror = np.diag([1.0, -1.0, 1.0])
    set_pose(job.cell["tool"], (mirror @ at, mirror @ rotation @ mirror))
    job.cell["tool"]["centre_of_mass_mm"] = (mirror @ np.array(job.cell["tool"]["centre_of_mass_mm"])).tolist()
    return job
