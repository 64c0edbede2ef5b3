"""Routines of one name in several modules: each call drives that of its own module."""

from __future__ import annotations

import pytest

from compensator.rapid import read_rapid
from tests.compensator.rapid.small_programs import target


def move(number: int) -> str:
    return f"MoveL {target(number)},v100,z1,tool0;\n"


def modules(*bodies: str) -> bytes:
    return "".join(f"MODULE M{number}\n{body}ENDMODULE\n" for number, body in enumerate(bodies)).encode()


def local(number: int) -> str:
    return f"LOCAL PROC cut()\n{move(number)}ENDPROC\n"


@pytest.mark.parametrize(("main", "driven"), [
    ("goB;\ngoA;\n", [1, 0]), ("goA;\ngoB;\ngoA;\n", [0, 1, 0]), ("cut;\ngoB;\n", [0, 1])])
def test_a_call_means_the_routine_of_its_own_module(main: str, driven: list[int]) -> None:
    """Targets count in the order of the text: 0 is the first module's."""
    read = read_rapid(modules(
        f"{local(7)}PROC goA()\ncut;\nENDPROC\nPROC main()\n{main}ENDPROC\n", f"{local(9)}PROC goB()\ncut;\nENDPROC\n"))
    assert [way.order.tolist() for way in read.runs.ways] == [driven]


def test_a_call_from_a_module_without_one_is_not_followed() -> None:
    read = read_rapid(modules(f"PROC main()\ncut;\n{move(1)}ENDPROC\n", local(7), local(9)))
    assert read.runs.ways == ()
