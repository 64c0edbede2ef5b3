"""The units of a program that are not one of the common forms: structure, declarations, calls, unusual moves."""

from __future__ import annotations

from itertools import pairwise

from compensator.rapid.blocks import JUMPS, Routine, Step
from compensator.rapid.expressions import Cursor
from compensator.rapid.lexer import OPERATORS, Token, ends_operand, tokens
from compensator.rapid.moves import (
    ARGUMENTS,
    AXIS_OFFSET,
    DISPLACEMENT,
    OVERRIDE,
    SOFT_SERVO,
    SWITCHES,
    UNIT_SWITCH,
    parse_move,
)
from compensator.rapid.runtime import HARMLESS, MOTION, Parameter
from compensator.rapid.scan import Scan
from compensator.rapid.scopes import Declaration, Scope
from compensator.toolpath import Move
from identification.common.findings import CompstiffError

_CLASSES = ("const", "pers", "var")
_ROUTINES = ("proc", "func", "trap")
_MODES = ("var", "pers", "inout", "in")
# Words no statement contains: where one turns up, the semicolon before it is missing.
_FOREIGN = frozenset((
    "endproc", "endfunc", "endtrap", "endmodule", "endif", "endfor", "endwhile", "endtest", "proc", "module",
    "movel", "movej", "movec", "moveabsj", "moveldo", "movejdo", "movecdo",
))
# What begins the part of a routine that is not driven as long as nothing goes wrong.
_HANDLERS = ("error", "undo", "backward")
_MOVES = {"movel": Move.LINEAR, "movej": Move.JOINT, "moveabsj": Move.ABSOLUTE, "moveldo": Move.LINEAR, "movejdo": Move.JOINT}


class Statements:
    """Takes units one after the other and enters what they say into a `Scan`."""

    def __init__(self, scan: Scan) -> None:
        self.scan = scan
        self.module = 0
        self.routine = -1
        self.open_module = -1           # where the module, the routine begins that has not ended yet
        self.open_routine = -1

    def unit(self, kind: str, start: int, end: int) -> None:
        if kind in ("module", "endmodule"):
            self._routine_ends()
            if kind == "module":
                self.module_ends()
                self.open_module = start
                self.scan.modules.append(start)
            else:
                self.open_module = -1
            self.module += 1                    # text behind ENDMODULE: a nameless module of its own
            self.scan.enter(Scope(self.module, -1))
        elif kind == "routine":
            self._routine_ends()
            self.routine += 1
            self.open_routine = start
            self.scan.enter(Scope(self.module, self.routine))
            self._parameters(tokens(self.scan.source, start, end))
        elif kind == "endroutine":
            self.open_routine = -1
            self.scan.enter(Scope(self.module, -1))
        elif kind == "condition":
            words = tokens(self.scan.source, start, end)
            self.scan.uses.reads(words[1:], self.scan.scope)
            if words[0].word == "for":      # its variable hides data of that name
                self.scan.uses.assigned.add((words[1].word, self.scan.scope))
            self._step(words[0].word, "", start, end)
        elif kind == "word":
            word = tokens(self.scan.source, start, end)[0].word
            self._step("handler" if word in _HANDLERS else word, "", start, end)
        elif kind == "label":
            word = tokens(self.scan.source, start, end)[0].word
            self._step("default" if word == "default" else "label", word, start, end)
        elif kind == "statement":
            self._statement(tokens(self.scan.source, start, end))

    def module_ends(self) -> None:
        """Raises CS2050 for a module that another one, or the end of the file, ends in place of its ENDMODULE."""
        if self.open_module >= 0:
            raise self._without_end(self.open_module, "ENDMODULE")

    def _routine_ends(self) -> None:
        """Raises CS2050 for a routine of a module that another one, or the module's end, ends in place of its ENDPROC."""
        if self.open_routine >= 0 and self.open_module >= 0:
            raise self._without_end(self.open_routine, "ENDPROC (ENDFUNC, ENDTRAP)")

    def _without_end(self, start: int, word: str) -> CompstiffError:
        source = self.scan.source
        line = source.text(start, start + 60).split("\n")[0].strip()
        return source.fail("CS2050", f"'{line}' begins here and has no {word}", start,
                           "the file may have been cut off, or is still being written; no controller loads it: write it again")

    def _parameters(self, words: list[Token]) -> None:
        """`PROC name(type a, \\switch b | PERS tooldata c, ...)`: every parameter is data of the routine."""
        at = next((i for i, word in enumerate(words) if word.word == "("), len(words) - 1)
        name = words[at - 1].word
        kind = next((word.word for word in words[:at - 1] if word.word in _ROUTINES), "proc")
        self.scan.bodies.append(Routine(name, len(self.scan.move), kind, self.scan.scope, local=words[0].word == "local"))
        parameters = self.scan.routines.setdefault(name, [])
        group: list[Token] = []
        optional, position = False, 0
        depth = 0
        for word in words[at + 1:]:
            depth += (word.word == "{") - (word.word == "}")
            if depth or word.word == "}":
                continue
            if word.word in (",", "|", ")"):
                if len(group) >= 2:
                    mode = group[0].word if group[0].word in _MODES else "in"
                    target = group[-1]
                    number = self.scan.names.add(Declaration(
                        target.word, group[-2].word, "parameter", mode, self.scan.scope, target.start, target.end))
                    parameters.append(Parameter(target.word if optional else position, mode, number))
                    position += not optional
                group, optional = [], optional and word.word == "|"
            elif word.word == "\\":
                optional = True
            elif word.kind == "name":
                group.append(word)

    def _statement(self, words: list[Token]) -> None:
        first = words[0]
        scope, uses = self.scan.scope, self.scan.uses
        if first.word in ("local", "task", *_CLASSES) and first.kind == "name":
            self._declaration(words)
        elif first.word in ARGUMENTS:
            self._move(words)
        elif first.word in ("if", "elseif"):
            self._compact_if(words)
        elif first.word == "alias" or first.word == ";":
            return
        else:
            self._complete(words)
            if first.word == "%":
                self._by_name(words)
            elif first.kind != "name":
                uses.reads(words, scope)
            elif uses.assignment(words, scope):
                self._step("set", first.word, first.start, words[-1].end)
            else:
                self._call(words)

    def _by_name(self, words: list[Token]) -> None:
        """`%name%` calls a routine by its name: one that stands there in quotes, or one that is made at run time."""
        written = words[1].kind == "string" and words[2].word == "%"
        behind = next((k + 1 for k, word in enumerate(words) if k and word.word == "%"), 1)
        name = self.scan.source.fold(words[1].text.strip(b'"')) if written else "%"
        self.scan.uses.reads(words[:behind], self.scan.scope)
        self.scan.uses.reads(words[behind:], self.scan.scope, name)
        self._step("call", name, words[0].start, words[-1].end)

    def _step(self, kind: str, name: str, start: int, end: int) -> None:
        if self.scan.bodies and self.scan.scope.routine >= 0:
            self.scan.bodies[-1].steps.append(Step(len(self.scan.move), kind, name, start, end))

    def _call(self, words: list[Token]) -> None:
        name = words[0].word
        if name in JUMPS:
            self._step("jump", name, words[0].start, words[-1].end)
        elif name in SWITCHES or name not in HARMLESS:
            self._step("call", name, words[0].start, words[-1].end)
        if name in DISPLACEMENT:
            self.scan.shifts.append((len(self.scan.move), DISPLACEMENT[name]))
        elif name in SOFT_SERVO:
            self.scan.softened.append((len(self.scan.move), SOFT_SERVO[name]))
        elif name in AXIS_OFFSET:
            self.scan.offsets.append((len(self.scan.move), AXIS_OFFSET[name]))
        elif name in UNIT_SWITCH:
            self.scan.units.append((len(self.scan.move), words[1].word, UNIT_SWITCH[name], words[0].start))
        elif name in OVERRIDE:
            step = Step(len(self.scan.move), "call", name, words[0].start, words[-1].end)
            self.scan.overridden.append((step, self.scan.scope))
        elif name == "confl":
            self.scan.unmonitored |= any(word.word == "off" for word in words)
        elif MOTION.fullmatch(name):
            self.scan.others.append((name, words[0].start))
        self.scan.uses.reads(words[1:], self.scan.scope, name)
        if name in ("setdataval", "setalldataval"):     # they find their data by a name in a string
            text = next((word.text for word in words if word.kind == "string"), b"")
            self.scan.uses.assigned.add((self.scan.source.fold(text.strip(b'"')), self.scan.scope))

    def _compact_if(self, words: list[Token]) -> None:
        """`IF condition statement;`: the statement begins where a name follows a complete operand."""
        depth = 0
        for at in range(1, len(words)):
            word, before = words[at], words[at - 1]
            depth += (word.word in ("(", "[", "{")) - (word.word in (")", "]", "}"))
            if (at > 1 and not depth and word.kind == "name" and word.word not in OPERATORS and ends_operand(before)):
                self.scan.uses.reads(words[1:at], self.scan.scope)
                self._step("if", "", words[0].start, words[at - 1].end)
                self._statement(words[at:])
                self._step("endif", "", words[-1].start, words[-1].end)
                return
        self.scan.uses.reads(words[1:], self.scan.scope)

    def _move(self, words: list[Token]) -> None:
        name = words[0].word
        cursor = Cursor(self.scan.source, words, at=1)
        targets, tail = parse_move(cursor, name)
        number = self.scan.add_tail(tail)
        if name in ("movec", "movecdo"):
            self.scan.add_target(Move.ARC_VIA, targets[0], number)
            self.scan.add_target(Move.ARC_END, targets[1], number)
        else:
            self.scan.add_target(_MOVES[name], targets[0], number)

    def _declaration(self, words: list[Token]) -> None:
        """`[LOCAL|TASK] CONST|PERS|VAR type name[{dimensions}] [:= value];`"""
        at = int(words[0].word in ("local", "task"))
        if len(words) < at + 4 or words[at].word not in _CLASSES:
            return
        dimensions = 0
        equals = at + 3
        if words[equals].word == "{":
            while words[equals].word != "}" and words[equals].kind != "end":
                dimensions += words[equals].word in ("{", ",")
                equals += 1
            equals = min(equals + 1, len(words) - 1)
        value = (-1, -1)
        if words[equals].word == ":=" and words[equals + 1].word != ";":
            value = (words[equals + 1].start, words[-3].end)
            self._complete(words)
            self.scan.uses.reads(words[equals + 1:], self.scan.scope)
        name = words[at + 2]
        self.scan.names.add(Declaration(
            name.word, words[at + 1].word, words[at].word, words[0].word if at else "", self.scan.scope,
            words[0].start, words[-2].end, *value, dimensions))

    def _complete(self, words: list[Token]) -> None:
        """Raises CS2002 where a statement runs on into the next one."""
        for before, word in pairwise(words):
            if word.word in _FOREIGN and word.kind == "name" and before.word not in (".", "\\", "%", "<"):
                raise self.scan.source.fail(
                    "CS2002", f"the statement before '{word.text.decode('latin-1')}' does not end, expected ';'",
                    word.start, "a semicolon is missing at the end of the statement before")


