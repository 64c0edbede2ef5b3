"""A watched folder: each finished program with its log is corrected once, also over restarts."""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from compstiff.batch.finished_files import Settled, Signature, lacks_its_end, signature
from compstiff.batch.journal import Journal, sync_folder
from compstiff.batch.pairing import Folders, Job, jobs_for, no_log, programs_in
from compstiff.batch.program import Common, Done, done_with, run_job
from compstiff.outcome import DONE, INTERRUPTED, Outcome
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, error, fold
from identification.model.cell import read_cell


@dataclass
class Watch:
    """The folder `source` under watch. handled: the files of a program as they were when it was last looked into."""

    source: Path
    folders: Folders
    common: Common
    journal: Journal
    settled: Settled
    handled: dict[Path, list[Signature]] = field(default_factory=dict)

    def look(self) -> Iterator[Done]:
        """Looks at the folder once: corrects what is finished and new, and says once what waits. Raises CompstiffError: CS0005
        the folder, CS0004 the journal."""
        shared = self.settled.look([self.common.cell, self.common.stiffness])
        for job in jobs_for(programs_in(self.source), None, self.folders):
            files = [job.program, *job.logs]
            if self.handled.get(job.program) == [signature(path) for path in (*files, self.common.cell, self.common.stiffness)]:
                continue
            own = self.settled.look(files)
            if own is None or shared is None:
                continue
            state = [*own, *shared]
            waits = self._waits_for(job)
            if waits:
                self.handled[job.program] = state
                yield done_with(job, self.common, Outcome(findings=(waits,)), "waiting", DONE)
                continue
            done = self._take(job, state)
            if done:
                yield done

    def _waits_for(self, job: Job) -> Finding | None:
        if not job.logs:
            return no_log(job.program, None, "it waits")
        with contextlib.suppress(OSError):
            if lacks_its_end(job.program):
                return Finding("CS6009", "warning", "has a MODULE without ENDMODULE: it is taken for half written, and waits",
                               file=str(job.program), hint="copy it again, under another name first and renamed at the end")
        return None

    def _take(self, job: Job, state: list[Signature]) -> Done | None:
        """Corrects a program unless the journal says that this was done; None where nothing new was learnt."""
        files = (job.program, *job.logs, self.common.cell, self.common.stiffness)
        try:
            digests = [sha256(path) for path in (job.program, *job.logs)]
            key = self._key(job, digests)
        except OSError:
            return None     # Gone, or no longer readable: the next look sees it.
        last = self.journal.last.get(job.program.name, {})
        if last.get("key") == key:
            self.handled[job.program] = state
            return None
        outputs = [os.path.relpath(path, self.folders.output) for path in job.written]
        own = all(name in self.journal.outputs for name, path in zip(outputs, job.written, strict=True) if path.exists())
        self.journal.begun(job.program.name, key, outputs)

        def still_the_same() -> None:
            if [signature(path) for path in files] != state:
                raise error("CS6004", "it, its log, the cell or the stiffness file changed while it was being corrected; it is "
                            "taken again when they are finished", file=str(job.program))

        done = run_job(job, self.common, overwrite=own, before_writing=still_the_same)
        if done.code == INTERRUPTED:
            raise KeyboardInterrupt
        if any(finding.code == "CS6004" for finding in done.findings):
            return done
        if last.get("program_sha256", digests[0]) != digests[0] and last.get("logs_sha256") == digests[1:]:
            done = done.with_finding(Finding(
                "CS6012", "warning", "changed since it was last corrected, its force log did not: the forces are taken for "
                "those of the new program", file=str(job.program), hint="mill the new program once and replace the log"))
        for folder in {path.parent for path in job.written}:
            sync_folder(folder)
        self.journal.done(job.program.name, key, program_sha256=digests[0], logs_sha256=digests[1:], status=done.status,
                          exit_code=done.code, findings=[finding.as_dict() for finding in fold(done.findings)])
        self.handled[job.program] = state
        return done

    def _key(self, job: Job, digests: list[str]) -> str:
        """What makes a job another one: names and content of program and log, cell, robot, stiffness and settings."""
        robot = ""
        with contextlib.suppress(CompstiffError):
            robot = read_cell(self.common.cell).robot.sha256
        chosen = self.common.settings.values()
        parts = [job.program.name, *digests, str(job.rival), sha256(self.common.cell), robot, sha256(self.common.stiffness),
                 *(f"{name}={value!r}" for name, value in chosen.items()),
                 *(sha256(value) for value in chosen.values() if isinstance(value, Path) and value.is_file())]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def check_folders(source: Path, folders: Folders) -> None:
    """Raises CompstiffError (CS6006) where a folder that is written to is, or lies in, the one that is read."""
    for folder in (folders.output, folders.offsets, folders.report):
        if folder and folder.resolve().is_relative_to(source.resolve()):
            raise error("CS6006", f"lies in the folder that is watched, {source}", file=str(folder),
                        hint="give a folder beside it: what was corrected must never be read again")


def watching(watch: Watch, interval: float, stopped: Callable[[], bool]) -> Iterator[Done | CompstiffError]:
    """Looks every `interval` seconds until `stopped`; that the folder cannot be read for a while (CS0005) is said once."""
    said = ""
    while not stopped():
        try:
            for done in watch.look():
                yield done
                if stopped():
                    return
            said = ""
        except CompstiffError as trouble:
            if trouble.findings[0].code != "CS0005":
                raise
            if str(trouble) != said:
                said = str(trouble)
                yield trouble
        pause(interval, stopped)


def look_once(watch: Watch, stopped: Callable[[], bool]) -> Iterator[Done]:
    """Takes what is finished now: looks, waits until files can have settled, and looks again."""
    yield from watch.look()
    if watch.settled.settle:
        pause(watch.settled.settle, stopped)
        if not stopped():
            yield from watch.look()


def pause(seconds: float, stopped: Callable[[], bool]) -> None:
    """Waits, in short steps, so that a signal ends it soon."""
    end = time.monotonic() + seconds
    while not stopped() and (left := end - time.monotonic()) > 0:
        time.sleep(min(0.1, left))
