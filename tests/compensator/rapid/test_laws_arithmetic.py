"""Arithmetic of constants in targets, held against Python's own."""

from __future__ import annotations

import random

import numpy as np
import pytest

from compensator.rapid import read_rapid, rewrite
from tests.compensator.rapid.small_programs import millimetres, path, target

REST = "[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
DATA = (f"CONST robtarget pA:=[[100,200,300],{REST};\nCONST num nA:=12.5;\nCONST num nB:=nA*2-1;\nPERS num nPers:=3;\n"
        "VAR num nVar:=3;")


def position(target: str) -> np.ndarray:
    """Of the only target [mm]."""
    text = f"MODULE M\n{DATA}\nPROC main()\nMoveL {target},v100,z1,tool0;\nENDPROC\nENDMODULE\n"
    return 1e3 * read_rapid(text.encode()).toolpath.position[0]


def expression(draw: random.Random, depth: int) -> str:
    if depth == 0 or draw.random() < 0.2:
        return draw.choice(["nA", "nB", "7", "0.25", "1.5E1", "(nA)", "(-nB)", "(-3)"])
    left, right = (expression(draw, depth - 1) for _ in range(2))
    return draw.choice([f"{left}+{right}", f"{left} - ({right})", f"{left}*({right})", f"({left})/({right})", f"(-({left}))"])


@pytest.mark.parametrize("seed", range(60))
def test_an_expression_of_constants_has_its_value(seed: int) -> None:
    text = expression(random.Random(seed), 4)
    try:
        meant = eval(text, {"nA": 12.5, "nB": 24.0})
    except ZeroDivisionError:
        meant = np.nan
    np.testing.assert_allclose(position(f"Offs(pA,0,{text},0)"), [100, 200 + meant, 300] if np.isfinite(meant) else np.nan,
                               rtol=1e-12)


@pytest.mark.parametrize("text", ["nVar+1", "2*nPers", "Abs(nA)", "nA-nC", "(1+nVar)", "nA DIV 5", "1/(nA-12.5)",
                                  "pA.trans.x-1", "nList{1}+1", "nA/0"])
def test_what_the_text_does_not_settle_stays_open(text: str) -> None:
    assert np.isnan(position(f"Offs(pA,{text},0,0)")).any()


@pytest.mark.parametrize(("text", "value"), [("100 DIV 3", 33), ("7 mod 4 + 93", 96), ("2*(50 DIV 4)", 24), ("9 MOD 3", 0)])
def test_whole_numbers_have_a_quotient_and_a_rest(text: str, value: float) -> None:
    assert position(f"Offs(pA,{text},0,0)")[0] == 100 + value


def test_constants_that_need_each_other_stay_open() -> None:
    text = f"MODULE M\n{DATA}\nCONST num nX:=nY+1;\nCONST num nY:=nX+1;\nPROC main()\n" \
           "MoveL Offs(pA,nX+1,0,0),v100,z1,tool0;\nENDPROC\nENDMODULE\n"
    assert np.isnan(read_rapid(text.encode()).toolpath.position).any()


def test_the_corrected_target_stands_in_place_of_the_expression() -> None:
    text = f"MODULE M\n{DATA}\nPROC main()\nMoveL Offs(pA,-nA,2*nA,0),v100,z1,tool0;\nENDPROC\nENDMODULE\n"
    program = read_rapid(text.encode())
    moved = program.toolpath.position + np.array([0, 0, 1e-4])
    written = rewrite(program, np.array([0]), moved, program.toolpath.quaternion, program.toolpath.confdata).content.decode()
    assert "MoveL [[87.5000,225.0000,300.1000]," in written
    assert written.replace(written[written.index("[[87.5"):written.index(",v100")], "Offs(pA,-nA,2*nA,0)") == text


@pytest.mark.parametrize(("text", "value"), [
    ("nSum", 2), ("nSame", 1), ("nOwn", 100), ("nSum+nOwn", 102), ("nDeep", 5), ("nOver", 3), ("nOver+0", 3),
    ("2*nOver-nDeep", 1)])
def test_the_names_in_a_constant_are_those_of_where_it_is_declared(text: str, value: float) -> None:
    """Though the routine that asks for it has constants of the same names: where the robot goes, and which element it is."""
    data = (f"CONST num nOwn:=1;\nCONST num nSum:=nOwn+1;\nCONST num nSame:=nOwn;\nCONST num nDeep:=2*nSum+nSame;\n"
            f"CONST robtarget p:={target()};\nCONST robtarget pts{{102}}:=[{','.join(target(k + 1) for k in range(102))}];")
    body = (f"CONST num nOwn:=100;\nCONST num nOver:=nSum+1;\nMoveL Offs(p,0,0,{text}),v100,z1,tool0;\n"
            f"MoveL pts{{{text}}},v100,z1,tool0;")
    assert millimetres(path(body, data)) == [[0, 0, value], [value, 0, 0]]


def test_a_constant_of_the_routine_may_have_the_name_of_one_that_it_needs() -> None:
    data = f"CONST num nOwn:=1;\nCONST num nSum:=nOwn+1;\nCONST robtarget p:={target()};"
    body = "CONST num nOwn:=nSum+1;\nMoveL Offs(p,0,0,nOwn+0),v100,z1,tool0;"
    assert millimetres(path(body, data)) == [[0, 0, 3]]
    assert path("MoveL Offs(p,0,0,nOwn+0),v100,z1,tool0;", data.replace(":=1", ":=nSum")).block[0]
