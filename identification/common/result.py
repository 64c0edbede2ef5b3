"""What every result of the chain offers, whichever room it comes from."""

from __future__ import annotations

from typing import Any, Protocol

from identification.common.findings import Finding


class Result(Protocol):
    """A frozen value. findings: what a user must know before trusting it."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """In the order in which they are shown."""
        ...

    def as_dict(self) -> dict[str, Any]:
        """JSON values: what `--json` shows."""
        ...

    def lines(self) -> list[str]:
        """What the terminal shows."""
        ...
