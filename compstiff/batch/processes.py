"""Work handed out to processes of this machine: one that is lost is tried once more by itself, and blames no other."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from typing import TypeVar

from compstiff.batch.pairing import ProgramFiles

Result = TypeVar("Result")
# (program, whether outputs that exist are what a lost process of this call left) -> what became of it
Work = Callable[[ProgramFiles, bool], Result]


def handed_out(
    programs: deque[ProgramFiles], submit: Callable[[ProgramFiles], Future[Result]], at_once: int, stopped: Callable[[], bool]
) -> Iterator[tuple[ProgramFiles, Future[Result]]]:
    """The programs with their finished futures, in order. No more are handed over than are worked on, so that none begins after
    a stop. Ends early where the executor takes no more: those not begun are left in `programs`."""
    begun: deque[tuple[ProgramFiles, Future[Result]]] = deque()
    while True:
        with contextlib.suppress(BrokenExecutor):
            while programs and not stopped() and sum(not future.done() for _, future in begun) < at_once:
                begun.append((programs[0], submit(programs[0])))
                programs.popleft()
        if not begun:
            return
        wait([future for _, future in begun if not future.done()], return_when=FIRST_COMPLETED)
        while begun and begun[0][1].done():
            yield begun.popleft()


def in_processes(
    programs: deque[ProgramFiles], work: Work[Result], processes: int, stopped: Callable[[], bool]
) -> Iterator[tuple[ProgramFiles, Result | None]]:
    """Each program with what came of it; None where the process was lost twice, the second time alone in its pool: a process
    that is lost takes its pool with it, and whoever else was under way there."""
    while programs and not stopped():
        new = {files: is_new(files) for files in programs}
        with _pool(min(processes, len(programs))) as pool:
            for files, future in handed_out(programs, lambda files: _submit(pool, work, files, own=False), processes, stopped):
                try:
                    yield files, future.result()
                except BrokenExecutor:
                    yield files, _alone(work, files, own=new[files])


def is_new(files: ProgramFiles) -> bool:
    """Whether none of its outputs exists."""
    return not any(path.exists() for path in files.outputs.files())


def _alone(work: Work[Result], files: ProgramFiles, own: bool) -> Result | None:
    with _pool(1) as pool:
        try:
            return _submit(pool, work, files, own).result()
        except BrokenExecutor:
            return None


def _pool(processes: int) -> ProcessPoolExecutor:
    import multiprocessing

    # Spawned, not forked: the libraries of this process may have threads.
    return ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _deaf)


def _submit(pool: ProcessPoolExecutor, work: Work[Result], files: ProgramFiles, own: bool) -> Future[Result]:
    with _without_interrupts():
        return pool.submit(work, files, own)


def _deaf() -> None:
    """In each process of the pool: Ctrl-C and Ctrl-Break are for the first one."""
    import signal

    for number in {signal.SIGINT, getattr(signal, "SIGBREAK", signal.SIGINT)}:
        signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes begun in here never see a Ctrl-C, which reaches every process of a terminal: the first one decides what becomes
    of the others' work. Its own comes afterwards."""
    import signal

    if not hasattr(signal, "pthread_sigmask"):      # Windows: `_deaf` is all there is
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
