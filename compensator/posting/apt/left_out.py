"""What of an APT file is not in the posted program: every word that was passed over is counted and told."""

from __future__ import annotations

from collections import Counter

from compensator.posting.apt.statements import Statement
from identification.common.findings import Finding, counted


class LeftOut:
    """Counts while the file is read."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.behind = 0                                     # statements behind FINI
        self.other_tools = 0                                # moves of tools that were not asked for
        self._first: dict[str, Statement] = {}              # where a word stood first
        self._ignored: Counter[str] = Counter()
        self._unknown: Counter[str] = Counter()
        self._commands = 0

    def ignored(self, statement: Statement) -> None:
        """A word on which nothing of the path depends."""
        self._ignored[statement.word] += 1
        self._first.setdefault("ignored", statement)

    def unknown(self, statement: Statement) -> None:
        """A word without a rule that, by its name, does not move the tool."""
        self._unknown[statement.word] += 1
        self._first.setdefault(statement.word, statement)

    def command(self, statement: Statement) -> None:
        """A word that would have done something on the machine, kept as a comment."""
        self._commands += 1
        self._first.setdefault("commands", statement)

    def findings(self, tool: str | None) -> list[Finding]:
        """All of it. tool: the one that was asked for."""
        findings = []
        if self._commands:
            first = self._first["commands"]
            findings.append(Finding(
                "CS2111", "warning", f"{counted(self._commands, 'machine command')} (from {first.spelled()} on) are comments "
                "in the program: your outputs are not known here", self.file, *first.place(),
                hint="switch spindle and coolant in your own program round this one"))
        for word, number in self._unknown.items():
            findings.append(Finding("CS2104", "warning", f"{word} is not known and was left out", self.file,
                                    *self._first[word].place(), count=number))
        if self._ignored:
            told = ", ".join(f"{word} ({number})" for word, number in sorted(self._ignored.items()))
            findings.append(Finding("CS2180", "note", f"left out, for no point of the path depends on it: {told}", self.file,
                                    *self._first["ignored"].place()))
        if self.other_tools:
            findings.append(Finding("CS2181", "note", f"{counted(self.other_tools, 'motion')} of other tools than {tool} left "
                                    "out; from one stretch of this tool to the next it goes straight", self.file))
        if self.behind:
            findings.append(Finding("CS2114", "warning", f"{counted(self.behind, 'statement')} behind FINI left out",
                                    self.file))
        return findings
