"""Every command that writes, on small sound files: what it is called with, what it reads and what it writes."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.fuzz_files import LVM, OFFSETS
from benchmarks.unbreakable import APT, CELL, sound_files
from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import Workshop, workshop
from tests.virtual_cell.arm import IRB6660

ROBOT = "irb6660-205-1.90"
SAMPLES = Path(__file__).parents[3] / "samples"
LEAST = 200                     # replicates behind the p-value of a diagnosis: the fewest that are taken


@dataclass(frozen=True)
class Command:
    """words: `@name` is a file to read, `>name` one to write; `>` alone the folder of outputs, `@` that of inputs. other: files
    in place of the inputs whose outputs differ. slow: over three seconds. several: it corrects several programs."""

    name: str
    words: tuple[str, ...]
    other: dict[str, str] = field(default_factory=dict)
    slow: bool = False
    several: bool = False
    cell: bool = False          # whether an offset device listens while it runs, on a port that it is told

    @property
    def reads(self) -> tuple[str, ...]:
        return tuple(word[1:] for word in self.words if word.startswith("@") and len(word) > 1)

    def call(self, place: Place, *more: str) -> list[str]:
        """The words with the paths in their place."""
        ways = {"@": place.inputs, ">": place.outputs}
        return [str(ways[word[0]] / word[1:]) if word[0] in ways else word for word in (*self.words, *more)]


@dataclass(frozen=True)
class Place:
    """A folder with the inputs, and one that outputs go to."""

    folder: Path

    @property
    def inputs(self) -> Path:
        return self.folder / "in"

    @property
    def outputs(self) -> Path:
        return self.folder / "out"

    @classmethod
    def make(cls, folder: Path, other: dict[str, str] | None = None) -> Place:
        """New, whatever was there."""
        place = cls(folder)
        shutil.rmtree(folder, ignore_errors=True)
        place.inputs.mkdir(parents=True)
        place.outputs.mkdir()
        for name, text in {**files(), **(other or {})}.items():
            (place.inputs / name).parent.mkdir(exist_ok=True)
            (place.inputs / name).write_bytes(text.encode())
        return place


@cache
def files() -> dict[str, str]:
    """The inputs of all commands, by name."""
    shop, sound = workshop(ROBOT), sound_files()
    still = "fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
    angles = [(0, 10, 20, 20 * j, 30 * k, 0) for k in (1, 2, 3) for j in range(-2, 3)]
    down = [IRB6660.pose(np.radians(q), np.zeros(3))[1].inv().apply([0, 0, -9.80665]) for q in angles]
    forces = [[*(12 * g + [5, -3, 7]), *(12 * np.cross([0, 0, 0.04], g))] for g in down]
    still += "".join(40 * (",".join(f"{x:.5f}" for x in [*force, *q]) + "\n") for force, q in zip(forces, angles, strict=True))
    halved = "".join(line if line.split(",")[0] not in "56" else f"{line.split(',')[0]},0,0,0\n"
                     for line in shop.files["forces.csv"].splitlines(keepends=True))
    return {**shop.files, "part.apt": APT, "sensor.yaml": CELL, "halved.csv": halved, "still.csv": still,
            "log.lvm": LVM, "before.csv": sound["before.csv"], "after.csv": sound["after.csv"],
            "offsets.csv": OFFSETS,
            "learn/points.csv": _points(shop), "many/a.mod": shop.files["part.mod"], "many/b.mod": shop.files["part.mod"],
            "many/a.forces.csv": shop.files["forces.csv"], "many/b.forces.csv": shop.files["forces.csv"]}


def _points(shop: Workshop) -> str:
    """Measured where the program goes: 1.2 times what is predicted there, so that there is something to learn."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in shop.files.items():
            (Path(folder) / name).write_text(text)
        cell, program, stiffness, forces, output = (
            Path(folder) / name for name in ("cell.yaml", "part.mod", "stiffness.json", "forces.csv", "deviation.csv"))
        done = kit.run("predict", cell, program, "--stiffness", stiffness, "--forces", forces, "-o", output)
        assert done.code == 0, done
        told = {row["target"]: [1.2 * float(row[f"d{axis}_um"]) for axis in "xyz"] for row in kit.table(output)}
    logged = [line.split(",")[0] for line in shop.files["forces.csv"].splitlines()[1:]]
    places = [line.split(",")[:3] for line in shop.files["along.csv"].splitlines()[1:]]
    return "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um\n" + "".join(
        f"{','.join(place)},{','.join(f'{value:.3f}' for value in told[target])},3\n"
        for place, target in zip(places, logged, strict=True))


def _softer() -> dict[str, str]:
    return {"stiffness.json": kit.stiffness_text(1.3 * kit.K, robot=ROBOT, load_path="drive", tool=None)}


def _fewer_rows() -> dict[str, str]:
    return {"measurements.csv": "\n".join(files()["measurements.csv"].splitlines()[:-12]) + "\n"}


JOB = ("@cell.yaml", "@part.mod", "--stiffness", "@stiffness.json", "--forces", "@forces.csv")
COMMANDS = {command.name: command for command in (
    Command("correct", ("correct", *JOB, "-o", ">part.mod", "--offsets", ">offsets.csv", "--report", ">report.html"),
            _softer()),
    Command("correct --split", ("correct", *JOB[:-1], "@halved.csv", "-o", ">part.mod", "--split", "6"), _softer()),
    Command("correct many", ("correct", "@cell.yaml", "@many", "--stiffness", "@stiffness.json", "-o", ">"), _softer(),
            several=True),
    Command("watch", ("watch", "@many", ">", "--cell", "@cell.yaml", "--stiffness", "@stiffness.json", "--once",
                      "--settle", "0"), _softer(), several=True),
    Command("predict", ("predict", *JOB, "-o", ">deviation.csv", "--report", ">report.html"), _softer()),
    Command("post", ("post", "@sensor.yaml", "@part.apt", "-o", ">part.mod"),
            {"part.apt": APT.replace("FEDRAT/0.2", "FEDRAT/0.3")}),
    Command("identify", ("identify", "@cell.yaml", "@measurements.csv", "-o", ">stiffness.json", "--report", ">report.html"),
            _fewer_rows(), slow=True),
    Command("diagnose", ("diagnose", "@cell.yaml", "@measurements.csv", "-o", ">diagnosis.json", "--extended", ">more.json",
                         "--report", ">report.html", "--replicates", str(LEAST)), _fewer_rows(), slow=True),
    Command("design", ("design", "@cell.yaml", "--quick", "--measurements", "6", "-o", ">plan.csv", "--rapid", ">drive.mod",
                       "--report", ">report.html"), slow=True),
    Command("verify", ("verify", "@cell.yaml", "@before.csv", "@after.csv", "--report", ">report.html")),
    Command("learn", ("learn", *JOB[:2], "@learn/points.csv", *JOB[2:], "-o", ">learned.json"), _softer()),
    Command("convert", ("convert", "@log.lvm", "--form", "lvm", "-o", ">log.csv"), {"log.lvm": LVM.replace("3.5", "4.5")}),
    Command("push", ("push", "@cell.yaml", "@offsets.csv", "--apply", "--any-program", "--log", ">push-log.jsonl", "--receiver",
                     ">receiver.mod"), cell=True),
    Command("tare", ("tare", "@sensor.yaml", "@still.csv", "-o", ">tare.yaml")),
)}
