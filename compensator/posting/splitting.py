"""A large program as a main module that calls parts, split only where the tool is in the air."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compensator.posting.module_text import module_name
from compensator.rapid import ARGUMENTS, INLINE, UNIT, RapidProgram, read_rapid
from identification.common.findings import Finding, counted, error

_HINT = "post the toolpath as one procedure of moves, without LOCAL data, loops, branches and routines, or do not split it"
_BLANK = b" \t"
_END = b"  ENDPROC"


@dataclass(frozen=True)
class Split:
    """main: the module that calls the parts. parts: file name -> bytes, in order; empty where the program fits in one.
    sizes: targets of each."""

    main: bytes
    parts: dict[str, bytes]
    sizes: tuple[int, ...]
    findings: tuple[Finding, ...]


class _MoveStatement(NamedTuple):
    """Where a move statement of the plain procedure starts and ends in the text, and how many targets stand before it."""

    start: int
    end: int
    targets_before: int


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
    moves = _moves(program)
    cuts, findings = _cuts(program, moves, air, most, output)
    data, source = content, program.source
    edges = [_line_start(data, moves[0].start), *(_behind(data, moves[cut - 1].end) for cut in cuts),
             _behind(data, moves[-1].end)]
    eol = b"\r\n" if b"\r\n" in data else b"\n"
    head = data[:source.start] + _header(data, source.start, eol)
    base = module_name(output.stem)[:22]
    parts, calls = {}, []
    for number, (start, end) in enumerate(pairwise(edges), 1):
        name, file = f"{base}_{number:03d}", f"{output.stem}_{number:03d}{output.suffix}"
        _check_free(program, name)
        parts[file] = head + _part(name.encode(), data[start:end], eol)
        calls += _calls(name, file, load)
    main = data[:edges[0]] + b"".join(b"    " + call.encode() + eol for call in calls) + data[edges[-1]:]
    bounds = [0, *(moves[cut].targets_before for cut in cuts), count]
    split = Split(main, parts, tuple(b - a for a, b in pairwise(bounds)), findings)
    together = data[:edges[0]] + b"".join(map(_moves_of, parts.values())) + data[edges[-1]:]
    _read_back(program, split, together, output)
    return split


def _part(name: bytes, body: bytes, eol: bytes) -> bytes:
    """The module of a part: a procedure of these moves."""
    closed = b"" if body.endswith((b"\n", b"\r")) else eol
    return b"".join((b"MODULE ", name, eol, b"  PROC ", name, b"_moves()", eol, body, closed, _END, eol, b"ENDMODULE", eol))


def _moves_of(part: bytes) -> bytes:
    """What stands in the procedure of a part."""
    begin = part.index(b"_moves()") + len(b"_moves()")
    return part[begin:part.rindex(_END)]


def _calls(name: str, file: str, load: bool) -> list[str]:
    if not load:
        return [f"{name}_moves;"]
    # A module must not be unloaded while the robot still moves along it, and a part may end in a fly-by point.
    return [f'Load \\Dynamic,"HOME:/{file}";', f'%"{name}_moves"%;', "WaitRob \\InPos;", f'UnLoad "HOME:/{file}";']


def _moves(program: RapidProgram) -> list[_MoveStatement]:
    """The moves of the one procedure. Raises CompstiffError (CS4310) where the program is anything else."""
    source, data = program.source, program.source.data
    moves: list[_MoveStatement] = []
    modules = routines = targets = 0
    inside = False
    for match in UNIT.finditer(data, source.start):
        kind = (match.lastgroup or "u_end")[2:]
        if kind == "end":
            break
        start, end = match.span(match.lastgroup or "u_end")
        modules += kind == "module"
        routines += kind == "routine"
        inside = kind == "routine" or (inside and kind != "endroutine")
        odd = "a second module or routine" if modules > 1 or routines > 1 else _odd(kind, data[start:end], inside)
        if odd:
            raise source.fail("CS4310", f"found {odd}; only one plain procedure of moves can be split", start, _HINT)
        instruction = source.fold(data[start:end].lower().split()[0].split(b"[")[0])
        if kind == "inline":
            inline = [match.span() for match in INLINE.finditer(data, start, end)]
            moves += [_MoveStatement(*span, targets + number) for number, span in enumerate(inline)]
            targets += len(inline)
        elif kind == "named" or (kind == "statement" and instruction in ARGUMENTS):
            moves.append(_MoveStatement(start, end, targets))
            targets += 2 if instruction in ("movec", "movecdo") else 1
    if not modules or targets != len(program.toolpath):
        raise source.fail("CS4310", "found no MODULE round the moves, or moves in other statements; only one plain procedure "
                          "of moves can be split", source.start, _HINT)
    return moves


def _odd(kind: str, text: bytes, inside: bool) -> str:
    """What a unit is that one plain procedure does not have, "" where it may stand there; inside: it is in the procedure."""
    if kind in ("word", "condition", "label", "record", "placeholder", "bad"):
        return "a loop, a branch, a label or a record"
    words = text.lower().split()
    first = words[0].rstrip(b";")
    if kind == "routine":
        plain = b"proc" in words[:1 + (words[0] == b"local")] and b"".join(words).endswith(b"()")
        return "" if plain else "a function, a trap or parameters"
    if kind != "endroutine" and words[0] == b"local":
        return "LOCAL data, which the parts could not see"
    if inside and (kind == "target" or words[0] in (b"const", b"pers", b"var")):
        return "data of the procedure, which the parts could not see"
    if inside and first in (b"return", b"goto", b"exitcycle", b"raise", b"retry", b"trynext"):
        return f"{first.decode().upper()}, which would leave the part only"
    return ""


def _cuts(
    program: RapidProgram, moves: list[_MoveStatement], air: NDArray[np.bool_], most: int, output: Path
) -> tuple[list[int], tuple[Finding, ...]]:
    """Numbers of the moves that begin a part, each behind a target in the air, as late as `most` allows."""
    first = np.array([move.targets_before for move in moves])
    allowed = np.flatnonzero(np.concatenate([[False], air[first[1:] - 1]]))
    if not len(allowed):
        raise error("CS4312", f"no target in the air to split at: the {len(air)} targets are one cut", file=str(output),
                    hint="a program is split at rapid moves (RAPID, a column rapid) or at targets without force")
    cuts: list[int] = []
    begin = 0
    while len(air) - begin > most:
        later = allowed[first[allowed] > begin]
        if not len(later):
            break
        fitting = later[first[later] <= begin + most]
        cuts.append(int(fitting[-1] if len(fitting) else later[0]))
        begin = int(first[cuts[-1]])
    bounds = np.array([0, *first[cuts], len(air)])
    longest = int(np.argmax(np.diff(bounds)))
    size, target = int(np.diff(bounds)[longest]), int(bounds[longest])
    if size <= most:
        return cuts, ()
    return cuts, (Finding(
        "CS4311", "warning", f"a cut is longer than a part shall be: {size} targets in one part, {most} asked for; "
        "nothing is split inside a cut", str(output), int(program.toolpath.line[target]), target=target,
        hint="lift the tool in the CAM system, or allow larger parts"),)


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
    taken = {declaration.name for declaration in program.scan.names.declarations} | set(program.scan.routines)
    text = program.source.data.lower()
    for needed in (name.lower(), f"{name.lower()}_moves"):
        if needed in taken or f"module {needed}".encode() in text:
            raise error("CS4310", f"the program has the name {needed} already, a part would need it", file=program.source.name,
                        hint="give the output another file name")


def _read_back(program: RapidProgram, split: Split, together: bytes, output: Path) -> None:
    """Raises CompstiffError (CS4313) where the parts do not say what the program said: each by itself as many moves, of the
    same kinds; `together`, the moves of all of them where the program's stood, whatever it said, since the data that they
    name stand in the main module."""
    alone = [read_rapid(part, output.name).toolpath for part in split.parts.values()]
    again, own = read_rapid(together, output.name).toolpath, program.toolpath
    good = len(read_rapid(split.main, output.name).toolpath) == 0 and len(again) == len(own)
    good &= tuple(map(len, alone)) == split.sizes and np.array_equal(np.concatenate([part.move for part in alone]), own.move)
    for column in ("move", "position", "quaternion", "confdata", "external", "joints"):
        read, meant = getattr(again, column), getattr(own, column)
        good = good and np.array_equal(read, meant, equal_nan=meant.dtype.kind == "f")
    if not good:
        raise error("CS4313", "the parts do not read back as the program; nothing was written", file=str(output),
                    hint="a defect in compstiff: please report it with this program")
