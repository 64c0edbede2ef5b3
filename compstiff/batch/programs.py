"""Programs of a batch or of a watched folder, each corrected by itself: a JSON document, a line of text, an exit code."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from compensator.correction.files import Inputs, correct_files
from compensator.correction.settings import DEFAULTS, Settings
from compstiff.batch.pairing import ProgramFiles, no_log, programs_in
from compstiff.outcome import DEFECT, DONE, FAILED, INTERRUPTED, REFUSED, Outcome, Session, attempt, document
from identification.common.findings import Finding, error

# An interrupt ends the whole call; a defect is worse than what could not be done, and that is worse than a refusal.
WORST_FIRST = (INTERRUPTED, DEFECT, FAILED, REFUSED, DONE)


@dataclass(frozen=True)
class Shared:
    """What all programs share. session: the options of the call (verbose, overwrite). logs: the folder of the force logs, None
    where each lies beside its program.

    >>> from pathlib import Path
    >>> compstiff.Shared(Path("cell.yaml"), Path("stiffness.json")).settings == compstiff.Settings()
    True
    """

    cell: Path
    stiffness: Path
    settings: Settings = DEFAULTS
    session: Session = field(default_factory=lambda: Session("correct"))
    logs: Path | None = None


@dataclass(frozen=True)
class ProgramResult:
    """A program that was dealt with. status: "ok", "left" or "waiting" without a log, or what stopped it. findings: as shown;
    document: as `--json` prints it, on one line."""

    files: ProgramFiles
    code: int
    status: str
    findings: tuple[Finding, ...]
    document: dict[str, Any]

    @classmethod
    def of(cls, files: ProgramFiles, shared: Shared, outcome: Outcome, status: str, code: int) -> ProgramResult:
        """A program with what there is to say of it."""
        session = replace(shared.session, inputs=[shared.cell, files.program, shared.stiffness, *files.logs])
        written = str(files.outputs.program) if status == "ok" else None
        shown = document(session, outcome, status, code) | {"program": str(files.program), "output": written}
        return cls(files, code, status, outcome.findings, shown)

    def as_dict(self) -> dict[str, Any]:
        """JSON values."""
        return self.document

    def lines(self) -> list[str]:
        """The program in one line."""
        program = self.files.program
        if self.status in ("left", "waiting"):
            return [f"{program}: {self.findings[0].message}"]
        if self.code != DONE:
            stop = next((finding for finding in self.findings if finding.level == "error"), None)
            return [f"{program}: {self.status} (exit {self.code})" + (f", {stop.code}" if stop else "")]
        figures = self.document["result"]
        return [f"{program} -> {self.files.outputs.program}: {figures['corrected']} of {figures['targets']} targets corrected, "
                f"largest {figures['offset_mm']['largest']:.4f} mm"]

    def with_finding(self, finding: Finding) -> ProgramResult:
        """The same with one more thing to say."""
        shown = {**self.document, "findings": [*self.document["findings"], finding.as_dict()]}
        return replace(self, findings=(*self.findings, finding), document=shown)


def worst(codes: Sequence[int]) -> int:
    """The exit code of a call of several programs."""
    return next((code for code in WORST_FIRST if code in codes), DONE)


def programs_of(paths: Sequence[Path]) -> list[Path]:
    """The programs named, and those of the folders named. Raises CompstiffError: CS0005, CS6003 there is none."""
    programs = [program for path in paths for program in (programs_in(path) if path.is_dir() else [path])]
    if not programs:
        raise error("CS6003", "has no program in it", file=str(paths[0]), hint="name the folder of the programs (.mod ...)")
    return programs


def correct_programs(
    programs: Iterable[ProgramFiles], shared: Shared, *, processes: int = 1, stopped: Callable[[], bool] = lambda: False,
) -> Iterator[ProgramResult]:
    """Corrects the programs (`paired`), in their order: each by itself, one that fails does not stop the others. Once
    `stopped`, those under way are finished and no further one is begun.

    >>> from pathlib import Path
    >>> folders = compstiff.Folders(Path("corrected"))
    >>> folders.make()
    >>> shared = compstiff.Shared(Path("cell.yaml"), Path("stiffness.json"), compstiff.Settings.of(tare=((0, 2),)))
    >>> [result.status for result in compstiff.correct_programs(compstiff.paired([Path("insert.mod")], None, folders), shared)]
    ['ok']
    """
    left = deque(programs)
    if processes > 1 and len(left) > 1:
        while left and not stopped():
            # A lost process takes its pool with it: those not begun go to a new one.
            yield from _in_processes(left, shared, min(processes, len(left)), stopped)
    while left and not stopped():
        yield correct_program(left.popleft(), shared)


def correct_program(
    files: ProgramFiles, shared: Shared, *, overwrite: bool = False, before_writing: Callable[[], None] | None = None
) -> ProgramResult:
    """Corrects one program; whatever stops it is in what it returns.

    overwrite: existing outputs are this call's own. before_writing: called once everything is computed; what it raises stops
    the correction, and nothing is written.
    """
    if not files.logs:
        left = Outcome(findings=(no_log(files.program, shared.logs, "it is left alone"),))
        return ProgramResult.of(files, shared, left, "left", DONE)

    def body() -> Outcome:
        inputs = Inputs(shared.cell, files.program, shared.stiffness, files.forces)
        corrected = correct_files(inputs, files.outputs, shared.settings, overwrite=overwrite or shared.session.overwrite,
                                  before_writing=before_writing)
        return Outcome(corrected.as_dict(), corrected.findings)

    return ProgramResult.of(files, shared, *attempt(replace(shared.session, jobs=False), body))


def _in_processes(
    programs: deque[ProgramFiles], shared: Shared, processes: int, stopped: Callable[[], bool]
) -> Iterator[ProgramResult]:
    """Takes programs from the left until none is left, or a process of the pool is lost."""
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    begun: deque[tuple[ProgramFiles, Future[ProgramResult]]] = deque()
    # Spawned, not forked: the libraries of this process may have threads.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _deaf) as pool:
        while True:
            # No more are handed over than are worked on, so that none begins after a stop.
            with contextlib.suppress(BrokenProcessPool):
                while programs and not stopped() and sum(not future.done() for _, future in begun) < processes:
                    with _without_interrupts():
                        begun.append((programs[0], pool.submit(correct_program, programs[0], shared)))
                    programs.popleft()
            if not begun:
                return
            wait([future for _, future in begun if not future.done()], return_when=FIRST_COMPLETED)
            while begun and begun[0][1].done():
                files, future = begun.popleft()
                try:
                    yield future.result()
                except BrokenProcessPool:
                    yield _lost(files, shared)


def _lost(files: ProgramFiles, shared: Shared) -> ProgramResult:
    finding = Finding("CS6010", "error", "the process that worked on a program of this batch ended by itself",
                      file=str(files.program), hint="memory may have run out: try again with --jobs 1")
    return ProgramResult.of(files, shared, Outcome(findings=(finding,)), "defect", DEFECT)


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
