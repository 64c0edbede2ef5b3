"""Ways of writing a shop's job anew that change nothing: for described_otherwise.py, which says what is tried.

CORRECT: ways of which the offsets must be the same, and all that is said of the part; PARTS: of the part's readings alone;
IDENTIFY: of which the stiffnesses must be, the program being another's. Nothing of the program is imported.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))
from shop_arm import matrix, quaternion, turn, turned_by

from benchmarks.described_job import (
    FORCES,
    MOMENTS,
    NORMALS,
    NUMBER,
    PLACES,
    POSE,
    Job,
    after,
    code_alone,
    data,
    each_text,
    inverse,
    set_pose,
    targets,
    values,
    written,
    yaml_pose,
)

Change = Callable[[Job, np.random.Generator], Job]
CORRECT: dict[str, Change] = {}
PARTS: dict[str, Change] = {}
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
    job.vectors(lambda place: (place - new[0]) @ new[1], PLACES)
    job.places(lambda place: (place - new[0]) @ new[1], turned)
    if "workobject" in job.cell:
        set_pose(job.cell["workobject"], after(yaml_pose(job.cell["workobject"]), new))
    job.turned = turned
    return job


@of(CORRECT)
def world(job: Job, rng: np.random.Generator) -> Job:
    """Robot and work object put elsewhere in the world together, upright as they were."""
    moved = rng.uniform(-900, 900, 3), turn(2, rng.uniform(-3, 3))
    for entry in {"base_frame", "workobject"} & set(job.cell):
        set_pose(job.cell[entry], after(moved, yaml_pose(job.cell[entry])))
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
    job.part = {name: table.iloc[:, rng.permutation(table.shape[1])] for name, table in job.part.items()}
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


@of(PARTS)
def normals_turned_over(job: Job, rng: np.random.Generator) -> Job:
    """A deviation along a normal is its opposite along the opposite normal."""
    for table in job.part.values():
        if "dn_um" in table:
            table[[*NORMALS, "dn_um"]] *= -1
    return job


@of(PARTS)
def order_of_the_second(job: Job, rng: np.random.Generator) -> Job:
    """The part was measured in another order after its correction: the first pass tells what the path is."""
    job.part["after"] = job.part["after"].iloc[rng.permutation(len(job.part["after"]))]
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
