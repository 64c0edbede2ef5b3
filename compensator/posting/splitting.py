"""A large program as a main module that calls parts, split only where the tool is in the air."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from compensator.posting.post import module_name
from compensator.rapid import RapidProgram, read_rapid
from compensator.rapid.moves import ARGUMENTS
from compensator.rapid.statements import UNIT
from identification.common.findings import Finding, counted, error

_HINT = "post the toolpath as one procedure of moves, without LOCAL data, loops, branches and routines, or do not split it"
_BLANK = b" \t"


@dataclass(frozen=True)
class Split:
    """main: the module that calls the parts. parts: file name -> bytes, in order; empty where the program fits in one.
    sizes: targets of each."""

    main: bytes
    parts: dict[str, bytes]
    sizes: tuple[int, ...]
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class _Moves:
    """The plain procedure: start and end of each move statement, its targets before it, and where the body lies."""

    start: list[int]
    end: list[int]
    first: list[int]


def split_program(content: bytes, air: NDArray[np.bool_], most: int, output: Path, *, load: bool = False) -> Split:
    """Splits a program into parts of at most `most` targets. air (N,): at these targets the tool cuts nothing.

    A part ends at a target in the air and holds every byte of its moves, and of what stands between them. load: parts are
    loaded and unloaded one after the other (`Load \\Dynamic`), else all are loaded beside the main module. Raises
    CompstiffError: CS4310 (not one plain procedure), CS4312 (no target in the air to split at), CS4313 (does not read back).
    """
    program = read_rapid(content, output.name)
    count = len(program.toolpath)
    if count <= most:
        note = Finding("CS4312", "note", f"not split: its {counted(count, 'target')} fit into one part of {most}", str(output))
        return Split(content, {}, (count,), (note,))
    moves = _plain(program)
    cuts, findings = _cuts(program, moves, air, most, output)
    data, source = content, program.source
    edges = [_line_start(data, moves.start[0]), *(_behind(data, moves.end[cut - 1]) for cut in cuts),
             _behind(data, moves.end[-1])]
    eol = b"\r\n" if b"\r\n" in data else b"\n"
    head = data[:source.start] + _header(data, source.start, eol)
    base = module_name(output.stem)[:22]
    parts, calls = {}, []
    for number, (start, end) in enumerate(pairwise(edges), 1):
        name, file = f"{base}_{number:03d}", f"{output.stem}_{number:03d}{output.suffix}"
        _check_free(program, name)
        body = data[start:end]
        closed = b"" if body.endswith((b"\n", b"\r")) else eol
        parts[file] = b"".join((head, b"MODULE ", name.encode(), eol, b"  PROC ", name.encode(), b"_moves()", eol, body, closed,
                                b"  ENDPROC", eol, b"ENDMODULE", eol))
        calls += _calls(name, file, load)
    main = data[:edges[0]] + b"".join(b"    " + call.encode() + eol for call in calls) + data[edges[-1]:]
    bounds = [0, *(moves.first[cut] for cut in cuts), count]
    _read_back(program, main, list(parts.values()), output)
    return Split(main, parts, tuple(int(b - a) for a, b in pairwise(bounds)), tuple(findings))


def _calls(name: str, file: str, load: bool) -> list[str]:
    if not load:
        return [f"{name}_moves;"]
    # A module must not be unloaded while the robot still moves along it, and a part may end in a fly-by point.
    return [f'Load \\Dynamic,"HOME:/{file}";', f'%"{name}_moves"%;', "WaitRob \\InPos;", f'UnLoad "HOME:/{file}";']


def _plain(program: RapidProgram) -> _Moves:
    """The moves of the one procedure. Raises CompstiffError (CS4310) where the program is anything else."""
    source, data = program.source, program.source.data
    moves = _Moves([], [], [])
    modules = routines = target = 0
    inside = False
    for match in UNIT.finditer(data, source.start):
        kind = (match.lastgroup or "u_end")[2:]
        if kind == "end":
            break
        start, end = match.span(match.lastgroup or "u_end")
        modules += kind == "module"
        routines += kind == "routine"
        words = data[start:end].lower().split()
        odd = ""
        if kind == "routine":
            inside = True
            odd = "" if words[0] == b"proc" and data[start:end].rstrip().endswith(b"()") else "a function, a trap or parameters"
        elif kind == "endroutine":
            inside = False
        elif kind in ("word", "condition", "label", "record", "placeholder", "bad"):
            odd = "a loop, a branch, a label or a record"
        elif words[0] == b"local":
            odd = "LOCAL data, which the parts could not see"
        elif inside and (kind == "target" or words[0] in (b"const", b"pers", b"var")):
            odd = "data of the procedure, which the parts could not see"
        elif inside and (words[0].rstrip(b";") in (b"return", b"goto", b"exitcycle", b"raise", b"retry", b"trynext")):
            odd = f"{words[0].rstrip(b';').decode().upper()}, which would leave the part only"
        if modules > 1 or routines > 1:
            odd = "a second module or routine"
        if odd:
            raise source.fail("CS4310", f"found {odd}; only one plain procedure of moves can be split", start, _HINT)
        first = source.fold(words[0].split(b"[")[0])
        if kind in ("inline", "named") or (kind == "statement" and first in ARGUMENTS):
            moves.start.append(start)
            moves.end.append(end)
            moves.first.append(target)
            target += 2 if first == "movec" else 1
    if not modules or target != len(program.toolpath):
        raise source.fail("CS4310", "found no MODULE round the moves, or moves in other statements; only one plain procedure "
                          "of moves can be split", source.start, _HINT)
    return moves


def _cuts(
    program: RapidProgram, moves: _Moves, air: NDArray[np.bool_], most: int, output: Path
) -> tuple[list[int], list[Finding]]:
    """Numbers of the moves that begin a part, each behind a target in the air, as late as `most` allows."""
    first = np.array(moves.first)
    allowed = np.flatnonzero(np.concatenate([[False], air[first[1:] - 1]]))
    if not len(allowed):
        raise error("CS4312", f"no target in the air to split at: the {len(air)} targets are one cut", file=str(output),
                    hint="a program is split at rapid moves (RAPID, a column rapid) or at targets without force")
    cuts: list[int] = []
    longest, at = 0, 0
    begin = 0
    while len(air) - begin > most:
        later = allowed[first[allowed] > begin]
        if not len(later):
            break
        fitting = later[first[later] <= begin + most]
        cut = int(fitting[-1] if len(fitting) else later[0])
        if first[cut] - begin > max(most, longest):
            longest, at = int(first[cut] - begin), begin
        cuts.append(cut)
        begin = int(first[cut])
    if len(air) - begin > max(most, longest):
        longest, at = len(air) - begin, begin
    findings = []
    if longest > most:
        findings.append(Finding(
            "CS4311", "warning", f"a cut is longer than a part shall be: {longest} targets in one part, {most} asked for; "
            "nothing is split inside a cut", str(output), int(program.toolpath.line[at]), target=at,
            hint="lift the tool in the CAM system, or allow larger parts"))
    return cuts, findings


def _line_start(data: bytes, at: int) -> int:
    """Where the line begins if only blanks stand before `at`, else `at`."""
    begin = at
    while begin and data[begin - 1:begin] in (b" ", b"\t"):
        begin -= 1
    return begin if not begin or data[begin - 1:begin] in (b"\n", b"\r") else at


def _behind(data: bytes, at: int) -> int:
    """Behind the end of the line if nothing but blanks and a comment follow, else `at`."""
    end = at
    while end < len(data) and data[end:end + 1] not in (b"\n", b"\r"):
        end += 1
    rest = data[at:end].strip(_BLANK)
    if rest and not rest.startswith(b"!"):
        return at
    while end < len(data) and data[end:end + 1] == b"\r":
        end += 1
    return end + (data[end:end + 1] == b"\n")


def _header(data: bytes, start: int, eol: bytes) -> bytes:
    """The %%% block on top, which every module of RobotWare 5 and 6 has."""
    text = data[start:].lstrip()
    if not text.startswith(b"%%%"):
        return b""
    return text[:text.index(b"%%%", 3) + 3] + eol


def _check_free(program: RapidProgram, name: str) -> None:
    names = {declaration.name for declaration in program.scan.names.declarations} | set(program.scan.routines)
    text = program.source.data.lower()
    for word in (name.lower(), f"{name.lower()}_moves"):
        if word in names or f"module {word}".encode() in text:
            raise error("CS4310", f"the program has the name {word} already, a part would need it", file=program.source.name,
                        hint="give the output another file name")


def _read_back(program: RapidProgram, main: bytes, parts: list[bytes], output: Path) -> None:
    """Raises CompstiffError (CS4313) where the parts together do not say what the program said."""
    read = [read_rapid(part, output.name).toolpath for part in parts]
    good = len(read_rapid(main, output.name).toolpath) == 0
    # Named targets stand in the main module, so a part alone does not have their numbers.
    named = any(declaration.type in ("robtarget", "jointtarget") for declaration in program.scan.names.declarations)
    columns = ("move",) if named else ("move", "position", "quaternion", "confdata", "external", "joints")
    for column in columns:
        whole = np.concatenate([getattr(one, column) for one in read])
        good &= np.array_equal(whole, getattr(program.toolpath, column), equal_nan=whole.dtype.kind == "f")
    if not good:
        raise error("CS4313", "the parts do not read back as the program; nothing was written", file=str(output),
                    hint="a defect in compstiff: please report it with this program")
