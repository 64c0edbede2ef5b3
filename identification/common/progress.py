"""Progress of long work on stderr: only where a person watches, and only when it takes over a second."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar

# Set by the console for the time of a command whose stderr is a terminal; library code by itself is silent.
shown: ContextVar[bool] = ContextVar("progress_shown", default=False)
PATIENCE = 1.0


class Progress:
    """Counts what is done; shows itself once a second has passed."""

    def __init__(self, what: str, total: float) -> None:
        self._what, self._total = what, total
        self._begun, self._done = time.monotonic(), 0.0
        self._stack = contextlib.ExitStack()
        self._advance: Callable[[float], None] | None = None if shown.get() else (lambda done: None)

    def add(self, amount: float) -> None:
        """So much more is done."""
        self._done += amount
        if self._advance is None and time.monotonic() - self._begun > PATIENCE:
            self._advance = self._show()
        if self._advance is not None:
            self._advance(self._done)

    def _show(self) -> Callable[[float], None]:
        from rich.console import Console
        from rich.progress import Progress as Bar

        bar = self._stack.enter_context(Bar(console=Console(stderr=True), transient=True))
        task = bar.add_task(self._what, total=self._total)
        return lambda done: bar.update(task, completed=min(done, self._total))

    def close(self) -> None:
        """Takes the bar off the screen."""
        self._stack.close()


@contextlib.contextmanager
def progress(what: str, total: float) -> Iterator[Progress]:
    """`with progress("reading", rows) as bar: bar.add(n)`."""
    bar = Progress(what, total)
    try:
        yield bar
    finally:
        bar.close()
