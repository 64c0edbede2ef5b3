"""Modules of one job as one program, for a log of the whole job; and such a program as its modules again, byte by byte.

A comment before each module names its file.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from compensator.posting.settings import PostingSettings
from compensator.posting.suffixes import RAPID_SUFFIXES
from compensator.rapid import JOINED, RapidProgram, read_rapid
from identification.common.files import check_distinct
from identification.common.findings import CompstiffError, Finding, counted, error

SUFFIXES = (*RAPID_SUFFIXES, ".pgf")
# What is said of any joined program.
_OF_JOB = ("CS2051",)
_MARKED = re.compile(rb"(?m)^! compstiff module: ([^\r\n]+)(\r?\n)")
_MODULE = re.compile(rb"(?im)^[ \t]*module[ \t]+([\w\x80-\xff]+)")
_MAIN = re.compile(rb"(?im)^[ \t]*(?:local[ \t]+)?proc[ \t]+main[ \t]*\(")


@dataclass(frozen=True, eq=False)
class JoinedModules:
    """files: what to write. sources: the modules' files, main: that with the routine main, else the first."""

    program: RapidProgram
    files: dict[Path, bytes]
    sources: tuple[Path, ...]
    main: Path
    findings: tuple[Finding, ...]

    def as_dict(self) -> dict[str, Any]:
        """The modules in their order, and how many targets they have together."""
        return {"targets": len(self.program.toolpath), "modules": [file.name for file in self.sources]}

    def lines(self) -> list[str]:
        """The modules in their order, and how many targets they have together."""
        return [f"joined: {', '.join(file.name for file in self.sources)}; {counted(len(self.program.toolpath), 'target')}, "
                "numbered in this order"]


def of_modules(files: Sequence[Path]) -> bool:
    """Whether a call of `post` is to join modules: several files, or a program file, of RAPID."""
    return files[0].suffix.lower() in SUFFIXES and (len(files) > 1 or files[0].suffix.lower() == ".pgf")


def join_files(files: Sequence[Path], output: Path, settings: PostingSettings) -> JoinedModules:
    """The modules of a job as one program; nothing is written. Raises CompstiffError: CS0003 (an output that is there:
    `write_whole`), CS0006 (output is an input), CS4350 (modules that cannot be joined, options for other toolpaths)."""
    sources = tuple(module for file in files for module in modules_of(file))
    check_distinct([*files, *sources], [output])
    if settings.split is not None or settings.mark:
        raise error("CS4350", "modules are joined as they are", hint="give --split and --mark where they are corrected")
    content = joined(sources)
    program = read_rapid(content, str(output))
    mains = [file for file in sources if _MAIN.search(file.read_bytes())]
    told = tuple(finding for finding in program.toolpath.findings if finding.code not in _OF_JOB)
    return JoinedModules(program, {output: content}, sources, mains[0] if mains else sources[0],
                         (*told, *said_of_joined(mains, sources)))


def modules_of(file: Path) -> list[Path]:
    """The modules that a program file (.pgf) lists, or a module itself. Raises CompstiffError: CS0005, CS4350."""
    if file.suffix.lower() != ".pgf":
        return [file]
    try:
        listed = [(node.text or "").strip() for node in ElementTree.fromstring(file.read_bytes()).iter("Module")]
    except OSError as reason:
        raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
    except ElementTree.ParseError as reason:
        raise error("CS4350", f"is no program file: {reason}", file=str(file), hint="a .pgf lists modules as "
                    "<Program><Module>main.mod</Module>...</Program>; or name the modules themselves") from reason
    if not listed:
        raise error("CS4350", "lists no module", file=str(file), hint="name the modules themselves")
    return [file.parent / name for name in listed]


def joined(files: Sequence[Path]) -> bytes:
    """The modules of these files as one program, one behind the other.

    Raises CompstiffError: CS0005, CS4350 (files that cannot be joined: not RAPID, of several names or encodings, or what is
    no module alone), and what `read_rapid` raises of each.
    """
    texts: list[bytes] = []
    names: dict[str, Path] = {}
    wide: dict[str, Path] = {}          # the first file of each encoding
    for file in files:
        if file.suffix.lower() not in RAPID_SUFFIXES:
            raise error("CS4350", f"'{file.suffix}' is no RAPID module", file=str(file), hint="modules are joined with "
                        "modules; another toolpath is posted by itself")
        other = names.setdefault(file.name.lower(), file)
        if other is not file:
            raise error("CS4350", f"has the name of {other}", file=str(file), hint="a module is joined once, and files of "
                        "one job have names of their own")
        try:
            data = file.read_bytes()
        except OSError as reason:
            raise error("CS0005", f"cannot be read: {reason.strerror}", file=str(file)) from reason
        program = read_rapid(data, str(file))
        modules = _MODULE.findall(data)
        if len(modules) != 1 or JOINED in data:
            raise error("CS4350", f"holds {counted(len(modules), 'module')}, expected one" if len(modules) != 1 else
                        "was joined already", file=str(file), hint="a controller loads one module a file")
        if not data.isascii():
            wide.setdefault(program.source.encoding, file)
        texts.append(data.removeprefix(codecs.BOM_UTF8))
    if len(wide) > 1:
        raise error("CS4350", f"is UTF-8, and {wide['latin-1']} is Latin-1", file=str(wide["utf-8"]),
                    hint="save all in one encoding")
    return b"".join(_marked(file.name, text) for file, text in zip(files, texts, strict=True))


def _marked(name: str, text: bytes) -> bytes:
    """One module with its name before it."""
    eol = b"\r\n" if b"\r\n" in text else b"\n"
    end = b"" if text.endswith((b"\n", b"\r")) else eol
    return JOINED + name.encode() + eol + text + end


def separate(content: bytes, output: Path) -> dict[Path, bytes]:
    """A program of several modules as a file for each, that of the routine main first and under the name `output`; the others
    beside it, under the names of the files that they were joined from, or of the modules. Raises CompstiffError (CS4351)."""
    marked = list(_MARKED.finditer(content))
    if marked:
        bounds = [match.start() for match in marked] + [len(content)]
        pieces = [(match[1].decode(), content[match.end():stop])
                  for match, stop in zip(marked, bounds[1:], strict=True)]
    else:
        found = list(_MODULE.finditer(content))
        bounds = [0, *(match.start() for match in found[1:]), len(content)]
        pieces = [(match[1].decode("latin-1") + output.suffix, content[start:stop])
                  for match, start, stop in zip(found, bounds[:-1], bounds[1:], strict=True)]
    if len(pieces) < 2:
        raise error("CS4351", "--modules writes each module in a file of its own, and the program is one module",
                    file=str(output), hint="leave the option out; `compstiff post CELL MAIN.mod OTHER.mod ... -o job.mod` "
                    "joins the modules of a job")
    first = next((k for k, (_, text) in enumerate(pieces) if _MAIN.search(text)), 0)
    files = {output: pieces[first][1]}
    for k, (name, text) in enumerate(pieces):
        file = output.with_name(Path(name).name)
        if k != first and file in files:
            raise error("CS4351", f"would be written twice: the module {name} and "
                        f"{'the one with main' if file == output else 'another of its name'}", file=str(file),
                        hint="name the output as the file of the module with main")
        if k != first:
            files[file] = text
    return files


def in_modules(findings: Iterable[Finding], program: Path) -> tuple[Finding, ...]:
    """The findings, those on a line of a program of joined modules with the module's own file and line."""
    if program.suffix.lower() not in RAPID_SUFFIXES or not program.is_file():
        return tuple(findings)
    content = program.read_bytes()
    names = [(content.count(b"\n", 0, match.start()) + 1, match[1].decode("utf-8", "replace"))
             for match in _MARKED.finditer(content)]

    def own(finding: Finding) -> Finding:
        if finding.file != str(program) or finding.line is None:
            return finding
        first, name = next(((line, name) for line, name in reversed(names) if line < finding.line), (0, str(program)))
        return replace(finding, file=name, line=finding.line - first)

    return tuple(map(own, findings))


@contextmanager
def told_in_modules(program: Path) -> Iterator[None]:
    """What is raised here has the places of `in_modules`."""
    try:
        yield
    except CompstiffError as stopped:
        raise type(stopped)(*in_modules(stopped.findings, program)) from stopped


def said_of_joined(mains: Sequence[Path], files: Sequence[Path]) -> list[Finding]:
    """What is said of a job: a warning (CS4352) where no module has the routine main, or several have. mains: those of the
    files that have it."""
    if len(mains) == 1:
        return []
    return [Finding("CS4352", "warning", "no module has the routine main: which routine is driven first, and in which order, "
                    "cannot be told" if not mains else f"{' and '.join(file.name for file in mains)} have a routine main each: "
                    "a task has one", str((mains or files)[-1]), hint="join all modules of the task, and no others")]
