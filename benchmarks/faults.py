"""Faults while a command works: every command that writes against every fault; nothing half written, a clear error, a rerun.

    python benchmarks/faults.py [--command NAME ...] [--fault NAME ...]

The commands and their files: tests/runs/faults/jobs.py; the faults and what must hold: tests/runs/faults/faults.py. As root a
small file system is filled besides (`no space`); else a limit on the size of files stands for it. Printed: a table with the
seconds of each cell, or what is wrong. Exit 1 where anything is.
"""

from __future__ import annotations

import argparse
import inspect
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.runs.faults.faults import FAULTS, no_space
from tests.runs.faults.jobs import COMMANDS


def main() -> int:
    """Tries all cells asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--command", action="append", choices=COMMANDS)
    faults = FAULTS | ({"no space": no_space} if os.geteuid() == 0 else {})
    parser.add_argument("--fault", action="append", choices=faults)
    chosen = parser.parse_args()
    wrong = cells = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen.command or COMMANDS:
            for fault in chosen.fault or faults:
                begun = time.monotonic()
                few = COMMANDS[name].slow and "most" in inspect.signature(faults[fault]).parameters
                said = faults[fault](COMMANDS[name], Path(folder) / "place", **({"most": 4} if few else {}))
                cells, wrong = cells + 1, wrong + bool(said)
                print(f"{name:16} {fault:20} {time.monotonic() - begun:6.1f} s  {'wrong' if said else 'holds'}", flush=True)
                for each in said:
                    print(f"    {each[:300]}", flush=True)
    print(f"\n{cells} cells, {wrong} wrong")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
