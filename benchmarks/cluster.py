"""The same programs by one process, by processes of this machine, and by a Dask cluster: the same bytes, at what cost.

    python benchmarks/cluster.py [PROGRAMS] [--workers 2] [--kill SECONDS]

PROGRAMS copies of the shipped program (3 586 targets), a comment apart. Wall time of the call; CPU of the workers and of the
scheduler, user and system; "trim" with the environment Dask gives its workers, "no trim" without MALLOC_TRIM_THRESHOLD_
(docs/cluster.md). --kill: then once more, with a worker killed at random every so many seconds, and from two calls at once.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.support import free_port, processes_in, started

ROOT = Path(__file__).parents[1]
NO_TRIM = {"DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON": "{'MALLOC_TRIM_THRESHOLD_': None}"}
ENVIRON = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
DEMO = Path("demo")
TICK = os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=int, nargs="?", default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kill", type=float, metavar="SECONDS")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        call(folder, "demo", "demo")
        (folder / "in").mkdir()
        text = (folder / "demo" / "insert.mod").read_text()
        for number in range(wanted.programs):
            (folder / "in" / f"p{number:03}.mod").write_text(f"! {number}\n{text}")
            shutil.copy(folder / "demo" / "insert.forces.parquet", folder / "in" / f"p{number:03}.forces.parquet")
        print(f"{wanted.programs} programs")
        serial = timed(folder, "one process", "serial")
        assert timed(folder, f"--jobs {wanted.workers}", "jobs", "--jobs", wanted.workers) == serial
        for name, more in (("trim", {}), ("no trim", NO_TRIM)):
            with cluster(folder, wanted.workers, more) as address:
                assert timed(folder, f"{wanted.workers} workers, {name}", name, "--scheduler", address) == serial
                for kind, user, system in spent(folder):
                    print(f"    {kind}: {user:.1f} s user, {system:.1f} s system")
        if wanted.kill:
            with cluster(folder, wanted.workers, NO_TRIM | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "10"}) as address:
                with killing(folder, wanted.kill, "killed") as killed:
                    assert timed(folder, "a worker killed now and then", "killed", "--scheduler", address) == serial
                print(f"    {len(killed)} killed, nothing lost")
                with started(*words(folder, "both", "--scheduler", address), cwd=folder, env=ENVIRON,
                             stdout=subprocess.DEVNULL) as other:
                    assert timed(folder, "two calls at once for the same output", "both", "--scheduler", address) == serial
                    print(f"    exit of the other one: {other.wait()}")


def words(folder: Path, out: str, *more: object) -> list[object]:
    return [sys.executable, "-m", "compstiff", "correct", DEMO / "cell.yaml", "in", "--stiffness", DEMO / "stiffness.json",
            "-o", f"{out}/", "--tare", "0:2", "--quiet", *more]


def call(folder: Path, *arguments: object) -> None:
    subprocess.run([sys.executable, "-m", "compstiff", *map(str, arguments)], cwd=folder, env=ENVIRON, check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def timed(folder: Path, name: str, out: str, *more: object) -> dict[str, str]:
    """Runs the call, prints its time, and returns the digests of what it wrote."""
    begun = time.perf_counter()
    subprocess.run(list(map(str, words(folder, out.replace(" ", "_"), *more))), cwd=folder, env=ENVIRON, check=True,
                   stdout=subprocess.DEVNULL)
    print(f"{name}: {time.perf_counter() - begun:.1f} s")
    return digests(folder / out.replace(" ", "_"))


def digests(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("*.mod"))}


@contextmanager
def cluster(folder: Path, workers: int, more: dict[str, str]) -> Iterator[str]:
    address, quiet = f"tcp://localhost:{free_port()}", {"cwd": folder, "env": ENVIRON | more, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m"]
    with started(*dask, "distributed.cli.dask_scheduler", "--host", "localhost", "--port", address.rpartition(":")[2],
                 "--no-dashboard", **quiet), started(
            *dask, "distributed.cli.dask_worker", address, "--nworkers", workers, "--nthreads", 1, "--no-dashboard",
            "--local-directory", folder / "dask", **quiet):
        yield address


def spent(folder: Path) -> list[tuple[str, float, float]]:
    """CPU [s], user and system, of workers and scheduler so far."""
    rows = []
    for kind, word in (("workers", b"spawn_main"), ("scheduler", b"dask_scheduler")):
        ticks = [Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]
                 for number in processes_in(folder, word)]
        rows.append((kind, sum(int(user) for user, _ in ticks) / TICK, sum(int(system) for _, system in ticks) / TICK))
    return rows


@contextmanager
def killing(folder: Path, every: float, out: str) -> Iterator[list[int]]:
    """A worker is killed every so many seconds, more or less, while this lasts, and at the earliest when a program more has
    come into the folder `out` since: a machine so busy that none is done in the time would never end."""
    over, killed = threading.Event(), []

    def kill() -> None:
        done = 0
        while not over.wait(random.uniform(0.5, 1.5) * every):
            before, done = done, len(list((folder / out).glob("*.mod")))
            if done == before:
                continue
            for worker in random.sample(workers := processes_in(folder, b"spawn_main"), min(1, len(workers))):
                killed.append(worker)
                os.kill(worker, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        yield killed
    finally:
        over.set()
        killer.join()


if __name__ == "__main__":
    main()
