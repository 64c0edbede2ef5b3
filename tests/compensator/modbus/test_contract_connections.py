"""Whoever reaches the port cannot use the cell up: the real command with few descriptors, and many silent connections."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.compensator.modbus import tables_and_devices as kit

IDLE = 300
FEW = "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (200, 200))"
# Fewer than the connections a cell holds, and asyncio tries for another one all the time.
TOO_FEW = ("import asyncio.constants, resource; resource.setrlimit(resource.RLIMIT_NOFILE, (32, 32))\n"
           "asyncio.constants.ACCEPT_RETRY_DELAY = 0.002")
CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 100], quaternion: [1, 0, 0, 0]}\n"


@contextlib.contextmanager
def _cell(tmp_path: Path, first: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """The command in a process that runs the statements `first` before it, and its port."""
    (tmp_path / "cell.yaml").write_text(CELL)
    command = [sys.executable, "-m", "compstiff", "cell", str(tmp_path / "cell.yaml"), "--port", "0", "--state", str(tmp_path)]
    run = [sys.executable, "-c", first + f"\nimport runpy, sys\nsys.argv = {command[2:]!r}\n"
                                         "runpy.run_module('compstiff', run_name='__main__')"]
    with subprocess.Popen(run, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, cwd=tmp_path) as process:
        assert process.stderr
        line = next(line for line in process.stderr if "listening on" in line)
        yield process, int(line.split("127.0.0.1:")[1].split()[0])
        process.terminate()


def test_idle_connections_do_not_keep_a_push_out(tmp_path: Path) -> None:
    with _cell(tmp_path, FEW) as (process, port):
        with contextlib.ExitStack() as idle:
            for k in range(IDLE):
                one = idle.enter_context(socket.create_connection(("127.0.0.1", port), timeout=5))
                if k % 3 == 0:
                    one.sendall(b"\x00\x01\x00")       # a frame that never ends
                if k == IDLE // 2:
                    assert kit.push(port, kit.random_table(1), timeout_s=5.0).text == "committed"
            assert kit.push(port, kit.random_table(2), timeout_s=5.0).text == "committed"
        process.terminate()
        assert process.stderr
        assert "Traceback" not in process.stderr.read()


def test_a_cell_that_can_accept_no_more_ends_without_a_trace(tmp_path: Path) -> None:
    with _cell(tmp_path, TOO_FEW) as (process, port), contextlib.ExitStack() as idle:
        for _ in range(60):
            idle.enter_context(socket.create_connection(("127.0.0.1", port), timeout=5))
        process.terminate()
        assert process.stderr
        assert process.stderr.read() == ""
        assert process.wait() == 0
