"""Work handed out to a cluster: programs on the workers of a Dask scheduler, which share the disk and nothing else.

A scheduler runs whatever it is sent, so it is spoken to over TLS, or on this machine alone. What a worker has is compared
before anything is begun: the same code, libraries, cell and stiffness.
"""

from __future__ import annotations

import hashlib
import ipaddress
import logging
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from compstiff.batch.pairing import ProgramFiles
from compstiff.batch.processes import handed_out, is_new
from compstiff.batch.programs import ProgramResult, Shared, content_key, correct_as_new
from identification.common.files import sha256
from identification.common.findings import CompstiffError, error

if TYPE_CHECKING:
    from distributed import Client
    from distributed import Future as Task

# [s] for a scheduler to answer, and for its first worker to come: a busy machine takes over 10 to load either.
PATIENCE = 30.0
# What computes: another release may give other last digits.
LIBRARIES = ("numpy", "scipy", "pyarrow", "toppra")
START = "start workers with: dask worker ADDRESS --nthreads 1 --nworkers auto"


def on_cluster(
    programs: deque[ProgramFiles], shared: Shared, scheduler: str, stopped: Callable[[], bool]
) -> Iterator[tuple[ProgramFiles, ProgramResult | None]]:
    """Each program with what came of it, in order; scheduler: tls://HOST:PORT, or tcp:// on this machine.

    None where every worker that had it was lost: Dask tries `distributed.scheduler.allowed-failures` more, and all that twice.
    Raises CompstiffError: CS6040 to CS6046.
    """
    settings = replace(shared.settings, **{
        name: replace(group, **{key: value.absolute() for key, value in vars(group).items() if isinstance(value, Path)})
        for name, group in vars(shared.settings).items()})
    there = replace(shared, cell=shared.cell.absolute(), stiffness=shared.stiffness.absolute(), settings=settings,
                    logs=shared.logs and shared.logs.absolute())
    total, yielded, new = len(programs), 0, {files: is_new(files) for files in programs}
    with connected(scheduler) as client:
        from distributed import KilledWorker

        workers = checked(client, there, scheduler)

        def submit(files: ProgramFiles, again: str = "") -> Future[ProgramResult]:
            return _settled(client.submit(correct_as_new, there, _absolute(files), new[files], key=_key(files, there) + again))

        # One for each worker: what waits at a worker that is lost counts as having been lost with it.
        for files, future in handed_out(programs, submit, workers, stopped):
            try:
                try:
                    result = future.result()
                except KilledWorker:
                    result = submit(files, again="-again").result()
            except KilledWorker:
                yield files, None
            except (CancelledError, OSError) as reason:
                raise error("CS6046", f"was lost: {yielded} of {total} programs were dealt with", file=scheduler, hint=(
                    "call again when it is back; --force writes those once more that are complete already")) from reason
            else:
                yield files, result
            yielded += 1


def _settled(task: Task[ProgramResult]) -> Future[ProgramResult]:
    """What comes of the task. Dask's own executor asks for its status once more after the result has come; a worker that was
    lost in between makes it take the result for an exception."""
    given: Future[ProgramResult] = Future()

    def settle(task: Task[ProgramResult]) -> None:
        try:
            given.set_result(task.result())
        except BaseException as reason:     # CancelledError too is for whoever asks for the result
            given.set_exception(reason)

    task.add_done_callback(settle)
    return given


@contextmanager
def connected(scheduler: str) -> Iterator[Client]:
    """A client of the scheduler; over TLS with the certificates that Dask's own settings name. Raises CompstiffError: CS6040
    Dask is missing, CS6041 the address, CS6042 no answer."""
    try:
        from distributed import Client, Security
    except ImportError as reason:
        raise error("CS6040", "a cluster needs Dask", hint="pip install 'compstiff[cluster]'") from reason
    # It tells a scheduler that is lost as tracebacks; what that means is said by whoever asked for results.
    for part in ("distributed", "distributed.client"):      # Dask gives the second a level of its own
        logging.getLogger(part).setLevel(logging.CRITICAL)
    security = None
    if _is_tls(scheduler):
        security = Security(require_encryption=True)
        files = security.get_tls_config_for_role("client")
        if not (files["ca_file"] and files["cert"]):
            raise error("CS6041", "needs certificates", file=scheduler, hint="name them to Dask: docs/cluster.md")
    try:
        client = Client(scheduler, security=security, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as reason:
        raise error("CS6042", f"does not answer: {reason}", file=scheduler,
                    hint="is the scheduler running there, and is it of the same kind, tls or tcp?") from reason
    try:
        yield client
    finally:
        client.close(timeout=2)


def _is_tls(scheduler: str) -> bool:
    """Raises CompstiffError (CS6041) of an address that is none, or open to others."""
    parts = urlsplit(scheduler)
    try:
        complete = bool(parts.hostname and parts.port)
    except ValueError:
        complete = False
    if parts.scheme not in ("tls", "tcp") or not complete:
        raise error("CS6041", "is no address of a scheduler", file=scheduler, hint="expected tls://HOST:PORT")
    if parts.scheme == "tls":
        return True
    try:
        local = ipaddress.ip_address(parts.hostname or "").is_loopback
    except ValueError:
        local = parts.hostname == "localhost"
    if not local:
        raise error("CS6041", "is open: whoever reaches such a scheduler runs what he likes on its workers",
                    file=scheduler, hint="start it with certificates, and name it tls://; tcp:// is for this machine")
    return False


def checked(client: Client, shared: Shared, address: str) -> int:
    """How many workers there are, each with what this side has. Raises CompstiffError: CS6043 none, CS6044 other code,
    libraries or threads, CS6045 other files."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as reason:
        raise error("CS6043", "has no worker", file=address, hint=START) from reason
    here = standing(*shared.files)
    for worker, there in _answers(client, shared, address).items():
        other = [f"{name} {there['has'].get(name)} in place of {mine}" for name, mine in here["has"].items()
                 if there["has"].get(name) != mine]
        if other:
            raise error("CS6044", f"has {', '.join(other)}", file=worker, hint="install the same there, then start it anew")
        if there["files"] != here["files"]:
            raise error("CS6045", f"does not see {' and '.join(map(str, shared.files))} as they are here", file=worker,
                        hint="programs, logs, cell, stiffness and output lie on a disk that all share, under the same path")
    threads: dict[str, int] = client.nthreads()         # asked for now; what the client knows of itself may be old
    for worker, count in threads.items():
        if count != 1:
            raise error("CS6044", f"has {count} threads; a correction has a process of its own", file=worker, hint=START)
    return max(len(threads), 1)


def _answers(client: Client, shared: Shared, address: str) -> dict[str, Any]:
    """What each worker has. One that is lost meanwhile comes back under another address: all are asked again."""
    for _ in range(5):
        answers: dict[str, Any] = client.run(standing, *shared.files, on_error="return")
        if not any(isinstance(answer, OSError) for answer in answers.values()):
            return answers
        time.sleep(PATIENCE / 30)
    raise error("CS6043", "has workers that do not stay", file=address, hint="see what the workers print")


def standing(*files: Path) -> dict[str, dict[str, Any]]:
    """What this process computes with, and the files that all programs share as it sees them."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    for package in ("identification", "compensator", "compstiff"):
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.relative_to(root).as_posix().encode() + file.read_bytes())
    has = {"compstiff": digest.hexdigest()[:12], "Python": ".".join(map(str, sys.version_info[:2]))}
    for name in LIBRARIES:
        try:
            has[name] = version(name)
        except PackageNotFoundError:
            has[name] = "none"
    seen = {}
    for path in files:
        try:
            seen[str(path)] = sha256(path)
        except OSError as reason:
            seen[str(path)] = os.strerror(reason.errno or 0)
    return {"has": has, "files": seen}


def _key(files: ProgramFiles, shared: Shared) -> str:
    """The name of a task: two calls for the same output from the same content are one task."""
    try:
        content = content_key(files, shared, [sha256(path) for path in files.own])
    except (OSError, CompstiffError):
        content = "unread"          # the worker says what is wrong
    return f"compstiff-{content}-{hashlib.sha256(str(files.outputs.program.absolute()).encode()).hexdigest()[:16]}"


def _absolute(files: ProgramFiles) -> ProgramFiles:
    """The same under paths that do not depend on where one stands."""
    outputs = replace(files.outputs, **{name: path and path.absolute() for name, path in vars(files.outputs).items()})
    return replace(files, program=files.program.absolute(), logs=tuple(log.absolute() for log in files.logs), outputs=outputs,
                   rival=files.rival and files.rival.absolute(), stocks=tuple(stock.absolute() for stock in files.stocks))
