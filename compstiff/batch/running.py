"""The programs of a batch, one after the other, in processes, or on a cluster: in their order, whatever becomes of each."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from compstiff.batch.pairing import ProgramFiles
from compstiff.batch.programs import ProgramResult, Shared, correct_as_new, correct_program
from compstiff.outcome import DEFECT, Outcome
from identification.common.findings import Finding


def correct_programs(
    programs: Iterable[ProgramFiles], shared: Shared, *, processes: int = 1, scheduler: str | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Iterator[ProgramResult]:
    """Corrects the programs (`paired`), in their order: each by itself, one that fails does not stop the others. Once
    `stopped`, those under way are finished and no further one is begun.

    processes: so many at a time. scheduler: on the workers of that Dask scheduler instead (docs/cluster.md).
    Raises CompstiffError: CS6040 to CS6046 the cluster.

    >>> from pathlib import Path
    >>> folders = compstiff.Folders(Path("corrected"))
    >>> folders.make()
    >>> shared = compstiff.Shared(Path("cell.yaml"), Path("stiffness.json"), compstiff.Settings.of(tare=((0, 2),)))
    >>> [result.status for result in compstiff.correct_programs(compstiff.paired([Path("insert.mod")], None, folders), shared)]
    ['ok']
    """
    left = deque(programs)
    if scheduler is not None:
        from compstiff.batch.cluster import on_cluster  # Dask only where it is asked for

        done = on_cluster(left, shared, scheduler, stopped)
    elif processes > 1 and len(left) > 1:
        from compstiff.batch.processes import in_processes

        done = in_processes(left, partial(correct_as_new, shared), processes, stopped)
    else:
        done = ((files, correct_program(files, shared)) for files in _until(left, stopped))
    for files, result in done:
        yield result if result is not None else _lost(files, shared)


def _until(left: deque[ProgramFiles], stopped: Callable[[], bool]) -> Iterator[ProgramFiles]:
    while left and not stopped():
        yield left.popleft()


def _lost(files: ProgramFiles, shared: Shared) -> ProgramResult:
    finding = Finding("CS6010", "error", "the process that worked on a program of this batch ended by itself, "
                      "when it was tried once more too", file=str(files.program),
                      hint="memory may have run out: try this program by itself, or split it")
    return ProgramResult.of(files, shared, Outcome(findings=(finding,)), "defect", DEFECT)
