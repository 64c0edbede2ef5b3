"""Small programs with their logs, for batches and watched folders."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner, Result

from compstiff.cli.main import compstiff
from tests.compensator.correction.virtual_job import job, there_and_back

HARMLESS = "MODULE Empty\nPROC main()\nENDPROC\nENDMODULE\n"


@dataclass(frozen=True)
class Shop:
    """A folder with a cell, stiffnesses, and `source`, where programs and logs are put."""

    folder: Path
    source: Path

    @property
    def part(self) -> Path:
        return self.folder / "part.mod"

    @property
    def log(self) -> Path:
        return self.folder / "forces.csv"

    @property
    def cell(self) -> Path:
        return self.folder / "cell.yaml"

    @property
    def stiffness(self) -> Path:
        return self.folder / "stiffness.json"

    def put(self, *names: str, log: bool = True) -> list[Path]:
        """Programs of these stems, each with its log."""
        for name in names:
            shutil.copy(self.part, self.source / f"{name}.mod")
            if log:
                shutil.copy(self.log, self.source / f"{name}.forces.csv")
        return [self.source / f"{name}.mod" for name in names]

    def correct(self, *arguments: object) -> Result:
        words = ["correct", self.cell, *arguments, "--stiffness", self.stiffness]
        return CliRunner().invoke(compstiff, [str(word) for word in words])

    def alone(self, name: str = "alone.mod") -> bytes:
        """The program as the command for one program corrects it."""
        done = self.correct(self.part, "--forces", self.log, "-o", self.folder / name)
        assert done.exit_code == 0, done.output
        return (self.folder / name).read_bytes()


def shop(folder: Path) -> Shop:
    job(folder, there_and_back())
    (folder / "in").mkdir()
    return Shop(folder, folder / "in")
