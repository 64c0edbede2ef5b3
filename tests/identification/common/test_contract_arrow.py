"""Ctrl-C while Arrow reads numbers is for whoever waits for it: a batch that only notes it goes on."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

NOTED = """
import os, signal, sys, threading, time
noted = []
signal.signal(signal.SIGINT, lambda number, frame: noted.append(number))
ended = threading.Event()
def knock():
    while not ended.is_set():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1e-4)
threading.Thread(target=knock).start()
try:
    {read}
finally:
    ended.set()
print(len(noted) > 0)
"""
LOG = """
    from compensator.forces.log import read_force_log
    assert [len(read_force_log(sys.argv[1]).place) for _ in range(10)] == 10 * [20_000]
"""
PROGRAM = """
    from compensator.rapid import read_rapid
    text = open(sys.argv[1], "rb").read()
    assert [len(read_rapid(text, "long.mod").toolpath) for _ in range(10)] == 10 * [5_000]
"""


@pytest.mark.parametrize("kind", ["log", "program"])
def test_a_signal_that_is_noted_stops_no_reading(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "long"
    if kind == "log":
        file.write_text("path_mm,fx_n,fy_n,fz_n\n" + "".join(f"{k / 10},{k / 7:.6f},1,2\n" for k in range(20_000)))
    else:
        file.write_text("MODULE m\nPROC main()\n" + "".join(
            f"MoveL [[{k},{k / 7:.3f},0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tool0;\n" for k in range(5_000))
            + "ENDPROC\nENDMODULE\n")
    script = NOTED.replace("{read}", (LOG if kind == "log" else PROGRAM).strip())
    done = subprocess.run([sys.executable, "-c", script, file], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr
