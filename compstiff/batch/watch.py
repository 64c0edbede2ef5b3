"""A watched folder: each finished program with its log is corrected once, also over restarts."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from compensator.cutting.coefficients import read_coefficients
from compstiff.batch.finished_files import Settled, lacks_its_end
from compstiff.batch.journal import Journal, sync_folder
from compstiff.batch.pairing import Folders, ProgramFiles, no_log, paired, programs_in
from compstiff.batch.programs import ProgramResult, Shared, content_key, correct_program, named_in
from compstiff.outcome import DONE, INTERRUPTED, Outcome
from identification.common.files import FileStamp, file_stamp, sha256
from identification.common.findings import CompstiffError, Finding, error, fold
from identification.model.cell import read_cell
from identification.model.stiffness_file import read_stiffness


@dataclass(frozen=True)
class Rhythm:
    """settle [s]: a file is finished when it has not changed for so long; interval [s]: between looks. once: take what is
    finished now, and end. retry: try programs again that failed before."""

    settle: float = 5.0
    interval: float = 2.0
    once: bool = False
    retry: bool = False


def watch_folder(
    source: Path, folders: Folders, shared: Shared, rhythm: Rhythm | None = None, *,
    stopped: Callable[[], bool] = lambda: False, say: Callable[[str], None] = lambda text: None,
) -> Iterator[ProgramResult]:
    """Corrects every finished program that appears in `source`, once, and yields how it went, until `stopped`.

    say: called with what else a person wants to know. Raises CompstiffError: CS6006 the folders, CS6005 another watch, CS0004
    a folder or the journal cannot be written, and what `read_cell`, `read_stiffness` and `read_coefficients` raise: a mistake
    in what every program needs is no program's failure.

    >>> from pathlib import Path
    >>> from compstiff.batch.watch import Rhythm
    >>> shared = compstiff.Shared(Path("cell.yaml"), Path("stiffness.json"), compstiff.Settings.of(tare=((0, 2),)))
    >>> watched = compstiff.watch_folder(Path("batch"), compstiff.Folders(Path("watched")), shared, Rhythm(settle=0, once=True))
    >>> [result.status for result in watched]
    ['ok', 'ok', 'waiting']
    """
    rhythm = rhythm or Rhythm()
    check_folders(source, folders)
    read_stiffness(shared.stiffness, read_cell(shared.cell))
    if shared.settings.cutting.predict_force:
        read_coefficients(shared.settings.cutting.predict_force)
    folders.make()
    with contextlib.closing(Journal(folders.output)) as journal:
        journal.sweep()
        if rhythm.retry:
            journal.forget_failures()
        if not rhythm.once:
            say(f"watching {source}; Ctrl-C ends it")
        for finding in journal.findings:
            say(str(finding))
        journal.told()
        watch = Watch(source, folders, shared, journal, Settled(rhythm.settle))
        yield from watch.once(stopped) if rhythm.once else watch.always(rhythm.interval, stopped, say)


@dataclass
class Watch:
    """The folder `source` under watch. handled: the files of a program as they were when it was last looked into. shut: what
    was said of a program with a file that cannot be read, which may change though the file does not."""

    source: Path
    folders: Folders
    shared: Shared
    journal: Journal
    settled: Settled
    handled: dict[Path, list[FileStamp]] = field(default_factory=dict)
    shut: dict[Path, Finding] = field(default_factory=dict)

    def always(self, interval: float, stopped: Callable[[], bool], say: Callable[[str], None]) -> Iterator[ProgramResult]:
        """Looks every `interval` seconds until `stopped`; that the folder cannot be read for a while (CS0005) is said once."""
        last_trouble = ""
        while not stopped():
            try:
                for result in self.look():
                    yield result
                    if stopped():
                        return
                last_trouble = ""
            except CompstiffError as trouble:
                if trouble.findings[0].code != "CS0005":
                    raise
                if str(trouble) != last_trouble:
                    last_trouble = str(trouble)
                    say(last_trouble)
            pause(interval, stopped)

    def once(self, stopped: Callable[[], bool]) -> Iterator[ProgramResult]:
        """Takes what is finished now: looks, waits until files can have settled, and looks again."""
        yield from self.look()
        if self.settled.settle:
            pause(self.settled.settle, stopped)
            if not stopped():
                yield from self.look()

    def look(self) -> Iterator[ProgramResult]:
        """Looks at the folder once: corrects what is finished and new, and says once what waits. Raises CompstiffError: CS0005
        the folder, CS0004 the journal."""
        shared = self.settled.look([*self.shared.files])
        for files in paired(programs_in(self.source), None, self.folders, predicted=self.shared.predicted):
            if self.handled.get(files.program) == [file_stamp(path) for path in self._read_for(files)]:
                continue
            own = self.settled.look(_own(files))
            if own is None or shared is None:
                yield from self._shut(files, self.settled.kept_shut(self._read_for(files)))
                continue
            stamps = [*own, *shared]
            waits = self._waits_for(files)
            if waits:
                self.handled[files.program] = stamps
                yield self._waiting(files, waits)
                continue
            yield from self._take(files, stamps)

    def _waiting(self, files: ProgramFiles, why: Finding) -> ProgramResult:
        return ProgramResult.of(files, self.shared, Outcome(findings=(why,)), "waiting", DONE)

    def _shut(self, files: ProgramFiles, reason: OSError | None) -> Iterator[ProgramResult]:
        """What is said, once, of a program that waits because a file that is read for it cannot be."""
        if reason is None:
            return
        file = Path(reason.filename or files.program)
        waits = Finding("CS6014", "warning", f"{file.name} cannot be read: {reason.strerror}; the program waits",
                        file=str(file), hint="may the account that watches read it? The program is taken as soon as it can be")
        if self.shut.get(files.program) != waits:
            self.shut[files.program] = waits
            yield self._waiting(files, waits)

    def _read_for(self, files: ProgramFiles) -> list[Path]:
        """Every file that the correction of a program reads."""
        return [*_own(files), *self.shared.files]

    def _waits_for(self, files: ProgramFiles) -> Finding | None:
        if not files.logs and not files.stocks:
            return no_log(files.program, None, "it waits", self.shared.predicted, watched=True)
        with contextlib.suppress(OSError):
            if lacks_its_end(files.program):
                return Finding("CS6009", "warning", "has a MODULE without ENDMODULE: it is taken for half written, and waits",
                               file=str(files.program),
                               hint="copy it again, under another name first and renamed at the end")
        return None

    def _take(self, files: ProgramFiles, stamps: list[FileStamp]) -> Iterator[ProgramResult]:
        """Corrects a program unless the journal says that this was done; yields nothing where nothing new was learnt."""
        name, outputs = files.program.name, files.outputs.files()
        try:
            digests = [sha256(path) for path in files.own]
            key = content_key(files, self.shared, digests)
        except FileNotFoundError:
            return      # Gone: the next look sees it.
        except OSError as reason:
            yield from self._shut(files, reason)
            return
        self.shut.pop(files.program, None)
        last = self.journal.last.get(name, {})
        if last.get("key") == key:
            self.handled[files.program] = stamps
            return
        written = [_from(self.folders.output, path) for path in outputs]
        own = all(file in self.journal.outputs for file, path in zip(written, outputs, strict=True) if os.path.lexists(path))
        self.journal.begun(name, key, written)

        def still_the_same() -> None:
            if [file_stamp(path) for path in self._read_for(files)] != stamps:
                raise error("CS6004", "it, its log or stock, the cell or the stiffness file changed while it was being "
                            "corrected; it is taken again when they are finished", file=str(files.program))

        result = correct_program(files, self.shared, overwrite=own, before_writing=still_the_same)
        if result.code == INTERRUPTED:
            raise KeyboardInterrupt
        if any(finding.code == "CS6004" for finding in result.findings):
            yield result
            return
        logs = digests[1:1 + len(files.logs)]
        if logs and last.get("program_sha256", digests[0]) != digests[0] and last.get("logs_sha256") == logs:
            result = result.with_finding(Finding(
                "CS6012", "warning", "changed since it was last corrected, its force log did not: the forces are taken for "
                "those of the new program", file=str(files.program), hint="mill the new program once and replace the log"))
        for folder in {path.parent for path in outputs}:
            sync_folder(folder)
        self.journal.done(name, key, program_sha256=digests[0], logs_sha256=logs,
                          stocks_sha256=digests[1 + len(logs):], status=result.status,
                          exit_code=result.code, findings=[finding.as_dict() for finding in fold(result.findings)])
        self.handled[files.program] = stamps
        yield result


def _own(files: ProgramFiles) -> list[Path]:
    """What is read for a program alone, what its stock file names included."""
    return [*files.own, *(path for stock in files.stocks for path in named_in(stock))]


def _from(folder: Path, path: Path) -> str:
    """The path as seen from the folder; on another drive, where there is no way from one to the other, as it is."""
    try:
        return os.path.relpath(path, folder)
    except ValueError:
        return str(path.absolute())


def check_folders(source: Path, folders: Folders) -> None:
    """Raises CompstiffError (CS6006) where a folder that is written to is, or lies in, the one that is read."""
    for folder in (folders.output, folders.offsets, folders.report):
        if folder and Path(os.path.realpath(folder)).is_relative_to(os.path.realpath(source)):
            raise error("CS6006", f"lies in the folder that is watched, {source}", file=str(folder),
                        hint="give a folder beside it: what was corrected must never be read again")


def pause(seconds: float, stopped: Callable[[], bool]) -> None:
    """Waits, in short steps, so that a signal ends it soon."""
    end = time.monotonic() + seconds
    while not stopped() and (left := end - time.monotonic()) > 0:
        time.sleep(min(0.1, left))
