"""A RoboDK post processor around your ABB post: what it saves is corrected at once where a force log of the program is there.

Copy this file into RoboDK's folder of posts and choose it for the robot. It lets POST write the program as ever. The first time
there is no log: the program is the planned one, to be milled and logged. With LOGS/name.forces.csv there, the next generation
writes name_corrected.mod beside it, and that is what RoboDK sends to the robot. If compstiff refuses, nothing is handed on.
The lines in capitals are yours to set; environment variables COMPSTIFF_CELL and so on win over them.
"""

from __future__ import annotations

import os
import subprocess
from importlib import import_module
from pathlib import Path


def _setting(name: str, otherwise: str) -> str:
    return os.environ.get(f"COMPSTIFF_{name}", otherwise)


POST = _setting("POST", "ABB_RAPID_IRC5")                       # the post that writes the program: a file beside this one
COMMAND = _setting("COMMAND", "compstiff")                      # or its whole path; RoboDK's own Python need not have it
CELL = _setting("CELL", "C:/cells/cell7/cell.yaml")
STIFFNESS = _setting("STIFFNESS", "C:/cells/cell7/stiffness_extended.json")
LOGS = _setting("LOGS", "C:/cells/cell7/programs")
OPTIONS = _setting("OPTIONS", "--tare 0:2")                     # as on the command line

_Written = import_module(POST).RobotPost


class RobotPost(_Written):
    """The user's post, with a corrected program behind each that it saves."""

    def ProgSave(self, folder: str, progname: str, ask_user: bool = False, show_result: bool | str = False) -> None:
        """Saves the planned program, then the corrected one where it was logged."""
        super().ProgSave(folder, progname, ask_user, show_result)
        saved = self.PROG_FILES if isinstance(self.PROG_FILES, list) else [self.PROG_FILES]
        files = [self._corrected(Path(file)) for file in saved if file]
        self.PROG_FILES = [str(file) for file in files if file] if all(files) else []

    def _corrected(self, planned: Path) -> Path | None:
        """The file to hand on: corrected, planned where there is no log yet, or None where the correction was refused."""
        logs = [path for ending in ("csv", "parquet") if (path := Path(LOGS) / f"{planned.stem}.forces.{ending}").is_file()]
        if not logs:
            print(f"compstiff: no log {planned.stem}.forces.csv in {LOGS}: this is the planned program, to mill and log")
            return planned
        corrected = planned.with_name(f"{planned.stem}_corrected{planned.suffix}")
        # Generated anew: the corrected program of the last time is replaced.
        done = subprocess.run([COMMAND, "correct", CELL, str(planned), "--stiffness", STIFFNESS, "--forces", str(logs[0]),
                               *OPTIONS.split(), "-o", str(corrected), "--force"], capture_output=True, text=True, check=False)
        print(done.stdout, done.stderr, sep="\n")
        if done.returncode != 0:
            said = next((line for line in done.stderr.splitlines() if "error" in line), f"exit code {done.returncode}")
            print(f"POPUP: compstiff did not correct {planned.name}, and nothing is sent: {said}")
            return None
        print(f"SAVED: {corrected}")
        return corrected
