"""Conditions of branches, held against Python's own, with every value that an unknown may have."""

from __future__ import annotations

import random

import pytest

from compensator.rapid import read_rapid
from tests.compensator.rapid.small_programs import target

DATA = "CONST num nA:=3;\nCONST num nB:=nA*2;\nCONST bool bYes:=TRUE;\nLOCAL VAR bool bNo;\n"
PYTHON = {"nA": 3, "nB": 6, "bYes": True, "bNo": False, "TRUE": True, "FALSE": False}
COMPARES = {"=": "==", "<>": "!=", "<": "<", ">": ">", "<=": "<=", ">=": ">="}


def driven(condition: str) -> set[int]:
    """The moves that may be driven of IF ... 0 ELSE 1."""
    moves = [f"MoveL {target(number)},v100,z1,tool0;" for number in range(2)]
    text = f"MODULE M\n{DATA}PROC main()\nIF {condition} THEN\n{moves[0]}\nELSE\n{moves[1]}\nENDIF\nENDPROC\nENDMODULE\n"
    return {int(way.order[0]) for way in read_rapid(text.encode()).runs.ways}


def logical(draw: random.Random, depth: int) -> tuple[str, str]:
    """A condition in RAPID and in Python; u is an input."""
    if depth == 0 or draw.random() < 0.2:
        if draw.random() < 0.4:
            return draw.choice([("bYes", "bYes"), ("bNo", "bNo"), ("TRUE", "True"), ("DInput(diU)=1", "u")])
        sign = draw.choice(list(COMPARES))
        a, b = draw.choice(["nA", "nB", "nA+1", "6 DIV 2"]), draw.choice(["3", "nA*2", "4", "(nB)"])
        return f"{a}{sign}{b}", f"({a.replace('DIV', '//')}{COMPARES[sign]}{b})"
    (a, one), (b, two) = (logical(draw, depth - 1) for _ in range(2))
    kind = draw.choice(["AND", "OR", "XOR", "NOT"])
    return {"AND": (f"({a}) AND ({b})", f"({one} and {two})"), "OR": (f"({a}) OR ({b})", f"({one} or {two})"),
            "XOR": (f"({a}) XOR ({b})", f"({one} != {two})"), "NOT": (f"NOT ({a})", f"(not {one})")}[kind]


@pytest.mark.parametrize("seed", range(60))
def test_a_condition_decides_where_it_is_known(seed: int) -> None:
    condition, python = logical(random.Random(seed), 3)
    meant = {0 if eval(python, {**PYTHON, "u": u}) else 1 for u in (True, False)}
    found = driven(condition)
    assert found >= meant
    if "diU" not in condition:
        assert found == meant


@pytest.mark.parametrize(("condition", "meant"), [
    ("bNo AND DInput(diU)=1", {1}), ("DInput(diU)=1 AND bNo", {1}), ("bYes OR DInput(diU)=1", {0}), ("nA=3 AND bYes", {0}),
    ("bNo OR nA=3 AND bYes", {0}), ("NOT bNo AND bNo", {0, 1}),     # by the table of priorities TRUE, by the grammar FALSE
    ("DInput(diU)=1", {0, 1}), ("nC=3", {0, 1}), ("bYes=3", {0, 1}), ("sName=\"x\"", {0, 1}), ("nA", {0, 1}),
])
def test_what_binds_first_and_what_stays_open(condition: str, meant: set[int]) -> None:
    assert driven(condition) == meant


@pytest.mark.parametrize(("deep", "settled"), [(36, True), (44, False)])
def test_parentheses_are_followed_forty_deep(deep: int, settled: bool) -> None:
    """In conditions, and in the bounds of loops."""
    assert driven(f"{'(' * deep}bYes{')' * deep}") == ({0} if settled else {0, 1})
    text = f"MODULE M\nPROC main()\nFOR i FROM 1 TO {'(' * deep}3{')' * deep} DO\nrCut;\nENDFOR\nENDPROC\n" \
           f"PROC rCut()\nMoveL {target(0)},v100,z1,tool0;\nENDPROC\nENDMODULE\n"
    assert (len(read_rapid(text.encode()).runs.ways) == 1) == settled
