"""Ctrl-C, SIGTERM and, on Windows, Ctrl-Break, for commands that end in their own time."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator

# Windows sends SIGBREAK for Ctrl-Break, and to a service or a task that is told to end.
ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))


@contextlib.contextmanager
def ending_signals() -> Iterator[list[int]]:
    """The signals that ask to end, as they come: the program under way is finished, no further one begun. The second one ends
    the program under way, too: nothing of it is written."""
    received: list[int] = []

    def note(number: int) -> None:
        received.append(number)
        for each in ENDING:
            signal.signal(each, signal.default_int_handler if each == signal.SIGINT else signal.SIG_DFL)

    with noted(note):
        yield received


@contextlib.contextmanager
def noted(note: Callable[[int], object]) -> Iterator[None]:
    """Calls `note` with each signal that asks to end, between two instructions of the main thread."""
    before = {number: signal.signal(number, lambda number, frame: note(number)) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
