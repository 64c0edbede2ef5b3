"""Every fault point of an upload to a controller, both generations: what was there afterwards, and whether the answer was true.

    python benchmarks/upload.py [EACH]      every fault (about a quarter of an hour), or every EACH-th

An emulated controller (tests/compensator/upload/emulator.py) behind a proxy that does one thing wrong, once: at every request
of an upload with `--load`, into a task without the module and over one that is loaded. Checked is what
tests/compensator/upload/fault_runs.py says.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.compensator.upload.fault_runs import Bench


def main(each: int) -> None:
    """Prints a line a generation and way."""
    print("| controller | into | faults | done (0) | refused (3) | unconfirmed (4) | untrue answers | mastership left "
          "| sessions left |")
    print("|---|---|---|---|---|---|---|---|---|")
    for generation, name in ((1, "RWS 1.0"), (2, "RWS 2.0")):
        for replace in (False, True):
            with tempfile.TemporaryDirectory() as folder, Bench(Path(folder), generation, replace=replace) as bench:
                codes: Counter[int] = Counter()
                untrue = held = sessions = 0
                chosen = bench.all_faults()[::each]
                for fault in chosen:
                    run = bench.run(fault)
                    codes[run.code] += 1
                    try:
                        bench.check(fault, run)
                    except AssertionError as wrong:
                        untrue += 1
                        print(wrong, file=sys.stderr)
                    held += bench.controller.holder is not None and fault.kind != "late request"
                    sessions += bool(bench.controller.sessions)
                into = "a loaded module" if replace else "a task without it"
                print(f"| {name} | {into} | {len(chosen)} | {codes[0]} | {codes[3]} | {codes[4]} | {untrue} | {held} "
                      f"| {sessions} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
