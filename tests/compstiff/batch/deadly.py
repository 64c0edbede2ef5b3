"""Work that ends its process at once: a file of its own, for a worker must not import much before it dies."""

from __future__ import annotations

import os
import time
from pathlib import Path

from compstiff.batch.pairing import ProgramFiles


class Deadly(ProgramFiles):
    """It spares the process that the tests run in."""

    @property
    def forces(self) -> Path:
        if os.environ.get("COMPSTIFF_TEST_PROCESS") != str(os.getpid()):
            os._exit(9)
        raise AssertionError("corrected in the first process")


def dies_at_a(files: ProgramFiles, own: bool) -> str:
    """Work that ends its process at a.mod; all else takes its time at the first try."""
    if files.program.name == "a.mod":
        os._exit(9)
    time.sleep(0.0 if own else 2.0)
    return files.program.name


def as_told(files: ProgramFiles, own: bool) -> tuple[str, bool]:
    """Work that says what it was told."""
    return files.program.name, own
