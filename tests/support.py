"""What several tests share: robots, random poses, small cells on disk, running the command line."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from identification.model.robot import RobotModel, built_in_robots, read_robot
from tests.runs.command_line.user_files import run

CELL = """\
robot: irb6660-205-1.90
tool: {position_mm: [120, 0, 250]}
"""


def robot(name: str = "irb6660-205-1.90") -> RobotModel:
    return read_robot(built_in_robots()[name])


def random_poses(model: RobotModel, count: int, rng: np.random.Generator, share: float = 1.0) -> np.ndarray:
    """Joint angles (count, 6) [rad] inside the limits and the parallel rod's window."""
    found = np.empty((0, 6))
    while len(found) < count:
        theta = share * rng.uniform(model.limits[:, 0], model.limits[:, 1], (2 * count, 6))
        found = np.concatenate([found, theta[(model.limit_excess(theta) == 0).all(axis=1)]])
    return found[:count]


def long(*values: Any) -> Any:
    """A case of a parametrised test that runs with --long alone: others tell in small what it tells."""
    return pytest.param(*values, marks=pytest.mark.long)


def write_cell(folder: Path, text: str = CELL) -> Path:
    path = folder / "cell.yaml"
    path.write_text(text)
    return path


def compstiff(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command line in this process, by the entry of the installed one: a start takes longer than most of what is asked."""
    with contextlib.chdir(cwd or Path.cwd()):
        done = run(*arguments)
    return subprocess.CompletedProcess(["compstiff", *map(str, arguments)], done.code, done.out, done.err)


def compstiff_process(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The installed command line, in a process of its own."""
    return subprocess.run([sys.executable, "-m", "compstiff", *map(str, arguments)], cwd=cwd, capture_output=True,
                          text=True, timeout=300)


@contextlib.contextmanager
def started(*command: object, **named: Any) -> Iterator[subprocess.Popen[Any]]:
    """A process that runs beside the test, in a process group of its own; it and its children are gone when the test leaves.

    Ctrl-C reaches it as on a terminal: a test run in the background, or under nohup, hands down an ignored SIGINT.
    """
    process = subprocess.Popen(
        list(map(str, command)), start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL), **named)
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream:
                stream.close()


def free_port() -> int:
    """A port of this machine on which nobody listens now."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return int(server.getsockname()[1])


def answers(port: int, within: float = 120.0) -> None:
    """Returns once somebody listens on this port of this machine; raises OSError after `within` [s]."""
    end = time.monotonic() + within
    while True:
        try:
            return socket.create_connection(("localhost", port), timeout=5.0).close()
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def processes_in(folder: Path, word: bytes) -> list[int]:
    """The processes that were begun in this folder, or in one within it, with this word in their call."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            wanted = word in Path(f"/proc/{entry}/cmdline").read_bytes()
            if wanted and os.readlink(f"/proc/{entry}/cwd").startswith(str(folder)):
                found.append(int(entry))
    return found


def cpu_seconds(process: subprocess.Popen[Any]) -> float:
    """CPU time of a running process [s], whatever else the machine does; 0 where it has ended."""
    with contextlib.suppress(OSError):
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def measurement_text(theta: np.ndarray, wrench: np.ndarray, deflection_um: np.ndarray, **columns: list[object]) -> str:
    """measurements.csv of joint angles [rad], wrenches [N], deflections [um] and further columns."""
    names = [*(f"q{i}_deg" for i in range(1, 7)), "fx_n", "fy_n", "fz_n", "dx_um", "dy_um", "dz_um", *columns]
    lines = [",".join(names)]
    for row, (q, w, d) in enumerate(zip(np.degrees(theta), wrench, deflection_um, strict=True)):
        numbers = [*(f"{x:.9f}" for x in q), *(f"{x:.6f}" for x in w[:3]), *(f"{x:.6f}" for x in d)]
        lines.append(",".join([*numbers, *(str(values[row]) for values in columns.values())]))
    return "\n".join(lines) + "\n"
