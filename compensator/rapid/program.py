"""What reading a program gives: its toolpath, and what is needed to write it again."""

from __future__ import annotations

from dataclasses import dataclass

from compensator.rapid.rows import Rows
from compensator.rapid.runs import Runs
from compensator.rapid.scan import Scan
from compensator.rapid.text import Source
from compensator.rapid.values import Values
from compensator.toolpath import Toolpath


@dataclass(frozen=True, slots=True)
class RapidProgram:
    """A RAPID program as read by `read_rapid`. runs: how it drives its targets. All but it and `toolpath` is for `rewrite`."""

    toolpath: Toolpath
    source: Source
    scan: Scan
    values: Values
    rows: Rows
    runs: Runs
