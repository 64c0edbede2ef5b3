"""The same small programs by one process, by processes of this machine, and by a Dask cluster: the same bytes, at what cost.

    python benchmarks/cluster.py [PROGRAMS] [--targets 1000] [--workers 2] [--every 3]

PROGRAMS copies of a program of so many targets, a comment apart, each with a log. Of each way the CPU of all its processes; of
a cluster also with the environment Dask gives its workers ("trim"; docs/cluster.md). Then what may happen to a cluster: a
worker killed at random every so many seconds; two calls at once for one output; a scheduler killed in the middle, another one
started and the call made again. After each: the bytes of every program, one line of --json a program, nothing else beside them.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.correct_time import write_job
from tests.support import free_port, processes_in, started

ROOT = Path(__file__).parents[1]
NO_TRIM = {"DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON": "{'MALLOC_TRIM_THRESHOLD_': None}"}
PATIENT = NO_TRIM | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "10"}
# An installation is compiled: a start that compiles is none, whatever the environment says of it.
ENVIRON = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | {
    "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
WORKER, SCHEDULER, NANNY = b"spawn_main", b"dask_scheduler", b"dask_worker"
TICK = os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=int, nargs="?", default=200)
    parser.add_argument("--targets", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--every", type=float, default=3.0, metavar="SECONDS")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job, text = write_job(folder, wanted.targets, "target"), (folder / "long.mod").read_bytes()
        (folder / "in").mkdir()
        for number in range(wanted.programs):
            (folder / "in" / f"p{number:03}.mod").write_bytes(f"! {number}\r\n".encode() + text)
            shutil.copy(job.forces, folder / "in" / f"p{number:03}.forces.csv")
        print(f"{wanted.programs} programs of {wanted.targets} targets, {wanted.workers} workers")
        serial = finished(folder, "one process", "serial")
        assert finished(folder, f"--jobs {wanted.workers}", "jobs", "--jobs", wanted.workers) == serial
        for name, more in (("trim", {}), ("no trim", NO_TRIM)):
            with cluster(folder, wanted.workers, more) as address:
                assert finished(folder, f"cluster, {name}", name, "--scheduler", address) == serial
                print("    " + "; ".join(f"{kind} {user:.1f} s user, {system:.1f} s system" for kind, user, system in
                                         spent(folder)))
        with cluster(folder, wanted.workers, PATIENT) as address:
            with killing(folder, wanted.every, "killed") as killed:
                assert finished(folder, "a worker killed now and then", "killed", "--scheduler", address) == serial
            print(f"    {len(killed)} workers killed: nothing lost, nothing twice")
            with started(*words("both", "--scheduler", address), cwd=folder, env=ENVIRON, stdout=subprocess.PIPE) as other:
                assert finished(folder, "two calls at once for one output", "both", "--scheduler", address) == serial
                once(folder, other.communicate()[0].decode())
            print(f"    the other call: exit code {other.returncode}")
        print(f"scheduler killed after {lost(folder, serial, wanted.workers)} programs: said, and the next call completes")


def words(out: str, *more: object) -> list[str]:
    return list(map(str, (sys.executable, "-m", "compstiff", "correct", "cell.yaml", "in", "--stiffness", "stiffness.json",
                          "-o", f"{out.replace(' ', '_')}/", "--json", *more)))


def finished(folder: Path, name: str, out: str, *more: object) -> dict[str, str]:
    """Runs the call to its end, prints its time, and returns the digests of what it wrote."""
    begun, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(words(out, *more), cwd=folder, env=ENVIRON, stdout=subprocess.PIPE, text=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done
    once(folder, done.stdout)
    print(f"{name}: {time.perf_counter() - begun:.1f} s on the clock; the call and its own processes "
          f"{used.ru_utime - before.ru_utime:.1f} s user, {used.ru_stime - before.ru_stime:.1f} s system", flush=True)
    return digests(folder, out)


def once(folder: Path, lines: str) -> None:
    """Each program was told once, in its order, and is corrected."""
    told = [json.loads(line) for line in lines.splitlines()]
    assert [Path(one["program"]).name for one in told] == sorted(path.name for path in (folder / "in").glob("*.mod"))
    assert {one["status"] for one in told} == {"ok"}


def digests(folder: Path, out: str) -> dict[str, str]:
    """Of the programs; nothing lies beside them but their records."""
    there = sorted((folder / out.replace(" ", "_")).iterdir())
    programs = [path for path in there if path.suffix == ".mod"]
    odd = {path.name for path in there} - {f"{path.name}{more}" for path in programs for more in ("", ".json")}
    assert not odd, odd
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in programs}


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
    """CPU [s], user and system, of workers, their nanny and the scheduler so far."""
    rows = []
    for kind, word in (("workers", WORKER), ("nanny", NANNY), ("scheduler", SCHEDULER)):
        ticks = [Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]
                 for number in processes_in(folder, word)]
        rows.append((kind, sum(int(user) for user, _ in ticks) / TICK, sum(int(system) for _, system in ticks) / TICK))
    return rows


@contextmanager
def beside(work: Callable[[threading.Event], None]) -> Iterator[None]:
    """Does the work in a thread of its own until this is left."""
    over = threading.Event()
    thread = threading.Thread(target=work, args=(over,))
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextmanager
def killing(folder: Path, every: float, out: str) -> Iterator[list[int]]:
    """A worker is killed every so many seconds, more or less, while this lasts, and at the earliest when a program more has
    come into the folder `out` since: a machine so busy that none is done in the time would never end."""
    killed: list[int] = []

    def kill(over: threading.Event) -> None:
        done = 0
        while not over.wait(random.uniform(0.5, 1.5) * every):
            before, done = done, written(folder, out)
            for worker in random.sample(workers := processes_in(folder, WORKER), min(done > before, len(workers))):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(worker, signal.SIGKILL)
                    killed.append(worker)

    with beside(kill):
        yield killed


def written(folder: Path, out: str) -> int:
    return len(list((folder / out).glob("*.mod")))


def lost(folder: Path, serial: dict[str, str], workers: int) -> int:
    """Kills the scheduler when a third of the programs is written; the next call, on another one, completes. How many were."""

    def kill(over: threading.Event) -> None:
        while not over.wait(0.2):
            if written(folder, "lost") >= len(serial) // 3:
                os.kill(processes_in(folder, SCHEDULER)[0], signal.SIGKILL)
                return

    with cluster(folder, workers, NO_TRIM) as address, beside(kill):
        call = subprocess.run(words("lost", "--scheduler", address), cwd=folder, env=ENVIRON, capture_output=True, text=True)
    done, (finding,) = digests(folder, "lost"), json.loads(call.stdout.splitlines()[-1])["findings"]
    assert (call.returncode, finding["code"]) == (1, "CS6046"), call
    assert done.items() < serial.items()
    assert "Traceback" not in call.stderr, call.stderr
    print(f"    {finding['code']} {finding['message']}; {finding['hint']}")
    with cluster(folder, workers, NO_TRIM) as address:
        assert finished(folder, "the call again", "lost", "--scheduler", address, "--force") == serial
    return len(done)


if __name__ == "__main__":
    main()
