"""Many programs: which belong together with which log and stock, and which files each is to become (docs/formats.md).

A program, its log and what it starts from share their stem: `part.mod`, `part.forces.csv`, `part.stock.yaml`. Nothing here
reads what is inside the files.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from compensator.correction.files import Outputs
from compensator.posting.suffixes import RAPID_SUFFIXES, TABLE_SUFFIXES, TOOLPATH_SUFFIXES, toolpath_stem, toolpath_suffix
from identification.common.files import sha256
from identification.common.findings import CompstiffError, Finding, error

LOG_SUFFIXES = (".forces.csv", ".forces.parquet", ".forces.pq")
STOCK_SUFFIXES = (".stock.yaml", ".stock.yml", ".stock.npz")


@dataclass(frozen=True)
class Folders:
    """Where a batch writes. offsets, report: None where they are not wanted.

    >>> from pathlib import Path
    >>> compstiff.Folders(Path("corrected"), report=Path("reports")).offsets is None
    True
    """

    output: Path
    offsets: Path | None = None
    report: Path | None = None

    def make(self) -> None:
        """Makes those that are not there. Raises CompstiffError (CS0004)."""
        for folder in (self.output, self.offsets, self.report):
            if folder is None:
                continue
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as reason:
                raise error("CS0004", f"cannot be made: {reason.strerror}", file=str(folder),
                            hint="a folder was expected here: give another name") from reason


@dataclass(frozen=True)
class ProgramFiles:
    """One program of a batch and the files it is to become. logs: its force logs, of which there should be one. rival: another
    program of the batch that would write one of the same files, or has the same log. stocks: what it starts from, where forces
    are predicted; one at most."""

    program: Path
    logs: tuple[Path, ...]
    outputs: Outputs
    rival: Path | None = None
    stocks: tuple[Path, ...] = ()

    @property
    def own(self) -> tuple[Path, ...]:
        """The files that are read for this program alone."""
        return (self.program, *self.logs, *self.stocks)

    @property
    def stock(self) -> Path | None:
        """What it starts from. Raises CompstiffError (CS4736): several files."""
        if len(self.stocks) > 1:
            raise error("CS4736", f"has {len(self.stocks)} stock files: {', '.join(stock.name for stock in self.stocks)}",
                        file=str(self.program), hint="keep the one that says what the program starts from")
        return self.stocks[0] if self.stocks else None

    @property
    def forces(self) -> Path | None:
        """Its log, None where there is none. Raises CompstiffError: CS6001 several logs, CS6002 a rival."""
        if self.rival:
            raise error("CS6002", f"and {self.rival} have the same log or would become the same file", file=str(self.program),
                        hint="programs of one batch need names of their own")
        if len(self.logs) > 1:
            raise error("CS6001", f"has {len(self.logs)} force logs: {', '.join(log.name for log in self.logs)}",
                        file=str(self.program), hint="keep the one that was logged when this program was milled")
        return self.logs[0] if self.logs else None


def is_program(file: Path) -> bool:
    """Whether a file of a folder is a toolpath: by its suffix, neither hidden nor a force log."""
    name = file.name.lower()
    return (toolpath_suffix(file) in TOOLPATH_SUFFIXES and not name.startswith(".") and not name.endswith(LOG_SUFFIXES)
            and file.is_file())


def programs_in(folder: Path) -> list[Path]:
    """The toolpaths of a folder, by name; folders inside it are not looked into. Raises CompstiffError (CS0005)."""
    try:
        return sorted(path for path in folder.iterdir() if is_program(path))
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(folder)) from reason


def logs_of(program: Path, folder: Path | None = None) -> tuple[Path, ...]:
    """The force logs with the program's stem, beside it or in a folder."""
    place = folder or program.parent
    return tuple(log for suffix in LOG_SUFFIXES if (log := place / (toolpath_stem(program) + suffix)).is_file())


def stocks_of(program: Path) -> tuple[Path, ...]:
    """The stock files with the program's stem, beside it."""
    stem = toolpath_stem(program)
    return tuple(stock for suffix in STOCK_SUFFIXES if (stock := program.parent / (stem + suffix)).is_file())


def no_log(program: Path, folder: Path | None, then: str, predicted: bool = False, watched: bool = False) -> Finding:
    """What is said of a program without a log. folder: of the logs, None where each lies beside its program; then: what becomes
    of it; predicted: forces are predicted where there is a stock, and there is none; watched: logs lie nowhere else."""
    stem = toolpath_stem(program)
    stock = f", and no stock {stem}{STOCK_SUFFIXES[0]} (or .npz) beside it" if predicted else ""
    near = _nearly_its_log(program, folder or program.parent)
    return Finding("CS6000", "warning", f"has no force log {stem}{LOG_SUFFIXES[0]} (or .parquet) in "
                   f"{folder or program.parent}{stock}; {then}", file=str(program),
                   hint=(f"is it {near}? Then rename it, capitals too; else " if near else "") +
                   "log the forces of a first pass, " + (
                       "and put the log beside the program" if watched else "or name the folder of the logs with --forces"))


def _nearly_its_log(program: Path, folder: Path) -> str:
    """A table in the folder whose name begins as the program's, in whatever capitals, and as no longer name of a program beside
    it; "" for none."""
    stem = toolpath_stem(program).lower()
    try:
        names = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in TABLE_SUFFIXES)
        longer = tuple(other for path in programs_in(program.parent)
                       if (other := toolpath_stem(path).lower()).startswith(stem) and other != stem)
    except (OSError, CompstiffError):
        return ""
    return next((name for name in names if name.lower().startswith(stem) and "force" in name.lower()
                 and not name.lower().startswith(longer)), "")


def logs_without_program(folder: Path) -> list[Finding]:
    """A warning (CS6013) for each force log of a folder beside which no program has its stem."""
    stems = {toolpath_stem(program) for program in programs_in(folder)}
    logs = {log: suffix for log in sorted(folder.iterdir()) for suffix in LOG_SUFFIXES if log.name.endswith(suffix)}
    return [Finding("CS6013", "warning", f"is a force log, and no program {log.name.removesuffix(suffix)}.mod (or .apt) lies "
                    "beside it", file=str(log), hint="names must be equal, capitals too; a table of targets (CSV) is posted "
                    "first, and folders inside the folder are not looked into")
            for log, suffix in logs.items() if log.name.removesuffix(suffix) not in stems]


def paired(programs: Iterable[Path], logs: Path | None, folders: Folders, *, predicted: bool = False) -> list[ProgramFiles]:
    """The programs with their logs (beside each, or in the folder `logs`) and the files they are to become. Toolpaths that are
    not RAPID are written as RAPID. predicted: with their stocks too, which lie beside them.

    >>> from pathlib import Path
    >>> files = compstiff.paired([Path("insert.mod")], None, compstiff.Folders(Path(".")))
    >>> files[0].forces.name
    'insert.forces.parquet'
    """
    pairs = []
    owner: dict[str, Path] = {}
    rivals: dict[Path, Path] = {}
    for program in {os.path.realpath(path): path for path in programs}.values():
        rapid, stem = program.suffix.lower() in RAPID_SUFFIXES, toolpath_stem(program)
        outputs = Outputs(folders.output / (program.name if rapid else f"{stem}.mod"),
                          folders.offsets / f"{stem}.offsets.csv" if folders.offsets else None,
                          folders.report / f"{stem}.html" if folders.report else None)
        pairs.append(ProgramFiles(program, logs_of(program, logs), outputs, stocks=stocks_of(program) if predicted else ()))
        for path in (*outputs.files(), *pairs[-1].logs):
            other = owner.setdefault(os.path.realpath(path), program)
            if other is not program:
                rivals |= {program: other, other: program}
    return [replace(files, rival=rivals.get(files.program)) for files in pairs]


def share_of(programs: Iterable[ProgramFiles], shard: tuple[int, int]) -> list[ProgramFiles]:
    """Part K of N (1 to N) of the programs, by their content: the same whatever else lies in the folder, and no two parts share
    one. A program that cannot be read is in the first part, which says so."""
    part, of = shard

    def belongs(program: Path) -> int:
        try:
            return int(sha256(program)[:16], 16) % of
        except OSError:
            return 0

    return [files for files in programs if belongs(files.program) == part - 1]
