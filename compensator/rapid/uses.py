"""What the statements that are not moves do with names: read them, assign to them, hand them to routines.

A target, tool or work object that changes while the program runs must not be corrected from its initial value, and
one that is read elsewhere must not be changed in place.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from compensator.rapid.lexer import OPERATORS, Token
from compensator.rapid.scopes import Scope


class Argument(NamedTuple):
    """`name` handed to `routine`: slot is the position among its arguments, or the name of an optional one."""

    routine: str
    slot: int | str
    name: str
    scope: Scope


@dataclass(slots=True)
class Uses:
    """Each use once, however often it stands in the text."""

    read: set[tuple[str, Scope]] = field(default_factory=set)
    assigned: set[tuple[str, Scope]] = field(default_factory=set)
    handed: set[Argument] = field(default_factory=set)

    def assignment(self, tokens: list[Token], scope: Scope) -> bool:
        """Logs `name:=...`, `name.part:=...`, `name{i}:=...`; False if the statement is something else."""
        at, depth = 1, 0
        while depth or tokens[at].word in (".", "{") or tokens[at - 1].word == ".":
            if tokens[at].kind == "end":
                return False
            depth += (tokens[at].word == "{") - (tokens[at].word == "}")
            at += 1
        if tokens[at].word != ":=":
            return False
        if tokens[2].word != "tload":                   # the load of a tool does not move its TCP
            self.assigned.add((tokens[0].word, scope))
        self.reads(tokens[1:], scope)
        return True

    def reads(self, tokens: list[Token], scope: Scope, routine: str = "") -> None:
        """Logs every name in an expression, or in the arguments of a call of `routine`."""
        frames = [_Frame(routine)]
        before = Token("mark", 0, 0, b"(", "(")
        for token, after in zip(tokens, [*tokens[1:], tokens[-1]], strict=True):
            frame = frames[-1]
            if token.kind == "name" and token.word not in OPERATORS and before.word != ".":
                if before.word == "\\":
                    frame.option = token.word
                elif after.word == "(":
                    frames.append(_Frame(token.word, waiting=True))
                else:
                    if frame.routine != "dim":          # which asks for no value
                        self.read.add((token.word, scope))
                    if frame.routine and before.word in ("(", ",", ":=", "?"):
                        slot = frame.option or frame.index
                        self.handed.add(Argument(frame.routine, slot, token.word, scope))
                    frame.filled = frame.filled or not frame.option
            elif token.word == "(":
                if frame.waiting:
                    frame.waiting = False
                else:
                    frames.append(_Frame(""))
            elif token.word in ("[", "{"):
                frames.append(_Frame(""))
            elif token.word in (")", "]", "}"):
                if len(frames) > 1:
                    frames.pop()
                frames[-1].filled = frames[-1].filled or not frames[-1].option
            elif token.word == "," and token.kind == "mark":
                frame.index += frame.filled
                frame.filled, frame.option = False, ""
            elif token.kind in ("number", "string"):
                frame.filled = frame.filled or not frame.option
            before = token


@dataclass(slots=True)
class _Frame:
    """One open bracket: which routine's arguments stand in it ("": no routine's), and how far they are."""

    routine: str
    waiting: bool = False       # its "(" is still to come
    index: int = 0
    option: str = ""
    filled: bool = False        # the positional argument at `index` has begun
