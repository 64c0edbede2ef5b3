"""Branches, loops and variables of random programs are followed as an interpreter of them that stands here drives them."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from compensator.rapid import read_rapid
from tests.compensator.rapid.small_programs import path, target

COMPARES = {"=": lambda a, b: a == b, "<": lambda a, b: a < b, ">": lambda a, b: a > b, "<>": lambda a, b: a != b}


@dataclass
class Author:
    """Writes a program, and what it does: a routine's body as a list of (what, ...) tuples."""

    draw: random.Random
    inputs: bool
    moves: int = 0
    left: int = 40
    forks: int = 0
    bodies: dict[str, list] = field(default_factory=dict)

    def routine(self, name: str, callable_: list[str]) -> str:
        text, self.bodies[name] = self.block(callable_, 3)
        return f"PROC {name}({'num nPart' if name != 'main' else ''})\n{text}\nENDPROC\n"

    def block(self, callable_: list[str], depth: int) -> tuple[str, list]:
        parts = [self.statement(callable_, depth) for _ in range(self.draw.randrange(1, 4))]
        return "\n".join(text for text, _ in parts), [does for _, does in parts]

    def value(self) -> tuple[str, object]:
        text = self.draw.choice(["nA", "nB", "2", "nPart", "nA+1"])
        return text, text

    def condition(self) -> tuple[str, tuple]:
        if self.inputs and self.forks < 4 and self.draw.random() < 0.4:
            self.forks += 1
            return "DInput(diAny)=1", ("input",)
        (a, one), sign, (b, two) = self.value(), self.draw.choice(list(COMPARES)), self.value()
        return f"{a}{sign}{b}", (sign, one, two)

    def statement(self, callable_: list[str], depth: int) -> tuple[str, tuple]:
        self.left -= 1
        kind = self.draw.random()
        if kind < 0.4 or depth == 0 or self.left < 0:
            self.moves += 1
            return f"MoveL {target(self.moves - 1)},v100,z1,tool0;", ("move", self.moves - 1)
        if kind < 0.5 and callable_:
            name, (text, value) = self.draw.choice(callable_), self.value()
            return f"{name} {text};", ("call", name, value)
        if kind < 0.62:
            name, (text, value) = self.draw.choice(["nA", "nB"]), self.value()
            return self.draw.choice([(f"{name}:={text};", ("set", name, value)), (f"Incr {name};", ("set", name, f"{name}+1"))])
        if kind < 0.68:
            return "RETURN;", ("return",)
        if kind < 0.85:
            arms, text = [], ""
            for number in range(self.draw.randrange(1, 4)):
                condition, holds = self.condition()
                body, does = self.block(callable_, depth - 1)
                text += f"{'ELSEIF' if number else 'IF'} {condition} THEN\n{body}\n"
                arms.append((holds, does))
            if self.draw.random() < 0.5:
                body, does = self.block(callable_, depth - 1)
                text, arms = text + f"ELSE\n{body}\n", [*arms, (("always",), does)]
            return text + "ENDIF", ("if", arms)
        if kind < 0.93:
            (text, value), cases = self.value(), []
            body, does = self.block(callable_, depth - 1)
            other, more = self.block(callable_, depth - 1)
            cases = [(("in", value, (1, 3)), does), (("always",), more)]
            return f"TEST {text}\nCASE 1,3:\n{body}\nDEFAULT:\n{other}\nENDTEST", ("if", cases)
        last, step = self.draw.randrange(0, 3), self.draw.choice([" STEP 1", ""])
        body, does = self.block(callable_, depth - 1)
        turns = list(range(1, last + 1)) if step or last >= 1 else [1, 0]
        return f"FOR nPart FROM 1 TO {last}{step} DO\n{body}\nENDFOR", ("for", turns, does)


@dataclass
class Robot:
    """Drives it. answers: what the input says each time it is asked."""

    bodies: dict[str, list]
    answers: Iterator[bool]
    globals: dict[str, float]
    driven: list[int] = field(default_factory=list)

    def value(self, text: str, own: dict) -> float:
        first, *plus = text.split("+")
        known = {**self.globals, **own}
        return (known[first] if first in known else float(first)) + sum(float(part) for part in plus)

    def holds(self, condition: tuple, own: dict) -> bool:
        if condition[0] in ("always", "input"):
            return condition[0] == "always" or next(self.answers)
        if condition[0] == "in":
            return self.value(condition[1], own) in condition[2]
        return COMPARES[condition[0]](self.value(condition[1], own), self.value(condition[2], own))

    def run(self, body: list, own: dict) -> bool:
        """Whether the routine has returned."""
        for what, *rest in body:
            if what == "move":
                self.driven.append(rest[0])
            elif what == "call":
                self.run(self.bodies[rest[0]], {"nPart": self.value(rest[1], own)})
            elif what == "set":
                self.globals[rest[0]] = self.value(rest[1], own)
            elif what == "return":
                return True
            elif what == "if":
                does = next((does for condition, does in rest[0] if self.holds(condition, own)), [])
                if self.run(does, own):
                    return True
            else:
                for value in rest[0]:
                    if self.run(rest[1], {**own, "nPart": value}):
                        return True
        return False


def written(seed: int, inputs: bool) -> tuple[Author, str]:
    author = Author(random.Random(seed), inputs)
    routines = [author.routine("rC", []), author.routine("rB", ["rC"]), author.routine("main", ["rB", "rC"])]
    data = "LOCAL VAR num nA:=1;\nLOCAL VAR num nB:=2;\nCONST num nPart:=3;\n"
    return author, f"MODULE M\n{data}{''.join(routines)}ENDMODULE\n"


def driven(author: Author, answers: list[bool]) -> tuple[int, ...] | None:
    """None where it asks more often than there are answers, or not so often."""
    left = iter(answers)
    robot = Robot(author.bodies, left, {"nA": 1.0, "nB": 2.0, "nPart": 3.0})
    try:
        robot.run(author.bodies["main"], {})
    except (StopIteration, RuntimeError):
        return None
    return None if next(left, None) is not None else tuple(robot.driven)


@pytest.mark.parametrize("seed", range(80))
def test_what_the_text_settles_is_followed(seed: int) -> None:
    author, text = written(seed, inputs=False)
    meant = driven(author, [])
    runs = read_rapid(text.encode()).runs
    assert [tuple(way.order.tolist()) for way in runs.ways] == [meant], text


@pytest.mark.parametrize("seed", range(80))
def test_every_way_that_inputs_may_lead_along_is_among_those_that_are_followed(seed: int) -> None:
    """Where there are few enough of them, and none goes on after eight answers."""
    author, text = written(1000 + seed, inputs=True)
    meant = {driven(author, [bool(number >> k & 1) for k in range(count)]) for count in range(8) for number in range(2**count)}
    runs = read_rapid(text.encode()).runs
    if runs.open or driven(author, [True] * 8) is not None:
        return
    assert {tuple(way.order.tolist()) for way in runs.ways} >= meant - {None}, text


A, B, C = (f"MoveL {target(place)},v100,z1,tool0;\n" for place in (1, 2, 3))


@pytest.mark.parametrize(("body", "declared", "driven"), [
    (f"n:=2;\nIF n=2 THEN\n{A}ELSE\n{B}ENDIF\n{C}", "VAR num n:=1;", [0, 2]),
    (f"n:=2;\nn:=3;\nIF n=2 THEN\n{A}ELSE\n{B}ENDIF\n{C}", "VAR num n:=1;", [1, 2]),
    (f"b:=TRUE;\nIF b THEN\n{A}ELSE\n{B}ENDIF\n{C}", "VAR bool b;", [0, 2]),
    (f"{A}rSub 2;\n{C}ENDPROC\nPROC rSub(num k)\nk:=k+1;\nIF k=3 THEN\n{B}ENDIF", "", [0, 2, 1]),
    (f"{A}rSub 2;\n{C}ENDPROC\nPROC rSub(num k)\nk:=k+1;\nIF k=2 THEN\n{B}ENDIF", "VAR num k:=2;", [0, 1])])
def test_the_moves_that_are_driven_by_what_the_program_itself_assigns(body, declared, driven) -> None:
    """The value that was assigned last, of a parameter that of this call."""
    found = path(body, declared).driven
    assert found is not None
    assert found.tolist() == driven


@pytest.mark.parametrize("main_first", [True, False])
@pytest.mark.parametrize(("before", "turns"), [("", set()), (A, set(range(9)))])
def test_a_loop_whose_calls_drive_all_moves_is_the_cell_that_waits_for_the_next_part(
        before: str, turns: set[int], main_first: bool) -> None:
    """Of one with a move beside it each number of turns is a way of its own; wherever the routines stand in the text."""
    routines = [f"PROC main()\n{before}WHILE bReady DO\nrPart;\nENDWHILE\nENDPROC\n",
                f"PROC rPart()\n{B}rEnd;\nENDPROC\n", f"PROC rEnd()\n{C}ENDPROC\n"]
    text = "".join(routines if main_first else routines[::-1])
    read = read_rapid(f"MODULE M\n{text}ENDMODULE\n".encode()).toolpath
    assert {way.turns[0] for way in read.ways} == turns
    assert (None if read.driven is None else read.driven.tolist()) == (None if main_first else [*range(len(read))][::-1])


@pytest.mark.parametrize(("call", "ways"), [
    ("rPass;", {(1,)}), ("rPass\\bFine;", {(0, 1)}), ("rPass \\nDeep:=2;", {(1,)}), ("rPass\\nDeep:=2\\bFine;", {(0, 1)}),
    ("rPass; rPass\\bFine;", {(1, 0, 1)}), ("rPass\\bFine?bAny;", {(0, 1), (1,)})])
@pytest.mark.parametrize("asks", ["IF Present(bFine) THEN\n", "IF NOT (Present(bFine)=FALSE) THEN\n"])
def test_an_optional_argument_is_present_where_a_call_gives_it(call: str, ways: set[tuple[int, ...]], asks: str) -> None:
    """Of one that is handed on only if it is present itself (`?`) it is not known."""
    text = f"PROC main()\n{call}\nENDPROC\nPROC rPass(\\switch bFine,\\num nDeep)\n{asks}{A}ENDIF\n{B}ENDPROC\n"
    found = read_rapid(f"MODULE M\n{text}ENDMODULE\n".encode()).runs.ways
    assert {tuple(way.order.tolist()) for way in found} == ways
