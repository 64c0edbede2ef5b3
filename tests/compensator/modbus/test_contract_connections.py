"""Whoever reaches the port cannot use the cell up: the real command with few descriptors, and many silent connections."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.compensator.modbus import tables_and_devices as kit

DESCRIPTORS, IDLE = 200, 600
CELL = "robot: irb6660-205-1.90\ntool: {position_mm: [0, 0, 100], quaternion: [1, 0, 0, 0]}\n"


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    (tmp_path / "cell.yaml").write_text(CELL)
    command = [sys.executable, "-m", "compstiff", "cell", str(tmp_path / "cell.yaml"), "--port", "0", "--state", str(tmp_path)]
    few = f"import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_NOFILE, ({DESCRIPTORS}, {DESCRIPTORS})); "
    run = [sys.executable, "-c", few + f"sys.argv = {command[2:]!r}; runpy.run_module('compstiff', run_name='__main__')"]
    with subprocess.Popen(run, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, cwd=tmp_path) as process:
        assert process.stderr
        line = next(line for line in process.stderr if "listening on" in line)
        yield process, int(line.split("127.0.0.1:")[1].split()[0])
        process.terminate()


def test_idle_connections_do_not_keep_a_push_out(cell: tuple[subprocess.Popen[str], int]) -> None:
    process, port = cell
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
