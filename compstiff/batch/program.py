"""One program of a batch or of a watched folder, corrected by itself: a JSON document, a line of text, an exit code."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from compensator.correction.files import Inputs, Outputs, correct_files
from compensator.correction.record import check_not_corrected
from compensator.correction.settings import Settings
from compstiff.batch.pairing import Job, no_log
from compstiff.outcome import DEFECT, DONE, FAILED, INTERRUPTED, REFUSED, Outcome, Session, attempt, document
from identification.common.findings import Finding

# An interrupt ends the whole call; a defect is worse than what could not be done, and that is worse than a refusal.
WORST_FIRST = (INTERRUPTED, DEFECT, FAILED, REFUSED, DONE)


@dataclass(frozen=True)
class Common:
    """What all programs share. session: the options of the call (JSON, verbose, overwrite). logs: the folder of the force
    logs, None where each lies beside its program."""

    cell: Path
    stiffness: Path
    settings: Settings
    session: Session
    logs: Path | None = None


@dataclass(frozen=True)
class Done:
    """A program that was dealt with. findings: as shown; document: as `--json` prints it, on one line."""

    job: Job
    code: int
    status: str
    findings: tuple[Finding, ...]
    document: dict[str, Any]

    @property
    def line(self) -> str:
        """The program in one line."""
        if self.status in ("left", "waiting"):
            return f"{self.job.program}: {self.findings[0].message}"
        if self.code != DONE:
            stop = next((finding for finding in self.findings if finding.level == "error"), None)
            return f"{self.job.program}: {self.status} (exit {self.code})" + (f", {stop.code}" if stop else "")
        figures = self.document["result"]
        return (f"{self.job.program} -> {self.job.output}: {figures['corrected']} of {figures['targets']} targets corrected, "
                f"largest {figures['offset_mm']['largest']:.4f} mm")


    def with_finding(self, finding: Finding) -> Done:
        """The same with one more thing to say."""
        shown = {**self.document, "findings": [*self.document["findings"], finding.as_dict()]}
        return replace(self, findings=(*self.findings, finding), document=shown)


def worst(codes: Sequence[int]) -> int:
    """The exit code of a call of several jobs."""
    return next((code for code in WORST_FIRST if code in codes), DONE)


def run_job(job: Job, common: Common, *, overwrite: bool = False, before_writing: Callable[[], None] | None = None) -> Done:
    """Corrects one program; whatever stops it is in what it returns.

    overwrite: existing outputs are this call's own. before_writing: called once everything is computed; what it raises stops
    the job, and nothing is written.
    """
    if not job.logs:
        return done_with(job, common, Outcome(findings=(no_log(job.program, common.logs, "it is left alone"),)), "left", DONE)
    forced = common.session.overwrite

    def body() -> Outcome:
        inputs = Inputs(common.cell, job.program, common.stiffness, job.forces)
        if not forced:
            check_not_corrected(job.program, job.output.parent)
        corrected = correct_files(inputs, Outputs(job.output, job.offsets, job.report), common.settings,
                                  overwrite=overwrite or forced, before_writing=before_writing)
        return Outcome(corrected.as_dict(), corrected.findings)

    session = replace(common.session, jobs=False)
    outcome, status, code = attempt(session, body)
    return done_with(job, common, outcome, status, code)


def done_with(job: Job, common: Common, outcome: Outcome, status: str, code: int) -> Done:
    """A program with what there is to say of it."""
    session = replace(common.session, inputs=[common.cell, job.program, common.stiffness, *job.logs])
    written = str(job.output) if status == "ok" else None
    shown = document(session, outcome, status, code) | {"program": str(job.program), "output": written}
    return Done(job, code, status, outcome.findings, shown)


def run_jobs(jobs: Sequence[Job], common: Common, processes: int, stopped: Callable[[], bool]) -> Iterator[Done]:
    """Corrects the programs, in their order; once `stopped`, those under way are finished and no further one is begun."""
    if processes > 1 and len(jobs) > 1:
        left = deque(jobs)
        while left and not stopped():
            # A lost process takes its pool with it: those not begun go to a new one.
            yield from _in_processes(left, common, min(processes, len(left)), stopped)
        return
    for job in jobs:
        if stopped():
            return
        yield run_job(job, common)


def _in_processes(jobs: deque[Job], common: Common, processes: int, stopped: Callable[[], bool]) -> Iterator[Done]:
    """Takes jobs from the left until none is left, or a process of the pool is lost."""
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    begun: deque[tuple[Job, Future[Done]]] = deque()
    # Spawned, not forked: the libraries of this process may have threads.
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        while True:
            # No more are handed over than are worked on, so that none begins after a stop.
            with contextlib.suppress(BrokenProcessPool):
                while jobs and not stopped() and sum(not future.done() for _, future in begun) < processes:
                    with _without_interrupts():
                        begun.append((jobs[0], pool.submit(run_job, jobs[0], common)))
                    jobs.popleft()
            if not begun:
                return
            wait([future for _, future in begun if not future.done()], return_when=FIRST_COMPLETED)
            while begun and begun[0][1].done():
                job, future = begun.popleft()
                try:
                    yield future.result()
                except BrokenProcessPool:
                    yield _lost(job, common)


def _lost(job: Job, common: Common) -> Done:
    finding = Finding("CS6010", "error", "the process that worked on a program of this batch ended by itself",
                      file=str(job.program), hint="memory may have run out: try again with --jobs 1")
    return done_with(job, common, Outcome(findings=(finding,)), "defect", DEFECT)


@contextlib.contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes begun in here never see a Ctrl-C, which reaches every process of a terminal: the first one decides what becomes
    of the others' work. Its own comes afterwards."""
    import signal

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
